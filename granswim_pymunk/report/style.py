"""What all figures share: colours, fonts, prefixes of units, the grid of small panels."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import matplotlib
from matplotlib.figure import Figure

NAIVE = "#d55e00"
RECALIBRATED = "#e69f00"
REVISED = "#0072b2"
FLOOR = "#777777"
SEEN = "#222222"
MUTED = "#9a9a9a"
SHADE = "#e8edf4"  # held out
COLOURS = {"naive": NAIVE, "recalibrated": RECALIBRATED, "revised": REVISED, "floor": FLOOR}

WIDTH = 6.8  # inches: text of 9 points is still read when a phone shows the figure 480 px wide

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelcolor": "#222222",
    "ytick.labelcolor": "#222222",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.dpi": 170,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
}

_PREFIXES = ((1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"))


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn when it is wanted: its section of the page, its caption and what stands for it in text.

    caption : HTML;  alt : plain text, the caption's first sentence where it is empty
    """

    draw: Callable[[], Figure]
    section: str
    caption: str
    alt: str = ""


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Draw with the page's fonts and lines, whatever the user's matplotlib is set to."""

    @functools.wraps(draw)
    def wrapped(*args: Any, **kwargs: Any) -> Figure:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(STYLE)
            figure = draw(*args, **kwargs)
            # the layout is settled here, while the style holds
            figure.canvas.draw()
            return figure

    return wrapped


def prefixed(unit: str, size: float) -> tuple[float, str]:
    """Factor and label of a unit that fits numbers of this size: ("m", 2e-3) gives (1e3, "mm").

    Units with kg, and powers, keep their unit: a milli-kilogram helps nobody.
    """
    if not unit or unit == "1" or "kg" in unit or "^" in unit or not math.isfinite(size) or size <= 0:
        return 1.0, unit
    for scale, prefix in reversed(_PREFIXES):
        if size >= scale * 0.999 and not (prefix == "k" and size < 1e4):
            return 1 / scale, prefix + unit
    return 1e9, "n" + unit


def plain(text: str) -> str:
    """A name as it stands: a dollar sign in it begins no formula."""
    return text.replace("$", r"\$")


def shortened(text: str, most: int = 26) -> str:
    """A long name with its middle left out, so that numbers at its end stay."""
    text = plain(text)
    return text if len(text) <= most else text[: most // 2] + "…" + text[-(most - most // 2 - 1) :]


def panels(
    count: int, *, columns: int, height: float, width: float = WIDTH, top: float = 0.0, **kwargs: Any
) -> tuple[Figure, list[Any]]:
    """A figure with ``count`` axes in a grid; ``height`` [inch] of each row, ``top`` room for a legend."""
    columns = max(1, min(columns, count))
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(width, rows * height + top), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, **kwargs)
    axes = list(grid.ravel())
    for axis in axes[count:]:
        axis.remove()
    return figure, axes[:count]


def legend_above(figure: Figure, handles: list[Any], columns: int | None = None) -> None:
    """One legend for the whole figure, above it."""
    figure.legend(
        handles=handles, loc="outside upper left", ncols=columns or min(len(handles), 5), handlelength=1.8,
        columnspacing=1.4, borderaxespad=0.2,
    )  # fmt: skip


def superscript(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def compact(value: float) -> str:
    """Three significant digits, powers of ten beyond 1e4 or below 1e-3."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -3 <= exponent < 4:
        digits = max(2 - exponent, 0)
        return f"{value:.{digits}f}".replace("-", "−")
    return f"{value / 10**exponent:.1f}×10{superscript(exponent)}".replace("-", "−")
