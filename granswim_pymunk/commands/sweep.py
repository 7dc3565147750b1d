"""``granswim sweep SCENE --vary NAME=VALUES ...``: run a scene over every combination of some values.

NAME is seed, bed.height, bed.packing_fraction or LAW.PARAMETER; VALUES are 4,9,15 or first:last or
first:last:step, both ends included. One netCDF file a run, in OUT/runs, found again by its hash: a sweep that
was stopped goes on, a larger one reuses a smaller one. OUT/table.nc holds all of it as labelled arrays (xarray).
Exit code 1 where every run failed.
"""

import argparse
import json
from pathlib import Path

from ..console import put_figures

EXAMPLES = (
    "granswim sweep swim --vary bending.frequency=4,9,15 --vary seed=1:4 --duration 2 --settle 0.5",
    "granswim sweep pocket_swim --vary bending.frequency=5:15:5 --duration 0.3 --json table.json",
)
HELP = "run a scene over frequencies, stiffnesses, seeds ...: labelled arrays"
NEEDS = ("run", "sweep")
FOLDERS = ("out",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", help="a TOML file, or the name of a scene that comes with the package")
    parser.add_argument(
        "--vary", action="append", required=True, metavar="NAME=VALUES",
        help="bending.frequency=4,9,15 or seed=1:8 (several --vary: every combination)",
    )  # fmt: skip
    parser.add_argument("--out", metavar="DIR", help="where to write (default: out/sweep-NAME)")
    parser.add_argument("--duration", type=float, metavar="S", help="of each run [s] (default: as the scene says)")
    parser.add_argument("--settle", type=float, default=0.0, metavar="S", help="left out of means [s] (default: 0)")
    parser.add_argument("--every", type=float, default=1e-3, metavar="S", help="between samples [s] (default: 1e-3)")
    parser.add_argument("--processes", type=int, metavar="N", help="local processes (default: one a core)")
    parser.add_argument("--dask", metavar="ADDRESS", help="run on a Dask cluster: its scheduler's address, or local")
    parser.add_argument("--retry-failed", action="store_true", help="run again what failed before")


def main(args: argparse.Namespace) -> int:
    from ..files import try_folder
    from ..run import find_scene
    from ..scene import read_scene
    from ..sweep import parse_axis, scene_sweep, summary_lines

    path = find_scene(args.scene)
    out = Path(args.out or Path("out") / f"sweep-{path.stem}")
    try_folder(out)
    axes = dict(parse_axis(text) for text in args.vary)
    table = scene_sweep(
        read_scene(path), axes, out, duration=args.duration, settle=args.settle, every=args.every,
        processes=args.processes, dask=args.dask, retry_failed=args.retry_failed,
        quiet=args.quiet,
    )  # fmt: skip
    put_figures(args, json.loads(table.to_dataframe().reset_index().to_json(orient="records", double_precision=15)))
    print("\n".join(summary_lines(table)))
    print(f"written to {out}: table.nc, runs/")
    return 1 if (table["reason"] != "").all() else 0  # a sweep of which nothing succeeded did not succeed
