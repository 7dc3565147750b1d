"""``python -m granswim_pymunk.validation.real_left TABLE --series N --commit HASH --out FILE``: both tests in a table.

Tables of series 1 to 53 hold what is left (``left``) with masses and radii as they are believed, whatever the recording
states of them. Here the cases in which that is seen are drawn again from the secret of their series; FILE holds what is
left once stated errors are fitted (``left``) beside what it was (``left_held``). Others keep theirs: what is fitted
takes away and never adds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.prove import table_text
from granswim_pymunk.proof.real_life import real_bodies_case
from granswim_pymunk.proof.real_score import RealRow, components_named, read_real_rows
from granswim_pymunk.proof.seal import series_secret


def fitted(row: RealRow, truth: Mapping[str, Any]) -> RealRow:
    """The row with what is left by the seal ``truth``, once what is stated is fitted, and as it is believed."""
    parts = "+".join(sorted(components_named(truth, row.named)))
    return replace(row, left=truth["left"].get(parts), left_held=truth["left_held"].get(parts))


def again(rows: list[RealRow], secret: bytes, say: Callable[[str], None]) -> list[RealRow]:
    """The rows, of bodies that are seen to be incomplete with the test of today."""
    found = []
    for k, row in enumerate(rows):
        kind, _, seed = row.case.rpartition("-")
        if kind == "real-life" and row.seen:
            say(f"{row.case}, {k + 1} of {len(rows)}")
            found.append(fitted(row, real_bodies_case(int(seed), secret).truth))
        else:
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
        rows = read_real_rows(args.table)
        secret = series_secret(args.series, args.commit)
        new = again(rows, secret, lambda text: print(text, file=sys.stderr))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    args.out.write_text(table_text(new), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
