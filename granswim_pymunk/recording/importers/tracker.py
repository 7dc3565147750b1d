"""Text exports of Tracker (Open Source Physics, physlets.org/tracker): tab or another sign, ``#``, several masses.

The name of the mass stands above the header; with several masses there is ``#multi:``, a row of names and the
columns x, y repeated for each behind one t.
"""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options, single
from .long import frames_by_row
from .source import Source
from .table import MISSING, find_decimal, find_delimiter, numeric, split


def _lines(source: Source) -> list[str]:
    text = source.text or ""
    return [line.lstrip().lstrip("#").rstrip("\r\n") for line in text.splitlines()]


def recognise(source: Source) -> bool:
    """A row of names above a header that begins with t and has x and y."""
    lines = [line for line in source.start[:6] if line.strip()]
    for above, line in pairwise(lines):
        cells = [cell.strip().lower() for cell in re.split(r"[\t,; ]+", line.lstrip("# \t"))]
        names = [cell for cell in re.split(r"[\t,;]+", above.lstrip("#")) if cell.strip()]
        if cells[:1] == ["t"] and {"x", "y"} <= set(cells) and names and not any(map(numeric, names)):
            several = lines[0].lower().lstrip("# ").startswith("multi")
            return several or above.lstrip().startswith("#") or "mass" in above.lower()
    return False


def read(source: Source, options: Options) -> Found:
    """t [s], x and y in the length of Tracker's calibration (m where nothing is said), y up.

    Tracker's t is never a count of frames: with a frame rate each row of a mass is the next frame.
    """
    text = "\n".join(_lines(source))
    lines = text.splitlines()
    head = next(k for k, line in enumerate(lines) if re.match(r"\s*t\b", line) and re.search(r"\bx\b", line))
    delimiter = options.delimiter or find_delimiter(lines[head : head + 100])
    rows = split("\n".join(["" if k < head else line for k, line in enumerate(lines)]), delimiter, source.path)
    header = [cell.strip().lower() for cell in rows.pop(0)[1]]
    decimal = options.decimal or find_decimal([row for _, row in rows], delimiter)
    groups = _groups(header)
    notes: list[str] = []
    names = _group_names(lines[:head], delimiter, len(groups))
    sentinels = {*MISSING, *(text.strip().lower() for text in options.missing)}

    def number(row: list[str], column: int, line: int) -> float:
        cell = row[column].strip() if column < len(row) else ""
        if cell.lower() in sentinels:
            return float("nan")
        if not numeric(cell, decimal):
            what = f"{header[column]} should be a number, got {cell[:60]!r}"
            raise InputError(what, file=source.path, where=f"row {line}")
        return float(cell.replace(",", ".") if decimal == "," else cell)

    clock, body, x, y, at = [], [], [], [], []
    for line, row in rows:
        for name, group in zip(names, groups, strict=True):
            t = number(row, group["t"], line)
            if t != t:
                continue
            clock.append(t)
            body.append(name)
            x.append(number(row, group["x"], line))
            y.append(number(row, group["y"], line))
            at.append(line)
    if not clock:
        raise InputError("is empty: it has no rows", file=source.path)
    xs, ys = single(np.array(x), np.array(y))
    times, counts = np.array(clock), "time"
    if options.fps is not None:
        begins = _begins(times, body, options.fps)
        times, counts = frames_by_row(body, len(body), notes, "t"), "frame"
        times += [begins[name] for name in body]
    return Found(clock=times, counts=counts, body=body, x=xs, y=ys, time="s", rows=at, notes=notes)


def _begins(times: np.ndarray, body: list[str], fps: float) -> dict[str, float]:
    """The frame in which each mass is first seen, counted from the first of all."""
    first = dict(zip(reversed(body), reversed(times.tolist()), strict=True))
    return {name: float(round((t - times.min()) * fps)) for name, t in first.items()}


def _groups(header: list[str]) -> list[dict[str, int]]:
    """The columns t, x, y of each mass; they share the first t, or have their own."""
    groups: list[dict[str, int]] = []
    last_t = header.index("t")
    for k, name in enumerate(header):
        if name == "t":
            last_t = k
        elif name == "x":
            groups.append({"t": last_t, "x": k})
        elif name == "y" and groups and "y" not in groups[-1]:
            groups[-1]["y"] = k
    return [group for group in groups if "y" in group]


def _group_names(above: list[str], delimiter: str, count: int) -> list[str]:
    """Names of the masses from the rows above the header; 1, 2, 3 ... where there are not as many."""
    cut = r"\t+|,|;" if delimiter == " " else re.escape(delimiter)
    cells = [cell.strip() for line in above for cell in re.split(cut, line) if cell.strip()]
    names = [cell.replace(" ", "_") for cell in cells if cell.lower().rstrip(":") != "multi"]
    return names if len(names) == count and len(set(names)) == count else [str(k + 1) for k in range(count)]


IMPORTER = Importer("tracker", "Tracker (Open Source Physics): text export, one mass or several", recognise, read)
