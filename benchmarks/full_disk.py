"""``python -m granswim_pymunk.benchmarks.full_disk [--json FILE]``: commands on a disk that takes no more.

No file may grow beyond a limit (RLIMIT_FSIZE), drawn from nothing to nearly all that the command writes. Each must end
with exit code 2 and one line that says why, without a traceback, and what was written before must be as it was.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .kills import JOBS, PATIENCE, Job, digest

START = (
    "import resource, sys; limit = int(sys.argv[1])\n"
    "from granswim_pymunk.cli import main\n"
    "resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)); sys.exit(main(sys.argv[2:]))"
)
LIMITS = (0, 1000, 30_000)  # bytes: each job writes a file that is larger


def on_a_full_disk(job: Job, place: Path, limit: int) -> str:
    """What went wrong with a command whose files may have so many bytes; empty where it ended as it should."""
    job.prepare(place)
    before = {path: digest(path) for path in sorted(place.rglob("*")) if path.is_file()}
    done = subprocess.run(
        [sys.executable, "-c", START, str(limit), *job.first(place)], cwd=place, capture_output=True, text=True,
        timeout=PATIENCE, check=False,
    )  # fmt: skip
    said = [line for line in done.stderr.splitlines() if line.startswith("granswim ") and "writ" in line]
    if "Traceback" in done.stderr or done.returncode != 2 or len(said) != 1:
        return f"exit code {done.returncode}, {len(said)} lines that say why: {done.stderr.strip()[-200:]}"
    changed = [path.name for path, mark in before.items() if digest(path) != mark]
    return f"{', '.join(changed)} is not what it was" if changed else ""


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="full_disk", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE")
    args = parser.parse_args(argv)
    result: dict[str, dict[str, str]] = {}
    for job in JOBS:
        if job.name in ("run", "sweep", "export", "diagnose"):
            for limit in LIMITS:
                with tempfile.TemporaryDirectory() as own:
                    wrong = on_a_full_disk(job, Path(own), limit)
                result.setdefault(job.name, {})[str(limit)] = wrong
                what = wrong or "one line, exit code 2, nothing lost"
                print(f"{job.name}, no file above {limit} bytes: {what}", flush=True)
    if args.json:
        args.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return any(wrong for job in result.values() for wrong in job.values())


if __name__ == "__main__":
    sys.exit(main())
