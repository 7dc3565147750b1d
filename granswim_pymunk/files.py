"""Files that appear whole or not at all, and folders that one program at a time writes to."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import InputError

try:
    import fcntl
except ImportError:  # Windows has no such locks: there two programs are not kept apart
    fcntl = None  # type: ignore[assignment]


@contextmanager
def written_whole(path: str | Path, mode: int = 0o644, *, sure: bool = False) -> Iterator[BinaryIO]:
    """A stream to a file beside ``path`` that is renamed to it at the end, or removed if anything is raised.

    ``sure``: flushed to the disk before it is renamed, so that not even a power failure leaves half of it.
    The folder has to be there. A link in the place of ``path`` is replaced, its target left alone. Raises
    OSError where it cannot be written to.
    """
    path = Path(path)
    handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            if sure:
                stream.flush()
                os.fsync(stream.fileno())
        os.chmod(beside, mode)
        os.replace(beside, path)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise


def _cannot(error: OSError) -> str:
    return error.strerror or str(error)


@contextmanager
def writing(path: str | Path, kept: str = "") -> Iterator[None]:
    """A disk that takes no more becomes an InputError that names the file; ``kept``: what is safe all the same."""
    try:
        yield
    except OSError as error:
        more = f"; {kept}" if kept else ""
        raise InputError(f"cannot write it: {_cannot(error)}{more}", file=error.filename or path) from None


class Reserved:
    """Room on the disk for a file that grows, asked for before it is written to.

    HDF5 that meets a full disk in the middle of a write leaves a file that cannot be read, and may end the program.
    What has been reserved is there when it is needed.
    """

    AHEAD = 1 << 18  # bytes: so much more is asked for, so that it need not be asked for each time

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._until = 0

    def until(self, size: int) -> None:
        """Make sure that the file can grow to ``size`` bytes. Raises OSError where the disk has no room for it."""
        if size <= self._until or not hasattr(os, "posix_fallocate"):
            return
        handle = os.open(self.path, os.O_WRONLY)
        try:
            for wanted in (size + self.AHEAD, size):
                try:
                    os.posix_fallocate(handle, 0, wanted)
                except OSError as error:
                    if error.errno in (errno.EINVAL, errno.EOPNOTSUPP):  # a disk that cannot say
                        self._until = sys.maxsize
                        return
                    if wanted == size:
                        raise OSError(error.errno, error.strerror, str(self.path)) from None
                else:
                    self._until = wanted
                    return
        finally:
            os.close(handle)

    def give_back(self, size: int) -> None:
        """Cut the file to the ``size`` that was written."""
        self._until = 0
        with suppress(OSError):
            if self.path.stat().st_size > size:
                os.truncate(self.path, size)


def _made(folder: Path) -> list[Path]:
    """Make a folder and those above it; returns those that were not there, the innermost first."""
    missing: list[Path] = []
    try:
        for place in (folder, *folder.parents):
            if place.exists():
                break
            missing.append(place)
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make this folder: {_cannot(error)}", file=folder) from None
    return missing


def _take_back(folders: Iterable[Path]) -> None:
    """Remove folders that nothing was written to."""
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _try(folder: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder) as stream:
            stream.write(b"x" * 512)
            stream.flush()
    except OSError as error:
        raise InputError(f"cannot write to this folder: {_cannot(error)}", file=folder) from None


def try_folder(path: str | Path) -> Path:
    """Find out before the work whether a folder can be made and written to. Raises InputError; leaves nothing."""
    folder = Path(path)
    missing = _made(folder)
    try:
        _try(folder)
    finally:
        _take_back(missing)
    return folder


def try_file(path: str | Path) -> Path:
    """The same for a file to be written later, whose folder has to be there."""
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError("is a folder; a file was expected", file=path)
        if not path.parent.is_dir():
            raise InputError("its folder does not exist", file=path)
        os.lstat(path)
    except FileNotFoundError:
        pass
    except OSError as error:  # a name too long for the disk, say
        raise InputError(f"cannot write it: {_cannot(error)}", file=path) from None
    _try(path.parent)
    return path


@contextmanager
def claimed(path: str | Path) -> Iterator[Path]:
    """A folder that can be written to and that no other program writes to meanwhile.

    It is made, and taken back if nothing was written to it. Raises InputError where it cannot be made or written
    to, or where another program holds it.
    """
    folder = Path(path)
    missing = _made(folder)
    handle = -1
    try:
        _try(folder)
        if fcntl is not None:
            handle = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                    raise InputError("another program is writing to this folder", file=folder) from None
                # a disk without locks
        yield folder
    finally:
        if handle >= 0:
            os.close(handle)
        _take_back(missing)


def refuse_links(folder: Path, names: Iterable[str]) -> None:
    """Raise InputError where one of these is a link, or no file or folder at all: what it leads to is not ours."""
    for name in names:
        place = folder / name
        try:
            special = place.is_symlink() or (place.exists() and not (place.is_file() or place.is_dir()))
        except OSError as error:
            raise InputError(f"cannot look at it: {_cannot(error)}", file=place) from None
        if special:
            raise InputError("is a link or no ordinary file; nothing is written through it", file=place)
