"""Spots and tracks of TrackMate (Ershov et al. 2022, doi:10.1038/s41592-022-01507-1): CSV or XML.

The CSV has four header rows (keys, names, short names, units); the XML is the whole model with its spots and edges,
or the simple one of "export tracks to XML".
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from ...errors import InputError
from .base import Found, Importer, Options
from .source import Source
from .table import numeric
from .units import LENGTHS, PIXELS, TIMES

NEEDED = ("TRACK_ID", "POSITION_X", "POSITION_Y")


def recognise(source: Source) -> bool:
    head = "".join(source.start[:20])
    if head.lstrip().startswith("<"):
        return "<TrackMate" in head or ("<Tracks" in head and "<particle" in head)
    return all(key in "".join(source.start[:1]) for key in NEEDED)


def read(source: Source, options: Options) -> Found:
    return _read_xml(source) if "".join(source.start).lstrip().startswith("<") else _read_csv(source)


def _unit(text: str, units: dict[str, float]) -> str | None:
    text = text.strip("() ").lower()
    if units is LENGTHS and text in PIXELS:
        return "px"
    return text if text in units else None


def _read_csv(source: Source) -> Found:
    rows = list(source.rows)
    header = [cell.strip() for cell in rows.pop(0)[1]]
    for key in NEEDED:
        if key not in header:
            raise InputError(f"needs the column {key}", file=source.path)
    at = {name: k for k, name in enumerate(header)}
    units: list[str] = [""] * len(header)
    # names, short names and units stand below the keys, before the first row with numbers
    while rows and not numeric(rows[0][1][at["POSITION_X"]].strip() or "x"):
        units = [cell.strip() for cell in rows.pop(0)[1]]
    spots = []
    for line, row in rows:
        try:
            if row[at["TRACK_ID"]].strip() in ("", "None", "null"):
                continue  # a spot that belongs to no track
            wanted = ("POSITION_X", "POSITION_Y", "POSITION_T", "FRAME", "RADIUS")
            numbers = [float(row[at[key]]) if key in at and row[at[key]].strip() else np.nan for key in wanted]
            spots.append((str(int(float(row[at["TRACK_ID"]]))), line, *numbers))
        except (ValueError, IndexError):
            raise InputError("expected a spot with numbers", file=source.path, where=f"row {line}") from None
    if not spots:
        raise InputError("has no spot that belongs to a track", file=source.path)
    time = units[at["POSITION_T"]] if "POSITION_T" in at else ""
    return _found(spots, units[at["POSITION_X"]], time)


def _found(spots: list[tuple], length: str, time: str) -> Found:
    body, lines, *numbers = (list(column) for column in zip(*spots, strict=True))
    x, y, t, frame, radius = (np.array(values, dtype=float) for values in numbers)
    timed = _unit(time, TIMES) is not None and np.isfinite(t).all()
    sizes: dict[str, float] = {}
    for name in dict.fromkeys(body):
        own = radius[(np.array(body) == name) & np.isfinite(radius)]
        if len(own):
            sizes[name] = float(np.median(own))
    return Found(
        clock=t if timed else frame,
        counts="time" if timed else "frame",
        body=body,
        x=x,
        y=y,
        length=_unit(length, LENGTHS) or "px",
        time=_unit(time, TIMES) if timed else None,
        y_down=True,
        rows=lines,
        radius=sizes,
    )


def _read_xml(source: Source) -> Found:
    try:
        root = ET.parse(source.path).getroot()
    except (ET.ParseError, OSError) as error:
        raise InputError(f"is not XML that can be read: {error}", file=source.path) from None
    try:
        return _simple_xml(root) if root.tag == "Tracks" else _model_xml(root, source)
    except (KeyError, ValueError) as error:
        raise InputError(f"is not a file of TrackMate: {error}", file=source.path) from None


def _simple_xml(root: ET.Element) -> Found:
    interval = float(root.get("frameInterval", "nan"))
    unit = root.get("timeUnits", "")
    spots = []
    for k, particle in enumerate(root.iter("particle")):
        for detection in particle.iter("detection"):
            frame, x, y = (float(detection.attrib[key]) for key in ("t", "x", "y"))
            spots.append((str(k), 0, x, y, interval * frame, frame, np.nan))
    if not spots:
        raise ValueError("it has no tracks")
    found = _found(spots, root.get("spaceUnits", ""), unit)
    found.rows = None
    return found


def _model_xml(root: ET.Element, source: Source) -> Found:
    model = root.find("Model")
    if model is None:
        raise InputError("has no Model", file=source.path)
    spots = {spot.attrib["ID"]: spot for spot in model.iter("Spot")}
    ends = ("SPOT_SOURCE_ID", "SPOT_TARGET_ID")
    tracks = {
        track.attrib["TRACK_ID"]: {edge.attrib[end] for edge in track.iter("Edge") for end in ends}
        for track in model.iter("Track")
    }
    kept = {item.attrib["TRACK_ID"] for item in model.iter("TrackID")}
    wanted = ("POSITION_X", "POSITION_Y", "POSITION_T", "FRAME", "RADIUS")
    rows = [
        (name, 0, *(float(spots[i].get(key, "nan")) for key in wanted))
        for name, members in tracks.items()
        if not kept or name in kept
        for i in sorted(members, key=int)
    ]
    if not rows:
        raise InputError("has no tracks", file=source.path)
    found = _found(rows, model.get("spatialunits", ""), model.get("timeunits", ""))
    found.rows = None
    return found


IMPORTER = Importer("trackmate", "TrackMate: spots CSV with its unit rows, or XML", recognise, read)
