"""``granswim crosscheck NAME.npz``: run a bed that another code has computed, and compare the positions.

Prints the largest deviation of a position [m] for each stored step. NAME.toml beside it has the laws.
"""

import argparse

from ..console import put_figures

EXAMPLES = ("granswim crosscheck bed_9Hz", "granswim crosscheck bed.npz --mode chipmunk --json deviations.json")
HELP = "compare with a bed that another code has computed"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..validation.crosscheck import MODES

    parser.add_argument("bed", metavar="NAME.npz", help="the bed, or bed_9Hz for the one that comes with the package")
    parser.add_argument("--mode", choices=MODES, default="verlet", help="who computes it (default: verlet)")


def main(args: argparse.Namespace) -> int:
    from ..validation.crosscheck import crosscheck, read_bed

    bed = read_bed(args.bed)
    print(f"{bed.scene.title}: {len(bed.scene.bodies)} bodies, dt = {bed.scene.time.dt:g} s, {args.mode}")
    print(f"{'steps':>8}  {'largest deviation of a position [m]':>36}")
    deviations = []
    for deviation in crosscheck(bed, args.mode):
        print(f"{deviation.steps:8d}  {deviation.max_position_error:36.3g}", flush=True)
        deviations.append(vars(deviation))
    put_figures(args, deviations)
    return 0
