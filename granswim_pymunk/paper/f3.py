"""F3a and F3b: speed under friction with the substrate, calibrated, and for beds of 1, 2 and 3 cm."""

import itertools

import numpy as np
from matplotlib.figure import Figure

from .calibrate import third_of_free
from .claim import CALIBRATED, OPEN, Claim, Finding, above, least, number
from .draw import curve, frequency_axis, legend, styled
from .plans import FRICTION
from .results import Results
from .scenes import LAYERS

STEPS = tuple(sorted({0.0, *FRICTION}))  # s/m, far enough apart to tell the speeds apart
SHADES = {0.055: "#56b4e9", 0.11: "#e69f00", 0.16: "#cc79a7", 0.22: "#009e73"}
CALIBRATED_SHADE = "#d55e00"


def judge_a(results: Results) -> list[Finding]:
    findings = []
    usual = results.setting.mu_eff
    for low, high in itertools.pairwise(STEPS):
        first = {"frequency": 9.0} if low == 0 else {"frequency": 9.0, "layers": 11.0, "mu_eff": low}
        second = {"frequency": 9.0, "layers": 11.0, "mu_eff": high}
        d, e, n = results.difference("speed", first, second)
        findings.append(
            Finding(
                says="speed falls as mu_eff grows (9 Hz, 11 layers)",
                measured=f"from mu_eff {low:g} to {high:g} s/m it falls by {number(d, e, 'mm/s', 1e3)}",
                verdict=above(d, e), value=d, error=e, unit="m/s", packings=n,
            )
        )  # fmt: skip
    found = third_of_free(results)
    ratio = f"free over confined speed {found.ratio:.2f} at mu_eff {usual:g} s/m" if np.isfinite(found.ratio) else ""
    findings.append(
        Finding(
            says="free speed is three times the confined one; mu_eff = 0.22",
            measured=f"{ratio or 'no runs'}; a third at mu_eff = {found.text}",
            verdict=CALIBRATED if np.isfinite(found.mu_eff) else OPEN,
            value=found.mu_eff, error=found.error, unit="s/m", packings=found.packings,
            note="mu_eff is fitted to this ratio here as in the paper, so it is no evidence",
        )
    )  # fmt: skip
    for mu in results.setting.friction:
        verdict, text, n = peaked(results, {"layers": 11.0, "mu_eff": mu})
        findings.append(
            Finding(
                says="speed against frequency has a maximum inside", measured=f"mu_eff {mu:g} s/m: {text}",
                verdict=verdict, packings=n,
            )
        )  # fmt: skip
    return findings


def peaked(results: Results, conditions: dict[str, float]) -> tuple[str, str, int]:
    """Whether the speed at 9 Hz lies above those at 4 and 15 Hz."""
    texts, verdicts, counts = [], [], []
    for other in (4.0, 15.0):
        d, e, n = results.difference("speed", {**conditions, "frequency": 9.0}, {**conditions, "frequency": other})
        texts.append(f"9 over {other:g} Hz by {number(d, e, 'mm/s', 1e3)}" if n else f"no runs at 9 and {other:g} Hz")
        verdicts.append(above(d, e))
        counts.append(n)
    worst = "does not hold" if "does not hold" in verdicts else OPEN if OPEN in verdicts else "holds"
    return worst, ", ".join(texts), least(counts)


def judge_b(results: Results) -> list[Finding]:
    findings = []
    for height, layers in LAYERS.items():
        verdict, text, n = peaked(results, {"layers": float(layers)})
        findings.append(
            Finding(
                says="the optimum frequency does not depend on the height of the bed",
                measured=f"{height} cm ({layers} layers): {text}", verdict=verdict, packings=n,
                note="holds: fastest at 9 Hz of 4, 9 and 15 Hz, as the free swimmer should be",
            )
        )  # fmt: skip
    for first, second in ((5.0, 11.0), (11.0, 18.0)):
        one, two = {"frequency": 9.0, "layers": first}, {"frequency": 9.0, "layers": second}
        d, e, n = results.difference("speed", one, two)
        findings.append(
            Finding(
                says="a higher bed slows the swimmer (9 Hz)",
                measured=f"from {first:g} to {second:g} layers by {number(d, e, 'mm/s', 1e3)}",
                verdict=above(d, e), value=d, error=e, unit="m/s", packings=n,
            )
        )  # fmt: skip
    return findings


@styled
def draw_a(results: Results) -> Figure | None:
    figure = Figure(figsize=(4.4, 3.0), layout="constrained")
    axis = figure.subplots()
    curve(axis, results, "speed", 1e3, "free", color="#222222")
    for mu in results.setting.friction:
        usual = mu == results.setting.mu_eff
        name = f"μ_eff = {mu:g} s/m" + ", calibrated" * usual
        colour = CALIBRATED_SHADE if usual else SHADES[mu]
        curve(axis, results, "speed", 1e3, name, color=colour, layers=11.0, mu_eff=mu)
    axis.axhline(0, color="#bbbbbb", linewidth=0.8, zorder=0)
    frequency_axis(axis, "speed, head first [mm/s]")
    legend(axis, loc="lower left", fontsize=7.5)
    return figure if axis.lines else None


@styled
def draw_b(results: Results) -> Figure | None:
    figure = Figure(figsize=(4.4, 3.0), layout="constrained")
    axis = figure.subplots()
    for (height, layers), colour in zip(LAYERS.items(), ("#56b4e9", "#d55e00", "#009e73"), strict=True):
        curve(axis, results, "speed", 1e3, f"{height} cm, {layers} layers", color=colour, layers=float(layers))
    axis.axhline(0, color="#bbbbbb", linewidth=0.8, zorder=0)
    frequency_axis(axis, "speed, head first [mm/s]")
    legend(axis)
    return figure if axis.lines else None


CLAIM_A = Claim("F3a", "Speed under friction", "Fig. 3a", ("free", "friction"), judge_a, draw_a)
CLAIM_B = Claim("F3b", "Beds of 1, 2 and 3 cm", "Fig. 3b", ("friction", "heights"), judge_b, draw_b)

