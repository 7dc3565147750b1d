"""A table of named columns, from a delimited text, a worksheet or a DataFrame."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from .units import is_unit, split_unit

MISSING = ("", "nan", "na", "n/a", "none", "null", "-", "--", "#n/a")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
# 20,000.5 and 20.000,5: signs between thousands tell themselves beside the other one, or where there are two
_POINT_GROUPS = re.compile(r"[-+]?\d{1,3}(?:(?:,\d{3})+\.\d*|(?:,\d{3}){2,})")
_COMMA_GROUPS = re.compile(r"[-+]?\d{1,3}(?:(?:\.\d{3})+,\d*|(?:\.\d{3}){2,})")
_GROUP_SIGNS = re.compile(r"(?<=\d)['’\u00a0\u202f\u2009 ](?=\d{3}(?!\d))")
_CLOCK = re.compile(r"(?:(\d+):)?(\d{1,2}):(\d{2}(?:[.,]\d+)?)")
_MINUS = re.compile("\u2212(?=[\\d.,])")  # U+2212
_SCIENTIFIC = re.compile(r"([-+]?\d),(\d+[eE][-+]?\d+)")
_BOTH_COMMAS = re.compile(r"(?:[-+]?\d,\d+[eE][-+]?\d+)?(?:,(?:[-+]?\d,\d+[eE][-+]?\d+)?)+")
_QUOTED = re.compile(r'\s*"((?:[^"]|"")*)"[\s,;]*')
FEWEST_EVEN = 5  # rows of which the first column may be a clock by its even steps
OFF_EVEN = 1.5  # of their last digit, by which rounded stamps may be off a line through two of them
DIGITS = 9  # behind the point, to which stamps are rounded at most
LOOKED_AT = 200  # rows that decide about delimiter, header and decimal sign


@dataclass
class Table:
    """Columns by name; cells are texts, or numbers where the source has types.

    lines : row number of each row in the source, for messages;  units : what a row of units says
    decimal : "," or ".";  bare : the source has no header, and columns are called 1, 2, 3 ...
    """

    source: Path
    header: list[str]
    columns: dict[str, Any]
    lines: Sequence[int]
    units: dict[str, str] = field(default_factory=dict)
    decimal: str = "."
    bare: bool = False
    missing: Sequence[str] = ()

    def __post_init__(self) -> None:
        self.sentinels = {text.strip().lower() for text in (*MISSING, *self.missing)}
        self.sentinel_numbers = set()
        for text in self.missing:
            try:
                self.sentinel_numbers.add(float(text))
            except ValueError:
                continue

    def __len__(self) -> int:
        return len(self.lines)

    def named(self, column: str) -> str:
        """The name of a column that is said by its name, with its unit or without, or by its number from 1.

        What is none stays as it is.
        """
        if column in self.columns:
            return column
        number = int(column) if column.isdecimal() else 0
        if 0 < number <= len(self.header):
            return self.header[number - 1]
        plain = [name for name in self.header if split_unit(name)[0].strip().lower() == column.strip().lower()]
        return plain[0] if len(plain) == 1 else column

    def mapped(self, columns: Mapping[str, str]) -> dict[str, str]:
        """A map of a user, with columns by their names, see ``named``."""
        return {key: self.named(column) for key, column in columns.items()}

    def unnamed(self) -> dict[str, str]:
        """Of two or three numbers a row without a header, t, x, y, where the first rises in even steps; else empty."""
        if not self.bare or not 2 <= len(self.header) <= 3 or len(self) < FEWEST_EVEN:
            return {}
        clock = self.times("1")
        clock = self.numbers("1") if clock is None else clock
        step = (clock[-1] - clock[0]) / (len(clock) - 1)
        # places along a straight way may rise as evenly, but hardly to their last digit
        whole = (clock == np.round(clock)).all()
        rounded = (d for d in range(DIGITS) if np.allclose(clock, np.round(clock, d), rtol=0, atol=1e-3 * 10.0**-d))
        digit = next(rounded, DIGITS)
        if not step > 0 or not (np.diff(clock) > 0).all():
            return {}
        off = np.abs(clock - np.linspace(clock[0], clock[-1], len(clock))).max()
        even = off < (1e-9 if whole else OFF_EVEN * 10.0**-digit)
        return dict(zip("txy", self.header, strict=False)) if even and off < 0.5 * step else {}

    def cells(self, name: str) -> Any:
        if name not in self.columns:
            hint = "; it has no header: columns are 1, 2, 3 ..." if self.bare else ""
            raise InputError(f"has no column {name!r}; it has: {some_of(self.header, 20)}{hint}", file=self.source)
        return self.columns[name]

    def texts(self, name: str) -> list[str]:
        """The cells as texts; whole numbers without a point."""
        cells = self.cells(name)
        if isinstance(cells, np.ndarray) and cells.dtype.kind == "f":
            return ["" if v != v else str(int(v)) if v == int(v) else repr(v) for v in cells.tolist()]
        return [_label(str(cell)) for cell in cells]

    def numbers(self, name: str, *, required: bool = False) -> np.ndarray:
        """(k,) values, NaN where missing; with ``required`` nothing may be missing. Raises InputError with the row."""
        cells = self.cells(name)
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "fiub":
            values = cells.astype(float)
        else:
            values = self._parse(name, cells)
        for sentinel in self.sentinel_numbers:
            values[values == sentinel] = np.nan
        bad = ~np.isfinite(values)
        if bad.any():
            k = int(np.argmax(bad))
            if np.isinf(values).any():
                k = int(np.argmax(np.isinf(values)))
                raise self._not_a_number(name, k)
            if required:
                raise InputError(f"{name} is missing", file=self.source, where=f"row {self.lines[k]}")
        return values

    def _parse(self, name: str, cells: Sequence[Any]) -> np.ndarray:
        values = np.full(len(cells), np.nan)
        comma = self.decimal == ","
        groups = "." if comma else ","
        pattern = _COMMA_GROUPS if comma else _POINT_GROUPS
        grouped = any(isinstance(cell, str) and pattern.fullmatch(cell.strip()) for cell in cells)
        for k, cell in enumerate(cells):
            try:
                if grouped:
                    cell = cell.replace(groups, "")
                values[k] = float(cell.replace(",", ".") if comma else cell)
            except (ValueError, AttributeError):
                if str(cell).strip().lower() in self.sentinels or cell is None:
                    continue
                plain = _GROUP_SIGNS.sub("", str(cell))
                if not numeric(plain, self.decimal):
                    raise self._not_a_number(name, k) from None
                values[k] = float(plain.replace(",", ".") if comma else plain)
        return values

    def times(self, name: str) -> np.ndarray | None:
        """(k,) [s] of a column of clock times (h:mm:ss.sss) or dates with times, from the first; None where it is none.

        Raises InputError naming the row that is not like the others.
        """
        cells = self.cells(name)
        first = next((cell for cell in cells if str(cell).strip().lower() not in self.sentinels), None)
        if not isinstance(first, str) or _microseconds(first) is None:
            return None
        values = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            found = _microseconds(cell)
            if found is None:
                what = f"{name} should be a time as {first!r}, got {str(cell)[:60]!r}"
                raise InputError(what, file=self.source, where=f"row {self.lines[k]}")
            values[k] = found
        return (values - values.min()) / 1e6

    def _not_a_number(self, name: str, k: int) -> InputError:
        hint = ""
        if self.decimal == "." and _DECIMAL_COMMA.fullmatch(str(self.columns[name][k]).strip()):
            hint = "; a decimal comma? Then --decimal ,"
        return InputError(
            f"{name} should be a number, got {str(self.columns[name][k])[:60]!r}{hint}",
            file=self.source,
            where=f"row {self.lines[k]}",
        )


def _microseconds(text: str) -> float | None:
    """Of h:mm:ss.sss or mm:ss.sss, or since 2000 of a date with a time; None where a text is neither.

    Whole numbers of them are exact, where seconds since 2000 would keep seven decimals.
    """
    text = text.strip()
    match = _CLOCK.fullmatch(text)
    if match is not None:
        seconds = 3600 * int(match[1] or 0) + 60 * int(match[2]) + float(match[3].replace(",", "."))
        return float(round(1e6 * seconds))
    try:
        when = datetime.fromisoformat(text) if ":" in text else None
    except ValueError:
        return None
    if when is None:
        return None
    return float((when - datetime(2000, 1, 1, tzinfo=when.tzinfo)) // timedelta(microseconds=1))


def _label(text: str) -> str:
    """``3.0`` as ``3``: labels that went through a column of floats."""
    text = text.strip()
    return text[:-2] if re.fullmatch(r"-?\d+\.0", text) else text


# ---- from a delimited text --------------------------------------------------------------------


def plain_numbers(text: str) -> str:
    """Numbers as programs of some languages write them, in the form that float() takes.

    The sign of subtraction becomes a hyphen. Where commas stand both between columns and as decimal sign, as Tracker
    writes them in Norwegian (``1,000000E-2,-1,498701E1``), the exponents tell where a number ends.
    """
    text = _MINUS.sub("-", text)
    lines = [line for line in text.splitlines()[:LOOKED_AT] if line.strip()]
    both = sum(bool(_BOTH_COMMAS.fullmatch(line.strip())) for line in lines)
    if both >= 3 and both > 0.5 * len(lines):
        text = _SCIENTIFIC.sub(r"\1.\2", text)
    return text


def unquoted(lines: list[str]) -> list[str]:
    """Lines, where each row stands in quotes as a whole, without them: a spreadsheet took the row for one cell.

    A row of one word, as a title, may stand without quotes. A cell that is a number with a decimal comma is no row.
    """
    sample = [_QUOTED.fullmatch(line) for line in lines[:LOOKED_AT]]
    quoted = [cell[1] for cell in sample if cell is not None]
    # a row of which one cell alone is filled, as times without a place, may be any cell
    if sum(map(_is_row, quoted)) < 3 or len(quoted) < 0.5 * len(sample):
        return lines
    cells = [_QUOTED.fullmatch(line) for line in lines]
    # the last line may be cut
    others = [line for line, cell in zip(lines[:-1], cells[:-1], strict=True) if cell is None]
    if any(re.search(r"[\t,;\"]", line.strip()) for line in others):
        return lines
    return [line if cell is None else cell[1].replace('""', '"') for cell, line in zip(cells, lines, strict=True)]


def _is_row(cell: str) -> bool:
    return bool(re.search(r"[\t;]", cell)) or ("," in cell and not _DECIMAL_COMMA.fullmatch(cell.strip()))


def split(text: str, delimiter: str, path: Path) -> list[tuple[int, list[str]]]:
    """Rows with their line numbers; empty lines are left out. A space stands for any run of blanks."""
    if delimiter == " ":
        found = [(line, row.split()) for line, row in enumerate(text.splitlines(), start=1)]
        return [(line, row) for line, row in found if row]
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        rows = [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise InputError(f"is not a table: {error}", file=path) from None
    return [(line, row) for line, row in rows if any(cell.strip() for cell in row)]


def find_delimiter(lines: Sequence[str]) -> str:
    """The sign that cuts most lines into the same number of parts, two or more."""
    best, best_score = ",", (0.0, 0)
    sample = [line for line in lines[:LOOKED_AT] if line.strip() and not line.lstrip().startswith(("#", "%"))]
    if not sample:
        return ","
    for rank, delimiter in enumerate((";", "\t", ",", " ")):
        if delimiter == " ":
            counts = [len(line.split()) for line in sample]
        else:
            counts = [_parts(line, delimiter) for line in sample]
        common, times = Counter(counts).most_common(1)[0]
        if common < 2:
            continue
        # of two that cut all lines alike the earlier: 0,5;1,2 is cut at ; and not at its decimal signs
        score = (round(times / len(sample), 2), -rank)
        if score > best_score:
            best, best_score = delimiter, score
    if best_score[0] < 0.5:
        counts_first = {d: _parts(sample[0], d) for d in (",", ";", "\t")}
        best = max(counts_first, key=lambda d: counts_first[d])
    return best


def _parts(line: str, delimiter: str) -> int:
    try:
        return len(next(csv.reader([line], delimiter=delimiter), []))
    except csv.Error:  # a cell of a hundred thousand letters is none
        return 1


def some_of(names: Sequence[str], most: int) -> str:
    """The first names of a list, so many at most, and dots where there are more."""
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


def numeric(cell: str, decimal: str = ".") -> bool:
    try:
        float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return False
    return True


def find_decimal(rows: Sequence[Sequence[str]], delimiter: str) -> str:
    """The decimal sign of most numbers. Where commas stand between columns, cells that hold one were quoted."""
    cells = [cell.strip() for row in rows[:LOOKED_AT] for cell in row]
    # "20,000" in such a cell may be twenty or twenty thousand
    unclear = re.compile(r"[-+]?\d{1,3},\d{3}" if delimiter == "," else "-")
    commas = sum(bool(_DECIMAL_COMMA.fullmatch(c)) and not unclear.fullmatch(c) for c in cells)
    commas += sum(bool(_COMMA_GROUPS.fullmatch(c)) for c in cells)
    points = sum((numeric(c) and "." in c) or bool(_POINT_GROUPS.fullmatch(c)) for c in cells)
    return "," if commas > points else "."


def table_from_rows(
    rows: Sequence[tuple[int, list[str]]],
    path: Path,
    *,
    decimal: str | None = None,
    delimiter: str = ",",
    missing: Sequence[str] = (),
    comment_header: list[str] | None = None,
) -> Table:
    """Header, a row of units where there is one, and columns. Raises InputError naming the row."""
    if not rows:
        raise InputError("is empty", file=path)
    rows = _without_tail([(line, [cell.strip() for cell in row]) for line, row in rows])
    if decimal not in (None, ".", ","):
        raise InputError(f"should be . or , got {decimal!r}", where="decimal")
    sign = decimal or find_decimal([row for _, row in rows], delimiter)
    counts = Counter(len(row) for _, row in rows[:LOOKED_AT])
    common, times = counts.most_common(1)[0]
    start = 0
    if times >= 3 and times >= 0.5 * len(rows[:LOOKED_AT]):
        # what stands above the header has another number of columns: a title, remarks
        start = next(k for k, (_, row) in enumerate(rows) if len(row) == common)
    body = list(rows[start:])
    body = body[_titles(body, sign) :]
    # no heading is a number, nor a time of day
    bare = all(numeric(cell, sign) or _microseconds(cell) is not None for cell in body[0][1])
    units: dict[str, str] = {}
    if bare and comment_header is not None and len(comment_header) == len(body[0][1]):
        header, bare = comment_header, False
    elif bare:
        header = [str(k + 1) for k in range(len(body[0][1]))]
    else:
        header = body.pop(0)[1]
    for line, row in body:
        if len(row) != len(header):
            raise InputError(f"expected {len(header)} columns, got {len(row)}", file=path, where=f"row {line}")
    if body and not bare and _is_unit_row(body[0][1], sign):
        units = {name: cell.strip("()[] ") for name, cell in zip(header, body.pop(0)[1], strict=True)}
    if not body:
        raise InputError("is empty: it has no rows", file=path)
    header = _names(header, path)
    columns = dict(zip(header, zip(*(row for _, row in body), strict=True), strict=True))
    units = {name: unit for name, unit in zip(header, units.values(), strict=True) if unit} if units else {}
    return Table(path, header, columns, [line for line, _ in body], units, sign, bare, missing)


def _without_tail(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Rows that all end in a delimiter have no last column."""
    if all(len(row) > 1 and row[-1] == "" for _, row in rows):
        return [(line, row[:-1]) for line, row in rows]
    return rows


def _titles(rows: Sequence[tuple[int, list[str]]], decimal: str) -> int:
    """How many rows stand above the header that fill fewer cells than it: titles, as ``Run #1;``."""
    numbers = (k for k, (_, row) in enumerate(rows) if any(numeric(cell, decimal) for cell in row))
    head = next(numbers, 0) - 1
    if head > 0 and _is_unit_row(rows[head][1], decimal):
        head -= 1
    if head <= 0:
        return 0
    *above, filled = (sum(map(bool, row)) for _, row in rows[: head + 1])
    named = all(re.search(r"[^\W\d_]", cell) and cell.lower() not in MISSING for cell in rows[head][1] if cell)
    return head if named and max(above) < filled else 0


def _is_unit_row(row: Sequence[str], decimal: str) -> bool:
    cells = [cell.strip("()[] ") for cell in row]
    return any(map(is_unit, cells)) and not any(numeric(cell, decimal) for cell in cells if cell)


def headed(comments: Sequence[Sequence[str]]) -> list[str]:
    """The header that stands in the last comments above a table: "#Time Pos" with its units, "#[s] [cm]", below it."""
    *above, last = [[cell.strip() for cell in row] for row in comments]
    bracketed = all(cell[:1] + cell[-1:] in ("[]", "()") for cell in last if cell)
    if above and bracketed and len(above[-1]) == len(last) and _is_unit_row(last, "."):
        return [f"{name} [{unit.strip('[]() ')}]" if unit else name for name, unit in zip(above[-1], last, strict=True)]
    return last


def _names(header: Sequence[str], path: Path) -> list[str]:
    """Names without blanks around them; a nameless column (an index) is called ``index``."""
    names = [cell.strip() or ("index" if k == 0 else f"column {k + 1}") for k, cell in enumerate(header)]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"a column stands in the header twice: {twice[0]!r}", file=path)
    return names


def table_from_frame(frame: Any, path: Path, missing: Sequence[str] = ()) -> Table:
    """The columns of a pandas DataFrame; an index that has a name, or is no plain count, becomes a column."""
    import pandas as pd

    plain = isinstance(frame.index, pd.RangeIndex) or (frame.index.name is None and frame.index.dtype.kind in "iu")
    if not plain and frame.index.name not in frame.columns:
        frame = frame.reset_index(names=None if frame.index.name is not None else "t")
    header = [str(name) for name in frame.columns]
    columns: dict[str, Any] = {}
    for name, label in zip(header, frame.columns, strict=True):
        series = frame[label]
        if pd.api.types.is_numeric_dtype(series.dtype):
            columns[name] = series.to_numpy(dtype=float, na_value=math.nan)
        elif pd.api.types.is_timedelta64_dtype(series.dtype):
            columns[name] = series.dt.total_seconds().to_numpy()
        else:
            columns[name] = tuple("" if cell is None or cell != cell else str(cell) for cell in series)
    return Table(path, _names(header, path), columns, range(1, len(frame) + 1), missing=missing)
