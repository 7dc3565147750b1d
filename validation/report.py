"""All cases one after the other: table, plots, JSON."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pymunk
import scipy
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas

from granswim_pymunk.errors import InputError, SimulationError

from . import cases_bed, cases_bodies, cases_contact, cases_swimmer
from .results import Case, Figure, Panel

CaseFunction = Callable[..., Case]

# case, engine mode
CASES: tuple[tuple[CaseFunction, str], ...] = (
    (cases_contact.linear_collision, "verlet"),
    (cases_contact.hertz_collision, "verlet"),
    (cases_contact.impulse_collision, "verlet"),
    (cases_bodies.convergence, "verlet"),
    (cases_bodies.spring, "verlet"),
    (cases_bodies.motions, "verlet"),
    (cases_bodies.pendulum, "verlet"),
    (cases_swimmer.swimmer_modes, "verlet"),
    (cases_swimmer.elastic_bending, "verlet"),
    (cases_bed.elastic_bed, "verlet"),
    (cases_bed.momentum, "verlet"),
    *((cases_bed.against_reference, mode) for mode in ("verlet", "chipmunk", "python", "batch")),
    *(
        (cases_bed.against_other_code, mode)
        for mode in ("reference", "verlet", "chipmunk", "python", "batch")
    ),
)


def run_cases(quick: bool = False, cases: Sequence[tuple[CaseFunction, str]] = CASES) -> Iterator[Case]:
    """Run the cases and yield each as it is done. One that cannot run yields a figure that does not hold."""
    for function, mode in cases:
        try:
            yield function(mode, quick=quick)
        except (InputError, SimulationError, ArithmeticError, IndexError) as error:
            failed = Figure("did not run", math.nan, 0.0, note=f"{type(error).__name__}: {error}")
            yield Case(f"{function.__name__} ({mode})", (failed,))


def lines(case: Case) -> str:
    """The case as rows of a table: figure, value, bound, whether it holds."""
    rows = [case.name]
    for figure in case.figures:
        unit = "" if figure.unit == "1" else f" {figure.unit}"
        state = "holds" if figure.holds else "DOES NOT HOLD"
        row = f"  {figure.name:<64} {figure.value:9.2e}{unit:<4} <= {figure.bound:7.2g}{unit:<4} {state}"
        rows.append(f"{row}   {figure.note}".rstrip())
    return "\n".join(rows)


def to_dict(cases: Sequence[Case], seconds: float, quick: bool) -> dict[str, Any]:
    """Every figure with bound and whether it holds, for JSON; a value that is not finite is null."""
    figures = [
        {
            "case": case.name,
            "name": figure.name,
            "value": float(figure.value) if math.isfinite(figure.value) else None,
            "bound": figure.bound,
            "unit": figure.unit,
            "holds": bool(figure.holds),
            "note": figure.note,
        }
        for case in cases
        for figure in case.figures
    ]
    return {
        "format": "granswim-validation/1",
        "holds": all(case.holds for case in cases),
        "quick": quick,
        "seconds": round(seconds, 1),
        "versions": {
            "python": platform.python_version(),
            "pymunk": pymunk.version,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
        "figures": figures,
    }


def _draw(axes: Any, panel: Panel) -> None:
    for line in panel.lines:
        axes.plot(line.x, line.y, line.style, label=line.label or None, ms=5, lw=1)
    if "x" in panel.log:
        axes.set_xscale("log")
    if "y" in panel.log:
        axes.set_yscale("log")
    if not panel.log:
        axes.locator_params(axis="x", nbins=5)
    axes.set_title(panel.title, fontsize=10)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    if len(panel.lines) > 1:
        axes.legend(fontsize=7, frameon=False)
    axes.grid(alpha=0.3)


def plot(case: Case, folder: str | Path) -> Path | None:
    """Draw the case to one PNG in ``folder``; None where it has nothing to draw. Raises InputError."""
    if not case.panels:
        return None
    columns = min(len(case.panels), 3)
    rows = -(-len(case.panels) // columns)
    canvas = Canvas(figsize=(4.6 * columns, 3.6 * rows), layout="constrained")
    FigureCanvasAgg(canvas)
    for number, panel in enumerate(case.panels, start=1):
        _draw(canvas.add_subplot(rows, columns, number), panel)
    name = "".join(c if c.isalnum() else "_" for c in case.name).strip("_").replace("__", "_")
    path = Path(folder) / f"{name}.png"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        canvas.savefig(path, dpi=130)
    except OSError as error:
        raise InputError(f"cannot write it: {error.strerror}", file=path) from None
    return path


def validate(
    quick: bool = False,
    out: str | Path | None = None,
    say: Callable[[str], None] = print,
    cases: Sequence[tuple[CaseFunction, str]] = CASES,
) -> dict[str, Any]:
    """Run all cases, ``say`` each as it is done, draw it into ``out``; returns what goes into the JSON."""
    begin = time.perf_counter()
    done = []
    for case in run_cases(quick, cases):
        say(lines(case))
        if out is not None:
            plot(case, out)
        done.append(case)
    result = to_dict(done, time.perf_counter() - begin, quick)
    failed = sum(not figure["holds"] for figure in result["figures"])
    say(f"{len(result['figures'])} figures, {failed} of them do not hold; {result['seconds']:g} s")
    return result
