"""Figures of tracks and simulations over one another, and of their distance over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from ..inference.data import Case
from ..inference.tracks.model import TrackFinding
from ..walls import outline
from .style import (
    FLOOR,
    SEEN,
    SHADE,
    WIDTH,
    legend_above,
    panels,
    prefixed,
    shortened,
    styled,
)
from .track_drawing import (
    LINES,
    MANY_TURNS,
    MOST,
    broken,
    chosen_cases,
    in_the_plane,
    legend_handles,
    models,
    predicted,
    shade_held_out,
    span_of,
    time_unit,
    turns_of,
)

MARGIN = 0.15  # of the larger side, around the measured tracks


@styled
def overlay(diagnosis: TrackFinding) -> Figure:
    """Track and simulation: free bodies in the plane, disks to scale; angles and coordinates over time."""
    cases = chosen_cases(diagnosis)
    flat = all(in_the_plane(c) for c in cases)
    items: list[tuple[Case, int | None]] = []
    for case in cases:
        items += [(case, None)] if flat else [(case, k) for k in range(len(case.channels))]
    items = items[:MOST]
    names = models(diagnosis)
    turns = max((turns_of(c.values[:, k], float(c.sigma[k])) for c, k in items if k is not None), default=0)
    if len(items) == 1 and items[0][1] is not None and turns > MANY_TURNS:
        return _long_track(diagnosis, items[0][0], items[0][1], names, turns)
    if flat:
        columns, height = (1, 3.6) if len(items) == 1 else (2, 2.9) if len(items) <= 4 else (3, 2.3)
    else:
        columns, height = (1, 2.5) if len(items) <= 2 else (2, 1.9) if len(items) <= 4 else (3, 1.75)
    figure, axes = panels(len(items), columns=columns, height=height, top=0.35)
    for position, (axis, (case, channel)) in enumerate(zip(axes, items, strict=True)):
        if channel is None:
            _draw_plane(axis, diagnosis, case, names)
        else:
            last_row = position >= len(items) - columns
            _draw_time(axis, diagnosis, case, channel, names, label_time=last_row)
        title = (
            case.name
            if channel is None or len(case.channels) == 1
            else _channel_name(case, channel, with_case=len(cases) > 1)
        )
        if len(items) > 1:
            axis.set_title(shortened(title))
    _label_once(axes, columns)
    legend_above(figure, legend_handles(names, any(c.scored.any() for c, _ in items)))
    return figure


def _label_once(axes: Sequence[Axes], columns: int) -> None:
    """The label of y at the left column only, where all panels have the same."""
    if len({axis.get_ylabel() for axis in axes}) == 1:
        for position, axis in enumerate(axes):
            if position % columns:
                axis.set_ylabel("")


def _channel_name(case: Case, k: int, *, with_case: bool) -> str:
    channel = case.channels[k]
    name = f"{channel.kind} of {channel.body}"
    return f"{case.name}: {name}" if with_case else name


def _draw_time(
    axis: Axes, diagnosis: TrackFinding, case: Case, k: int, names: Sequence[str], *, label_time: bool = True,
    span: tuple[float, float] | None = None,
) -> None:  # fmt: skip
    use = np.ones(len(case.t), dtype=bool) if span is None else (case.t >= span[0]) & (case.t <= span[1])
    unit = "rad" if case.channels[k].kind == "angle" else "m"
    factor, label = prefixed(unit, span_of(case.values[:, k]))
    seconds, second = time_unit(case.t)
    shade_held_out(axis, case, seconds)
    dense = use.sum() > 400 and span is None
    axis.plot(
        case.t[use] * seconds, case.values[use, k] * factor, "o", color=SEEN, zorder=2,
        markersize=1.0 if dense else 2.2 if use.sum() > 60 else 3.2,
        markeredgewidth=0, alpha=0.55 if dense else 0.9,
    )  # fmt: skip
    for name in names:
        told = predicted(diagnosis, name, case)[use, k]
        t, values = broken(case.t[use], np.isfinite(case.values[use, k]), case.t[use], told)
        style = dict(LINES[name])
        if dense:
            style |= {"linewidth": 0.8, "linestyle": "-", "zorder": 9 - style["zorder"]}
        axis.plot(t * seconds, values * factor, **style)
    lo, hi = (case.t[0], case.t[-1]) if span is None else span
    axis.set_xlim(lo * seconds, hi * seconds)
    # a prediction that runs away must not flatten what was seen
    seen = case.values[use, k]
    seen = seen[np.isfinite(seen)]
    if len(seen):
        room = max(float(np.ptp(seen)), 10 * float(case.sigma[k]), 1e-300)
        low, high = axis.get_ylim()
        axis.set_ylim(
            max(low, (float(seen.min()) - 0.6 * room) * factor),
            min(high, (float(seen.max()) + 0.6 * room) * factor),
        )
    axis.yaxis.set_major_locator(MaxNLocator(5))
    axis.set_ylabel(f"{case.channels[k].kind} [{label}]")
    if label_time:
        axis.set_xlabel(f"time [{second}]")


def _long_track(diagnosis: TrackFinding, case: Case, k: int, names: Sequence[str], turns: int) -> Figure:
    """A long oscillation: all of it, and four swings each at its start, at the split and at its end."""
    figure = Figure(figsize=(WIDTH, 4.8), layout="constrained")
    grid = figure.add_gridspec(2, 3)
    whole = figure.add_subplot(grid[0, :])
    _draw_time(whole, diagnosis, case, k, names)
    begin, end = float(case.t[0]), float(case.t[-1])
    length = min(8.0 * (end - begin) / max(turns, 1), (end - begin) / 4)
    split = float(case.t[case.scored][0]) if case.scored.any() else (begin + end) / 2
    spans = [(begin, begin + length), (split - length / 2, split + length / 2), (end - length, end)]
    for column, span in enumerate(spans):
        axis = figure.add_subplot(grid[1, column])
        _draw_time(axis, diagnosis, case, k, names, span=span)
        axis.set_title(
            ("the start", "where training ends" if case.scored.any() else "the middle", "the end")[column]
        )
        axis.xaxis.set_major_locator(MaxNLocator(4))
        if column:
            axis.set_ylabel("")
    legend_above(figure, legend_handles(names, bool(case.scored.any())))
    return figure


def _draw_plane(axis: Axes, diagnosis: TrackFinding, case: Case, names: Sequence[str]) -> None:
    scene = case.recording.scene
    size = max(span_of(case.values), 1e-12)
    factor, unit = prefixed("m", size)
    columns = {b: [k for k, c in enumerate(case.channels) if c.body == b] for b in case.bodies}
    simulated = {name: predicted(diagnosis, name, case) for name in names}
    disks: list[Circle] = []
    for wall in (b for b in scene.bodies if not b.mobile and b.initial is not None):
        assert wall.initial is not None
        disks.append(Circle((wall.initial[0] * factor, wall.initial[1] * factor), wall.radius * factor))
    axis.add_collection(PatchCollection(disks, facecolor="#cfcfcf", edgecolor="none", zorder=0))
    corners = [factor * outline(wall) for wall in scene.walls]
    grey = "#cfcfcf"
    axis.add_collection(
        PolyCollection(corners, facecolors=grey, edgecolors=grey, linewidths=1.5, zorder=0), autolim=False
    )
    for item in scene.laws:
        anchor = item.values.get("anchor")
        if anchor is not None:
            axis.plot(anchor[0] * factor, anchor[1] * factor, "+", color=SEEN, markersize=7, zorder=2)
    for body, (kx, ky) in columns.items():
        radius = scene.body(body).radius * factor
        x, y = case.values[:, kx] * factor, case.values[:, ky] * factor
        seen = np.isfinite(x) & np.isfinite(y)
        if not seen.any():
            continue
        if (case.scored & seen).any():
            held = [np.where(case.scored & seen, v, np.nan) for v in (x, y)]
            axis.plot(*broken(case.t, seen, *held), color=SHADE, linewidth=11, zorder=0, solid_capstyle="butt")
        axis.plot(x[seen], y[seen], "o", color=SEEN, markersize=2.0, markeredgewidth=0, alpha=0.8, zorder=2)
        at = np.flatnonzero(seen)
        axis.add_patch(
            Circle(
                (x[at[0]], y[at[0]]),
                radius,
                facecolor="none",
                edgecolor=SEEN,
                linewidth=0.8,
                alpha=0.5,
                zorder=2,
            )
        )
        axis.add_patch(
            Circle(
                (x[at[-1]], y[at[-1]]), radius, facecolor="#22222222", edgecolor=SEEN, linewidth=0.9, zorder=2
            )
        )
        # the name stands behind the disk, away from its track
        away = np.array([x[at[0]] - x[at[-1]], y[at[0]] - y[at[-1]]])
        away = away / max(float(np.hypot(*away)), 1e-12)
        axis.annotate(
            shortened(body, 14), (x[at[0]] + away[0] * radius, y[at[0]] + away[1] * radius),
            xytext=tuple(4 * away), textcoords="offset points", fontsize=8, color=SEEN, zorder=7,
            ha="left" if away[0] > 0.4 else "right" if away[0] < -0.4 else "center",
            va="bottom" if away[1] > 0.4 else "top" if away[1] < -0.4 else "center",
        )  # fmt: skip
        for name in names:
            px, py = simulated[name][:, kx] * factor, simulated[name][:, ky] * factor
            use = np.isfinite(px) & np.isfinite(py)
            if not use.any():
                continue
            axis.plot(*broken(case.t, seen, px, py), **LINES[name])
            last = np.flatnonzero(use)[-1]
            axis.add_patch(
                Circle((px[last], py[last]), radius, facecolor="none", edgecolor=LINES[name]["color"],
                       linewidth=1.2, zorder=LINES[name]["zorder"])
            )  # fmt: skip
    axis.set_aspect("equal", adjustable="datalim")
    _frame_tracks(axis, case, columns, factor)
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.yaxis.set_major_locator(MaxNLocator(5))
    axis.set_xlabel(f"x [{unit}]")
    axis.set_ylabel(f"y [{unit}]")


def _frame_tracks(axis: Axes, case: Case, columns: Mapping[str, Sequence[int]], factor: float) -> None:
    """The measured disks with a margin: a prediction that runs away must not make them small."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for body, pair in columns.items():
        places = case.values[:, list(pair)]
        places = places[np.isfinite(places).all(axis=1)]
        if len(places):
            radius = case.recording.scene.body(body).radius
            low = np.minimum(low, places.min(axis=0) - radius)
            high = np.maximum(high, places.max(axis=0) + radius)
    if np.isfinite(low).all():
        room = MARGIN * float((high - low).max())
        # not fixed: one side grows to the shape of the panel
        axis.set_xlim((low[0] - room) * factor, (high[0] + room) * factor, auto=True)
        axis.set_ylim((low[1] - room) * factor, (high[1] + room) * factor, auto=True)


@styled
def errors_over_time(diagnosis: TrackFinding) -> Figure:
    """Seen minus predicted over time. One channel: with its sign; several: their rms in each frame."""
    cases = chosen_cases(diagnosis)
    names = models(diagnosis)
    columns, height = (1, 2.6) if len(cases) == 1 else (2, 2.1) if len(cases) <= 4 else (3, 1.8)
    figure, axes = panels(len(cases), columns=columns, height=height, top=0.35)
    noise = False
    for position, (axis, case) in enumerate(zip(axes, cases, strict=True)):
        noise |= _draw_errors(axis, diagnosis, case, names)
        if len(cases) > 1:
            axis.set_title(shortened(case.name))
        if position >= len(cases) - columns:
            axis.set_xlabel(f"time [{time_unit(case.t)[1]}]")
    _label_once(axes, columns)
    handles = legend_handles(names, any(c.scored.any() for c in cases))[1:]
    if noise:
        handles.append(Line2D([], [], color=FLOOR, linestyle=(0, (1, 1.5)), label="noise, 1 s.d."))
    legend_above(figure, handles)
    return figure


def _draw_errors(axis: Axes, diagnosis: TrackFinding, case: Case, names: Sequence[str]) -> bool:
    errors = {name: case.values - predicted(diagnosis, name, case) for name in names}
    single = len(case.channels) == 1
    unit = "rad" if case.unit == "rad rms" else "m"
    sigma = float(np.sqrt(np.mean(case.sigma**2)))
    curves = {}
    for name, array in errors.items():
        if single:
            curves[name] = array[:, 0]
        else:
            count = np.isfinite(array).sum(axis=1)
            squares = np.nansum(array**2, axis=1)
            curves[name] = np.where(count > 0, np.sqrt(squares / np.maximum(count, 1)), np.nan)
    largest = max(span_of(v) for v in curves.values())
    factor, label = prefixed(unit, largest)
    seconds, _ = time_unit(case.t)
    shade_held_out(axis, case, seconds)
    ends = [float(np.sqrt(np.nanmean(v**2))) for v in curves.values() if np.isfinite(v).any()]
    logarithmic = not single and bool(ends) and max(ends) > 20 * max(min(ends), 1e-300)
    for name, curve in curves.items():
        t, values = broken(case.t, np.isfinite(case.values).any(axis=1), case.t, curve)
        style = dict(LINES[name])
        if len(t) > 400:
            style |= {"linewidth": 0.7, "linestyle": "-", "zorder": 9 - style["zorder"]}
        if logarithmic:
            values = np.maximum(values, 1e-3 * sigma)
        axis.plot(t * seconds, values * factor, **style)
    drawn = False
    if single:
        axis.axhline(0, color="#bbbbbb", linewidth=0.7, zorder=1)
        # below a pixel a line for the noise says nothing
        if sigma > 0.01 * largest:
            for sign in (-1, 1):
                axis.axhline(
                    sign * sigma * factor, color=FLOOR, linewidth=0.9, linestyle=(0, (1, 1.5)), zorder=6
                )
            drawn = True
    else:
        axis.axhline(sigma * factor, color=FLOOR, linewidth=0.9, linestyle=(0, (1, 1.5)), zorder=6)
        drawn = True
        if logarithmic:
            axis.set_yscale("log")
        else:
            axis.set_ylim(bottom=0)
    if not logarithmic:
        axis.yaxis.set_major_locator(MaxNLocator(5))
    axis.set_xlim(case.t[0] * seconds, case.t[-1] * seconds)
    axis.set_ylabel(f"error [{label}]")
    return drawn
