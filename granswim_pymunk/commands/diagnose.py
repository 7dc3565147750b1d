"""``granswim diagnose``: hold a simulation against a recording and find the physics that was left out."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MOST_BODIES = 8  # named one by one

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


def standing(verdict: Mapping[str, Any]) -> list[str]:
    """How much is explained, whether it is complete, what is left, and what held-out data say: one line each."""
    lines = []
    withdrawn = [r["name"] for r in verdict["rivals"] if r.get("withdrawn")]
    if withdrawn:
        lines.append(f"withdrawn, as held-out data are predicted worse with it: {', '.join(withdrawn)}")
    told, left = verdict.get("explained"), verdict.get("remains")
    if told:
        form = told["best_free_form"]
        beside = "" if form is None else f"; the best force without a name {100 * form:.0f} %"
        lines.append(
            f"explains {100 * told['share']:.0f} % ({100 * told['low']:.0f} to {100 * told['high']:.0f} %) "
            f"of the mismatch on blocks that the fit did not see{beside}"
        )
    if left:
        lines.append(
            f"the best approximation so far: {left['times_floor']:.2g} times the noise is left, most on "
            f"{', '.join(left['bodies'][:MOST_BODIES])}; it looks like {left['looks_like']}"
        )
    elif verdict.get("complete"):
        lines.append("what is left passes for noise")
    if verdict.get("heldout"):
        lines.append(f"held-out data: {verdict['heldout']}")
    return lines


def main(args: argparse.Namespace) -> int:
    from ..console import default_out, put_figures
    from ..diagnosis.diagnose import ProgressLine, diagnose, verdict_of
    from ..errors import InputError

    if args.minutes is not None and not args.minutes > 0:
        raise InputError(f"should be above zero, got {args.minutes:g}", where="--minutes")
    if args.seed < 0:
        raise InputError(f"should be zero or more, got {args.seed}", where="--seed")
    out = args.out or default_out("diagnose", args.recordings[0])
    found = diagnose(
        args.recordings, out, hold_out=args.hold_out, minutes=args.minutes, seed=args.seed,
        progress=None if args.quiet else ProgressLine(),
    )
    verdict = verdict_of(found)
    put_figures(args, verdict)
    print(f"verdict: {verdict['verdict']}")
    for entry in verdict["mechanisms"]:
        shown, more = entry["bodies"][:MOST_BODIES], len(entry["bodies"]) - MOST_BODIES
        whom = ", ".join(shown) + (f" and {more} more" if more > 0 else "")
        print(f"  {entry['name']}{f' on {whom}' if whom else ''}: {entry['expression']}")
    for line in standing(verdict):
        print(f"  {line}")
    same = [rival["name"] for rival in verdict["rivals"] if rival["indistinguishable"]]
    worse = [rival["name"] for rival in verdict["rivals"] if not rival["indistinguishable"]]
    if same:
        print(f"  these data cannot tell it from {', '.join(same)}")
    if worse:
        print(f"  rivals that do worse: {', '.join(worse)}")
    unit = verdict["fit"]["unit"]
    for part, title in (("train", "training"), ("heldout", "held out")):
        errors = verdict["fit"][part]
        shown = ", ".join(f"{k.replace('_', ' ')} {v:.3g}" for k, v in errors.items() if v is not None)
        print(f"  {title} [{unit}]: {shown or 'nothing'}")
    for note in verdict["notes"]:
        print(f"  note: {note}")
    print(f"report: {out / 'report.html'}")
    return 0
