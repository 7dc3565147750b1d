"""A file that is to be imported, looked into as far as somebody asks: bytes, text, table, HDF5, DataFrame."""

from __future__ import annotations

import contextlib
import re
import warnings
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...limits import LARGEST_TABLE, ordinary_file
from .arrays import MATLAB, MATLAB_73, NUMPY, held, is_json, is_npz, table_of
from .base import Options, extra_needed
from .headings import is_clock, is_rate
from .table import Table, find_delimiter, headed, plain_numbers, split, table_from_frame, table_from_rows, unquoted

HEAD = 65536  # bytes that decide what a file is
LISTED = 12  # columns of a table that a message names
SIGNATURES = (
    (b"\x89PNG", "a PNG picture"), (b"\xff\xd8\xff", "a JPEG picture"), (b"GIF8", "a GIF"), (b"%PDF", "a PDF"),
    (b"II*\x00", "a TIFF picture"), (b"MM\x00*", "a TIFF picture"), (b"\x1aE\xdf\xa3", "a film (Matroska)"),
    (b"\x1f\x8b", "compressed (gzip): unpack it first"), (b"BZh", "compressed (bzip2): unpack it first"),
    (b"7z\xbc\xaf", "compressed (7z): unpack it first"), (b"SQLite format 3", "an SQLite database"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook (.xls): save it as .xlsx"),
    (b"CDF", "an old netCDF file: write it as netCDF-4"),
)
PICKLE = re.compile(rb"\x80[\x02-\x05].|\(dp\d|\(lp\d|c(?:os|pandas|numpy|__builtin__|builtins)[\w.]*\n", re.DOTALL)


class Source:
    """A file and what the user said about it. What cannot be read is None; ``head`` is always there."""

    def __init__(self, path: str | Path, options: Options) -> None:
        self.path = Path(path)
        self.options = options
        if self.path.is_dir():
            self.head = b""  # named formats take a folder
            return
        try:
            with ordinary_file(self.path, LARGEST_TABLE).open("rb") as handle:
                self.head = handle.read(HEAD)
        except OSError as error:
            raise InputError(f"cannot read it: {error.strerror}", file=path) from None

    @property
    def suffix(self) -> str:
        return self.path.suffix.lower()

    # ---- texts ----------------------------------------------------------------------------------

    @cached_property
    def encoding(self) -> str | None:
        """Of a text; None where the file is none."""
        if self.options.encoding:
            return self.options.encoding
        if self.head[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
        if self.head[:3] == b"\xef\xbb\xbf":
            return "utf-8-sig"
        sample = self.head[:4096]
        if b"\x00" in sample:
            # UTF-16 without its mark: every other byte of western text is zero
            for start, name in ((1, "utf-16-le"), (0, "utf-16-be")):
                half = sample[start::2]
                if half and half.count(0) > 0.9 * len(half) and sample[1 - start :: 2].count(0) == 0:
                    return name
            return None
        try:
            self.head.decode("utf-8")
            return "utf-8"
        except UnicodeDecodeError as error:
            if error.start > len(self.head) - 4 and len(self.head) == HEAD:
                return "utf-8"  # cut in the middle of a letter
        controls = sum(byte < 9 or 13 < byte < 32 for byte in sample)
        return None if controls > 0.01 * len(sample) else "cp1252"

    @cached_property
    def text(self) -> str | None:
        """The file as text, without the lines to be skipped; None where it is none."""
        if self.encoding is None or not self.head:
            return None
        try:
            text = self.path.read_bytes().decode(self.encoding)
        except (UnicodeDecodeError, LookupError) as error:
            if self.options.encoding is None and isinstance(error, UnicodeDecodeError):
                text = self.path.read_bytes().decode("cp1252", errors="replace")
            else:
                raise InputError(f"is not a text in {self.encoding}: {error}", file=self.path) from None
        skipped = self.options.skip_rows or 0
        if skipped < 0:
            raise InputError(f"should be zero or more, got {skipped}", where="skip rows")
        if skipped:
            # empty lines in their place keep the row numbers of the file
            lines = text.splitlines()
            if skipped >= len(lines):
                raise InputError(f"has {len(lines)} lines, none after {skipped}", file=self.path, where="skip rows")
            text = "\n" * skipped + "\n".join(lines[skipped:])
        if '"' in text[:HEAD]:
            lines = text.splitlines()
            bare = unquoted(lines)
            text = text if bare is lines else "\n".join(bare)
        return plain_numbers(text)

    @cached_property
    def start(self) -> list[str]:
        """The first lines of a text, none of what is no text."""
        if self.encoding is None:
            return []
        with contextlib.suppress(UnicodeDecodeError, LookupError):
            return unquoted(self.head.decode(self.encoding, errors="ignore").splitlines()[:200])
        return []

    @cached_property
    def delimiter(self) -> str:
        given = self.options.delimiter
        if given is not None:
            given = {"tab": "\t", "\\t": "\t", "space": " "}.get(given, given)
            if len(given) != 1:
                raise InputError(f"should be a single character, got {given!r}", where="delimiter")
            return given
        return find_delimiter(self.text.splitlines()[:300] if self.text else [])

    @cached_property
    def rows(self) -> list[tuple[int, list[str]]]:
        """Rows of a delimited text or a worksheet with their numbers; comments (#, %) are left out."""
        if self.is_workbook:
            return self._sheet_rows()
        if self.text is None or self.is_arrays:
            return []
        rows = split(self.text, self.delimiter, self.path)
        return [(line, row) for line, row in rows if not row[0].lstrip().startswith(("#", "%"))]

    @cached_property
    def comments(self) -> list[str]:
        """Lines that begin with # or %, without that sign."""
        lines = (self.text or "").splitlines()
        return [line.strip().lstrip("#%").strip("\r\n") for line in lines if line.lstrip().startswith(("#", "%"))]

    # ---- tables ---------------------------------------------------------------------------------

    @cached_property
    def table(self) -> Table | None:
        """A table with one header; None where the file has none. Raises InputError naming the row."""
        if self.frame is not None:
            return (
                None
                if self.frame.columns.nlevels > 1
                else table_from_frame(self.frame, self.path, self.options.missing)
            )
        if self.is_arrays or (not self.is_workbook and self.text is None):
            return None
        heads = [line.split(None if self.delimiter == " " else self.delimiter) for line in self.comments[-2:]]
        cells = headed(heads) if heads else None
        return table_from_rows(
            self.rows,
            self.path,
            decimal=self.options.decimal,
            delimiter=self.delimiter if not self.is_workbook else "",
            missing=self.options.missing,
            comment_header=cells or None,
        )

    @cached_property
    def columns(self) -> Sequence[str]:
        """Names of the table's columns in small letters, none where there is no table that can be read."""
        try:
            return [name.lower() for name in self.table.header] if self.table is not None else []
        except InputError:
            return []

    @property
    def is_workbook(self) -> bool:
        return self.head[:4] == b"PK\x03\x04" and self.suffix in (".xlsx", ".xlsm", ".ods")

    def _sheet_rows(self) -> list[tuple[int, list[str]]]:
        import pandas as pd

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # openpyxl remarks on styles
                sheet = self.options.table if self.options.table is not None else 0
                frame = pd.read_excel(self.path, sheet_name=sheet, header=None, dtype=object)
        except ImportError as error:
            package = "odfpy" if self.suffix == ".ods" else "openpyxl"
            raise extra_needed(getattr(error, "name", None) or package, "a workbook", self) from None
        except Exception as error:
            raise InputError(f"is not a workbook that can be read: {error}", file=self.path) from None
        skipped = self.options.skip_rows or 0
        rows = [
            (k + 1, ["" if cell is None or cell != cell else str(cell) for cell in row])
            for k, row in enumerate(frame.itertuples(index=False, name=None))
        ]
        return [(line, row) for line, row in rows[skipped:] if any(row)]

    # ---- HDF5, Parquet, arrays ------------------------------------------------------------------

    @property
    def is_hdf5(self) -> bool:
        return self.head[:8] == b"\x89HDF\r\n\x1a\n"

    @cached_property
    def hdf5_names(self) -> dict[str, str]:
        """Top-level names of an HDF5 file, with the pandas type of those that pandas wrote ("" for others)."""
        if not self.is_hdf5:
            return {}
        import h5py

        try:
            with h5py.File(self.path, "r") as file:
                found = {}
                for name in file:
                    kind = file[name].attrs.get("pandas_type", b"")
                    kind = kind.decode("utf-8", "replace") if isinstance(kind, bytes) else str(kind)
                    # names that are no text are bytes
                    found[name.decode("utf-8", "replace") if isinstance(name, bytes) else name] = kind
                return found
        except (OSError, RuntimeError, KeyError) as error:
            raise InputError(f"is not an HDF5 file that can be read: {error}", file=self.path) from None

    @cached_property
    def frame(self) -> Any:
        """The table of a Parquet or Feather file, of HDF5 that pandas wrote, of arrays; None of other files."""
        kind = {b"PAR1": "Parquet", b"ARRO": "Feather"}.get(self.head[:4])
        if kind is not None:
            import pandas as pd

            try:
                return (pd.read_parquet if kind == "Parquet" else pd.read_feather)(self.path)
            except ImportError:
                raise extra_needed("pyarrow", f"a {kind} file", self) from None
            except Exception as error:
                raise InputError(f"is not a {kind} file that can be read: {error}", file=self.path) from None
        if any(self.hdf5_names.values()):
            return self._hdf_frame()
        return table_of(self.path, self.head)

    @property
    def is_arrays(self) -> bool:
        """Whether it is a file of named arrays other than HDF5: MATLAB, NumPy, JSON."""
        return self.head.startswith((NUMPY, MATLAB, MATLAB_73)) or is_npz(self.path, self.head) or is_json(self.head)

    def _hdf_frame(self) -> Any:
        import pandas as pd

        keys = [name for name, kind in self.hdf5_names.items() if kind]
        if self.options.table is not None:
            keys = [key for key in keys if key == str(self.options.table).strip("/")]
        frames = sorted((int(m[1]), key) for key in keys if (m := re.fullmatch(r"Frame_(\d+)", key)))
        if not frames and len(keys) != 1:
            listed = ", ".join(self.hdf5_names)
            raise InputError(f"holds several tables: {listed}; say which (--table KEY)", file=self.path)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with pd.HDFStore(self.path, mode="r") as store:
                    if frames:
                        return pd.concat([store[key] for _, key in frames], ignore_index=True)
                    return store[keys[0]]
        except ImportError:
            raise extra_needed("tables", "an HDF5 file that pandas wrote", self) from None
        except Exception as error:
            raise InputError(f"is not a table that pandas can read: {error}", file=self.path) from None

    # ---- what it is -----------------------------------------------------------------------------

    def described(self) -> str:
        """What a file is that no importer recognises, in a few words."""
        if not self.head:
            return "is empty"
        for signature, name in SIGNATURES:
            if self.head.startswith(signature):
                film = ": make tracks of it with granswim track" if "film" in name or "GIF" in name else ""
                return f"is {name}{film or (', not tracks' if ':' not in name else '')}"
        if self.head[4:8] == b"ftyp" or self.head[:4] == b"RIFF":
            return "is a film: make tracks of it with granswim track"
        if PICKLE.match(self.head):
            return (
                "is a pickle of Python, which may run any code when it is opened, and is not opened: write the table "
                "as CSV, Parquet or HDF5 (DataFrame.to_csv, to_parquet, to_hdf)"
            )
        if re.match(rb"\s*<(?:!doctype html|html|table)", self.head[:200], re.IGNORECASE):
            return "is a web page (HTML), whatever its name says: save it as CSV or .xlsx"
        if re.match(rb"\s*<\?xml", self.head[:200]):
            return "is XML, but none of TrackMate"
        if self.is_arrays and self.table is None:
            inside = held(self.path, self.head)
            return f"holds no arrays t, x and y (or xy) with a value for each frame; it holds: {inside}"
        if self.is_hdf5 and self.table is None:
            return f"is an HDF5 file without tracks that are known; it holds: {', '.join(self.hdf5_names)[:200]}"
        if self.head[:4] == b"PK\x03\x04":
            return "is a ZIP archive: unpack it"
        if self.encoding is None and self.table is None:
            return "is a binary file of an unknown kind"
        if self.table is not None:
            more = f" ... ({len(self.table.header)} in all)" if len(self.table.header) > LISTED else ""
            listed = ", ".join(self.table.header[:LISTED]) + more
            bare = " (it has no header)" if self.table.bare else ""
            if self._clock_alone_is_missing():
                return (
                    f"is a table in which no clock is found{bare}; its columns: {listed}; say which it is, as "
                    "--columns t=TIME, or --fps HZ where each row is the next frame"
                )
            rest = [name for name in self.table.header if is_clock(name) is None]
            if rest and all(map(is_rate, rest)):
                return (
                    f"is a table of rates alone, and no places; its columns: {listed}. A velocity that is summed up "
                    "over time is a place; of an acceleration, summed up twice, the errors grow without end, and no "
                    "recording can be made of it: film it, or measure places beside it"
                )
            return (
                f"is a table in which no time and positions are found{bare}; its columns: {listed}; say which is "
                "which, as --columns t=TIME,x=CX,y=CY,body=NAME (a row per body and frame) or "
                "t=TIME,A.x=AX,A.y=AY,B.angle=BA (a row per frame); --fps where rows are frames, "
                "--skip-rows N where rows stand above the header"
            )
        return "is a text, but no table of tracks"

    def _clock_alone_is_missing(self) -> bool:
        """Whether the user has said where places or angles stand, and not where a clock does, nor a frame rate."""
        said = {key.rpartition(".")[2] for key in self.options.column_map()}
        return bool({"x", "y", "angle"} & said) and "t" not in said and self.options.fps is None
