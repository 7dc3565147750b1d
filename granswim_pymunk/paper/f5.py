"""F5: directions of the contact forces on head, centre and tail in the first two modes (4 and 9 Hz)."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .claim import Claim, Finding, above, number, within
from .draw import MODE_1, MODE_2, styled
from .results import CENTRE, HEAD, TAIL, Results

MODES = ((4.0, "first mode (4 Hz)", MODE_1), (9.0, "second mode (9 Hz)", MODE_2))
PLACES = ((HEAD, "head"), (CENTRE, "centre"), (TAIL, "tail"))


def judge(results: Results) -> list[Finding]:
    from ..analysis.speed import mean_error

    findings = []
    for f, name, _ in MODES:
        lean = results.values("lean_x", frequency=f)
        n = len(lean)
        mean, error = mean_error(lean) if n else (np.full(TAIL + 1, np.nan),) * 2
        value, half = float(mean[HEAD]), float(error[HEAD])
        findings.append(
            Finding(
                says="head: contacts push against the direction of motion",
                measured=f"{name}: mean x of the pushes {number(value, half)} (+1: straight back)",
                verdict=above(value, half), value=value, error=half, packings=n,
            )
        )  # fmt: skip
        value, half = float(mean[CENTRE]), float(error[CENTRE])
        findings.append(
            Finding(
                says="centre: symmetric, mostly across the motion",
                measured=f"{name}: mean x of the pushes {number(value, half)}",
                verdict=within(value, half, -0.15, 0.15), value=value, error=half, packings=n,
                note="symmetric: within ± 0.15",
            )
        )  # fmt: skip
    d, e, n = results.difference("lean_x", {"frequency": 4.0}, {"frequency": 9.0}, lambda v: v[TAIL])
    findings.append(
        Finding(
            says="tail: in the second mode the pushes shift to the direction of motion",
            measured=f"mean x of the pushes falls by {number(d, e)} from the first mode to the second (-x is ahead)",
            verdict=above(d, e), value=d, error=e, packings=n,
        )
    )  # fmt: skip
    return findings


@styled
def draw(results: Results) -> Figure | None:
    figure = Figure(figsize=(6.8, 2.7), layout="constrained")
    drawn = False
    for k, (disk, place) in enumerate(PLACES):
        axis = figure.add_subplot(1, 3, k + 1, projection="polar")
        for f, name, colour in MODES:
            counts = results.values("direction_count", frequency=f)
            if not len(counts):
                continue
            total = counts[:, disk].sum(axis=0)
            edges = np.linspace(-np.pi, np.pi, len(total) + 1)
            middle = 0.5 * (edges[1:] + edges[:-1])
            axis.bar(middle, total / total.sum(), width=edges[1] - edges[0], color=colour, alpha=0.55, label=name)
            drawn = True
        axis.set_title(place)
        axis.yaxis.set_major_locator(MaxNLocator(3))
        axis.set_yticklabels([])
        axis.tick_params(labelsize=7)
    if not drawn:
        return None
    figure.suptitle("contacts by the direction of their push; the swimmer moves to the left ←", fontsize=8)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


CLAIM = Claim("F5", "Directions of contact forces", "Fig. 5", ("free",), judge, draw)
