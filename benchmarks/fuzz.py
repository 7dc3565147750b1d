"""``python -m granswim_pymunk.benchmarks.fuzz [N] [SEED] [--kinds K ...] [--case K] [--whole N] [--json FILE]``.

Nonsense for every door of the program: recordings, scenes, foreign tables, options of the commands, beds of another
code, checkpoints. Good files are cut off, shuffled, given bytes that are no UTF-8, numbers that are huge, tiny or none,
keys and rows twice or not at all. Each must be taken or refused with an error of one line: never another error, never
more than LONGEST seconds, never more than MOST_MEMORY. N cases run in this process, each up to the plan of its work;
``--whole N`` runs whole diagnoses of spoilt recordings, each in a process of its own.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import math
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from granswim_pymunk.benchmarks.fuzz_inputs import KINDS, nonsense, seeds, spoil_some, write
from granswim_pymunk.errors import InputError, SimulationError

LONGEST = 10.0  # s of computing for one case; six times as much on the clock, as the machine may be busy
MOST_MEMORY = 2e9  # bytes, of the process with everything that it has imported
MOST_PACKED = 300  # grains that are packed here; more is work, not a plan

__all__ = ["Found", "fuzz", "nonsense", "seeds", "whole"]


@dataclass
class Found:
    """What came of it: ``failures`` holds (case, kind and error) for all that is neither taken nor refused."""

    tried: int = 0
    read: int = 0
    refused: int = 0
    slowest: float = 0.0  # s of computing
    failures: list[tuple[int, str]] = field(default_factory=list)
    kinds: dict[str, dict[str, int]] = field(default_factory=dict)
    memory: float = 0.0  # bytes, the most that the process had

    def count(self, kind: str, what: str) -> None:
        self.kinds.setdefault(kind, {"read": 0, "refused": 0, "failed": 0})[what] += 1


class Planned(BaseException):
    """The work was planned: here it would begin."""


class TooLong(BaseException):
    """A case has taken its time."""


@contextlib.contextmanager
def up_to_the_plan() -> Iterator[None]:
    """Commands stop where their work begins: the first step, the first diagnosis, the first case."""
    from granswim_pymunk import packing, run, sweep
    from granswim_pymunk.benchmarks import speed
    from granswim_pymunk.limits import MOST_BODIES
    from granswim_pymunk.validation import crosscheck

    # the package has functions of these names
    diagnose = importlib.import_module("granswim_pymunk.inference.entry")
    conceal = importlib.import_module("granswim_pymunk.proof.conceal")
    prove = importlib.import_module("granswim_pymunk.proof.prove")

    def begin(*args: Any, **more: Any) -> Any:
        raise Planned

    make = packing._make

    def little(scene: Any, *more: Any) -> Any:
        bed = scene.bed
        area = math.pi / 4 * float(np.mean(bed.grain_diameter)) ** 2
        grains = (scene.periodic_x or 0.0) * bed.height * bed.packing_fraction / area
        if MOST_PACKED < grains <= MOST_BODIES:
            raise Planned
        return make(scene, *more)

    with contextlib.ExitStack() as stack:
        for owner, name, stub in (
            (run._Run, "go", begin), (sweep, "run_jobs", begin), (packing, "_make", little),
            (diagnose, "diagnose_together", begin), (prove, "prove_cases", begin), (crosscheck, "crosscheck", begin),
            (speed, "benchmark", begin),
        ):  # fmt: skip
            stack.enter_context(mock.patch.object(owner, name, stub))
        stack.enter_context(mock.patch.dict(diagnose.METHODS, dict.fromkeys(diagnose.METHODS, begin)))
        stack.enter_context(mock.patch.dict(conceal.KINDS, dict.fromkeys(conceal.KINDS, begin)))
        yield


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TooLong after so many seconds, where the system has such an alarm."""

    def ring(*args: Any) -> None:
        raise TooLong

    try:
        alarms = {signal.SIGALRM: (signal.ITIMER_REAL, 6 * seconds), signal.SIGPROF: (signal.ITIMER_PROF, seconds)}
        before = {number: signal.signal(number, ring) for number in alarms}
    except (AttributeError, ValueError):  # Windows; not the main thread
        yield
        return
    for timer, after in alarms.values():
        signal.setitimer(timer, after)
    try:
        yield
    finally:
        for number, (timer, _) in alarms.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])


def fuzz(
    count: int,
    folder: str | Path,
    seed: int = 0,
    show: bool = False,
    kinds: Sequence[str] = ("recording",),
    first: int = 0,
) -> Found:
    """Try ``count`` pieces of nonsense of these kinds in turn, each below ``folder``; a case can be tried alone.

    Case k is the same for a seed whatever ran before it.
    """
    found = Found()
    place = Path(folder) / "case"
    with up_to_the_plan():
        for case in range(first, first + count):
            kind = kinds[case % len(kinds)]
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir(parents=True)
            act = KINDS[kind](np.random.default_rng([seed, case]), place)
            begin = time.process_time()
            failure = _try(act)
            spent = time.process_time() - begin
            found.tried += 1
            found.slowest = max(found.slowest, spent)
            if failure is None:
                found.read += 1
            elif failure == "":
                found.refused += 1
            else:
                found.failures.append((case, f"{kind}: {failure}"))
                if show:
                    print(f"case {case}, {kind}: {failure}", flush=True)
            found.count(kind, "read" if failure is None else "failed" if failure else "refused")
            if show and found.tried % 1000 == 0:
                what = f"{found.refused} refused, {found.read} taken, {len(found.failures)} failures"
                print(f"{found.tried}: {what}", flush=True)
    shutil.rmtree(place, ignore_errors=True)
    found.memory = _peak()
    if found.memory > MOST_MEMORY:
        found.failures.append((-1, f"the process had {found.memory / 1e9:.1f} GB"))
    return found


def _try(act: Any) -> str | None:
    """None: taken; empty: refused in one line; otherwise what is wrong."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), limited(LONGEST):
            warnings.simplefilter("ignore")
            act()
    except Planned:
        return None
    except (InputError, SimulationError) as error:
        return f"more than one line: {error}" if "\n" in str(error) else ""
    except TooLong:
        return f"longer than {LONGEST:g} s"
    except MemoryError:
        return "no memory left"
    except Exception as error:  # this is what is looked for
        return f"{type(error).__name__}: {' '.join(str(error).split())[:160]} ({_place(error)})"
    return None


def _place(error: Exception) -> str:
    """File and line of the program that an error came through last."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if not {"site-packages", "lib"} & set(Path(f.filename).parts)] or frames
    return f"{Path(own[-1].filename).name}:{own[-1].lineno}"


def _peak() -> float:
    """The most memory that this process has had [bytes]."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(most) * (1 if sys.platform == "darwin" else 1024)


def whole(count: int, folder: str | Path, seed: int = 0, minutes: float = 0.1, show: bool = False) -> Found:
    """Whole diagnoses of recordings with a few spoilt numbers, each a process of its own: exit code 0 or one line."""
    found = Found()
    place = Path(folder) / "whole"
    readable = [s for s in seeds() if sum(map(len, s.values())) < 100_000]
    for case in range(count):
        rng = np.random.default_rng([seed, case, 1])
        shutil.rmtree(place, ignore_errors=True)
        write(spoil_some(readable[int(rng.integers(len(readable)))], rng), place / "recording")
        argv = [sys.executable, "-m", "granswim_pymunk", "diagnose", str(place / "recording")]
        argv += ["--out", str(place / "out"), f"--minutes={minutes}"]
        begin = time.perf_counter()
        failure = ""
        try:
            done = subprocess.run(argv, capture_output=True, text=True, timeout=60 * minutes + 120, errors="replace")
            lines = [line for line in done.stderr.splitlines() if line.startswith("granswim diagnose: ")]
            if "Traceback" in done.stderr:
                failure = done.stderr.strip().splitlines()[-1]
            elif done.returncode and len(lines) != 1:
                failure = f"exit code {done.returncode}, {len(lines)} lines that say why"
            elif not done.returncode and not (place / "out" / "verdict.json").exists():
                failure = "exit code 0 without a verdict"
            found.refused += bool(done.returncode)
            found.read += not done.returncode
        except subprocess.TimeoutExpired:
            failure = f"longer than {60 * minutes + 120:g} s"
        found.tried += 1
        found.slowest = max(found.slowest, time.perf_counter() - begin)
        if failure:
            found.failures.append((case, failure))
            if show:
                print(f"diagnosis {case}: {failure}", flush=True)
    shutil.rmtree(place, ignore_errors=True)
    found.memory = float(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) * 1024
    return found


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=10_000)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--kinds", nargs="+", choices=tuple(KINDS), default=tuple(KINDS))
    parser.add_argument("--first", type=int, default=0, metavar="K", help="begin with case K (slices; one case alone)")
    parser.add_argument("--whole", type=int, default=0, metavar="N", help="whole diagnoses, instead")
    parser.add_argument("--json", type=Path, metavar="FILE")
    args = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as own:
        if args.whole:
            result = whole(args.whole, own, args.seed, show=True)
        else:
            result = fuzz(args.count, own, args.seed, show=True, kinds=args.kinds, first=args.first)
    for kind, counts in result.kinds.items():
        print(f"{kind}: " + ", ".join(f"{value} {name}" for name, value in counts.items()))
    print(f"{result.tried} tried, {result.read} taken, {result.refused} refused, slowest {result.slowest:.2f} s, "
          f"{result.memory / 1e9:.2f} GB; failures: {len(result.failures)}")  # fmt: skip
    if args.json:
        args.json.write_text(json.dumps(asdict(result), indent=1) + "\n", encoding="utf-8")
    return bool(result.failures)


if __name__ == "__main__":
    sys.exit(main())
