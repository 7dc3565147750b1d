"""``granswim diagnose``: hold a simulation against a recording and find the physics that was left out."""

import argparse
from pathlib import Path

EXAMPLES = (
    "granswim diagnose pendulum",
    "granswim diagnose swing_1 swing_2 swing_3 --out out/swings",
    "granswim diagnose drops --hold-out drops/last --minutes 10 --json verdict.json",
)
HELP = "find the physics that the scene of a recording lacks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recordings", nargs="+", metavar="RECORDING", help="folder, or name of a shipped recording")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for verdict, report, figures (default: out/diagnose-NAME)"
    )
    parser.add_argument(
        "--hold-out", action="append", default=[], metavar="RECORDING", help="not looked at before the verdict is fixed"
    )
    parser.add_argument("--minutes", type=float, metavar="M", help="time budget")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="seed of the nulls")
    parser.add_argument("--open", action="store_true", help="show the report in the browser when it is there")


def main(args: argparse.Namespace) -> int:
    from ..console import default_out, put_figures
    from ..errors import InputError
    from ..inference.entry import ProgressLine, diagnose
    from ..inference.mechanisms import not_told_apart, worse_rivals
    from ..result import MOST_BODIES, adjusted, law_line, standing

    if args.minutes is not None and not args.minutes > 0:
        raise InputError(f"should be above zero, got {args.minutes:g}", where="--minutes")
    if args.seed < 0:
        raise InputError(f"should be zero or more, got {args.seed}", where="--seed")
    out = args.out or default_out("diagnose", args.recordings[0])
    found = diagnose(
        args.recordings, out, hold_out=args.hold_out, minutes=args.minutes, seed=args.seed,
        progress=None if args.quiet else ProgressLine(),
    )
    verdict = found.verdict
    put_figures(args, verdict)
    print(f"verdict: {verdict['verdict']}")
    for entry in verdict["mechanisms"]:
        shown, more = entry["bodies"][:MOST_BODIES], len(entry["bodies"]) - MOST_BODIES
        whom = ", ".join(shown) + (f" and {more} more" if more > 0 else "")
        print(f"  {entry['name']}{f' on {whom}' if whom else ''}: {law_line(entry)}")
    if told := adjusted(verdict, found.believed):
        print(f"  {told}")
    for line in standing(verdict):
        print(f"  {line}")
    if same := not_told_apart(verdict):
        print(f"  {same}")
    for how, names in worse_rivals(verdict):
        print(f"  rivals that {how}: {', '.join(names)}")
    unit = verdict["fit"]["unit"]
    for part, title in (("train", "training"), ("heldout", "held out")):
        errors = verdict["fit"][part]
        shown = ", ".join(f"{k.replace('_', ' ')} {v:.3g}" for k, v in errors.items() if v is not None)
        print(f"  {title} [{unit}]: {shown or 'nothing'}")
    for note in verdict["notes"]:
        print(f"  note: {note}")
    report = out / "report.html"
    print(f"report: {report}")
    if args.open:
        import webbrowser

        if not webbrowser.open(report.resolve().as_uri()):
            print("no browser was found to show it in")
    return 0
