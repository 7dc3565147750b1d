"""``python -m granswim_pymunk.validation.pucks --out DIR --seed S --count N [--real]``: films of colliding pucks.

Four to six pucks that meet three to ten times, filmed at 240 frames a second with 0.3 mm of noise, simulated by
``hard_disks``. The scene that comes with a film knows ``contact_elastic`` alone; what is left out is a lower
restitution, dry friction of the table, a repulsion with drag, friction of the contacts, or nothing. Impacts are
ideal, or with ``--real`` up to 0.2 ms late or spread over up to 0.4 ms, and all radii are off by 0.5 %.

DIR gets a folder for each recording, named by its number alone; the truth of all of them goes to another file.
``--diagnose VERDICTS`` runs ``granswim diagnose`` on the recordings of DIR, each in a process of its own, and goes on
where it was stopped; ``--slice k/n`` takes the k-th of n parts of them, in rising order.
``--score VERDICTS --truth FILE`` holds VERDICTS/NAME/verdict.json against the truth.
With ``--csv FILE`` the table of all films begun goes there after each of them; ``--told FILE ...`` prints what such
tables say together.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from granswim_pymunk.commands.prove import parse_slice
from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.proof.prove import diagnose_alone, sliced
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.scene import Body, Scene, use

from .hard_disks import Flight, Impacts, Physics, Table, run
from .output import write_json
from .spent import core_seconds

RATE, NOISE = 240.0, 3e-4  # frames a second, m
BELIEVED = 0.95  # restitution
OFF = 0.005  # relative error of radii where impacts are real
LATE, LASTING = 2e-4, 4e-4  # s; an impulse spread over 0.4 ms comes 0.2 ms late in the mean
TRAINING = 0.6  # of the time
FEWEST, MOST = 3, 10  # impacts
WITHIN = 60.0  # s, that a diagnosis may take
SHOWN = 5.0  # rms departure from the naive path over the noise, in the training part
EFFECTS = ("restitution", "substrate", "repulsion", "contact_friction", "nothing")
LAYOUTS = ("open", "posts", "box")
# what says the same of such a film
EQUAL = {
    "restitution": (), "coulomb_substrate": ("rolling_resistance",), "contact_friction": (), "distance_force": (),
    "linear_drag": ("quadratic_drag", "ambient_flow"),
}  # fmt: skip


@dataclass(frozen=True)
class Puck:
    """A drawn film: recording and truth."""

    recording: Recording
    truth: dict[str, Any]


# ---- drawing --------------------------------------------------------------------------------------


def physics_of(effect: str, table: Table, speed: float, rng: np.random.Generator) -> tuple[Physics, list[dict]]:
    """The true physics of a film and the mechanisms it takes, named as in the contract."""
    naive = Physics(restitution=BELIEVED)
    if effect == "restitution":
        return replace(naive, restitution=0.75), [{"name": "restitution", "values": {"restitution": 0.75}}]
    if effect == "substrate":
        return replace(naive, substrate=0.03), [{"name": "coulomb_substrate", "values": {"mu": 0.03}}]
    if effect == "contact_friction":
        return replace(naive, contact_friction=0.25), [{"name": "contact_friction", "values": {"mu": 0.25}}]
    if effect == "repulsion":
        moving = ~table.fixed
        # posts repel as well: r_0 of a law between bodies is the mean radius of all that it acts on
        mass, r_0 = float(table.mass[moving].mean()), float(table.radius.mean())
        c, n = _short(mass * rng.uniform(0.15, 0.5)), _short(rng.uniform(2.0, 4.0))
        # the potential of two touching pucks, s r_0/(n - 1) 2^(1 - n), is a share of their kinetic energy
        s = _short(rng.uniform(0.1, 0.35) * mass * speed**2 * (n - 1) * 2 ** (n - 1) / r_0)
        named = [{"name": "distance_force", "values": {"s": s, "n": n}}, {"name": "linear_drag", "values": {"c": c}}]
        return replace(naive, drag=c, repulsion=(s, n, r_0)), named
    return naive, []


def _short(value: float) -> float:
    return float(f"{value:.4g}")


def draw_table(rng: np.random.Generator, layout: str) -> tuple[Table, np.ndarray, float]:
    """A table, starts (n, 4), and the mean speed [m/s]: pucks on a ring, aimed at its middle with some error."""
    count = int(rng.integers(4, 7))
    posts = int(rng.integers(2, 5)) if layout == "posts" else 0
    radius = np.round(np.concatenate([rng.uniform(0.02, 0.035, count), rng.uniform(0.015, 0.04, posts)]), 4)
    mass = np.array([_short(m) for m in radius**2 * rng.uniform(50.0, 110.0, count + posts)])
    start = np.zeros((count + posts, 4))
    turn = rng.uniform(0, 2 * math.pi)
    for k in range(count):
        at = turn + 2 * math.pi * (k + rng.uniform(-0.25, 0.25)) / count
        place = rng.uniform(0.14, 0.3) * np.array([math.cos(at), math.sin(at)])
        way = math.atan2(-place[1], -place[0]) + rng.normal() * 0.25
        start[k, :2], start[k, 2:] = place, rng.uniform(0.3, 0.8) * np.array([math.cos(way), math.sin(way)])
    for k in range(posts):
        at = turn + 2 * math.pi * (k + rng.uniform(0.3, 0.7)) / posts
        start[count + k, :2] = rng.uniform(0.15, 0.4) * np.array([math.cos(at), math.sin(at)])
    start = np.round(start, 4)
    walls: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()
    if layout == "box":
        x, y = (float(v) for v in np.round(rng.uniform(0.3, 0.42, 2), 3))
        corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
        walls = tuple(zip(corners, [*corners[1:], corners[0]], strict=True))
        start[:, :2] = np.clip(start[:, :2], [-x + 0.05, -y + 0.05], [x - 0.05, y - 0.05])
    fixed = np.arange(count + posts) >= count
    return Table(radius, mass, fixed, walls), start, float(np.hypot(*start[:count, 2:].T).mean())


def apart_at_start(table: Table, start: np.ndarray) -> bool:
    """Whether no two disks are within 5 mm of each other."""
    i, j = np.triu_indices(len(start), 1)
    gap = np.hypot(*(start[i, :2] - start[j, :2]).T) - table.radius[i] - table.radius[j]
    return bool(gap.min() > 5e-3)


def draw(number: int, effect: str, real: bool, layouts: Sequence[str] = LAYOUTS[:2]) -> Puck:
    """The film ``number``: its apparatus is drawn until pucks meet often enough and the effect shows."""
    rng = np.random.default_rng((20, number, int(real)))
    for _ in range(2000):
        layout = layouts[int(rng.integers(len(layouts)))]
        table, start, speed = draw_table(rng, layout)
        if not apart_at_start(table, start):
            continue
        t = round(float(rng.uniform(0.1, 2.0)), 4) + np.arange(int(rng.uniform(1.0, 1.5) * RATE)) / RATE
        physics, effects = physics_of(effect, table, speed, rng)
        true, impacts = table, Impacts()
        if real:
            true = replace(table, radius=table.radius * (1 + OFF * rng.normal(size=len(table.radius))))
            impacts = Impacts(late=LATE) if rng.random() < 0.5 else Impacts(lasting=LASTING)
        try:
            flight = run(true, physics, start, t, impacts, rng)
            early = sum(touch[0] <= t[0] + TRAINING * (t[-1] - t[0]) for touch in flight.touches)
            if not FEWEST <= len(flight.touches) <= MOST or early < 2:
                continue
            naive = run(table, Physics(restitution=BELIEVED), start, t)
        except SimulationError:
            continue
        part = slice(0, int(TRAINING * len(t)))
        shown = float(np.sqrt(np.mean((flight.xy[part] - naive.xy[part])[:, ~table.fixed] ** 2))) / NOISE
        if not effects or shown > SHOWN:
            return _film(number, (layout, effects, shown, real), (table, true, impacts), start, t, flight, rng)
    raise SimulationError(f"no film of {effect} in 2000 draws")


def _film(
    number: int, drawn: tuple[str, list[dict], float, bool], tables: tuple[Table, Table, Impacts], start: np.ndarray,
    t: np.ndarray, flight: Flight, rng: np.random.Generator,
) -> Puck:  # fmt: skip
    layout, effects, shown, real = drawn
    table, true, impacts = tables
    name = f"pucks-{number:04d}"
    order = [f"p{k + 1}" for k in range(len(start))]
    bodies = tuple(
        Body(b, "wall", r, m, initial=(*map(float, s[:2]), 0.0, 0.0)) if fixed else Body(b, "free", r, m)
        for b, fixed, r, m, s in zip(order, table.fixed, table.radius, table.mass, start, strict=True)
    )
    moving = ~table.fixed
    seen = np.round(flight.xy[:, moving] + NOISE * rng.normal(size=(len(t), int(moving.sum()), 2)), 7)
    recording = Recording(
        name, Scene(bodies, (use("contact_elastic", restitution=BELIEVED),)), np.round(t, 7),
        tuple(b for b, m in zip(order, moving, strict=True) if m), seen, title="pucks on a table", sampling=RATE,
        position_noise=NOISE,
    )  # fmt: skip
    truth = {
        "name": name, "layout": layout, "real": real, "effects": effects, "shown": shown,
        "impacts": [{"t": a, "pair": [order[i], order[j] if j < len(order) else f"wall {j - len(order)}"],
                     "closing": c, "slip": s} for a, i, j, c, s in flight.touches],
        "late": impacts.late, "lasting": impacts.lasting, "radius": dict(zip(order, true.radius.tolist(), strict=True)),
        "start": dict(zip(order, start.tolist(), strict=True)), "walls": table.walls,
    }  # fmt: skip
    return Puck(recording, truth)


def effects_of(seed: int, count: int) -> list[str]:
    """Which effect each film hides: all five in every five, in an order that the number does not tell."""
    rng = np.random.default_rng((21, seed))
    return [e for _ in range(0, count, len(EFFECTS)) for e in rng.permutation(EFFECTS)][:count]


def write(puck: Puck, out: Path) -> None:
    """The folder of one recording."""
    folder = write_recording(puck.recording, out / puck.recording.name)
    walls = puck.truth["walls"]
    if walls:
        lines = [f"\n[[wall]]\nfrom = {list(a)}\nto = {list(b)}\n" for a, b in walls]
        with (folder / "recording.toml").open("a", encoding="utf-8") as file:
            file.write("".join(lines))


# ---- scoring --------------------------------------------------------------------------------------


def judged(truth: Mapping[str, Any], verdict: Mapping[str, Any] | None) -> str:
    """right | class | part | wrong | silent | none.

    class : what is named is the same on such films, or the verdict says that it cannot be told from the truth
    part : of a repulsion with drag one of the two alone;  silent : real, but nothing with a name;  none : no verdict
    A further name that was not drawn makes an answer wrong.
    """
    if verdict is None:
        return "none"
    wanted = [e["name"] for e in truth["effects"]]
    named = list(dict.fromkeys(m["name"] for m in verdict["mechanisms"]))
    if not wanted:
        return "right" if verdict["verdict"] in ("no_mismatch", "recalibrate") else "wrong"
    if verdict["verdict"] in ("no_mismatch", "recalibrate", "unmodelled"):
        return "silent"
    if set(named) == set(wanted) and verdict["verdict"] == "missing_physics":
        return "right"
    alike = {r["name"] for r in verdict.get("rivals", []) if r.get("indistinguishable")}
    # each name stands for one wanted: itself, its equal, or (of a single one) what the verdict cannot tell from it
    stands = {n: next((w for w in wanted if n == w or n in EQUAL[w]), None) for n in named}
    if len(named) == len(wanted) == 1 and wanted[0] in alike:
        return "class"
    if None in stands.values():
        return "wrong"
    return "class" if set(stands.values()) == set(wanted) else "part"


@dataclass(frozen=True)
class Row:
    """A film that was begun: what it hides, what was answered, how that is judged.

    values, told : true numbers, and those of the verdict, as ``name=value`` each;  hold : of the numbers whose truth is
    known, those whose interval holds it, of how many
    core, wall : seconds of a core and by the clock, empty where it is not finished;  failed : why there is no verdict
    """

    film: str
    impacts_are: str
    hidden: str
    values: str
    impacts: str
    layout: str
    verdict: str
    named: str
    told: str
    judged: str
    complete: str
    heldout: str
    explained: str
    hold: str
    core: str
    wall: str
    failed: str

    @property
    def answer(self) -> str:
        return self.failed or f"{self.verdict} {self.named}".strip()


def row_of(truth: Mapping[str, Any], folder: Path) -> Row:
    """The row of a film whose verdict lies in a folder."""
    verdict, time = answer_in(folder)
    said: Mapping[str, Any] = verdict or {}
    share = (said.get("explained") or {}).get("share")
    hold, known, told = 0, 0, []
    named = dict.fromkeys(m["name"] for m in said.get("mechanisms", ()))
    values = {e["name"]: e.get("values", {}) for e in truth["effects"]}
    for m in said.get("mechanisms", ()):
        for name, told_of in m.get("parameters", {}).items():
            told.append(f"{name}={_few(told_of['value'])} ({_few(told_of['low'])} to {_few(told_of['high'])})")
            if (true := values.get(m["name"], {}).get(name)) is not None:
                known += 1
                low, high = (math.nan if told_of[end] is None else told_of[end] for end in ("low", "high"))
                hold += not (true < low or true > high)
    return Row(
        truth["name"], "real" if truth.get("real") else "ideal", " + ".join(values) or "nothing",
        " ".join(f"{k}={_few(v)}" for each in values.values() for k, v in each.items()), str(len(truth["impacts"])),
        truth["layout"], said.get("verdict", ""), " + ".join(named), "; ".join(told), judged(truth, verdict),
        str(said.get("complete", "")), said.get("heldout") or "", "" if share is None else f"{share:.2f}",
        f"{hold} of {known}" if known else "", _seconds(time.get("core")), _seconds(time.get("seconds")),
        time["failed"],
    )  # fmt: skip


def _few(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.0f}"


def score(truths: Sequence[Mapping[str, Any]], verdicts: Path) -> str:
    """A table of all films, and sums, as Markdown."""
    rows = [row_of(truth, verdicts / truth["name"]) for truth in truths]
    lines = ["| film | hidden | impacts | layout | answer | judged | complete | explained | core s | s |",
             "|---|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
    lines += [
        "| "
        + " | ".join(
            (r.film, r.hidden, r.impacts, r.layout, r.answer, r.judged, r.complete, r.explained, r.core, r.wall)
        )
        + " |"
        for r in rows
    ]
    return "\n".join([*lines, "", sums(rows)])


def sums(rows: Sequence[Row]) -> str:
    """How many were named right, in a sentence or two."""
    hidden = [r.judged for r in rows if r.hidden != "nothing"]
    nulls = [r.judged for r in rows if r.hidden == "nothing"]
    good = sum(h in ("right", "class") for h in hidden)
    told = (
        f"Right name {hidden.count('right')} of {len(hidden)}, right name or class {good}, one of two "
        f"{hidden.count('part')}, wrong name {hidden.count('wrong')}, no name {hidden.count('silent')}, no verdict "
        f"{hidden.count('none')}. Nothing named in nothing: {nulls.count('right')} of {len(nulls)}."
    )
    for what, seconds in (("Seconds", [r.wall for r in rows]), ("Seconds of a core", [r.core for r in rows])):
        if taken := [float(s) for s in seconds if s]:
            told += f" {what}: median {np.median(taken):.0f}, longest {max(taken):.0f}."
    return told


def told_together(files: Sequence[Path]) -> str:
    """A Markdown table of what tables of films say, a line for each kind of impacts, and what went wrong."""
    rows = [row for file in files for row in read_rows(file)]
    lines = ["| impacts | films | right name | name or class | of both only one | wrong | silent or none | nothing in "
             f"nothing | numbers that hold | core s: median, longest | within {WITHIN:.0f} s of a core |",
             "|---|---|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for kind in dict.fromkeys(r.impacts_are for r in rows):
        mine = [r for r in rows if r.impacts_are == kind]
        some, none = ([r.judged for r in mine if (r.hidden == "nothing") is null] for null in (False, True))
        hold = [tuple(map(int, r.hold.split(" of "))) for r in mine if r.hold]
        core = [float(r.core) for r in mine if r.core]
        good = sum(j in ("right", "class") for j in some)
        cells = [
            kind, f"{len(mine)}", f"{some.count('right')} of {len(some)}", f"{good} of {len(some)}",
            f"{some.count('part')}", f"{some.count('wrong')}", f"{some.count('silent') + some.count('none')}",
            f"{none.count('right')} of {len(none)}", f"{sum(a for a, _ in hold)} of {sum(b for _, b in hold)}",
            f"{np.median(core):.0f}, {max(core):.0f}" if core else "",
            f"{sum(c <= WITHIN for c in core)} of {len(core)}",
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    wrong = [f"- {r.film} ({r.impacts_are}): {r.hidden} {r.values}: {r.answer} {r.told}".rstrip()
             for r in rows if r.judged not in ("right", "class")]  # fmt: skip
    return "\n".join([*lines, "", *wrong])


def write_rows(rows: Sequence[Row], file: Path) -> None:
    """A table of films. Raises InputError where it cannot be written."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(Row)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text.getvalue(), encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write it: {error.strerror}", file=file) from None


def read_rows(file: Path) -> list[Row]:
    """What ``write_rows`` wrote. Raises InputError where it is no such table."""
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            return [Row(**row) for row in csv.DictReader(stream)]
    except (OSError, TypeError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the table: {error}", file=file) from None


def answer_in(folder: Path) -> tuple[dict[str, Any] | None, dict[str, Any]]:
    """The verdict in a folder (or None), what is known of its time, and as ``failed`` why there is none."""
    time = json.loads((folder / "time.json").read_text()) if (folder / "time.json").exists() else {}
    file = folder / "verdict.json"
    verdict = json.loads(file.read_text(encoding="utf-8")) if file.exists() else None
    return verdict, time | {"failed": "" if verdict else time.get("failed") or "no verdict"}


# ---- the command ----------------------------------------------------------------------------------


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the recordings")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="number of the first film")
    parser.add_argument("--count", type=int, metavar="N", help="films to draw")
    parser.add_argument("--real", action="store_true", help="impacts that are late or last, radii that are off")
    parser.add_argument("--layout", choices=(*LAYOUTS, "mixed"), default="mixed", help="mixed: open or posts")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="the truth (default: DIR.json)")
    parser.add_argument("--diagnose", type=Path, metavar="VERDICTS", help="diagnose the recordings of DIR")
    parser.add_argument("--slice", metavar="K/N", help="of the recordings to diagnose, the K-th of N parts")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="where the table of all films begun goes")
    parser.add_argument("--told", type=Path, nargs="+", metavar="FILE", help="print what such tables say together")
    parser.add_argument("--minutes", type=float, metavar="M", help="budget of each diagnosis")
    parser.add_argument("--score", type=Path, metavar="VERDICTS", help="hold these verdicts against the truth")
    args = parser.parse_args(argv)
    try:
        return _main(args, say)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _diagnose(folder: Path, kept: Path, minutes: float | None, say: Callable[[str], None]) -> None:
    """Diagnose a recording, unless that was finished before; that it was begun is written down first."""
    file = kept / "time.json"
    if file.exists() and "seconds" in json.loads(file.read_text()):
        return
    kept.mkdir(parents=True, exist_ok=True)
    write_json({"failed": "begun, not finished"}, file)
    before = core_seconds()
    result = diagnose_alone([folder.resolve()], kept, minutes)
    core = core_seconds() - before
    write_json({"seconds": round(result["seconds"], 1), "core": round(core, 1), "failed": result["failed"]}, file)
    said = result["failed"] or result["verdict"]["verdict"]
    say(f"{folder.name}: {said} ({result['seconds']:.0f} s, {core:.0f} s of a core)")


def _main(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    if args.told:
        say(told_together(args.told))
        return 0
    if args.out is None and args.truth is None:
        raise InputError("needs --out DIR, or --truth FILE with --score", where="pucks")
    truth_file: Path = args.truth or args.out.with_name(f"{args.out.name}.json")
    if args.count is not None:
        if args.out is None or args.count < 1 or args.seed < 0:
            raise InputError("needs --out DIR, a count of one or more, and a seed of zero or more", where="--count")
        layouts = LAYOUTS[:2] if args.layout == "mixed" else (args.layout,)
        truths = json.loads(truth_file.read_text()) if truth_file.exists() else []
        for k, effect in enumerate(effects_of(args.seed, args.count)):
            puck = draw(args.seed + k, effect, args.real, layouts)
            write(puck, args.out)
            truths = [t for t in truths if t["name"] != puck.recording.name] + [puck.truth]
            write_json(sorted(truths, key=lambda t: t["name"]), truth_file)
            say(f"{args.out / puck.recording.name}")
        say(f"truth: {truth_file}")
    verdicts = args.score or args.diagnose
    try:
        truths = json.loads(truth_file.read_text(encoding="utf-8")) if verdicts is not None else []
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the truth: {error}", file=truth_file) from None

    def begun() -> list[Mapping[str, Any]]:
        return [t for t in truths if (verdicts / t["name"]).exists()]

    if args.diagnose is not None:
        if args.out is None:
            raise InputError("needs --out DIR with the recordings", where="--diagnose")
        films = sorted(p.parent for p in args.out.glob("*/recording.toml"))
        if args.slice:
            mine = sliced([("pucks", k) for k in range(len(films))], *parse_slice(args.slice))
            films = [films[k] for _, k in mine]
        for folder in films:
            _diagnose(folder, args.diagnose / folder.name, args.minutes, say)
            if args.csv is not None:
                write_rows([row_of(t, verdicts / t["name"]) for t in begun()], args.csv)
    elif verdicts is not None and args.csv is not None:
        write_rows([row_of(t, verdicts / t["name"]) for t in begun()], args.csv)
    if verdicts is not None:
        say(score(begun() if args.diagnose else truths, verdicts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
