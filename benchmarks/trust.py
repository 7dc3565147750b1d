"""``python -m granswim_pymunk.benchmarks.trust FOLDER [--page docs/trust.md]``: what was done to break the program.

Runs the fuzz, whole diagnoses of spoilt recordings, the kills and the full disk, each in a process of its own, and
writes the page. What lies in FOLDER already is not run again, so that a long series can be stopped and gone on with.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

HEAD = """# Trust

What was tried to break the program, and what came of it. Every line is made by one command:
`python -m granswim_pymunk.benchmarks.trust FOLDER` ({fuzz} spoilt inputs, {whole} whole diagnoses, {kills} kills).
A small part of each runs with the tests.
"""
INPUTS = """## Spoilt inputs

Files cut off, shuffled, with bytes that are no text, numbers that are huge, tiny or none, keys twice or not at all;
options of all commands. Each is taken or refused in one line, within 10 s and 2 GB.

| kind | taken | refused in one line | neither |
|---|---|---|---|"""
DIAGNOSES = """## Whole diagnoses of spoilt recordings

`granswim diagnose --minutes 0.1`, each a process of its own: {tried} started, {read} with a verdict, {refused} refused
in one line, {failed} otherwise; the longest took {slowest:.0f} s with start and report, the largest {memory:.2f} GB."""
KILLS = """## Kills

SIGKILL to a command and all its processes at a moment drawn over its duration, then the second start: a run goes on to
the same bits, a sweep to the same table, an export to the same file; a verdict that was there stays or is replaced as a
whole.

| command | killed | after its end | lost |
|---|---|---|---|"""
DISK = """## A disk that takes no more

No file may grow beyond so many bytes. Asked: exit code 2, one line that says why, nothing changed that was there
before.
"""


def run_part(module: str, words: Sequence[str], file: Path) -> dict[str, Any]:
    """The JSON of one of the series, run where it is not there yet. Raises RuntimeError where none comes out."""
    if not file.exists():
        command = [sys.executable, "-m", f"granswim_pymunk.benchmarks.{module}", *words, "--json", str(file)]
        done = subprocess.run(command, check=False)
        if not file.exists():
            raise RuntimeError(f"{' '.join(command)}: exit code {done.returncode} and no {file.name}")
    result: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return result


def spoilt_inputs(found: dict[str, Any]) -> list[str]:
    """Markdown: what became of spoilt inputs of each kind."""
    lines = [INPUTS]
    for kind, n in sorted(found["kinds"].items()):
        lines.append(f"| {kind} | {n['read']} | {n['refused']} | {n['failed']} |")
    took = f"{found['slowest']:.1f} s of computing"
    most = f"{found['memory'] / 1e9:.2f} GB"
    lines += ["", f"Together {found['tried']}; the slowest took {took}, the process had {most} at most."]
    return [*lines, *_failures([text for _, text in found["failures"]])]


def whole_diagnoses(found: dict[str, Any]) -> list[str]:
    """Markdown: what became of whole diagnoses of spoilt recordings."""
    numbers = {key: found[key] for key in ("tried", "read", "refused", "slowest")}
    said = DIAGNOSES.format(**numbers, failed=len(found["failures"]), memory=found["memory"] / 1e9)
    return [said, *_failures([text for _, text in found["failures"]])]


def killed(series: dict[str, Any]) -> list[str]:
    """Markdown: what was lost by kills."""
    lines = [KILLS]
    for name, count in series["kills"].items():
        lost = sum(f", {name} after" in text for text in series["lost"])
        lines.append(f"| {name} | {count - series['late'][name]} | {series['late'][name]} | {lost} |")
    return [*lines, *_failures(series["lost"])]


def disk(result: dict[str, dict[str, str]]) -> list[str]:
    """Markdown: commands where no file may grow beyond a limit."""
    limits = list(next(iter(result.values())))
    lines = [DISK, "| command | " + " | ".join(f"{int(k):,} bytes" for k in limits) + " |"]
    lines.append("|---" * (len(limits) + 1) + "|")
    for name, each in result.items():
        lines.append(f"| {name} | " + " | ".join("as asked" if not each[k] else "**not**" for k in limits) + " |")
    wrong = [f"{name}, {k} bytes: {each[k]}" for name, each in result.items() for k in limits if each[k]]
    return [*lines, *_failures(wrong)]


def _failures(said: Sequence[str]) -> list[str]:
    return ["", "What failed:", "", *(f"- {' '.join(text.split())}" for text in said)] if said else []


def main(argv: Sequence[str] | None = None) -> int:
    how = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="trust", description=__doc__, formatter_class=how)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fuzz", type=int, default=10_000, metavar="N")
    parser.add_argument("--whole", type=int, default=200, metavar="N")
    parser.add_argument("--kills", type=int, default=100, metavar="N")
    parser.add_argument("--page", type=Path, metavar="FILE", help="the page, also printed")
    args = parser.parse_args(argv)
    args.folder.mkdir(parents=True, exist_ok=True)
    parts = (
        disk(run_part("full_disk", [], args.folder / "full_disk.json")),
        killed(run_part("kills", [str(args.kills)], args.folder / "kills.json")),
        spoilt_inputs(run_part("fuzz", [str(args.fuzz)], args.folder / "fuzz.json")),
        whole_diagnoses(run_part("fuzz", ["0", "--whole", str(args.whole)], args.folder / "whole.json")),
    )
    said = [HEAD.format(fuzz=args.fuzz, whole=args.whole, kills=args.kills).rstrip()]
    text = "\n\n".join([*said, *("\n".join(part) for part in parts)]) + "\n"
    print(text)
    if args.page:
        args.page.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
