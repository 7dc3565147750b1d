"""What is kept between runs, and where: beds, runs of diagnoses, machine code.

All of it lies in one folder of the user's own: GRANSWIM_CACHE, else the user's cache. A folder that belongs to
somebody else, or that others can write to, is not used: code would be loaded from it. Everything in it can be made
again, so it may be removed at any time (``granswim cache --clear``).
"""

from __future__ import annotations

import atexit
import functools
import logging
import os
import shutil
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

import platformdirs

log = logging.getLogger("granswim")

# folder under the cache: what is kept there
KINDS = {
    "compiled": "machine code of laws and engine",
    "beds": "packed beds",
    "runs": "runs that several diagnoses share",
    "diagnoses": "unfinished diagnoses",
    "kernels": "machine code of earlier versions",
}


def _refusal(folder: Path) -> str:
    """Why a folder is not fit to be written to and loaded from, empty where it is. It is made if it is not there."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = os.stat(folder)
        if hasattr(os, "geteuid"):
            if found.st_uid != os.geteuid():
                return "it belongs to another user"
            if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                return "others can write to it"
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return error.strerror or str(error)
    return ""


@functools.cache
def _for_this_process(wanted: str, why: str) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="granswim-"))  # nobody else can enter it
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    log.warning("the cache %s is not used: %s; what is compiled and packed is kept for this run only", wanted, why)
    return folder


@functools.lru_cache(maxsize=8)
def _checked(wanted: str, process: int) -> Path:
    why = _refusal(Path(wanted))
    return _for_this_process(wanted, why) if why else Path(wanted)


def cache_folder() -> Path:
    """Where things are kept: GRANSWIM_CACHE, else the user's cache; a private folder of this process if it cannot be.

    That is said once. Raises OSError where not even a temporary folder can be made.
    """
    wanted = os.environ.get("GRANSWIM_CACHE") or platformdirs.user_cache_dir("granswim_pymunk")
    return _checked(os.path.abspath(wanted), os.getpid())


@functools.lru_cache(maxsize=8)
def _code_folder(root: Path) -> Path | None:
    folder = root / "compiled"
    why = _refusal(folder)
    if not why and stat.S_IMODE(os.stat(folder).st_mode) & 0o077 and hasattr(os, "geteuid"):
        why = "others can look into it"
    if why:
        log.warning("no machine code is loaded from %s: %s; compiling anew", folder, why)
    return None if why else folder


def code_folder() -> Path | None:
    """Where machine code is kept: only this user can write to it or read it; None where there is no such place."""
    try:
        return _code_folder(cache_folder())
    except OSError as error:
        log.warning("machine code is not kept: %s", error.strerror)
        return None


@dataclass(frozen=True)
class Kept:
    """One kind of what is kept: its folder's name, what it is, number of files, their size [bytes]."""

    name: str
    what: str
    files: int
    size: int


def what_is_kept() -> list[Kept]:
    """Everything in the cache, one line a kind; kinds without files are left out."""
    found = []
    for name, what in KINDS.items():
        files = [p for p in (cache_folder() / name).rglob("*") if p.is_file() and not p.is_symlink()]
        if files:
            found.append(Kept(name, what, len(files), sum(p.stat().st_size for p in files)))
    return found


def clear(*names: str) -> list[Kept]:
    """Remove these kinds, or all; returns what was there. Links are not followed. Raises OSError."""
    found = [kept for kept in what_is_kept() if not names or kept.name in names]
    for kept in found:
        folder = cache_folder() / kept.name
        if folder.is_symlink():
            folder.unlink()
        else:
            shutil.rmtree(folder)
    _code_folder.cache_clear()
    return found


__all__ = ["KINDS", "Kept", "cache_folder", "clear", "code_folder", "what_is_kept"]
