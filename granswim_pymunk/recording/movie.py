"""Films as frames: what ffmpeg reads, GIFs, folders of pictures."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


@dataclass(frozen=True)
class Film:
    """Grey frames (h, w) float, 0 to 255, read anew each time; ``rate`` [Hz] or None; ``count`` or None."""

    path: Path
    rate: float | None
    width: int
    height: int
    frames: Callable[[], Iterator[np.ndarray]]


def open_film(path: str | Path) -> Film:
    """A film, a GIF or a folder of pictures. Raises InputError."""
    path = Path(path)
    if not path.exists():
        raise InputError("no such file", file=path)
    if path.is_dir():
        files = sorted(f for f in path.iterdir() if f.suffix.lower() in PICTURES)
        if not files:
            raise InputError("holds no pictures", file=path)
        height, width = _grey(files[0]).shape
        return Film(path, None, width, height, lambda: map(_grey, files))
    if path.suffix.lower() in (".gif", ".tif", ".tiff"):
        return _animation(path)
    first = next(decoded(path, grey=True), None)
    if first is None:
        raise InputError("is not a film that can be read", file=path)
    frames = lambda: (frame.astype(float) for frame in decoded(path, grey=True))  # noqa: E731
    return Film(path, _rate(path), first.shape[1], first.shape[0], frames)


def decoded(path: Path, *, grey: bool, before: Sequence[str] = (), after: Sequence[str] = ()) -> Iterator[np.ndarray]:
    """Frames (h, w) or (h, w, 3) uint8 by ffmpeg, turned as a player turns them; none where it is no film.

    A stream of PGM or PPM pictures, each of which says its own size. ``before``, ``after``: further words to ffmpeg,
    for what is read and for what is written.
    """
    import imageio_ffmpeg

    kind = ("pgm", "gray") if grey else ("ppm", "rgb24")
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", *before, "-i", str(path), *after, "-an", "-f",
               "image2pipe", "-vcodec", kind[0], "-pix_fmt", kind[1], "-"]  # fmt: skip
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        stream = process.stdout
        assert stream is not None
        try:
            while stream.readline() == (b"P5\n" if grey else b"P6\n"):
                width, height = (int(part) for part in stream.readline().split())
                stream.readline()
                shape = (height, width) if grey else (height, width, 3)
                raw = stream.read(math.prod(shape))
                if len(raw) < math.prod(shape):
                    break
                yield np.frombuffer(raw, np.uint8).reshape(shape)
        finally:
            process.kill()


def _rate(path: Path) -> float | None:
    """Frames per second, as ffmpeg says it of a film."""
    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", str(path)]
    said = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False).stderr.decode(
        "utf-8", "replace"
    )
    match = re.search(r"Video:.*?([\d.]+) fps", said)
    return float(match[1]) if match and float(match[1]) > 0 else None


def _grey(path: Path) -> np.ndarray:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            return np.asarray(picture.convert("L"), dtype=float)
    except (OSError, UnidentifiedImageError) as error:
        raise InputError(f"is not a picture that can be read: {error}", file=path) from None


def _animation(path: Path) -> Film:
    from PIL import Image, ImageSequence, UnidentifiedImageError

    def frames() -> Iterator[np.ndarray]:
        with Image.open(path) as picture:
            for frame in ImageSequence.Iterator(picture):
                yield np.asarray(frame.convert("L"), dtype=float)

    try:
        with Image.open(path) as picture:
            width, height = picture.size
            lasts = float(picture.info.get("duration", 0.0))
    except (OSError, UnidentifiedImageError) as error:
        raise InputError(f"is not a film that can be read: {error}", file=path) from None
    return Film(path, 1000 / lasts if lasts else None, width, height, frames)


def keep_film(film: Film, path: Path, rate: float) -> None:
    """The film beside the recording: as it is where it is an MP4, else encoded anew."""
    if film.path.suffix.lower() in (".mp4", ".m4v"):
        if film.path.resolve() != path.resolve():
            shutil.copyfile(film.path, path)
        return
    import imageio_ffmpeg

    width, height = film.width - film.width % 2, film.height - film.height % 2
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=rate, pix_fmt_in="gray", macro_block_size=2, output_params=["-crf", "23"]
    )
    writer.send(None)
    for frame in film.frames():
        writer.send(np.ascontiguousarray(frame[:height, :width].clip(0, 255).astype(np.uint8)))
    writer.close()
