"""What the figures of whole tracks share: which recordings, which models, how they are called and coloured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..inference.data import Case
from ..inference.tracks.fitted import Fit
from ..inference.tracks.model import TrackFinding
from ..joints import hinged, place
from ..scene import Scene
from .style import (
    COLOURS,
    SEEN,
    SHADE,
    prefixed,
)

MOST = 12  # small panels in one figure
LONG = 3.5  # usual times between frames, from which a line is broken
MANY_TURNS = 14  # turning points of a track beyond which one panel shows it no longer
LABELS = {
    "naive": "naive scene",
    "recalibrated": "recalibrated",
    "revised": "revised",
    "seen": "seen",
    "held": "held out",
}
LINES: dict[str, dict[str, Any]] = {
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
    """Predicted channels (T, c) [m or rad] of a recording, NaN where there is no prediction, or nothing was seen.

    Held-out frames as they were predicted; the others, where that covers windows alone, as they were fitted.
    """
    errors = diagnosis.held.get(model)
    innovations = fit_of(diagnosis, model).innovations.get(case.name)
    fitted = np.full(case.values.shape, np.nan) if innovations is None else case.values - innovations * case.sigma
    if errors is not None and errors.predicted is not None and case.name in errors.predicted:
        # a body that is not seen in a part has no start there: its prediction is of nothing
        told = np.where(np.isfinite(case.values), errors.predicted[case.name], np.nan)
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


def turns_of(values: np.ndarray, sigma: float) -> int:
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
    return all(turns_of(case.values[:, k], float(case.sigma[k])) <= 6 for k in range(len(case.channels)))


def legend_handles(names: Sequence[str], held: bool) -> list[Any]:
    handles: list[Any] = [
        Line2D([], [], color=SEEN, marker="o", markersize=3, linestyle="none", label=LABELS["seen"])
    ]
    for name in names:
        style = {k: v for k, v in LINES[name].items() if k != "zorder"}
        handles.append(Line2D([], [], label=LABELS[name], **style))
    if held:
        handles.append(Patch(facecolor=SHADE, label=LABELS["held"]))
    return handles


def shade_held_out(axis: Axes, case: Case, factor: float = 1.0) -> None:
    if case.scored.any():
        t = case.t[case.scored]
        axis.axvspan(t[0] * factor, t[-1] * factor, facecolor=SHADE, edgecolor="none", zorder=0)


def with_gaps(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Only the frames with a number: a line is not broken where a body was not seen."""
    use = np.isfinite(values)
    return t[use], values[use]


def broken(t: np.ndarray, seen: np.ndarray, *curves: np.ndarray) -> tuple[np.ndarray, ...]:
    """Curves (T,) as one line: the frames in which all have a number, and NaN where the line is broken.

    t : (T,) times;  seen : (T,) whether there was something to compare with
    A line goes on over a single frame that is left out, and between frames of a body that is seldom seen. It is broken
    where several were seen and are not drawn, and where far more time than is usual lies between two.
    """
    at = np.flatnonzero(np.all(np.isfinite(curves), axis=0))
    if len(at) < 2:
        return tuple(c[at] for c in curves)
    passed = np.diff(np.cumsum(seen)[at]) - seen[at[1:]]  # frames that were seen between two that are drawn
    steps = np.diff(t[at])
    breaks = np.flatnonzero((passed > 1) | (steps > LONG * np.median(steps))) + 1
    return tuple(np.insert(c[at], breaks, np.nan) for c in curves)


def time_unit(t: np.ndarray) -> tuple[float, str]:
    return prefixed("s", float(np.max(np.abs(t), initial=0.0)))


def span_of(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values), initial=0.0)) if len(values) else 0.0


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
