"""Recordings that come with the package."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError

FOLDER = Path(__file__).parent.parent / "recordings"


def _parts(folder: Path) -> list[Path]:
    """A recording itself, or the recordings it consists of."""
    if (folder / "recording.toml").is_file():
        return [folder]
    return sorted(child for child in folder.iterdir() if (child / "recording.toml").is_file())


def shipped_names() -> tuple[str, ...]:
    """Names of the recordings that come with the package; one may consist of several (falling_balls)."""
    return tuple(sorted(child.name for child in FOLDER.iterdir() if child.is_dir() and _parts(child)))


def shipped(name: str) -> Path:
    """Folder of a recording that comes with the package, also of a part: ``falling_balls/Baseball_1``."""
    folder = FOLDER / name
    top = Path(name).parts[0] if Path(name).parts else ""
    if top not in shipped_names() or ".." in Path(name).parts or not folder.is_dir():
        raise InputError(f"no such recording; shipped: {', '.join(shipped_names())}", file=name)
    return folder


def resolve_recording(text: str | Path) -> list[Path]:
    """Folders a user means: a path first (one recording, or a folder of them), else a shipped name.

    ``falling_balls`` gives all its drops. Raises InputError where there is neither.
    """
    path = Path(text)
    try:
        if path.is_dir() and (found := _parts(path)):
            return found
        if path.exists():
            # let the reader say what is missing there
            return [path]
        return _parts(shipped(str(text)))
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise InputError(
                f"no such folder, and no shipped recording; shipped: {', '.join(shipped_names())}", file=path
            ) from None
        raise InputError(f"cannot read it: {error}", file=repr(str(text))) from None
