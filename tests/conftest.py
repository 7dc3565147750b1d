"""Settings for all tests: kernels are compiled once per user cache, figures need no screen."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
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


def _keep_to_own_cores() -> None:
    """Each of several workers of pytest-xdist keeps to its share of the cores: threads of two would only take turns."""
    worker, count = os.environ.get("PYTEST_XDIST_WORKER", ""), int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if worker.startswith("gw") and hasattr(os, "sched_setaffinity"):
        mine = sorted(os.sched_getaffinity(0))
        if len(mine) >= count:
            os.sched_setaffinity(0, mine[int(worker[2:]) :: count])


_keep_to_own_cores()


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
