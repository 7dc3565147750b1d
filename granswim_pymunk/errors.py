"""Errors that are shown to a person: one clear line, no traceback, exit code 2."""

from __future__ import annotations

from pathlib import Path


class InputError(ValueError):
    """Something the user gave is wrong.

    Parameters
    ----------
    message : what is wrong and what was expected
    file : the file it stands in, if any
    where : row, key, body or parameter
    """

    def __init__(self, message: str, *, file: str | Path | None = None, where: str | None = None) -> None:
        # what is quoted from a file may hold line breaks; an error is one line
        message = " ".join(str(message).split())
        self.message = message
        self.file = None if file is None else "".join(c if c.isprintable() else "?" for c in str(file))
        self.where = where = None if where is None else " ".join(str(where).split())
        super().__init__(": ".join(part for part in (self.file, where, message) if part))


class SimulationError(RuntimeError):
    """A run could not go on (a body escaped, a number is not finite, a list overflowed)."""


class BodyLost(SimulationError):
    """A body went astray: its position is not finite, or absurdly far away."""


class Terminated(KeyboardInterrupt):
    """The program was asked to end (SIGTERM): it ends as after Ctrl-C, with another exit code."""
