"""What the paper's figures share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ..report.style import STYLE
from .results import Results

COLOURS = {100.0: "#5e3c99", 150.0: "#1b7837", 200.0: "#d95f02", 500.0: "#0072b2"}
BY_FREQUENCY = {4.0: "#0072b2", 6.0: "#56b4e9", 9.0: "#d55e00", 11.0: "#e69f00", 15.0: "#009e73", 20.0: "#777777"}
MODE_1, MODE_2 = "#0072b2", "#e69f00"


Draw = Callable[[Results], Figure | None]


def styled(draw: Draw) -> Draw:
    """Draw with the fonts and lines of all figures; a claim without runs has no figure."""

    @functools.wraps(draw)
    def wrapped(results: Results) -> Figure | None:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(STYLE)
            figure = draw(results)
            if figure is not None:
                figure.canvas.draw()  # the layout is settled here, while the style holds
            return figure

    return wrapped


def curve(axis: Any, results: Results, name: str, scale: float = 1.0, label: str = "", **conditions: Any) -> int:
    """A quantity against frequency with 95 % bars; returns the fewest packings of its points.

    Two packings have no bar, as theirs would be thirteen times their spread: open points.
    """
    style: dict[str, Any] = {k: conditions.pop(k) for k in ("color", "marker", "linestyle", "alpha") if k in conditions}
    frequency = results.frequencies(**conditions)
    rows = [results.mean(name, **conditions, frequency=f) for f in frequency]
    if not rows:
        return 0
    mean = np.array([r[0] for r in rows]) * scale
    error = np.nan_to_num(np.array([r[1] for r in rows])) * scale
    style = {"marker": "o", "markersize": 4, **style}
    few = np.array([r[2] for r in rows]) < 3
    drawn = axis.errorbar(frequency, mean, np.where(few, 0.0, error), label=label, capsize=2, **style)
    at = np.array(frequency)[few]
    axis.plot(at, mean[few], "o", markersize=4, markerfacecolor="white", color=drawn.lines[0].get_color(), zorder=5)
    return min(r[2] for r in rows)


def legend(axis: Any, **kwargs: Any) -> None:
    """A legend where there is something to name."""
    if axis.get_legend_handles_labels()[0]:
        axis.legend(**kwargs)


def frequency_axis(axis: Any, label: str) -> None:
    axis.set_xlabel("frequency f [Hz]")
    axis.set_ylabel(label)


__all__ = ["BY_FREQUENCY", "COLOURS", "MODE_1", "MODE_2", "curve", "frequency_axis", "legend", "styled"]
