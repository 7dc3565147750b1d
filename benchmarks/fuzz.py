"""``python -m granswim_pymunk.benchmarks.fuzz [N] [SEED]``: nonsense for the reader of recordings.

Good recordings are cut off, shuffled, given bytes that are no UTF-8, numbers that are huge, tiny or none, keys and rows
twice or not at all, and long lines. Each must be read or refused with an InputError of one line: never another error,
never a hang.
"""

from __future__ import annotations

import functools
import importlib
import shutil
import sys
import tempfile
import time
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import read_recording

Files = dict[str, bytes]

VALUES = (
    b"nan", b"inf", b"-inf", b"1e999", b"-1e308", b"1e-320", b"0", b"-0.0", b"", b"''", b"true", b"[]", b"{}",
    b"1e5000", b"9" * 400, b"0x1F", b"1_000", b"12:30", b"\xff\xfe", b"\xc3\x28", b"\x00", "½".encode(),
    b"[[body]]", b"\"", b"#",
    b"1979-05-27", b"\"a\\nb\"", b"-1", b"1e300", b"[1, 2", b"../../etc/passwd", b"'''",
)  # fmt: skip


@dataclass
class Found:
    """What came of it: ``failures`` holds (case, error) for all that is neither read nor refused."""

    tried: int = 0
    read: int = 0
    refused: int = 0
    slowest: float = 0.0  # s
    failures: list[tuple[int, str]] = field(default_factory=list)


@functools.cache
def seeds() -> tuple[Files, ...]:
    """The small recordings that come with the package, their tables cut to 40 rows."""
    root = importlib.import_module("granswim_pymunk.recordings").__path__
    found = []
    for toml in sorted(p for folder in root for p in Path(folder).rglob("recording.toml")):
        files = {p.name: p.read_bytes() for p in sorted(toml.parent.iterdir()) if p.is_file()}
        if sum(len(f) for f in files.values()) > 300_000:
            continue
        found.append(_shortened(files))
    return tuple(found)


def _shortened(files: Files, rows: int = 40) -> Files:
    return {
        name: b"".join(content.splitlines(keepends=True)[: rows + 1]) if name == "tracks.csv" else content
        for name, content in files.items()
    }


def nonsense(rng: np.random.Generator) -> Files:
    """A recording with one to three things wrong with it."""
    kept = seeds()
    files = dict(kept[int(rng.integers(len(kept)))])
    for _ in range(int(rng.integers(1, 4))):
        if not files:
            break
        name = sorted(files)[int(rng.integers(len(files)))]
        files[name] = _spoil(files[name], rng)
        if rng.random() < 0.03:
            del files[name]
    return files


def _spoil(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    at = int(rng.integers(max(len(lines), 1)))
    value = VALUES[int(rng.integers(len(VALUES)))]
    kind = int(rng.integers(11))
    if kind == 0:
        return content[: int(rng.integers(len(content) + 1))]
    if kind == 1:
        return b"".join(lines[k] for k in rng.permutation(len(lines)))
    if kind == 2 and content:
        spoilt = bytearray(content)
        for k in rng.integers(len(spoilt), size=int(rng.integers(1, 20))):
            spoilt[k] = int(rng.integers(256))
        return bytes(spoilt)
    if kind in (3, 4, 5) and lines:
        mark = b"," if b"," in lines[at] and b"=" not in lines[at] else b"="
        parts = lines[at].split(mark)
        parts[int(rng.integers(len(parts)))] = value
        lines[at] = mark.join(parts).rstrip(b"\r\n") + b"\n"
        return b"".join(lines)
    if kind == 6 and lines:
        return b"".join(lines[:at] + lines[at : at + 1] * int(rng.integers(2, 50)) + lines[at:])
    if kind == 7 and lines:
        return b"".join(lines[:at] + lines[at + 1 :])
    if kind == 8:
        return content + value * int(rng.integers(1, 20_000))
    if kind == 9:
        return rng.bytes(int(rng.integers(2000)))
    return b"\xef\xbb\xbf" + content.replace(b"\n", b"\r" if rng.random() < 0.5 else b"\r\n")


def fuzz(count: int, folder: str | Path, seed: int = 0, show: bool = False) -> Found:
    """Read ``count`` pieces of nonsense, each from a folder of its own below ``folder``."""
    rng = np.random.default_rng(seed)
    found = Found()
    place = Path(folder) / "recording"
    for case in range(count):
        files = nonsense(rng)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for name, content in files.items():
            (place / name).write_bytes(content)
        begin = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                read_recording(place)
            found.read += 1
        except InputError as error:
            if "\n" in str(error):
                found.failures.append((case, f"more than one line: {error}"))
            found.refused += 1
        except Exception as error:  # this is what is looked for
            found.failures.append((case, f"{type(error).__name__}: {error}"))
        found.tried += 1
        found.slowest = max(found.slowest, time.perf_counter() - begin)
        if show and found.tried % 1000 == 0:
            what = f"{found.refused} refused, {found.read} read, {len(found.failures)} failures"
            print(f"{found.tried}: {what}", flush=True)
    return found


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as own:
        result = fuzz(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000, own, *map(int, sys.argv[2:3]), show=True)
    print(f"slowest {result.slowest:.2f} s; failures: {result.failures[:5] or 'none'}")
    sys.exit(bool(result.failures))
