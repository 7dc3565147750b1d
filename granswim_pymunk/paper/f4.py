"""F4: the optimum frequency for each k_B against the second resonance."""

import numpy as np
from matplotlib.figure import Figure

from ..analysis.resonance import linearised_modes, second_resonance
from .claim import CALIBRATED, FAILS, HOLDS, OPEN, Claim, Finding, least, number, peaks
from .draw import COLOURS, curve, frequency_axis, legend, styled
from .results import Results
from .scenes import bending_stiffness, paper_scene

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


def relative(results: Results) -> list[Finding]:
    """The optima against each other: what is left of the claim when label 100 sets the scale of k_B."""
    found = {label: optimum(results, k_B=label) for label in LABELS}
    used_now = bending_stiffness(LABELS[0], results.setting.k_B_scale)
    inside = {
        k: np.isfinite(best) and results.frequencies(k_B=k)[0] < best < results.frequencies(k_B=k)[-1]
        for k, (best, _, _) in found.items()
    }
    rng = np.random.default_rng(2)  # each label's draws in an order of its own, as they are independent
    drawn = {k: rng.permutation(found[k][1]) for k in LABELS}
    base = LABELS[0]
    findings = []
    for label in LABELS[1:]:
        table = second_resonance(label) / second_resonance(base)
        says = f"k_B {label:g}: the optimum is {table:.2f} times that of k_B {base:g} (which sets the scale of k_B)"
        if not np.isfinite(found[label][0] + found[base][0]):
            findings.append(Finding(says=says, measured="too few packings", verdict=OPEN))
            continue
        ratio = found[label][0] / found[base][0]
        low, high = middle(drawn[label] / drawn[base])
        open_ = not (inside[label] and inside[base]) or high - low > 0.5 * ratio
        findings.append(
            Finding(
                says=says, measured=f"{ratio:.2f} times (95 %: {low:.2f} to {high:.2f})",
                verdict=OPEN if open_ else HOLDS if low <= table <= high else FAILS,
                value=ratio, error=(high - low) / 2, packings=least([found[label][2], found[base][2]]),
            )
        )  # fmt: skip
    used = [k for k in LABELS if inside[k]]
    if base in used and len(used) > 1:
        x = np.log(used)
        slope = float(np.polyfit(x, np.log([found[k][0] for k in used]), 1)[0])
        low, high = middle(np.polyfit(x, np.log([drawn[k] for k in used]), 1)[0])
        table = float(np.polyfit(x, np.log([second_resonance(k) for k in used]), 1)[0])
        scale = (second_resonance(base) / found[base][0]) ** (1 / slope)
        spread = middle((second_resonance(base) / drawn[base]) ** (1 / slope))
        findings.append(
            Finding(
                says="the optimum is the second resonance: what scale of k_B that takes",
                measured=f"optimum proportional to k_B^{slope:.2f} (95 %: {low:.2f} to {high:.2f}), the table's second "
                f"resonance to k_B^{table:.2f}; they meet at k_B 100 with {scale:.2f} of the scale used (95 %: "
                f"{spread[0]:.2f} to {spread[1]:.2f}), {1e3 * scale * used_now:.2f} mN per radian",
                verdict=CALIBRATED, value=scale, error=(spread[1] - spread[0]) / 2,
                packings=least([found[k][2] for k in used]),
            )
        )  # fmt: skip
    return findings


def _second_mode(results: Results, label: float) -> float:
    """Of the bending law as simulated, linearised [Hz]."""
    scene = paper_scene(k_B=label, k_B_scale=results.setting.k_B_scale)
    return float(linearised_modes(scene).natural[1])


def judge(results: Results) -> list[Finding]:
    findings = []
    for label in LABELS:
        table, linear = second_resonance(label), _second_mode(results, label)
        best, drawn, n = optimum(results, k_B=label)
        low, high = middle(drawn)
        verdict = OPEN if not np.isfinite(best) else HOLDS if low <= table <= high else FAILS
        ends = results.frequencies(k_B=label)
        note = "sets the k_B scale, so it is no evidence; " if label == 100.0 else ""
        if np.isfinite(best):
            note += f"speeds were measured from {ends[0]:g} to {ends[-1]:g} Hz"
            if best in (ends[0], ends[-1]):
                verdict, note = OPEN, note + "; the largest lies at the end of that range"
            elif label == 100.0:
                verdict = CALIBRATED
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
    findings += relative(results)
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
        axis.axvline(_second_mode(results, label), color=COLOURS[label], linewidth=0.8, linestyle=":", zorder=0)
    axis.axvline(3.82, color=COLOURS[100.0], linewidth=1, linestyle="--", zorder=0)
    axis.axhline(0, color="#bbbbbb", linewidth=0.8, zorder=0)
    axis.set_xlim(0, 38)
    frequency_axis(axis, "speed, head first [mm/s]")
    axis.set_title("solid: the table's mode 2; dashed: its mode 1; dotted: mode 2 as simulated", fontsize=8)
    legend(axis, loc="upper left", frameon=True, framealpha=1.0, edgecolor="white")
    return figure if axis.containers else None


CLAIM = Claim("F4", "Optimum frequency against k_B", "Fig. 4", ("free", "k_B"), judge, draw)
