"""What an import found: numbers in words, warnings of what is absurd, and the tracks as a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import cKDTree

from ..grid import rounded_to
from ..recording import Recording
from .plausible import bounced, doubts
from .stamps import LEFT_OUT, usual_step
from .table import some_of

JUMP = 10.0  # a step so many times beyond the usual change of the steps is a jump
FAST = 20.0  # m/s
FAST_RADII = 2e4  # radii a second; a golf ball that falls 30 m has 1e3, a swimmer's disk 1e2
NARROW = 1e4  # times as long as wide, where a path cannot be drawn to scale
# stamps count frames where nine of ten steps that are not long are as close to the usual one, as a share of it, and
# the middle one of the long steps to a whole number of them, which of steps longer than 1/EVEN is not asked
EVEN = 0.1
# pictures stand twice where noise falls to less than this part of it without frames that are as the one before: what
# stands still and jumps in turn has noise as large as the jumps. Of what rests, or creeps over pixels, it does not
TWICE = 0.5
EXACT = 1e-12  # of the field, below which noise is what sums in floating point leave
FAR_APART = 1e4  # distances in radii beyond which bodies are dust in a hall


@dataclass(frozen=True)
class Look:
    """Figures of a recording's tracks. Lengths in m, times in s; nan where they cannot be told.

    gaps : share of the frames between first and last sight in which a body is not seen, those without a row as well,
        where stamps are even;  unseen : of those that have a row alone
    left_out : frames without a row between the first and the last;  uneven : steps that are long where stamps are not
        even, and count no frames;  step, longest_step : of the stamps, the usual one and the longest
    jumps : steps that no motion of that kind makes;  noise : one standard deviation, off fast differences
    """

    bodies: int
    frames: int
    duration: float
    gaps: float
    longest_gap: float
    jumps: int
    jump_at: str
    speed: float
    fastest: float
    noise: float
    angle_noise: float
    extent: tuple[float, float]
    radius: float
    nearest: float
    unseen: float = 0.0
    left_out: int = 0
    uneven: int = 0
    step: float = math.nan
    longest_step: float = math.nan
    again: int = 0
    warnings: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in vars(self).items()}


def noise_of(values: np.ndarray, t: np.ndarray | None = None) -> float:
    """Standard deviation [as the values] of white noise on a smooth course, from third differences.

    The third difference of noise has a variance of 20; motion that is smooth over four frames drops out. The median
    keeps jumps out: 1.4826 MAD. At uneven times t (T,) [s] third divided differences take their place, each over the
    root of the sum of its squared weights.
    """
    seen = np.isfinite(values)
    values = values[seen]
    if len(values) < 8:
        return math.nan
    if t is None:
        third = np.diff(values, 3) / math.sqrt(20)
    else:
        s = sliding_window_view(t[seen], 4)
        apart = s[:, :, None] - s[:, None, :] + np.eye(4)
        weights = 1 / np.prod(apart / np.median(np.diff(s)), axis=2)
        third = np.sum(weights * sliding_window_view(values, 4), axis=1) / np.sqrt(np.sum(weights**2, axis=1))
    return float(1.4826 * np.median(np.abs(third - np.median(third))))


def _as_written(t: np.ndarray, values: np.ndarray, even: bool) -> float:
    """``noise_of``, and no less than rounding leaves of values on a grid, a step over root twelve."""
    return max(noise_of(values, None if even else t), rounded_to(t, values) / math.sqrt(12))


def _shown_again(recording: Recording) -> np.ndarray:
    """(T,) frames in which all is where it was in the frame before, to the last digit, where pictures stand twice."""
    numbers = recording.unwrapped().xy.reshape(len(recording.t), -1)
    if recording.angle is not None:
        numbers = np.hstack([numbers, recording.angle])
    unseen = np.isnan(numbers)
    same = ((numbers[1:] == numbers[:-1]) | (unseen[1:] & unseen[:-1])).all(axis=1) & ~unseen[1:].all(axis=1)
    again, none = np.append(False, same), np.zeros(len(recording.t), dtype=bool)
    if not same.any():
        return none
    pairs = [(noise_of(v), noise_of(v[~again])) for v in numbers.T]
    told = [less < TWICE * noise for noise, less in pairs if noise > 0 and math.isfinite(less)]
    return again if told and all(told) else none


def look(recording: Recording) -> Look:
    """Look at the tracks as they will be diagnosed."""
    recording = recording.on_rails()
    frames_in_all, again = len(recording.t), _shown_again(recording)
    if again.any():
        angle = None if recording.angle is None else recording.angle[~again]
        recording = replace(recording, t=recording.t[~again], xy=recording.xy[~again], angle=angle)
    unwrapped = recording.unwrapped()
    t, xy = unwrapped.t, unwrapped.xy
    seen, counted, even = recording.seen, _counted(t), _even(np.diff(t))
    gaps, longest, possible, unseen, rows = 0, 0.0, 0, 0, 0
    speeds, noises, turned = [], [], []
    jumps, jump_at = 0, ""
    for k, name in enumerate(recording.ids):
        frames = np.flatnonzero(seen[:, k])
        there = counted[frames[-1]] - counted[frames[0]] + 1
        possible += there
        gaps += there - len(frames)
        rows += int(frames[-1] - frames[0]) + 1
        unseen += int(frames[-1] - frames[0]) + 1 - len(frames)
        longest = max(longest, float(np.diff(t[frames])[np.diff(counted[frames]) > 1].max(initial=0.0)))
        if recording.angle is not None:
            turned.append(_as_written(t, recording.angle[:, k], even))
        at = np.flatnonzero(np.isfinite(xy[:, k, 0]))
        if len(at) < 3:
            continue
        steps = np.diff(xy[at, k], axis=0)
        dt = np.diff(t[at])
        velocity = steps / dt[:, None]
        speeds.append(np.hypot(*velocity.T))
        noises += [_as_written(t[at], xy[at, k, axis], even) for axis in (0, 1) if np.ptp(xy[at, k, axis]) > 0]
        change = np.hypot(*np.diff(velocity, axis=0).T) * dt[1:]
        # of places that were read off a scale, no change is smaller than its least step
        usual = float(np.median(change)) + 1e-3 * float(np.median(np.hypot(*steps.T)))
        moved = np.abs(steps[steps != 0])
        usual = max(usual, float(moved.min())) if len(moved) else usual
        # a wrong point changes the velocity there and back, in three steps; an impact between two frames does not
        turns = np.pad(np.diff(velocity, axis=0) * dt[1:, None], ((0, 1), (0, 0)))
        wild = change > JUMP * usual
        back = np.hypot(*(turns[:-2] + turns[1:-1] + turns[2:]).T) < 0.5 * np.maximum(change[1:], change[:-1])
        both = wild[1:] & wild[:-1] & back
        if usual > 0 and both.any():
            jumps += int(np.count_nonzero(np.diff(both.astype(int), prepend=0) == 1))
            jump_at = jump_at or f"{name} at t = {t[at[int(np.argmax(both)) + 2]]:.4g} s"
    speed = np.concatenate(speeds) if speeds else np.array([math.nan])
    radii = [recording.scene.bodies[row].radius for row in recording.track_rows]
    places = xy[np.isfinite(xy[..., 0])]
    extent = np.ptp(places, axis=0) if len(places) else np.array([math.nan, math.nan])
    stamps = np.diff(t)
    usual, long_ = _usual(stamps)
    found = Look(
        bodies=len(recording.ids), frames=frames_in_all, duration=float(t[-1] - t[0]),
        gaps=float(gaps / max(possible, 1)), longest_gap=longest, jumps=jumps, jump_at=jump_at,
        speed=float(np.median(speed)), fastest=float(np.max(speed)),
        noise=float(np.nanmedian(noises)) if np.isfinite(noises).any() else math.nan,
        angle_noise=float(np.nanmedian(turned)) if np.isfinite(turned).any() else math.nan,
        extent=(float(extent[0]), float(extent[1])), radius=float(np.median(radii)), nearest=_nearest(recording),
        unseen=unseen / max(rows, 1), left_out=int(counted[-1]) + 1 - len(t),
        uneven=0 if even else int(long_.sum()), step=usual, longest_step=float(stamps.max(initial=0.0)),
        again=int(again.sum()),
    )  # fmt: skip
    found.warnings.extend([*_absurd(found, recording), *doubts(recording, found.noise), *bounced(recording)])
    return found


def _counted(t: np.ndarray) -> np.ndarray:
    """(T,) which frame of the film each is: where stamps are even but for some longer steps, these leave frames out."""
    steps = np.diff(t)
    usual, long_ = _usual(steps)
    if not _even(steps):
        return np.arange(len(t))
    passed = np.where(long_, np.round(steps / usual), 1.0)
    return np.concatenate([[0.0], np.cumsum(passed)]).astype(int)


def _usual(steps: np.ndarray) -> tuple[float, np.ndarray]:
    """The usual step of stamps [s], and which steps are so long that frames may have been left out."""
    usual = usual_step(steps) if len(steps) else math.nan
    return usual, steps > LEFT_OUT * usual


def _even(steps: np.ndarray) -> bool:
    """Whether steps of stamps count the frames of a film: a program that writes when it can has steps of any length."""
    usual, long_ = _usual(steps)
    if not usual > 0 or (np.mean(long_) > 0.25 and usual >= np.median(steps)):
        return False
    times = steps / usual
    off = np.abs(times - np.where(long_, np.round(times), 1.0))
    off[times > 1 / EVEN] = 0.0
    return bool(np.quantile(off[~long_], 0.9) <= EVEN and (not long_.any() or np.median(off[long_]) <= EVEN))


def _nearest(recording: Recording) -> float:
    """The smallest distance of two bodies in a frame [m], of at most 20,000 places: all frames of a few bodies."""
    nearest = math.inf
    frames = min(len(recording.t), max(50, 20_000 // max(len(recording.ids), 1)))
    for frame in np.unique(np.linspace(0, len(recording.t) - 1, frames).astype(int)):
        xy = recording.xy[frame]
        xy = xy[np.isfinite(xy[:, 0])]
        if len(xy) > 1:
            nearest = min(nearest, float(cKDTree(xy).query(xy, k=2)[0][:, 1].min()))
    return nearest if math.isfinite(nearest) else math.nan


def _absurd(found: Look, recording: Recording) -> list[str]:
    said = []
    r = found.radius
    if found.speed > FAST and found.speed > FAST_RADII * r:
        said.append(
            f"bodies of {_length(2 * r)} across move at {found.speed:.3g} m/s: are the positions in mm or pixels "
            "(--unit), or the times in frames or ms (--fps, --time-unit)?"
        )
    reach = max((v for v in found.extent if math.isfinite(v)), default=math.nan)
    if reach > FAR_APART * r:
        said.append(f"bodies of {_length(2 * r)} across move over {_length(reach)}: is the unit right (--unit)?")
    if reach < 1e-3 * r and found.bodies == 1:
        said.append(f"a body of {_length(2 * r)} across moves over {_length(reach)} only: is the unit right (--unit)?")
    pairs = any(item.law.kind in ("pair", "impulse") for item in recording.scene.laws)
    if found.nearest < 1.2 * r and pairs:
        near = _length(found.nearest)
        said.append(f"bodies of {_length(2 * r)} across come as near as {near}: unit or radius is wrong")
    # of a cart on a rail the radius does not matter
    railed = {name for item in recording.scene.laws_named("rail") for name in item.bodies or recording.ids}
    for body in (recording.scene.bodies[row] for row in recording.track_rows if recording.scene.ids[row] not in railed):
        density = body.mass / (4 / 3 * math.pi * body.radius**3)
        if not 0.5 < density < 3e4:
            size = f"{_length(2 * body.radius)} across and {body.mass:.3g} kg"
            said.append(f"a sphere as {body.id}, {size}, has {density:.3g} kg/m^3")
            break
    steps = np.diff(recording.t)
    if len(steps) > 2 and steps.max() > 5.5 * np.median(steps):
        said.append(f"no body is seen for {steps.max():.3g} s after t = {recording.t[int(np.argmax(steps))]:.4g} s")
    if found.jumps:
        said.append(f"{found.jumps} jumps (there and back), the first of {found.jump_at}: wrong points of the tracker?")
    return said


def _length(value: float) -> str:
    if not math.isfinite(value):
        return "?"
    for unit, size in (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)):
        if abs(value) >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.3g} m"


def told(recording: Recording, found: Look) -> list[str]:
    """The figures in words, a line each."""
    names = some_of(recording.ids, 6)
    rate = f", {recording.sampling:g} Hz" if recording.sampling else ""
    bodies = "1 body" if found.bodies == 1 else f"{found.bodies} bodies"
    lines = [f"{bodies} ({names}), {found.frames} frames in {found.duration:.4g} s{rate}"]
    lines.append(f"{_gaps(found)}, {'no jumps' if not found.jumps else f'{found.jumps} jumps'}")
    if found.again:
        lines.append(f"{found.again} frames show the picture before again: what is said here is of the others")
    if math.isfinite(found.speed):
        lines.append(f"speeds: median {found.speed:.3g} m/s, largest {found.fastest:.3g} m/s")
        near = f", nearest centres {_length(found.nearest)}" if math.isfinite(found.nearest) else ""
        room = " x ".join(map(_length, found.extent))
        radii = [recording.scene.bodies[row].radius for row in recording.track_rows]
        across = dict.fromkeys(_length(2 * radius) for radius in (min(radii), max(radii)))
        lines.append(f"sizes: {' to '.join(across)} across, in a field of {room}{near}")
    noise = [_length(found.noise)] if math.isfinite(found.noise) else []
    noise += [f"{found.angle_noise:.2g} rad"] if math.isfinite(found.angle_noise) else []
    if noise:
        reach = max((v for v in found.extent if math.isfinite(v)), default=0.0)
        sums = ", that of arithmetic: places that were computed, or held, and not measured one by one"
        exact = sums if found.noise <= EXACT * reach else ""
        lines.append(f"noise, off fast differences: {', '.join(noise)} (one standard deviation){exact}")
    laws = ", ".join(dict.fromkeys(item.name for item in recording.scene.laws)) or "none"
    lines.append(f"laws of the scene: {laws}")
    return lines


def _gaps(found: Look) -> str:
    """What is not seen: of the frames that have a row, and the frames that have none; or that the stamps are uneven."""
    said = []
    if found.unseen:
        whose = "not seen" if found.bodies == 1 else "a body is not seen, on average,"
        said.append(f"{whose} in {found.unseen:.1%} of the frames between its first and its last")
    if found.left_out:
        frames = "1 frame has" if found.left_out == 1 else f"{found.left_out} frames have"
        film = found.frames - found.again
        said.append(f"{frames} no row, {found.left_out / (film + found.left_out):.1%} of the film")
    longest = f" (longest gap {found.longest_gap:.3g} s)" if found.longest_gap else ""
    if found.uneven:
        steps = "1 step is" if found.uneven == 1 else f"{found.uneven} of {found.frames - found.again - 1} steps are"
        said.append(
            f"time stamps are uneven: {steps} longer than {LEFT_OUT:g} times the usual {found.step:.3g} s, up to "
            f"{found.longest_step:.3g} s"
        )
    return "; ".join(said) + longest if said else "no gaps"


def draw(recording: Recording, path: str | Path, *, most: int = 400) -> Path:
    """The tracks as a PNG: paths in the plane with start and size, and coordinates (or angles) over time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    recording = recording.on_rails()
    placed = bool(np.isfinite(recording.xy).any())
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    plane, *courses = figure.subplots(1, 2, width_ratios=(1, 1.2)) if placed else (None, figure.subplots())
    unwrapped = recording.unwrapped()
    for k, name in enumerate(recording.ids[:most]):
        color = f"C{k % 10}"
        xy = unwrapped.xy[:, k]
        if plane is not None and np.isfinite(xy).any():
            plane.plot(*xy.T, color=color, lw=0.8, marker="." if len(xy) < 60 else None, ms=3)
            first = int(np.argmax(np.isfinite(xy[:, 0])))
            plane.add_patch(_disk(xy[first], recording.scene.body(name).radius, color))
            if len(recording.ids) <= 20:
                plane.annotate(name, xy[first], fontsize=8, color=color, parse_math=False)
        course = courses[0]
        if placed:
            course.plot(unwrapped.t, xy[:, 0], color=color, lw=0.8, label="x" if k == 0 else None)
            course.plot(unwrapped.t, xy[:, 1], color=color, lw=0.8, ls=":", label="y" if k == 0 else None)
        else:
            course.plot(recording.t, recording.angle[:, k] if recording.angle is not None else [], lw=0.8, label=name)
    if plane is not None:
        plane.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="paths, with the disk at its first place")
        plane.autoscale_view()
        wide, high = (float(np.ptp(ends)) for ends in (plane.get_xlim(), plane.get_ylim()))
        if not 1 / NARROW < wide / high < NARROW:  # drawn to scale it would have no height
            plane.set_aspect("auto")
    courses[0].set(xlabel="t [s]", ylabel="x, y [m]" if placed else "angle [rad]")
    courses[0].set_title(recording.title[:60], parse_math=False)  # a title is no formula
    courses[0].legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=110)
    return Path(path)


def _disk(at: np.ndarray, radius: float, color: str) -> Any:
    from matplotlib.patches import Circle

    return Circle((float(at[0]), float(at[1])), radius, fill=False, color=color, lw=1)
