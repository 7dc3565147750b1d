"""Formats that ``granswim import`` understands. An importer makes Recordings of a file; one file each."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from .folder import one_line, write_recording
from .import_falling_balls import import_falling_balls
from .import_single_pendulum import import_single_pendulum
from .import_table import import_long, import_wide
from .import_two_disk_spin import import_two_disk_spin
from .plausible import check_plausible
from .recording import Recording


@dataclass(frozen=True)
class Format:
    """A format by name; its options are the keyword arguments of its function."""

    name: str
    help: str
    function: Callable[..., Recording | list[Recording]]

    @property
    def options(self) -> tuple[str, ...]:
        parameters = inspect.signature(self.function).parameters.values()
        return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)


FORMATS = {
    f.name: f
    for f in (
        Format("long", "plain CSV, one row per body and frame (t,body,x,y[,angle])", import_long),
        Format("wide", "plain CSV, one row per frame (t,x1,y1,x2,y2, or t,x1,x2)", import_wide),
        Format("falling_balls", "ball_drops.csv with balls.txt beside it", import_falling_balls),
        Format(
            "single_pendulum", "single_pendulum_200Hz.csv or mounted_arm_1kHz.npz", import_single_pendulum
        ),
        Format("two_disk_spin", "disk_tracks.csv", import_two_disk_spin),
    )
}


def import_recording(source: str | Path, format: str, **options: Any) -> list[Recording]:
    """The recordings in a foreign file. Raises InputError; an option the format does not have is one."""
    if format not in FORMATS:
        raise InputError(f"unknown format {format!r}; known: {', '.join(FORMATS)}")
    chosen = FORMATS[format]
    for name in options:
        if name not in chosen.options:
            known = ", ".join(chosen.options) or "none"
            raise InputError(f"format {format} has no option {name}; it has: {known}")
    if not Path(source).exists():
        raise InputError("no such file", file=source)
    try:
        found = chosen.function(source, **options)
        recordings = [found] if isinstance(found, Recording) else found
    except InputError as error:
        raise one_line(error) from None
    for recording in recordings:
        try:
            check_plausible(recording)
        except InputError as error:
            raise InputError(error.message, file=source, where=error.where) from None
    return recordings


def import_to(source: str | Path, out: str | Path, format: str, **options: Any) -> list[Path]:
    """Import and write: one recording becomes the folder ``out``, several become folders in it."""
    recordings = import_recording(source, format, **options)
    if len(recordings) == 1:
        return [write_recording(recordings[0], out)]
    return [write_recording(recording, Path(out) / recording.name) for recording in recordings]
