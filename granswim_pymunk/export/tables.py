"""Tables for pandas and everything else that reads one: a row for each body and frame, in SI."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .base import Exporter, Frames

UNITS = {
    "t": "s", "x": "m", "y": "m", "vx": "m/s", "vy": "m/s", "angle": "rad", "spin": "rad/s", "contact_force": "N",
    "radius": "m", "mass": "kg",
}  # fmt: skip


def table_of(frames: Frames) -> Any:
    """A DataFrame with t, body, x, y, vx, vy, angle ..., role, radius, mass; its ``attrs`` say the units."""
    import pandas as pd

    seen = np.isfinite(frames.xy).any(axis=-1)
    for values in frames.more.values():
        seen = seen | np.isfinite(values)
    frame, body = np.nonzero(seen)
    columns: dict[str, Any] = {
        "t": frames.t[frame],
        "body": np.array(frames.ids, dtype=object)[body],
        "x": frames.xy[frame, body, 0],
        "y": frames.xy[frame, body, 1],
    }
    if frames.v is not None:
        columns |= {"vx": frames.v[frame, body, 0], "vy": frames.v[frame, body, 1]}
    columns |= {name: values[frame, body] for name, values in frames.more.items()}
    columns |= {
        "role": np.array(frames.roles, dtype=object)[body],
        "radius": frames.radius[body],
        "mass": frames.mass[body],
    }
    table = pd.DataFrame(columns)
    table.attrs["units"] = {name: UNITS[name] for name in columns if name in UNITS}
    return table


def write_csv(frames: Frames, path: Path) -> None:
    table_of(frames).to_csv(path, index=False)


def write_parquet(frames: Frames, path: Path) -> None:
    try:
        table_of(frames).to_parquet(path, index=False)
    except ImportError:
        raise InputError("Parquet needs the package pyarrow: pip install 'granswim_pymunk[files]'") from None


CSV = Exporter("csv", ".csv", "table, a row for each body and frame: any program", write_csv)
PARQUET = Exporter("parquet", ".parquet", "the same table for pandas, polars, DuckDB", write_parquet)
