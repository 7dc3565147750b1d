"""``python -m granswim_pymunk.validation.proof_pictures TABLE ... --out DIR``: scored cases, in figures and words.

TABLE: a ``score.csv`` of ``granswim prove``; those of the scored series are kept in docs/proof. Of bodies without a
bed the figures are of the tables given with ``--bodies``, as each series has the code as it then was; of full beds
they are of all. What is printed: how many cases there are, and the score of those that are drawn.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.page import draw_calibration, draw_confusion, draw_detection, draw_held_out
from granswim_pymunk.proof.score import NULLS, read_rows, told
from granswim_pymunk.validation.output import check_folder

DRAWN = {
    "detection": draw_detection,
    "confusion": draw_confusion,
    "held_out": draw_held_out,
    "calibration": draw_calibration,
}


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="+", metavar="TABLE")
    parser.add_argument("--bodies", nargs="*", default=[], metavar="TABLE")
    parser.add_argument("--out", required=True, metavar="DIR")
    args = parser.parse_args(argv)
    try:
        check_folder(Path(args.out) / "proof.png")
        every = [r for table in args.tables for r in read_rows(table)]
        bodies = [r for table in args.bodies for r in read_rows(table) if r.case.startswith("bodies-")]
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    named = [r.physics_named for r in every if r.category in NULLS]
    say(f"{len(every)} cases; nulls and decoys with physics named: {sum(named)} of {len(named)}")
    for kind, rows in (("beds", [r for r in every if r.case.startswith("bed-")]), ("bodies", bodies)):
        if not rows:
            continue
        say("\n".join([f"{kind}, {len(rows)} cases", *told(rows)]))
        for name, draw in DRAWN.items():
            file = Path(args.out) / f"proof_{kind}_{name}.png"
            draw(rows).savefig(file, dpi=120)
            say(f"  {file}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
