"""Figures of forces without a name, over place, speed and time, and of answers to a command."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..inference.data import Case
from ..inference.driven_terms import commanded, held_answer, step_answer
from ..inference.tracks.fitted import Fit
from ..inference.tracks.model import TrackFinding
from ..joints import arm_of
from ..laws import Law
from .style import (
    REVISED,
    SEEN,
    WIDTH,
    legend_above,
    prefixed,
    styled,
)
from .track_drawing import HEAT, end_of_rod, hinged_places, span_of


@styled
def flexible(diagnosis: TrackFinding) -> Figure:
    """The force that no named law gives, over the speeds, times or places that the recordings visit.

    A curve with its central 95 % where the form sees velocities only (force over speed) or times only (acceleration);
    arrows along the tracks where it sees places; of a motor its answer to a step, or to commands of any size. Raises
    ValueError where no form without a name was fitted.
    """
    trial = diagnosis.flexible
    if trial is None or trial.fit is None:
        raise ValueError("no form without a name was fitted")
    case = next(c for c in diagnosis.cases if c.name in trial.fit.innovations)
    scene, _ = trial.fit.hypothesis.scene(case, trial.fit.values.tolist())
    item = scene.laws[-1]
    draw = {"speed": _speed_curve, "time": _time_curve, "command": _answer_curve}.get(drawn_over(item.law))
    if draw is not None:
        return draw(diagnosis, trial.fit, case, len(trial.term.free))
    return _force_field(diagnosis, item.law, dict(item.values))


def drawn_over(law: Law) -> str:
    """What a form without a name is drawn over: "place", "speed" or "time", or the "command"."""
    if law.series is not None:
        return "command"
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

    best, half = _with_spread(forces, fit, count, diagnosis.spread)
    return best, half, mass


def _with_spread(
    drawn: Callable[[np.ndarray], np.ndarray], fit: Fit, count: int, spread: float
) -> tuple[np.ndarray, np.ndarray]:
    """What is drawn of a fit's numbers, the last ``count`` of which shape it, and half of its central 95 %."""
    best = drawn(fit.values)
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
        slopes.append((drawn(moved) - best) / step)
    design = np.array(slopes)
    variance = np.einsum("k...,kl,l...->...", design, fit.covariance[base:, base:], design) * spread
    return best, 1.96 * np.sqrt(np.maximum(variance, 0.0))


def _answer_curve(diagnosis: TrackFinding, fit: Fit, case: Case, count: int) -> Figure:
    """What a motor makes of a step of its command, or of commands that are held, where it has no memory."""
    def found(numbers: np.ndarray) -> tuple[Law, dict[str, float]]:
        item = fit.hypothesis.scene(case, numbers.tolist())[0].laws[-1]
        return item.law, {p.name: item.values[p.name] for p in item.law.parameters}

    span = found(fit.values)[1].get("span")
    over = np.linspace(0.0, 1.1 * span, 221) if span else np.linspace(*_ends(diagnosis.cases), 221)

    def answer(numbers: np.ndarray) -> np.ndarray:
        law, values = found(numbers)
        return step_answer(law, values, over) if span else held_answer(law, values, over)

    best, half = _with_spread(answer, fit, count, diagnosis.spread)
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    axis = figure.add_subplot()
    factor, unit = prefixed("s" if span else "m/s", float(np.abs(over).max()))
    size, over = 1.0 if span else factor, over * factor
    believed = np.ones(len(over)) if span else over
    axis.fill_between(over, (best - half) * size, (best + half) * size, color=REVISED, alpha=0.18, linewidth=0)
    axis.plot(over, best * size, color=REVISED, linewidth=2, label="found")
    axis.plot(over, believed, color=SEEN, linewidth=1, label="believed")
    axis.set_xlim(over[0], over[-1])
    lowest, highest = (float(f(np.append(best * size, believed))) for f in (np.min, np.max))
    lowest = min(lowest, 0.0) if span else lowest
    axis.set_ylim(lowest - 0.1 * (highest - lowest), highest + 0.2 * (highest - lowest))
    axis.set_xlabel(f"time after a step of the command [{unit}]" if span else f"command [{unit}]")
    axis.set_ylabel("velocity over that step" if span else f"velocity [{unit}]")
    legend_above(figure, axis.get_legend_handles_labels()[0])
    return figure


def _ends(cases: Sequence[Case]) -> tuple[float, float]:
    """Lowest and highest velocity that was commanded [m/s]."""
    every = np.concatenate([velocity for _, velocity in commanded(cases)])
    return float(every.min()), float(every.max())


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
    factor, unit = prefixed("m", span_of(xy))
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
