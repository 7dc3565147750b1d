"""``granswim validate``: the engine against closed solutions, a reference integrator and another code.

Prints every figure with its bound and whether it holds, draws the cases, and exits 1 when one does not.
"""

import argparse

from ..console import put_figures

EXAMPLES = ("granswim validate --quick", "granswim validate --out plots --json figures.json")
HELP = "check the engine against closed solutions, a reference integrator and another code"
NEEDS = ("validation.report",)
FOLDERS = ("out",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", metavar="DIR", default="out/validate", help="plots go here (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="fewer points and steps")


def main(args: argparse.Namespace) -> int:
    from ..validation.report import validate

    result = validate(args.quick, args.out, say=lambda text: print(text, flush=True))
    print(f"plots: {args.out}")
    put_figures(args, result)
    return 0 if result["holds"] else 1
