"""Files appear whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from granswim_pymunk.errors import InputError
from granswim_pymunk.files import try_file


def check_folder(path: str | Path | None) -> None:
    """Raise InputError, before a long run, where a file could not be written."""
    if path is not None:
        try_file(path)


def write_json(data: Any, path: str | Path) -> None:
    """Write ``data`` as JSON, beside and then renamed. Raises InputError where that cannot be done."""
    path = Path(path)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise InputError(f"cannot write it: {error.strerror}", file=path) from None
