"""``python -m granswim_pymunk.validation.swings [--source FILE] [--json FILE]``: two arms, followed in windows.

The swing of the shipped double pendulum over 48 s is chaotic: no run follows it to its end. So each law is fitted to
the first 60 %, in segments as long as one start can be followed, and the last 40 % are cut into windows of 1 s and of
4 s. The start of each is fitted on its first third, the rest is predicted, without friction and with it. Printed is
what is left of the error of the scene without friction, a table in Markdown.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.candidates import named_terms, scaled_like
from granswim_pymunk.inference.criteria import current
from granswim_pymunk.inference.data import Case, prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor, Term
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.fitted import Fit
from granswim_pymunk.inference.tracks.held_out import window_errors
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import Recording
from granswim_pymunk.recording.importers import import_double_pendulum

from .output import write_json

SOURCE = Path("recordings/double_pendulum/source/double_pendulum_200Hz_48s.csv")  # in the package
WINDOWS = (1.0, 4.0)  # s
EACH = " (each body)"
LAWS: dict[str, tuple[str, ...]] = {
    "viscous, in each joint": ("joint_drag" + EACH,),
    "dry, in each joint": ("joint_friction" + EACH,),
    "viscous and dry, in each joint": ("joint_drag" + EACH, "joint_friction" + EACH),
    "drag of the air, of each arm": ("quadratic_drag" + EACH,),
}


@dataclass(frozen=True)
class Row:
    """What one set of laws leaves: its numbers with units, and errors [rad rms] in the windows of each length [s]."""

    name: str
    numbers: dict[str, tuple[float, str]]
    errors: dict[float, float]


def windows_of(case: Case, predictor: Predictor, hypothesis: Hypothesis, values: np.ndarray) -> dict[float, float]:
    """Errors [rad rms] of held-out windows of each length [s] after their starts."""
    rows = np.flatnonzero(case.scored)
    result = {}
    for length in WINDOWS:
        if case.t[rows[-1]] - case.t[rows[0]] < length * (1 - 1e-3):
            continue
        found = window_errors(hypothesis, values, case, rows, length, predictor, current().blocks.start)
        result[length] = float(np.sqrt(np.nanmean(found**2)))
    return result


def compared(recording: Recording, laws: dict[str, tuple[str, ...]], say: Callable[[str], None]) -> list[Row]:
    """The scene as it is, and with each set of laws fitted to the first 60 % of a recording. Raises InputError."""
    case = prepare(recording, held_out=False, split=True)
    predictor = Predictor(time_steps([case]))
    fitter = Fitter([case], predictor)
    base = fitter.fit(Hypothesis(), None)
    rows = [Row("nothing", {}, windows_of(case, predictor, Hypothesis(), np.zeros(0)))]
    say(f"{len(fitter.segments[case.name])} segments; without friction {_told(rows[0].errors)}")
    known = {t.label: t for t in named_terms([case])}
    for name, labels in laws.items():
        fit = _fitted(fitter, base, [known[label] for label in labels])
        free = fit.hypothesis.free
        # what changes the prediction by less than the noise is none
        told = [0.0 if abs(v - f.neutral) < f.scale else float(v) for f, v in zip(free, fit.values, strict=True)]
        numbers = {f.name: (v, f.unit) for f, v in zip(free, told, strict=True)}
        rows.append(Row(name, numbers, windows_of(case, predictor, fit.hypothesis, fit.values)))
        say(f"{name}: {_told(rows[-1].errors)}")
    return rows


def _fitted(fitter: Fitter, base: Fit, terms: Sequence[Term]) -> Fit:
    scaled = [scaled_like(t, s.term) for t, s in zip(terms, make_bank(fitter, base, terms).signatures, strict=True)]
    hypothesis = base.hypothesis.with_term(*scaled)
    neutral = [f.neutral for f in hypothesis.free]
    return fitter.fit(hypothesis, neutral, base.starts, evaluations=current().intervals.refit)


def _told(errors: dict[float, float]) -> str:
    return ", ".join(f"{error:.3g} rad in {length:g} s" for length, error in errors.items())


def table(rows: Sequence[Row]) -> str:
    """Markdown: what is left of the first row's errors."""
    lengths = list(rows[0].errors)
    head = ["friction", "numbers", *(f"left in windows of {length:g} s" for length in lengths)]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        numbers = ", ".join(f"`{k}` {v:.3g} {unit}" for k, (v, unit) in row.numbers.items())
        shares = [row.errors[length] / rows[0].errors[length] for length in lengths]
        cells = [row.name, numbers, *(f"{share:.2f}" for share in shares)]
        if row is rows[0]:
            cells[2:] = [f"1 ({row.errors[length]:.2g} rad)" for length in lengths]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def shipped() -> Path:
    """The file of 48 s that comes with the package."""
    import granswim_pymunk

    return Path(granswim_pymunk.__file__).parent / SOURCE


def main(argv: Sequence[str] | None = None, laws: dict[str, tuple[str, ...]] | None = None) -> int:
    how = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="swings", description=__doc__, formatter_class=how)
    parser.add_argument("--source", type=Path, metavar="FILE", help="table of t_s, theta1_rad, theta2_rad")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the numbers")
    args = parser.parse_args(argv)
    try:
        recording = import_double_pendulum(args.source or shipped())
        rows = compared(recording, laws or LAWS, lambda text: print(text, file=sys.stderr))
        print(table(rows))
        if args.json is not None:
            write_json([{"name": r.name, "numbers": r.numbers, "errors": r.errors} for r in rows], args.json)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
