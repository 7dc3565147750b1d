"""``diagnose``: recordings in, verdict and report out."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ..errors import InputError
from ..recording import Recording, read_recording, resolve_recording
from .driver import Diagnosis, check_kind, diagnose_bodies
from .verdict import write_verdict


class ProgressLine:
    """One line on stderr: what is being done, how far, how long it will take."""

    def __init__(self, stream=None) -> None:
        self.stream = stream or sys.stderr
        self.began = time.monotonic()
        self.terminal = self.stream.isatty()
        self.last = ""

    def __call__(self, text: str, share: float) -> None:
        spent = time.monotonic() - self.began
        left = spent * (1 - share) / share if share > 0.05 else None
        line = f"[{100 * share:3.0f} %] {text}, {spent:.0f} s" + (f", about {left:.0f} s left" if left else "")
        if self.terminal:
            end = "\n" if share >= 1 else ""
            self.stream.write("\r" + line.ljust(len(self.last)) + end)
            self.last = line
        elif text.split()[0] != self.last:
            self.stream.write(line + "\n")
            self.last = text.split()[0]
        self.stream.flush()


def diagnose(
    recordings: Sequence[str | Path | Recording],
    out: str | Path,
    *,
    hold_out: Sequence[str | Path | Recording] = (),
    minutes: float | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> Diagnosis:
    """Explain recordings together by one set of missing laws, and write it down.

    recordings, hold_out : Recording objects, folders, or names of shipped recordings
    out : folder for verdict.json, report.html, figures/, revised.toml
    minutes : time budget; seed : of the nulls. Raises InputError for recordings that cannot be used.
    """
    training = _read(recordings)
    held = _read(hold_out)
    names = {r.name for r in held}
    training = [r for r in training if r.name not in names]
    every = [r.name for r in (*training, *held)]
    if len(set(every)) != len(every):
        twice = next(n for n in every if every.count(n) > 1)
        raise InputError("two recordings have this name", where=twice)
    check_kind([*training, *held])
    out = Path(out)
    if out.exists() and not out.is_dir():
        raise InputError("is a file; --out should name a folder", file=out)
    diagnosis = diagnose_bodies(training, held, minutes=minutes, seed=seed, progress=progress or (lambda *a: None))
    out.mkdir(parents=True, exist_ok=True)
    write_verdict(diagnosis, out)
    from ..report.page import write_report

    write_report(diagnosis, out)
    return diagnosis


def _read(items: Sequence[str | Path | Recording]) -> list[Recording]:
    result: list[Recording] = []
    for item in items:
        if isinstance(item, Recording):
            result.append(item)
        else:
            result += [read_recording(folder) for folder in resolve_recording(item)]
    return result
