"""Tables of trackpy (Allan et al., doi:10.5281/zenodo.60550): x, y in pixels, frame, particle, mass, size, ecc ...

CSV with and without an index, Excel, Parquet, ``DataFrame.to_hdf`` and the stores of trackpy (one table a frame).
"""

from __future__ import annotations

from ...errors import InputError
from .base import Found, Importer, Options
from .source import Source

LOCATED = ("mass", "size", "ecc", "signal", "raw_mass", "ep")  # what trackpy.locate measures besides x and y


def recognise(source: Source) -> bool:
    columns = set(source.columns)
    return {"x", "y", "frame"} <= columns and ("particle" in columns or len(columns & set(LOCATED)) >= 3)


def read(source: Source, options: Options) -> Found:
    """Positions [px], y from the top. Raises InputError where features are not linked to tracks."""
    table = source.table
    if table is None:
        raise InputError("is not a table of trackpy", file=source.path)
    names = {key: key for key in ("x", "y", "frame", "particle")} | table.mapped(options.column_map())
    if names["particle"] not in table.columns:
        raise InputError(
            "its features are not linked to tracks yet: trackpy.link(features, search_range) adds the column particle",
            file=source.path,
        )
    return Found(
        clock=table.numbers(names.get("t", names["frame"]), required=True),
        counts="time" if "t" in names else "frame",
        body=table.texts(names.get("body", names["particle"])),
        x=table.numbers(names["x"]),
        y=table.numbers(names["y"]),
        angle=table.numbers(names["angle"]) if "angle" in names else None,
        length="px",
        y_down=True,
        rows=table.lines,
    )


IMPORTER = Importer("trackpy", "tracks of trackpy: CSV, to_hdf, PandasHDFStore, Parquet", recognise, read)
