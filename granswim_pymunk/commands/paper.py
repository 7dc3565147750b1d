"""``granswim paper [CLAIM ...]``: the tables and figures of the paper on the optimal frequency of a sand swimmer.

Runs what a claim needs and is not there yet, draws its figure, and prints what the paper says, what was measured
with its 95 % error, and whether it holds. CLAIM: T1, F2 .. F10 (F3 is F3a and F3b), readings, convergence, checks;
none: all. The pocket setting (8 packings, 1.5 s, softer contacts) is 570 runs of about 10 s of one core, 16 of them,
with stiff contacts, 50 s: an hour of two cores. paper is 20 packings of 10 s after settling with the paper's
stiffnesses, for a cluster (--dask). Stopped, it goes on where it was.
"""

import argparse

HELP = "the tables and figures of the sand swimmer's paper, claim by claim"
NEEDS = ("paper.driver",)
FOLDERS = ("out", "runs", "pages")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..paper.scenes import MU_EFF

    parser.add_argument("claims", nargs="*", metavar="CLAIM", help="T1, F2 .. F10, readings, convergence, checks")
    parser.add_argument("--setting", choices=("pocket", "paper"), default="pocket", help="how much is run (pocket)")
    parser.add_argument("--out", metavar="DIR", default="out/paper", help="figures and tables (default: %(default)s)")
    parser.add_argument("--runs", metavar="DIR", help="where the runs' files are (default: OUT/runs)")
    parser.add_argument("--pages", metavar="DIR", help="where paper.md and readings.md go (default: OUT)")
    parser.add_argument("--json", metavar="FILE", help="verdicts and every number as JSON (default: OUT/claims.json)")
    parser.add_argument("--curve", metavar="FILE", help="calibrate mu_eff to a measured curve.csv as well")
    parser.add_argument(
        "--k-b-scale", type=float, default=1.0, metavar="X", help="times the default k_B (1.47: as first taken)"
    )
    parser.add_argument(
        "--mu-eff", type=float, default=MU_EFF, metavar="X", help="calibrated mu_eff, under layers (%(default)s)"
    )
    parser.add_argument("--compare", metavar="FILE", help="claims.json of another run, to stand beside this one")
    parser.add_argument("--no-run", action="store_true", help="only with what is finished")
    parser.add_argument("--retry-failed", action="store_true", help="run again what failed before")
    parser.add_argument("--processes", type=int, metavar="N", help="local processes (default: one a core)")
    parser.add_argument("--dask", metavar="ADDRESS", help="run on a Dask cluster: its scheduler's address, or local")


def main(args: argparse.Namespace) -> int:
    from ..paper.driver import paper

    paper(
        args.claims, setting=args.setting, out=args.out, runs=args.runs, pages=args.pages, json_file=args.json,
        curve=args.curve, k_B_scale=args.k_b_scale, mu_eff=args.mu_eff, compare=args.compare, run=not args.no_run,
        processes=args.processes, dask=args.dask, retry_failed=args.retry_failed,
        say=lambda text: print(text, flush=True),
    )  # fmt: skip
    return 0
