"""The folder that a run writes to: what of it belongs to an earlier run, and what does not."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import InputError
from .files import refuse_links
from .trajectory import count_states

CHECKPOINT = "checkpoint.npz"
VIDEOS = tuple(f"video.{kind}" for kind in ("gif", "mp4"))
TRAJECTORY, SCENE, REPORT = "trajectory.h5", "scene.toml", "run.json"
PICTURES = "frames"
_PICTURE = re.compile(r"frame_\d{5,}\.png")


@dataclass(frozen=True)
class Earlier:
    """What an earlier run left in a folder.

    there : whether there was one;  states : in its trajectory;  reason : why it stopped;  video : its name, if any
    """

    there: bool
    states: int = 0
    reason: str = ""
    video: str | None = None

    @classmethod
    def find(cls, folder: Path) -> Earlier:
        report: Any = None
        with suppress(OSError, ValueError):
            report = json.loads((folder / REPORT).read_text(encoding="utf-8"))
        files = report.get("files") if isinstance(report, dict) and "scene_hash" in report else None
        states, ours = 0, isinstance(files, dict)
        if (folder / TRAJECTORY).is_file():
            with suppress(InputError):
                states, ours = count_states(folder / TRAJECTORY), True
        video = files.get("video") if isinstance(files, dict) else None
        reason = str(report.get("stopped", "")) if isinstance(files, dict) else ""
        return cls(ours or (folder / CHECKPOINT).is_file(), states, reason, video if video in VIDEOS else None)

    def own(self, folder: Path) -> list[Path]:
        """Its files, those that are there."""
        if not self.there:
            return []
        names = [SCENE, REPORT, TRAJECTORY, CHECKPOINT, *([self.video] if self.video else [])]
        pictures = [p for p in (folder / PICTURES).glob("frame_*.png") if _PICTURE.fullmatch(p.name)]
        return [place for place in (*(folder / name for name in names), *pictures) if place.exists()]


def look(folder: Path, video: str, overwrite: bool) -> Earlier:
    """What lies in an output folder, before anything is written.

    Raises InputError where a run is there that was not to be overwritten, or something that is not of a run.
    """
    names = [SCENE, REPORT, TRAJECTORY, CHECKPOINT, PICTURES, *([f"video.{video}"] if video != "none" else [])]
    refuse_links(folder, names)
    earlier = Earlier.find(folder)
    own = set(earlier.own(folder))
    pictures = [p for p in (folder / PICTURES).glob("frame_*.png") if _PICTURE.fullmatch(p.name)]
    for place in (*(folder / name for name in names if name != PICTURES), *pictures):
        if place.exists() and place not in own:
            raise InputError("is there and is not of an earlier run: move it, or write to another folder", file=place)
    kept = (folder / CHECKPOINT).is_file()
    if not overwrite and (earlier.states or kept):
        ended = "a finished run" if earlier.reason == "finished" else "a run that did not come to its end"
        more = f"granswim run --resume {folder} goes on with it, " if kept else ""
        raise InputError(f"holds {ended}; {more}--overwrite replaces it", file=folder)
    return earlier


def make_room(folder: Path, earlier: Earlier) -> None:
    """Remove what an earlier run left, and nothing else."""
    try:
        for place in earlier.own(folder):
            place.unlink(missing_ok=True)
        (folder / PICTURES).mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to this folder: {error.strerror}", file=folder) from None
