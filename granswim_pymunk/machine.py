"""What the machine gives to this process."""

from __future__ import annotations

import os


def cores() -> int:
    """Cores that this process may use: on a shared machine fewer than there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
