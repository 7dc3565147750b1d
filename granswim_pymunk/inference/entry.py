"""``diagnose``: recordings in, verdict and report out."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

from threadpoolctl import threadpool_limits

from ..errors import InputError
from ..files import claimed
from ..recording import Recording, read_recording, resolve_recording
from .criteria import Criteria, current, using
from .packings import diagnose_unseen
from .result import Diagnosis
from .together import diagnose_together
from .tracks import diagnose_tracks
from .windows import diagnose_bed

# how recordings are compared: each method takes (training, held out, minutes=, seed=, progress=)
METHODS: dict[str, Callable[..., Diagnosis]] = {
    "bodies": diagnose_tracks,
    "bed": diagnose_bed,
    "unseen": diagnose_unseen,
}


def kind_of(recording: Recording) -> str:
    """How a recording is compared with simulations.

    "bodies": whole tracks;  "bed": short windows, where a swimmer and its grains are seen;
    "unseen": statistics over packings, where the grains are not seen or there are only curves.
    """
    scene = recording.scene
    grains = [b for b in scene.bodies if b.role == "grain"]
    if not len(recording.t) or (scene.bed is not None and not grains):
        return "unseen"
    if scene.chains and grains:
        return "bed" if any(b.observed for b in grains) else "unseen"
    return "bodies"


def grouped(
    training: Sequence[Recording], held: Sequence[Recording]
) -> dict[str, tuple[list[Recording], list[Recording]]]:
    """Kind to (training, held out)."""
    groups: dict[str, tuple[list[Recording], list[Recording]]] = {}
    for part, recordings in enumerate((training, held)):
        for recording in recordings:
            groups.setdefault(kind_of(recording), ([], []))[part].append(recording)
    return groups


class ProgressLine:
    """One line on stderr: what is being done, how far, how long it will take; what is done again goes no step back."""

    def __init__(self, stream=None) -> None:
        self.stream = stream or sys.stderr
        self.began = time.monotonic()
        self.terminal = self.stream.isatty()
        self.last = ""
        self.share = 0.0

    def __call__(self, text: str, share: float) -> None:
        share = self.share = max(share, self.share)
        spent = time.monotonic() - self.began
        left = spent * (1 - share) / share if share > current().budget.foretold else None
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
    out: str | Path | None = None,
    *,
    hold_out: Sequence[str | Path | Recording] = (),
    minutes: float | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
    criteria: Criteria | None = None,
) -> Diagnosis:
    """Explain recordings together by one set of missing laws, and write it down where a folder is given.

    recordings, hold_out : Recording objects, folders, or names of shipped recordings
    out : folder for verdict.json, report.html, figures/, revised.toml; None: nothing is written
    minutes : time budget; seed : of the nulls;  criteria : what decides, where it is not as usual
    Recordings of different kinds are explained together, see ``together``.
    Raises InputError for recordings that cannot be used.
    """
    training = _read(recordings)
    held = _read(hold_out)
    names = {r.name for r in held}
    training = [r for r in training if r.name not in names]
    every = [r.name for r in (*training, *held)]
    if len(set(every)) != len(every):
        twice = next(n for n in every if every.count(n) > 1)
        raise InputError("two recordings have this name", where=twice)
    groups = grouped(training, held)
    tell = progress or (lambda text, share: None)
    # the folder is tried before the search, not after it; matrices are small, and threads of BLAS wait for each other
    folder = nullcontext() if out is None else claimed(out)
    with using(criteria), threadpool_limits(limits=1, user_api="blas"), folder:
        if len(groups) > 1:
            diagnosis = diagnose_together(groups, METHODS, minutes=minutes, seed=seed, progress=tell)
        else:
            method = METHODS[next(iter(groups), "bodies")]
            diagnosis = method(training, held, minutes=minutes, seed=seed, progress=tell)
        if out is not None:
            from ..report import write_diagnosis

            write_diagnosis(diagnosis, Path(out))
    return diagnosis


def _read(items: Sequence[str | Path | Recording]) -> list[Recording]:
    result: list[Recording] = []
    for item in items:
        if isinstance(item, Recording):
            result.append(item)
        else:
            result += [read_recording(folder) for folder in resolve_recording(item)]
    return result
