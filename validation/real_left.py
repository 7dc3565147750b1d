"""``python -m granswim_pymunk.validation.real_left TABLE --series N --commit HASH --out FILE``: both tests in a table.

Tables of series 1 to 53 hold what is left (``left``) with masses and radii as they are believed, whatever the recording
states of them. Here the cases in which that is seen are drawn again from the secret of their series; FILE holds what is
left once stated errors are fitted (``left``) beside what it was (``left_held``). Others keep theirs: what is fitted
takes away and never adds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.conceal import write_beside
from granswim_pymunk.proof.prove import table_text
from granswim_pymunk.proof.real_life import real_bodies_case
from granswim_pymunk.proof.real_score import RealRow, read_real_rows, what_is_left
from granswim_pymunk.proof.seal import series_secret
from granswim_pymunk.validation.output import check_folder


def again(rows: list[RealRow], secret: bytes, say: Callable[[str], None]) -> list[RealRow]:
    """The rows, of bodies that are seen to be incomplete with the test of today."""
    found = []
    for k, row in enumerate(rows):
        kind, _, seed = row.case.rpartition("-")
        if kind == "real-life" and row.seen:
            say(f"{row.case}, {k + 1} of {len(rows)}")
            left, held = what_is_left(real_bodies_case(int(seed), secret).truth, row.named)
            row = replace(row, left=left, left_held=held)
        found.append(row)
    return found


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", metavar="TABLE")
    parser.add_argument("--series", type=int, required=True)
    parser.add_argument("--commit", required=True, help="that of the series, 40 digits")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    args = parser.parse_args(argv)
    try:
        check_folder(args.out)
        rows = read_real_rows(args.table)
        secret = series_secret(args.series, args.commit)
        new = again(rows, secret, lambda text: print(text, file=sys.stderr))
        write_beside(args.out, table_text(new))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
