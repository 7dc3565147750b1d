"""Run a scene: pack its bed, simulate, keep the trajectory, draw frames and a video."""

from __future__ import annotations

import dataclasses
import importlib
import json
import logging
import math
import platform
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import h5py
import matplotlib
import numba
import numpy as np
import pymunk
import scipy
from tqdm import tqdm

from . import __version__
from .choices import COLORS, VIDEOS
from .engine import Contacts, Simulation, State, Watch, advise_dt, contact_duration, resume, save_checkpoint, softened
from .engine.watch import OVERLAP
from .errors import InputError, SimulationError, Terminated
from .files import claimed, refuse_links, writing, written_whole
from .limits import MOST_PICTURES, MOST_STATES, MOST_STEPS, check_seed
from .packing import pack, quality
from .render import Painter, Scale, body_force, frame_options
from .run_folder import CHECKPOINT, PICTURES, REPORT, SCENE, TRAJECTORY, Earlier, look, make_room
from .run_folder import VIDEOS as VIDEO_NAMES
from .scene import Scene, Time, read_scene
from .trajectory import TrajectoryWriter, read_trajectory
from .video import write_video

log = logging.getLogger("granswim")

FRAMES = 60  # pictures of a run that does not say how many
VIDEO_FPS = 25.0
CHECKPOINT_EVERY = 20.0  # seconds of the clock on the wall
# steps times bodies between two looks at the keyboard: about a quarter of a second. A fixed number, not a
# measured one: where a run is cut into blocks must not depend on how busy the machine is
BLOCK = {"verlet": 1.2e7, "chipmunk": 2e6, "batch": 4e5, "python": 3e4}


@dataclass(frozen=True)
class RunResult:
    """What a run left behind.

    out : folder;  scene : as it was run, packed;  state : the last one
    trajectory : HDF5 file;  frames : PNG files;  video : GIF or MP4, if any
    reason : "finished", or why it stopped;  diagnostics : what stands in run.json
    """

    out: Path
    scene: Scene
    state: State
    trajectory: Path
    frames: tuple[Path, ...]
    video: Path | None
    reason: str
    diagnostics: dict[str, Any]


def shipped_scenarios() -> dict[str, Path]:
    """Scenes that come with the package, by name."""
    scenarios = importlib.import_module(".scenarios", __package__)
    return {path.stem: path for folder in scenarios.__path__ for path in sorted(Path(folder).glob("*.toml"))}


def find_scene(name: str | Path) -> Path:
    """A path to a scene, or the name of one that comes with the package. Raises InputError."""
    path = Path(name)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError) as error:  # a name that no file can have
        raise InputError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=path) from None
    shipped = shipped_scenarios()
    if path.name == str(name) and path.stem in shipped and path.suffix in ("", ".toml"):
        return shipped[path.stem]
    raise InputError(
        f"no such file; scenes that come with the package: {', '.join(sorted(shipped))}", file=path
    )


def _one_of(known: Sequence[str], given: str, name: str) -> str:
    if given not in known:
        raise InputError(f"{name} should be one of {', '.join(known)}, got {given!r}")
    return given


def _pictures(frames: int | None, fps: float | None, duration: float) -> int:
    """How many pictures there are: so many, or of ``duration`` [s] so many a second. Raises InputError."""
    if frames is None:
        frames = FRAMES if fps is None else round(min(fps * duration, 1e18)) + 1
    if frames < 0 or frames == 1:
        raise InputError(f"should be 0 or at least 2, got {frames}", where="frames")
    if frames > MOST_PICTURES:
        raise InputError(f"would be {frames:.3g} pictures; at most {MOST_PICTURES} can be drawn", where="frames")
    return frames


def _set_up(
    packed: Scene, duration: float, dt: float | None, mode: str, file: Path | None
) -> tuple[Simulation, Scene]:
    """The simulation of a packed scene over ``duration`` [s], and the scene as it is run. Raises InputError."""
    time_of = dataclasses.replace(packed.time, duration=duration)
    if dt is not None:
        time_of = dataclasses.replace(time_of, dt=dt)
    sim = Simulation(dataclasses.replace(packed, time=time_of), mode=mode)
    if duration / sim.dt > MOST_STEPS:
        raise InputError(
            f"is {duration / sim.dt:.2g} steps of {sim.dt:.3g} s; more than {MOST_STEPS:g} cannot be counted",
            file=file, where="time.duration",
        )  # fmt: skip
    if time_of.dt is None and duration > sim.dt:
        # a little less than the automatic step, so that the run ends when it should
        time_of = dataclasses.replace(time_of, dt=duration / math.ceil(duration / sim.dt))
        sim = Simulation(dataclasses.replace(packed, time=time_of), mode=mode)
    if round(duration / sim.dt) < 1:
        raise InputError(f"is shorter than one step of {sim.dt:g} s", file=file, where="time.duration")
    return sim, dataclasses.replace(packed, time=dataclasses.replace(time_of, dt=sim.dt))


def run_scene(
    scene: Scene | str | Path,
    out: str | Path,
    *,
    duration: float | None = None,
    dt: float | None = None,
    mode: str = "verlet",
    frames: int | None = None,
    fps: float | None = None,
    color: str | None = None,
    video: str | None = None,
    seed: int | None = None,
    cache: bool = True,
    quiet: bool = False,
    max_overlap: float | None = None,
    soft: float | None = None,
    overwrite: bool = False,
) -> RunResult:
    """Pack if needed, simulate, and write what came of it into the folder ``out``.

    Written are trajectory.h5 (float64, H5MD layout), frames/frame_NNNNN.png, video.gif or video.mp4,
    scene.toml (the scene as it was run), run.json (versions, seed, scene hash, time spent in each part,
    why it stopped) and, every 20 s, checkpoint.npz, from which ``resume_run`` goes on with the same bits.

    Parameters
    ----------
    scene : a Scene, a TOML file, or the name of a scene that comes with the package
    duration, dt : [s]; left out, those of the scene, and a time step that resolves its fastest law
    mode : "verlet", "chipmunk", "python" or "batch"
    frames : number of pictures, start and end included; 0: none. ``fps``: pictures per simulated second
    color : "speed" or "force";  video : "gif", "mp4" or "none"
    seed : instead of the scene's; it decides how the bed is packed
    soft : contacts so many times softer, for a screening run (see ``engine.softened``); a bed is packed hard
    max_overlap : largest overlap as a part of the smaller radius; left out, 0.02 in a scene with grains. The run
        stops with a SimulationError when two bodies overlap more, a grain leaves the box, energy jumps or a
        number is not finite (see ``engine.Watch``); the last good checkpoint stays
    overwrite : replace a run that lies in ``out``. Otherwise such a folder is refused; files that are not of a
        run are never touched, and nothing is written through links. One program at a time writes to a folder

    What is left out is looked up in the scene's [frames] table. Ctrl-C stops between blocks of steps: what
    was written stays and can be read, and KeyboardInterrupt is raised. Raises InputError before anything
    is written, SimulationError when the run could not go on.
    """
    file = None
    if not isinstance(scene, Scene):
        file = find_scene(scene)
        scene = read_scene(file)
    options = frame_options(scene.frames, file)
    color = _one_of(COLORS, color or options.get("color", "speed"), "color")
    video = _one_of(VIDEOS, video or options.get("video", "gif"), "video")
    if seed is not None:
        scene = dataclasses.replace(scene, seed=check_seed(seed))
    duration = _above_zero(duration if duration is not None else scene.time.duration, "duration", file)
    dt = None if dt is None else _above_zero(dt, "dt", file)
    if frames is not None and fps is not None:
        raise InputError("give frames or fps, not both")
    if frames is None and fps is None:
        frames, fps = options.get("count"), options.get("per_second")
    frames = _pictures(frames, None if fps is None or frames is not None else _above_zero(fps, "fps", file), duration)

    run = _Run(quiet)
    with claimed(out) as folder:
        earlier = look(folder, video, overwrite)
        with run.timed("packing"):
            packed = run.pack(scene, cache)
            if soft is not None:
                packed = softened(packed, soft)
                if max_overlap is None and any(b.role == "grain" for b in packed.bodies):
                    max_overlap = OVERLAP * math.sqrt(soft)
        with run.timed("setting up"):
            sim, scene = _set_up(packed, duration, dt, mode, file)
            total = round(duration / sim.dt)
            look_at = {"top": options.get("top"), "view": options.get("view"), "width": options.get("width", 1200)}
            painter = Painter(scene, color, **look_at)
            plan = _Plan.make(total, frames, scene.time, sim.dt)
        run.describe(scene, sim, total, requested=mode)
        make_room(folder, earlier)
        note = {"total": total, "frames": frames, "color": color, "video": video, "max_overlap": max_overlap,
            "view": {name: options.get(name) for name in ("top", "view", "width")}}  # fmt: skip
        return run.go(_Job(scene, sim, plan, painter, folder, video, note))


def resume_run(out: str | Path, *, quiet: bool = False) -> RunResult:
    """Go on with a run that was stopped, from the checkpoint in its folder.

    States and frames that were written after the checkpoint are computed again; the result is that of a run that
    was never stopped, bit for bit in modes verlet and chipmunk. Raises InputError where the run is finished, or the
    folder has no checkpoint of a run or a damaged one.
    """
    if not Path(out).is_dir():
        raise InputError("no such folder", file=out)
    run = _Run(quiet)
    with claimed(out) as folder:
        refuse_links(folder, [SCENE, REPORT, TRAJECTORY, CHECKPOINT, PICTURES, *VIDEO_NAMES])
        if not (folder / CHECKPOINT).exists() and Earlier.find(folder).reason == "finished":
            raise InputError("the run is finished: there is nothing to go on with", file=folder)
        with run.timed("setting up"):
            sim, _, note = resume(folder / CHECKPOINT)
            note = _checked(note, folder / CHECKPOINT)
            scene = dataclasses.replace(sim.scene, time=dataclasses.replace(sim.scene.time, dt=sim.dt))
            view = {name: value for name, value in note["view"].items() if value is not None}
            painter = Painter(
                scene, note["color"], top=view.get("top"), view=view.get("view"), width=view.get("width", 1200)
            )
            plan = _Plan.make(note["total"], note["frames"], scene.time, sim.dt)
        run.say(f"going on at step {sim.step} of {note['total']}, t = {sim.t:.6g} s")
        run.describe(scene, sim, note["total"], requested=sim.mode)
        return run.go(_Job(scene, sim, plan, painter, folder, note["video"], note), going_on=True)


def _checked(note: dict[str, Any], file: Path) -> dict[str, Any]:
    """What a checkpoint says of its run. Raises InputError where that is not what a run writes."""
    if "total" not in note:
        raise InputError("is not the checkpoint of a run", file=file)

    def whole(value: Any, most: float) -> bool:
        return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= most

    def number(value: Any) -> bool:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

    view, overlap = note.get("view"), note.get("max_overlap")
    good = {
        "total": whole(note["total"], MOST_STEPS),
        "frames": whole(note.get("frames"), MOST_PICTURES),
        "color": isinstance(note.get("color"), str) and note["color"] in COLORS,
        "video": isinstance(note.get("video"), str) and note["video"] in VIDEOS,
        "max_overlap": "max_overlap" in note and (overlap is None or number(overlap) or overlap == math.inf),
        "view": isinstance(view, dict) and {"top", "view", "width"} >= set(view),
    }
    if good["view"]:
        assert isinstance(view, dict)
        box = view.get("view")
        good["view.top"] = view.get("top") is None or number(view["top"])
        good["view.width"] = view.get("width") is None or whole(view["width"], 1e9)
        good["view.view"] = box is None or (isinstance(box, list | tuple) and len(box) == 4 and all(map(number, box)))
    for name, fits in good.items():
        if not fits:
            raise InputError("is not what a run writes: the checkpoint is damaged", file=file, where=name)
    return note


def _above_zero(value: float | None, name: str, file: Path | None) -> float:
    if value is None:
        raise InputError(
            f"needs {name} [s]: in the scene's [time], or as --{name}", file=file, where=f"time.{name}"
        )
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"should be above zero, got {value!r}", file=file, where=name)
    return float(value)


@dataclass(frozen=True)
class _Plan:
    """After which steps a state is stored, and which of those are drawn."""

    stored: tuple[int, ...]
    drawn: frozenset[int]

    @classmethod
    def make(cls, total: int, frames: int, times: Time, dt: float) -> _Plan:
        states = max(frames, total * dt / times.output if times.output else 0)
        if states > MOST_STATES:
            raise InputError(f"would store {states:.3g} states or pictures; at most {MOST_STATES} are", where="frames")
        pictures = np.round(np.linspace(0, total, max(frames, 2))).astype(int).tolist()
        if times.output is None:
            stored = pictures if frames else np.round(np.linspace(0, total, 101)).astype(int).tolist()
        else:
            stride = max(round(times.output / dt), 1)
            stored = [*range(0, total, stride), total]
            # a picture shows a stored state, so that it can be drawn again from the trajectory
            places = np.clip(np.searchsorted(stored, pictures), 0, len(stored) - 1)
            pictures = [stored[k] for k in places]
        return cls(tuple(sorted(set(stored))), frozenset(pictures) if frames else frozenset())


Picture = tuple[Path, int, Scale | None]  # file, number of the state, scale it was drawn with


@dataclass(frozen=True)
class _Job:
    """What is run, drawn and written; ``note``: what a checkpoint keeps of it."""

    scene: Scene
    sim: Simulation
    plan: _Plan
    painter: Painter
    folder: Path
    video: str
    note: dict[str, Any]

    @property
    def trajectory(self) -> Path:
        return self.folder / TRAJECTORY

    def picture(self, number: int) -> Path:
        return self.folder / PICTURES / f"frame_{number:05d}.png"


class _Run:
    """One run: its clock, its progress bars, its interruption."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.spent: dict[str, float] = {}
        self.stopped = self.terminated = False
        self.last_checkpoint: float | None = None
        self.began = time.time()

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.spent[part] = self.spent.get(part, 0.0) + time.perf_counter() - start

    def bar(self, text: str, total: float, **more: Any) -> tqdm:  # type: ignore[type-arg]
        return tqdm(total=total, desc=text, disable=self.quiet or None, dynamic_ncols=True, mininterval=0.2, **more)

    def say(self, text: str) -> None:
        if not self.quiet:
            print(text, flush=True)

    def pack(self, scene: Scene, cache: bool) -> Scene:
        if scene.bed is None or any(b.role == "grain" for b in scene.bodies):
            return scene
        form = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}"
        with self.bar("packing the bed", 1.0, bar_format=form) as bar:

            def show(part: float) -> None:
                bar.update(part - bar.n)

            packed = pack(scene, cache=cache, progress=show)
        found = quality(packed)
        self.say(
            f"bed: {found.grains} grains, packing fraction {found.packing_fraction:.4f}, "
            f"largest overlap {100 * found.overlap:.2g} % of a radius, seed {scene.seed}"
        )
        return packed

    def describe(self, scene: Scene, sim: Simulation, total: int, requested: str) -> None:
        self.say(str(scene))
        note = "" if sim.mode == requested else f" ({requested} was asked for)"
        line = f"  {total} steps of {sim.dt:.3g} s = {total * sim.dt:g} s, mode {sim.mode}{note}"
        contact = contact_duration(scene)
        if contact is not None:
            line += f"; a contact lasts {contact:.2g} s: {contact / sim.dt:.1f} steps"
        self.say(line)
        advised = advise_dt(scene)
        if sim.dt > 1.001 * advised:
            # said even by a quiet run: what follows is not to be trusted
            log.warning(
                "the time step %.3g s is longer than %.3g s, which resolves the fastest law of the scene",
                sim.dt,
                advised,
            )

    # ---- the run ------------------------------------------------------------------------------

    @contextmanager
    def gentle_interrupt(self) -> Iterator[None]:
        """The first Ctrl-C or SIGTERM asks the run to stop after this block; a second one stops at once."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.getsignal(number) or signal.SIG_DFL for number in (signal.SIGINT, signal.SIGTERM)}

        def ask(number: int, frame: FrameType | None) -> None:
            self.stopped = True
            self.terminated = number == signal.SIGTERM
            signal.signal(number, before[signal.Signals(number)])

        for number in before:
            signal.signal(number, ask)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def go(self, job: _Job, going_on: bool = False) -> RunResult:
        """Simulate, draw, write; whatever ends it, what was written stays and is said."""
        reason = "finished"
        failure: Exception | None = None
        made: Path | None = None
        pictures: list[Picture] = []
        with self.gentle_interrupt():
            writer = self.open(job, going_on)
            try:
                with writer:
                    self.recall(job, writer, pictures)
                    self.simulate(job, writer, pictures)
                if self.stopped:
                    reason = "interrupted"
                else:
                    made = self.draw(job, pictures)
            except SimulationError as error:
                last = self.last_checkpoint
                if last is not None:
                    kept = f"; the checkpoint of t = {last:.6g} s is kept in {job.folder / CHECKPOINT}"
                    error = SimulationError(f"{error}{kept}")
                failure, reason = error, f"failed: {error}"
            except (OSError, InputError) as error:  # a disk that takes no more
                failure = self.full(job, error)
                reason = f"failed: {failure}"
        names = tuple(name for name, _, _ in pictures if name.exists())
        diagnostics = self.diagnose(job, reason, names, made)
        try:
            self.report(job.folder, diagnostics)
        except OSError as error:
            failure = failure or self.full(job, error)
        if failure is not None:
            raise failure
        if self.stopped:
            self.say(f"stopped at t = {job.sim.t:.4g} s; {len(names)} frames and the trajectory are in {job.folder}")
            if not job.sim.impulse:
                self.say(f"granswim run --resume {job.folder}  goes on")
            raise Terminated if self.terminated else KeyboardInterrupt
        (job.folder / CHECKPOINT).unlink(missing_ok=True)
        self.say(_summary(job.scene, job.trajectory, job.folder, names, made, self.spent))
        return RunResult(
            job.folder, job.scene, job.sim.state(), job.trajectory, names, made, reason, diagnostics
        )

    def full(self, job: _Job, error: OSError | InputError) -> InputError:
        """What is said of a disk that took no more; the checkpoint is written if there is room for it now."""
        with suppress(OSError, InputError, SimulationError):
            if job.sim.step > 0:
                self.save(job)
        what = str(error) if isinstance(error, InputError) else f"cannot write it: {error.strerror or error}"
        file = None if isinstance(error, InputError) else error.filename or job.folder
        more = "what was written can be read"
        if (job.folder / CHECKPOINT).is_file():
            more += f", granswim run --resume {job.folder} goes on"
        return InputError(f"{what}; {more}", file=file)

    def open(self, job: _Job, going_on: bool) -> TrajectoryWriter:
        """The trajectory to be added to. Raises InputError where the disk has no room for a new one."""
        if going_on:
            return TrajectoryWriter.reopen(job.trajectory, job.sim.step)
        with writing(job.folder):
            # first of all whose files these are: a run that is killed leaves no files that nobody owns
            planned = None if job.video == "none" else job.folder / f"video.{job.video}"
            self.report(job.folder, self.diagnose(job, "running", (), planned))
            _write_text(job.folder / SCENE, job.scene.to_toml())
        return TrajectoryWriter(job.trajectory, job.scene)

    def recall(self, job: _Job, writer: TrajectoryWriter, pictures: list[Picture]) -> None:
        """The states that were stored before: a painter that goes on has seen them, and draws them again.

        So scale, view and paths of all pictures are those of a run that was never stopped.
        """
        if not writer.frames:
            return
        earlier = read_trajectory(job.trajectory)
        force = earlier.more.get("contact_force")
        for frame, step in enumerate(job.plan.stored[: writer.frames]):
            state = earlier.state(frame)
            job.painter.remember(state)
            if step in job.plan.drawn:
                job.painter.fit(state, force=None if force is None else force[frame])
                pictures.append((job.picture(len(pictures)), frame, None))

    def simulate(self, job: _Job, writer: TrajectoryWriter, pictures: list[Picture]) -> None:
        """From the step that the simulation has come to, to the end or to where it is stopped."""
        sim, plan, painter = job.sim, job.plan, job.painter
        total, begun = plan.stored[-1], sim.step
        block = max(round(BLOCK[sim.mode] / max(len(job.scene.bodies), 20)), 1)
        watch = Watch(sim, job.note["max_overlap"])
        saved = time.monotonic()
        form = "{desc}: {percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} steps [{elapsed}<{remaining}{postfix}]"
        with self.bar("simulating", total, unit_scale=True, bar_format=form, initial=begun) as bar:
            for step in plan.stored[writer.frames :]:
                with self.timed("simulation"):
                    while sim.step < step and not self.stopped:
                        size = min(block, step - sim.step)
                        sim.advance(size)
                        bar.update(size)
                        watch.look()
                        if time.monotonic() - saved > CHECKPOINT_EVERY:
                            self.save(job)
                            saved = time.monotonic()
                if sim.step < step:
                    break
                bar.set_postfix_str(f"t = {sim.t:.4g} s", refresh=False)
                with self.timed("trajectory"):
                    state, contacts = _store(writer, sim, job.scene)
                painter.remember(state)
                if step in plan.drawn:
                    with self.timed("frames"):
                        name, scale = job.picture(len(pictures)), None
                        if painter.live:
                            painter.paint(state, contacts)
                            painter.save(name)
                            scale = painter.scale.copy()
                        else:
                            painter.fit(state, contacts)
                        pictures.append((name, writer.frames - 1, scale))
            if sim.step > begun:
                self.save(job)

    def draw(self, job: _Job, pictures: list[Picture]) -> Path | None:
        """What is drawn when all is known: pictures of another scale than the last one's, and the video."""
        with self.timed("frames"):
            self.redraw(job.scene, job.trajectory, job.painter, pictures)
        if job.video == "none" or not pictures or self.stopped:
            return None
        with self.timed("video"):
            return self.video(job.folder / f"video.{job.video}", [name for name, _, _ in pictures])

    @staticmethod
    def report(folder: Path, diagnostics: dict[str, Any]) -> None:
        _write_text(folder / REPORT, json.dumps(diagnostics, indent=1) + "\n")

    def save(self, job: _Job) -> None:
        """A checkpoint; with impulses there is none. Raises InputError where the disk is full."""
        if job.sim.impulse:
            return
        with self.timed("checkpoints"):
            try:
                save_checkpoint(job.sim, job.folder / CHECKPOINT, note=job.note)
            except SimulationError as error:
                raise InputError(str(error)) from None
        self.last_checkpoint = job.sim.t

    def redraw(self, scene: Scene, path: Path, painter: Painter, pictures: list[Picture]) -> None:
        """Draw what was not drawn yet, or before the scale was known: all frames show the same."""
        if not pictures:
            return
        trajectory = read_trajectory(path)
        painter.settle(trajectory.xy)
        last = painter.scale
        if all(scale == last for _, _, scale in pictures):
            return
        painter.restart()
        shown = {frame: (name, scale) for name, frame, scale in pictures}
        with self.bar("drawing", len(pictures)) as bar:
            for frame in range(len(trajectory)):
                if self.stopped:
                    return
                state = trajectory.state(frame)
                painter.remember(state)
                if frame in shown:
                    name, scale = shown[frame]
                    if scale != last:
                        contacts = contacts_of(scene, state) if painter.color == "force" else None
                        painter.paint(state, contacts, grow=False)
                        painter.save(name)
                    bar.update(1)

    def video(self, path: Path, names: list[Path]) -> Path:
        with self.bar(f"writing {path.name}", len(names)) as bar:

            def show(done: int, count: int) -> None:
                bar.update(done - bar.n)

            return write_video(names, path, VIDEO_FPS, show)

    def diagnose(self, job: _Job, reason: str, names: tuple[Path, ...], made: Path | None) -> dict[str, Any]:
        scene, sim = job.scene, job.sim
        return {
            "title": scene.title,
            "scene_hash": scene.identity,
            "seed": scene.seed,
            "stopped": reason,
            "started_at": time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(self.began)),
            "wall_time_s": round(time.time() - self.began, 3),
            "wall_time_of_parts_s": {name: round(value, 3) for name, value in self.spent.items()},
            "mode": sim.mode,
            "dt_s": sim.dt,
            "steps": sim.step,
            "start_s": scene.time.start,
            "end_s": sim.t,
            "contact_duration_s": contact_duration(scene),
            "bodies": len(scene.bodies),
            "engine": sim.diagnostics,
            "files": {
                "trajectory": TRAJECTORY,
                "frames": len(names),
                "video": made.name if made else None,
                "scene": SCENE,
            },
            "versions": {
                "granswim_pymunk": __version__,
                "python": platform.python_version(),
                "pymunk": pymunk.version,
                "chipmunk": pymunk.chipmunk_version,
                "numpy": np.__version__,
                "scipy": scipy.__version__,
                "numba": numba.__version__,
                "h5py": h5py.__version__,
                "matplotlib": matplotlib.__version__,
                "platform": platform.platform(),
            },
        }


def contacts_of(scene: Scene, state: State) -> Contacts:
    """The contacts of a stored state, with their forces."""
    initial = {
        b.id: (*state.xy[k].tolist(), *state.v[k].tolist()) for k, b in enumerate(scene.bodies) if b.mobile
    }
    return Simulation(scene.with_initial(initial)).contacts()


def _store(writer: TrajectoryWriter, sim: Simulation, scene: Scene) -> tuple[State, Contacts]:
    state, contacts = sim.state(), sim.contacts()
    mass = np.array([b.mass if b.mobile else 0.0 for b in scene.bodies])
    kinetic = 0.5 * mass * (state.v**2).sum(axis=1)
    more = {"angle": state.angle, "spin": state.spin, "contact_force": body_force(contacts, len(mass))}
    observables: dict[str, Any] = {"kinetic_energy": kinetic.sum()}
    swimmer = list(scene.swimmer)
    if swimmer:
        observables["swimmer_kinetic_energy"] = kinetic[swimmer].sum()
        observables["swimmer_center"] = (mass[swimmer, None] * state.xy[swimmer]).sum(axis=0) / mass[
            swimmer
        ].sum()
    writer.add(sim.step, state.t, state.xy, state.v, more, observables)
    return state, contacts


def _summary(
    scene: Scene,
    path: Path,
    folder: Path,
    names: tuple[Path, ...],
    made: Path | None,
    spent: dict[str, float],
) -> str:
    lines = []
    trajectory = read_trajectory(path)
    for chain in scene.chains:
        mass = trajectory.mass[list(chain)]
        center = (mass[:, None] * trajectory.xy[:, list(chain)]).sum(axis=1) / mass.sum()
        ahead = trajectory.xy[0, chain[0]] - trajectory.xy[0, chain[-1]]
        ahead = ahead / np.hypot(*ahead)
        # the first half second is the swimmer settling in (contract); a short run has nothing else
        t = trajectory.t - trajectory.t[0]
        since = 0.5 if t[-1] > 0.75 else 0.0
        k = int(np.searchsorted(t, since))
        speed = float((center[-1] - center[k]) @ ahead) / (t[-1] - t[k])
        lines.append(
            f"swimmer: {1e3 * speed:+.2f} mm/s head first, from {t[k]:.2g} s to {t[-1]:.2g} s after the start"
        )
    parts = ", ".join(f"{name} {value:.1f} s" for name, value in spent.items() if value >= 0.05)
    lines.append(f"wall time: {parts}")
    what = [path.name, f"{len(names)} frames", made.name if made else "", "scene.toml", "run.json"]
    lines.append(f"written to {folder}: " + ", ".join(w for w in what if w))
    return "\n".join(lines)


def _write_text(path: Path, text: str) -> None:
    """Beside first, then in place: a reader never sees half of it."""
    with written_whole(path) as stream:
        stream.write(text.encode("utf-8"))


__all__ = ["RunResult", "contacts_of", "find_scene", "resume_run", "run_scene", "shipped_scenarios"]
