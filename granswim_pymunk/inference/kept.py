"""Finished simulations kept on disk by the hash of what they are of, so that an interrupted diagnosis goes on."""

from __future__ import annotations

import hashlib
import json
import logging
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from ..files import written_whole
from ..storage import cache_folder

log = logging.getLogger("granswim")

CODE = "4"  # part of every key: a new number forgets what older code computed


def load_array(file: Path, shape: tuple[int, ...] | None = None) -> np.ndarray | None:
    """The array in a file, None where it is missing, damaged, of another shape or without any finite number."""
    try:
        found: np.ndarray = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    return None if (shape is not None and found.shape != shape) or not np.isfinite(found).any() else found


def store_array(file: Path, values: np.ndarray) -> None:
    """Write beside, then rename; a disk that takes nothing is a warning."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(file, mode=0o600) as stream:
            np.save(stream, values)
    except OSError as error:
        log.warning("a finished run is not kept: %s", error)


class Store:
    """Arrays of one diagnosis. ``name``: what tells it from others. Forgotten as a whole when it has its verdict."""

    def __init__(self, *name: Any) -> None:
        self.folder = cache_folder() / "diagnoses" / digest([CODE, *name])

    def get(self, key: str, shape: tuple[int, ...] | None = None) -> np.ndarray | None:
        return load_array(self.folder / f"{key}.npy", shape)

    def put(self, key: str, values: np.ndarray) -> None:
        store_array(self.folder / f"{key}.npy", values)

    def forget(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


def digest(parts: Any) -> str:
    """SHA-256 of anything that JSON can hold; arrays by their bytes."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            raw = np.ascontiguousarray(value).tobytes()
            return [str(value.dtype), list(value.shape), hashlib.sha256(raw).hexdigest()]
        if isinstance(value, np.generic):
            return value.item()
        return str(value)

    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=plain).encode()).hexdigest()[:40]
