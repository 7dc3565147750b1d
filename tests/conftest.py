"""Settings for all tests: kernels are compiled once per user cache, figures need no screen."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from granswim_pymunk.inference import Diagnosis

# many small matrices: threads of the linear algebra library would only wait for each other
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")


# of the workers of pytest-xdist this is the one with this number
WORKER = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))


def _keep_to_own_cores() -> None:
    """Each of several workers of pytest-xdist keeps to its share of the cores: threads of two would only take turns."""
    if WORKER and hasattr(os, "sched_setaffinity"):
        mine = sorted(os.sched_getaffinity(0))
        if len(mine) >= WORKERS:
            os.sched_setaffinity(0, mine[int(WORKER) :: WORKERS])


_keep_to_own_cores()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--part", metavar="K/N", help="only the K-th of N parts of what is selected, each about as long")


@pytest.hookimpl(trylast=True)  # after -m and -k
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Every N-th test, from the K-th on: neighbours in a file take about as long, and land in different parts."""
    part = config.getoption("--part")
    if part is None:
        return
    try:
        k, n = (int(number) for number in part.split("/"))
    except ValueError:
        k, n = 0, 0
    if not 1 <= k <= n:
        raise pytest.UsageError(f"--part {part}: should be K/N with 1 <= K <= N, as in 1/8")
    chosen = items[k - 1 :: n]
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    items[:] = chosen


@pytest.fixture(scope="session", autouse=True)
def laws_shared_out() -> None:
    """Each of several workers begins with laws of its own and finds the others' compiled when it comes to them.

    All need all of them sooner or later; on a new machine, where they begin alike, each would compile the same ones.
    Every second one packs a bed first, while the others compile what laws have in common.
    """
    if not WORKER:
        return
    from granswim_pymunk.engine.callbacks import kernel_for
    from granswim_pymunk.engine.native import ProbeError, offsets
    from granswim_pymunk.errors import InputError
    from granswim_pymunk.laws import all_laws
    from granswim_pymunk.packing import pack
    from granswim_pymunk.scene import read_scene

    if int(WORKER) % 2:
        pack(read_scene(Path(__file__).parent.parent / "scenarios" / "pocket_swim.toml"))
    try:
        kernel = kernel_for(offsets())
    except ProbeError:
        return
    own = "granswim_pymunk."
    forces = [law for law in all_laws().values() if law.kind in ("pair", "body", "chain", "constraint", "joint")]
    for law in [law for law in forces if law.function.__module__.startswith(own)][int(WORKER) :: WORKERS]:
        with suppress(InputError):
            kernel.block(law)


@pytest.fixture(scope="session")
def bed_with_another_held_out() -> Diagnosis:
    """Of a small bed whose grains are seen, with a weak joint, and a whole recording held out."""
    from granswim_pymunk.inference.windows import diagnose_bed
    from granswim_pymunk.inference.windows.plan import Plan
    from granswim_pymunk.recording import read_recording

    recording = read_recording(Path(__file__).parent / "data" / "small_joint")
    other = replace(recording, name="other")
    return diagnose_bed([recording], [other], candidates=["weak_joint"], plan=Plan(1, 1, 4, 8, 2))


@contextmanager
def no_simulation() -> Iterator[None]:
    """In here whoever builds, begins or goes on with a simulation fails."""
    from granswim_pymunk.engine import Simulation

    def refuse(*args: object, **kwargs: object) -> None:
        raise AssertionError("something was simulated")

    with pytest.MonkeyPatch.context() as patch:
        for name in ("__init__", "restart", "retune", "sample", "advance", "forces"):
            patch.setattr(Simulation, name, refuse)
        yield
