"""Recordings of different kinds, explained by one set of laws.

Free flights, a bed that is seen, a bed that is not: each kind is compared with simulations in its own way. What the
most telling kind shows is then added to the scenes of the others, which are diagnosed again: either that explains
them, or something else is missing there besides, or the law does not act there; each is said.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..errors import InputError
from ..recording import Recording
from ..scene import LawUse
from .criteria import current
from .hypothesis import equation_with
from .mechanisms import APPARATUS
from .result import MODELS, Diagnosis, Progress, Table, empty_verdict

Method = Callable[..., Diagnosis]
SPOKEN = {"bodies": "bodies without a bed", "bed": "a bed that is seen", "unseen": "a bed that is not seen"}
QUIET = ("no_mismatch", "recalibrate")


@dataclass
class Part:
    """The recordings of one kind and what was found in them."""

    kind: str
    training: list[Recording]
    held: list[Recording]
    found: Diagnosis
    given: tuple[LawUse, ...] = ()  # laws of other kinds that their scenes had

    @property
    def verdict(self) -> Mapping[str, Any]:
        return self.found.verdict

    @property
    def names(self) -> list[str]:
        """Of the physics that was found, the most telling first."""
        return [m["name"] for m in self.verdict["mechanisms"] if m["name"] not in (*APPARATUS, "unknown")]

    @property
    def z(self) -> float:
        """Significance of what was found."""
        return max((float(m["z"]) for m in self.verdict["mismatch"] if m["z"] is not None), default=0.0)

    def laws(self) -> list[LawUse]:
        """The laws that were found missing, with their numbers; ``bodies`` None where they act on all."""
        known = {item.name for r in self.training for item in r.scene.laws}
        new: dict[str, LawUse] = {}
        for scene in self.found.revised.values():
            every = {b.id for b in scene.bodies if b.mobile}
            for item in scene.laws:
                if item.name in self.names and item.name not in known:
                    whole = item.bodies is None or set(item.bodies) == every
                    new[f"{item.name} {None if whole else item.bodies}"] = replace(
                        item, bodies=None if whole else item.bodies
                    )
        return list(new.values())


def diagnose_together(
    groups: Mapping[str, tuple[Sequence[Recording], Sequence[Recording]]],
    methods: Mapping[str, Method],
    *,
    minutes: float | None = None,
    seed: int = 0,
    progress: Progress = lambda text, share: None,
) -> Diagnosis:
    """Explain recordings of several kinds together.

    groups : kind to (training, held out);  methods : kind to the way it is diagnosed;  minutes : of all together
    Raises InputError for recordings that cannot be used.
    """
    began = time.monotonic()
    notes: list[str] = []
    rounds = 2 * len(groups) - 1
    done = 0

    def share() -> float | None:
        """Of the budget: a part for each kind, and what is left for those that are diagnosed again."""
        if minutes is None:
            return None
        left = max(minutes - (time.monotonic() - began) / 60, current().work.least * minutes)
        return left / (len(groups) + 1 - done) if done < len(groups) else left / max(rounds - done, 1)

    def diagnosed(kind: str, given: tuple[LawUse, ...] = ()) -> Part | None:
        nonlocal done
        training, held = ([_with(r, given) for r in part] for part in groups[kind])
        if given and all(a.scene is b.scene for a, b in zip(training, groups[kind][0], strict=True)):
            done += 1
            return None  # none of the laws can act there
        begin = done / rounds

        def tell(text: str, part: float) -> None:
            progress(f"{SPOKEN[kind]}: {text}", begin + 0.99 * part / rounds)

        if not training:
            raise InputError("every recording of this kind is held out: nothing is left to learn from", where=kind)
        found = methods[kind](training, held, minutes=share(), seed=seed, progress=tell)
        done += 1
        return Part(kind, training, held, found, given)

    alone = [part for kind in groups if (part := diagnosed(kind)) is not None]
    leader = max(alone, key=lambda p: (bool(p.names), p.z))
    parts = [leader]
    laws = tuple(leader.laws()) if leader.names else ()
    for part in alone:
        if part is leader:
            continue
        if not laws or set(part.names) == set(leader.names):
            if laws:
                both = f"{SPOKEN[leader.kind]} and {SPOKEN[part.kind]} both show it"
                notes.append(f"{' and '.join(leader.names)}: {both}")
            parts.append(part)
            continue
        again = diagnosed(part.kind, laws)
        told = " and ".join(dict.fromkeys(item.name for item in laws))
        if again is None:
            notes.append(f"{told}, found in {SPOKEN[leader.kind]}, cannot act in {SPOKEN[part.kind]}")
            parts.append(part)
        elif again.verdict["verdict"] in QUIET:
            explained = "explains" if part.verdict["verdict"] not in QUIET else "agrees with"
            notes.append(f"{told}, found in {SPOKEN[leader.kind]}, {explained} {SPOKEN[part.kind]} too")
            parts.append(again)
        elif part.verdict["verdict"] in QUIET:
            notes.append(
                f"{told}, found in {SPOKEN[leader.kind]}, does not act in {SPOKEN[part.kind]}: nothing is missing "
                "there without it, and something is with it"
            )
            parts.append(part)
        else:
            notes.append(f"{SPOKEN[part.kind]} lacks something beside {told}")
            parts.append(again)
    progress("done", 1.0)
    return _result(parts, leader, notes, time.monotonic() - began, seed)


def _with(recording: Recording, given: Sequence[LawUse]) -> Recording:
    """The recording with laws as a known part of its scene, as far as they can act there."""
    scene = recording.scene
    mobile = {b.id for b in scene.bodies if b.mobile}
    new = []
    for item in given:
        bodies = None if item.bodies is None else tuple(b for b in item.bodies if b in mobile)
        if bodies == () or scene.laws_named(item.name):
            continue
        new.append(replace(item, bodies=bodies))
    for item in new:
        extended = scene.with_laws(item)
        try:
            extended.resolved(item)
        except InputError:
            continue
        scene = extended
    return recording if scene is recording.scene else replace(recording, scene=scene)


# ---- what is handed over ---------------------------------------------------------------------


def combined(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """One parameter measured twice: x = (x_1/s_1^2 + x_2/s_2^2)/(1/s_1^2 + 1/s_2^2), 1/s^2 the sum.

    The interval is widened by |x_1 - x_2|/sqrt(s_1^2 + s_2^2) where that is above one (the Birge ratio).
    Source: Birge 1932, Phys. Rev. 40, 207.
    """

    def spread(p: Mapping[str, Any]) -> float | None:
        if not all(isinstance(p[k], int | float) for k in ("value", "low", "high")):
            return None
        half = (p["high"] - p["low"]) / 2 / current().intervals.normal
        return float(half) if half > 0 and math.isfinite(half) else None

    a, b = spread(first), spread(second)
    if a is None or b is None or first["unit"] != second["unit"]:
        return dict(first)
    weight = 1 / a**2 + 1 / b**2
    value = (first["value"] / a**2 + second["value"] / b**2) / weight
    birge = max(abs(first["value"] - second["value"]) / math.hypot(a, b), 1.0)
    half = current().intervals.normal * birge / math.sqrt(weight)
    return {"value": value, "low": value - half, "high": value + half, "unit": first["unit"]}


def _mechanisms(parts: Sequence[Part]) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for part in parts:
        for entry in part.verdict["mechanisms"]:
            same = next((e for e in entries if e["name"] == entry["name"] and part is not parts[0]), None)
            if same is None or set(same["parameters"]) != set(entry["parameters"]):
                entries.append(dict(entry))
                continue
            same["parameters"] = {k: combined(p, entry["parameters"][k]) for k, p in same["parameters"].items()}
            numbers = ((k, p["value"], p["unit"]) for k, p in same["parameters"].items())
            same["expression"] = equation_with(same["expression"].split("; ")[0], numbers)
            same["bodies"] = list(dict.fromkeys([*same["bodies"], *entry["bodies"]]))
            gains = [g for g in (same["gain_heldout"], entry["gain_heldout"]) if g is not None]
            same["gain_heldout"] = sum(gains) if gains else None
    return entries


def _verdict(parts: Sequence[Part]) -> str:
    every = {p.verdict["verdict"] for p in parts}
    return next(v for v in ("missing_physics", "unmodelled", "measurement", "recalibrate", "no_mismatch") if v in every)


def weighed_together(verdicts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What is explained, whether that is all, what is left and what held-out data say, the leader's verdict first.

    The share is that of the leader, whose errors are told too: shares of different kinds have no common unit. All is
    complete where every kind is, and held-out data of any kind may turn down what is named.
    """
    told = [v.get("heldout") for v in verdicts]
    held = next((h for h in ("fails", "holds", "undecided") if h in told), None)
    return {
        "explained": verdicts[0].get("explained"),
        "complete": all(bool(v.get("complete")) for v in verdicts),
        "remains": next((v["remains"] for v in verdicts if v.get("remains")), None),
        "heldout": held if held == "fails" else (told[0] or held),
    }


def _result(parts: list[Part], leader: Part, notes: list[str], seconds: float, seed: int) -> Diagnosis:
    verdict = empty_verdict(_verdict(parts), leader.verdict["fit"]["unit"])
    verdict["mechanisms"] = _mechanisms(parts)
    places = [(m, p.found.places_in[k : k + 1]) for p in parts for k, m in enumerate(p.verdict["mismatch"])]
    places.sort(key=lambda place: -(place[0]["z"] if place[0]["z"] is not None else 0.0))
    verdict["mismatch"] = [place for place, _ in places]
    verdict["rivals"] = list(leader.verdict["rivals"])
    verdict["fit"] = leader.verdict["fit"]
    verdict |= weighed_together([leader.verdict, *(p.verdict for p in parts if p is not leader)])
    nulls = [p.verdict["null"] for p in parts if p.verdict["null"]]
    if nulls:
        least = min(n["p_false_alarm"] for n in nulls)
        # the best of several searches
        verdict["null"] = {
            "p_false_alarm": min(1.0, least * len(nulls)), "replicates": min(n["replicates"] for n in nulls),
        }  # fmt: skip
    for p in (leader, *parts):
        verdict["next_experiment"] = verdict["next_experiment"] or p.verdict["next_experiment"]
        verdict["recalibrated"] = {**p.verdict["recalibrated"], **verdict["recalibrated"]}
    verdict["notes"] = [*notes, *(n for p in parts for n in p.verdict["notes"])]
    tables = [replace(t, title=f"{t.title}, {SPOKEN[p.kind]}") for p in parts for t in p.found.tables]
    return Diagnosis(
        kind="together", verdict=verdict, revised={k: v for p in parts for k, v in p.found.revised.items()},
        evidence=tuple(p.found for p in parts), tables=(_by_kind(parts), *tables),
        used=tuple(u for p in parts for u in p.found.used),
        believed={k: v for p in parts for k, v in p.found.believed.items()},
        places_in=tuple(name for _, found in places for name in (found or ("",))),
        right_law=leader.found.right_law, widened=leader.found.widened, instead=leader.found.instead, seconds=seconds,
        runs=sum(p.found.runs for p in parts), seed=seed,
    )  # fmt: skip


def _by_kind(parts: Sequence[Part]) -> Table:
    """What each kind of recording says by itself."""
    rows = []
    for p in parts:
        fit = p.verdict["fit"]["heldout"]
        told = ", ".join(m["name"] for m in p.verdict["mechanisms"]) or "–"
        rows.append(
            [
                SPOKEN[p.kind], ", ".join(r.name for r in (*p.training, *p.held)), p.verdict["verdict"], told,
                ", ".join(dict.fromkeys(item.name for item in p.given)) or "–",
                *("–" if fit[m] is None else f"{fit[m]:.3g} {p.verdict['fit']['unit'].split()[0]}" for m in MODELS),
            ]
        )  # fmt: skip
    header = ("kind", "recordings", "verdict", "found", "taken over from the others",
              *(f"held out, {m.replace('_', ' ')}" for m in MODELS))  # fmt: skip
    return Table("What each kind of recording says", header, rows, tuple(range(5, len(header))))
