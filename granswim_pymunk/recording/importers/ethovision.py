"""Raw data of EthoVision XT (Noldus): UTF-16 text or a workbook, remarks above, a row of units, ``-`` for missing.

The first row says how many rows are header; its last two are the names and the units.
"""

from __future__ import annotations

import re

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, single
from .source import Source
from .table import Table, find_decimal

_COORDINATE = re.compile(r"([xy])\s+(.+)", re.IGNORECASE)


def recognise(source: Source) -> bool:
    first = source.rows[0][1] if (source.is_workbook or source.start) and source.rows else []
    return len(first) > 1 and "header lines" in first[0].lower() and first[1].strip().isdigit()


def read(source: Source, options: Options) -> Found:
    """X and Y of each point (center, nose ...) as a body; with one point it has the subject's name."""
    rows = source.rows
    count = int(rows[0][1][1])
    head = [row for line, row in rows if line <= count]
    body_rows = [(line, row) for line, row in rows if line > count]
    if len(head) < 2 or not body_rows:
        raise InputError("is empty: it has no rows", file=source.path)
    names, units = ([cell.strip() for cell in row] for row in head[-2:])
    size = len(names)
    cells = [(line, row[:size] + [""] * (size - len(row))) for line, row in body_rows]
    delimiter = "" if source.is_workbook else source.delimiter
    decimal = options.decimal or find_decimal([row for _, row in cells], delimiter)
    columns = dict(zip(names, zip(*(row for _, row in cells), strict=True), strict=False))
    table = Table(source.path, names, columns, [line for line, _ in cells], decimal=decimal, missing=options.missing)
    said = dict(zip(names, units, strict=True))
    points: dict[str, dict[str, str]] = {}
    for name in names:
        if (match := _COORDINATE.fullmatch(name)) is not None:
            points.setdefault(match[2].strip(), {})[match[1].lower()] = name
    points = {name: at for name, at in points.items() if {"x", "y"} <= at.keys()}
    time = next((n for n in ("Recording time", "Trial time", "Time") if n in columns), None)
    if time is None or not points:
        raise InputError(f"has no time or no X and Y; it has: {', '.join(names[:12])}", file=source.path)
    t = table.numbers(time, required=True)
    subject = next((row[1].strip() for row in head if len(row) > 1 and row[0].strip().lower() == "subject name"), "")
    bodies = list(points)
    if len(bodies) == 1:
        bodies = [subject.replace(" ", "_") or bodies[0]]
    xs, ys, body = [], [], []
    for name, at in zip(bodies, points.values(), strict=True):
        x, y = single(table.numbers(at["x"]), table.numbers(at["y"]))
        xs.append(x)
        ys.append(y)
        body += [name] * len(t)
    unit = said[next(iter(points.values()))["x"]]
    return Found(
        clock=np.tile(t, len(points)), counts="time", body=body, x=np.concatenate(xs), y=np.concatenate(ys),
        length=unit or None, time=said[time] or "s", rows=list(table.lines) * len(points),
    )  # fmt: skip


IMPORTER = Importer("ethovision", "EthoVision XT: raw data as text (UTF-16) or workbook", recognise, read)
