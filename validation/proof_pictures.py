"""``python -m granswim_pymunk.validation.proof_pictures TABLE ... --out DIR``: figures of scored cases.

TABLE: a ``score.csv`` of ``granswim prove``; those of the scored series are kept in docs/proof. Of bodies without a
bed the figures are of the tables given with ``--bodies``, as each series has the code as it then was; of full beds
they are of all.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.page import draw_calibration, draw_confusion, draw_detection, draw_held_out
from granswim_pymunk.proof.score import read_rows

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
        beds = [r for table in args.tables for r in read_rows(table) if r.case.startswith("bed-")]
        bodies = [r for table in args.bodies for r in read_rows(table) if r.case.startswith("bodies-")]
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for kind, rows in (("beds", beds), ("bodies", bodies)):
        for name, draw in DRAWN.items() if rows else ():
            file = Path(args.out) / f"proof_{kind}_{name}.png"
            draw(rows).savefig(file, dpi=120)
            say(f"{file}: {len(rows)} cases")
    return 0


if __name__ == "__main__":
    sys.exit(main())
