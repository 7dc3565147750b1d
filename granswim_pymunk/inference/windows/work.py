"""What the work of a diagnosis of beds is worth in seconds of a core, told from its size."""

from __future__ import annotations

from dataclasses import dataclass

CORES = 2  # idle ones, that a budget is meant for
BODY_STEP = 1.4e-8  # s of a core that a step of one body takes, about
BODY_START = 1e-5  # s of a core that a body's start takes: estimated, drawn, taken apart from its neighbours


@dataclass
class Work:
    """Seconds of a core [s] that what was asked for takes, told from the size of the runs.

    Not measured: a busy machine, or a diagnosis that goes on from kept runs, then gives the same answer, only later.
    """

    seconds: float = 0.0
