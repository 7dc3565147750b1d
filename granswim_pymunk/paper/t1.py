"""T1: the table of natural and resonant frequencies, and the modes of the law that is simulated."""

import math

import numpy as np
from matplotlib.figure import Figure

from ..analysis.resonance import PRINTED_DAMPING, PRINTED_MASS, linearised_modes, resonance_table
from .claim import FAILS, HOLDS, Claim, Finding
from .draw import COLOURS, styled
from .results import Results
from .scenes import paper_scene

FORMS = ("leader", "elastic", "head_axis")


def judge(results: Results) -> list[Finding]:
    rows = resonance_table()
    findings = [
        Finding(
            says="natural angular frequencies of modes 1 and 2 for k_B 100, 150, 200, 500",
            measured=", ".join(f"{r.natural:.2f}" for r in rows) + " rad/s",
            verdict=HOLDS if all(r.natural_agrees for r in rows) else FAILS,
            note=f"to the printed digits with m = {PRINTED_MASS} g and gamma_B = {PRINTED_DAMPING:g} 1/s",
        )
    ]
    wrong = [f"k_B {r.label:g} mode {r.mode}: {text}" for r in rows for text in r.misprints]
    findings.append(
        Finding(
            says="resonant angular frequencies omega_0 sqrt(1 - 2 xi^2)",
            measured=", ".join(f"{r.resonant_computed:.2f}" for r in rows) + " rad/s",
            verdict=HOLDS if not wrong else FAILS,
            note="misprints: " + "; ".join(wrong) if wrong else "",
        )
    )
    printed = resonance_table(damping=1e3)[0].xi
    findings.append(
        Finding(
            says="gamma_B = 10^3 1/s, lightly damped (xi about 0.3)",
            measured=f"gamma_B = 10^3 1/s gives xi = {printed:.2f}; the table's xi need 10^2 1/s",
            verdict=FAILS,
            note="a misprint of gamma_B; with xi above 0.71 there is no resonance",
        )
    )
    for form in FORMS:
        modes = linearised_modes(paper_scene(form=form, k_B_scale=results.setting.k_B_scale))
        findings.append(
            Finding(
                says="the second mode of the swimmer lies at 9.06 Hz (k_B 100)",
                measured=f"bending law `{form}` as simulated: modes 1, 2 at {modes.natural[0]:.1f}, "
                f"{modes.natural[1]:.1f} Hz",
                verdict=FAILS,
                value=float(modes.natural[1]),
                unit="Hz",
                note="the table's chain has masses that move along a line; a bending law acts through angles",
            )
        )
    return findings


@styled
def draw(results: Results) -> Figure:
    figure = Figure(figsize=(6.8, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    rows = resonance_table()
    for row in rows:
        left.plot(row.label, row.resonant_printed / (2 * math.pi), "s", color="#bbbbbb", markersize=9)
        left.plot(row.label, row.resonant_computed / (2 * math.pi), "o", color=COLOURS[row.label], markersize=4)
    left.set_xlabel("label k_B")
    left.set_ylabel("resonant frequency [Hz]")
    left.set_title("chain: squares printed, dots computed")
    for mode in (1, 2):
        last = next(r for r in rows if r.mode == mode and r.label == 500.0)
        left.annotate(f"mode {mode}", (last.label, last.resonant_computed / (2 * math.pi)), (-10, -3),
                      textcoords="offset points", ha="right", fontsize=8)  # fmt: skip
    labels = np.array([100.0, 150.0, 200.0, 300.0, 400.0, 500.0])
    for form, style in zip(FORMS, ("-", "--", ":"), strict=True):
        scale = results.setting.k_B_scale
        second = [linearised_modes(paper_scene(form=form, k_B=k, k_B_scale=scale)).natural[1] for k in labels]
        right.plot(labels, second, style, color="#222222", label=form)
    right.plot(
        [r.label for r in rows if r.mode == 2], [r.resonant_computed / (2 * math.pi) for r in rows if r.mode == 2],
        "o", color="#5e3c99", markersize=4, label="the table's mode 2",
    )  # fmt: skip
    right.set_xlabel("label k_B")
    right.set_ylabel("second mode [Hz]")
    right.set_title("bending laws as simulated, linearised")
    right.legend()
    return figure


CLAIM = Claim("T1", "Resonance table", "table of appendix A", (), judge, draw)
