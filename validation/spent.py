"""Seconds of a core that were spent."""

from __future__ import annotations

import resource


def core_seconds(own: bool = False) -> float:
    """Of this process, or of all that were begun by it and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_SELF if own else resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
