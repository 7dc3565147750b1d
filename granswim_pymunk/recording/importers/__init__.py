"""Formats that ``granswim import`` understands, one file each, and how a file becomes recordings.

``FORMATS`` lists them in the order in which they are asked whether a file is theirs. An importer has a name, a help
text, ``recognise`` and ``read`` (see ``base.py``); a shipped recording's own format makes recordings itself.
"""

from __future__ import annotations

import csv
import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...files import written_whole
from ..backdrop import Shown
from ..folder import FORMATS as VERSIONS
from ..folder import one_line, write_recording
from ..keys import commented
from ..movie import open_film
from ..plausible import check_plausible
from ..recording import Recording
from . import (
    deeplabcut,
    ethovision,
    extxyz,
    gsd,
    h5md,
    kinovea,
    lammps,
    long,
    mocap,
    sleap,
    tracker,
    trackmate,
    trackpy,
    wide,
)
from .base import Found, Importer, Options
from .build import Built, build
from .double_pendulum import import_double_pendulum
from .falling_balls import import_falling_balls
from .look import Look, draw, look, told
from .single_pendulum import import_single_pendulum
from .source import Source
from .templates import TEMPLATES
from .two_disk_spin import import_two_disk_spin

IMPORTERS = tuple(
    module.IMPORTER
    for module in (
        h5md, sleap, gsd, lammps, extxyz, trackmate, deeplabcut, mocap, ethovision, kinovea, tracker, trackpy, long,
        wide,
    )
)  # fmt: skip
TABLE_OPTIONS = tuple(f.name for f in fields(Options))


@dataclass(frozen=True)
class Format:
    """A format by name; ``function`` makes recordings of a path and the options it has."""

    name: str
    help: str
    function: Callable[..., Recording | list[Recording]]
    importer: Importer | None = None

    @property
    def options(self) -> tuple[str, ...]:
        if self.importer is not None or self.name == "auto":
            return TABLE_OPTIONS
        parameters = inspect.signature(self.function).parameters.values()
        return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)


@dataclass(frozen=True)
class Imported:
    """What an import gave: the folder, the format that was found, the recording, a look at it, remarks, the picture."""

    folder: Path
    format: str
    recording: Recording
    look: Look
    notes: tuple[str, ...] = ()
    picture: Path | None = None

    def lines(self) -> list[str]:
        """What was found, in words."""
        said = [
            f"{self.recording.name}: {FORMATS[self.format].help if self.format in FORMATS else self.format}",
            *(f"  {line}" for line in told(self.recording, self.look)),
        ]
        said += [f"  note: {note}" for note in self.notes]
        said += [f"  warning: {warning}" for warning in self.look.warnings]
        return said

    def as_dict(self) -> dict[str, Any]:
        return {
            "folder": str(self.folder), "format": self.format,
            "sampling": self.recording.sampling, "notes": list(self.notes), **self.look.as_dict(),
            "bodies": list(self.recording.ids),
            "picture": None if self.picture is None else str(self.picture),
        }  # fmt: skip


def find_format(source: Source) -> str:
    """The format of a file by looking into it. Raises InputError that says what the file is."""
    if source.path.is_dir():
        raise InputError("is a folder: give the file in it", file=source.path)
    if not source.head:
        raise InputError("is empty", file=source.path)
    for importer in IMPORTERS:
        if importer.recognise(source):
            return importer.name
    raise InputError(source.described(), file=source.path)


def _import(source: str | Path, format: str, options: dict[str, Any]) -> tuple[list[Built], str]:
    chosen = FORMATS[format]
    if chosen.importer is None and format != "auto":
        found = chosen.function(source, **options)
        return [Built(one, ()) for one in ([found] if isinstance(found, Recording) else found)], format
    said = Options(**options)
    opened = Source(source, said)
    name = format
    try:
        name = find_format(opened) if format == "auto" else format
        importer = FORMATS[name].importer
        assert importer is not None
        if not opened.head:
            raise InputError("is a folder: give the file in it" if opened.path.is_dir() else "is empty", file=source)
        shown = importer.read(opened, said)
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, IndexError, ValueError, OverflowError, csv.Error) as error:
        # what HDF5 and other libraries raise for a damaged file
        told = FORMATS[name].help if name != "auto" else "file that is known"
        raise InputError(f"is damaged, or no {told}: {' '.join(str(error).split())[:200]}", file=source) from None
    return [build(shown, said, Path(source))], name


def _checked(source: str | Path, format: str, options: dict[str, Any]) -> tuple[list[Built], str]:
    if format not in FORMATS:
        raise InputError(f"unknown format {format!r}; known: {', '.join(FORMATS)}")
    known = FORMATS[format].options
    for name in options:
        if name not in known:
            raise InputError(f"format {format} has no option {name}; it has: {', '.join(known) or 'none'}")
    if not Path(source).exists():
        raise InputError("no such file", file=source)
    try:
        found, name = _import(source, format, options)
    except InputError as error:
        raise one_line(error) from None
    for built in found:
        try:
            check_plausible(built.recording)
        except InputError as error:
            raise InputError(error.message, file=source, where=error.where) from None
    return found, name


def import_recording(source: str | Path, format: str = "auto", **options: Any) -> list[Recording]:
    """The recordings in a foreign file. Raises InputError; an option the format does not have is one."""
    return [built.recording for built in _checked(source, format, options)[0]]


def import_all(
    source: str | Path, out: str | Path, format: str = "auto", *, picture: bool = True,
    film: str | Path | None = None, **options: Any,
) -> list[Imported]:  # fmt: skip
    """Import, write and look: one recording becomes the folder ``out``, several become folders in it.

    ``recording.toml`` has a remark at each key, ``tracks.png`` shows the tracks. ``film``: what positions in pixels
    were read from; it is kept beside them, and reports draw the simulation over it. Raises InputError.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found, name = _checked(source, format, options)
    said = dict.fromkeys(str(item.message) for item in caught if item.category.__name__ == "SceneWarning")
    single = len(found) == 1
    shown = None if film is None else _film(film, found, options)
    own = FORMATS[name].importer is None  # a shipped recording stays as it is
    done = []
    for built in found:
        folder = out if single else Path(out) / built.recording.name
        notes = (*built.notes, *said)
        done.append(finish(built.recording, folder, name, notes, picture=picture, remarks=not own))
        if shown is not None:
            shown.keep(done[-1].folder)
    return done


def _film(film: str | Path, found: Sequence[Built], options: Mapping[str, Any]) -> Shown:
    """A film and where it lies. Raises InputError where it cannot be read, or the file does not count its pixels."""
    place = found[0].place if len(found) == 1 else None
    if place is None:
        raise InputError(
            "where it lies is known where positions are counted in its pixels, from its upper left corner: "
            "--unit 0.1mm/px --flip-y HEIGHT",
            where="film",
        )
    opened = open_film(film)
    recording = found[0].recording
    rate = options.get("fps") or opened.rate or recording.sampling or 1 / float(np.median(np.diff(recording.t)))
    return Shown(opened, *place, float(rate))


def finish(
    recording: Recording,
    folder: str | Path,
    format: str,
    notes: tuple[str, ...] = (),
    *,
    picture: bool = True,
    remarks: bool = True,
) -> Imported:
    """Write a recording with remarks at its keys, look at it and draw its tracks."""
    folder = write_recording(recording, folder)
    if remarks:
        toml = folder / "recording.toml"
        text = toml.read_text(encoding="utf-8").replace(f'"{VERSIONS[0]}"', f'"{VERSIONS[-1]}"', 1)
        with written_whole(toml) as stream:
            stream.write(commented(text).encode("utf-8"))
    drawn = draw(recording, folder / "tracks.png") if picture else None
    return Imported(folder, format, recording, look(recording), notes, drawn)


def import_to(source: str | Path, out: str | Path, format: str = "auto", **options: Any) -> list[Path]:
    """As ``import_all``, without the pictures; the folders."""
    return [item.folder for item in import_all(source, out, format, picture=False, **options)]


def _through(name: str) -> Callable[..., list[Recording]]:
    def function(source: str | Path, **options: Any) -> list[Recording]:
        return [built.recording for built in _import(source, name, options)[0]]

    return function


FORMATS = {
    "auto": Format("auto", "found by looking into the file", _through("auto")),
    **{i.name: Format(i.name, i.help, _through(i.name), i) for i in IMPORTERS},
    "double_pendulum": Format("double_pendulum", "double_pendulum_200Hz.csv", import_double_pendulum),
    "falling_balls": Format("falling_balls", "ball_drops.csv with balls.txt beside it", import_falling_balls),
    "single_pendulum": Format(
        "single_pendulum", "single_pendulum_200Hz.csv or mounted_arm_1kHz.npz", import_single_pendulum
    ),
    "two_disk_spin": Format("two_disk_spin", "disk_tracks.csv", import_two_disk_spin),
}

__all__ = [
    "FORMATS", "IMPORTERS", "TEMPLATES", "Format", "Found", "Imported", "Importer", "Look", "Options", "draw",
    "find_format", "finish", "import_all", "import_recording", "import_to", "look",
]  # fmt: skip
