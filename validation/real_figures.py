"""``python -m granswim_pymunk.validation.real_figures TABLE ...``: what real-life tables say together.

TABLE: a ``real-life.csv`` or a ``slice-k-of-n.csv`` of ``granswim prove --real-life``. Printed are the figures, those
of every apparatus, and what went wrong. A case that stands in two tables is an error: a seed is scored once.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.real_score import RealRow, read_real_rows, real_told


def by_setup(rows: Sequence[RealRow]) -> list[str]:
    """A Markdown table: of every apparatus how many were named right, and how long a diagnosis took."""
    lines = ["| apparatus | with an effect | right name | right name or class | nulls | named in nulls | longest, s |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for setup in sorted({r.setup for r in rows}):
        mine = [r for r in rows if r.setup == setup]
        some, none = [r for r in mine if r.truth], [r for r in mine if not r.truth]
        lines.append(
            f"| {setup} | {len(some)} | {sum(r.right_name for r in some)} | {sum(r.right_class for r in some)} | "
            f"{len(none)} | {sum(bool(r.strange) for r in none)} | {max(r.seconds for r in mine):.0f} |"
        )
    return lines


def wrong(rows: Sequence[RealRow]) -> list[str]:
    """What was not named right, a line each."""
    lines = []
    for r in rows:
        if r.right_class and not r.strange:
            continue
        said = " + ".join(r.named) or r.failed or r.verdict
        complete = {True: ", complete", False: ", incomplete", None: ""}[r.complete]
        lines.append(
            f"- {r.case} ({r.setup}): {' + '.join(r.truth) or 'nothing'} of {r.sigma:.0f} beside "
            f"{', '.join(r.drawn) or 'no nuisance of the bodies'}: {said}{complete}"
        )
    return lines


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", metavar="TABLE")
    args = parser.parse_args(argv)
    try:
        rows = [r for table in args.tables for r in read_real_rows(table)]
        twice = [case for case, count in Counter(r.case for r in rows).items() if count > 1]
        if twice:
            raise InputError(f"{twice[0]} stands in the tables twice; a seed is scored once", where="TABLE")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    say("\n".join([*real_told(rows), "", *by_setup(rows), "", "What went wrong:", "", *wrong(rows)]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
