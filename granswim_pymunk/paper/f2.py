"""F2: the bed, and shapes of the swimmer in the co-moving frame at 4, 9 and 15 Hz."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ..packing import pack
from .claim import FAILS, HOLDS, OPEN, Claim, Finding, above, number
from .draw import styled
from .results import Results
from .scenes import paper_scene

THREE = (4.0, 9.0, 15.0)


def _last_over_first(amplitude: np.ndarray) -> float:
    return float(amplitude[-1] / amplitude[0])


def _lag(lag: np.ndarray) -> float:
    return float(lag[-1] - lag[0])


def judge(results: Results) -> list[Finding]:
    from ..analysis.speed import mean_error

    findings = []
    ratio: dict[float, tuple[float, float, int]] = {}
    lag: dict[float, tuple[float, float, int]] = {}
    for f in THREE:
        amplitudes, lags = results.values("segment_amplitude", frequency=f), results.values("segment_lag", frequency=f)
        n = len(amplitudes)
        if n:
            mean, error = mean_error(np.array([_last_over_first(a) for a in amplitudes]))
            ratio[f] = float(mean), float(error), n
            mean, error = mean_error(np.array([_lag(a) for a in lags]))
            lag[f] = float(mean), float(error), n
        else:
            ratio[f] = lag[f] = (np.nan, np.nan, 0)
    r, d, n = ratio[4.0]
    rigid = lag[4.0]
    # a rod: the last segment turns about as much as the first, and with it
    verdicts = {above(-r, d, -1.5), above(r, d, 0.67), above(-abs(rigid[0]), rigid[1], -np.pi / 4)}
    findings.append(
        Finding(
            says="4 Hz: rigid rod",
            measured=f"last segment swings {number(r, d)} times the first, "
            f"{number(rigid[0], rigid[1], 'rad')} behind it",
            verdict=FAILS if FAILS in verdicts else OPEN if OPEN in verdicts else HOLDS,
            value=rigid[0], error=rigid[1], unit="rad", packings=n,
            note="rod: amplitude ratio 0.67 to 1.5 and a lag below pi/4",
        )
    )  # fmt: skip
    r, d, n = lag[9.0]
    findings.append(
        Finding(
            says="9 Hz: a delay propagates to the tail (wavy)",
            measured=f"the last segment is {number(r, d, 'rad')} behind the first",
            verdict=above(r, d, np.pi / 2), value=r, error=d, unit="rad", packings=n,
            note="wavy: a lag above pi/2",
        )
    )  # fmt: skip
    r, d, n = results.difference("tail_swing", {"frequency": 15.0}, {"frequency": 9.0})
    a, b = results.mean("tail_swing", frequency=9.0), results.mean("tail_swing", frequency=15.0)
    findings.append(
        Finding(
            says="15 Hz: tail oscillations shrink",
            measured=f"tail swings {number(a[0], a[1], 'mm', 1e3)} at 9 Hz, {number(b[0], b[1], 'mm', 1e3)} at 15 Hz",
            verdict=above(-r, d), value=r, error=d, unit="m", packings=n,
        )
    )  # fmt: skip
    return findings


@styled
def draw(results: Results) -> Figure | None:
    shown = [(f, results.shapes(frequency=f)) for f in THREE]
    if not any(shapes for _, shapes in shown):
        return None
    figure = Figure(figsize=(6.8, 5.6), layout="constrained")
    top, bottom = np.atleast_1d(np.asarray(figure.subfigures(2, 1, height_ratios=(3.1, 2.5))))
    _bed(top.subplots())
    axes = bottom.subplots(1, 3, sharex=True, sharey=True)
    for axis, (f, shapes) in zip(axes, shown, strict=True):
        if shapes:
            for k, shape in enumerate(shapes[0]):
                axis.plot(*(1e3 * shape.T), color="#0072b2", alpha=0.15 + 0.85 * k / len(shapes[0]), linewidth=1)
                axis.plot(*(1e3 * shape[0]), "o", color="#e6ab02", markersize=4, zorder=3)
        axis.set_title(f"({'bcd'[THREE.index(f)]}) {f:g} Hz, one cycle")
        axis.set_xlabel("x [mm]")
        axis.set_aspect("equal")
    axes[0].set_ylabel("y [mm]")
    return figure


def _bed(axis: Axes) -> None:
    """The swimmer in its bed before the first step: yellow the head, blue the other disks."""
    scene = pack(paper_scene(seed=1))
    colours = {"head": "#e6ab02", "tail": "#0072b2", "grain": "#d9d9d9", "wall": "#7f7f7f"}
    period = scene.periodic_x or 0.0
    circles, colour = [], []
    for body in scene.bodies:
        if body.initial is not None:
            x = body.initial[0] % period if period else body.initial[0]
            circles.append(Circle((1e3 * x, 1e3 * body.initial[1]), 1e3 * body.radius))
            colour.append(colours[body.role])
    axis.add_collection(PatchCollection(circles, facecolor=colour, edgecolor="white", linewidth=0.2))
    axis.set_xlim(0, 1e3 * period)
    axis.autoscale_view(scalex=False)
    axis.set_aspect("equal")
    axis.set_title("(a) the bed, periodic along x")
    axis.set_xlabel("x [mm]")
    axis.set_ylabel("y [mm]")


CLAIM = Claim("F2", "Shapes of the swimmer", "Fig. 2", ("free",), judge, draw)
