"""Scores of cases under real-life conditions: the name of the largest effect, completeness, and what else is named.

Verdicts of version 2 say ``complete``, ``explained`` and ``remains``; where a verdict does not, the columns that need
them stay empty and the figures leave the case out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .. import distributions as stats
from .score import APART, Figure, counted, figure_lines, numbers_held, read_table, short, standing

STRONG = 10.0  # ideal standard errors of the largest effect, of which enough cases are wanted
SURE = 1e-3  # p at which an ideal test sees what is left
PREFIX = "real-life"
NOTHING = ("no_mismatch", "recalibrate")
BEDS = ("real-life-bed", "real-life-small-bed")


@dataclass(frozen=True)
class RealRow:
    """One case, scored.

    drawn : nuisances that were drawn;  sigma, second_sigma : ideal standard errors;  complete : as the verdict says
    strange : names that were neither drawn nor equivalent;  entries : how many names there are
    left : ideal standard errors of what was drawn and not named, None where that is not known; masses and radii are
        fitted within what the recording states of them
    left_held : the same with masses and radii as they are believed, whatever is stated
    covered : for each number with an interval, whether it holds the truth;  ideal : whether it holds what an ideal
        analyst finds (``ideal.Response.ideal``), None where the seal does not say
    alone : no second effect, or it is named
    """

    case: str
    setup: str
    category: str
    truth: tuple[str, ...]
    drawn: tuple[str, ...]
    sigma: float
    second_sigma: float
    rival: str
    d_prime: float
    verdict: str
    named: tuple[str, ...]
    right_name: bool
    right_class: bool
    complete: bool | None
    share: float | None
    strange: tuple[str, ...]
    entries: int
    left: float | None
    covered: tuple[bool, ...]
    alone: bool
    heldout: str
    seconds: float
    failed: str = ""
    ideal: tuple[bool, ...] | None = None
    left_held: float | None = None

    @property
    def bed(self) -> bool:
        return self.case.rpartition("-")[0] in BEDS

    @property
    def wrong_complete(self) -> bool:
        """A wrong name said to be complete: of what was concealed, or one where nothing was."""
        if not self.named or self.complete is not True or self.verdict == "unmodelled":
            return False
        return bool(self.strange) if self.category == "null" else not self.right_class

    @property
    def seen(self) -> bool:
        """Whether an ideal test sees what is left."""
        return _sees(self.left)

    @property
    def seen_held(self) -> bool:
        """The same where the test takes masses and radii as they are believed."""
        return _sees(self.left if self.left_held is None else self.left_held)

    def as_dict(self) -> dict[str, Any]:
        """As a line of a table."""
        return {
            "case": self.case, "setup": self.setup, "category": self.category, "truth": "+".join(self.truth),
            "nuisances": "+".join(self.drawn), "sigma": short(self.sigma), "second_sigma": short(self.second_sigma),
            "best_rival": self.rival, "d_prime": short(self.d_prime), "verdict": self.verdict,
            "named": "+".join(self.named), "right_name": int(self.right_name), "right_class": int(self.right_class),
            "complete": "" if self.complete is None else int(self.complete), "share": short(self.share),
            "strange": "+".join(self.strange), "entries": self.entries, "left": short(self.left),
            "left_held": short(self.left_held),
            "numbers": len(self.covered), "covered": sum(self.covered),
            "ideal": "" if self.ideal is None else sum(self.ideal), "alone": int(self.alone),
            "heldout": self.heldout, "seconds": short(self.seconds), "failed": self.failed,
        }  # fmt: skip


def _sees(left: float | None) -> bool:
    return left is not None and bool(stats.norm.sf(left) < SURE)


def nuisances(truth: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Component -> names that are right for it, of the nuisances that were drawn and act on what is compared."""
    found: dict[str, tuple[str, ...]] = {}
    if truth.get("tilt") is not None:
        found["tilt"] = ("uniform_force", "camera_tilt")
    if truth.get("scale"):
        found["scale"] = ("camera_scale",)
    if truth.get("mass"):
        found["mass"] = ("added_mass",)
    if truth.get("radius"):
        found["radius"] = ()
    return found


def _near(name: str, rivals: Mapping[str, float | None], truth: Mapping[str, Any]) -> set[str]:
    """Names that are as good as this one: its own, and rivals within d' of 2."""
    return {*standing(name, truth), *(k for k, v in rivals.items() if v is not None and v < APART)}


def _near_each(truth: Mapping[str, Any]) -> list[set[str]]:
    """Of each effect the names that are as good as its own."""
    rivals = (truth["rivals"], truth.get("second_rivals", {}))
    return [_near(e["name"], by, truth) for e, by in zip(truth["effects"], rivals, strict=False)]


def _components_named(truth: Mapping[str, Any], named: Sequence[str]) -> list[str]:
    """What was drawn and has a name that is right for it: ``first``, ``second``, ``tilt``, ``scale``, ``mass``."""
    names = set(named)
    effects = [p for p, near in zip(("first", "second"), _near_each(truth), strict=False) if near & names]
    return effects + [p for p, right in nuisances(truth).items() if set(right) & names]


def what_is_left(truth: Mapping[str, Any], named: Sequence[str]) -> tuple[float | None, float | None]:
    """``RealRow.left`` and ``left_held`` by the seal, where these names are given; None where it does not know."""
    parts = "+".join(sorted(_components_named(truth, named)))
    return truth.get("left", {}).get(parts), truth.get("left_held", {}).get(parts)


def score_real(result: Mapping[str, Any]) -> RealRow:
    """Score one result: ``truth`` (opened), ``verdict`` (verdict.json, or None where the diagnosis failed)."""
    truth, verdict = result["truth"], result["verdict"] or {}
    effects = truth["effects"]
    names = tuple(e["name"] for e in effects)
    mechanisms = verdict.get("mechanisms", [])
    kind = verdict.get("verdict", "failed")
    # a curve without a name is no name
    named = tuple(dict.fromkeys(m["name"] for m in mechanisms if m["name"] != "unknown"))
    alike = {r["name"] for r in verdict.get("rivals", []) if r.get("indistinguishable")}
    rivals = {k: v for k, v in truth["rivals"].items() if v is not None}
    rival, d_prime = min(rivals.items(), key=lambda item: item[1], default=("", math.inf))
    positive = kind in ("missing_physics", "measurement")
    drawn = nuisances(truth)
    near = _near_each(truth)
    if names:
        right = positive and bool(standing(names[0], truth) & set(named))
        in_class = right or (positive and bool(near[0] & set(named) or (named and standing(names[0], truth) & alike)))
    else:
        right = in_class = kind in NOTHING
    equivalent = set().union(*near, *(set(v) for v in drawn.values()))
    strange = tuple(n for n in named if n not in equivalent)
    if len(strange) == 1 and names and strange[0] == named[0] and standing(names[0], truth) & alike:
        strange = ()  # the verdict itself says that it cannot tell it from the truth
    strange = strange if positive else ()
    if not names:
        right = in_class = not strange and kind != "failed"
    left, held = what_is_left(truth, named)
    covered, ideal = (_covered(truth, mechanisms, by) for by in ("believed", "ideal"))
    fit = verdict.get("explained") or {}
    return RealRow(
        case=result["case"], setup=truth["setup"], category=truth["category"], truth=names, drawn=tuple(drawn),
        sigma=_number(truth["sigma"]), second_sigma=_number(truth.get("second_sigma")), rival=rival, d_prime=d_prime,
        verdict=kind, named=named if positive else (), right_name=bool(right), right_class=bool(in_class),
        complete=verdict.get("complete"), share=fit.get("share"), strange=strange,
        entries=len(named) if positive else 0, left=left, left_held=held, covered=covered or (), ideal=ideal,
        alone=len(names) < 2 or "second" in _components_named(truth, named), heldout=str(verdict.get("heldout") or ""),
        seconds=result["seconds"], failed=result.get("failed", ""),
    )  # fmt: skip


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _covered(
    truth: Mapping[str, Any], mechanisms: Sequence[Mapping[str, Any]], by: str
) -> tuple[bool, ...] | None:
    """Intervals that hold the truth, of the drawn effects that are named themselves with one entry.

    by : whose numbers are true, "believed" or "ideal"; None where the seal has none. Of both the same are counted
    """
    if by not in truth:
        return None
    covered: list[bool] = []
    for effect, believed, true in zip(truth["effects"], truth["believed"], truth[by], strict=True):
        mine = [m for m in mechanisms if m["name"] in standing(effect["name"], truth)]
        if believed is not None and len(mine) == 1:
            covered += numbers_held([true], mine, truth.get("pin_length"), truth.get("radii"))[0]
    return tuple(covered)


def real_figures(rows: Sequence[RealRow]) -> list[Figure]:
    """The figures that real-life cases are to show."""
    concealed = [r for r in rows if r.truth]
    strong = [r for r in concealed if r.sigma >= STRONG]
    nulls = [r for r in rows if not r.truth]
    entries = sum(r.entries for r in rows)
    strange = sum(len(r.strange) for r in rows)
    seen = [r.complete is False for r in rows if r.seen and r.complete is not None]
    alone = [c for r in rows if r.alone for c in r.covered]
    beside = [c for r in rows if not r.alone for c in r.covered]
    by_ideal = [c for r in rows if r.alone for c in r.ideal or ()]
    told = [r for r in rows if r.complete is not None]
    return [
        counted("largest effect: right name or class", "at least 85 %", [r.right_class for r in concealed], 0.85, True),
        counted(f"the same, of {STRONG:g} ideal standard errors and more", "at least 85 %",
                [r.right_class for r in strong], 0.85, True),
        replace(counted("right name itself", "nothing", [r.right_name for r in concealed], 0.0, True), reached=None),
        counted("full beds: right name or class", "at least 85 %",
                [r.right_class for r in concealed if r.bed], 0.85, True),
        counted("a wrong name said to be complete, of all cases", "at most 5 %", [r.wrong_complete for r in told], 0.05,
                False),
        counted("names neither drawn nor equivalent, of all entries", "at most 10 %",
                [True] * strange + [False] * (entries - strange), 0.1, False),
        counted("an ideal test sees what is left: said to be incomplete", "at least 80 %", seen, 0.8, True),
        replace(counted("the same where the test takes masses and radii as they are believed", "nothing",
                        [r.complete is False for r in told if r.seen_held], 0.0, True), reached=None),
        counted("nulls with a mechanism that is no nuisance drawn", "at most 5 %", [bool(r.strange) for r in nulls],
                0.05, False),
        counted("95 % intervals that hold the truth, no second effect or a named one", "at least 85 %", alone, 0.85,
                True),
        counted("95 % intervals that hold the truth, a second effect not named", "at least 70 %", beside, 0.7, True),
        replace(counted("no second effect or a named one: what an ideal analyst finds, masses and all in their priors",
                "nothing", by_ideal, 0.0, True), reached=None),
    ]  # fmt: skip


def read_real_rows(path: str | Path) -> list[RealRow]:
    """Rows of a table that ``table_text`` made of them.

    Raises InputError where a column is missing or a number cannot be read.
    """
    return read_table(path, _row)


def _row(line: Mapping[str, str]) -> RealRow:
    def names(key: str) -> tuple[str, ...]:
        return tuple(n for n in line[key].split("+") if n)

    def number(key: str) -> float:
        return float(line[key]) if line[key] else math.nan

    hits, numbers = int(line["covered"]), int(line["numbers"])
    return RealRow(
        case=line["case"], setup=line["setup"], category=line["category"], truth=names("truth"),
        drawn=names("nuisances"), sigma=number("sigma"), second_sigma=number("second_sigma"),
        rival=line["best_rival"], d_prime=number("d_prime"), verdict=line["verdict"], named=names("named"),
        right_name=line["right_name"] == "1", right_class=line["right_class"] == "1",
        complete=None if not line["complete"] else line["complete"] == "1",
        share=float(line["share"]) if line["share"] else None, strange=names("strange"), entries=int(line["entries"]),
        left=float(line["left"]) if line["left"] else None, covered=(True,) * hits + (False,) * (numbers - hits),
        ideal=(True,) * int(line["ideal"]) + (False,) * (numbers - int(line["ideal"])) if line.get("ideal") else None,
        left_held=float(line["left_held"]) if line.get("left_held") else None,
        alone=line["alone"] == "1", heldout=line["heldout"], seconds=float(line["seconds"] or 0), failed=line["failed"],
    )  # fmt: skip


def real_told(rows: Sequence[RealRow]) -> list[str]:
    """The figures, a line each, and how many cases there are."""
    strong = sum(r.sigma >= STRONG for r in rows if r.truth)
    nulls, beds = sum(not r.truth for r in rows), sum(r.bed for r in rows)
    return [
        f"{len(rows)} real-life cases: {len(rows) - nulls} with an effect, {strong} of them of {STRONG:g} ideal "
        f"standard errors and more, {nulls} nulls, {beds} beds",
        *figure_lines(real_figures(rows)),
    ]
