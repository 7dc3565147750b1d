"""``granswim validate``: the engine against closed solutions, a reference integrator and another code.

Prints every figure with its bound and whether it holds, draws the cases, and exits 1 when one does not.
"""

import argparse

from ..validation.output import check_folder, write_json
from ..validation.report import validate

HELP = "check the engine against closed solutions, a reference integrator and another code"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", metavar="DIR", default="granswim-validation", help="plots go here (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="fewer points and steps")
    parser.add_argument("--json", metavar="FILE", help="write every figure with its bound as JSON")


def main(args: argparse.Namespace) -> int:
    check_folder(args.json)
    result = validate(args.quick, args.out, say=lambda text: print(text, flush=True))
    print(f"plots: {args.out}")
    if args.json:
        write_json(result, args.json)
    return 0 if result["holds"] else 1
