"""``granswim prove``: conceal, diagnose each recording in a process of its own, open the seals, score.

The quick form runs a handful of small development cases; the full form the scored seeds, all kinds or one of them.
Results lie in DIR/results, one file a case; an interrupted run goes on where it stopped, and a seed is scored once.
Parts may be run apart (--seeds, --kind) into one DIR: each run scores all that lies there.
"""

import argparse
from pathlib import Path

HELP = "score the diagnosis on recordings with concealed effects"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--quick", action="store_true", help="a handful of development cases (the default)")
    which.add_argument("--full", action="store_true", help="the scored seeds, and the real recordings")
    which.add_argument("--seeds", metavar="LIST", help="seeds as 1000-1019,1040; below 1000: development")
    parser.add_argument("--kind", help="sort of recording: bodies, bed, small-bed, unseen, small-unseen, curve, "
                                       "small-curve (default: bodies; with --full: all)")  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("granswim-proof"), metavar="DIR")
    parser.add_argument("--secret", type=Path, metavar="FILE", help="for scored seeds (default: yours)")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="diagnoses at a time (default: 2)")
    parser.add_argument("--minutes", type=float, metavar="M", help="time budget of each diagnosis")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures as JSON")


def parse_seeds(text: str) -> list[int]:
    """``1000-1019,1040`` as numbers. Raises InputError."""
    from ..errors import InputError

    seeds: list[int] = []
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if not first.isdigit() or (last and not last.isdigit()) or (last and int(last) < int(first)):
            raise InputError(f"expected numbers and ranges as 1000-1019,1040, got {text!r}", where="--seeds")
        seeds += range(int(first), int(last or first) + 1)
    return seeds


def main(args: argparse.Namespace) -> int:
    import time
    from dataclasses import asdict

    from ..errors import InputError
    from ..proof.conceal import KINDS
    from ..proof.prove import FIRST_SCORED, QUICK, full_cases, prove_cases
    from ..proof.score import figures_of_merit, held_out, told
    from ..proof.seal import read_secret
    from ..validation.output import check_folder, write_json

    check_folder(args.json)
    if args.kind is not None and args.kind not in KINDS:
        raise InputError(f"unknown kind {args.kind!r}; known: {', '.join(KINDS)}", where="--kind")
    if args.workers < 1:
        raise InputError(f"should be one or more, got {args.workers}", where="--workers")
    if args.minutes is not None and not args.minutes > 0:
        raise InputError(f"should be above zero, got {args.minutes:g}", where="--minutes")
    if args.seeds:
        cases = [(args.kind or "bodies", seed) for seed in parse_seeds(args.seeds)]
    else:
        cases = full_cases(args.kind) if args.full else [c for c in QUICK if args.kind in (None, c[0])]
    if not cases:
        raise InputError(f"the quick form has no case of the kind {args.kind}", where="--kind")
    secret = read_secret(args.secret) if any(s >= FIRST_SCORED for _, s in cases) else None
    began = time.monotonic()

    def progress(name: str, done: int, of: int) -> None:
        spent = time.monotonic() - began
        left = f", about {spent / done * (of - done):.0f} s left" if done < of else ""
        print(f"{name}: {done} of {of}, {spent:.0f} s{left}", flush=True)

    rows = prove_cases(
        cases, args.out, secret=secret, minutes=args.minutes, workers=args.workers, real=args.full, progress=progress
    )
    print(f"{'case':<18} {'concealed':<28} {'st. errors':>10}  answer")
    for r in rows:
        concealed = "+".join(r.truth) or r.category
        print(f"{r.case:<18} {concealed:<28} {r.sigma:>10.1f}  {r.failed or r.verdict} {'+'.join(r.named)}")
    print("\n".join(told(rows)))
    print(f"page: {args.out / 'proof.html'}")
    if args.json:
        data = {
            "format": "granswim-proof/1", "cases": [r.as_dict() for r in rows], "held_out": held_out(rows),
            "figures": [asdict(f) for f in figures_of_merit(rows)],
        }  # fmt: skip
        write_json(data, args.json)
    return 0
