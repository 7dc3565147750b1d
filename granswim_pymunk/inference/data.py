"""What a diagnosis looks at: recordings as channels of numbers with noise, split into training and held out."""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .. import distributions as stats
from ..errors import InputError
from ..joints import hanging, hinged
from ..laws import Law
from ..recording import Recording, grid
from ..recording.turns import continuous
from ..scene import Scene, use
from ..walls import gap_to_wall
from .criteria import current
from .filled import held_places, on_a_line
from .latecomers import without_latecomers
from .linking import linked
from .lost import missing, repeated, same_as_before
from .noise import Noise, coloured, outliers, slopes, timing, whitened
from .release import at_rest_though_commanded, begins_at_rest, caught, first_free, first_pulled
from .smoothed import frames_apart


@dataclass(frozen=True)
class Channel:
    """One measured number of one body: ``kind`` is "x", "y" [m] or "angle" [rad]."""

    body: str
    kind: str


@dataclass(frozen=True)
class Kick:
    """A change of velocity within a frame or two.

    row : the frame after it;  t : when [s];  place : (2,) [m];  change : (2,) of the velocity [m/s]
    """

    body: str
    row: int
    t: float
    place: np.ndarray
    change: np.ndarray


@dataclass(frozen=True)
class Case:
    """One recording, ready to be compared.

    t : (T,) frame times [s];  values : (T, c) measured numbers, NaN where there is none;
    sigma : (c,) one standard deviation of the white noise;  sigma_known : given by the experimenter, and not refuted
    notes : what was found of the noise;  noise : its slow part, as it was estimated from what the best fit leaves
    late : (T, c) what an error of the stamps of one standard deviation moves each number by, over sigma
    kicks : where bodies go on at velocities of their own, whatever struck them
    apart : one frame in so many of the film is used
    training, start, scored : (T,) masks of frames: used for fitting; used for fitting the start when the
        parameters are known; scored as held out
    """

    recording: Recording
    t: np.ndarray
    channels: tuple[Channel, ...]
    values: np.ndarray
    sigma: np.ndarray
    sigma_known: bool
    training: np.ndarray
    start: np.ndarray
    scored: np.ndarray
    held_out: bool
    notes: tuple[str, ...] = ()
    noise: Noise = field(default_factory=Noise)
    late: np.ndarray | None = None
    kicks: tuple[Kick, ...] = ()
    apart: int = 1

    @functools.cached_property
    def told(self) -> dict[Any, Any]:
        """What was found in the recording, by what it was asked for: it takes long, and is asked again and again."""
        return {}

    @functools.cached_property
    def numbers(self) -> np.ndarray:
        """(T,) numbers of the frames, lost ones counted: how often the median time between frames has passed."""
        steps = np.diff(self.t)
        return np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1.0))])

    @functools.cached_property
    def turning(self) -> float:
        """How fast a measured angle turns in all but few frames [rad/s], 0 where none is measured."""
        fastest = 0.0
        for column in (self.values[:, c] for c, channel in enumerate(self.channels) if channel.kind == "angle"):
            seen = np.isfinite(column)
            rates = np.abs(np.diff(column[seen]) / np.diff(self.t[seen]))
            if len(rates):
                fastest = max(fastest, float(np.quantile(rates, 1 - current().fits.fast)))
        return fastest

    def spins_at(self, t0: float) -> np.ndarray | None:
        """Spins (n,) [rad/s] of the scene's bodies at ``t0`` [s], off angles that were tracked; None where none were.

        Of disks that turn freely, which do so evenly until they are struck: a line through the next few frames. 0 of
        all others.
        """
        if ("spins", t0) not in self.told:
            self.told["spins", t0] = self._spins_at(t0)
        return self.told["spins", t0]

    def _spins_at(self, t0: float) -> np.ndarray | None:
        recording = self.recording
        spins, few = np.zeros(len(recording.scene.bodies)), current().fits.spun
        for body, angle in _turning_freely(recording, {c.body for c in self.channels if c.kind == "angle"}):
            rows = np.flatnonzero(np.isfinite(angle) & (recording.t >= t0))[:few]
            if len(rows) > 1:
                t = recording.t[rows]
                spins[recording.scene.ids.index(body)] = np.polyfit(t - t[0], continuous(angle[rows]), 1)[0]
        return spins if spins.any() else None

    def timed(self, innovations: np.ndarray, frames: np.ndarray, back: bool = False) -> np.ndarray:
        """Innovations (T_frames, c) with what stamps that are off do to all numbers of a frame scaled down to one.

        (1 + u u')^-1/2 r, u what a stamp of one standard deviation moves: the root of the covariance of a frame.
        ``back``: the other way.
        """
        if self.late is None:
            return innovations
        seen = np.isfinite(innovations)
        u = np.where(seen, self.late[frames], 0.0)
        size = np.sum(u**2, axis=1)
        root = np.sqrt(1.0 + size)
        factor = np.where(size > 0, (root - 1.0 if back else 1.0 / root - 1.0) / np.maximum(size, 1e-300), 0.0)
        return np.asarray(innovations + u * (factor * np.where(seen, u * innovations, 0.0).sum(axis=1))[:, None])

    def white(self, innovations: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Innovations (T_frames, c) on ``frames`` (T,), uncorrelated and of unit size where they are this noise."""
        timed = self.timed(innovations, frames)
        return whitened(timed, self.numbers[frames], self.noise)[0] if self.noise.size else timed

    def raw(self, white: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """The innovations that ``white`` makes these of."""
        timed = coloured(white, self.numbers[frames], self.noise) if self.noise.size else white
        return self.timed(timed, frames, back=True)

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """(T, c) noise like that of the recording [m or rad]."""
        drawn = self.noise.draw(self.values.shape, rng)
        if self.late is not None:
            drawn = drawn + self.late * rng.normal(size=(len(self.t), 1))
        return np.asarray(drawn * self.sigma)

    @property
    def name(self) -> str:
        return self.recording.name

    @property
    def bodies(self) -> tuple[str, ...]:
        """The observed bodies, in the order of their channels."""
        return tuple(dict.fromkeys(channel.body for channel in self.channels))

    @property
    def unit(self) -> str:
        return "rad rms" if all(channel.kind == "angle" for channel in self.channels) else "m rms"

    @property
    def in_unit(self) -> np.ndarray:
        """(c,) which channels are in the unit that errors are told in: angles only where there are no positions."""
        angles = np.array([channel.kind == "angle" for channel in self.channels], dtype=bool)
        return angles if angles.all() else ~angles


def with_gravity(cases: Sequence[Case]) -> bool:
    """Whether gravity acts in the scene of any of the recordings."""
    return any(any(case.recording.scene.gravity) for case in cases)


HOLDING = ("pendulum", "pivot", "guide", "bar", "tether", "command")  # roles of laws that hold a body, or move it


def driven(scene: Scene) -> set[str]:
    """Bodies whose motion is commanded: no force changes it."""
    return {name for item in scene.laws_as("command") for name in item.bodies or ()}


def falls(scene: Scene) -> bool:
    """Whether gravity moves a body that no joint, rail, spring or command holds."""
    return any(scene.gravity) and not any(scene.laws_as(role) for role in HOLDING)


def sinks_evenly(case: Case) -> bool:
    """Whether all that falls in a recording sinks along gravity, at speeds that hardly change.

    Of its training frames, a line or a parabola through each body: no faster at their end than ``even`` of what
    gravity gives in that time, two standard errors added, and hardly across. What bears a body's weight at an even
    speed is a drag, and whatever else would have to be as large as the weight by chance.
    """
    scene, frames, even = case.recording.scene, np.flatnonzero(case.training), current().apparatus.even
    gravity = np.array(scene.gravity, dtype=float)
    size, bodies = float(np.hypot(*gravity)), [b.id for b in scene.bodies if b.mobile and b.id in case.recording.ids]
    if not falls(scene) or not bodies or not len(frames):
        return False
    down = gravity / size
    for body in bodies:
        xy = case.recording.xy[frames, case.recording.ids.index(body)]
        moves = np.ptp(np.nan_to_num(xy), axis=0) > 0
        seen = np.isfinite(xy[:, moves]).all(axis=1)
        t, xy = case.t[frames][seen], np.where(moves, xy, 0.0)[seen]
        if len(t) <= 2 * current().release.after:
            return False
        numbers, covariance = np.polyfit(t - t[0], xy @ down, 2, cov=True)
        way = xy[-1] - xy[0]
        across = float(np.hypot(*(way - (way @ down) * down)))
        bent = 2 * (abs(numbers[0]) + 2 * math.sqrt(max(float(covariance[0, 0]), 0.0)))
        if way @ down <= 0 or across > even * (way @ down) or bent > even * size:
            return False
    return True


def left_out(count: int, why: str) -> str:
    """What a note says of single sightings that are no positions."""
    return f"{count} single sighting{'' if count == 1 else 's'}, {why}, {'is' if count == 1 else 'are'} left out"


def estimate_noise(t: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth curve: residuals of local polynomials over 9 points, or all.

    t, values : (T,), NaN where not seen; of fewer than five, half of what neighbours differ by. Quadratics, or the
    least higher degree (to 5) after which the next takes no more than a tenth away: over few frames of an oscillation,
    what a quadratic leaves is no noise. The dof of each local fit are taken off; the median keeps collisions out. At
    least what rounding to a grid leaves, which hides where a coordinate hardly moves: then most frames have the same
    value. Even stations at which a clock was read are no such grid.
    """
    seen = np.isfinite(values)
    t, values = t[seen], values[seen]
    return max(_scatter(t, values), rounded_to(t, values) / math.sqrt(12.0))


def rounded_to(t: np.ndarray, values: np.ndarray) -> float:
    """``recording.grid.rounded_to``, by the criteria of the diagnosis."""
    return grid.rounded_to(t, values, current().noise.same_level, current().noise.on_grid)


def stations(t: np.ndarray, values: np.ndarray) -> bool:
    """``recording.grid.stations``, by the criteria of the diagnosis."""
    return grid.stations(t, values, current().noise.same_level)


def grid_of(values: np.ndarray) -> float:
    """``recording.grid.grid_of``, by the criteria of the diagnosis."""
    return grid.grid_of(values, current().noise.same_level, current().noise.on_grid)


def coarse_grid(t: np.ndarray, values: np.ndarray) -> float:
    """The step of the grid that the values (T,) lie on, where it is no finer than the noise that neighbours show.

    0 where they lie on none, or on a finer one. An encoder counts whole steps: at rest it tells one number again and
    again, and a step g is g/sqrt(12) of noise, which neighbours share while the body moves less than a step a frame.
    Noise told from frames apart then grows without any filter. A filter's output is a mean of several numbers, each
    frame its own, and lies on a finer grid than they did. Where it was rounded to a coarse one once more, rounding is
    what neighbours show, and of a filter they tell nothing. Readings that were written to the millimetre are on that
    grid, though no two of a few may be a millimetre apart.
    """
    seen = np.isfinite(values)
    if stations(t[seen], values[seen]):
        return 0.0
    step = grid_of(values[seen]) or last_place(values[seen])
    return step if step and step >= current().smoothed.coarse * estimate_noise(t, values) else 0.0


def last_place(values: np.ndarray) -> float:
    """The step in the last place to which all of the values (T,) are written."""
    rounding = np.finfo(float).eps * np.abs(values)
    digits = range(current().noise.digits)
    told = (10.0**-d for d in digits if np.all(np.abs(values - np.round(values, d)) <= rounding))
    return float(next(told, np.max(rounding, initial=0.0)))


def least_step(values: np.ndarray) -> float:
    """``recording.grid.least_step``, by the criteria of the diagnosis."""
    return grid.least_step(values, current().noise.same_level)


def _scatter(t: np.ndarray, values: np.ndarray, share: float = 0.5) -> float:
    """``estimate_noise`` without a grid, by the window that a ``share`` of all leave less than."""
    width, degrees = min(9, len(t)), current().noise.degrees
    degrees = tuple(d for d in degrees if d <= width - 3)  # two numbers are left to tell the size from
    if not degrees:
        return float(np.std(np.diff(values)) / np.sqrt(2)) if len(t) > 2 else 0.0
    s = sliding_window_view(t, width)
    s = (s - s[:, [width // 2]]) / np.maximum(np.ptp(s, axis=1, keepdims=True), 1e-300)
    q, _ = np.linalg.qr(np.power(s[..., None], np.arange(7)))
    v = sliding_window_view(values, width)
    found = []
    for degree in degrees:
        # the first columns span the polynomials of each degree
        span = q[..., : degree + 1]
        left = v - np.einsum("wpk,wlk,wl->wp", span, span, v, optimize=True)
        sums = np.sum(left**2, axis=1)
        least = stats.chi2.isf(1 - share, width - degree - 1)
        found.append(float(np.sqrt(np.quantile(sums, share) / least)))
    falls = current().noise.degree
    return next((now for now, then in pairwise(found) if then > falls * now), found[max(len(found) - 2, 0)])


def prepare(recording: Recording, *, held_out: bool, split: bool, clean: bool = True) -> Case:
    """Make a Case. ``held_out``: nothing of it is used for fitting; ``split``: the last 40 % of its time are;
    ``clean``: single sightings that are no positions are left out, and the noise that was stated is held against them.

    Raises InputError where there is nothing to look at.
    """
    recording, told = _each_once(recording) if clean else (recording, [])
    recording, swapped = _relabelled(recording) if clean else (recording, [])
    if held_out or split:
        recording, late = without_latecomers(recording, current().split.start if held_out else current().split.training)
        swapped = [*swapped, *late]
    channels, values = _channels(recording)
    if not channels:
        raise InputError("no body was seen moving in four frames or more", file=recording.folder, where=recording.name)
    known = all(_stated(recording, channel) for channel in channels)
    t = recording.t
    sigmas = _noises(recording, channels, t, values)
    notes, lost, tau, first, apart = list[str](), 0, 0.0, 0, 1
    if clean:
        recording, values, mended = _mended(recording, values, channels, sigmas)
        told += mended
        recording, values, sigmas, first, apart = _let_go(recording, values, channels, sigmas, known)
        told += [_says_smoothed(recording, apart)] if apart > 1 else []
        t = recording.t
        swapped += _without_caught(recording, t, values, channels, sigmas)
        near = _meetings(recording, channels, values)
        smooth = _without_meetings(recording, channels, values, sigmas, near)
        values, lost = _without_outliers(t, values, channels, sigmas, smooth, _pressed(recording, near))
        sigmas, tau = _timed_noise(t, values, channels, sigmas, known, recording.time_noise, smooth)
        sigmas, refuted, notes = _weighed_noise(t, values, channels, sigmas, known, tau)
        known = known and not refuted
        if tau:
            notes.append(f"{recording.name}: the time stamps are off by {tau:.2g} s (one standard deviation)")
        notes = swapped + told + notes + _driven_from_rest(recording, t, values, channels, sigmas)
    notes += _unused_angles(recording, {c.body for c in channels if c.kind == "angle"})
    if first:
        notes.append(_says_held(recording, _channels(recording)[1], sigmas, first))
    if lost:
        notes.append(f"{recording.name}: {left_out(lost, 'off by more than noise')}")
    scale = np.nanmax(np.abs(values - np.nanmean(values, axis=0)), axis=0)
    sigma_array = np.maximum(np.array(sigmas), 1e-9 * scale)
    training, start, scored = frames_of(t, values, first, held_out, split)
    return Case(
        recording, t, tuple(channels), values, sigma_array, known, training, start, scored, held_out, tuple(notes),
        late=tau * slopes(t, values) / sigma_array if tau else None, apart=apart,
    )  # fmt: skip


def _channels(recording: Recording) -> tuple[list[Channel], np.ndarray]:
    """What was measured of a recording: numbers that move, each seen in enough frames, and their values (T, c)."""
    channels, columns = list[Channel](), list[np.ndarray]()
    pinned = {name for item in recording.scene.laws_as("pendulum") for name in item.bodies or ()}
    pinned |= set(hinged(recording.scene))
    arms = hanging(recording.scene)
    xy = recording.unwrapped().xy if recording.scene.periodic_x else recording.xy
    for k, body in enumerate(recording.ids):
        angle = None if recording.angle is None else recording.angle[:, k]
        for axis, kind in enumerate("xy"):
            column = xy[:, k, axis]
            seen = np.isfinite(column)
            if seen.sum() < current().noise.sightings:
                continue
            if np.ptp(column[seen]) <= np.finfo(float).eps * recording.scene.body(body).radius:
                continue  # a coordinate that was not measured (a vertical fall has x = 0 throughout)
            channels.append(Channel(body, kind))
            columns.append(column)
        if angle is not None and arms.get(body) == 0.0:
            raise InputError(
                f"{body} turns in a hinge at its own centre, and a turn moves no centre, which is what is simulated:"
                f" hold it by a pin of the length sqrt(I/m), without gravity (granswim import --scene wheel)",
                where=recording.name,
            )
        # the angle of a free disk says nothing about forces without spin
        if angle is not None and body in pinned and np.isfinite(angle).sum() >= current().noise.sightings:
            seen = np.isfinite(angle)
            column = angle.copy()
            column[seen] = continuous(angle[seen])
            channels.append(Channel(body, "angle"))
            columns.append(column)
    return channels, np.column_stack(columns) if columns else np.zeros((len(recording.t), 0))


def _stated(recording: Recording, channel: Channel) -> float | None:
    """The noise that the experimenter stated of a number, if any."""
    return (recording.angle_noise if channel.kind == "angle" else recording.position_noise) or None


def _noises(recording: Recording, channels: Sequence[Channel], t: np.ndarray, values: np.ndarray) -> list[float]:
    """One standard deviation of the noise of numbers (T, c): what was stated, else what neighbouring frames show."""
    return [_stated(recording, c) or estimate_noise(t, v) for c, v in zip(channels, values.T, strict=True)]


def _each_once(recording: Recording) -> tuple[Recording, list[str]]:
    """The recording without pictures that are shown again, and what is said of them.

    What moves jumps from picture to picture where each is there twice, and all of it looks like noise: how large that
    is only frames say that differ from the one before. Where most frames are such pictures, the film has no more
    frames than there are others; else they are frames in which nothing is seen.
    """
    channels, values = _channels(recording)
    if not channels:
        return recording, []
    t, differs = recording.t, np.append(True, ~same_as_before(values))
    sigmas = np.minimum(
        _noises(recording, channels, t, values), _noises(recording, channels, t[differs], values[differs])
    ).tolist()
    told = [v[np.isfinite(v)] for v in values.T]
    again = repeated(values, sigmas, [least_step(v) for v in told], [grid_of(v) for v in told])
    if not again.any():
        return recording, []
    apart = round(float(np.median(np.diff(t[~again])) / np.median(np.diff(t))))
    if apart > 1:
        ends = [1, -2, -1]  # there no curve tells where a body is
        again[ends] |= ~differs[ends]
    times = f"{again.sum()} frames, the first" if again.sum() > 1 else "a frame"
    shows = "show" if again.sum() > 1 else "shows"
    note = f"{recording.name}: {times} at t = {t[again][0]:.4g} s, {shows} the picture before again: left out"
    if apart > 1:
        return _with_frames(recording, ~again, apart), [note]
    xy, angle = recording.xy.copy(), None if recording.angle is None else recording.angle.copy()
    for numbers in (xy, angle):
        if numbers is not None:
            numbers[again] = np.nan
    return replace(recording, xy=xy, angle=angle), [note]


def _driven_from_rest(
    recording: Recording, t: np.ndarray, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float]
) -> list[str]:  # fmt: skip
    """That bodies rest in their first frames though they are commanded to move, as if the command had stood for long.

    A motor that is late is late from the first command on: where none stands before it, it is at its speed at once.
    """
    scene, notes = recording.scene, list[str]()
    motors = {b: scene.resolved(i) for i in scene.laws_as("command") for b in i.bodies or () if b in scene.inputs}
    for body, law in motors.items():
        at = [k for k, channel in enumerate(channels) if channel.body == body and channel.kind in "xy"]
        first, along = float(scene.inputs[body][1][0]), np.asarray(law["direction"], float)
        if not at or not first or not all(sigmas[k] > 0 for k in at):
            continue
        speed = law["gain"] * np.interp(t, *scene.inputs[body]) / math.hypot(*along)
        commanded = speed[:, None] * along[["xy".index(channels[k].kind) for k in at]]
        how = t, values[:, at], [sigmas[k] for k in at], commanded
        rests = at_rest_though_commanded(*how)
        if rests or begins_at_rest(*how):
            what = f"is at rest in its first {rests} frames" if rests else "begins at rest"
            notes.append(
                f"{recording.name}: {body} {what}, though its first command is "
                f"{first:g}, as if that had stood there for long: it does not move the motor, or the motor began then; "
                "of that a row with 0 before it in the commands tells, else its gain and how late it is are found wrong"
            )
    return notes


def _unused_angles(recording: Recording, used: Collection[str]) -> list[str]:
    """That angles of bodies that turn freely were given and tell nothing here, ``used``: whose do."""
    free = [body for body, _ in _turning_freely(recording, used)]
    if not free:
        return []
    whose = free[0] if len(free) == 1 else f"{free[0]} and {len(free) - 1} more"
    what = "how fast they turn at first is read off them where contacts rub, and no more"
    return [f"{recording.name}: angles of {whose} are hardly used: of disks that turn freely, {what}"]


def _turning_freely(recording: Recording, used: Collection[str]) -> list[tuple[str, np.ndarray]]:
    """Bodies that turn freely, with their tracked angles (T,); ``used``: bodies whose angle is compared."""
    if recording.angle is None:
        return []
    found = []
    for body, angle in zip(recording.ids, recording.angle.T, strict=True):
        seen = angle[np.isfinite(angle)]
        if len(seen) and np.ptp(seen) > 0 and body not in used and recording.scene.body(body).role == "free":
            found.append((body, angle))
    return found


def frames_of(
    t: np.ndarray, values: np.ndarray, first: int, held_out: bool, split: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Masks (T,) of training, start and scored frames, from the row ``first`` on; see ``prepare`` and ``Case``."""
    last = int(np.flatnonzero(np.isfinite(values).any(axis=1))[-1])
    begin, end, free = float(t[first]), float(t[last]), np.arange(len(t)) >= first
    nothing = np.zeros(len(t), dtype=bool)
    if held_out:
        start = free & (t <= begin + current().split.start * (end - begin))
        return nothing, start, free & ~start
    if split:
        before = free & (t <= begin + current().split.training * (end - begin))
        return before, before, free & ~before
    return free, free, nothing


def _may_hold(scene: Scene) -> bool:
    """Whether walls, bodies that never move, or a law on single bodies that is no drag may hold what gravity pulls."""
    laws = any(
        item.law.kind == "body" and item.law.parameters and item.law.role not in ("drag", "medium", "guide")
        for item in scene.laws
    )
    return bool(scene.walls) or laws or any(not b.mobile for b in scene.bodies)


def _without_caught(
    recording: Recording, t: np.ndarray, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float]
) -> list[str]:  # fmt: skip
    """Frames of ``values`` (T, c) in which a body rests at the end as if held become NaN; what is said of them.

    Not where the scene has what may hold it: walls, bodies that never move, or a law that acts on single bodies and is
    no drag, such as friction on a slope.
    """
    scene, notes = recording.scene, list[str]()
    if not falls(scene) or _may_hold(scene):
        return notes
    gravity = float(np.hypot(*scene.gravity))
    for body in dict.fromkeys(channel.body for channel in channels):
        own = [k for k, channel in enumerate(channels) if channel.body == body]
        row = caught(t, values[:, own], [sigmas[k] for k in own], gravity)
        if row is None:
            continue
        # when it came to rest is known to a frame
        values[max(row - 1, 0) :, own] = np.nan
        notes.append(
            f"{recording.name}: {body} rests from t = {t[row]:.4g} s on, where nothing that the scene has holds it "
            "against gravity, as if it was caught, or lay on something: left out from then"
        )
    return notes


def _relabelled(recording: Recording) -> tuple[Recording, list[str]]:
    """The recording with labels that a tracker swapped put back, and what is said of it.

    Of bodies that are seen in the plane: of two that pass on a line nothing tells who is who.
    """
    period = recording.scene.periodic_x or 0.0
    xy = recording.unwrapped().xy if period else recording.xy
    seen = np.isfinite(xy).all(axis=2)
    moves = [(np.ptp(xy[seen[:, k], k], axis=0) > 0).all() for k in np.flatnonzero(seen.any(axis=0))]
    rows = np.flatnonzero(seen.any(axis=0))[np.array(moves, dtype=bool)]
    if len(rows) < 2:
        return recording, []
    t, sigma = recording.t, recording.position_noise
    if not sigma:
        sigma = float(np.median([estimate_noise(t, np.where(seen[:, k], c, np.nan)) for k in rows for c in xy[:, k].T]))
    who = linked(t, xy[:, rows], sigma, period, strays=False).who
    if not (changed := who != np.arange(len(rows))).any():
        return recording, []
    order = np.tile(np.arange(xy.shape[1]), (len(t), 1))
    order[:, rows] = rows[who]
    placed = np.take_along_axis(recording.xy, order[:, :, None], axis=1)
    angle = None if recording.angle is None else np.take_along_axis(recording.angle, order, axis=1)
    begin = int(np.argmax(changed.any(axis=1)))
    names = " and ".join(recording.ids[rows[k]] for k in np.flatnonzero(changed[begin]))
    frames = int(changed.any(axis=1).sum())
    note = (
        f"{recording.name}: the tracks of {names} change places at t = {t[begin]:.4g} s, as where a tracker takes one "
        f"for the other: labels are put back ({frames} frames in all)"
    )
    return replace(recording, xy=placed, angle=angle), [note]


def _mended(
    recording: Recording, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float]
) -> tuple[Recording, np.ndarray, list[str]]:  # fmt: skip
    """Recording and numbers (T, c) without what a camera or a tracker made of them, and what is said of it.

    Sightings that a tracker made up become NaN; stamps after frames that are missing though the stamps go on become
    later.
    """
    t, notes = np.array(recording.t), list[str]()
    notes += _without_filled(recording, values, channels, sigmas)
    gaps = missing(recording.t, values, sigmas)
    for row, count in gaps:
        t[row:] += count * float(np.median(np.diff(recording.t)))
    if gaps:
        lost = ", ".join(f"{count} before t = {recording.t[row]:.4g} s" for row, count in gaps)
        notes.append(
            f"{recording.name}: all that moves jumps ahead along its way, as if frames were missing where the stamps "
            f"go on ({lost}): the stamps after that are taken as so many frames later"
        )
        recording = replace(recording, t=t)
    return recording, values, notes


def _let_go(
    recording: Recording, values: np.ndarray, channels: Sequence[Channel], sigmas: list[float], known: bool
) -> tuple[Recording, np.ndarray, list[float], int, int]:  # fmt: skip
    """Recording, numbers (T, c), their noise, the first frame in which nothing is held, one frame in how many is kept.

    Frames before that one become NaN. Of tracks that were smoothed, frames so far apart that their noise is independent
    are kept. When bodies are let go is asked of all frames: a hand may hold them for few that are kept, or for none.
    Where the noise of neighbours is one, so many frames tell as much as one.
    """
    t, steps = recording.t, [coarse_grid(recording.t, column) for column in values.T]
    first = first_free(recording, t, values, sigmas, steps)
    apart = _apart(recording, channels, values, steps, first)
    if apart > 1:
        kept = t[::apart], values[::apart]
        if not known:
            sigmas = [estimate_noise(kept[0], column) for column in kept[1].T]
        first = first or first_free(recording, t, values, [math.sqrt(apart) * sigma for sigma in sigmas])
        recording, values = _with_frames(recording, slice(None, None, apart), apart), kept[1]
        first = -(-first // apart) or first_free(recording, *kept, sigmas)
    if not first:
        first = first_pulled(recording.t, values, sigmas, _pulls(recording.scene, channels))
        if first and not known:  # one number again and again is no noise of what moves
            sigmas = [estimate_noise(recording.t[first:], column[first:]) for column in values.T]
    values[:first] = np.nan
    return recording, values, sigmas, first, apart


def _pulls(scene: Scene, channels: Sequence[Channel]) -> list[float]:
    """(c,) [m/s^2] by how much gravity changes each number, along its rail; 0 where the scene has what may hold it."""
    gravity = np.array(scene.gravity, dtype=float)
    held = {b for item in scene.laws_as(*HOLDING) if item.law.role != "guide" for b in item.bodies or ()}
    if not gravity.any() or _may_hold(scene):
        return [0.0] * len(channels)
    pulled = {b.id: gravity for b in scene.bodies if b.id not in held}
    for item in scene.laws_as("guide"):
        along = np.array(scene.resolved(item)["direction"], dtype=float)
        for body in item.bodies or tuple(pulled):
            pulled[body] = gravity @ along * along / (along @ along)
    return [abs(float(pulled[c.body]["xy".index(c.kind)])) if c.kind in "xy" and c.body in pulled else 0.0
            for c in channels]  # fmt: skip


def _says_held(recording: Recording, values: np.ndarray, sigmas: Sequence[float], first: int) -> str:
    """What is said of frames before the row ``first``, of numbers (T, c), in which bodies are held."""
    lead = values[:first]
    still = np.nan_to_num(np.abs(lead - np.nanmedian(lead, axis=0))) <= current().release.away * np.asarray(sigmas)
    what = "all is at rest" if still.all() else "what gravity pulls is at rest"
    return f"{recording.name}: {what} until t = {recording.t[first]:.4g} s, as if held: left out until then"


def _says_smoothed(recording: Recording, apart: int) -> str:
    """What is said of tracks of which one frame in so many is used."""
    return (
        f"{recording.name}: the tracks look smoothed, neighbouring frames differ by far less than those {apart} "
        f"frames apart: one frame in {apart} is used; tracks as they were found tell more"
    )


def _apart(
    recording: Recording, channels: Sequence[Channel], values: np.ndarray, steps: Sequence[float], first: int
) -> int:
    """How many frames apart the noise of ``values`` (T, c) is independent, 1 where impacts are all about.

    steps : (c,) of coarse grids, 0 where there is none: numbers on one tell nothing of it, see ``coarse_grid``
    first : the frame from which bodies are free: where they are let go no polynomial follows them
    """
    fine = [column[first:] for column, step in zip(values.T, steps, strict=True) if not step]
    apart = frames_apart(recording.t[first:], fine, _scatter)
    if apart == 1:
        return 1
    near = _meetings(recording, channels, values)[first:]
    around = np.convolve(near, np.ones(current().stamps.window * apart), mode="same")
    return apart if np.mean(around > 0) < 1 - current().smoothed.quiet else 1


def _with_frames(recording: Recording, frames: np.ndarray | slice, apart: int) -> Recording:
    """Those frames of a recording alone, one in so many."""
    angle = None if recording.angle is None else recording.angle[frames]
    rate = None if recording.sampling is None else recording.sampling / apart
    return replace(recording, t=recording.t[frames], xy=recording.xy[frames], angle=angle, sampling=rate)


def _without_filled(
    recording: Recording, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float]
) -> list[str]:  # fmt: skip
    """Sightings among ``values`` (T, c) that a tracker made up become NaN; what is said of them."""
    notes, t = list[str](), recording.t
    stamp = last_place(t)
    for body in dict.fromkeys(channel.body for channel in channels):
        own = [k for k, channel in enumerate(channels) if channel.body == body]
        shows = [estimate_noise(t, values[:, k]) for k in own]
        size = [max(sigmas[k], noise) for k, noise in zip(own, shows, strict=True)]
        told = [values[np.isfinite(values[:, k]), k] for k in own]
        steps, digits = [least_step(v) for v in told], [grid_of(v) or last_place(v) for v in told]
        for made_up, how in (
            (lambda v, s=size, g=steps: held_places(t, v, s, g), "stays at its last place and goes on from elsewhere"),
            (lambda v, s=shows, g=digits: on_a_line(t, v, s, g, stamp), "is on a straight line between its neighbours"),
        ):
            rows = made_up(values[:, own])
            if rows.any():
                values[np.ix_(rows, np.array(own))] = np.nan
                notes.append(
                    f"{recording.name}: {body} {how}, to the last digit (frames: {rows.sum()}, the first at "
                    f"t = {t[rows][0]:.4g} s), as where a tracker lost it and filled the gap: left out"
                )
    return notes


def _timed_noise(
    t: np.ndarray, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float], known: bool,
    stated: float | None, smooth: np.ndarray,
) -> tuple[list[float], float]:  # fmt: skip
    """Sizes of the white noise beside an error of the stamps [s], 0 where none shows.

    smooth : (T,) frames in which nothing meets.
    Where no size was given, one camera has one: that of the channel that shows least. At rest numbers on a grid are the
    same again and again: that shows no noise, and says nothing of how much of it there is in motion, which is no less
    than what rounding leaves.
    """
    base = list(sigmas)
    grids = [rounded_to(t, column) for column in values.T]
    if any(grids):
        again = same_as_before(values)
        smooth = smooth & ~(np.append(again, False) & np.append(False, again))
    if not known:
        for kinds in (("x", "y"), ("angle",)):
            mine = [k for k, channel in enumerate(channels) if channel.kind in kinds and sigmas[k] > 0]
            for k in mine:
                base[k] = min(sigmas[m] for m in mine)
    if min(base) <= 0:
        return list(sigmas), 0.0
    tau, larger = timing(t, values, np.array(base), stated, known, smooth)
    if not tau:
        return list(sigmas), 0.0
    off = abs(np.log(larger)) > current().noise.stated_off
    sizes = [b * larger if off or not known else b for b in base]
    return [max(size, grid / math.sqrt(12.0)) for size, grid in zip(sizes, grids, strict=True)], tau


def _meetings(
    recording: Recording, channels: Sequence[Channel], values: np.ndarray, least: float = 0.0
) -> np.ndarray:  # fmt: skip
    """(T,) frames in which two bodies, or one and a wall, may touch, as near as they get between two frames.

    least : [m] by which their distance changes from one of these frames to the next
    """
    scene = recording.scene
    near = np.zeros(len(values), dtype=bool)
    if not scene.laws_as("contact"):
        return near
    paths = _paths(recording, channels, values)
    paths |= {b.id: np.array([b.initial[:2]]) for b in scene.bodies if not b.mobile and b.initial is not None}
    for k, (name, xy) in enumerate(paths.items()):
        radius = scene.body(name).radius
        gaps = [(r := radius + scene.body(other).radius, np.linalg.norm(xy - at, axis=1) - r)
                for other, at in list(paths.items())[k + 1 :] if len(xy) > 1 or len(at) > 1]  # fmt: skip
        gaps += [(radius, gap_to_wall(xy, radius, wall, scene.periodic_x)) for wall in scene.walls if len(xy) > 1]
        for size, gap in gaps:
            step = np.abs(np.diff(gap, prepend=gap[:1]))
            step = np.fmax(step, np.append(step[1:], 0.0))
            near |= (gap < step + current().segments.near * size) & (step >= least)
    return near


def _paths(recording: Recording, channels: Sequence[Channel], values: np.ndarray) -> dict[str, np.ndarray]:
    """(T, 2) places of the bodies of which both coordinates were measured."""
    place = {(channel.body, channel.kind): values[:, c] for c, channel in enumerate(channels)}
    bodies = [b for b in recording.ids if (b, "x") in place and (b, "y") in place]
    return {b: np.column_stack([place[b, "x"], place[b, "y"]]) for b in bodies}


def layers_seen(law: Law, cases: Sequence[Case]) -> tuple[float, float]:
    """Between which widths [m] a layer along walls, in which a law acts, shows in training parts.

    Some sightings lie in it: bodies pass a thinner one between two frames, and it shows no more than a contact does.
    Some lie outside: a wider one is everywhere. Without walls, or with too few sightings, none is asked.
    """
    gaps, count = [np.zeros(0)], current().candidates.layer
    needed: dict[str, Any] = {p.name: p.typical for p in law.parameters if p.typical is not None}
    for case in cases:
        scene = case.recording.scene
        if not scene.walls and all(b.mobile for b in scene.bodies):
            continue
        lines = scene.resolved(use(law, **needed))
        for name, xy in _paths(case.recording, case.channels, case.values).items():
            seen, radius = xy[case.training & np.isfinite(xy).all(axis=1)], scene.body(name).radius
            every = [seen[:, 1] - lines["bottom"] - radius, lines["top"] - seen[:, 1] - radius]
            every += [gap_to_wall(seen, radius, wall, scene.periodic_x) for wall in scene.walls]
            gaps.append(np.min(every, axis=0))
    nearest = np.sort(np.concatenate(gaps))
    if len(nearest) < 2 * count:
        return 0.0, math.inf
    return max(float(nearest[count - 1]), 0.0), max(float(nearest[-count]), 0.0)


def _without_meetings(
    recording: Recording, channels: Sequence[Channel], values: np.ndarray, sigmas: Sequence[float], near: np.ndarray
) -> np.ndarray:  # fmt: skip
    """(T,) frames without a meeting within the frames of a polynomial about them; near : (T,) where bodies may touch.

    Where that leaves less than half: bodies that go on touching press, and do not kink, so all of them; where contacts
    are instantaneous, those about which nothing is struck, as what rests on a wall touches it and is not.
    """
    around = _around(near)
    if around.sum() <= len(near) / 2:
        return ~around
    if _lasts(recording):
        return np.ones_like(near)
    of_places = [sigma for sigma, channel in zip(sigmas, channels, strict=True) if channel.kind != "angle"]
    least = current().stamps.struck * max(of_places, default=0.0)
    return ~_around(_meetings(recording, channels, values, least))


def _around(near: np.ndarray) -> np.ndarray:
    """(T,) frames whose polynomial goes over one of ``near`` (T,)."""
    wide = current().stamps.window
    return np.convolve(near, np.ones(wide))[wide // 2 :][: len(near)] > 0


def _lasts(recording: Recording) -> bool:
    """Whether a contact takes its time, so that it may be seen."""
    return any(item.law.kind != "impulse" for item in recording.scene.laws_as("contact"))


def _pressed(recording: Recording, near: np.ndarray) -> np.ndarray:
    """(T,) frames in which a contact may be seen while it lasts, none where contacts are instantaneous."""
    return near if _lasts(recording) else np.zeros_like(near)


def _without_outliers(
    t: np.ndarray, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float], smooth: np.ndarray,
    pressed: np.ndarray,
) -> tuple[np.ndarray, int]:  # fmt: skip
    """The numbers (T, c) without single sightings that are no positions, and how many were taken out.

    Where one coordinate of a body is off, the other is not believed either.
    """
    found = np.zeros(values.shape, dtype=bool)
    for c, sigma in enumerate(sigmas):
        found[:, c] = outliers(t, values[:, c], max(sigma, estimate_noise(t, values[:, c])), smooth, pressed)
    for body in dict.fromkeys(channel.body for channel in channels):
        mine = [c for c, channel in enumerate(channels) if channel.body == body]
        found[:, mine] = found[:, mine].any(axis=1, keepdims=True)
    return np.where(found, np.nan, values), int(found.any(axis=1).sum())


def _weighed_noise(
    t: np.ndarray, values: np.ndarray, channels: Sequence[Channel], sigmas: Sequence[float], known: bool,
    tau: float = 0.0,
) -> tuple[list[float], bool, list[str]]:  # fmt: skip
    """Sizes of the noise, whether what was stated is refuted by the recording itself, and what is to be said of it.

    What neighbouring frames say is believed where all channels of a kind together are off by more than
    ``stated_off``, and are told well enough.
    """
    result, refuted, notes = list(sigmas), False, list[str]()
    if not known or tau:  # with the stamps the white part was weighed too
        return result, bool(tau), notes
    for kinds, what, unit in ((("x", "y"), "positions", "m"), (("angle",), "angles", "rad")):
        ratios, told = [], 0
        for c, channel in enumerate(channels):
            seen = np.isfinite(values[:, c])
            if channel.kind in kinds and seen.sum() >= current().noise.frames:
                estimate = estimate_noise(t, values[:, c])
                if estimate > 0:
                    ratios.append(np.log(estimate / sigmas[c]))
                    told += int(seen.sum())
        if not ratios:
            continue
        off = float(np.median(ratios))
        if abs(off) > max(current().noise.stated_off, current().noise.refutes / np.sqrt(2 * told)):
            refuted = True
            mine = [c for c, channel in enumerate(channels) if channel.kind in kinds]
            for c in mine:
                result[c] = sigmas[c] * float(np.exp(off))
            notes.append(
                f"noise of {what}: {sigmas[mine[0]]:.2g} {unit} was stated, neighbouring frames show "
                f"{result[mine[0]]:.2g} {unit}, which is used"
            )
    return result, refuted, notes


def choose_held_out(recordings: Sequence[Recording]) -> set[str]:
    """Names of the recordings to hold out where the user named none: none below three.

    Of recordings of the same bodies the last by name; where every recording has bodies of its own, the
    bodies' parameters could not be known, so then the last 40 % of each are held out instead.
    """
    if len(recordings) < 3:
        return set()
    groups: dict[tuple, list[str]] = {}
    for recording in recordings:
        key = tuple((b.id, b.radius, b.mass) for b in recording.scene.bodies if b.mobile)
        groups.setdefault(key, []).append(recording.name)
    chosen: set[str] = set()
    for names in groups.values():
        names.sort()
        if len(names) >= 2:
            chosen |= set(names[-max(1, len(names) // 3) :])
    return chosen


def divided(
    recordings: Sequence[Recording], hold_out: Sequence[Recording] = ()
) -> tuple[list[Recording], list[Recording]]:
    """Recordings to learn from and held-out ones: as given, or as ``choose_held_out`` chooses.

    Raises InputError where none is left to learn from.
    """
    if hold_out:
        training, held = list(recordings), list(hold_out)
    else:
        names = choose_held_out(recordings)
        training = [r for r in recordings if r.name not in names]
        held = [r for r in recordings if r.name in names]
    if not training:
        raise InputError("every recording is held out: nothing is left to learn from")
    return training, held


def prepare_all(recordings: Sequence[Recording], hold_out: Sequence[Recording] = ()) -> list[Case]:
    """Cases of all recordings, training first. Raises InputError where no training recording is left."""
    training, held = divided(recordings, hold_out)
    cases = [prepare(r, held_out=False, split=not held) for r in training]
    cases += [prepare(r, held_out=True, split=False) for r in held]
    for case in cases:
        _check_enough(case)
    return cases


def _check_enough(case: Case) -> None:
    """Raise InputError where the frames that may be used measure no more than the start of the bodies."""
    pinned = {name for item in case.recording.scene.laws_as("pendulum") for name in item.bodies or ()}
    # a place and a speed in each channel; a pinned body has one angle and its speed
    of_start = sum(2 for c in case.channels if c.body not in pinned) + 2 * len(pinned & set(case.bodies))
    frames, needed = (case.start, of_start) if case.held_out else (case.training, of_start + 1)
    measured = int(np.isfinite(case.values[frames]).sum())
    if measured >= needed:
        return
    if case.held_out:
        part, why = f"first {current().split.start:.0%}", "its start is fitted on these frames alone"
    elif frames.all():
        part, why = "100 %", "they say nothing beyond it"
    else:
        part, why = f"first {current().split.training:.0%}", "they say nothing beyond it, and the rest is held out"
    raise InputError(
        f"the {part} of its time ({case.t[0]:.6g} to {case.t[frames][-1]:.6g} s) have {int(frames.sum())} frames with "
        f"{measured} measured numbers, and the start alone has {of_start}: {why}. Are all time stamps right?",
        file=case.recording.folder,
        where=case.name,
    )
