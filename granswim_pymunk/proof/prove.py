"""Conceal, diagnose in a process of its own, open the seals, score: one file per case, resumed where it stopped."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from .conceal import conceal, write_beside
from .real_score import PREFIX, RealRow, real_told, score_real
from .score import Row, score_case
from .seal import opened

# seeds below this are development seeds: anybody may draw them, with a secret that is no secret
FIRST_SCORED = 1000
DEVELOPMENT_SECRET = b"the secret of the development seeds"
LONGEST = 7200.0  # s, after which a diagnosis has failed
# exit codes of a diagnosis that somebody ended, as the command says it and as the system does
STOPPED = {code for number in (signal.SIGINT, signal.SIGTERM) for code in (128 + number, -number)}
REAL = ("pendulum", "falling_balls", "two_disk_spin")
# development cases, small, and of every sort; the mix of the full form, 36 full seen beds among them
QUICK = tuple(("bodies", seed) for seed in (6, 14, 25, 34, 37))
QUICK_REAL = tuple(("real-life", seed) for seed in (1, 4, 6, 18, 24))
FULL = {
    "bodies": range(3511, 3711),
    "bed": range(1070, 1106),
    "small-bed": range(1001, 1051),
    "unseen": range(1003, 1015),
    "small-unseen": range(1078, 1126),
    "curve": range(1000, 1004),
    "small-curve": range(1006, 1022),
}
# under real-life conditions: three in ten of the bodies are nulls
FULL_REAL = {"real-life": range(4213, 4383), "real-life-bed": range(1027, 1036)}

_RUNNING: set[subprocess.Popen[str]] = set()  # diagnoses under way
_GONE = threading.Event()  # nobody waits for them any more, nor for those that are begun after it


@dataclass(frozen=True)
class Task:
    """One case to be made, diagnosed and scored; plain, so that any executor can carry it."""

    seed: int
    kind: str
    out: str
    secret: bytes
    minutes: float | None = None

    @property
    def name(self) -> str:
        return f"{self.kind}-{self.seed}"

    @property
    def result(self) -> Path:
        return Path(self.out) / "results" / f"{self.name}.json"


def diagnose_alone(recordings: Sequence[str | Path], keep: Path | None, minutes: float | None = None) -> dict[str, Any]:
    """Run ``granswim diagnose`` in another process, in an empty folder that holds copies of the recordings only.

    Names of shipped recordings are passed on as they are. ``keep``: where verdict and report are left.
    Returns verdict (or None), seconds, failed (a reason, or empty). Raises InputError where it was stopped.
    """
    with tempfile.TemporaryDirectory(prefix="granswim-") as folder:
        given = []
        for source in recordings:
            if isinstance(source, Path):
                shutil.copytree(source, Path(folder) / source.name)
                given.append(source.name)
            else:
                given.append(source)
        command = [sys.executable, "-m", "granswim_pymunk.cli", "diagnose", *given, "--out", "out", "--seed", "0"]
        if minutes is not None:
            command += ["--minutes", str(minutes)]
        environment = {k: v for k, v in os.environ.items() if not k.startswith("GRANSWIM_") or k == "GRANSWIM_CACHE"}
        began = time.monotonic()
        failed, verdict = "", None
        try:
            code, said = _run(command, folder, environment)
            if code in STOPPED:  # no result: it is begun again another time
                raise InputError("the diagnosis was stopped; the same command goes on with it", where=given[0])
            if code:
                failed = (said.strip().splitlines() or ["?"])[-1][:300]
        except subprocess.TimeoutExpired:
            failed = f"not done after {LONGEST:.0f} s"
        seconds = time.monotonic() - began
        out = Path(folder) / "out"
        if not failed and (out / "verdict.json").exists():
            verdict = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
        elif not failed:
            failed = "no verdict was written"
        if keep is not None and out.exists():
            keep.mkdir(parents=True, exist_ok=True)
            for name in ("verdict.json", "report.html", "revised.toml"):
                if (out / name).exists():
                    shutil.copy(out / name, keep / name)
        return {"verdict": verdict, "seconds": seconds, "failed": failed}


def _run(command: Sequence[str], folder: str, environment: Mapping[str, str]) -> tuple[int, str]:
    """Exit code of a command and what it said on stderr. Raises TimeoutExpired after ``LONGEST``."""
    how: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=folder, env=environment, **how) as process:
        _RUNNING.add(process)
        if _GONE.is_set():
            process.terminate()
        try:
            said = process.communicate(timeout=LONGEST)[1]
            return process.returncode, said
        except BaseException:
            process.kill()
            raise
        finally:
            _RUNNING.discard(process)


def run_task(task: Task) -> str:
    """Do one case, unless its result lies there already: conceal, diagnose, only then open the seal. Its name."""
    if task.result.exists():
        return task.name
    out = Path(task.out)
    recording, sealed = out / "recordings" / task.name, out / "sealed"
    if not recording.exists() or not (sealed / f"{task.name}.json").exists():
        # what an interrupted run left behind is drawn again, alike
        shutil.rmtree(recording, ignore_errors=True)
        (sealed / f"{task.name}.json").unlink(missing_ok=True)
        conceal(task.seed, out / "recordings", task.secret, sealed, kind=task.kind)
    answer = diagnose_alone([recording], out / "reports" / task.name, task.minutes)
    published = (out / "recordings" / f"{task.name}.sha256").read_text(encoding="utf-8")
    truth = opened(json.loads((sealed / f"{task.name}.json").read_text(encoding="utf-8")), published)
    result = {"case": task.name, "commitment": published.strip(), "truth": truth, **answer}
    write_beside(task.result, json.dumps(result, indent=1) + "\n")
    return task.name


def prove_cases(
    cases: Sequence[tuple[str, int]],
    out: str | Path,
    *,
    secret: bytes | None = None,
    minutes: float | None = None,
    workers: int = 1,
    executor: Any = None,
    real: bool = False,
    progress: Callable[[str, int, int], None] = lambda *a: None,
) -> list[Row]:
    """Score cases (kind, seed); results of earlier runs in ``out`` are kept, and counted with them.

    Seeds below 1000 are development seeds and use the public secret; others need ``secret``.
    executor : anything with ``submit`` (concurrent.futures, dask.distributed.Client); else ``workers`` threads, each
        of which waits for a process.  real : also diagnose the shipped real recordings
    Writes results/, reports/, score.csv and proof.html. Raises InputError without a secret for scored seeds.
    """
    out = Path(out)
    if len(set(cases)) != len(cases):
        raise InputError("a seed is scored once, but one was given twice", where="--seeds")
    if secret is None and any(s >= FIRST_SCORED for _, s in cases):
        raise InputError(f"seeds of {FIRST_SCORED} and more need a secret", where="--secret")
    tasks = [
        Task(s, kind, str(out.resolve()), DEVELOPMENT_SECRET if s < FIRST_SCORED else secret or b"", minutes)
        for kind, s in cases
    ]
    _GONE.clear()
    own = ThreadPoolExecutor(max(workers, 1)) if executor is None else None
    pool: Any = executor or own
    try:
        waiting = [pool.submit(run_task, task) for task in tasks]
        if own is not None:
            for n, future in enumerate(as_completed(waiting)):
                progress(future.result(), n + 1, len(tasks))
        else:
            for n, future in enumerate(waiting):
                progress(future.result(), n + 1, len(tasks))
    except BaseException:
        _GONE.set()
        for process in tuple(_RUNNING):
            process.terminate()
        raise
    finally:
        if own is not None:
            own.shutdown(wait=True, cancel_futures=True)
    if real:
        for n, name in enumerate(REAL):
            file = out / "real" / f"{name}.json"
            if not file.exists():
                write_beside(file, json.dumps(diagnose_alone([name], out / "reports" / name), indent=1) + "\n")
            progress(name, n + 1, len(REAL))
    return write_score(out)


def full_cases(kind: str | None = None, real_life: bool = False) -> list[tuple[str, int]]:
    """The cases of the full form, all or those of one kind: the quick kinds first."""
    if real_life:
        return [(k, seed) for k, seeds in FULL_REAL.items() if kind in (None, k) for seed in seeds]
    order = ("bodies", "small-curve", "small-unseen", "small-bed", "bed", "curve", "unseen")
    return [(k, seed) for k in order if kind in (None, k) for seed in FULL[k]]


def sliced(cases: Sequence[tuple[str, int]], part: int, parts: int) -> list[tuple[str, int]]:
    """The ``part``-th of ``parts`` slices, counted from one: of every kind as many, in rising order.

    Raises InputError where there is no such slice.
    """
    if not 1 <= part <= parts:
        raise InputError(f"expected k/n with k from 1 to n, got {part}/{parts}", where="--slice")
    kinds = dict.fromkeys(kind for kind, _ in cases)
    result = []
    for kind in kinds:
        mine = [case for case in cases if case[0] == kind]
        result += mine[len(mine) * (part - 1) // parts : len(mine) * part // parts]
    return result


def claim(out: str | Path, series: int, commit: str) -> None:
    """Write into ``out`` which series lies there, scored with which commit.

    Raises InputError where it is another: a series is gone on with from a checkout of its commit.
    """
    file = Path(out) / "series.json"
    mine = {"series": series, "commit": commit}
    if file.exists():
        there = json.loads(file.read_text(encoding="utf-8"))
        if there != mine:
            raise InputError(
                f"holds series {there['series']} of commit {there['commit']}, not {series} of {commit}", file=file
            )
    else:
        write_beside(file, json.dumps(mine, indent=1) + "\n")


def slice_table(out: str | Path, cases: Sequence[tuple[str, int]], part: int, parts: int) -> Path:
    """slice-K-of-N.csv in ``out``: the rows of a slice's cases that are done."""
    out = Path(out)
    names = {f"{kind}-{seed}" for kind, seed in cases}
    results = [r for r in read_results(out) if r["case"] in names]
    real = [score_real(r) for r in results if is_real(r)]
    file = out / f"slice-{part}-of-{parts}.csv"
    write_beside(file, table_text(real) if real else table_text([score_case(r) for r in results]))
    return file


def is_real(result: dict[str, Any]) -> bool:
    return str(result["case"]).startswith(PREFIX)


def real_rows(out: str | Path) -> list[RealRow]:
    """The scored real-life cases of a folder."""
    return [score_real(result) for result in read_results(Path(out)) if is_real(result)]


def read_results(out: Path) -> list[dict[str, Any]]:
    """All results of a folder, by kind and seed."""
    named = [(f.stem.rpartition("-"), f) for f in (out / "results").glob("*.json")]
    files = [f for _, f in sorted(named, key=lambda item: (item[0][0], int(item[0][2])))]
    return [json.loads(file.read_text(encoding="utf-8")) for file in files]


def write_score(out: str | Path) -> list[Row]:
    """score.csv and proof.html from all results in ``out``; the rows.

    Real-life cases have a table and figures of their own: real-life.csv, real-life.txt.
    """
    from .page import write_page

    out = Path(out)
    conditions = real_rows(out)
    if conditions:
        write_beside(out / "real-life.csv", table_text(conditions))
        write_beside(out / "real-life.txt", "\n".join(real_told(conditions)) + "\n")
    results = [result for result in read_results(out) if not is_real(result)]
    if conditions and not results:
        return []
    rows = [score_case(result) for result in results]
    real = {f.stem: json.loads(f.read_text(encoding="utf-8")) for f in sorted((out / "real").glob("*.json"))}
    write_beside(out / "score.csv", table_text(rows))
    write_page(rows, results, real, out / "proof.html")
    return rows


def table_text(rows: Sequence[Row] | Sequence[RealRow]) -> str:
    """The rows as CSV."""
    if not rows:
        return ""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0].as_dict()), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(row.as_dict())
    return text.getvalue()
