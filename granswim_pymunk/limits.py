"""What is read at all: ordinary files, of a stated size, nested to a stated depth.

A recording or a scene may come from anybody. A pipe in the place of a file, an archive that unpacks to a thousand
times its size or a key of a hundred thousand parts are refused before anything waits for them or fills the memory.
"""

from __future__ import annotations

import re
import stat
import warnings
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError

MEGABYTE = 1_000_000
LARGEST_TOML = 20 * MEGABYTE  # about 10 s of reading
LARGEST_TABLE = 1_000 * MEGABYTE  # a CSV
LARGEST_ARRAYS = 1_000 * MEGABYTE  # unpacked numbers of an NPZ
MOST_BODIES = 250_000
MOST_CELLS = LARGEST_ARRAYS // 16  # frames times bodies, two coordinates each
MOST_STEPS = 10**15  # of a run: beyond, a time in floating point no longer tells one step from the next
MOST_STATES = 10**7  # stored by a run, or sampled by one of a sweep
MOST_PICTURES = 100_000  # their names have five digits
MOST_RUNS = 10**6  # of a sweep
MOST_SEED = 2**63 - 1
# sizes and masses between which forces, squares and cubes of them are ordinary floats [m], [kg]
SMALLEST_RADIUS, LARGEST_RADIUS = 1e-12, 1e12
SMALLEST_MASS, LARGEST_MASS = 1e-36, 1e36
DEEPEST = 50  # tables in tables
LONGEST_ID = 200
LONGEST_TITLE = 500

_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff]")
_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'')
_PART = re.compile(r"[\w'-]\s*\.\s*(?=[\w'-])")


def ordinary_file(path: str | Path, largest: int) -> Path:
    """The path, where it is an ordinary file of at most ``largest`` bytes. Raises InputError.

    A missing file raises too, with the system's words.
    """
    path = Path(path)
    try:
        info = path.stat()
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except ValueError:  # a name with a zero byte
        raise InputError("cannot be the name of a file", file=repr(str(path))) from None
    if stat.S_ISDIR(info.st_mode):
        raise InputError("cannot read it: Is a directory", file=path)
    if not stat.S_ISREG(info.st_mode):
        raise InputError("is no ordinary file but a device or a pipe", file=path)
    if info.st_size > largest:
        raise InputError(
            f"has {info.st_size / MEGABYTE:.0f} MB; at most {largest / MEGABYTE:.0f} MB are read", file=path
        )
    return path


def check_keys(text: str, file: Path) -> None:
    """Refuse a TOML text with a key of very many parts, a.a.a. ... = 1: the parser needs their number squared."""
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") <= DEEPEST:
            continue
        for piece in re.split(r"[,=\[\]{}#]", _STRINGS.sub("'", line)):
            if piece.count(".") > DEEPEST and len(_PART.findall(piece)) > DEEPEST:
                raise InputError(f"has a key of more than {DEEPEST} parts", file=file, where=f"line {number}")


def one_title(text: str) -> str:
    """A title as one line that can be printed anywhere: control characters become spaces, the rest is cut off."""
    if len(text) > LONGEST_TITLE:
        text = text[: LONGEST_TITLE - 3] + "..."
    return _CONTROL.sub(" ", text)


def check_id(name: str) -> None:
    """Raise InputError where a body's id is empty, very long, or holds control characters."""
    if _CONTROL.search(name):
        raise InputError(f"id holds a character that cannot be printed: {name[:LONGEST_ID]!r}", where="body")
    if not name or len(name) > LONGEST_ID:
        what = "is empty" if not name else f"has {len(name)} characters, at most {LONGEST_ID}"
        raise InputError(f"id {what}", where="body" + (f" {name[:40]}..." if name else ""))


def check_between(value: float, name: str, unit: str, low: float, high: float, where: str) -> None:
    """Raise InputError where a number is not between the two."""
    if not low <= value <= high:
        raise InputError(f"{name} should lie between {low:g} and {high:g} {unit}, got {value:g}", where=where)


def check_seed(seed: Any, where: str = "seed") -> int:
    """A seed as a whole number that fits into 63 bits. Raises InputError."""
    try:
        whole = not isinstance(seed, bool) and int(seed) == seed and 0 <= seed <= MOST_SEED
    except (TypeError, ValueError, OverflowError):
        whole = False
    if not whole:
        raise InputError(f"should be a whole number from 0 to 2^63 - 1, got {str(seed)[:40]}", where=where)
    return int(seed)


def read_arrays(path: str | Path, names: Collection[str] | None = None) -> dict[str, np.ndarray]:
    """Arrays of an NPZ, all of them or those among ``names`` that it has. Nothing in it is executed.

    Their sizes are looked up in the archive's directory first. Raises InputError where it is no archive of plain
    arrays, or unpacks to more than LARGEST_ARRAYS.
    """
    path = ordinary_file(path, LARGEST_ARRAYS)
    data: dict[str, np.ndarray] = {}
    try:
        # opened here, as numpy does not close what it cannot read
        with path.open("rb") as handle, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy remarks on the headers of damaged files
            loaded: Any = np.load(handle, allow_pickle=False)
            if not isinstance(loaded, np.lib.npyio.NpzFile):
                raise ValueError("it holds a single array")
            with loaded:
                wanted = [name for name in loaded.files if names is None or name in names]
                size = sum(_unpacked(loaded, name) for name in wanted)
                if size > LARGEST_ARRAYS:
                    raise InputError(
                        f"unpacks to {size / MEGABYTE:.0f} MB; at most {LARGEST_ARRAYS / MEGABYTE:.0f} MB are read",
                        file=path,
                    )
                for name in wanted:
                    data[name] = np.asarray(loaded[name])
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read it: {error}", file=path) from None
    except Exception as error:  # damaged headers are parsed as Python: whatever that may raise
        text = " ".join(str(error).split())
        text = text if len(text) <= 80 else text[:77] + "..."
        raise InputError(f"is not an NPZ of plain arrays: {text}", file=path) from None
    return data


def _unpacked(loaded: Any, name: str) -> int:
    """Bytes that a member holds by the archive's directory, or that its header asks for if that is more."""
    inside = name if name in loaded.zip.NameToInfo else f"{name}.npy"
    size = int(loaded.zip.getinfo(inside).file_size)
    with loaded.zip.open(inside) as stream:
        if stream.read(6) != b"\x93NUMPY":
            return size
        stream.read(2)
        stream.seek(0)
        version = np.lib.format.read_magic(stream)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = header(stream)
    count = 1
    for length in shape:
        count *= int(length)
    return max(size, count * dtype.itemsize)
