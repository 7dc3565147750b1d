"""``python -m granswim_pymunk.validation.bed_effects [NAME ...] --out DIR``: known effects in full beds, diagnosed.

The paper's bed of some 2200 grains, every one packed and numbered anew, simulated by the proof's own code, filmed for
0.6 s at about 500 frames a second with 20 micrometres of noise; then ``granswim diagnose`` in another process, which is
given the recording folder and nothing else. One folder a case; finished ones are not run again. These strengths are
chosen, not drawn: what is drawn and sealed is scored by ``granswim prove``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import granswim_pymunk
from granswim_pymunk.files import written_whole
from granswim_pymunk.proof.bed_cases import seen_recording, shown
from granswim_pymunk.proof.beds import BedSetup, digits, draw_bed, packed
from granswim_pymunk.proof.candidates import camera_of, physics_of
from granswim_pymunk.proof.fitting import with_adjusted
from granswim_pymunk.proof.windows import calibrated, film_of
from granswim_pymunk.proof.world import Effect
from granswim_pymunk.recording import write_recording
from granswim_pymunk.scene import Adjustable
from granswim_pymunk.validation.spent import core_seconds

DURATION = 0.6  # s
Values = Mapping[str, Any]


@dataclass(frozen=True)
class Row:
    """One line of the table.

    name : of the effect;  values : its numbers, SI;  moved : factors on true parameters, which nobody tells
    verdict : what must come out;  names : mechanisms that are right, those of its class included
    number : the parameter that is compared, and what it should be;  confined : under layers of grains
    masked : the adjustable numbers are fitted to the film beforehand;  known : nothing is adjustable
    """

    name: str
    values: Values
    verdict: str = "missing_physics"
    names: tuple[str, ...] = ()
    number: tuple[str, float] | None = None
    moved: tuple[tuple[str, float], ...] = ()
    bodies: tuple[str, ...] | None = None
    confined: bool = False
    masked: bool = False
    known: bool = False

    @property
    def key(self) -> str:
        return self.name + ("_masked" if self.masked else "")


ROWS = (
    Row("weak_joint", {"joint": 4, "factor": 0.5}, number=("factor", 0.5)),
    Row("actuator_lag", {"tau": 4e-3}, names=("actuator_delay", "time_offset"), number=("tau", 4e-3)),
    Row("actuator_delay", {"tau": 4e-3}, names=("actuator_lag", "time_offset"), number=("tau", 4e-3)),
    Row("actuator_saturation", {"limit": 0.6}, number=("limit", 0.6)),
    Row("resting_curvature", {"joint": 2, "phi_0": 0.1}, number=("phi_0", 0.1)),
    Row("nonlinear_bending", {"k_3": 2e-3}, number=("k_3", 2e-3)),
    Row("head_force", {"force": 1.5e-4, "axis": "fixed", "angle": 0.7}, number=("force", 1.5e-4)),
    Row("contact_friction", {"mu": 0.3}, number=("mu", 0.3)),
    Row("coulomb_substrate", {"mu": 0.3}, number=("mu", 0.3)),
    Row("restitution", {"times": 4.0}),
    Row("cohesion", {"force": 5e-5, "range": 1e-4}, number=("force", 5e-5)),
    Row("linear_drag", {"c": 6e-5, "p": 0}, number=("c", 6e-5)),
    Row("quadratic_drag", {"c": 1e-3, "p": 0}, number=("c", 1e-3)),
    Row("ambient_flow", {"c": 4e-5, "u": (0.08, 0.06)}),
    # a softer k_B imitates added mass
    Row("added_mass", {"beta": 0.4}, number=("beta", 0.4), known=True),
    Row("stiffness off", {}, "recalibrate", moved=(("bending.stiffness", 0.8),)),
    Row("mu_eff off", {}, "recalibrate", moved=(("confinement.mu_eff", 1.6),), confined=True),
    Row("nothing", {}, "no_mismatch"),
    Row("nothing, confined", {}, "no_mismatch", confined=True),
    Row("camera_scale", {"s": 0.01}, "measurement", ("camera_scale",)),
    Row("time_offset", {"offset": 4e-3}, "measurement", ("time_offset",)),
    Row("attraction", {"strength": 2e-6, "size": 8e-3}, "unmodelled"),
    Row("phase_drag", {"c": 2e-4, "phase": 1.0}, "unmodelled"),
    Row("quadratic_drag", {"c": 1e-3, "p": 0}, number=("c", 1e-3), confined=True, masked=True),
    Row("contact_friction", {"mu": 0.3}, number=("mu", 0.3), confined=True, masked=True),
)  # fmt: skip


def bed_of(row: Row, seed: int) -> BedSetup:
    """The first of the drawn beds with or without layers; k_B adjustable, mu_eff where there are layers."""
    for k in range(1000):
        setup = draw_bed(np.random.default_rng((seed, k)), "bed", False)
        if bool(setup.scene.laws_named("confinement")) == row.confined:
            break
    setup = film_in(setup)
    free = [("bending", "stiffness")] + ([("confinement", "mu_eff")] if row.confined else [])
    return adjustable(setup, free if not row.known else [])


def adjustable(setup: BedSetup, free: Sequence[tuple[str, str]]) -> BedSetup:
    """The same with these parameters, and no others, adjustable between 0.4 and 2.5 of what they are."""
    found = []
    for law, parameter in free:
        value = float(setup.scene.parameter(f"{law}.{parameter}"))
        found.append(Adjustable(law, parameter, digits(0.4 * value, 3), digits(2.5 * value, 3)))
    return replace(setup, scene=replace(setup.scene, adjustable=tuple(found)))


def film_in(setup: BedSetup) -> BedSetup:
    """The same, filmed for DURATION."""
    rate = 1 / float(np.median(np.diff(setup.t)))
    return replace(setup, t=np.round(setup.t[0] + np.arange(int(DURATION * rate) + 1) / rate, 7))


def effects_of(row: Row, setup: BedSetup) -> list[Effect]:
    values = dict(row.values)
    if not values:
        return []
    if row.name == "restitution":
        contact = setup.scene.laws_named("contact_linear")[0].values
        values = {"damping": float(contact["damping"]) * values["times"]}
    elif row.name == "attraction":
        assert setup.scene.periodic_x and setup.scene.bed
        values["centre"] = (0.6 * setup.scene.periodic_x, 0.35 * setup.scene.bed.height)
    elif row.name == "phase_drag":
        values["frequency"] = float(setup.scene.laws_named("bending")[0].values["frequency"])
    return [Effect(row.name, values, row.bodies)]


def make(row: Row, number: int, folder: Path) -> list[Path]:
    """The recording of a row, written if it is not there. Raises SimulationError where it cannot be simulated."""
    seed, target = 7000 + number, folder / f"recording-{number:02d}"
    if not (target / "recording.toml").exists():
        recorded(row, bed_of(row, seed), seed, target)
    return [target]


def recorded(row: Row, setup: BedSetup, seed: int, folder: Path) -> None:
    """Write the film of a bed, packed from ``seed``, with what the row conceals. Raises SimulationError."""
    rng = np.random.default_rng(seed)
    scene = replace(packed(setup.scene, seed), bed=None)
    true = with_adjusted(scene, {name: factor * float(scene.parameter(name)) for name, factor in row.moved})
    effects = effects_of(row, setup)
    xy = film_of(setup, true, physics_of(effects), camera_of(effects).time_offset)
    seen = shown(setup, xy, effects, rng)
    guess = {}
    for a in setup.scene.adjustable:
        off = 0.0 if row.moved else float(rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.06))
        guess[a.name] = float(scene.parameter(a.name)) * (1 + off)
    if row.masked:
        guess = calibrated(setup, scene, setup.t, seen, guess)
    belief = with_adjusted(scene, {name: digits(value) for name, value in guess.items()})
    write_recording(seen_recording(setup, belief, seen, folder.name), folder)


def diagnosed(recordings: Sequence[Path], out: Path, minutes: float) -> dict[str, Any]:
    """The verdict of ``granswim diagnose`` on recordings of one folder, in a process of its own.

    ``seconds``: by the clock;  ``cpu``: of a core, which other work beside it hardly changes
    ``code``, ``commit``: see the functions of these names
    """
    began, before, stamp = time.monotonic(), core_seconds(), {"code": code(), "commit": commit()}
    done = subprocess.run(
        [sys.executable, "-m", "granswim_pymunk", "diagnose", *(r.name for r in recordings), "--out",
         str(out.resolve()), "--minutes", f"{minutes:g}"],
        cwd=recordings[0].parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        return {"failed": done.stderr.strip().splitlines()[-1:] or ["no reason given"], **stamp}
    verdict: dict[str, Any] = json.loads((out / "verdict.json").read_text())
    spent = {"seconds": round(time.monotonic() - began), "cpu": round(core_seconds() - before)}
    return {"verdict": verdict, **spent, **stamp}


def commit() -> str:
    """The first digits of the checkout's commit, with a + where the package differs from it; "–" outside of one."""
    folder = Path(granswim_pymunk.__file__).parent

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(folder), *words], capture_output=True, text=True, check=True)
        return done.stdout.strip()

    try:
        return git("rev-parse", "--short=8", "HEAD") + "+" * bool(git("status", "--porcelain", "--", "."))
    except (OSError, subprocess.CalledProcessError):
        return "–"


def code() -> str:
    """Of the package's sources, comments and all: whether a result is of the code that is here."""
    folder = Path(granswim_pymunk.__file__).parent
    total = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        name = file.relative_to(folder).as_posix()
        if not name.startswith(("validation/", "benchmarks/", "scenarios/")):
            total.update(name.encode() + b"\0" + file.read_bytes() + b"\0")
    return total.hexdigest()[:12]


def judged(row: Row, verdict: Mapping[str, Any]) -> tuple[str, str]:
    """("right", "class" or "wrong", the numbers that were found)."""
    named = [m["name"] for m in verdict["mechanisms"]]
    first = named[0] if named else ""
    alike = [r["name"] for r in verdict["rivals"] if r["indistinguishable"]]
    said = ""
    if row.number is not None and first == row.name:
        p = verdict["mechanisms"][0]["parameters"].get(row.number[0])
        if p is not None and p["low"] is not None:
            inside = p["low"] <= row.number[1] <= p["high"]
            said = f"{p['value']:.3g} ({p['low']:.3g} to {p['high']:.3g}), {'holds' if inside else 'misses'}"
    if row.verdict == "no_mismatch" and verdict["verdict"] == "recalibrate":
        return "class", said  # what is adjustable is believed some per cent off: that may be told
    if len(named) > 1 and set(named) - {row.name, *row.names}:
        return "wrong", said  # a law that is not there is claimed beside it
    if row.verdict != verdict["verdict"]:
        same = row.verdict == "missing_physics" and set(named) & set(row.names)
        return ("class" if same else "wrong"), said
    if row.verdict == "missing_physics":
        if len(named) == 1 and first == row.name:
            return "right", said
        return ("class" if {first, *alike} & {row.name, *row.names} else "wrong"), said
    if row.verdict == "measurement":
        return ("right" if first in row.names else "wrong"), said
    return ("right" if not named or row.verdict == "unmodelled" else "wrong"), said


def where(verdict: Mapping[str, Any]) -> str:
    places = verdict["mismatch"]
    if not places:
        return "–"
    first = places[0]
    bodies = first["bodies"]
    region = (first["where"] or {}).get("region")
    return region or (f"body {bodies[0]}" if len(bodies) == 1 else f"{len(bodies)} bodies")


def told(row: Row) -> str:
    numbers = ", ".join(f"{k} = {v:g}" if isinstance(v, float | int) else f"{k} = {v}" for k, v in row.values.items())
    moved = ", ".join(f"{k} is {v:g} of what is believed" for k, v in row.moved)
    flags = "confined" * row.confined, "masked" * row.masked, "k_B known" * row.known
    extra = [x for x in (numbers, moved, *flags) if x]
    return f"{row.name.replace('_', ' ')}" + (f" ({'; '.join(extra)})" if extra else "")


TITLE = "Known effects in full beds"
ABOUT = (
    "Every line is a bed of its own (some 2200 grains, 0.6 s, 500 frames a second, 20 µm), simulated by the",
    "proof's code, not by the engine, and diagnosed in another process from the recording alone; two to four diagnoses",
    "at a time shared two cores. Strengths are chosen; drawn and sealed ones are in [proof.md](proof.md). Errors:",
    "held-out windows, rms of the swimmer's disks, µm.",
)


HEADER = (
    "concealed", "verdict", "named", "number, 95 %", "first place", "naive, recalibrated, revised, floor", "p", "s",
    "s of a core", "code", "",
)  # fmt: skip


def kept_lines(page: str | None, about: str) -> dict[str, str]:
    """The lines of a page that is there already, by their first cell; none where it is about something else."""
    text = Path(page).read_text() if page is not None and Path(page).exists() else ""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    if not lines or lines[0] != _line(HEADER) or about not in text:
        return {}
    return {line.split(" | ")[0].removeprefix("| "): line for line in lines[1:]}


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |".replace("|  |", "| |")


def table(
    rows: Sequence[Row], results: Mapping[str, Mapping[str, Any]], title: str, module: str, about: Sequence[str],
    kept: Mapping[str, str] | None = None,
) -> str:  # fmt: skip
    """The page of some rows. ``kept``: lines of an earlier page, which stay where there is no result."""
    lines = [
        f"# {title}",
        "",
        f"Made by `python -m granswim_pymunk.validation.{module} --out DIR --page FILE`; do not edit.",
        "",
        *about,
        "",
        _line(HEADER),
        "|" + "---|" * len(HEADER),
    ]
    count = {"right": 0, "class": 0, "wrong": 0}
    inside = total = 0
    for row in rows:
        result = results.get(row.key)
        if result is None and told(row) in (kept or {}):
            line = (kept or {})[told(row)]
            cells = line.removesuffix("|").split(" | ")
            count[cells[-1].strip()] += 1
            total += "holds" in cells[3] or "misses" in cells[3]
            inside += "holds" in cells[3]
            lines.append(line)
        if result is None:
            continue
        mark = str(result.get("commit", "–"))
        if "verdict" not in result:
            lines.append(_line([told(row), f"failed: {result['failed'][0]}", *[""] * 7, mark, "wrong"]))
            count["wrong"] += 1
            continue
        v = result["verdict"]
        how, said = judged(row, v)
        count[how] += 1
        total += bool(said)
        inside += "holds" in said
        named = ", ".join(m["name"] for m in v["mechanisms"]) or "–"
        alike = [r["name"] for r in v["rivals"] if r["indistinguishable"]]
        named += f" (or {', '.join(alike)})" if alike else ""
        held = v["fit"]["heldout"]
        errors = ", ".join(
            "–" if held[k] is None or not math.isfinite(held[k]) else f"{1e6 * held[k]:.0f}"
            for k in ("naive", "recalibrated", "revised", "noise_floor")
        )
        p = v["null"]["p_false_alarm"]
        lines.append(_line([
            told(row), v["verdict"], named, said or "–", where(v), errors, f"{p:.3f}", f"{result['seconds']}",
            f"{result['cpu']}", mark, how,
        ]))  # fmt: skip
    lines += [
        "",
        "code: the commit that the line was made with.",
        "",
        f"Right: {count['right']} of {sum(count.values())}; right class: {count['class']}; wrong: {count['wrong']}. "
        f"Intervals that hold the truth: {inside} of {total}.",
        "",
    ]
    return "\n".join(lines)


def keep(file: Path, result: Mapping[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(file) as stream:
        stream.write(json.dumps(result, indent=1).encode())


def run_rows(
    args: argparse.Namespace, rows: Sequence[Row], make: Callable[[Row, int, Path], list[Path]],
    say: Callable[[str], None],
) -> Iterator[dict[str, dict[str, Any]]]:  # fmt: skip
    """Results by the rows' keys: those that are in the folder, then again after each that is run.

    Rows without a result are run first, then those of other code; of ``names`` all that this code has no result of.
    """
    out, stamp = Path(args.out), code()
    files = {row.key: out / "results" / f"{row.key.replace(' ', '_').replace(',', '')}.json" for row in rows}
    results = {key: json.loads(file.read_text()) for key, file in files.items() if file.exists()}
    yield results
    wanted = [(n, row) for n, row in enumerate(rows) if not args.names or row.key in args.names]
    for number, row in sorted(wanted, key=lambda item: item[1].key in results):
        before = results.get(row.key, {})
        if before.get("code") == stamp:
            continue
        recordings = make(row, number, out / "recordings")
        result = diagnosed(recordings, out / "reports" / f"{number:02d}", args.minutes)
        for spent in ("seconds", "cpu"):  # where runs are there from a diagnosis by other code, what that one took
            result[spent] = max(result.get(spent, 0), before.get(spent, 0))
        keep(files[row.key], result)
        results[row.key] = result
        how = judged(row, result["verdict"])[0] if "verdict" in result else "failed"
        say(f"{row.key}: {how} ({result.get('seconds', 0)} s, {result.get('cpu', 0)} s of a core)")
        yield results


def run_table(
    args: argparse.Namespace, rows: Sequence[Row], make: Callable[[Row, int, Path], list[Path]], title: str,
    module: str, about: Sequence[str], say: Callable[[str], None],
) -> int:  # fmt: skip
    """Run the wanted rows; the page is written after every one of them, so that an interruption loses none."""
    for folder in (Path(args.out), Path(args.page or args.out).parent):
        folder.mkdir(parents=True, exist_ok=True)
    text, kept = "", kept_lines(args.page, about[0])
    for results in run_rows(args, rows, make, say):
        text = table(rows, results, title, module, about, kept)
        if args.page:
            Path(args.page).write_text(text)
    return tell(text, None, say)


def tell(text: str, page: str | None, say: Callable[[str], None]) -> int:
    if page:
        Path(page).write_text(text)
    say(text)
    return 0


def table_parser(doc: str | None, minutes: float) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=doc)
    parser.add_argument("names", nargs="*", metavar="NAME", help="rows of the table (default: all)")
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument("--page", metavar="FILE", help="write the table here")
    parser.add_argument("--minutes", type=float, default=minutes, help="budget of a diagnosis")
    return parser


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    args = table_parser(__doc__, 10.0).parse_args(argv)
    return run_table(args, ROWS, make, TITLE, "bed_effects", ABOUT, say)


if __name__ == "__main__":
    sys.exit(main())
