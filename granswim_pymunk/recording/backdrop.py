"""The film that tracks were read from, and where it lies in the scene: ``film.mp4`` and ``film.toml`` of a recording.

The film is shown under the simulation and never analysed; a recording without it is complete. ``film.toml``::

    scale = 2.5e-4   # m/px
    left = 0.0       # m, x of the middle of the first column of pixels
    top = 0.12       # m, y of the middle of the first row of pixels
    rate = 60.0      # Hz, frames per second of the experiment (a film in slow motion plays at another rate)
    start = 0.0      # s, when the first frame was taken, on the clock of the tracks
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import written_whole
from ..scene import read_toml
from .movie import Film, decoded, keep_film

FILM, PLACE = "film.mp4", "film.toml"
QUALITY = 55  # of JPEG pictures in a page
# only what an MP4 holds itself: a playlist under that name could fetch other files
ALONE = ("-f", "mp4", "-protocol_whitelist", "file")
COMMENTS = {
    "scale": "m/px", "left": "m: x of the middle of the first column of pixels",
    "top": "m: y of the middle of the first row", "rate": "Hz: frames per second of the experiment",
    "start": "s: when the first frame was taken",
}  # fmt: skip


@dataclass(frozen=True)
class Backdrop:
    """A film and its place: the pixel in column c and row r (from 0, r from above) shows x = left + scale c,
    y = top - scale r; frame k was taken at start + k/rate.

    scale [m/px], left, top [m], rate [Hz], start [s]. Raises InputError where one is not finite, or scale or rate
    not above zero.
    """

    path: Path
    scale: float
    left: float
    top: float
    rate: float
    start: float = 0.0

    def __post_init__(self) -> None:
        for name in COMMENTS:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(f"should be a number, got {value!r}", file=self.path.with_name(PLACE), where=name)
            if name in ("scale", "rate") and value <= 0:
                raise InputError(f"should be above zero, got {value!r}", file=self.path.with_name(PLACE), where=name)

    def frames_at(self, t: np.ndarray) -> np.ndarray:
        """Numbers of the frames taken nearest to times [s]; -1 where the film had not begun."""
        frames = np.round((np.asarray(t, dtype=float) - self.start) * self.rate)
        return np.where(frames < 0, -1, frames).astype(int)

    def write(self, folder: Path) -> None:
        """film.toml beside the film."""
        with written_whole(folder / PLACE) as stream:
            lines = (f"{name} = {float(getattr(self, name))!r}  # {told}\n" for name, told in COMMENTS.items())
            stream.write("".join(lines).encode("utf-8"))


def read_backdrop(folder: Path) -> Backdrop | None:
    """The film beside a recording; None where there is no film, or nothing says where it lies. Raises InputError."""
    if not (folder / FILM).is_file() or not (folder / PLACE).is_file():
        return None
    data = read_toml(folder / PLACE)
    known = [f.name for f in fields(Backdrop) if f.name != "path"]
    for name in data:
        if name not in known:
            raise InputError(f"unknown key; known: {', '.join(known)}", file=folder / PLACE, where=name)
    missing = [name for name in known if name not in data and name != "start"]
    if missing:
        raise InputError(f"says no {missing[0]} [{COMMENTS[missing[0]].partition(':')[0]}]", file=folder / PLACE)
    return Backdrop(folder / FILM, **data)


@dataclass(frozen=True)
class Shown:
    """A film and where it lies: scale [m/px], left, top [m], rate [Hz], as in ``Backdrop``."""

    film: Film
    scale: float
    left: float
    top: float
    rate: float

    def keep(self, folder: Path) -> None:
        """Film and place beside a recording. Raises InputError."""
        keep_film(self.film, folder / FILM, self.rate)
        Backdrop(folder / FILM, self.scale, self.left, self.top, self.rate).write(folder)


@dataclass(frozen=True)
class Pictures:
    """JPEG pictures as texts in base64, which of them each moment shows (-1: none), and the box [m] they fill.

    box : left, bottom, width, height [m], from edge to edge of the outer pixels
    """

    data: Sequence[str]
    shown: Sequence[int]
    box: tuple[float, float, float, float]


def pictures_at(film: Backdrop, t: np.ndarray, across: int) -> Pictures | None:
    """Frames at times [s], made smaller to at most so many pixels across; None where the film cannot be read."""
    from PIL import Image

    wanted = film.frames_at(t)
    size = _size(film.path)
    if size is None or not np.any(wanted >= 0):
        return None
    order = {int(frame): k for k, frame in enumerate(np.unique(wanted[wanted >= 0]))}
    data: list[str] = []
    for k, frame in enumerate(_small(film.path, size, across)):
        if k in order:
            buffer = io.BytesIO()
            Image.fromarray(frame).save(buffer, "JPEG", quality=QUALITY, optimize=True)
            data.append(base64.b64encode(buffer.getvalue()).decode("ascii"))
        if len(data) == len(order):
            break
    if not data:
        return None
    place = [order.get(int(frame), -1) for frame in wanted]
    width, height = size
    box = (
        film.left - 0.5 * film.scale, film.top - (height - 0.5) * film.scale, width * film.scale, height * film.scale
    )  # fmt: skip
    return Pictures(data, [k if k < len(data) else -1 for k in place], box)


def _size(path: Path) -> tuple[int, int] | None:
    """Width and height [px] of a film as it is shown (turned as it says); None where it is none."""
    first = next(decoded(path, grey=False, before=ALONE), None)
    return None if first is None else (first.shape[1], first.shape[0])


def _small(path: Path, size: tuple[int, int], across: int) -> Iterator[np.ndarray]:
    width = min(size[0], across)
    words = ("-vf", f"scale={width}:{max(2, round(size[1] * width / size[0]))}")
    return decoded(path, grey=False, before=ALONE, after=words)
