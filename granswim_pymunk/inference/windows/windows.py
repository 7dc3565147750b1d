"""Short windows through a bed: members started from estimated states, and what is seen of them later.

A bed forgets: a difference in the last bit grows tenfold a millisecond. So every window starts anew, and what
is compared is the mean over a few members, 8 to 16 ms on: where the disks of the swimmer are, and how the
grains near it and far from it have moved on the whole (``sums``).
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...engine import Simulation, advise_dt
from ...errors import InputError, SimulationError
from ...machine import cores
from ...recording import Recording
from ...recording.camera import see
from ...scene import Scene
from ..criteria import current
from ..data import Case, estimate_noise, prepare
from ..hypothesis import NO_CAMERA, Failed, Hypothesis
from ..kept import Store, digest
from ..linking import linked, off_links
from ..threads import ContextPool
from .cut import carried_paths, cut_out
from .hidden import with_hidden
from .radii import Sized, with_radii
from .stamps import Jitter, in_order, sighting_noise
from .starts import Shapes, draw, local_quadratic, take_apart
from .sums import Sums, size_of, sums_of

THREADS = cores()
POOL = ContextPool(max_workers=THREADS, thread_name_prefix="granswim-bed")


@dataclass(frozen=True, eq=False)
class Film:
    """One film of a bed in the scene's order.

    t : (T,) [s];  xy : (T, n, 2) as the camera shows it [m], unwrapped, NaN where not seen;  sigma [m]
    """

    t: np.ndarray
    xy: np.ndarray
    sigma: float


@dataclass(frozen=True, eq=False)
class BedCase:
    """A recording of swimmer and bed, cut into windows.

    case : the same for the machinery of candidates;  rows : (s,) scene rows of the swimmer's disks that are seen
    grains : (g,) scene rows of the grains that are seen;  starts : (W,) frames at which windows start
    looks : (L,) frames later, the first 0;  training : (W,) bool;  repaired : labels put back, sightings left out
    hidden : (h,) rows of grains that the film does not show, see ``hidden``: they are there, and are not compared
    given : the recording as it was given, without them
    resized : how far off the radii of grains were, which are put right; None where they are as believed
    jitter : of the frames' moments, which are put right as far as the film tells; None where they are even
    """

    case: Case
    film: Film
    rows: np.ndarray
    grains: np.ndarray
    starts: np.ndarray
    looks: np.ndarray
    training: np.ndarray
    shapes: Shapes
    dt: float
    seed: int
    repaired: tuple[int, int]
    hidden: np.ndarray
    given: Recording
    resized: Sized | None = None
    jitter: Jitter | None = None

    @property
    def recording(self) -> Recording:
        return self.case.recording

    @property
    def name(self) -> str:
        return self.recording.name

    @property
    def scene(self) -> Scene:
        return self.recording.scene

    @property
    def times(self) -> np.ndarray:
        """(W,) times [s] of the starts."""
        return self.film.t[self.starts]

    @property
    def half(self) -> int:
        """Frames on either side that a start is told from: the first that a replicate has."""
        return current().windows.starts.half

    @property
    def span(self) -> float:
        """Length of a window [s]."""
        return float(self.film.t[self.looks[-1]] - self.film.t[0])

    @property
    def swimmer_size(self) -> int:
        """How many of the compared numbers are positions of disks; those come first."""
        return len(self.looks) * len(self.rows) * 2

    @property
    def size(self) -> int:
        """D: how many numbers are compared in a window."""
        return self.swimmer_size + (len(self.looks) - 1) * size_of(len(self.rows)) * bool(len(self.grains))

    def shapes_of(self, scene: Scene) -> Shapes:
        """Of bodies that may have other radii, or other links; mine where they have mine."""
        if scene.bodies is self.scene.bodies and scene.laws is self.scene.laws:
            return self.shapes
        radius, lengths = np.array([b.radius for b in scene.bodies]), self.shapes.lengths
        if scene.laws_as("link") != self.scene.laws_as("link"):
            lengths = Shapes.of(scene).lengths
        same = np.array_equal(radius, self.shapes.radius) and np.array_equal(lengths, self.shapes.lengths)
        return self.shapes if same else replace(self.shapes, radius=radius, lengths=lengths)

    def frequency(self) -> float | None:
        """Of the drive [Hz]."""
        for item in self.scene.laws_as("stroke"):
            if item.values["frequency"]:
                return float(item.values["frequency"])
        return None

    def phases(self) -> np.ndarray | None:
        """(W,) the drive's phase in the middle of each window, as a share of the cycle."""
        f = self.frequency()
        if f is None:
            return None
        shift = float(self.scene.laws_as("stroke")[0].values["phase"]) / (2 * np.pi)
        return np.mod(f * (self.times + 0.5 * self.span) + shift, 1.0)


def bed_case(
    recording: Recording, *, held_out: bool = False, split: bool = True, seed: int = 0, most: int | None = None
) -> BedCase:
    """Cut a recording into windows that share no frame, ``most`` at the most. Raises InputError for too few."""
    scene, plan, half = recording.scene, current().windows.plan, current().windows.starts.half
    most = plan.most if most is None else most

    def fault(message: str) -> InputError:
        return InputError(message, file=recording.folder, where=f"recording {recording.name}")

    if not scene.chains:
        raise fault("has no swimmer to follow through the bed")
    if recording.xy.size == 0 or len(recording.t) < plan.frames:
        raise fault("has too few frames for windows in a bed")
    unwrapped = recording.unwrapped().xy
    end = recording.t[0] + current().split.training * (recording.t[-1] - recording.t[0])
    learnt = int(np.sum(recording.t <= end)) if split and not held_out else len(recording.t)
    sigma, upper = recording.position_noise, sighting_noise(recording.t[:learnt], unwrapped[:learnt])
    if upper and (not sigma or sigma > current().windows.stamps.refuted * upper):
        sigma = upper
    if not sigma:
        columns = [unwrapped[:, k, a] for k in range(min(len(recording.ids), 40)) for a in (0, 1)]
        found = [estimate_noise(recording.t, c) for c in columns]
        sigma = float(np.median(found))
    # whether it is what was said that is too little, a simulated film tells later (``as_filmed``)
    likely = upper if upper > current().windows.stamps.refuted * sigma else float(sigma)
    full = np.full((len(recording.t), len(scene.bodies), 2), np.nan)
    tracks = linked(recording.t, unwrapped, likely, scene.periodic_x or 0.0)
    full[:, recording.track_rows] = tracks.xy
    full, off = off_links(full, Shapes.of(scene).joints, likely, scene.periodic_x or 0.0)
    listed = len(scene.bodies)
    given = recording
    recording, resized = with_radii(recording, full, likely, learnt)
    recording, full = with_hidden(recording, full, likely, learnt)
    scene = recording.scene
    # of a bed one noise is told for all
    case = prepare(replace(recording, position_noise=likely), held_out=held_out, split=split, clean=False)
    spacing = float(np.median(np.diff(recording.t)))
    reach = max(round(plan.length / spacing), half + 2)
    # a frame that the start is made of says nothing new, but for its place among its neighbours
    looks = np.unique([0, max(round(reach / 2), half + 1), reach])
    # replicates of a recording begin at its third frame and have no earlier ones; they need a while to settle
    first, last = 2 * half + 2, len(recording.t) - 1 - reach
    size = half + reach + 1
    count = (last - first) // size + 1
    if count < plan.windows:
        raise fault(
            f"only {max(count, 0)} windows of {1e3 * plan.length:g} ms fit in; {plan.windows} are needed "
            "(film longer, or with more frames a second)"
        )
    starts = first + size * np.arange(count)
    if count > most:
        starts = starts[np.unique(np.round(np.linspace(0, count - 1, max(most, plan.windows))).astype(int))]
    training = np.full(len(starts), not held_out)
    if split and not held_out:
        training = recording.t[starts + reach] <= end
    seen = np.isfinite(full[..., 0]).sum(axis=0) > current().windows.starts.sightings
    rows = np.array([k for chain in scene.chains for k in chain if seen[k]], dtype=np.int64)
    if not len(rows):
        raise fault("no disk of the swimmer is seen in five frames")
    grains = [k for k, b in enumerate(scene.bodies) if b.role == "grain" and seen[k] and k < listed]
    dt = max(scene.time.dt or 0.0, plan.coarse * advise_dt(placed(scene, np.nan_to_num(full[first]), None)))
    steps = max(int(np.ceil(spacing / dt)), current().fits.steps)
    return BedCase(
        case, Film(recording.t, full, float(sigma)), rows, np.array(grains, dtype=np.int64), starts, looks, training,
        Shapes.of(scene), spacing / steps, seed, (tracks.put_back, tracks.left_out + off),
        np.arange(listed, len(scene.bodies)), given, resized,
    )  # fmt: skip


def placed(scene: Scene, xy: np.ndarray, v: np.ndarray | None) -> Scene:
    """The scene with a start for every mobile body: xy, v (n, 2) [m, m/s]."""
    v = np.zeros_like(xy) if v is None else v
    bodies = tuple(
        replace(b, initial=(float(xy[k, 0]), float(xy[k, 1]), float(v[k, 0]), float(v[k, 1]))) if b.mobile else b
        for k, b in enumerate(scene.bodies)
    )
    return replace(scene, bodies=bodies)


def off_by(bed: BedCase, scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with masses and radii off by as much as the recording says that they may be.

    Each by a factor of its own, exp(s z - s^2/2) with s the relative error and z a normal number within 2.5. Radii of
    disks are as far off as those of grains were before these were put right.
    """
    radius, mass = bed.recording.radius_error or 0.0, bed.recording.mass_error or 0.0
    if not (radius or mass):
        return scene
    disks = radius if bed.resized is None else bed.resized.off
    z = np.clip(rng.normal(size=(len(scene.bodies), 2)), -2.5, 2.5)
    errors = np.array([(radius if b.role == "grain" else disks, mass) for b in scene.bodies])
    factors = np.exp(errors * z - 0.5 * errors**2)
    bodies = tuple(
        replace(b, radius=b.radius * float(f[0]), mass=b.mass * float(f[1])) if b.mobile else b
        for b, f in zip(scene.bodies, factors, strict=True)
    )
    return replace(scene, bodies=bodies)


def _plain(camera: Mapping[str, Any]) -> bool:
    """Whether places are shown as they are."""
    return camera["scale"] == 1 and camera["tilt"] == 0.0 and not any(camera["bias"])


def _unseen(xy: np.ndarray, camera: Mapping[str, Any]) -> np.ndarray:
    """True positions from those that the camera shows: the inverse of ``see``."""
    if _plain(camera):
        return xy
    return see(xy - np.asarray(camera["bias"]), scale=1.0 / camera["scale"], tilt=-camera["tilt"])


def _shown(xy: np.ndarray, camera: Mapping[str, Any]) -> np.ndarray:
    return see(xy, scale=camera["scale"], tilt=camera["tilt"], bias=camera["bias"])


Kept = dict[tuple[int, int], Any]  # starts by window and member, and under member -1 the path of the wall


class BedPredictor:
    """Predicts windows of one film under a hypothesis; a start is estimated once for each camera.

    ``runs`` counts members simulated.  ``store``: where finished predictions are kept.  ``cut``: what is near the
    swimmer is simulated, grains farther off are walls that move as seen, if that saves much (see ``cut_out``).
    """

    def __init__(
        self, bed: BedCase, film: Film | None = None, members: int | None = None, store: Store | None = None,
        cut: bool = True,
    ) -> None:  # fmt: skip
        self.bed = bed
        self.film = film or bed.film
        self.cuts = cut
        self.cut = cut_out(bed.scene, self.film.xy, bed.starts, int(bed.looks[-1])) if cut else None
        self.free = np.ones(len(bed.grains), dtype=bool)  # which of the grains are simulated
        if self.cut is not None:
            self.free = np.isin(bed.grains, self.cut.inside)
        self.store = store
        self.members = members or current().windows.plan.members
        self._lock = threading.Lock()
        self.keeps = current().windows.starts.kept
        self._starts: dict[tuple[Any, ...], Kept] = {}
        self._sums: dict[int, Sums] = {}
        self.weighed = False
        self.runs = 0

    def of(self, film: Film, members: int | None = None) -> BedPredictor:
        """The same for another film, a replicate's; none of its predictions, and few of its starts, are kept."""
        own = BedPredictor(self.bed, film, members or self.members, cut=self.cuts)
        own.keeps = 2
        return own

    @property
    def whole(self) -> float:
        """How many times the bodies of a window the whole bed has."""
        return 1.0 if self.cut is None else len(self.bed.scene.bodies) / len(self.cut.rows)

    @property
    def member_cost(self) -> float:
        """Seconds of a core [s] that a member of a window takes, about."""
        bodies = len(self.bed.scene.bodies) if self.cut is None else len(self.cut.rows)
        work = current().work
        return bodies * (work.body_start + work.body_step * self.bed.span / self.bed.dt)

    @property
    def film_cost(self) -> float:
        """Seconds of a core [s] that the whole film of a replicate takes, about."""
        return len(self.bed.scene.bodies) * current().work.body_step * float(np.ptp(self.bed.film.t)) / self.bed.dt

    def pace(self) -> np.ndarray:
        """(2,) rms speed [m/s] at the starts of training windows, of the swimmer's disks and of the grains."""
        bed, frames = self.bed, self.bed.starts[self.bed.training]
        if not len(frames):
            frames = bed.starts
        after, before, t = frames + bed.half, frames - bed.half, self.film.t
        v = (self.film.xy[after] - self.film.xy[before]) / (t[after] - t[before])[:, None, None]
        squares = np.sum(v**2, axis=-1)
        means = [np.nanmean(squares[:, rows]) if len(rows) else 0.0 for rows in (bed.rows, bed.grains)]
        return np.sqrt(np.nan_to_num(np.array(means)))

    # ---- what is seen -------------------------------------------------------------------------

    def sums(self, window: int) -> Sums:
        """How the grains of a window are added up; alike until ``weigh`` has been asked."""
        if window not in self._sums:
            bed = self.bed
            frame = int(bed.starts[window])
            low = max(frame - 8, 0)
            xy = self.film.xy[low : frame + 9]
            posterior = local_quadratic(self.film.t[low : frame + 9], xy, frame - low, self.film.sigma)
            radius = np.array([b.radius for b in bed.scene.bodies])
            seen = np.isfinite(self.film.xy[frame, :, 0])
            self._sums[window] = sums_of(posterior, seen, bed.rows, bed.grains, radius, bed.scene.periodic_x or 0.0)
        return self._sums[window]

    def weigh(self, hypothesis: Hypothesis, values: np.ndarray, windows: Sequence[int] | None = None) -> np.ndarray:
        """From now on grains count by how little members scatter under a hypothesis; what these show, (w, m, D).

        Raises Failed.
        """
        chosen = range(len(self.bed.starts)) if windows is None else windows
        simulation, camera = self.simulation(hypothesis, values)
        out = np.empty((len(chosen), self.members, self.bed.size))
        for k, window in enumerate(map(int, chosen)):
            shown = [self._shown_by(simulation, camera, window, m) for m in range(max(self.members, 2))]
            if len(self.bed.grains):
                sums = self.sums(window)
                q = sums.sure(np.stack([moved for _, moved in shown]), self.film.sigma)
                self._sums[window] = replace(sums, q=q)
            out[k] = [self._numbers(window, *s) for s in shown[: self.members]]
        self.weighed = True
        return out

    def seen(self, windows: Sequence[int] | None = None) -> np.ndarray:
        """(w, D) what is compared, as the film shows it [m], NaN where not seen."""
        bed = self.bed
        chosen = range(len(bed.starts)) if windows is None else windows
        out = np.empty((len(chosen), bed.size))
        for k, w in enumerate(chosen):
            frames = bed.starts[w] + bed.looks
            out[k, : bed.swimmer_size] = self.film.xy[frames][:, bed.rows].ravel()
            if len(bed.grains):
                moved = self.film.xy[frames[1:]][:, bed.grains] - self.sums(w).start
                moved[:, ~self.free] = np.nan
                out[k, bed.swimmer_size :] = self.sums(w).of(moved).ravel()
        return out

    # ---- starts -------------------------------------------------------------------------------

    def start(
        self, window: int, member: int, camera: Mapping[str, Any] = NO_CAMERA, scene: Scene | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (n, 2) of a member at the start of a window [m, m/s], of bodies as in ``scene``."""
        shapes = self.bed.shapes if scene is None else self.bed.shapes_of(scene)
        kept = self._kept_for(camera, shapes)
        found = kept.get((window, member))
        if found is None:
            frame, numbers = int(self.bed.starts[window]), (window, member)
            if self.cut is None:
                found = self.start_at(frame, numbers, camera, shapes=shapes)
            else:
                wall = self.cut.wall
                path = self._wall_path(window, camera, kept)
                found = self.start_at(frame, numbers, camera, self.cut.rows, (wall, path[0]), shapes)
                found[1][wall] = self._wall_velocity(window, path, 0)
            with self._lock:
                kept[window, member] = found
        return found

    def _kept_for(self, camera: Mapping[str, Any], shapes: Shapes) -> Kept:
        """Starts with this camera and bodies of these shapes; those asked for last are kept."""
        sizes = b"" if shapes is self.bed.shapes else shapes.radius.tobytes() + shapes.lengths.tobytes()
        key = (camera["scale"], camera["tilt"], tuple(camera["bias"]), sizes)
        with self._lock:
            if key not in self._starts:
                if len(self._starts) >= self.keeps:
                    # the oldest but for the first, which is the scene as believed
                    del self._starts[list(self._starts)[1]]
                self._starts[key] = {}
            return self._starts[key]

    def start_at(
        self,
        frame: int,
        numbers: tuple[int, ...],
        camera: Mapping[str, Any] = NO_CAMERA,
        rows: np.ndarray | None = None,
        held: tuple[np.ndarray, np.ndarray] | None = None,
        shapes: Shapes | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """A state (n, 2), (n, 2) drawn from what the frames around ``frame`` say; ``numbers`` seed the draw.

        ``rows`` of the scene's bodies, all if not given: others are left at nought.  ``held``: rows, and the places
        (k, 2) [m] where they stay.  ``shapes``: of other bodies than the scene's.
        """
        bed = self.bed
        # one draw for all hypotheses, so that their differences are physics
        normals = np.random.default_rng((bed.seed, *numbers)).normal(size=(len(bed.scene.bodies), 2, 2))
        low, high = max(frame - 8, 0), frame + 9
        t, film = self.film.t[low:high], self.film
        chosen = np.arange(len(bed.scene.bodies)) if rows is None else rows
        seen = _unseen(film.xy[low:high], camera)[:, chosen]
        posterior = local_quadratic(t, seen, frame - low, film.sigma / camera["scale"])
        xy, v = np.zeros((2, len(bed.scene.bodies), 2))
        xy[chosen], v[chosen] = draw(posterior, normals[chosen])
        for k in chosen:
            b = bed.scene.bodies[k]
            if not b.mobile and b.initial is not None:
                xy[k], v[k] = b.initial[:2], 0.0
        if held is not None:
            xy[held[0]] = held[1]
        shapes = bed.shapes if shapes is None else shapes
        xy[chosen] = take_apart(xy[chosen], shapes.part(chosen, () if held is None else held[0]))
        return xy, v

    def _wall_path(self, window: int, camera: Mapping[str, Any], kept: Kept) -> np.ndarray:
        """(L, k, 2) where the grains that are walls are at the looks [m]; ``kept`` for this camera."""
        assert self.cut is not None
        if (window, -1) in kept:
            return kept[window, -1]
        bed = self.bed
        first = int(bed.starts[window])
        # a frame more on either side: the path is least sure at its ends
        low, high = max(first - 1, 0), min(first + int(bed.looks[-1]) + 2, len(self.film.t))
        seen = _unseen(self.film.xy[low:high][:, self.cut.wall], camera)
        path = carried_paths(self.film.t[low:high], seen, self.film.t[first + bed.looks])
        lost = ~np.isfinite(path[0, :, 0])
        if lost.any():
            # not seen in all of the window: where it was seen last
            xy = _unseen(self.film.xy[:low][:, self.cut.wall[lost]], camera)
            for k, track in zip(np.flatnonzero(lost), np.moveaxis(xy, 1, 0), strict=True):
                known = np.flatnonzero(np.isfinite(track[:, 0]))
                path[:, k] = track[known[-1]] if len(known) else (0.0, 0.0)
        with self._lock:
            kept[window, -1] = path
        return path

    def _wall_velocity(self, window: int, path: np.ndarray, leg: int) -> np.ndarray:
        t = self.film.t[int(self.bed.starts[window]) + self.bed.looks]
        return (path[leg + 1] - path[leg]) / (t[leg + 1] - t[leg])

    # ---- predictions --------------------------------------------------------------------------

    def key(self, what: str, hypothesis: Hypothesis, values: np.ndarray, *numbers: Any) -> str:
        """What a prediction is of, as the name of its file."""
        scene, camera = hypothesis.scene(self.bed.case, values)
        bed = self.bed
        return digest(
            [
                what,
                bed.name,
                scene.hash,
                sorted(camera.items()),
                bed.starts,
                bed.looks,
                bed.dt,
                bed.seed,
                self.weighed,
                bed.recording.radius_error,
                bed.recording.mass_error,
                *numbers,
            ]
        )

    def simulation(self, hypothesis: Hypothesis, values: np.ndarray) -> tuple[Simulation, Mapping[str, Any]]:
        """A simulation under a hypothesis, ready to be restarted anywhere, and its camera. Raises Failed.

        Of the cut where there is one, else of all bodies.
        """
        scene, camera = hypothesis.scene(self.bed.case, values)
        xy, v = self.start(0, 0, camera, scene)
        only, carried = (None, ()) if self.cut is None else (self.cut.rows, self.cut.wall)
        try:
            started = placed(replace(scene, adjustable=()), xy, v)
            return Simulation(started, dt=self.bed.dt, only=only, carried=carried), camera
        except (InputError, SimulationError) as error:
            raise Failed(str(error)) from None

    def __call__(
        self,
        hypothesis: Hypothesis,
        values: np.ndarray,
        windows: Sequence[int] | None = None,
        members: int | None = None,
        first: int = 0,
    ) -> np.ndarray:
        """(w, m, D) what each member would show [m], from number ``first`` on. Raises Failed."""
        bed = self.bed
        chosen = range(len(bed.starts)) if windows is None else windows
        count = members or self.members
        key = self.key("windows", hypothesis, values, list(map(int, chosen)), count, first) if self.store else ""
        out = self.store.get(key, (len(chosen), count, bed.size)) if self.store else None
        if out is not None:
            return out
        simulation, camera = self.simulation(hypothesis, values)
        out = np.empty((len(chosen), count, bed.size))
        for k, window in enumerate(chosen):
            for member in range(count):
                out[k, member] = self.member(simulation, camera, int(window), first + member)
        if self.store:
            self.store.put(key, out)
        return out

    def member(self, simulation: Simulation, camera: Mapping[str, Any], window: int, number: int) -> np.ndarray:
        """(D,) what one member of one window would show [m]. Raises Failed."""
        return self._numbers(window, *self._shown_by(simulation, camera, window, number))

    def _shown_by(
        self, simulation: Simulation, camera: Mapping[str, Any], window: int, number: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places of the disks (L, s, 2), displacements of the grains (L - 1, g, 2) [m], NaN where the film has none."""
        bed = self.bed
        frames = int(bed.starts[window]) + bed.looks
        t = self.film.t[frames] + float(camera["time_offset"])
        xy, v = self.start(window, number, camera, simulation.scene)
        rows = np.concatenate([bed.rows, bed.grains[self.free]])
        try:
            simulation.restart(xy, v, float(t[0]))
            if self.cut is None:
                later = simulation.sample(t[1:], rows)
            else:
                kept = self._kept_for(camera, bed.shapes_of(simulation.scene))
                # the start is everybody's: the wall's velocities of a leg are this run's own
                path, v, legs = self._wall_path(window, camera, kept), v.copy(), []
                for leg in range(len(t) - 1):
                    v[self.cut.wall] = self._wall_velocity(window, path, leg)
                    simulation.steer(v)
                    legs.append(simulation.sample(t[leg + 1 : leg + 2], rows))
                later = np.concatenate(legs)
        except SimulationError as error:
            raise Failed(str(error)) from None
        self.runs += 1
        if not np.isfinite(later).all():
            raise Failed("a prediction is not finite")
        path = _shown(np.concatenate([xy[rows][None], later]), camera)
        s = len(bed.rows)
        moved = np.full((len(frames) - 1, len(bed.grains), 2), np.nan)
        if len(bed.grains):
            moved[:, self.free] = path[1:, s:] - self.sums(window).start[self.free]
            # of those grains only that the film shows there
            moved[~np.isfinite(self.film.xy[frames[1:]][:, bed.grains, 0])] = np.nan
        return path[:, :s], moved

    def _numbers(self, window: int, disks: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(D,) what is compared."""
        grains = self.sums(window).of(moved).ravel() if len(self.bed.grains) else moved.ravel()
        return np.concatenate([disks.ravel(), grains])

    def replicate(self, hypothesis: Hypothesis, values: np.ndarray, number: int) -> Film:
        """The recording as it would be if the hypothesis were the truth: simulated throughout and filmed.

        Its bodies are off as the recording says that radii and masses may be, those of each replicate in another way:
        what the windows then show is what a scene with the wrong ones leaves. Its frames are as uneven as the film's,
        and put right in the same way.
        """
        bed = self.bed
        scene, camera = hypothesis.scene(bed.case, values)
        scene = off_by(bed, replace(scene, adjustable=()), np.random.default_rng((bed.seed, 8, number)))
        shapes = bed.shapes_of(scene)
        rng = np.random.default_rng((bed.seed, 7, number))
        first = self.start_at(int(bed.starts[0]), (0, 0), shapes=shapes)
        xy, v = self.start_at(bed.half, (3, number), camera, shapes=shapes)
        t, jitter = bed.film.t[bed.half :], bed.jitter
        moments = t
        if jitter is not None:
            moments = np.maximum(in_order(t, jitter.size * rng.normal(size=len(t))), t[0])
        offset = float(camera["time_offset"])
        try:
            simulation = Simulation(placed(scene, *first), dt=bed.dt)
            simulation.restart(xy, v, float(t[0]) + offset)
            true = simulation.sample(moments + offset)
        except (InputError, SimulationError) as error:
            raise Failed(str(error)) from None
        seen = np.full(bed.film.xy.shape, np.nan)
        seen[bed.half :] = _shown(true, camera)
        seen[bed.half :] += rng.normal(0.0, bed.film.sigma, true.shape)
        seen[~np.isfinite(bed.film.xy)] = np.nan
        told = bed.film.t if jitter is None else jitter.put_right(bed.film.t, seen, bed.film.sigma)
        return Film(told, seen, bed.film.sigma)


@dataclass(frozen=True)
class Job:
    """A prediction to be made: which film, which hypothesis, which windows; ``weigh``: see ``BedPredictor.weigh``."""

    predictor: BedPredictor
    hypothesis: Hypothesis
    values: np.ndarray
    windows: Sequence[int] | None = None
    members: int | None = None
    first: int = 0
    weigh: bool = False


def predict_all(jobs: Sequence[Job]) -> list[np.ndarray | None]:
    """All predictions (w, m, D), None where a run failed. Compiled loops release the GIL."""

    def one(job: Job) -> np.ndarray | None:
        try:
            if job.weigh:
                return job.predictor.weigh(job.hypothesis, job.values, job.windows)
            return job.predictor(job.hypothesis, job.values, job.windows, job.members, job.first)
        except Failed:
            return None

    if len(jobs) >= 2 * THREADS:
        return list(POOL.map(one, jobs))
    parts: list[Job] = []
    owner: list[int] = []
    for k, job in enumerate(jobs):
        windows = list(range(len(job.predictor.bed.starts)) if job.windows is None else job.windows)
        for piece in np.array_split(windows, min(THREADS, len(windows))):
            parts.append(replace(job, windows=[int(w) for w in piece]))
            owner.append(k)
    found = list(POOL.map(one, parts))
    result: list[np.ndarray | None] = []
    for k in range(len(jobs)):
        mine = [f for f, o in zip(found, owner, strict=True) if o == k]
        good = [f for f in mine if f is not None]
        result.append(np.concatenate(good) if len(good) == len(mine) else None)
    return result
