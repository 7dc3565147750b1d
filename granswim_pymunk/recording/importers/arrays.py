"""Files of named arrays as a table: MATLAB, NumPy, HDF5, netCDF-4 and JSON, where their names say what they are.

One row a frame. ``t`` (T,), ``x`` and ``y`` (T,) or (T, n), or ``xy`` (T, n, 2), as a person saves them, become the
columns t, x1, y1, x2, y2 ...; of MATLAB's structures and JSON's objects the first that holds such arrays is taken.
Nothing in a file is executed: objects of Python are refused.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...limits import LARGEST_ARRAYS, MEGABYTE, ordinary_file, read_arrays
from .headings import find_columns, is_clock, words

if TYPE_CHECKING:
    import pandas as pd

NUMPY, MATLAB, MATLAB_73 = b"\x93NUMPY", b"MATLAB 5.0", b"MATLAB 7.3"
RATE = ("fps", "frame rate", "framerate", "frames per second")
PLACES = ("xy", "pos", "position", "positions", "trajectories", "trajectory", "tracks", "r", "xyz", "coordinates")
DEEPEST = 4  # structures in structures


def frame_of(data: Mapping[str, Any]) -> pd.DataFrame | None:
    """The arrays of one frame each as a table; None where there is no place in them."""
    import pandas as pd

    arrays = {name: np.squeeze(np.asarray(value)) for name, value in data.items() if _plain(value)}
    scalars = {name: float(a) for name, a in arrays.items() if a.ndim == 0 and a.dtype.kind in "iuf"}
    arrays = {name: a for name, a in arrays.items() if a.ndim}
    if not arrays:
        return None
    clock = next((name for name, a in arrays.items() if a.ndim == 1 and is_clock(name)), None)
    counts = Counter(a.shape[0] for a in arrays.values())
    frames = len(arrays[clock]) if clock is not None else counts.most_common(1)[0][0]
    columns: dict[str, Any] = {}
    for name, a in arrays.items():
        if a.shape[0] != frames and a.ndim > 1 and a.shape[1] == frames:
            a = np.swapaxes(a, 0, 1)  # a row for each body
        if a.shape[0] != frames:
            continue
        if a.dtype.kind == "f":
            a = np.where(np.isfinite(a), a, math.nan)  # TRex writes infinite places where it does not see
        place = " ".join(words(name)) in PLACES or len(arrays) - (clock is not None) == 1
        if a.ndim == 1:
            columns[name] = a
        elif a.ndim == 2 and place and a.shape[1] in (2, 3) and (clock is not None or name.lower() in PLACES):
            columns |= {axis: a[:, k] for k, axis in enumerate("xy")}
        elif a.ndim == 2 and len(arrays) == 1:
            columns |= {str(k + 1): a[:, k] for k in range(a.shape[1])}
        elif a.ndim == 2:
            columns |= {f"{name}{k + 1}": a[:, k] for k in range(a.shape[1])}
        elif a.ndim == 3 and place and a.shape[2] in (2, 3):
            columns |= {f"{axis}{b + 1}": a[:, b, k] for b in range(a.shape[1]) for k, axis in enumerate("xy")}
    rates = [value for name, value in scalars.items() if name.lower().replace("_", " ") in RATE and value > 0]
    if clock is None and rates and columns:
        columns = {"t": np.arange(frames) / rates[0], **columns}
    return pd.DataFrame(columns) if columns else None


def _plain(value: Any) -> bool:
    """Whether it is a number or an array of numbers, or of texts."""
    try:
        kind = np.asarray(value).dtype.kind
    except (ValueError, TypeError):  # lists of unlike lengths
        return False
    return kind in "biufU"


def _first(data: Mapping[str, Any], depth: int = 0) -> pd.DataFrame | None:
    """The table of the first structure that holds places, the outermost first."""
    own = frame_of(data)
    if own is not None and _has_places(own):
        return own
    if depth < DEEPEST:
        for value in data.values():
            inner = _first(value, depth + 1) if isinstance(value, Mapping) else _records(value)
            if inner is not None and _has_places(inner):
                return inner
    # columns without known names may be said by --columns
    return own if depth == 0 and own is not None and len(own.columns) > 1 else None


def _has_places(frame: pd.DataFrame) -> bool:
    try:
        found = find_columns([str(c) for c in frame.columns], {})
    except InputError:  # several runs
        return True
    return any(key in found for key in ("x", "y", "angle")) or {"x1", "y1", "1"} & set(frame.columns) != set()


def _records(value: Any) -> pd.DataFrame | None:
    """A list of objects with the same keys, a row each."""
    import pandas as pd

    if not isinstance(value, list) or not value or not all(isinstance(row, Mapping) for row in value):
        return None
    if any(isinstance(cell, list | Mapping) for row in value for cell in row.values()):
        return None
    return pd.DataFrame.from_records(value)


def table_of(path: Path, head: bytes) -> pd.DataFrame | None:
    """The table of a file of arrays; None of other files, and where nothing in it is a place. Raises InputError."""
    if head.startswith(NUMPY):
        return frame_of({"array": _numpy(path)})
    if is_npz(path, head):
        return _first(read_arrays(path))
    if head.startswith(MATLAB):
        return _first(_matlab(path))
    if head.startswith(MATLAB_73) or head.startswith(b"\x89HDF\r\n\x1a\n"):
        return _first(_hdf5(path, matlab=head.startswith(MATLAB_73)))
    if is_json(head):
        return _json(path)
    return None


def is_npz(path: Path, head: bytes) -> bool:
    return head.startswith(b"PK\x03\x04") and (path.suffix.lower() == ".npz" or b".npy" in head[:300])


def is_json(head: bytes) -> bool:
    """Whether a text begins as an object or a list of JSON."""
    start = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if start[:1] == b"{":
        return start[1:].lstrip()[:1] in (b'"', b"}")
    return start[:1] == b"[" and start[1:].lstrip()[:1] in (b"{", b"[")


def _numpy(path: Path) -> np.ndarray:
    try:
        with ordinary_file(path, LARGEST_ARRAYS).open("rb") as handle:
            found: np.ndarray = np.load(handle, allow_pickle=False)
    except Exception as error:
        if "allow_pickle" in str(error):
            raise InputError(
                "holds Python objects (a pickle), which may run any code when they are opened, and is not opened: "
                "save plain arrays, as numpy.savez('tracks.npz', t=t, xy=xy)",
                file=path,
            ) from None
        raise InputError(f"is not a NumPy array that can be read: {_brief(error)}", file=path) from None
    return found


def _brief(error: Exception) -> str:
    return " ".join(str(error).split())[:80]


def _matlab(path: Path) -> dict[str, Any]:
    """Variables of a MAT-file up to version 7, structures as dictionaries."""
    from scipy.io import loadmat, whosmat

    try:
        sizes = [(name, math.prod(shape)) for name, shape, _ in whosmat(path)]
        if 8 * sum(size for _, size in sizes) > LARGEST_ARRAYS:
            raise InputError(f"unpacks to more than {LARGEST_ARRAYS / MEGABYTE:.0f} MB", file=path)
        data = loadmat(path, simplify_cells=True)
    except InputError:
        raise
    except Exception as error:  # damaged files raise whatever their bytes lead to
        raise InputError(f"is not a MATLAB file that can be read: {_brief(error)}", file=path) from None
    return {name: value for name, value in data.items() if not name.startswith("__")}


def _hdf5(path: Path, *, matlab: bool) -> dict[str, Any]:
    """Datasets and numbers among the attributes of an HDF5 file, groups as dictionaries.

    MATLAB 7.3 counts the axes the other way round.
    """
    import h5py

    left = LARGEST_ARRAYS

    def read(group: Any, depth: int) -> dict[str, Any]:
        nonlocal left
        found: dict[str, Any] = {
            str(name): value for name, value in group.attrs.items() if np.ndim(value) == 0 and _plain(value)
        }
        for name, item in group.items():
            if isinstance(item, h5py.Group) and depth < DEEPEST and not str(name).startswith("#"):
                found[str(name)] = read(item, depth + 1)
            elif isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf":
                left -= item.size * item.dtype.itemsize
                if left < 0:
                    raise InputError(f"holds more than {LARGEST_ARRAYS / MEGABYTE:.0f} MB of numbers", file=path)
                found[str(name)] = np.transpose(item[...]) if matlab else item[...]
        return found

    try:
        with h5py.File(path, "r") as file:
            return read(file, 0)
    except (OSError, RuntimeError, KeyError) as error:
        raise InputError(f"is not an HDF5 file that can be read: {error}", file=path) from None


def _json(path: Path) -> pd.DataFrame | None:
    """Of a list of rows, of lists by name, or of one object in each line."""
    try:
        text = path.read_text(encoding="utf-8-sig")
        try:
            data = json.loads(text)
        except ValueError:
            data = [json.loads(line) for line in text.splitlines() if line.strip()]
    except (UnicodeDecodeError, ValueError) as error:
        raise InputError(f"is not JSON that can be read: {error}", file=path) from None
    except RecursionError:
        raise InputError("is not JSON that can be read: it is nested too deeply", file=path) from None
    if isinstance(data, list):
        rows = _records(data)
        return rows if rows is not None or not _plain(data) else frame_of({"array": data})
    return _first(data) if isinstance(data, Mapping) else None


def held(path: Path, head: bytes) -> str:
    """What a file of arrays holds, in a few words, for a message."""
    try:
        if head.startswith(NUMPY):
            return f"an array of shape {_numpy(path).shape}"
        if is_npz(path, head):
            names = list(read_arrays(path))
        elif head.startswith(MATLAB):
            names = list(_matlab(path))
        elif is_json(head):
            data = json.loads(path.read_text(encoding="utf-8-sig"))
            names = list(data) if isinstance(data, dict) else ["a list"]
        else:
            names = list(_hdf5(path, matlab=True))
    except ValueError:
        names = []
    return ", ".join(map(str, names))[:200] or "nothing"
