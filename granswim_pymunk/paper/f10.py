"""F10: the optimum against grain size and width of the channel."""

from matplotlib.figure import Figure

from .claim import Claim, Finding
from .draw import curve, frequency_axis, legend, styled
from .f3 import peaked
from .plans import SIZES
from .results import Results

SPARE = (
    "; a smaller box at the same packing fraction has less area to spare, and the free speed hangs on that: see "
    "convergence"
)
NAMES = {"grain_diameter": "mean grain", "height": "L_y"}


def title(size: dict[str, float]) -> str:
    return ", ".join(f"{NAMES[k]} {1e3 * v:g} mm" for k, v in size.items())


def judge(results: Results) -> list[Finding]:
    findings = []
    for size in ({}, *SIZES):
        verdict, text, n = peaked(results, dict(size))
        findings.append(
            Finding(
                says="the optimum does not move with grain size or L_y",
                measured=f"{title(size) or 'mean grain 1.5 mm, L_y 50 mm'}: {text}",
                verdict=verdict if size else f"for comparison: {verdict}", packings=n,
                note="holds: fastest at 9 Hz of 4, 9 and 15 Hz" + (SPARE if "height" in size else ""),
            )
        )  # fmt: skip
    return findings


@styled
def draw(results: Results) -> Figure | None:
    figure = Figure(figsize=(6.8, 2.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for axis, kind in zip(axes, NAMES, strict=True):
        curve(axis, results, "speed", 1e3, "as in the main text", color="#5e3c99")
        for size, colour in zip([s for s in SIZES if kind in s], ("#d95f02", "#1b7837"), strict=False):
            curve(axis, results, "speed", 1e3, title(size), color=colour, **size)
        axis.axvline(9.06, color="#5e3c99", linewidth=1, zorder=0)
        axis.axhline(0, color="#bbbbbb", linewidth=0.8, zorder=0)
        frequency_axis(axis, "speed, head first [mm/s]")
        legend(axis, fontsize=7)
    return figure if axes[0].containers else None


CLAIM = Claim("F10", "Grain size and size of the box", "Fig. 10, appendix D", ("free", "sizes"), judge, draw)
