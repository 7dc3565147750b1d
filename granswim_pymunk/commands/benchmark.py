"""``granswim benchmark``: time per step and memory, side by side with LAMMPS and a plain compiled loop.

All engines run in one process in short alternating blocks; the fastest block of each counts.
"""

import argparse
import os
from pathlib import Path

from ..console import put_figures

EXAMPLES = ("granswim benchmark --grains 500 5000", "granswim benchmark --engines verlet plain --out out/benchmark")
HELP = "time per step and memory, side by side with LAMMPS and a plain compiled loop"
FOLDERS = ("out",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..benchmarks.speed import ENGINES

    parser.add_argument(
        "--grains",
        type=int,
        nargs="+",
        default=[500, 2264, 5000, 20000, 100000],
        metavar="N",
        help="sizes of the bed (default: 500 2264 5000 20000 100000)",
    )
    parser.add_argument(
        "--engines", nargs="+", default=list(ENGINES), metavar="NAME", help=f"some of {', '.join(ENGINES)}"
    )
    parser.add_argument("--rounds", type=int, default=12, metavar="N", help="blocks of each engine (default: 12)")
    parser.add_argument("--no-memory", action="store_true", help="do not measure memory (a process for each row)")
    parser.add_argument("--profile", action="store_true", help="also say where the time of a step goes")
    parser.add_argument(
        "--out", metavar="DIR", help="write benchmark.json, a table (benchmark.md) and a figure (benchmark.png) there"
    )


def main(args: argparse.Namespace) -> int:
    from ..benchmarks import profile as phases
    from ..benchmarks.beds import bed
    from ..benchmarks.speed import as_json, benchmark, draw, table
    from ..errors import InputError
    from ..validation.output import write_json

    if args.rounds < 1:
        raise InputError(f"should be at least 1, got {args.rounds}", where="--rounds")
    out = None
    if args.out:
        out = Path(args.out)
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make this folder: {error.strerror}", file=out) from None
    rows, _ = benchmark(args.grains, args.engines, rounds=args.rounds, with_memory=not args.no_memory)
    found = []
    if args.profile:
        for grains in dict.fromkeys(args.grains):
            found += phases.profile(bed(grains), grains, args.rounds)
        print("\n" + phases.table(found))
    put_figures(args, as_json(rows))
    if out is not None:
        write_json(as_json(rows), out / "benchmark.json")
        text = table(rows) + ("\n" + phases.table(found) if found else "")
        (out / "benchmark.md").write_text(text, encoding="utf-8")
        beside = out / f".benchmark.{os.getpid()}.png"
        draw(rows, beside)
        beside.replace(out / "benchmark.png")
        print(f"\n{out / 'benchmark.json'}, {out / 'benchmark.md'}, {out / 'benchmark.png'}")
    return 0
