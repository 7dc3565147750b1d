"""What the work of a diagnosis of beds is worth in seconds of a core, told from its size."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Work:
    """Seconds of a core [s] that what was asked for takes, told from the size of the runs.

    Not measured: a busy machine, or a diagnosis that goes on from kept runs, then gives the same answer, only later.
    """

    seconds: float = 0.0
