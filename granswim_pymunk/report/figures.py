"""The pictures of a diagnosis, each a function that returns a matplotlib Figure and can be used alone.

    figure = overlay(diagnosis)
    figure.savefig("overlay.png")

No window system is touched: figures are built without pyplot and saved by the Agg canvas.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle
from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator, NullLocator

from ..diagnosis.data import Case
from ..diagnosis.fitted import Fit
from ..diagnosis.innovations import Whiteness, WindowMap
from ..diagnosis.name import Trial
from ..diagnosis.tracks import TrackFinding
from ..inference.mechanisms import APPARATUS
from ..inference.significance import Null
from ..joints import arm_of, hinged, place
from ..laws import Law, all_laws
from ..scene import Scene
from ..walls import outline
from .style import (
    COLOURS,
    FLOOR,
    MUTED,
    REVISED,
    SEEN,
    SHADE,
    WIDTH,
    Drawing,
    compact,
    legend_above,
    panels,
    plain,
    prefixed,
    shortened,
    styled,
)
from .words import number

MOST = 12  # small panels in one figure
MANY_TURNS = 14  # turning points of a track beyond which one panel shows it no longer
LABELS = {
    "naive": "naive scene",
    "recalibrated": "recalibrated",
    "revised": "revised",
    "seen": "seen",
    "held": "held out",
}
_LINES: dict[str, dict[str, Any]] = {
    # dashes lie on the solid line, so that both are seen where they coincide
    "naive": {"color": COLOURS["naive"], "linestyle": (0, (3.6, 2.4)), "linewidth": 1.3, "zorder": 6},
    "recalibrated": {
        "color": COLOURS["recalibrated"],
        "linestyle": (0, (1.3, 1.6)),
        "linewidth": 1.7,
        "zorder": 5,
    },
    "revised": {"color": COLOURS["revised"], "linestyle": "-", "linewidth": 1.5, "zorder": 4},
}
SIZES = {"naive": 7.5, "recalibrated": 6.5, "revised": 5.0}
HEAT = LinearSegmentedColormap.from_list("mismatch", ["#e9e9e6", "#f5cf7a", "#e8823a", "#b8312f", "#5e1034"])


# ---- what is drawn ------------------------------------------------------------------------------


def models(diagnosis: TrackFinding) -> tuple[str, ...]:
    """Hypotheses that differ: naive, recalibrated if something is adjustable, revised if a law was found."""
    result = ["naive"]
    if diagnosis.recalibrated.hypothesis.terms:
        result.append("recalibrated")
    if diagnosis.found:
        result.append("revised")
    return tuple(result)


def fit_of(diagnosis: TrackFinding, model: str) -> Fit:
    fits = {"naive": diagnosis.naive, "recalibrated": diagnosis.recalibrated, "revised": diagnosis.revised}
    return fits[model]


def predicted(diagnosis: TrackFinding, model: str, case: Case) -> np.ndarray:
    """Predicted channels (T, c) [m or rad] of a recording, NaN where there is no prediction.

    Held-out frames as they were predicted; the others, where that covers windows alone, as they were fitted.
    """
    errors = diagnosis.held.get(model)
    innovations = fit_of(diagnosis, model).innovations.get(case.name)
    fitted = np.full(case.values.shape, np.nan) if innovations is None else case.values - innovations * case.sigma
    if errors is not None and errors.predicted is not None and case.name in errors.predicted:
        told = errors.predicted[case.name]
        return np.where(np.isfinite(told) | ~case.training[:, None], told, fitted)
    return fitted


def chosen_cases(diagnosis: TrackFinding, most: int = MOST) -> list[Case]:
    """The recordings a figure shows: held-out ones first, and training ones where all have room."""
    held = [c for c in diagnosis.cases if c.held_out]
    rest = [c for c in diagnosis.cases if not c.held_out]
    if len(held) + len(rest) <= most:
        return rest + held
    if not held:
        held = rest
    worst = diagnosis.held.get("naive")
    by_case = worst.by_case if worst is not None else {}
    if len(held) > most:
        held = sorted(held, key=lambda c: -by_case.get(c.name, 0.0))[:most]
        held.sort(key=lambda c: c.name)
    return held


def _turns(values: np.ndarray, sigma: float) -> int:
    """Turning points of a track (T,), those smaller than the noise left out."""
    values = values[np.isfinite(values)]
    if len(values) < 3:
        return 0
    least = max(6 * sigma, 0.02 * float(np.ptp(values)))
    turns, direction = 0, 0
    low = high = float(values[0])  # extremes since the last turn
    for value in values:
        low, high = min(low, float(value)), max(high, float(value))
        if direction >= 0 and value < high - least:
            turns += direction > 0
            direction, low = -1, float(value)
        elif direction <= 0 and value > low + least:
            turns += direction < 0
            direction, high = 1, float(value)
    return turns


def in_the_plane(case: Case) -> bool:
    """Whether a recording is drawn in the plane: x and y seen of every body, few turns, no rod."""
    kinds: dict[str, set[str]] = {}
    for channel in case.channels:
        kinds.setdefault(channel.body, set()).add(channel.kind)
    if any(kind != {"x", "y"} for kind in kinds.values()):
        return False
    return all(_turns(case.values[:, k], float(case.sigma[k])) <= 6 for k in range(len(case.channels)))


def _handles(names: Sequence[str], held: bool) -> list[Any]:
    handles: list[Any] = [
        Line2D([], [], color=SEEN, marker="o", markersize=3, linestyle="none", label=LABELS["seen"])
    ]
    for name in names:
        style = {k: v for k, v in _LINES[name].items() if k != "zorder"}
        handles.append(Line2D([], [], label=LABELS[name], **style))
    if held:
        handles.append(Patch(facecolor=SHADE, label=LABELS["held"]))
    return handles


def _shade(axis: Axes, case: Case, factor: float = 1.0) -> None:
    if case.scored.any():
        t = case.t[case.scored]
        axis.axvspan(t[0] * factor, t[-1] * factor, facecolor=SHADE, edgecolor="none", zorder=0)


def _gaps(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Only the frames with a number: a line is not broken where a body was not seen."""
    use = np.isfinite(values)
    return t[use], values[use]


def _time_unit(t: np.ndarray) -> tuple[float, str]:
    return prefixed("s", float(np.max(np.abs(t), initial=0.0)))


def _span_of(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values), initial=0.0)) if len(values) else 0.0


# ---- 1. track and simulation --------------------------------------------------------------------


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
    turns = max((_turns(c.values[:, k], float(c.sigma[k])) for c, k in items if k is not None), default=0)
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
    legend_above(figure, _handles(names, any(c.scored.any() for c, _ in items)))
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
    factor, label = prefixed(unit, _span_of(case.values[:, k]))
    seconds, second = _time_unit(case.t)
    _shade(axis, case, seconds)
    dense = use.sum() > 400 and span is None
    axis.plot(
        case.t[use] * seconds, case.values[use, k] * factor, "o", color=SEEN, zorder=2,
        markersize=1.0 if dense else 2.2 if use.sum() > 60 else 3.2,
        markeredgewidth=0, alpha=0.55 if dense else 0.9,
    )  # fmt: skip
    for name in names:
        t, values = _gaps(case.t[use], predicted(diagnosis, name, case)[use, k])
        style = dict(_LINES[name])
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
    legend_above(figure, _handles(names, bool(case.scored.any())))
    return figure


def _draw_plane(axis: Axes, diagnosis: TrackFinding, case: Case, names: Sequence[str]) -> None:
    scene = case.recording.scene
    size = max(_span_of(case.values), 1e-12)
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
            axis.plot(
                x[case.scored & seen], y[case.scored & seen], color=SHADE, linewidth=11, zorder=0,
                solid_capstyle="butt",
            )  # fmt: skip
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
            axis.plot(px[use], py[use], **_LINES[name])
            last = np.flatnonzero(use)[-1]
            axis.add_patch(
                Circle((px[last], py[last]), radius, facecolor="none", edgecolor=_LINES[name]["color"],
                       linewidth=1.2, zorder=_LINES[name]["zorder"])
            )  # fmt: skip
    axis.set_aspect("equal", adjustable="datalim")
    axis.autoscale_view()
    axis.margins(0.06)
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.yaxis.set_major_locator(MaxNLocator(5))
    axis.set_xlabel(f"x [{unit}]")
    axis.set_ylabel(f"y [{unit}]")


# ---- error over time ----------------------------------------------------------------------------


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
            axis.set_xlabel(f"time [{_time_unit(case.t)[1]}]")
    _label_once(axes, columns)
    handles = _handles(names, any(c.scored.any() for c in cases))[1:]
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
    largest = max(_span_of(v) for v in curves.values())
    factor, label = prefixed(unit, largest)
    seconds, _ = _time_unit(case.t)
    _shade(axis, case, seconds)
    ends = [float(np.sqrt(np.nanmean(v**2))) for v in curves.values() if np.isfinite(v).any()]
    logarithmic = not single and bool(ends) and max(ends) > 20 * max(min(ends), 1e-300)
    for name, curve in curves.items():
        t, values = _gaps(case.t, curve)
        style = dict(_LINES[name])
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


# ---- 2. innovations -----------------------------------------------------------------------------


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
    worst = max((_span_of(fit.used(c.name)) for _, fit in pair for c in training), default=1.0)
    bent = worst > 12
    first: Axes | None = None
    seconds, second = _time_unit(np.concatenate([c.t[c.training] for c in training]))
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
                    t, r = _gaps(case.t, fit.innovations[case.name][:, k])
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


# ---- 3. where the mismatch is -------------------------------------------------------------------


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
    factor, second = _time_unit(np.array([t for r in rows for t in r["t"]] or [1.0]))
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


# ---- 4. candidates ------------------------------------------------------------------------------


@styled
def candidates(diagnosis: TrackFinding, most: int = 18) -> Figure:
    """Candidates ranked: misfit each takes away, surviving fraction, test inside the training part."""
    trials = list(diagnosis.trials)
    if diagnosis.flexible is not None:
        trials.append(diagnosis.flexible)
    trials.sort(key=lambda t: (t.fit is None, -t.gain))
    # a law looked for from several sides is one candidate: its best fit
    best: dict[str, Trial] = {}
    for trial in trials:
        best.setdefault(trial.term.label, trial)
    shown = list(best.values())[:most]
    found = {t.term.label for t in diagnosis.found}
    same = {t.term.label for t, alike in diagnosis.rivals if alike}
    figure = Figure(figsize=(WIDTH, 0.27 * max(len(shown), 1) + 1.25), layout="constrained")
    left, middle, right = figure.subplots(1, 3, sharey=True, width_ratios=[2.6, 1, 1.5])
    count = max(diagnosis.recalibrated.count, 1)
    # laws that were named together come first, as one row
    together = len(diagnosis.found) > 1 and " + ".join(t.term.label for t in diagnosis.found)
    before = max(diagnosis.recalibrated.chi2, 1e-300) / count
    after = [max(t.fit.chi2, 1e-300) / count for t in shown if t.fit is not None]
    if together:
        after.append(max(diagnosis.revised.chi2, 1e-300) / count)
        gain = diagnosis.recalibrated.chi2 - diagnosis.revised.chi2
        left.barh(-1, after[-1] - before, left=before, height=0.66, color=REVISED)
        left.text(before, -1, " " + compact(gain), va="center", fontsize=7.5, color="white")
        if math.isfinite(diagnosis.inner.get(together, math.nan)):
            right.plot(diagnosis.inner[together], -1, "o", color=REVISED, markersize=5.5)
    for row, trial in enumerate(shown):
        colour = (
            REVISED if trial.term.label in found else "#8fbbd9" if trial.term.label in same else "#bcbcbc"
        )
        if trial.fit is None:
            left.text(
                before,
                row,
                " " + _why_not(trial.reason),
                va="center",
                fontsize=7.5,
                color="#666666",
                style="italic",
            )
        else:
            # the axis runs from much misfit to little: a longer bar takes more away
            left.barh(row, trial.fit.chi2 / count - before, left=before, height=0.66, color=colour)
            left.text(
                before, row, " " + (compact(trial.gain) if trial.gain > 0.05 else "0"), va="center",
                fontsize=7.5, ha="left",
                color="white" if trial.term.label in found and trial.gain > 0.3 * count * before else SEEN,
            )  # fmt: skip
        middle.plot([0, trial.signature.surviving], [row, row], color="#d0d0d0", linewidth=1, zorder=1)
        middle.plot(trial.signature.surviving, row, "o", color=SEEN if trial.fit else MUTED, markersize=4)
        if math.isfinite(trial.inner) and trial.inner > 0:
            right.plot(
                trial.inner, row, "o", color=colour if colour != "#bcbcbc" else "#777777", markersize=5.5
            )
    names = []
    for trial in shown:
        mark = " ≈" if trial.term.label in same else ""
        names.append(plain(trial.term.label) + (" °" if trial.mechanism in APPARATUS else "") + mark)
    first = -1 if together else 0
    left.set_yticks(range(first, len(shown)), ["both together"] * -first + names)
    labels = left.get_yticklabels()
    if together:
        labels.pop(0).set_fontweight("bold")
    for label, trial in zip(labels, shown, strict=True):
        if trial.term.label in found:
            label.set_fontweight("bold")
        elif trial.fit is None:
            label.set_color("#777777")
    left.set_ylim(max(len(shown), 1) - 0.4, first - 0.6)
    low, high = min([*after, 1.0, before]), max([before, *after])
    _falling_axis(left, low, high, top=before)
    left.axvline(1.0, color=FLOOR, linestyle=(0, (1, 1.5)), zorder=1)
    left.set_xlabel("misfit left [χ² per number]")
    middle.set_xlim(-0.04, 1.06)
    middle.set_xticks([0, 0.5, 1], ["0", "½", "1"])
    middle.set_xlabel("surviving\nfraction")
    base = diagnosis.inner.get("recalibrated", float("nan"))
    if math.isfinite(base) and base > 0:
        right.axvline(base, color=COLOURS["recalibrated"], linewidth=1.4, linestyle=(0, (1.4, 1.2)))
        scores = [t.inner for t in shown if math.isfinite(t.inner) and t.inner > 0] + [base]
        if together and diagnosis.inner.get(together, 0.0) > 0:
            scores.append(diagnosis.inner[together])
        _falling_axis(right, min(scores), max(scores))
    right.set_xlabel("inner test\n[−2 ln p per number]")
    for axis in (left, middle, right):
        axis.tick_params(axis="y", length=0)
        axis.spines["left"].set_visible(False)
    handles: list[Any] = [Patch(facecolor=REVISED, label="named")] if found else []
    if same:
        handles.append(Patch(facecolor="#8fbbd9", label="≈ cannot be told apart"))
    handles.append(Line2D([], [], color=FLOOR, linestyle=(0, (1, 1.5)), label="noise"))
    if math.isfinite(base):
        handles.append(
            Line2D(
                [], [], color=COLOURS["recalibrated"], linestyle=(0, (1.4, 1.2)), label="without any of them"
            )
        )
    legend_above(figure, handles)
    return figure


def _falling_axis(axis: Axes, low: float, high: float, top: float | None = None) -> None:
    """A logarithmic x axis that runs from large to small numbers; ``top``: where it begins."""
    axis.set_xscale("log")
    room = 1.5 * (high / low) ** 0.04
    axis.set_xlim(top if top is not None else high * room, low / room)
    _few_log_ticks(axis, low, high)


def _why_not(reason: str) -> str:
    return reason.removeprefix("dropped: ") or "not fitted"


def _few_log_ticks(axis: Axes, low: float, high: float) -> None:
    """Two to four labelled ticks on a logarithmic x axis, also within one decade."""
    decades = math.log10(high * 1.8 / (low / 1.8))
    if decades > 2.0:
        step = 1 if decades < 5 else 2 if decades < 8 else 3
        ticks = [10.0**k for k in range(-12, 16, step)]
    else:
        ticks = [
            m * 10.0**k for k in range(-9, 12) for m in ((1, 2, 5) if decades > 0.9 else (1, 1.5, 2, 3, 5, 7))
        ]
    inside = [t for t in ticks if low / 1.8 <= t <= high * 1.8]
    while len(inside) > 5:
        inside = inside[::2]
    axis.xaxis.set_major_locator(FixedLocator(inside))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(lambda v, _: _tick(v))


def _tick(value: float) -> str:
    return f"{value:g}" if 1e-3 <= value < 1e4 else compact(value).replace("1.0×", "")


# ---- 5. held-out errors -------------------------------------------------------------------------


@styled
def held_out(diagnosis: TrackFinding, most: int = 40) -> Figure:
    """Held-out errors by recording; open rings: starts fitted to whole recordings.

    Where there is one recording only, its training error stands beside."""
    names = models(diagnosis)
    # two values of one place lie side by side
    reference = diagnosis.held["naive"].by_case
    rows: list[tuple[str, dict[str, float], dict[str, float]]] = []
    for case in [c for c in diagnosis.cases if c.scored.any()]:
        values = {
            n: diagnosis.held[n].by_case[case.name] for n in names if case.name in diagnosis.held[n].by_case
        }
        everything = {n: (diagnosis.held[n].whole_by_case or {}).get(case.name) for n in names}
        rows.append((case.name, values, {n: v for n, v in everything.items() if v is not None}))
    rows.sort(key=lambda row: -reference.get(row[0], 0.0))
    if len(rows) == 1:
        name = rows[0][0]
        in_training = {n: diagnosis.train[n].rms for n in names if n in diagnosis.train}
        rows = [
            ("training", {n: v for n, v in in_training.items() if v is not None}, {}),
            ("held out" if diagnosis.train["naive"].by_case.get(name) else name, *rows[0][1:]),
        ]
    rows = rows[:most]
    every = [v for _, a, b in rows for v in (*a.values(), *b.values()) if v > 0]
    floor = diagnosis.floor[1]
    if floor:
        every.append(floor)
    unit = (diagnosis.cases[0].unit if diagnosis.cases else "m rms").split()[0]
    factor, label = prefixed(unit, max(every, default=1.0))
    figure = Figure(figsize=(WIDTH, 0.27 * len(rows) + 1.05), layout="constrained")
    axis = figure.add_subplot()
    for row, (_, values, whole) in enumerate(rows):
        ends = [v * factor for v in values.values()]
        if len(ends) > 1:
            axis.plot([min(ends), max(ends)], [row, row], color="#d4d4d4", linewidth=1.4, zorder=1)
        for name, error in values.items():
            # the later ones are smaller: where two coincide both are seen
            axis.plot(error * factor, row, "o", color=COLOURS[name], markersize=SIZES[name], zorder=3)
        for name, error in whole.items():
            axis.plot(
                error * factor, row, "o", markerfacecolor="white", markeredgecolor=COLOURS[name],
                markersize=5, markeredgewidth=1.1, zorder=2,
            )  # fmt: skip
    if floor:
        axis.axvline(floor * factor, color=FLOOR, linestyle=(0, (1, 1.5)), zorder=1)
    axis.set_yticks(range(len(rows)), [shortened(r[0], 30) for r in rows])
    axis.set_ylim(len(rows) - 0.4, -0.6)
    axis.tick_params(axis="y", length=0)
    axis.spines["left"].set_visible(False)
    if every and max(every) > 8 * min(every):
        axis.set_xscale("log")
        axis.set_xlim(min(every) * factor / 1.6, max(every) * factor * 1.6)
        _few_log_ticks(axis, min(every) * factor, max(every) * factor)
    else:
        axis.set_xlim(0, max(every, default=1.0) * factor * 1.1)
    axis.set_xlabel(f"error [{label} rms]")
    handles: list[Any] = [
        Line2D([], [], color=COLOURS[n], marker="o", markersize=5.5, linestyle="none", label=LABELS[n])
        for n in names
    ]
    if floor:
        handles.append(Line2D([], [], color=FLOOR, linestyle=(0, (1, 1.5)), label="noise floor"))
    if any(whole for _, _, whole in rows):
        handles.append(
            Line2D([], [], markerfacecolor="white", markeredgecolor="#555555", marker="o", markersize=5,
                   linestyle="none", label="start fitted to the whole")
        )  # fmt: skip
    legend_above(figure, handles)
    return figure


# ---- 6. nulls -----------------------------------------------------------------------------------


@styled
def null_histogram(null: Null) -> Figure:
    """Best gains that the same search finds in noise, and where this case lies."""
    gains = np.asarray(null.gains, dtype=float)
    figure = Figure(figsize=(WIDTH, 2.3), layout="constrained")
    axis = figure.add_subplot()
    far = null.case > 4 * max(float(gains.max()), 1e-12)
    low = max(float(gains.min()), 0.02 * float(np.median(gains)), 1e-9)
    high = max(float(gains.max()), low * 1.5)
    if far:
        axis.set_xscale("log")
        # as fine as the spread of the replicates asks for
        bins = np.geomspace(
            low / 1.05, high * 1.05, max(6, min(30, int(math.sqrt(max(len(gains), 1)) * 1.5)))
        )
        axis.set_xlim(low / 2, null.case * 3)
    else:
        bins = np.linspace(0.0, max(high, null.case) * 1.05, 40)
        axis.set_xlim(0.0, max(high, null.case) * 1.12)
    counts, *_ = axis.hist(
        np.clip(gains, bins[0], bins[-1]),
        bins=bins.tolist(),
        color="#b4b4b4",
        edgecolor="white",
        linewidth=0.5,
    )
    top = max(float(np.max(counts)), 1.0)
    colour = REVISED if null.p <= 0.01 else "#555555"
    axis.plot([null.case, null.case], [0, 0.8 * top], color=colour, linewidth=2)
    axis.plot(null.case, 0.8 * top, "v", color=colour, markersize=7)
    right = null.case > (math.sqrt(low * null.case) if far else 0.6 * axis.get_xlim()[1])
    axis.annotate(
        f"this case, {compact(null.case)}\n{p_text(null)}", (null.case, 0.8 * top),
        xytext=(-8 if right else 8, 0),
        textcoords="offset points", ha="right" if right else "left", va="center", color=colour, fontsize=9,
    )  # fmt: skip
    axis.set_ylim(0, top * 1.08)
    axis.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    axis.set_xlabel("best gain of the whole search [fall in χ²]")
    axis.set_ylabel(f"of {len(gains)} tries in noise")
    return figure


def p_text(null: Null) -> str:
    """p as it may be claimed: never below one over the number of tries plus one."""
    reach = int(np.sum(null.gains >= null.case))
    return f"p ≤ {null.p:.2g}" if reach == 0 else f"p = {null.p:.2g}"


# ---- 7. the flexible arm ------------------------------------------------------------------------


@styled
def flexible(diagnosis: TrackFinding) -> Figure:
    """The force that no named law gives, over the speeds, times or places that the recordings visit.

    A curve with its central 95 % where the arm sees velocities only (force over speed) or times only (acceleration);
    arrows along the tracks where it sees places. Raises ValueError where no flexible arm was fitted.
    """
    trial = diagnosis.flexible
    if trial is None or trial.fit is None:
        raise ValueError("no flexible arm was fitted")
    case = next(c for c in diagnosis.cases if c.name in trial.fit.innovations)
    scene, _ = trial.fit.hypothesis.scene(case, trial.fit.values.tolist())
    item = scene.laws[-1]
    draw = {"speed": _speed_curve, "time": _time_curve}.get(drawn_over(item.law))
    if draw is not None:
        return draw(diagnosis, trial.fit, case, len(trial.term.free))
    return _force_field(diagnosis, item.law, dict(item.values))


def drawn_over(law: Law) -> str:
    """What a force without a name is drawn over: "place", "speed" or "time"."""
    reads = set(law.arguments)
    if {"x", "y"} & reads:
        return "place"
    return "speed" if {"vx", "vy"} & reads else "time"


def _call(law: Law, values: Mapping[str, Any], **state: float) -> tuple[float, float]:
    """Force of a body law [N] at one state; what the state does not give is 0, sizes are 1."""
    given: dict[str, Any] = {}
    for parameter in law.parameters:
        value = values[parameter.name]
        parts = value if parameter.size > 1 else (value,)
        given |= dict(zip(parameter.arguments, parts, strict=True))
    for name in law.arguments:
        if name not in given:
            given[name] = state.get(name, 1.0 if name in ("radius", "r0") else 0.0)
    fx, fy = law(**given)
    return float(fx), float(fy)


def _seen_speeds(diagnosis: TrackFinding) -> np.ndarray:
    """Speeds between frames of the training part [m/s], of a pinned body its rod's length times its rate."""
    speeds = []
    for case in diagnosis.cases:
        if case.held_out:
            continue
        t = case.t[case.training]
        for body in case.bodies:
            columns = [k for k, c in enumerate(case.channels) if c.body == body and c.kind != "angle"]
            arm = 1.0
            if not columns:
                columns = [k for k, c in enumerate(case.channels) if c.body == body]
                arm = arm_of(case.recording.scene, body)
            steps = np.diff(case.values[case.training][:, columns], axis=0) / np.diff(t)[:, None] * arm
            speeds.append(np.sqrt(np.sum(steps**2, axis=1)))
    every = np.concatenate(speeds) if speeds else np.zeros(0)
    return every[np.isfinite(every)]


def _forces(
    diagnosis: TrackFinding, fit: Fit, case: Case, count: int, states: Sequence[Mapping[str, float]]
) -> tuple[np.ndarray, np.ndarray, float]:
    """Force of a fit's last law, which has ``count`` numbers, on a body of the mean radius in each state: (k, 2) [N],
    half of its central 95 % (k, 2), and the mass [kg] of the body."""
    mass = next(b.mass for b in case.recording.scene.bodies if b.mobile)

    def forces(numbers: np.ndarray) -> np.ndarray:
        scene, _ = fit.hypothesis.scene(case, numbers.tolist())
        item = scene.laws[-1]
        return np.array([_call(item.law, item.values, mass=mass, **state) for state in states])

    best = forces(fit.values)
    # to first order its covariance follows from that of its numbers
    base = len(fit.values) - count
    _, highest = fit.hypothesis.bounds
    slopes = []
    for k in range(base, len(fit.values)):
        step = 0.01 * max(abs(fit.values[k]), float(np.sqrt(fit.covariance[k, k])), 1e-12)
        if fit.values[k] + step > highest[k]:
            step = -step  # a number at its bound can only go back
        moved = fit.values.copy()
        moved[k] += step
        slopes.append((forces(moved) - best) / step)
    design = np.array(slopes)
    variance = np.einsum("kva,kl,lva->va", design, fit.covariance[base:, base:], design) * diagnosis.spread
    return best, 1.96 * np.sqrt(np.maximum(variance, 0.0)), mass


def _time_curve(diagnosis: TrackFinding, fit: Fit, case: Case, count: int) -> Figure:
    seen = case.t[case.training]
    t = np.linspace(seen[0], seen[-1], 141)
    best, half, mass = _forces(diagnosis, fit, case, count, [{"t": float(s)} for s in t])
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    axis = figure.add_subplot()
    for k, (name, colour) in enumerate((("along x", REVISED), ("along y", SEEN))):
        middle, wide = best[:, k] / mass, half[:, k] / mass
        axis.fill_between(t, middle - wide, middle + wide, color=colour, alpha=0.18, linewidth=0)
        axis.plot(t, middle, color=colour, linewidth=2, label=name)
    axis.axhline(0, color="#bbbbbb", linewidth=0.7, zorder=0)
    axis.set_xlim(t[0], t[-1])
    axis.set_xlabel("time [s]")
    axis.set_ylabel("acceleration [m/s²]")
    legend_above(figure, axis.get_legend_handles_labels()[0])
    return figure


def _speed_curve(diagnosis: TrackFinding, fit: Fit, case: Case, count: int) -> Figure:
    seen = _seen_speeds(diagnosis)
    top = float(np.quantile(seen, 0.98)) if len(seen) else 1.0
    v = np.linspace(0.0, top, 121)
    both, spread, _ = _forces(diagnosis, fit, case, count, [{"vx": float(s)} for s in v])
    # of bodies that go along x
    across = not both[:, 0].any()
    best, half = (both[:, 1], spread[:, 1]) if across else (-both[:, 0], spread[:, 0])
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    axis = figure.add_subplot()
    factor, unit = prefixed("N", float(np.quantile(np.abs(best), 0.9)))
    speed, speed_unit = prefixed("m/s", top)
    axis.fill_between(
        v * speed, (best - half) * factor, (best + half) * factor, color=REVISED, alpha=0.18, linewidth=0
    )
    axis.plot(v * speed, best * factor, color=REVISED, linewidth=2)
    axis.axhline(0, color="#bbbbbb", linewidth=0.7, zorder=0)
    # where hardly anything was seen the curve may do what it likes, out of the picture
    well = v <= (float(np.quantile(seen, 0.9)) if len(seen) else top)
    low, high = (float(f((best[well] + s * half[well]) * factor)) for f, s in ((np.min, -1), (np.max, 1)))
    reach = max(float(np.abs(best[well]).max()) * factor, 1e-300)
    axis.set_ylim(max(low, -2 * reach) - 0.1 * reach, min(high, 2 * reach) + 0.2 * reach)
    if len(seen):
        marks = np.quantile(seen, np.linspace(0.005, 0.98, 120))
        axis.plot(marks * speed, np.zeros(len(marks)), "|", color=SEEN, markersize=6, alpha=0.35,
                  transform=axis.get_xaxis_transform(), clip_on=False)  # fmt: skip
    axis.set_xlim(0, top * speed)
    axis.set_xlabel(f"speed [{speed_unit}]; ticks: speeds that were seen")
    axis.set_ylabel(f"force {'to the left of' if across else 'against'} the motion [{unit}]")
    return figure


def end_of_rod(scene: Scene, body: str, angle: np.ndarray) -> np.ndarray | None:
    """Places (T, 2) [m] of a body on a pin at these angles (T,), 0 hanging; None where it is on none."""
    pin = next((item for item in scene.laws_named("pin") if body in (item.bodies or ())), None)
    if pin is None:
        return None
    down = np.array(scene.gravity if any(scene.gravity) else (0.0, -1.0), dtype=float)
    down /= math.hypot(*down)
    end = np.cos(angle)[:, None] * down + np.sin(angle)[:, None] * np.array([-down[1], down[0]])
    return np.array(pin.values["anchor"]) + pin.values["length"] * end


def hinged_places(case: Case, values: np.ndarray) -> dict[str, np.ndarray]:
    """Places (T, 2) [m] of hinged bodies from channels (T, c), as their angles tell; NaN where these do not."""
    scene = case.recording.scene
    turning = set(hinged(scene))
    columns = {c.body: k for k, c in enumerate(case.channels) if c.kind == "angle" and c.body in turning}
    found = {body: np.full((len(values), 2), np.nan) for body in columns}
    still = dict.fromkeys(columns, 0.0)
    for frame, row in enumerate(values if columns else ()):
        known = {body: float(row[k]) for body, k in columns.items() if math.isfinite(row[k])}
        for body, state in place(scene, known, still).items():
            found[body][frame] = state[:2]
    return found


def _places_of(case: Case) -> np.ndarray:
    """Places (k, 2) [m] seen in the training part; of rods and hinged bodies whose angles were measured, too."""
    recording = case.recording.unwrapped().on_rails()
    every = [recording.xy[case.training].reshape(-1, 2)]
    for k, channel in enumerate(case.channels):
        end = end_of_rod(recording.scene, channel.body, case.values[case.training, k])
        if channel.kind == "angle" and end is not None:
            every.append(end)
    rows = np.flatnonzero(case.training)
    # some frames are enough
    turned = hinged_places(case, case.values[rows[:: max(len(rows) // 200, 1)]])
    if turned:
        every.append(np.stack(list(turned.values()), axis=1).reshape(-1, 2))
    places = np.concatenate(every)
    return places[np.isfinite(places).all(axis=1)]


def _force_field(diagnosis: TrackFinding, law: Law, values: Mapping[str, Any]) -> Figure:
    training = [c for c in diagnosis.cases if not c.held_out]
    xy = np.concatenate([_places_of(c) for c in training])
    kinds = {c.kind for case in training for c in case.channels}
    if len(xy) == 0:
        raise ValueError("no place was measured: a field over place cannot be drawn")
    given = {"mass": next(b.mass for b in training[0].recording.scene.bodies if b.mobile)}
    if "vx" in law.arguments:  # a drag: on a body that goes along x as fast as was usual
        given["vx"] = float(np.median(_seen_speeds(diagnosis)))
    mass = given["mass"]
    figure = Figure(figsize=(WIDTH, 2.9 if kinds in ({"x"}, {"y"}) else 4.6), layout="constrained")
    axis = figure.add_subplot()
    if kinds in ({"x"}, {"y"}):
        axis_index = 0 if kinds == {"x"} else 1
        s = np.linspace(xy[:, axis_index].min(), xy[:, axis_index].max(), 161)
        other = float(np.median(xy[:, 1 - axis_index]))
        along = [(p, other) if axis_index == 0 else (other, p) for p in s]
        force = np.array([_call(law, values, x=x, y=y, **given)[axis_index] / mass for x, y in along])
        factor, unit = prefixed("m", float(np.abs(s).max()))
        axis.plot(s * factor, force, color=REVISED, linewidth=2)
        axis.axhline(0, color="#bbbbbb", linewidth=0.7, zorder=0)
        axis.set_xlabel(f"{'xy'[axis_index]} [{unit}]")
        axis.set_ylabel("force per mass [m/s²]")
        return figure
    factor, unit = prefixed("m", _span_of(xy))
    # about 220 arrows, thinned so that they do not lie on each other
    size = max(float(np.ptp(xy, axis=0).max()), 1e-12)
    _, keep = np.unique(np.round(xy / (size / 26)).astype(int), axis=0, return_index=True)
    places = xy[np.sort(keep)]
    force = np.array([_call(law, values, x=p[0], y=p[1], **given) for p in places]) / mass
    strength = np.hypot(force[:, 0], force[:, 1])
    axis.plot(xy[:, 0] * factor, xy[:, 1] * factor, ".", color="#d0d0d0", markersize=2, zorder=1)
    arrows = axis.quiver(
        places[:, 0] * factor, places[:, 1] * factor, force[:, 0], force[:, 1], strength, cmap=HEAT,
        angles="xy",
        pivot="mid", width=0.004, zorder=3, clim=(-0.35 * float(strength.max()), float(strength.max())),
        scale_units="xy", scale=max(float(np.quantile(strength, 0.95)), 1e-300) / (size * factor / 16),
    )  # fmt: skip
    bar = figure.colorbar(arrows, ax=axis, label="force per mass [m/s²]", pad=0.015, aspect=24, fraction=0.05)
    bar.ax.set_ylim(0, float(strength.max()))
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel(f"x [{unit}]")
    axis.set_ylabel(f"y [{unit}]")
    return figure


# ---- all of them --------------------------------------------------------------------------------

NAMES = (
    "overlay", "errors_over_time", "innovations", "windows", "flexible", "candidates", "held_out", "null",
)  # fmt: skip


def whiteness_text(white: Whiteness, known: bool) -> str:
    """How far innovations are from noise (HTML); ``known``: the size of the noise was given."""
    size = f"χ² {number(white.z, 2)} s.d. from that of noise, " if known else ""
    p = "p &lt; 10<sup>−16</sup>" if white.p < 1e-16 else f"p = {number(white.p, 2)}"
    memory = "none" if white.memory < 1.05 else f"{white.memory:.{1 if white.memory < 10 else 0}f} frames"
    return f"{size}memory {memory}, {p}"


def pictures(found: TrackFinding) -> dict[str, Drawing]:
    """The figures of this diagnosis by file name, in the order of the page; each is drawn when called."""
    several = (
        " The recordings shown are the held-out ones, at most 12, those with the largest naive error."
        if len(found.cases) > 12
        else ""
    )
    known = all(c.sigma_known for c in found.cases if not c.held_out)
    before, after = (whiteness_text(white, known) for white in (found.white_recalibrated, found.white_revised))
    result = {
        "overlay": Drawing(
            lambda: overlay(found), "Seen and simulated",
            "Seen track and simulation. Grey: held out, never looked at before the verdict was fixed. In the plane, "
            "disks are drawn to scale where they start (open) and where they end (filled; coloured rings: where the "
            "simulation ends)." + several,
            "Seen track with the naive and the revised simulation over it",
        ),
        "errors_over_time": Drawing(
            lambda: errors_over_time(found), "Seen and simulated",
            "Seen minus predicted over time; with several measured numbers in a frame, their root mean square.",
            "Seen minus predicted over time, before and after",
        ),
        "innovations": Drawing(
            lambda: innovations(found), "Is what remains noise?",
            "Innovations of the training part: seen minus predicted in standard deviations of the noise, by body. "
            f"Right: their root mean square; noise alone gives 1. Before: {before}"
            + (f". After: {after}." if found.found else "."),
            "Innovations over time and by body in standard deviations, before and after",
        ),
    }  # fmt: skip
    windowed, flexed, null = found.windows, found.flexible, found.null
    if windowed is not None and windowed.rows:
        result["windows"] = Drawing(
            lambda: windows(windowed, found.cases), "Where the mismatch is",
            "The training part in short windows, each started anew, under the scene as recalibrated: where a body does "
            "not do what the scene says even over a short time. z is that of χ² against what remains when the physics "
            "is right.",
            "Map of short windows coloured by their misfit",
        )  # fmt: skip
    if found.verdict == "unmodelled" and flexed is not None:
        band = " (band: central 95 %)." if drawn_over(all_laws()[flexed.mechanism]) != "place" else "."
        result["flexible"] = Drawing(
            lambda: flexible(found), "The force without a name",
            f"The fitted force without a name, over what the recordings visit{band}",
            "The force that no named law gives",
        )  # fmt: skip
    if found.trials:
        same = "; ≈ cannot be told apart from the law named" if any(alike for _, alike in found.rivals) else ""
        result["candidates"] = Drawing(
            lambda: candidates(found), "Candidates",
            "Every candidate refitted by simulation, alone. Bars run from the misfit without it to the misfit with it "
            "(the number: fall in χ²), so the longest takes most away. Surviving fraction: the share of its signature "
            "that recalibration cannot imitate. Inner test: prediction of a part of the training data that the fit did "
            "not see; further right is better. The choice rests on both, and on few numbers where candidates are "
            f"alike. ° apparatus{same}.",
            "Candidates ranked by gain, with surviving fraction and inner test",
        )  # fmt: skip
    if any(e.by_case for e in found.held.values()):
        result["held_out"] = Drawing(
            lambda: held_out(found), "Held-out errors", "Errors by recording; the same as in the table, taken apart.",
            "Held-out errors by recording",
        )  # fmt: skip
    if null is not None and len(null.gains):
        result["null"] = Drawing(
            lambda: null_histogram(null), "Could it be chance?",
            "The same search on what remains, with its phases shuffled: the best gain it finds in noise of the same "
            "spectrum.",
            "Histogram of the best gains found in noise, with this case marked",
        )  # fmt: skip
    return result
