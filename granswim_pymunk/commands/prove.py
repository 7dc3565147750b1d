"""``granswim prove``: conceal, diagnose each recording in a process of its own, open the seals, score.

The quick form runs a handful of small development cases; the full form the scored seeds, all kinds or one of them.
Results lie in DIR/results, one file a case; an interrupted run goes on where it stopped, and a seed is scored once.
Parts may be run apart (--seeds, --kind, --slice) into one DIR: each run scores all that lies there.
--real-life: the cases under real-life conditions, which have a table of their own.
--series N: the secret is SHA-256 of `series N COMMIT`, COMMIT that of the checkout; N is in the list of
docs/proof_history.md.
"""

import argparse
from pathlib import Path

HELP = "score the diagnosis on recordings with concealed effects"
NEEDS = ("proof.prove",)
FOLDERS = ("out",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--quick", action="store_true", help="a handful of development cases (the default)")
    which.add_argument("--full", action="store_true", help="the scored seeds, and the real recordings")
    which.add_argument("--seeds", metavar="LIST", help="seeds as 1000-1019,1040; below 1000: development")
    parser.add_argument("--kind", help="sort of recording: bodies, bed, small-bed, unseen, small-unseen, curve, "
                                       "small-curve (default: bodies; with --full: all)")  # fmt: skip
    parser.add_argument("--real-life", action="store_true", help="cases with what laboratories add")
    parser.add_argument("--slice", metavar="K/N", help="the K-th of N parts; its table: slice-K-of-N.csv")
    parser.add_argument("--series", type=int, metavar="N", help="number of the series, which gives the secret")
    parser.add_argument("--commit", metavar="HASH", help="commit of the series (default: that of the checkout)")
    parser.add_argument("--out", type=Path, default=Path("out/prove"), metavar="DIR")
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


def parse_slice(text: str) -> tuple[int, int]:
    """``2/10`` as numbers. Raises InputError."""
    from ..errors import InputError

    part, _, parts = text.partition("/")
    if not part.isdigit() or not parts.isdigit():
        raise InputError(f"expected k/n as 2/10, got {text!r}", where="--slice")
    return int(part), int(parts)


def wanted_cases(args: argparse.Namespace) -> list[tuple[str, int]]:
    """The cases that the options ask for. Raises InputError."""
    from ..errors import InputError
    from ..proof.conceal import KINDS, real_kind
    from ..proof.prove import QUICK, QUICK_REAL, full_cases, sliced

    kind = args.kind
    if args.real_life and kind is not None:
        kind = real_kind(kind)
    if kind is not None and kind not in KINDS:
        raise InputError(f"unknown kind {kind!r}; known: {', '.join(KINDS)}", where="--kind")
    if args.seeds:
        cases = [(kind or ("real-life" if args.real_life else "bodies"), seed) for seed in parse_seeds(args.seeds)]
    elif args.full:
        cases = full_cases(kind, args.real_life)
    else:
        cases = [c for c in (QUICK_REAL if args.real_life else QUICK) if kind in (None, c[0])]
    if not cases:
        raise InputError(f"there is no case of the kind {kind} in this form", where="--kind")
    return sliced(cases, *parse_slice(args.slice)) if args.slice else cases


def secret_of(args: argparse.Namespace, scored: bool) -> bytes | None:
    """The secret that the cases are drawn with; of a series it follows from its number and commit."""
    from ..errors import InputError
    from ..proof.prove import claim
    from ..proof.seal import checked_out, read_secret, series_secret

    if args.series is None:
        if args.commit is not None:
            raise InputError("belongs to --series N", where="--commit")
        return read_secret(args.secret) if scored else None
    if args.secret is not None:
        raise InputError("the secret of a series follows from its number; leave --secret out", where="--series")
    if not scored:
        raise InputError("has no development seeds", where="--series")
    commit = args.commit or checked_out(args.series)
    secret = series_secret(args.series, commit)
    claim(args.out, args.series, commit)
    return secret


def main(args: argparse.Namespace) -> int:
    import time
    from dataclasses import asdict

    from ..errors import InputError
    from ..proof.prove import FIRST_SCORED, prove_cases, real_rows, slice_table
    from ..proof.real_score import real_figures, real_told
    from ..proof.score import figures_of_merit, held_out, told
    from ..validation.output import write_json

    if args.workers < 1:
        raise InputError(f"should be one or more, got {args.workers}", where="--workers")
    if args.minutes is not None and not args.minutes > 0:
        raise InputError(f"should be above zero, got {args.minutes:g}", where="--minutes")
    cases = wanted_cases(args)
    secret = secret_of(args, any(s >= FIRST_SCORED for _, s in cases))
    began = time.monotonic()

    def progress(name: str, done: int, of: int) -> None:
        spent = time.monotonic() - began
        left = f", about {spent / done * (of - done):.0f} s left" if done < of else ""
        print(f"{name}: {done} of {of}, {spent:.0f} s{left}", flush=True)

    rows = prove_cases(
        cases, args.out, secret=secret, minutes=args.minutes, workers=args.workers,
        real=args.full and not args.real_life, progress=progress,
    )
    real = real_rows(args.out)
    if args.slice:
        print(f"slice: {slice_table(args.out, cases, *parse_slice(args.slice))}")
    if real:
        print(f"{'case':<18} {'concealed':<38} {'st. errors':>10}  answer")
        for q in real:
            said = {True: ", complete", False: ", incomplete", None: ""}[q.complete]
            concealed = "+".join(q.truth) or "nothing"
            print(f"{q.case:<18} {concealed:<38} {q.sigma:>10.1f}  {q.failed or q.verdict} {'+'.join(q.named)}{said}")
        print("\n".join(real_told(real)))
        print(f"table: {args.out / 'real-life.csv'}")
    if rows:
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
            "real_life": [r.as_dict() for r in real], "real_figures": [asdict(f) for f in real_figures(real)],
        }  # fmt: skip
        write_json(data, args.json)
    return 0
