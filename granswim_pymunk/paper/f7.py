"""F7: kinetic energy of the bed and of the swimmer."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from .claim import FAILS, HOLDS, OPEN, Claim, Finding, above, least, number
from .draw import BY_FREQUENCY, curve, frequency_axis, legend, styled
from .results import Results


def judge(results: Results) -> list[Finding]:
    findings = []
    frequency = results.frequencies()
    ratios = {f: results.values("bed_pulse", frequency=f) / np.maximum(results.values("bed_once", frequency=f), 1e-300)
              for f in frequency}  # fmt: skip
    shares = [float(np.mean(r > 1)) for r in ratios.values() if len(r)]
    findings.append(
        Finding(
            says="bed: two pulses of energy in each cycle",
            measured=f"amplitude at 2 f above that at f in {100 * np.mean(shares):.0f} % of the runs, at least "
            f"{100 * min(shares):.0f} % at each frequency" if shares else "no runs",
            verdict=OPEN if not shares else HOLDS if min(shares) > 0.75 else FAILS if np.mean(shares) < 0.5 else OPEN,
            packings=least([len(r) for r in ratios.values()]),
        )
    )  # fmt: skip
    d, e, n = results.difference("bed_energy", {"frequency": 9.0}, {"frequency": 4.0})
    findings.append(
        Finding(
            says="bed: energy rises with f up to 9 Hz",
            measured=f"from 4 to 9 Hz by {number(d, e, 'µJ', 1e6)}",
            verdict=above(d, e), value=d, error=e, unit="J", packings=n,
        )
    )  # fmt: skip
    # saturation: the growth exponent d ln E/d ln f above 9 Hz is below half of that from 4 to 9 Hz
    for what, title in (("bed_energy", "bed"), ("swimmer_energy", "swimmer")):
        low, high = growth(results, what, 4.0, 9.0), growth(results, what, 9.0, 15.0)
        if what == "bed_energy":
            both = min(len(low), len(high))
            halves = high[:both] - 0.5 * low[:both]
            mean, error = _mean(halves)
            verdict, says = above(-mean, error), "bed: energy saturates above 9 Hz"
            note = "saturates: d ln E/d ln f from 9 to 15 Hz below half of that from 4 to 9 Hz"
        else:
            both = len(high)
            mean, error = _mean(high)
            verdict, says, note = above(mean, error), "swimmer: energy keeps rising with f", ""
        findings.append(
            Finding(
                says=says,
                measured=f"{title}: d ln E/d ln f is {number(*_mean(low))} from 4 to 9 Hz, {number(*_mean(high))} from "
                "9 to 15 Hz",
                verdict=verdict, value=mean, error=error, packings=both, note=note,
            )
        )  # fmt: skip
    bed, body = (growth(results, what, 15.0, 20.0) for what in ("bed_energy", "swimmer_energy"))
    if len(bed):
        (mean, error), (other, half) = _mean(bed), _mean(body)
        verdicts = {above(-mean, error), above(other, half)}
        findings.append(
            Finding(
                says="bed's energy does not grow from 15 to 20 Hz, while the swimmer's does",
                measured=f"d ln E/d ln f from 15 to 20 Hz is {number(mean, error)} for the bed, {number(other, half)} "
                "for the swimmer",
                verdict=HOLDS if verdicts == {HOLDS} else FAILS if FAILS in verdicts else OPEN,
                value=mean, error=error, packings=len(bed),
                note="the paper's saturation, looked for at the highest frequencies",
            )
        )  # fmt: skip
    return findings


def growth(results: Results, name: str, low: float, high: float, **conditions: Any) -> np.ndarray:
    """d ln E/d ln f between two frequencies, one value for each packing that has both."""
    a = {p["seed"]: float(s[name]) for p, s in results.select(frequency=low, **conditions)}
    b = {p["seed"]: float(s[name]) for p, s in results.select(frequency=high, **conditions)}
    return np.array([np.log(b[k] / a[k]) / np.log(high / low) for k in sorted(set(a) & set(b))])


def _mean(values: np.ndarray) -> tuple[float, float]:
    from ..analysis.speed import mean_error

    mean, error = mean_error(values) if len(values) else (np.nan, np.nan)
    return float(mean), float(error)


@styled
def draw(results: Results) -> Figure | None:
    if not results.frequencies():
        return None
    figure = Figure(figsize=(6.8, 4.2), layout="constrained")
    grid = figure.add_gridspec(2, 2)
    series, bed, body = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    for f in results.frequencies():
        for p, _ in results.select(frequency=f)[:1]:
            run = results.full(p)
            if run is not None:
                t = run["time"].values
                kept = t < 1.0
                series.plot(t[kept], 1e6 * run["bed_energy"].values[kept], color=BY_FREQUENCY.get(f, "#999999"),
                            linewidth=0.8, label=f"{f:g} Hz")  # fmt: skip
    series.set_xlabel("time [s]")
    series.set_ylabel("bed [µJ]")
    legend(series, ncols=3, fontsize=7)
    curve(bed, results, "bed_energy", 1e6, color="#0072b2")
    curve(body, results, "swimmer_energy", 1e6, color="#d55e00")
    frequency_axis(bed, "bed, mean [µJ]")
    frequency_axis(body, "swimmer, mean [µJ]")
    return figure


CLAIM = Claim("F7", "Kinetic energy of bed and swimmer", "Fig. 7", ("free",), judge, draw)
