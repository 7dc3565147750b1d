"""``granswim crosscheck NAME.npz``: run a bed that another code has computed, and compare the positions.

Prints the largest deviation of a position [m] for each stored step. NAME.toml beside it has the laws.
"""

import argparse

from ..validation.crosscheck import MODES, crosscheck, read_bed
from ..validation.output import check_folder, write_json

HELP = "compare with a bed that another code has computed"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bed", metavar="NAME.npz", help="the bed, or bed_9Hz for the one that comes with the package")
    parser.add_argument("--mode", choices=MODES, default="verlet", help="who computes it (default: verlet)")
    parser.add_argument("--json", metavar="FILE", help="write the deviations as JSON")


def main(args: argparse.Namespace) -> int:
    check_folder(args.json)
    bed = read_bed(args.bed)
    print(f"{bed.scene.title}: {len(bed.scene.bodies)} bodies, dt = {bed.scene.time.dt:g} s, {args.mode}")
    print(f"{'steps':>8}  {'largest deviation of a position [m]':>36}")
    deviations = []
    for deviation in crosscheck(bed, args.mode):
        print(f"{deviation.steps:8d}  {deviation.max_position_error:36.3g}", flush=True)
        deviations.append(vars(deviation))
    if args.json:
        write_json(deviations, args.json)
    return 0
