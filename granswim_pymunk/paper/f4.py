"""F4: the optimum frequency for each k_B against the second resonance."""

import numpy as np
from matplotlib.figure import Figure

from ..analysis.resonance import linearised_modes, second_resonance
from .claim import FAILS, HOLDS, OPEN, Claim, Finding, least, number, peaks
from .draw import COLOURS, curve, frequency_axis, legend, styled
from .results import Results
from .scenes import paper_scene

LABELS = (100.0, 150.0, 200.0, 500.0)


def optimum(results: Results, **conditions: float) -> tuple[float, np.ndarray, int]:
    """Frequency of the largest mean speed [Hz], where it might as well have been, fewest packings; NaN with too few."""
    frequency = results.frequencies(**conditions)
    speeds = [results.values("speed", **conditions, frequency=f) for f in frequency]
    counts = [len(s) for s in speeds]
    if len(frequency) < 3 or min(counts) < 2:
        return np.nan, np.array([np.nan]), least(counts)
    best, drawn = peaks(np.array(frequency), speeds, np.random.default_rng(1))
    return best, drawn, min(counts)


def middle(values: np.ndarray) -> tuple[float, float]:
    """Central 95 % of the draws."""
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def growth(results: Results) -> Finding:
    """How the optimum grows with k_B against how the table's second resonance does."""
    found = {label: optimum(results, k_B=label) for label in LABELS}
    used = [k for k in LABELS if np.isfinite(found[k][0])]
    says = "the optimum rises with k_B as the second resonance does"
    if len(used) < 2:
        return Finding(says=says, measured="too few packings", verdict=OPEN)
    x = np.log(used)
    table = float(np.polyfit(x, np.log([second_resonance(k) for k in used]), 1)[0])
    linear = float(np.polyfit(x, np.log([linearised_modes(paper_scene(k_B=k)).natural[1] for k in used]), 1)[0])
    slope = float(np.polyfit(x, np.log([found[k][0] for k in used]), 1)[0])
    # each label's draws in an order of its own, as they are independent
    rng = np.random.default_rng(2)
    drawn = np.array([rng.permutation(found[k][1]) for k in used])
    low, high = middle(np.polyfit(x, np.log(drawn), 1)[0])
    inside = all(results.frequencies(k_B=k)[0] < found[k][0] < results.frequencies(k_B=k)[-1] for k in used)
    ratio = ", ".join(f"{found[k][0] / second_resonance(k):.2f}" for k in used)
    return Finding(
        says=says,
        measured=f"d ln f/d ln k_B is {slope:.2f} (95 %: {low:.2f} to {high:.2f}) for the optimum, {table:.2f} for the "
        f"table's second resonance, {linear:.2f} for the second mode as simulated; optimum over the table's: {ratio} "
        f"(k_B {', '.join(f'{k:g}' for k in used)})",
        verdict=OPEN if not inside or high - low > 0.5 else HOLDS if low <= table <= high else FAILS,
        value=slope, error=(high - low) / 2, packings=least([found[k][2] for k in used]),
        note="independent of the scale of k_B" + ("" if inside else "; an optimum lies at the end of its range"),
    )  # fmt: skip


def judge(results: Results) -> list[Finding]:
    findings = []
    for label in LABELS:
        table, linear = second_resonance(label), float(linearised_modes(paper_scene(k_B=label)).natural[1])
        best, drawn, n = optimum(results, k_B=label)
        low, high = middle(drawn)
        verdict = OPEN if not np.isfinite(best) else HOLDS if low <= table <= high else FAILS
        ends = results.frequencies(k_B=label)
        note = "sets the k_B scale, so it is no evidence; " if label == 100.0 else ""
        if np.isfinite(best):
            note += f"speeds were measured from {ends[0]:g} to {ends[-1]:g} Hz"
            if best in (ends[0], ends[-1]):
                verdict, note = OPEN, note + "; the largest lies at the end of that range"
            elif verdict == HOLDS and high - low > 0.5 * (ends[-1] - ends[0]):
                verdict, note = OPEN, note + "; the interval spans more than half of them"
        findings.append(
            Finding(
                says=f"k_B {label:g}: the optimum is the second resonance, {table:.2f} Hz",
                measured=f"optimum {best:.1f} Hz (95 %: {low:.1f} to {high:.1f}), {best - table:+.1f} Hz from the "
                f"second resonance; second mode of the bending law as simulated {linear:.1f} Hz"
                if np.isfinite(best) else "too few packings",
                verdict=verdict, value=best, error=(high - low) / 2, unit="Hz", packings=n, note=note,
            )
        )  # fmt: skip
    findings.append(growth(results))
    for label in LABELS:
        frequency = results.frequencies(k_B=label)
        means = [results.mean("speed", k_B=label, frequency=f) for f in frequency]
        usable = [k for k, m in enumerate(means) if np.isfinite(m[1])]
        if len(usable) < 3:
            continue
        k = max(usable, key=lambda k: means[k][0])
        fast, n = means[k], least([means[j][2] for j in usable])
        first, last = usable[0], usable[-1]
        parts, verdicts = [], []
        for end in (first, last):
            one, two = {"k_B": label, "frequency": frequency[k]}, {"k_B": label, "frequency": frequency[end]}
            d, e, _ = results.difference("speed", one, two)
            if end != k:
                parts.append(f"{number(d, e, 'mm/s', 1e3)} above that at {frequency[end]:g} Hz")
            # a maximum at the end of the range may lie beyond it
            verdicts.append(OPEN if end == k else HOLDS if d - e > 0 else OPEN)
        findings.append(
            Finding(
                says=f"k_B {label:g}: speed is not monotone in f",
                measured=f"largest at {frequency[k]:g} Hz, {number(*fast[:2], 'mm/s', 1e3)}: " + ", ".join(parts),
                verdict=OPEN if OPEN in verdicts else HOLDS, value=fast[0], error=fast[1], unit="m/s", packings=n,
            )
        )  # fmt: skip
    return findings


@styled
def draw(results: Results) -> Figure | None:
    figure = Figure(figsize=(5.2, 3.3), layout="constrained")
    axis = figure.subplots()
    for label in LABELS:
        curve(axis, results, "speed", 1e3, f"k_B = {label:g}", color=COLOURS[label], k_B=label)
        axis.axvline(second_resonance(label), color=COLOURS[label], linewidth=1, zorder=0)
        linear = linearised_modes(paper_scene(k_B=label)).natural[1]
        axis.axvline(linear, color=COLOURS[label], linewidth=0.8, linestyle=":", zorder=0)
    axis.axvline(3.82, color=COLOURS[100.0], linewidth=1, linestyle="--", zorder=0)
    axis.axhline(0, color="#bbbbbb", linewidth=0.8, zorder=0)
    axis.set_xlim(0, 30)
    frequency_axis(axis, "speed, head first [mm/s]")
    axis.set_title("lines: second resonance of the table; dotted: second mode as simulated", fontsize=8)
    legend(axis)
    return figure if axis.containers else None


CLAIM = Claim("F4", "Optimum frequency against k_B", "Fig. 4", ("free", "k_B"), judge, draw)
