"""Figures of what predictions miss: innovations, and where they stand out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from ..inference.data import Case
from ..inference.tracks.fitted import Fit
from ..inference.tracks.innovations import WindowMap
from ..inference.tracks.model import TrackFinding
from .style import (
    COLOURS,
    FLOOR,
    WIDTH,
    compact,
    legend_above,
    plain,
    prefixed,
    shortened,
    styled,
)
from .track_drawing import HEAT, LABELS, MOST, SIZES, span_of, time_unit, with_gaps


@styled
def innovations(diagnosis: TrackFinding) -> Figure:
    """Innovations of the training part [s.d. of the noise], over time and by body, before and after."""
    before = "recalibrated" if diagnosis.recalibrated.hypothesis.terms else "naive"
    pair = [(before, diagnosis.recalibrated)]
    if diagnosis.found:
        pair.append(("revised", diagnosis.revised))
    elif before == "recalibrated":
        pair.insert(0, ("naive", diagnosis.naive))
    training = [c for c in diagnosis.cases if c.name in diagnosis.recalibrated.innovations]
    bodies = list(dict.fromkeys(b for c in training for b in c.bodies))
    sizes = {b: [_rms(_of_body(fit, training, b)) for _, fit in pair] for b in bodies}
    if len(bodies) > MOST:
        keep = set(sorted(bodies, key=lambda b: -max(sizes[b]))[:MOST])
        bodies = [b for b in bodies if b in keep]
    height = 2.5 if len(bodies) == 1 else 1.35 if len(bodies) <= 4 else 0.78
    figure = Figure(figsize=(WIDTH, height * len(bodies) + 0.75), layout="constrained")
    grid = figure.add_gridspec(len(bodies), 2, width_ratios=[3.4, 1])
    worst = max((span_of(fit.used(c.name)) for _, fit in pair for c in training), default=1.0)
    bent = worst > 12
    first: Axes | None = None
    seconds, second = time_unit(np.concatenate([c.t[c.training] for c in training]))
    for row, body in enumerate(bodies):
        axis = figure.add_subplot(grid[row, 0], sharex=first, sharey=first)
        first = first or axis
        axis.axhspan(-2, 2, facecolor="#e4e4e4", edgecolor="none", zorder=0)
        count = 0
        for order, (name, fit) in enumerate(pair):
            for case in training:
                for k, channel in enumerate(case.channels):
                    if channel.body != body:
                        continue
                    t, r = with_gaps(case.t, fit.innovations[case.name][:, k])
                    count += len(t)
                    axis.plot(
                        t * seconds, r, "o", color=COLOURS[name], markeredgewidth=0, zorder=2 + order,
                        markersize=1.5 if len(t) > 300 else 2.4, alpha=0.6 if len(t) > 300 else 0.8,
                    )  # fmt: skip
        if bent:
            axis.set_yscale("symlog", linthresh=3, linscale=0.6)
            axis.yaxis.set_minor_locator(NullLocator())
            _bent_ticks(axis, worst, few=height < 1)
        if len(bodies) > 1:
            axis.text(
                0.005, 0.97, plain(body), transform=axis.transAxes, va="top", fontsize=8, zorder=9,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1},
            )  # fmt: skip
        if row < len(bodies) - 1:
            axis.tick_params(labelbottom=False)
        else:
            axis.set_xlabel(f"time [{second}]")
    assert first is not None
    figure.supylabel("seen minus predicted [s.d. of the noise]", fontsize=9)
    side = figure.add_subplot(grid[:, 1])
    rows = np.arange(len(bodies))
    values = np.maximum(np.array([sizes[b] for b in bodies]), 1e-3)
    side.axvline(1.0, color=FLOOR, linestyle=(0, (1, 1.5)), zorder=1)
    for k, (name, _) in enumerate(pair):
        side.plot(values[:, k], rows, "o", color=COLOURS[name], markersize=SIZES[name], zorder=3 + k)
    if len(pair) == 2:
        for row in range(len(bodies)):
            side.plot(values[row], [row, row], color="#c4c4c4", linewidth=1.2, zorder=2)
    side.set_ylim(len(bodies) - 0.5, -0.5)
    side.set_yticks(rows, [shortened(b, 12) for b in bodies] if len(bodies) > 1 else [""])
    side.yaxis.tick_right()
    side.tick_params(axis="y", length=0)
    side.spines["left"].set_visible(False)
    _log_if_wide(side, values)
    side.set_xlabel("rms [s.d.]")
    handles: list[Any] = [
        Line2D([], [], color=COLOURS[n], marker="o", linestyle="none", markersize=5, label=LABELS[n])
        for n, _ in pair
    ]
    handles.append(Patch(facecolor="#e4e4e4", label="within 2 s.d."))
    handles.append(Line2D([], [], color=FLOOR, linestyle=(0, (1, 1.5)), label="noise"))
    legend_above(figure, handles)
    return figure


def _of_body(fit: Fit, cases: Sequence[Case], body: str) -> np.ndarray:
    parts = [
        fit.innovations[c.name][:, k]
        for c in cases
        for k, channel in enumerate(c.channels)
        if channel.body == body
    ]
    values = np.concatenate(parts) if parts else np.zeros(0)
    return values[np.isfinite(values)]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _bent_ticks(axis: Axes, worst: float, *, few: bool) -> None:
    top = math.floor(math.log10(max(worst, 10)))
    powers = [10**k for k in range(1, top + 1)]
    if few:
        powers = powers[-1:]
    elif len(powers) > 2:
        powers = powers[::-2][::-1]
    ticks = [-p for p in reversed(powers)] + [0] + powers
    names = [f"{t:.0f}".replace("-", "−") if abs(t) < 1e4 else compact(t) for t in ticks]
    axis.yaxis.set_major_locator(FixedLocator(ticks))
    axis.yaxis.set_major_formatter(FixedFormatter(names))


def _log_if_wide(axis: Axes, values: np.ndarray) -> None:
    """A logarithmic x axis where the numbers differ by more than ten times, from zero otherwise."""
    values = values[np.isfinite(values) & (values > 0)]
    if len(values) and values.max() > 10 * min(values.min(), 1.0):
        axis.set_xscale("log")
        low, high = min(values.min(), 1.0), values.max()
        axis.set_xlim(low / 2, high * 2)
        decades = math.log10(high / low)
        axis.xaxis.set_major_locator(
            FixedLocator([10.0**k for k in range(-4, 12, 1 if decades < 3.2 else 2)])
        )
        axis.xaxis.set_minor_locator(NullLocator())
        axis.xaxis.set_major_formatter(
            lambda v, _: f"{v:g}" if 1e-3 < v < 9999 else compact(v).replace("1.0×", "")
        )
    else:
        axis.set_xlim(0, max(values.max() * 1.15, 1.3) if len(values) else 1.3)


@styled
def windows(found: WindowMap, cases: Sequence[Case]) -> Figure:
    """Short windows, each started anew: z of their misfit over time by body, against speed, and in place."""
    rows = [dict(row) for row in found.rows]
    # beyond 37 the tail of chi2 underflows and z says no more
    ceiling = sum(row["z"] >= 36.9 for row in rows) > len(rows) / 2
    what = "misfit [times expected]" if ceiling else "misfit z [s.d.]"
    for row in rows:
        row["label"] = _row_label(row, found)
        if ceiling:
            row["z"] = math.sqrt(row["chi2"] / row["dof"])
    labels = list(dict.fromkeys(row["label"] for row in rows))
    if len(labels) > 30:
        worst = {name: max(r["z"] for r in rows if r["label"] == name) for name in labels}
        keep = set(sorted(labels, key=lambda n: -worst[n])[:30])
        labels = [n for n in labels if n in keep]
        rows = [r for r in rows if r["label"] in keep]
    top = max(max((r["z"] for r in rows), default=5.0), 5.0)
    norm = Normalize(0.0, top)
    speeds = [r for r in rows if r["speed"]]
    places = [r for r in rows if r["x"] or r["y"]]
    height = max(0.9, 0.22 * len(labels)) + 0.7
    below = 2.5 if speeds or places else 0.0
    figure = Figure(figsize=(WIDTH, height + below), layout="constrained")
    grid = figure.add_gridspec(2 if below else 1, 2, height_ratios=[height, below] if below else [1])
    axis = figure.add_subplot(grid[0, :])
    factor, second = time_unit(np.array([t for r in rows for t in r["t"]] or [1.0]))
    for r in rows:
        begin, end = r["t"][0] * factor, r["t"][1] * factor
        axis.add_patch(
            Rectangle((begin, labels.index(r["label"]) - 0.42), end - begin, 0.84,
                      facecolor=HEAT(norm(max(r["z"], 0.0))),
                      edgecolor="white", linewidth=0.8)
        )  # fmt: skip
    times = [t * factor for r in rows for t in r["t"]] or [0.0, 1.0]
    axis.set_xlim(min(times), max(times))
    axis.set_ylim(len(labels) - 0.5, -0.5)
    axis.set_yticks(range(len(labels)), [shortened(n, 24) for n in labels])
    axis.tick_params(axis="y", length=0)
    axis.spines["left"].set_visible(False)
    axis.set_xlabel(f"time [{second}]")
    figure.colorbar(
        ScalarMappable(norm, HEAT),
        ax=axis,
        label="× expected" if ceiling else "misfit z",
        pad=0.015,
        aspect=max(6, 4 * height),
        fraction=0.06,
    )
    if below:
        wide = grid[1, :] if not (speeds and places) else None
        if speeds:
            _draw_speeds(figure.add_subplot(wide or grid[1, 0]), speeds, norm, what)
        if places:
            _draw_places(figure.add_subplot(wide or grid[1, 1]), places, cases, norm, what)
    return figure


def _row_label(row: Mapping[str, Any], found: WindowMap) -> str:
    bodies = {r["body"] for r in found.rows if r["case"] == row["case"]}
    recordings = {r["case"] for r in found.rows}
    if len(recordings) == 1:
        return str(row["body"])
    return str(row["case"]) if len(bodies) == 1 else f"{row['case']}: {row['body']}"


def _draw_speeds(axis: Axes, rows: Sequence[Mapping[str, Any]], norm: Normalize, what: str) -> None:
    factor, unit = prefixed("m/s", max(r["speed"][1] for r in rows))
    segments = [[(r["speed"][0] * factor, r["z"]), (r["speed"][1] * factor, r["z"])] for r in rows]
    colours = [HEAT(norm(max(r["z"], 0.0))) for r in rows]
    axis.add_collection(LineCollection(segments, colors="#00000040", linewidths=3.6, capstyle="round"))
    axis.add_collection(LineCollection(segments, colors=colours, linewidths=2.6, capstyle="round"))
    axis.axhline(0, color="#bbbbbb", linewidth=0.7, zorder=0)
    axis.set_xlim(0, max(r["speed"][1] for r in rows) * factor * 1.04)
    z = [r["z"] for r in rows]
    axis.set_ylim(min(-1.0, *z) - 0.06 * max(z), max(4.0, *z) * 1.08)
    axis.set_xlabel(f"speed in the window [{unit}]")
    axis.set_ylabel(what)
    axis.set_title("against speed")


def _draw_places(
    axis: Axes, rows: Sequence[Mapping[str, Any]], cases: Sequence[Case], norm: Normalize, what: str
) -> None:
    by_name = {c.name: c for c in cases}
    flat = all(r["x"] and r["y"] and np.ptp(r["x"]) > 0 and np.ptp(r["y"]) > 0 for r in rows)
    ordered = sorted(rows, key=lambda r: r["z"])
    if flat:
        sizes = [abs(v) for r in rows for key in "xy" for v in r[key]]
        factor, unit = prefixed("m", max(sizes))
        for r in ordered:
            case = by_name.get(r["case"])
            if case is None:
                continue
            part = (case.t >= r["t"][0]) & (case.t <= r["t"][1])
            xy = case.recording.unwrapped().xy[part, case.recording.ids.index(r["body"])] * factor
            xy = xy[np.isfinite(xy).all(axis=1)]
            axis.plot(xy[:, 0], xy[:, 1], color="#00000040", linewidth=3.6)
            axis.plot(xy[:, 0], xy[:, 1], color=HEAT(norm(max(r["z"], 0.0))), linewidth=2.6)
        axis.set_aspect("equal", adjustable="datalim")
        axis.set_xlabel(f"x [{unit}]")
        axis.set_ylabel(f"y [{unit}]")
        axis.set_title("in place")
        return
    key = max("xy", key=lambda a: max((float(np.ptp(r[a])) for r in rows if r[a]), default=0.0))
    rows = [r for r in rows if r[key]]
    factor, unit = prefixed("m", max(abs(v) for r in rows for v in r[key]))
    segments = [[(r[key][0] * factor, r["z"]), (r[key][1] * factor, r["z"])] for r in rows]
    axis.add_collection(LineCollection(segments, colors="#00000040", linewidths=3.6, capstyle="round"))
    axis.add_collection(
        LineCollection(
            segments, colors=[HEAT(norm(max(r["z"], 0.0))) for r in rows], linewidths=2.6, capstyle="round"
        )
    )
    axis.axhline(0, color="#bbbbbb", linewidth=0.7, zorder=0)
    axis.autoscale_view()
    axis.set_xlabel(f"{key} in the window [{unit}]")
    axis.set_ylabel(what)
    axis.set_title("against place")
