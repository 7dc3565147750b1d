"""Trajectories of Kinovea as text: ``#Kinovea Trajectory data export``, ``#T X Y``, one block a trajectory.

Older versions write a time code h:mm:ss:hundredths, newer ones numbers. (Its CSV is an ordinary wide table.)
"""

from __future__ import annotations

import re

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, single
from .source import Source

_CODE = re.compile(r"(?:(\d+):)?(\d+):(\d+):(\d+)")


def recognise(source: Source) -> bool:
    return any("kinovea trajectory" in line.lower() for line in source.start[:3])


def read(source: Source, options: Options) -> Found:
    """Time [s] (numbers with steps above 1 are milliseconds), x and y in the unit that was calibrated, y up."""
    blocks: list[list[tuple[int, float, float, float]]] = [[]]
    names: list[str | None] = [None]
    coded = False
    for line, text in enumerate((source.text or "").splitlines(), start=1):
        text = text.strip()
        if text.startswith("#") or not text:
            if blocks[-1]:
                blocks.append([])
                names.append(None)
            if text.startswith("#") and line > 2:
                names[-1] = text.lstrip("# ").replace(" ", "_") or None
            continue
        cells = text.split()
        if len(cells) != 3:
            raise InputError(f"expected a time, x and y, got {text[:60]!r}", file=source.path, where=f"row {line}")
        try:
            match = _CODE.fullmatch(cells[0])
            coded |= match is not None
            t = _seconds(match) if match else _number(cells[0])
            blocks[-1].append((line, t, _number(cells[1]), _number(cells[2])))
        except ValueError:
            raise InputError("should hold numbers", file=source.path, where=f"row {line}") from None
    kept = [(name, block) for name, block in zip(names, blocks, strict=True) if block]
    if not kept:
        raise InputError("is empty: it has no rows", file=source.path)
    clock, body, x, y, at = [], [], [], [], []
    for k, (name, block) in enumerate(kept):
        for frame, (line, t, one, two) in enumerate(block):
            clock.append(float(frame) if coded and options.fps is not None else t)
            body.append(name or str(k + 1))
            x.append(one)
            y.append(two)
            at.append(line)
    xs, ys = single(np.array(x), np.array(y))
    notes = []
    times = np.array(clock)
    time, counts = "s", "time"
    if coded and options.fps is not None:
        counts = "frame"
    elif coded:
        notes.append("its time code has hundredths of a second only: --fps gives exact times")
    elif len(times) > 1 and np.median(np.diff(times)) > 1:
        time = "ms"
        notes.append("times are taken to be in ms, as they step by more than 1: --time-unit says otherwise")
    return Found(clock=times, counts=counts, body=body, x=xs, y=ys, time=time, rows=at, notes=notes)


def _number(cell: str) -> float:
    return float(cell.replace(",", "."))


def _seconds(match: re.Match[str]) -> float:
    hours, minutes, seconds, hundredths = (int(part or 0) for part in match.groups())
    return 3600 * hours + 60 * minutes + seconds + hundredths / 100


IMPORTER = Importer("kinovea", "Kinovea: text export of trajectories", recognise, read)
