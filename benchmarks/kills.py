"""``python -m granswim_pymunk.benchmarks.kills [N] [SEED] [--jobs J ...] [--json FILE]``: nothing is lost by a kill.

Commands are killed (SIGKILL, with all processes they started) at moments drawn over their whole duration, and started
again. A run goes on to the same bits; a sweep to the same table; the source of an export is untouched and its target
whole or absent; a diagnosis into a folder with an earlier verdict leaves that verdict or the new one, and can be
started again. N kills are dealt out over the jobs in turn.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

# as the command line, but with a checkpoint every 0.2 s of the clock instead of every 20
START = (
    "import sys; from granswim_pymunk import run; run.CHECKPOINT_EVERY = 0.2\n"
    "from granswim_pymunk.cli import main; sys.exit(main(sys.argv[1:]))"
)
TWO = """title = "two disks"
[[body]]
id = "left"
role = "free"
radius = 3e-3
mass = 1e-4
initial = [-0.01, 0.0, 0.1, 0.0]
[[body]]
id = "right"
role = "free"
radius = 3e-3
mass = 1e-4
initial = [0.004, 0.003, 0.0, 0.0]
[[law]]
name = "contact_linear"
stiffness = 2.2e3
damping = 1e3
[time]
dt = 1e-6
duration = 1.0
output = 1e-3
"""
PATIENCE = 600.0  # s for a command that is not killed


@dataclass(frozen=True)
class Job:
    """A command, how it is started again, and what must hold.

    prepare : makes what the command needs in an empty folder
    first, again : its words after ``granswim``, of the first start and of that after the kill
    broken : what is wrong right after the kill, given the folder and that of a finished start; empty where nothing is
    differs : the same after the second start
    """

    name: str
    prepare: Callable[[Path], None]
    first: Callable[[Path], list[str]]
    again: Callable[[Path], list[str]]
    broken: Callable[[Path, Path], str]
    differs: Callable[[Path, Path], str]


@dataclass
class Series:
    """What came of it: kills of each job, those that came after its end, and what was lost."""

    kills: dict[str, int] = field(default_factory=dict)
    late: dict[str, int] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)


# ---- what must hold ----------------------------------------------------------------------------


def digest(path: Path) -> str:
    """SHA-256 of a file, empty where there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of numbers in an HDF5 or netCDF file, by name."""
    import h5py

    found: dict[str, np.ndarray] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
            found[name] = item[...]

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return found


def _unlike(one: Path, other: Path, leave: Sequence[str] = ()) -> str:
    """How two such files differ in their bits, empty where they do not."""
    try:
        a, b = _arrays(one), _arrays(other)
    except OSError as error:
        return f"{one.name} cannot be read: {error}"
    for name in sorted(set(a) | set(b)):
        if not any(part in name for part in leave) and (
            name not in a or name not in b or a[name].tobytes() != b[name].tobytes()
        ):
            return f"{one.name}: {name} differs"
    return ""


def _run_broken(place: Path, whole: Path) -> str:
    path = place / "out" / "trajectory.h5"
    if not path.exists():
        return ""
    from granswim_pymunk.errors import InputError
    from granswim_pymunk.trajectory import read_trajectory

    try:
        read_trajectory(path)
    except InputError as error:
        return "" if not (place / "out" / "checkpoint.npz").exists() else f"trajectory: {error}"
    return ""


def _run_differs(place: Path, whole: Path) -> str:
    frames = sorted(p.name for p in (whole / "out" / "frames").iterdir())
    unlike = [n for n in frames if digest(place / "out" / "frames" / n) != digest(whole / "out" / "frames" / n)]
    return _unlike(place / "out" / "trajectory.h5", whole / "out" / "trajectory.h5") or ", ".join(unlike[:3])


def _sweep_broken(place: Path, whole: Path) -> str:
    for path in (place / "out" / "runs").glob("*.nc") if (place / "out").exists() else ():
        try:
            _arrays(path)
        except OSError as error:
            return f"{path.name} is half a file: {error}"
    return ""


def _sweep_differs(place: Path, whole: Path) -> str:
    return _unlike(place / "out" / "table.nc", whole / "out" / "table.nc", leave=("seconds", "wall"))


def _verdict(place: Path) -> dict[str, Any]:
    verdict = json.loads((place / "out" / "verdict.json").read_text(encoding="utf-8"))
    return {key: value for key, value in verdict.items() if key in ("verdict", "mechanisms", "fit")}


def _verdict_broken(place: Path, whole: Path) -> str:
    try:
        return "" if _verdict(place) == _verdict(whole) else "another verdict than the finished one"
    except Exception as error:  # whatever it is, the verdict that was there is lost
        return f"verdict.json: {error}"


def _export_broken(place: Path, whole: Path) -> str:
    if digest(place / "out" / "trajectory.h5") != digest(whole / "out" / "trajectory.h5"):
        return "the trajectory was touched"
    target = place / "run.csv"
    return "" if not target.exists() or digest(target) == digest(whole / "run.csv") else "half a file under its name"


# ---- the jobs ----------------------------------------------------------------------------------


def _scene(place: Path) -> None:
    (place / "two.toml").write_text(TWO, encoding="utf-8")


def _short_scene(place: Path) -> None:
    (place / "two.toml").write_text(TWO.replace("dt = 1e-6", "dt = 1e-5"), encoding="utf-8")


def _finished_run(place: Path) -> None:
    (place / "two.toml").write_text(TWO.replace("output = 1e-3", "output = 2e-5"), encoding="utf-8")
    _finish(["run", "two.toml", "--out", "out", "--frames", "0", "--quiet"], place)


def _fall(place: Path) -> None:
    """A disk that falls with a drag which its scene does not have, filmed with noise."""
    from granswim_pymunk.api import make_recording
    from granswim_pymunk.recording import write_recording

    t = np.arange(80) / 100.0
    k = 1.5  # 1/s
    y = -9.81 * (t / k - (1.0 - np.exp(-k * t)) / k**2)
    noise = np.random.default_rng(5).normal(0.0, 1e-4, (len(t), 2))
    xy = np.stack([0.2 * (1.0 - np.exp(-k * t)) / k, y], axis=1) + noise
    write_recording(
        make_recording(t, xy, radius=5e-3, mass=1e-2, gravity=9.81, position_noise=1e-4, names="ball", name="fall"),
        place / "fall",
    )


def _fall_known(place: Path) -> None:
    _fall(place)
    _finish(_diagnose("fall")(place), place)


def _small_bed(place: Path) -> None:
    from granswim_pymunk.proof.conceal import conceal

    case = conceal(7, place / "cases", b"kills", place / "truth", kind="small-bed")
    shutil.move(case, place / "bed")
    _finish(_diagnose("bed")(place), place)


def _diagnose(name: str) -> Callable[[Path], list[str]]:
    return lambda place: ["diagnose", name, "--out", "out", "--quiet", "--seed", "3"]


def _run(place: Path) -> list[str]:
    return ["run", "two.toml", "--out", "out", "--frames", "12", "--video", "none", "--quiet"]


def _resume(place: Path) -> list[str]:
    if (place / "out" / "checkpoint.npz").exists():
        return ["run", "--resume", "out", "--quiet"]
    return [*_run(place), "--overwrite"]


def _sweep(place: Path) -> list[str]:
    vary = ["--vary", "contact_linear.stiffness=1000,1500,2000,2500,3000,3500"]
    return ["sweep", "two.toml", *vary, "--out", "out", "--processes", "2", "--quiet"]


def _export(place: Path) -> list[str]:
    return ["export", "out", "--to", "csv", "--out", "run.csv", "--quiet"]


JOBS = (
    Job("run", _scene, _run, _resume, _run_broken, _run_differs),
    Job("sweep", _short_scene, _sweep, _sweep, _sweep_broken, _sweep_differs),
    Job("export", _finished_run, _export, _export, _export_broken,
        lambda place, whole: "" if digest(place / "run.csv") == digest(whole / "run.csv") else "another file"),
    Job("diagnose", _fall_known, _diagnose("fall"), _diagnose("fall"), _verdict_broken, _verdict_broken),
    Job("diagnose a small bed", _small_bed, _diagnose("bed"), _diagnose("bed"), _verdict_broken, _verdict_broken),
)  # fmt: skip


# ---- kills -------------------------------------------------------------------------------------


def _start(words: Sequence[str], place: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", START, *words], cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def _finish(words: Sequence[str], place: Path) -> float:
    """Run a command to its end; the seconds that it took. Raises RuntimeError where it fails."""
    begin = time.monotonic()
    with _start(words, place) as program:
        said = program.communicate(timeout=PATIENCE)[1]
    if program.returncode:
        raise RuntimeError(f"granswim {' '.join(words)}: exit code {program.returncode}: {said.strip()[-300:]}")
    return time.monotonic() - begin


def kill_after(words: Sequence[str], place: Path, seconds: float) -> bool:
    """Start a command and kill it with its children after so long; whether it was still at work."""
    with _start(words, place) as program:
        with contextlib.suppress(subprocess.TimeoutExpired):
            program.communicate(timeout=seconds)
            return False
        os.killpg(program.pid, signal.SIGKILL)
        program.communicate()
    return True


def one_kill(
    job: Job, ready: Path, whole: Path, place: Path, seconds: float, start_again: bool = True
) -> tuple[bool, str]:
    """Whether the kill came before the end, and what was lost by it (empty: nothing)."""
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(ready, place)
    killed = kill_after(job.first(place), place, seconds)
    wrong = job.broken(place, whole)
    if not wrong and start_again:
        try:
            if killed:
                _finish(job.again(place), place)
            wrong = job.differs(place, whole)
        except RuntimeError as error:
            wrong = f"cannot be started again: {error}"
    return killed, wrong


def kills(count: int, folder: str | Path, seed: int = 0, jobs: Sequence[Job] = JOBS, show: bool = False) -> Series:
    """Kill ``count`` commands, the jobs in turn, below this folder."""
    series, spent = Series(), {}
    folder = Path(folder)
    for job in jobs[:count]:
        ready, whole = folder / f"{job.name}-ready", folder / f"{job.name}-whole"
        ready.mkdir(parents=True)
        job.prepare(ready)
        shutil.copytree(ready, whole)
        _finish(job.first(whole), whole)  # the first one may compile
        shutil.rmtree(whole)
        shutil.copytree(ready, whole)
        spent[job.name] = _finish(job.first(whole), whole)
    for case in range(count):
        job = jobs[case % len(jobs)]
        seconds = float(np.random.default_rng([seed, case]).uniform(0.05, 1.0)) * spent[job.name]
        # a bed takes a minute each time: the start after the kill is tried for one in five
        again = "bed" not in job.name or case // len(jobs) % 5 == 0
        killed, wrong = one_kill(
            job, folder / f"{job.name}-ready", folder / f"{job.name}-whole", folder / "case", seconds, again
        )
        series.kills[job.name] = series.kills.get(job.name, 0) + 1
        series.late[job.name] = series.late.get(job.name, 0) + (not killed)
        if wrong:
            series.lost.append(f"case {case}, {job.name} after {seconds:.2f} s: {wrong}")
        if show:
            when = f"{seconds:.2f} of {spent[job.name]:.2f} s"
            print(f"case {case}, {job.name}: killed after {when}: {wrong or 'nothing lost'}", flush=True)
    return series


def main(argv: Sequence[str] | None = None) -> int:
    how = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="kills", description=__doc__, formatter_class=how)
    parser.add_argument("count", type=int, nargs="?", default=100)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--jobs", nargs="+", choices=[job.name for job in JOBS], default=[job.name for job in JOBS])
    parser.add_argument("--json", type=Path, metavar="FILE")
    args = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as own:
        series = kills(args.count, own, args.seed, [job for job in JOBS if job.name in args.jobs], show=True)
    for name, count in series.kills.items():
        print(f"{name}: {count} killed, {series.late[name]} of them after its end")
    print(f"lost: {len(series.lost)}", *series.lost, sep="\n")
    if args.json:
        args.json.write_text(json.dumps(asdict(series), indent=1) + "\n", encoding="utf-8")
    return bool(series.lost)


if __name__ == "__main__":
    sys.exit(main())
