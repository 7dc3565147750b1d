"""``python -m granswim_pymunk.benchmarks.unseen_power RECORDING ...``: what films of a swimmer tell, its bed unseen.

Of every law that a diagnosis tries: the amount that is one standard error in these films, what adjustables imitate
taken off, and so the amount that is found from five on; and how many times more standard errors correlations between
packings that are shrunk between bends at the joints tell than such that are shrunk between angles of segments. The
weights w = C^-1 d are made of four fifths of the runs, their noise is that of the others. Runs are kept in the cache
of a diagnosis; the first of a bed takes some four minutes of a core, all that follow a few seconds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.packings.model import Packings
from granswim_pymunk.inference.packings.response import Means, covariances
from granswim_pymunk.inference.packings.screening import columns_of, model_of
from granswim_pymunk.inference.packings.state import Search
from granswim_pymunk.recording import Recording, read_recording

FOLDS = 5
SURE = 5.0  # standard errors


def standard_error(means: Means, s: Search, columns: np.ndarray, bends: bool) -> float:
    """Of the last of the numbers whose derivatives are ``columns`` (n, k), all others fitted."""
    at, sought, spread = 0, 0.0, 0.0
    for c in s.training:
        view = means.view(c)
        size = len(view.numbers())
        mine, at = columns[at : at + size], at + size
        rows, dof = means.residuals[c.name], means.dof[c.name]
        turn = view.bends() if bends else np.eye(size)
        for fold in range(FOLDS):
            kept = np.delete(rows, np.s_[fold::FOLDS], axis=0)
            v = covariances({c.name: kept}, {c.name: round(dof * (1 - 1 / FOLDS))}, turn)[c.name] + c.error
            whole = np.linalg.solve(v, mine)
            normal = mine.T @ whole
            w = whole @ np.linalg.pinv(normal, hermitian=True)[:, -1] * normal[-1, -1]
            sought += float(w @ mine[:, -1])
            spread += float(np.mean((rows[fold::FOLDS] @ w) ** 2) + w @ c.error @ w)
    information = sought / np.sqrt(FOLDS * spread)
    return 1 / information if information > 0 else np.inf


def table(model: Packings) -> list[str]:
    """Markdown, a line for every law of one number that was run."""
    s = model.state
    lines = ["| law | number | one standard error | found from | bends over angles |", "|---|---|---|---|---|"]
    for x in model.candidates:
        whole = None if x.apparatus or x.numbers > 1 else model_of(s, [x])
        if whole is None:
            continue
        plain = {c.name: np.eye(len(c.seen)) for c in s.training}
        columns = columns_of(s, whole, whole.centre, plain)
        bends, angles = (standard_error(s.means, s, columns, k) for k in (True, False))
        free = x.term.free[0]
        sure = f"{SURE * bends:.2g}" + f" off {free.neutral:.3g}" * bool(free.neutral)
        unit = "" if free.unit == "1" else f" {free.unit}"
        lines.append(f"| {x.label} | {free.name} | {bends:.2g}{unit} | {sure} | {angles / bends:.2f} |")
    return lines


def page(recordings: Sequence[Recording]) -> str:
    model = Packings(recordings)
    model.recalibrate()
    model.try_candidates()
    films = "; ".join(
        f"{np.ptp(c.recording.t):.1f} s at {c.frequency:.3g} Hz, {len(c.scene.chains[0])} disks, of which "
        f"{c.any_view.cycles:.1f} cycles are learnt from" for c in model.state.training
    )  # fmt: skip
    return "\n".join([
        "# What a film tells of which only the swimmer is seen", "",
        "Made by `python -m granswim_pymunk.benchmarks.unseen_power RECORDING ... --page FILE`; do not edit.", "",
        f"Films: {films}.", "",
        "One standard error is that of one such film (or of all together), whose own packing is the noise, what",
        "adjustables imitate taken off; a law is found from about five on. The last column is by how many times",
        "correlations that are shrunk between bends at joints, not between angles of segments, tell it more surely;",
        "both are judged by packings that the covariance was not made of.", "",
        *table(model), "",
    ])  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", metavar="RECORDING")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the page here")
    args = parser.parse_args(argv)
    try:
        text = page([read_recording(name) for name in args.recordings])
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if args.page:
        args.page.write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
