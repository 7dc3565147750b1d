"""Extended XYZ (Bernstein et al., github.com/libAtoms/extxyz): frames with ``Properties=`` and ``Lattice=``.

Read here rather than by a library: grains have species that are no chemical elements.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options
from .source import Source

_PAIR = re.compile(r"""([\w-]+)\s*=\s*(?:"([^"]*)"|'([^']*)'|\{([^}]*)\}|\[([^\]]*)\]|(\S+))""")


def recognise(source: Source) -> bool:
    lines = source.start
    if len(lines) < 3 or not lines[0].strip().isdigit():
        return False
    return source.suffix in (".xyz", ".extxyz") or "properties=" in lines[1].lower() or "lattice=" in lines[1].lower()


def _frames(source: Source) -> Iterator[tuple[int, dict[str, str], list[list[str]]]]:
    lines = (source.text or "").splitlines()
    at = 0
    while at < len(lines):
        if not lines[at].strip():
            at += 1
            continue
        try:
            count = int(lines[at])
        except ValueError:
            raise InputError(
                f"expected a number of atoms, got {lines[at][:60]!r}", file=source.path, where=f"row {at + 1}"
            ) from None
        if at + 2 + count > len(lines):
            raise InputError(f"ends within a frame of {count} atoms", file=source.path, where=f"row {at + 1}")
        pairs = {m[1].lower(): next(v for v in m.groups()[1:] if v is not None) for m in _PAIR.finditer(lines[at + 1])}
        yield at + 3, pairs, [line.split() for line in lines[at + 2 : at + 2 + count]]
        at += 2 + count


def _columns(text: str) -> dict[str, tuple[int, int]]:
    """``species:S:1:pos:R:3`` as name: (first column, how many)."""
    parts = text.split(":")
    found, column = {}, 0
    for name, _, size in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
        found[name.lower()] = (column, int(size))
        column += int(size)
    return found


def read(source: Source, options: Options) -> Found:
    """x, y of the positions (z with ``columns y=z``), time from ``Time=``, ids from a column id, else the row."""
    plane = [{"x": 0, "y": 1, "z": 2}.get(options.column_map().get(key, key), 0) for key in ("x", "y")]
    clock: list[float] = []
    frames: list[float] = []
    body, xs, ys, rows = [], [], [], []
    sizes: dict[str, list[float]] = {"radius": [], "mass": []}
    period, timed = None, True
    for frame, (line, pairs, atoms) in enumerate(_frames(source)):
        try:
            at = _columns(pairs.get("properties", "species:S:1:pos:R:3"))
            start = at["pos"][0]
            name = next((at[n][0] for n in ("id", "tag", "particle", "body", "name") if n in at), None)
            time = pairs.get("time", pairs.get("t"))
            timed &= time is not None
            for k, atom in enumerate(atoms):
                clock.append(float(time) if time is not None else np.nan)
                frames.append(float(frame))
                body.append(str(k) if name is None else atom[name])
                xs.append(float(atom[start + plane[0]]))
                ys.append(float(atom[start + plane[1]]))
                rows.append(line + k)
            for what in ("radius", "mass"):
                column = at.get(what, at.get("masses" if what == "mass" else "radii"))
                if column is not None and frame == 0:
                    sizes[what] = [float(atom[column[0]]) for atom in atoms]
            if "lattice" in pairs and period is None and _periodic(pairs.get("pbc", "T T T")):
                period = float(pairs["lattice"].split()[0])
        except (ValueError, IndexError, KeyError) as error:
            raise InputError(f"a frame cannot be read: {error}", file=source.path, where=f"row {line}") from None
    if not body:
        raise InputError("is empty: it has no frames", file=source.path)
    named = body[: len(sizes["radius"]) or len(sizes["mass"])]
    return Found(
        clock=np.array(clock if timed else frames), counts="time" if timed else "frame", body=body,
        x=np.array(xs), y=np.array(ys), rows=rows, period=period,
        radius=dict(zip(named, sizes["radius"], strict=False)), mass=dict(zip(named, sizes["mass"], strict=False)),
    )  # fmt: skip


def _periodic(text: str) -> bool:
    return text.split()[0].strip('",').upper() in ("T", "TRUE", "1")


IMPORTER = Importer("extxyz", "extended XYZ, as of ASE and OVITO", recognise, read)
