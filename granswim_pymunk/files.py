"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def written_whole(path: str | Path, mode: int = 0o644) -> Iterator[BinaryIO]:
    """A stream to a file beside ``path`` that is renamed to it at the end, or removed if anything is raised.

    The folder has to be there. Raises OSError where it cannot be written to.
    """
    path = Path(path)
    handle, beside = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
        os.chmod(beside, mode)
        os.replace(beside, path)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise
