"""Videos made of pictures: GIF and MP4."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from .errors import InputError

GIF_WIDTH = 720  # pixels; a wide GIF of a whole bed is too large to put on a page


def write_video(
    frames: Sequence[str | Path],
    path: str | Path,
    fps: float = 25.0,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """A GIF or MP4, by the ending of ``path``, of PNG frames; ``fps`` pictures a second.

    Raises InputError for another ending or without frames.
    """
    path = Path(path)
    if not frames:
        raise InputError("there are no frames to make a video of", file=path)
    if path.suffix not in (".gif", ".mp4"):
        raise InputError("should end in .gif or .mp4", file=path)
    beside = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        if path.suffix == ".gif":
            _write_gif(frames, beside, fps, progress)
        else:
            _write_mp4(frames, beside, fps, progress)
            if _length(beside) != len(frames):  # ffmpeg says nothing of a full disk
                raise InputError("cannot write it: ffmpeg left out pictures", file=path)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
    return path


def _write_gif(
    frames: Sequence[str | Path], path: Path, fps: float, progress: Callable[[int, int], None] | None
) -> None:
    pictures = []
    palette = None
    for k, name in enumerate(frames):
        with Image.open(name) as picture:
            small = picture.convert("RGB")
        if small.width > GIF_WIDTH:
            small = small.resize(
                (GIF_WIDTH, round(small.height * GIF_WIDTH / small.width)), Image.Resampling.LANCZOS
            )
        if palette is None:
            # one palette for all, from first, middle and last: colours must not flicker
            palette = _palette([frames[0], frames[len(frames) // 2], frames[-1]])
        pictures.append(small.quantize(palette=palette, dither=Image.Dither.NONE))
        if progress is not None:
            progress(k + 1, len(frames))
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=round(1000 / fps), loop=0, optimize=False
    )


def _palette(names: Sequence[str | Path]) -> Image.Image:
    strips = []
    for name in names:
        with Image.open(name) as picture:
            strips.append(np.asarray(picture.convert("RGB").resize((400, 300))))
    return Image.fromarray(np.vstack(strips)).quantize(128, method=Image.Quantize.MAXCOVERAGE)


def _write_mp4(
    frames: Sequence[str | Path], path: Path, fps: float, progress: Callable[[int, int], None] | None
) -> None:
    import imageio_ffmpeg

    with Image.open(frames[0]) as first:
        size = (first.width // 2 * 2, first.height // 2 * 2)
    writer = imageio_ffmpeg.write_frames(
        str(path), size, fps=fps, codec="libx264", quality=None, macro_block_size=2,
        output_params=["-crf", "18", "-preset", "fast"], ffmpeg_log_level="error",
    )  # fmt: skip
    writer.send(None)
    try:
        for k, name in enumerate(frames):
            with Image.open(name) as picture:
                writer.send(np.ascontiguousarray(np.asarray(picture.convert("RGB").crop((0, 0, *size)))))
            if progress is not None:
                progress(k + 1, len(frames))
    except OSError as error:
        # imageio_ffmpeg puts ffmpeg's whole command line into it
        raise InputError(f"cannot write it: {(error.strerror or str(error)).splitlines()[0]}", file=path) from None
    finally:
        writer.close()


def _length(path: Path) -> int:
    """Number of pictures in a video, 0 where it cannot be read."""
    import imageio_ffmpeg

    try:
        return int(imageio_ffmpeg.count_frames_and_secs(str(path))[0])
    except (OSError, RuntimeError):
        return 0
