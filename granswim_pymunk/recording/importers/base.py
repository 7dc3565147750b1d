"""What an importer is: it recognises a file and says what the file shows, in the file's own units.

An importer is one file with a function ``recognise(source) -> bool`` that looks at the beginning of the file and a
function ``read(source, options) -> Found``. Units, the direction of y, bodies, laws and the scene are nobody's
business but ``build.py``'s, so that they are the same for every format. ``__init__.py`` lists them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError

if TYPE_CHECKING:
    from .source import Source

# NAME=COLUMN of a map; a comma ends a column only where another NAME= follows, and never within quotes
_PAIR = re.compile(r"""\s*([^=,]*[^=,\s])\s*=\s*(?:"([^"]*)"|'([^']*)'|(.+?))\s*(?:,(?=[^=,]*=)|$)""")


@dataclass(frozen=True)
class Options:
    """What a user says about a file; None and empty: the file says it, or the default.

    bodies : ``id:radius:mass[:role]`` each, ``*`` for all that are not named; ``5mm``, ``10g`` or SI
    scene : a TOML with bodies, laws, gravity ..., or the name of a template (pendulum, wheel, puck, drop, cart,
        swimmer)
    inputs : commands given to a motor, ``[body=]file[:column]`` each: t,name,value, or a time and columns of values
    hold : whether a command stays until the next row, or is linear between rows; None: as the values look
    laws : ``name[:body[,body]],parameter=value,...`` each;  gravity : "9.81" (along -y) or "gx,gy" [m/s^2]
    adjustables : what recalibration may move, ``law.parameter=low:high`` each, of a vector a component (``a_x``)
    columns : where t, body, x, y, angle stand, ``{"t": "time", "x": "cx"}`` or "t=time,x=cx"; names, or
        numbers from 1
    unit, time_unit, angle_unit : of the file, a name, SI per unit, or both ("0.1mm/px")
    fps : frame rate [Hz]; the clock of the file then counts frames, or is not used where ``columns`` leaves it out
    flip_y : y = height - y with a height in the file's unit, False: y points up already
    missing : texts or numbers that mean "not seen", besides nothing and NaN
    delimiter, decimal, skip_rows, encoding : of a text; left out, found by looking
    table : sheet of a workbook, or key of an HDF5 file
    likelihood : positions of a lower likelihood (pose trackers) are not seen
    min_frames : tracks seen in fewer frames are left out
    title, sampling [Hz], position_noise [m], angle_noise [rad], tolerance [m] : as in recording.toml
    """

    bodies: Sequence[str] = ()
    scene: Any = None
    laws: Sequence[str] = ()
    inputs: Sequence[str] = ()
    hold: bool | None = None
    adjustables: Sequence[str] = ()
    gravity: str | Sequence[float] | float | None = None
    columns: str | Mapping[str, str] | None = None
    unit: str | float | None = None
    time_unit: str | float | None = None
    fps: float | None = None
    angle_unit: str | float | None = None
    flip_y: float | bool | None = None
    missing: Sequence[str] = ()
    delimiter: str | None = None
    decimal: str | None = None
    skip_rows: int | None = None
    encoding: str | None = None
    table: str | int | None = None
    likelihood: float = 0.6
    min_frames: int = 1
    title: str | None = None
    sampling: float | None = None
    position_noise: float | None = None
    angle_noise: float | None = None

    def column_map(self) -> dict[str, str]:
        """``t=time,x=cx`` as a dictionary. Raises InputError."""
        if self.columns is None or isinstance(self.columns, Mapping):
            return {key: str(column) for key, column in (self.columns or {}).items()}
        found: dict[str, str] = {}
        at = 0
        while at < len(self.columns) or not found:
            match = _PAIR.match(self.columns, at)
            column = match and next((text for text in match.groups()[1:] if text is not None), "").strip()
            if match is None or not column:
                raise InputError(
                    f"should be NAME=COLUMN,NAME=COLUMN ..., a column by its name, in quotes if it holds a comma and a "
                    f"sign of equality, or by its number, got {self.columns!r}",
                    where="columns",
                )
            found[match[1]] = column
            at = match.end()
        return found


@dataclass
class Found:
    """What a file shows, in its own units: one entry for each body and frame where it may have been seen.

    clock : (k,) times, frame or step numbers;  counts : what it counts, "time", "frame" or "step"
    body : k names, or None where the file does not tell bodies apart
    x, y, angle : (k,) NaN where not seen; angle None where there is none
    length, time, turn : units that the file states ("px" for pixels), None where it says nothing
    y_down : the format counts y from the top of a picture
    rate : frames per second, where the file says it
    rows : k row numbers to name in an error, None where the file has no rows
    radius, mass : of bodies, where the file has them, in the file's length, in kg
    period : length of a box that is periodic along x, in the file's length
    unmeasured : "x" or "y", which is 0 wherever the other one was measured
    lone : heading of the only coordinate where it names no axis ("Position"); it stands in x
    notes : what was decided on the way, one line each
    """

    clock: np.ndarray
    counts: str
    body: Sequence[str] | None
    x: np.ndarray
    y: np.ndarray
    angle: np.ndarray | None = None
    length: str | None = None
    time: str | None = None
    turn: str | None = None
    y_down: bool = False
    rate: float | None = None
    rows: Sequence[int] | None = None
    radius: dict[str, float] = field(default_factory=dict)
    mass: dict[str, float] = field(default_factory=dict)
    period: float | None = None
    title: str | None = None
    unmeasured: str | None = None
    lone: str | None = None
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Importer:
    """A format by name. ``recognise`` looks at the beginning of a file, ``read`` says what it shows."""

    name: str
    help: str
    recognise: Callable[[Source], bool]
    read: Callable[[Source, Options], Found]


def single(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both coordinates, or neither: a position with one coordinate is not seen."""
    seen = np.isfinite(x) & np.isfinite(y)
    return np.where(seen, x, np.nan), np.where(seen, y, np.nan)


def only_one(measured: Collection[str]) -> str | None:
    """The coordinate that was not measured, where the other one was."""
    return next((other for axis, other in ("xy", "yx") if axis in measured and other not in measured), None)


def grid(t: np.ndarray, names: Sequence[str], xy: np.ndarray) -> tuple[np.ndarray, list[str], np.ndarray, np.ndarray]:
    """Arrays t (T,) and xy (T, n, 2) as clock, body, x, y with one entry for each body and frame."""
    frames, n = len(t), len(names)
    clock = np.repeat(np.asarray(t, dtype=float), n)
    body = list(names) * frames
    return clock, body, xy[..., 0].reshape(-1), xy[..., 1].reshape(-1)


def extra_needed(package: str, what: str, source: Source, extra: str = "files") -> InputError:
    return InputError(f"{what} needs the package {package}: pip install 'granswim_pymunk[{extra}]'", file=source.path)
