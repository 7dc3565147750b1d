"""``python -m granswim_pymunk.validation.real_figures TABLE ... [--kind KIND]``: what tables of the proof say together.

TABLE: a ``real-life.csv`` or a ``slice-k-of-n.csv`` of ``granswim prove --real-life``, or a ``score.csv`` or slice of
``granswim prove``, but not both kinds at once. Printed are the figures, of real-life tables those of each apparatus and
what went wrong, too. A case that stands in two tables is an error: a seed is scored once.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TypeVar

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.real_score import RealRow, read_real_rows, real_told
from granswim_pymunk.proof.score import Row, read_rows, told

Scored = TypeVar("Scored", Row, RealRow)


def is_real_life(table: str) -> bool:
    """Whether a table is that of real-life cases: they say which nuisances were drawn. Other files are not read."""
    try:
        with open(table, encoding="utf-8") as file:
            return "nuisances" in file.readline().strip().split(",")
    except (OSError, UnicodeDecodeError):
        return False  # what is wrong is said where it is read


def wanted(rows: Sequence[Scored], kind: str | None) -> list[Scored]:
    """Rows of a kind. Raises InputError for a case that is there twice, and where none is there."""
    twice = [case for case, count in Counter(r.case for r in rows).items() if count > 1]
    if twice:
        raise InputError(f"{twice[0]} stands in the tables twice; a seed is scored once", where="TABLE")
    found = [r for r in rows if kind is None or r.case.rpartition("-")[0] == kind]
    if not found:
        kinds = sorted({r.case.rpartition("-")[0] for r in rows})
        raise InputError(f"no case of kind {kind}, there are: {', '.join(kinds) or 'none'}", where="--kind")
    return found


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
    parser.add_argument("--kind", help="cases of this kind alone: bodies, small-unseen, ...")
    args = parser.parse_args(argv)
    try:
        real = {table: is_real_life(table) for table in args.tables}
        if len(set(real.values())) > 1:
            raise InputError("real-life tables and others have figures of their own: give one kind", where="TABLE")
        if not any(real.values()):
            say("\n".join(told(wanted([r for table in args.tables for r in read_rows(table)], args.kind))))
            return 0
        rows = wanted([r for table in args.tables for r in read_real_rows(table)], args.kind)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    say("\n".join([*real_told(rows), "", *by_setup(rows), "", "What went wrong:", "", *wrong(rows)]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
