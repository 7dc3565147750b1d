"""Scores: a verdict held against an opened truth, and the sums over many cases."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .. import distributions as stats
from ..errors import InputError
from .candidates import APPARATUS, fitted
from .world import Effect

STRONG = 5.0  # standard errors
APART = 2.0  # d' of the best refitted rival
NULLS = ("null", "decoy_adjustable", "decoy_camera")


@dataclass(frozen=True)
class Row:
    """One case, scored. ``covered``: for each number with an interval, whether it holds the truth."""

    case: str
    setup: str
    category: str
    truth: tuple[str, ...]
    other_form: bool
    sigma: float
    rival: str
    d_prime: float
    verdict: str
    first: str
    named: tuple[str, ...]
    right_name: bool
    right_class: bool
    located: bool | None
    physics_named: bool
    covered: tuple[bool, ...]
    errors: Mapping[str, float]  # relative error of numbers
    held: Mapping[str, float | None]
    p: float | None
    seconds: float
    failed: str = ""
    complete: bool | None = None  # as the verdict says, None where it does not

    @property
    def eligible(self) -> bool:
        """Strong enough, and far enough from the best rival, to count for the figures on naming."""
        return self.category == "mechanism" and self.sigma >= STRONG and self.d_prime >= APART

    def as_dict(self) -> dict[str, Any]:
        """As a line of a table."""
        return {
            "case": self.case, "setup": self.setup, "category": self.category, "truth": "+".join(self.truth),
            "other_form": int(self.other_form), "sigma": short(self.sigma), "best_rival": self.rival,
            "d_prime": short(self.d_prime), "verdict": self.verdict, "named": "+".join(self.named),
            "right_name": int(self.right_name), "right_class": int(self.right_class),
            "located": "" if self.located is None else int(self.located), "physics_named": int(self.physics_named),
            "numbers": len(self.covered), "covered": sum(self.covered),
            **{f"heldout_{k}": short(v) for k, v in self.held.items()},
            "p": short(self.p), "seconds": short(self.seconds), "failed": self.failed,
            "complete": "" if self.complete is None else int(self.complete),
        }  # fmt: skip


def short(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else f"{value:.4g}"


def read_rows(path: str | Path) -> list[Row]:
    """Rows of a table that ``Row.as_dict`` made; it does not keep the relative errors of numbers.

    Raises InputError where a column is missing or a number cannot be read.
    """
    return read_table(path, _row)


Line = TypeVar("Line")


def read_table(path: str | Path, row: Callable[[Mapping[str, str]], Line]) -> list[Line]:
    """The lines of a CSV, each made by ``row``; InputError names the line that is none."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a table: {error}", file=path) from None
    rows = []
    for k, line in enumerate(lines, start=2):
        try:
            rows.append(row(line))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a line of a score: {error}", where=f"row {k}", file=path) from None
    return rows


def _row(line: Mapping[str, str]) -> Row:
    def number(key: str) -> float | None:
        return float(line[key]) if line[key] else None

    named = tuple(n for n in line["named"].split("+") if n)
    hits, numbers = int(line["covered"]), int(line["numbers"])
    sigma, d_prime = number("sigma"), number("d_prime")
    return Row(
        case=line["case"], setup=line["setup"], category=line["category"],
        truth=tuple(n for n in line["truth"].split("+") if n), other_form=line["other_form"] == "1",
        sigma=math.nan if sigma is None else sigma, rival=line["best_rival"],
        d_prime=math.nan if d_prime is None else d_prime, verdict=line["verdict"],
        first=named[0] if named else "", named=named, right_name=line["right_name"] == "1",
        right_class=line["right_class"] == "1", located=None if line["located"] == "" else line["located"] == "1",
        physics_named=line["physics_named"] == "1", covered=(True,) * hits + (False,) * (numbers - hits), errors={},
        held={k.removeprefix("heldout_"): number(k) for k in line if k.startswith("heldout_")},
        p=number("p"), seconds=number("seconds") or 0.0, failed=line["failed"] or "",
        complete=None if not line.get("complete") else line["complete"] == "1",  # older tables have no such column
    )  # fmt: skip


# in a pin a drag is one of the joint, and so is dry friction: the contract's names there
IN_A_PIN = {"linear_drag": "joint_drag", "coulomb_substrate": "joint_friction"}


def standing(name: str, truth: Mapping[str, Any]) -> set[str]:
    """The names that an effect has in this apparatus."""
    return {name, IN_A_PIN[name]} if truth["setup"] == "pendulum" and name in IN_A_PIN else {name}


def score_case(result: Mapping[str, Any]) -> Row:
    """Score one result: ``truth`` (opened), ``verdict`` (verdict.json, or None where the diagnosis failed)."""
    truth, verdict = result["truth"], result["verdict"] or {}
    effects = truth["effects"]
    names = tuple(e["name"] for e in effects)
    rivals = {k: v for k, v in truth["rivals"].items() if v is not None}
    rival, d_prime = min(rivals.items(), key=lambda item: item[1], default=("", math.inf))
    if not truth.get("rivals_computed", True):
        d_prime = math.nan  # too long to compute: no case for the figures on naming
    sigma = math.nan if truth["sigma"] is None else truth["sigma"]
    mechanisms = verdict.get("mechanisms", [])
    named = tuple(dict.fromkeys(m["name"] for m in mechanisms))
    first = named[0] if named else ""
    kind = verdict.get("verdict", "failed")
    physics = kind == "missing_physics" and any(n not in (*APPARATUS, "unknown") for n in named)
    alike = {r["name"] for r in verdict.get("rivals", []) if r.get("indistinguishable")}
    category = truth["category"]
    if category == "mechanism":
        own = standing(names[0], truth)
        right = kind in ("missing_physics", "measurement") and len(named) == 1 and first in own
        near = {*own, *(k for k, v in rivals.items() if v < APART)}
        # of one class: by the proof's own simulator, or as the verdict itself says
        in_class = right or (kind in ("missing_physics", "measurement") and bool(first in near or own & alike))
    elif category == "decoy_camera":
        right = kind == "measurement" and named == names
        near = {names[0], *(k for k, v in rivals.items() if v < APART)}
        in_class = right or (bool(first) and (first in near or names[0] in alike))
    elif category == "pair":
        stands = [standing(n, truth) for n in names]
        right = len(named) == len(names) and all(own & set(named) for own in stands)
        in_class = right
    elif category == "outside":
        right = in_class = kind == "unmodelled"
    else:
        right = in_class = kind in ("no_mismatch", "recalibrate")
    # a force without a name has numbers of its own, which no truth speaks of
    comparable = right and len(effects) == 1 and category != "outside"
    covered, errors = ((), {})
    if comparable:
        covered, errors = numbers_held(effects, mechanisms, truth.get("pin_length"), truth.get("radii"))
    fit = (verdict.get("fit") or {}).get("heldout") or {}
    null = verdict.get("null")
    return Row(
        case=result["case"], setup=truth["setup"], category=category, truth=names,
        other_form=any(e["other"] for e in effects), sigma=sigma, rival=rival, d_prime=d_prime, verdict=kind,
        first=first, named=named, right_name=bool(right), right_class=bool(in_class),
        located=_located(truth, verdict) if category in ("mechanism", "outside", "pair") else None,
        physics_named=bool(physics), covered=covered, errors=errors,
        held={k: fit.get(k) for k in ("naive", "recalibrated", "revised", "noise_floor")},
        p=None if null is None else null["p_false_alarm"], seconds=result["seconds"], failed=result.get("failed", ""),
        complete=verdict.get("complete"),
    )  # fmt: skip


def _located(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> bool | None:
    """Whether the first place and the bodies of the mechanisms are those concerned; None where nothing was found."""
    if verdict.get("verdict") in (None, "no_mismatch", "recalibrate"):
        return None
    right = set(truth["bodies"])
    places = verdict.get("mismatch", [])
    swimmer = truth.get("swimmer")
    if not places or not _classes(places[0]["bodies"], swimmer) <= right:
        return False
    bodies = _classes([b for m in verdict["mechanisms"] for b in m["bodies"]], swimmer)
    # an unknown force is located by its place; a named law says on whom it acts
    return verdict["verdict"] != "missing_physics" or bodies == right


def _classes(bodies: Sequence[str], swimmer: Sequence[str] | None) -> set[str]:
    """Ids; in a bed those of the swimmer's disks, and "grains" for any grain."""
    if swimmer is None:
        return set(bodies)
    out: set[str] = set()
    for b in bodies:
        if b in swimmer:
            out.add(b)
        elif b in ("swimmer", "all"):
            out |= set(swimmer) | ({"grains"} if b == "all" else set())
        else:
            out.add("grains")
    return out


def numbers_held(
    effects: Sequence[Mapping[str, Any]], mechanisms: Sequence[Mapping[str, Any]], pin_length: float | None = None,
    radii: Mapping[str, float] | None = None,
):  # fmt: skip
    """Whether each interval holds the truth, and relative errors; nothing where the true form is another one.

    pin_length : of a pendulum [m], by which a drag of its bob is one of its joint
    radii : of all bodies [m]: a strength is that of a body of the mean radius r_0 of those that a law acts on, so that
        with the power p the same law on fewer bodies has another number
    """
    effect, entry = effects[0], mechanisms[0]
    if effect["other"] or len(mechanisms) != 1:
        return (), {}
    if entry["name"] == "joint_drag" and effect["name"] == "linear_drag" and pin_length is not None:
        effect = {**effect, "values": {"c": effect["values"]["c"] * pin_length**2}}
    elif entry["name"] != effect["name"]:
        return (), {}
    acts, whole = entry["bodies"], effect.get("bodies") or list(radii or ())
    if effect["values"].get("p") and "c" in effect["values"] and radii and set(acts) < set(whole) <= set(radii):
        share = np.mean([radii[b] for b in acts]) / np.mean([radii[b] for b in whole])
        c = float(effect["values"]["c"] * share ** effect["values"]["p"])
        effect = {**effect, "values": {**effect["values"], "c": c}}
    true = Effect(effect["name"], {k: tuple(v) if isinstance(v, list) else v for k, v in effect["values"].items()})
    found = entry["parameters"]
    if (
        "p" in effect["values"]
        and len(entry["bodies"]) > 1
        and found.get("p", {}).get("value") != effect["values"]["p"]
    ):
        return (), {}
    if "joint" in effect["values"] and found.get("joint", {}).get("value") != effect["values"]["joint"]:
        return (), {}
    rename = {"camera_scale": lambda v: 1.0 + v}
    covered: list[bool] = []
    errors: dict[str, float] = {}
    for key in fitted(true):
        if key not in found:
            continue
        shift = rename.get(true.name, lambda v: v)
        wanted = np.atleast_1d(shift(np.asarray(true.values[key], dtype=float)))
        value = np.atleast_1d(np.asarray(found[key]["value"], dtype=float))
        low, high = (np.atleast_1d(np.asarray(found[key][end], dtype=object)) for end in ("low", "high"))
        for k in range(min(len(wanted), len(value))):
            if low[k] is None or high[k] is None:
                continue
            covered.append(bool(low[k] <= wanted[k] <= high[k]))
            size = float(np.linalg.norm(wanted)) or 1.0
            errors[f"{key}{k if len(wanted) > 1 else ''}"] = float((value[k] - wanted[k]) / size)
    return tuple(covered), errors


def proportion(hits: int, n: int) -> tuple[float, float, float] | None:
    """Share and its central 95 % (Clopper & Pearson 1934, Biometrika 26, 404); None without cases."""
    if n == 0:
        return None
    low = float(stats.beta.ppf(0.025, hits, n - hits + 1)) if hits else 0.0
    high = float(stats.beta.ppf(0.975, hits + 1, n - hits)) if hits < n else 1.0
    return hits / n, low, high


@dataclass(frozen=True)
class Figure:
    """One asked figure: what was counted, what came out, and whether the asked bound is reached."""

    what: str
    asked: str
    hits: int
    n: int
    share: tuple[float, float, float] | None
    reached: bool | None


def counted(what: str, asked: str, flags: Sequence[bool], bound: float, at_least: bool, top: float = 1.0) -> Figure:
    n, hits = len(flags), int(sum(flags))
    share = proportion(hits, n)
    reached = None if share is None else (bound <= share[0] <= top if at_least else share[0] <= bound)
    return Figure(what, asked, hits, n, share, reached)


def figures_of_merit(rows: Sequence[Row]) -> list[Figure]:
    """The figures that the proof is to show, in their order."""
    strong = [r for r in rows if r.eligible]
    nulls = [r for r in rows if r.category in NULLS]
    outside = [r for r in rows if r.category == "outside" and r.sigma >= STRONG]
    # a force that a known law imitates within its noise can only be named after that law
    unlike = [r for r in outside if r.d_prime >= STRONG]
    intervals = [c for r in rows for c in r.covered]
    return [
        counted("right name first (5 standard errors, best rival at d' of 2 or more)", "at least 90 %",
                [r.right_name for r in strong], 0.9, True),
        counted("right name or right class (the same cases)", "at least 97 %",
                [r.right_class for r in strong], 0.97, True),
        counted("located at the right bodies (the same cases, where something was found)", "at least 90 %",
                [r.located for r in strong if r.located is not None], 0.9, True),
        counted("nulls and decoys with physics named", "at most 5 %", [r.physics_named for r in nulls], 0.05, False),
        counted("outside the library: unmodelled", "at least 80 %", [r.verdict == "unmodelled" for r in outside], 0.8,
                True),
        counted("outside the library: a confident wrong name", "at most 10 %", [r.physics_named for r in outside], 0.1,
                False),
        counted("outside, and no known law comes nearer than 5 standard errors: unmodelled", "at least 80 %",
                [r.verdict == "unmodelled" for r in unlike], 0.8, True),
        counted("outside, and no known law comes nearer than 5 standard errors: a confident wrong name",
                "at most 10 %", [r.physics_named for r in unlike], 0.1, False),
        counted("95 % intervals that hold the truth", "90 to 99 %", intervals, 0.9, True, 0.99),
        counted("right names said to be complete", "at least 85 %",
                [r.complete for r in strong if r.right_name and r.complete is not None], 0.85, True),
        counted("outside the library: a wrong name said to be complete", "at most 5 %",
                [bool(r.physics_named and r.complete) for r in outside if r.complete is not None], 0.05, False),
    ]  # fmt: skip


def held_out(rows: Sequence[Row]) -> dict[str, float]:
    """Medians of held-out errors over the floor, of the cases whose physics was named right.

    ``revised_known``, ``revised_other``: of effects that have the form that a diagnosis knows, and of the others,
    whose exponent or smoothing no revised scene has.
    """
    good = [r for r in rows if r.category == "mechanism" and r.right_name and r.held.get("noise_floor")]
    result: dict[str, float] = {"n": float(len(good))}
    for key in ("naive", "recalibrated", "revised"):
        ratios = [r.held[key] / r.held["noise_floor"] for r in good if r.held.get(key)]  # type: ignore[operator]
        if ratios:
            result[key] = float(np.median(ratios))
    for key, other in (("revised_known", False), ("revised_other", True)):
        mine = [r.held for r in good if r.other_form == other and r.held.get("revised")]
        if mine:
            result[key] = float(np.median([h["revised"] / h["noise_floor"] for h in mine]))  # type: ignore[operator]
    return result


def figure_lines(figures: Sequence[Figure]) -> list[str]:
    """Figures, a line each, and whether what is asked is reached."""
    lines = []
    for f in figures:
        share = "no cases" if f.share is None else f"{100 * f.share[0]:.0f} % ({f.hits} of {f.n})"
        state = "" if f.reached is None else ", reached" if f.reached else ", NOT reached"
        lines.append(f"{f.what}: {share}; asked {f.asked}{state}")
    return lines


def told(rows: Sequence[Row]) -> list[str]:
    """The figures of merit, and the held-out error, a line each."""
    lines = figure_lines(figures_of_merit(rows))
    held = held_out(rows)
    if "revised" in held:
        median = f"median of {held['n']:.0f}: {held['revised']:.2f}"
        lines.append(f"held-out error over the floor, {median}; asked at most 1.1")
    return lines


def detection(rows: Sequence[Row], edges: Sequence[float] = (0, 2.5, 4, 6.5, 10, 16, 30, 60, 1e9)):
    """(low, high, n, detected, right name) for bins of standard errors, of concealed mechanisms."""
    out = []
    for low, high in pairwise(edges):
        mine = [r for r in rows if r.category == "mechanism" and low <= r.sigma < high]
        if mine:
            seen = sum(r.verdict not in ("no_mismatch", "recalibrate", "failed") for r in mine)
            out.append((low, high, len(mine), seen, sum(r.right_class for r in mine)))
    return out


def confusion(rows: Sequence[Row]) -> tuple[list[str], list[str], np.ndarray]:
    """Truths, answers, counts (truths, answers); answers with ``none`` and ``unknown``. Effects of 5 and more."""
    counts: Counter[tuple[str, str]] = Counter()
    for r in rows:
        if r.category in ("mechanism", "decoy_camera", "outside") and r.sigma < STRONG:
            continue
        truth = "+".join(r.truth) if r.truth else "none"
        if r.category == "outside":
            truth = f"outside: {truth}"
        if r.category == "pair":
            truth = "two laws"
        answer = "unknown" if r.verdict == "unmodelled" else "none" if not r.first else r.first
        if r.category == "pair" and r.right_name:
            answer = "two laws"
        counts[truth, answer] += 1
    truths = sorted({t for t, _ in counts}, key=lambda t: (t == "none", t.startswith("outside"), t))
    extra = [a for a in ("none", "unknown") if any(x == a for _, x in counts)]
    answers = [t for t in truths if any(a == t for _, a in counts) and t not in extra]
    answers += sorted({a for _, a in counts} - set(answers) - set(extra)) + extra
    table = np.array([[counts[t, a] for a in answers] for t in truths]).reshape(len(truths), len(answers))
    return truths, answers, table


def is_failure(row: Row) -> bool:
    """What a reader should look at: not silence about what is too weak to be seen, nor a right answer."""
    if row.failed:
        return True
    if row.category == "mechanism":
        return row.sigma >= STRONG and not row.right_class
    if row.category in NULLS:
        return row.physics_named or (row.category != "decoy_camera" and not row.right_name)
    return not row.right_name
