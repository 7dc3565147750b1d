"""F9: vertical profiles of solid fraction and inertial number, anisotropy of the contact network."""

import numpy as np
from matplotlib.figure import Figure

from ..analysis.speed import mean_error
from .claim import FAILS, HOLDS, OPEN, Claim, Finding, above, least, number, within
from .draw import BY_FREQUENCY, curve, frequency_axis, legend, styled
from .results import HEIGHTS, Results, nan_mean

TRANSITION = 1e-3
PLACES = (0.0, 2.0, 5.0)


def at(profile: np.ndarray, height: float) -> float:
    """Mean of a vertical profile above and below at |y/D_s| = height."""
    return float(nan_mean(profile[np.isclose(np.abs(HEIGHTS), height)]))


def interface(profile: np.ndarray) -> float:
    """|y/D_s| where the inertial number, averaged above and below, first falls below 1e-3; NaN where it does not."""
    heights = np.unique(np.abs(HEIGHTS))
    values = np.array([at(profile, h) for h in heights])
    below = np.flatnonzero(values < TRANSITION)
    if not len(below) or below[0] == 0:
        return float("nan")
    k = int(below[0])
    a, b = np.log(values[k - 1]), np.log(values[k])
    return float(heights[k - 1] + (np.log(TRANSITION) - a) / (b - a) * (heights[k] - heights[k - 1]))


def judge(results: Results) -> list[Finding]:
    findings = []
    frequency = results.frequencies()
    for f in (4.0, 9.0, 15.0):
        logs = np.log(np.array([[at(p, 0.0), at(p, 5.0)] for p in results.values("profile_inertial", frequency=f)]))
        mean, error = map(float, mean_error(logs[:, 0] - logs[:, 1])) if len(logs) else (np.nan, np.nan)
        findings.append(
            Finding(
                says="I falls away from the swimmer", measured=f"{f:g} Hz: ln I(0)/I(5 D_s) = {number(mean, error)}",
                verdict=above(mean, error), value=mean, error=error, packings=len(logs),
            )
        )  # fmt: skip
    seen = [f for f in frequency if len(results.values("profile_inertial", frequency=f))]
    for f in [f for f in seen if f > 8]:
        found = np.array([interface(p) for p in results.values("profile_inertial", frequency=f)])
        reached = np.isfinite(found)
        mean, error = map(float, mean_error(found)) if reached.any() else (np.nan, np.nan)
        said = number(mean, error, "D_s") if reached.any() else "nowhere"
        findings.append(
            Finding(
                says=f"above 8 Hz I = 1e-3 lies near y/D_s = 2 ({f:g} Hz)",
                measured=f"{said}, reached in {reached.sum()} of {len(found)} packings",
                verdict=(within(mean, error, 1.0, 3.0) if reached.mean() > 0.5 else FAILS) if len(found) else OPEN,
                value=mean, error=error, unit="D_s", packings=len(found), note="near: 1 to 3 D_s; P taken over "
                "the thickness of the layer, so that I is a pure number: as written, I is 32 times larger",
            )
        )  # fmt: skip
    if len(frequency) >= 3:
        trends = {place: _trend(results, frequency, place) for place in PLACES}
        for place, sign, says in ((0.0, 1.0, "centre: I rises with f"), (5.0, -1.0, "y = 5 D_s: I falls with f")):
            mean, error, n = trends[place]
            findings.append(
                Finding(
                    says=says, measured=f"slope d ln I/d ln f {number(mean, error)}", verdict=above(sign * mean, error),
                    value=mean, error=error, packings=n,
                )
            )  # fmt: skip
        findings += _peak(results, seen)
        d, e, n = results.difference("anisotropy", {"frequency": frequency[0]}, {"frequency": frequency[-1]})
        findings.append(
            Finding(
                says="anisotropy of the contacts falls with f",
                measured=f"from {frequency[0]:g} to {frequency[-1]:g} Hz by {number(d, e)}",
                verdict=above(d, e), value=d, error=e, packings=n,
                note="F_1 - F_2 over their sum, unit vectors; with branch vectors, as stated, the figure shows both",
            )
        )  # fmt: skip
    return findings


def _peak(results: Results, frequency: list[float]) -> list[Finding]:
    """Whether I at y = 2 D_s is largest inside the frequencies, packing by packing against both ends."""
    if len(frequency) < 3:
        return []
    rows = [results.values("profile_inertial", frequency=f) for f in frequency]
    best = int(np.argmax([float(nan_mean([at(p, 2.0) for p in row])) for row in rows]))
    ends = [k for k in (0, len(frequency) - 1) if k != best]
    top = {"frequency": frequency[best]}
    apart = [
        results.difference("profile_inertial", top, {"frequency": frequency[k]}, lambda p: np.log(at(p, 2.0)))
        for k in ends
    ]
    texts = [f"ln I above that at {frequency[k]:g} Hz by {number(*d[:2])}" for k, d in zip(ends, apart, strict=True)]
    inside = len(ends) == 2
    return [
        Finding(
            says="y = 2 D_s: I peaks at an intermediate f",
            measured=f"largest mean at {frequency[best]:g} Hz of {', '.join(f'{f:g}' for f in frequency)}: "
            + ", ".join(texts),
            verdict=FAILS if not inside else HOLDS if all(d - e > 0 for d, e, _ in apart) else OPEN,
            packings=least([len(r) for r in rows]),
        )
    ]  # fmt: skip


def _trend(results: Results, frequency: list[float], place: float) -> tuple[float, float, int]:
    """Slope d ln I/d ln f by packing."""
    by_seed: dict[int, list[tuple[float, float]]] = {}
    for f in frequency:
        for p, s in results.select(frequency=f):
            if "profile_inertial" in s:
                value = at(s["profile_inertial"].values, place)
                if np.isfinite(value) and value > 0:
                    by_seed.setdefault(p["seed"], []).append((np.log(f), np.log(value)))
    slopes = []
    for rows in by_seed.values():
        if len(rows) >= 3:
            x, y = np.array(rows).T
            slopes.append(float(np.polyfit(x, y, 1)[0]))
    mean, error = mean_error(np.array(slopes)) if slopes else (np.nan, np.nan)
    return float(mean), float(error), len(slopes)


@styled
def draw(results: Results) -> Figure | None:
    frequency = results.frequencies()
    if not frequency:
        return None
    figure = Figure(figsize=(6.8, 5.0), layout="constrained")
    (fraction, inertial), (inset, fabric) = figure.subplots(2, 2)
    for f in frequency:
        colour = BY_FREQUENCY.get(f, "#999999")
        for axis, name in ((fraction, "profile_fraction"), (inertial, "profile_inertial")):
            values = results.values(name, frequency=f)
            if len(values):
                axis.plot(HEIGHTS, nan_mean(values, axis=0), color=colour, label=f"{f:g} Hz")
    inertial.set_yscale("log")
    inertial.axhline(TRANSITION, color="#777777", linestyle="--", linewidth=0.8)
    fraction.set_ylabel("Φ of the grains")
    inertial.set_ylabel("inertial number I")
    for axis in (fraction, inertial):
        axis.set_xlabel("y/D_s")
    legend(fraction, fontsize=7, ncols=2)
    for place, colour in zip(PLACES, ("#d55e00", "#e69f00", "#0072b2"), strict=True):
        points = [(f, [at(p, place) for p in results.values("profile_inertial", frequency=f)]) for f in frequency]
        inset.plot([f for f, v in points if v], [nan_mean(v) for _, v in points if v], "o-", color=colour, markersize=4,
                   label=f"y = {place:g} D_s")  # fmt: skip
    inset.set_yscale("log")
    legend(inset, fontsize=7)
    frequency_axis(inset, "inertial number I")
    curve(fabric, results, "anisotropy", 1.0, "unit vectors", color="#0072b2")
    curve(fabric, results, "branch_anisotropy", 1.0, "branch vectors, as stated", color="#999999")
    frequency_axis(fabric, "anisotropy of the contacts")
    legend(fabric, fontsize=7)
    return figure


CLAIM = Claim("F9", "Profiles, inertial number, fabric", "Fig. 9, appendix C", ("free",), judge, draw)
