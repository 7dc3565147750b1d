"""What is compared where the grains are not seen: numbers that average over the packing.

Of tracks: mean and harmonics of the angles of the swimmer's segments against the drive's phase, the drift, the
stroke of the head, the mean distance of neighbouring disks. Of a curve: the mean speed. A recording is a condition:
a scene to be packed, frames to be looked at, numbers that were seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...errors import InputError
from ...recording import Recording
from ...scene import LawUse, Scene
from ..criteria import current
from ..data import choose_held_out, estimate_noise


@dataclass(frozen=True)
class Number:
    """One compared number. ``kind``: "mean", "cos", "sin" (angle of a segment), "head", "drift", "length", "speed".

    place : segment (0 behind the head), or axis (0 along x, 1 along y);  harmonic : 0 for means
    """

    kind: str
    place: int
    harmonic: int
    unit: str

    @property
    def label(self) -> str:
        names = {"drift": "drift along " + "xy"[self.place % 2], "length": "distance of disks", "speed": "speed"}
        if self.kind in names:
            return names[self.kind]
        if self.kind == "mean":
            return f"segment {self.place}, mean angle"
        if self.kind in ("head_cos", "head_sin"):
            return f"head {'xy'[self.place]}, {self.kind[5:]}, harmonic {self.harmonic}"
        return f"segment {self.place}, {self.kind}, harmonic {self.harmonic}"


@dataclass(frozen=True)
class View:
    """How tracks become numbers: the drive's frequency [Hz] and phase [rad], the frames that count, the noise [m].

    t : (T,) frame times [s];  keep : (T,) True for frames that count;  masses : (n,) of the disks
    """

    t: np.ndarray
    keep: np.ndarray
    frequency: float
    phase: float
    masses: np.ndarray
    curve: bool = False

    @property
    def last(self) -> int:
        """The last frame that counts."""
        return int(np.flatnonzero(self.keep)[-1])

    @property
    def cycles(self) -> float:
        t = self.t[self.keep]
        return float(np.ptp(t) * self.frequency) if len(t) > 1 else 0.0

    @cached_property
    def harmonics(self) -> tuple[int, ...]:
        criteria = current().packings.summaries
        return criteria.harmonics if self.cycles >= criteria.higher else (1,)

    def numbers(self) -> tuple[Number, ...]:
        """What ``observe`` returns, in its order."""
        return self._numbers

    @cached_property
    def _numbers(self) -> tuple[Number, ...]:
        if self.curve:
            return (Number("speed", 0, 0, "m/s"),)
        segments = len(self.masses) - 1
        found = [Number("mean", s, 0, "rad") for s in range(segments)]
        for h in self.harmonics:
            found += [Number(kind, s, h, "rad") for kind in ("cos", "sin") for s in range(segments)]
        found += [Number(kind, axis, h, "m") for axis, h in ((1, 1), (0, 2)) for kind in ("head_cos", "head_sin")]
        found += [Number("drift", 0, 0, "m/s"), Number("drift", 1, 0, "m/s"), Number("length", 0, 0, "m")]
        return tuple(found)

    def bends(self) -> np.ndarray:
        """(p, p) that turns the numbers into those of bends: of each segment but the first its angle to the one before.

        A packing that turns a joint turns all segments behind it: bends at joints are hardly correlated, angles are.
        """
        names = self.numbers()
        at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(names)}
        found = np.eye(len(names))
        for k, n in enumerate(names):
            if n.kind in ("mean", "cos", "sin") and n.place:
                found[k, at[n.kind, n.place - 1, n.harmonic]] = -1.0
        return found

    @cached_property
    def _designs(self) -> dict[tuple[tuple[int, ...], bool], np.ndarray]:
        return {}

    def _design(self, t: np.ndarray, orders: tuple[int, ...], trend: bool) -> np.ndarray:
        turn = 2 * math.pi * self.frequency * t + self.phase
        columns = [np.ones_like(t)]
        for h in orders:
            columns += [np.cos(h * turn), np.sin(h * turn)]
        if trend:
            columns.append(t - t.mean())
        return np.column_stack(columns)

    def observe(self, xy: np.ndarray, noise: float = 0.0) -> np.ndarray:
        """(p,) numbers of tracks xy (T, n, 2) [m], unwrapped, NaN where not seen; see ``numbers`` for their order.

        alpha_s(t) = a_s + sum_h b_sh cos(h theta) + c_sh sin(h theta), theta = 2 pi f t + phase, by least squares;
        ``noise`` [m], one standard deviation: its share in the distance of disks is taken off.
        """
        xy = xy[self.keep]
        t = self.t[self.keep]
        if self.curve:
            # the definition of a curve's speed: displacement of the centre of mass over time, head first positive
            centre = np.tensordot(xy, self.masses / self.masses.sum(), axes=([1], [0]))
            velocity = (centre[-1] - centre[0]) / (t[-1] - t[0])
            forward = xy[0, 0] - xy[0, -1]
            axis = np.array([np.sign(forward[0]) or -1.0, 0.0])
            return np.array([float(velocity @ axis)])
        step = np.diff(xy, axis=1)
        angle = np.arctan2(step[..., 1], step[..., 0])
        orders = (1, 2, 3) if len(self.harmonics) > 1 else (1,)
        out: dict[tuple[str, int, int], float] = {}
        for s in range(angle.shape[1]):
            seen = np.isfinite(angle[:, s])
            found = self._fit(t, seen, np.unwrap(angle[seen, s]), orders, False)
            # the turn nearest to the drive's axis: an angle has no other zero
            out["mean", s, 0] = found[0] - 2 * math.pi * round(found[0] / (2 * math.pi))
            for k, h in enumerate(orders):
                out["cos", s, h], out["sin", s, h] = found[1 + 2 * k], found[2 + 2 * k]
        for a in (0, 1):
            seen = np.isfinite(xy[:, 0, a])
            found = self._fit(t, seen, xy[seen, 0, a], (1, 2), True)
            for k, h in enumerate((1, 2)):
                out["head_cos", a, h], out["head_sin", a, h] = found[1 + 2 * k], found[2 + 2 * k]
            whole = np.isfinite(xy[..., a]).all(axis=1)
            middle = xy[whole][..., a].mean(axis=1)
            out["drift", a, 0] = float(self._fit(t, whole, middle, (1, 2), True)[-1])
        squares = np.nanmean((step**2).sum(axis=2), axis=0) - 4 * noise**2
        out["length", 0, 0] = float(np.mean(np.sqrt(np.maximum(squares, 0.0))))
        return np.array([out[n.kind, n.place, n.harmonic] for n in self.numbers()])

    def _fit(
        self, t: np.ndarray, seen: np.ndarray, value: np.ndarray, orders: tuple[int, ...], trend: bool
    ) -> np.ndarray:
        """By least squares to values in the frames (T,) of ``t`` that are seen; of runs these are all of them."""
        if seen.all():
            if (orders, trend) not in self._designs:
                self._designs[orders, trend] = self._design(t, orders, trend)
            design = self._designs[orders, trend]
        else:
            design = self._design(t[seen], orders, trend)
        found: np.ndarray = np.linalg.lstsq(design, value, rcond=None)[0]
        return found

    def noise_covariance(self, xy: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
        """(p, p) covariance of the numbers from white tracking noise [m] on these tracks, by simulation."""
        if noise <= 0 or self.curve:
            p = len(self.numbers())
            return np.zeros((p, p))
        criteria = current().packings.summaries
        drawn = [self.observe(xy + rng.normal(0.0, noise, xy.shape), noise) for _ in range(criteria.draws)]
        covariance: np.ndarray = np.cov(np.array(drawn), rowvar=False)
        sizes, whole = criteria.shares
        return np.diag(np.diag(covariance)) * sizes + covariance * whole

    def filmed(
        self, numbers: np.ndarray, *, scale: float = 1.0, tilt: float = 0.0, time_offset: float = 0.0
    ) -> np.ndarray:
        """The same numbers (p,) as the camera of the contract shows them: seen = s R(tilt) true at t + offset."""
        names = self.numbers()
        if self.curve:
            return scale * numbers
        at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(names)}
        out = numbers.copy()
        # c cos + s sin at a turn further on
        for k, n in enumerate(names):
            if n.kind in ("cos", "head_cos"):
                other = at[n.kind.replace("cos", "sin"), n.place, n.harmonic]
                turn = 2 * math.pi * self.frequency * time_offset * n.harmonic
                c, s = numbers[k], numbers[other]
                out[k] = c * math.cos(turn) + s * math.sin(turn)
                out[other] = s * math.cos(turn) - c * math.sin(turn)
        for k, n in enumerate(names):
            if n.kind == "mean":
                out[k] += tilt
            elif n.kind in ("head_cos", "head_sin", "drift", "length"):
                out[k] *= scale
        a, b = at["drift", 0, 0], at["drift", 1, 0]
        along, across = out[a], out[b]
        out[a] = along * math.cos(tilt) - across * math.sin(tilt)
        out[b] = along * math.sin(tilt) + across * math.cos(tilt)
        # of the head's stroke each axis keeps one harmonic: what the other axis lends at this harmonic is not seen
        for k, n in enumerate(names):
            if n.kind in ("head_cos", "head_sin"):
                out[k] *= math.cos(tilt)
        return out

    def shape(self, numbers: np.ndarray, phases: np.ndarray) -> np.ndarray:
        """(k, segments) angles [rad] over the cycle at ``phases`` (k,) [rad], from means and harmonics."""
        names = self.numbers()
        segments = len(self.masses) - 1
        out = np.zeros((len(phases), segments))
        for value, n in zip(numbers, names, strict=True):
            if n.kind == "mean":
                out[:, n.place] += value
            elif n.kind == "cos":
                out[:, n.place] += value * np.cos(n.harmonic * phases)
            elif n.kind == "sin":
                out[:, n.place] += value * np.sin(n.harmonic * phases)
        return out

    def places(self, numbers: np.ndarray, phases: np.ndarray) -> np.ndarray:
        """(k, n, 2) places of the disks [m] over one cycle, the swimmer's middle at the origin in mid-cycle."""
        names = self.numbers()
        value = {(n.kind, n.place): x for x, n in zip(numbers, names, strict=True) if n.kind in ("drift", "length")}
        angle = self.shape(numbers, phases)
        step = value["length", 0] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        xy = np.concatenate([np.zeros((len(phases), 1, 2)), np.cumsum(step, axis=1)], axis=1)
        xy -= xy.mean(axis=1, keepdims=True)
        when = (phases - math.pi) / (2 * math.pi * self.frequency)
        return xy + when[:, None, None] * np.array([value["drift", 0], value["drift", 1]])

    def distance(self, seen: np.ndarray, predicted: np.ndarray) -> float:
        """Root mean square distance [m] of the disks over one cycle, of two sets of numbers; [m/s] for a curve."""
        if self.curve:
            return abs(float(seen[0] - predicted[0]))
        phases = np.linspace(0, 2 * math.pi, 24, endpoint=False)
        apart = self.places(seen, phases) - self.places(predicted, phases)
        return float(np.sqrt(np.mean(np.sum(apart**2, axis=-1))))


@dataclass(frozen=True)
class Shim:
    """What lists of candidates ask of a recording."""

    recording: Recording
    held_out: bool = False

    @property
    def name(self) -> str:
        return self.recording.name


@dataclass(frozen=True)
class Condition:
    """One swimmer-only recording, or one row of a curve.

    scene : naive, the bed not packed yet; ``time.start`` is where a run begins
    frames : (T,) times [s] at which a run is looked at;  view, test : what counts in training, and held out
    seen, seen_test : the measured numbers;  error : (p, p) covariance of the measurement (tracking noise, sem)
    averaged : the measured number is a mean whose spread is in ``error`` already (a curve)
    """

    name: str
    recording: Recording
    scene: Scene
    frames: np.ndarray
    view: View | None
    seen: np.ndarray
    error: np.ndarray
    test: View | None
    seen_test: np.ndarray
    error_test: np.ndarray
    averaged: bool = False
    layers: float | None = None

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows of the scene's bodies that a run keeps: the swimmer's disks."""
        return self.scene.chains[0]

    @property
    def learnt(self) -> int:
        """How many frames there are up to the held-out part: all where none is, or where nothing else is seen."""
        return len(self.frames) if self.view is None else self.view.last + 1

    @property
    def frequency(self) -> float:
        return float(self.scene.laws_as("stroke")[0].values["frequency"])

    @property
    def any_view(self) -> View:
        view = self.view or self.test
        assert view is not None
        return view

    @property
    def numbers(self) -> tuple[Number, ...]:
        return self.any_view.numbers()


def conditions_of(recordings: Sequence[Recording], hold_out: Sequence[Recording], seed: int) -> list[Condition]:
    """All conditions, those of training recordings first. Raises InputError where one cannot be used."""
    rng = np.random.default_rng(seed)
    for recording in (*recordings, *hold_out):
        check(recording)
    held = {r.name for r in hold_out}
    if not held:
        with_tracks = [r for r in recordings if len(r.t)]
        held = choose_held_out(with_tracks) if len(recordings) >= 3 else set()
    every = [*recordings, *hold_out]
    if all(r.name in held for r in every):
        raise InputError("every recording is held out: nothing is left to learn from")
    result = []
    split = not held
    for recording in sorted(every, key=lambda r: r.name in held):
        if len(recording.t):
            result.append(_from_tracks(recording, recording.name in held, split, rng))
        if recording.curve is not None:
            result += _from_curve(recording, recording.name in held, split)
    if all(c.view is None for c in result):
        raise InputError("nothing is left to learn from: all that was seen is held out")
    return result


def check(recording: Recording) -> None:
    """Raise InputError where the swimmer, its drive or what is known of its bed is missing."""
    scene = recording.scene

    def error(message: str, where: str) -> InputError:
        return InputError(message, file=recording.folder, where=where)

    if not len(recording.t) and recording.curve is None:
        raise error("has neither tracks nor a curve", recording.name)
    if len(scene.chains) != 1 or len(scene.chains[0]) < 2:
        raise error(f"needs one swimmer (a head and its tail), has {len(scene.chains)}", "body")
    if not scene.laws_as("stroke"):
        raise error("needs the law that drives the swimmer", "law bending")
    grains = [b for b in scene.bodies if b.role == "grain"]
    if scene.bed is None and not grains:
        raise error("says nothing about the bed: it needs height, packing_fraction, grain_diameter, density",
                    "scene.bed")  # fmt: skip
    if grains and any(b.initial is None for b in grains):
        raise error("a grain that is listed but not seen needs its place at the start", f"body {grains[0].id}")
    if scene.bed is not None and scene.periodic_x is None:
        raise error("a bed needs periodic_x, the width of its box [m]", "scene")
    if recording.curve is not None:
        for k, row in enumerate(recording.curve):
            if not row["frequency"] > 0:
                raise error("frequency should be above zero [Hz]", f"curve.csv, row {k + 2}")
            if row["layers"] > 0 and not _layered(scene):
                raise error("there are layers above the swimmer, but the scene has no law confinement",
                            f"curve.csv, row {k + 2}")  # fmt: skip
    if len(recording.t):
        missing = [scene.bodies[k].id for k in scene.chains[0] if scene.bodies[k].id not in recording.ids]
        if missing:
            raise error("is never seen; all disks of the swimmer have to be tracked", f"body {missing[0]}")


def _start(recording: Recording, xy: np.ndarray) -> tuple[Scene, bool]:
    """The scene with the swimmer placed, and whether it rests there.

    Where the start is not given it is the first frame's shape at the disks' own distance, at rest: the frames
    that follow at once are not compared.
    """
    scene = recording.scene
    rows = scene.chains[0]
    if all(scene.bodies[k].initial is not None for k in rows):
        return scene, True
    if len(xy):
        whole = np.flatnonzero(np.isfinite(xy).all(axis=(1, 2)))
        if not len(whole):
            raise InputError("no frame shows the whole swimmer", file=recording.folder, where=recording.name)
        place = xy[whole[0]]
        step = np.diff(place, axis=0)
        angle = np.arctan2(step[:, 1], step[:, 0])
        straight = float(np.abs(angle).max()) < current().packings.summaries.straight
        head = place[0]
    else:
        bed = scene.bed
        assert bed is not None and scene.periodic_x is not None
        length = sum(2 * scene.bodies[k].radius for k in rows)
        head = np.array([(scene.periodic_x - length) / 2, bed.height / 2])
        angle, straight = np.zeros(len(rows) - 1), True
    if straight:
        angle = np.zeros_like(angle)
    states = {}
    here = np.array(head, dtype=float)
    for k, row in enumerate(rows):
        body = scene.bodies[row]
        if k:
            apart = scene.bodies[rows[k - 1]].radius + body.radius
            here = here + apart * np.array([math.cos(angle[k - 1]), math.sin(angle[k - 1])])
        states[body.id] = (float(here[0]), float(here[1]), 0.0, 0.0)
    return scene.with_initial(states), straight


def _from_tracks(recording: Recording, held: bool, split: bool, rng: np.random.Generator) -> Condition:
    criteria = current().packings.summaries
    scene = recording.scene
    columns = [recording.column(scene.bodies[k].id) for k in scene.chains[0]]
    xy = recording.unwrapped().xy[:, columns]
    if scene.periodic_x is not None:
        # neighbours stand on the same side of the seam
        for k in range(1, xy.shape[1]):
            apart = xy[:, k, 0] - xy[:, k - 1, 0]
            xy[:, k, 0] -= scene.periodic_x * np.round(apart / scene.periodic_x)
    placed, rests = _start(recording, xy)
    t = recording.t
    bending = scene.laws_as("stroke")[0].values
    f, phase = float(bending["frequency"]), float(bending["phase"])
    if not f > 0:
        raise InputError("frequency should be above zero [Hz]", file=recording.folder, where="law bending")
    duration = float(t[-1] - t[0])
    # a swimmer filmed on its way has a bed that remembers; one filmed from rest starts as the simulation does
    criteria = current().packings.summaries
    least, cycles = criteria.settled if rests else criteria.under_way
    skip = min(max(least, cycles / f), criteria.late * duration)
    begin = float(t[0]) + skip
    cut = float(t[0]) + current().split.training * duration
    masses = np.array([scene.bodies[k].mass for k in scene.chains[0]])
    enough = (t[-1] - cut) * f >= criteria.cycles and (cut - begin) * f >= criteria.cycles
    before, after = (t >= begin) & (t <= cut), t > cut
    every = t >= begin
    if held:
        view, test = None, View(t, every, f, phase, masses)
    elif split and enough:
        view, test = View(t, before, f, phase, masses), View(t, after, f, phase, masses)
    else:
        view, test = View(t, every, f, phase, masses), None
    noise = recording.position_noise
    if noise is None:
        noise = _noise(t, xy)
    nothing = np.zeros(0), np.zeros((0, 0))
    measured = []
    for looked in (view, test):
        if looked is None:
            measured.append(nothing)
            continue
        if looked.cycles < criteria.cycles:
            raise InputError(
                f"shows {looked.cycles:.2g} cycles of {f:g} Hz after the start; {criteria.cycles:g} are needed",
                file=recording.folder,
                where=recording.name,
            )
        few = np.isfinite(xy[looked.keep]).all(axis=2).sum(axis=0)
        if few.min() < criteria.frames:
            row = scene.chains[0][int(np.argmin(few))]
            raise InputError(
                f"is seen in {few.min()} of the frames that count; {criteria.frames} are needed",
                file=recording.folder, where=f"body {scene.bodies[row].id}",
            )  # fmt: skip
        measured.append((looked.observe(xy, noise), looked.noise_covariance(xy, noise, rng)))
    start = replace(placed, time=replace(placed.time, start=float(t[0])), adjustable=())
    return Condition(
        recording.name, recording, start, t, view, measured[0][0], measured[0][1], test, measured[1][0], measured[1][1]
    )


def _noise(t: np.ndarray, xy: np.ndarray) -> float:
    """Tracking noise [m] where it was not given."""
    return float(np.median([estimate_noise(t, column) for column in xy.reshape(len(t), -1).T]))


def _few(n: float) -> float:
    """By how much the square of a standard error is larger that n speeds tell: nu/(nu - 2), nu = n - 1.

    The variance of Student's t; a mean of two or three speeds counts as one of four, for which it is 3. 1 where n is
    not said.
    """
    if not math.isfinite(n):
        return 1.0
    nu = max(n - 1, 3.0)
    return nu / (nu - 2)


def _layered(scene: Scene) -> list[LawUse]:
    """Laws of a scene that know how many layers lie above the swimmer, as curve.csv says it."""
    return [item for item in scene.laws if "layers" in item.values]


def _from_curve(recording: Recording, held: bool, split: bool) -> list[Condition]:
    scene, _ = _start(recording, np.zeros((0, 7, 2)))
    curve = recording.curve
    assert curve is not None
    criteria = current().packings.summaries
    end, first = float(scene.time.duration or criteria.end), criteria.curve
    if not end > first + criteria.least:
        needed = f"it has to last {first + criteria.least:g} s or more"
        raise InputError(f"a curve's speed is that after {first:g} s: {needed}", file=recording.folder,
                         where="time.duration")  # fmt: skip
    frames = np.arange(0.0, end + 0.5 * criteria.look, criteria.look)
    masses = np.array([scene.bodies[k].mass for k in scene.chains[0]])
    result, stroke = [], scene.laws_as("stroke")[0]
    for k, row in enumerate(curve):
        f, layers = float(row["frequency"]), float(row["layers"])
        own = scene.with_parameter(f"{stroke.name}.frequency", f)
        for item in _layered(own):
            own = own.with_parameter(f"{item.name}.layers", layers)
        own = replace(own, adjustable=(), time=replace(own.time, start=0.0))
        phase = float(stroke.values["phase"])
        view = View(frames, frames >= first - current().rounding.time, f, phase, masses, curve=True)
        sem = float(row["speed_sem"])
        speed = np.array([float(row["speed"])])
        error = np.array([[sem**2 * _few(float(row["n"])) if math.isfinite(sem) else 0.0]])
        # every third speed tests what the others said
        test = held or (split and len(curve) >= criteria.speeds and k % 3 == 1)
        name = f"{recording.name}, {f:g} Hz" + (f", {layers:g} layers" if math.isfinite(layers) else "")
        none, empty = np.zeros(0), np.zeros((0, 0))
        result.append(
            Condition(
                name, recording, own, frames,
                view=None if test else view, seen=none if test else speed, error=empty if test else error,
                test=view if test else None, seen_test=speed if test else none, error_test=error if test else empty,
                averaged=math.isfinite(sem), layers=layers if math.isfinite(layers) else None,
            )
        )  # fmt: skip
    return result


def fastest_of(conditions: Sequence[Condition]) -> float:
    """How fast disks moved in the training parts, along one axis [m/s]; infinite where no tracks were seen.

    A few steps may be faster, as in recordings of bodies.
    """
    found = []
    for c in conditions:
        if c.view is None or c.view.curve:
            continue
        learnt = c.recording.t <= c.view.t[c.view.last]
        step = np.abs(np.diff(c.recording.xy[learnt], axis=0)) / np.diff(c.recording.t[learnt])[:, None, None]
        seen = (column[np.isfinite(column)] for column in step.reshape(len(step), -1).T)
        found += [float(np.quantile(column, current().candidates.fastest)) for column in seen if len(column)]
    return max(found, default=math.inf)
