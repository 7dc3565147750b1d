"""F6: the work per cycle, as the paper defines it and as work is."""

import numpy as np
from matplotlib.figure import Figure

from ..analysis.resonance import second_resonance
from ..analysis.work import work_per_cycle
from .claim import FAILS, HOLDS, OPEN, Claim, Finding, above, least, number
from .draw import COLOURS, MODE_1, MODE_2, curve, frequency_axis, legend, styled
from .results import Results, nan_mean

MODES = ((4.0, "first mode (4 Hz)", MODE_1), (9.0, "second mode (9 Hz)", MODE_2))


def judge(results: Results) -> list[Finding]:
    findings = []
    for f, name, _ in MODES:
        once, pulse = results.mean("push_once", frequency=f), results.mean("push_pulse", frequency=f)
        ratio = results.values("push_pulse", frequency=f) / np.maximum(results.values("push_once", frequency=f), 1e-300)
        low = float(np.min(ratio)) if len(ratio) else np.nan
        findings.append(
            Finding(
                says="two peaks of propulsion in each cycle",
                measured=f"{name}: amplitude of F.v/|v| at 2 f {number(pulse[0], pulse[1], 'mN', 1e3)}, at f "
                f"{number(once[0], once[1], 'mN', 1e3)}",
                verdict=OPEN if not len(ratio) else HOLDS if low > 1 else OPEN if ratio.mean() > 1 else FAILS,
                packings=len(ratio), note="holds: larger at 2 f in every packing",
            )
        )  # fmt: skip
    d, e, n = results.difference("push_peak", {"frequency": 9.0}, {"frequency": 4.0})
    findings.append(
        Finding(
            says="peaks are higher in the second mode",
            measured=f"95th percentile of F.v/|v| is larger by {number(d, e, 'mN', 1e3)}",
            verdict=above(d, e), value=d, error=e, unit="N", packings=n,
        )
    )  # fmt: skip
    d, e, n = results.difference("work_spread", {"frequency": 9.0}, {"frequency": 4.0})
    findings.append(
        Finding(
            says="the distribution of W_T is wider in the second mode",
            measured=f"its standard deviation is larger by {number(d, e, 'µN s', 1e6)}",
            verdict=above(d, e), value=d, error=e, unit="N s", packings=n,
        )
    )  # fmt: skip
    # with F the total force, F.v/|v| = M d|V|/dt: the mean over many cycles is the change of speed over their number
    frequency = results.frequencies()
    rows = [results.mean("work_stated", frequency=f) for f in frequency]
    spread = [results.mean("work_spread", frequency=f)[0] for f in frequency]
    away = [abs(m) > e for m, e, _ in rows if np.isfinite(e)]
    share = max((abs(m) / s for (m, _, _), s in zip(rows, spread, strict=True) if s > 0), default=np.nan)
    findings.append(
        Finding(
            says="<W_T> has a maximum near the optimum frequency",
            measured=f"<W_T> is at most {100 * share:.2g} % of its own standard deviation at any frequency"
            if rows else "no runs",
            verdict=OPEN if not away else FAILS, packings=least([r[2] for r in rows]),
            note="as defined W_T is M times the change of |V| over a cycle (an impulse, not a work): its mean is zero "
            "in a steady state, whatever the swimmer does",
        )
    )  # fmt: skip
    rows = [results.mean("input", frequency=f) for f in frequency]
    if rows and np.isfinite([r[1] for r in rows]).all():
        best = int(np.argmax([r[0] for r in rows]))
        findings.append(
            Finding(
                says="(corrected) work that the swimmer does in a cycle",
                measured=f"largest at {frequency[best]:g} Hz, {number(rows[best][0], rows[best][1], 'µJ', 1e6)}; "
                f"at {frequency[0]:g} Hz {number(rows[0][0], rows[0][1], 'µJ', 1e6)}",
                verdict=HOLDS if 0 < best < len(rows) - 1 and 6 <= frequency[best] <= 12 else FAILS,
                value=rows[best][0], error=rows[best][1], unit="J", packings=least([r[2] for r in rows]),
                note="holds: a maximum between 6 and 12 Hz. Work of the bending law on the disks, what the bed and the "
                "dashpots take up",
            )
        )  # fmt: skip
    return findings


PHASES = 30  # in a cycle


def _by_phase(cycles: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Means over cycles at ``PHASES`` phases of the drive."""
    bins = np.floor((cycles % 1.0) * PHASES).astype(int)
    count = np.bincount(bins, minlength=PHASES)
    return np.bincount(bins, values, PHASES) / np.where(count, count, np.nan)


@styled
def draw(results: Results) -> Figure | None:
    figure = Figure(figsize=(6.8, 4.6), layout="constrained")
    (top, pdf), (stated, real) = figure.subplots(2, 2)
    drawn = False
    for f, name, colour in MODES:
        works: list[np.ndarray] = []
        rates: list[np.ndarray] = []
        for p, _ in results.select(frequency=f):
            run = results.full(p)
            if run is None:
                continue
            kept = run["time"].values >= float(run.attrs["settle"])
            work = work_per_cycle(run["time"].values[kept], run["v"].values[kept].astype(float),
                                  run["disk_mass"].values, f)  # fmt: skip
            if not works:
                late = work.t > work.t[-1] - 4 / f
                begin = np.floor(work.t[late][0] * f)
                top.plot(work.t[late] * f - begin, 1e3 * work.rate[late], color=colour, alpha=0.35, linewidth=0.6)
            rates.append(_by_phase(work.t * f, work.rate))
            works.append(work.stated[np.isfinite(work.stated)])
        if works:
            phase = np.arange(4 * PHASES + 1) / PHASES + 0.5 / PHASES
            mean = np.tile(nan_mean(rates, axis=0), 5)[: len(phase)]
            top.plot(phase, 1e3 * mean, color=colour, label=name)
            pdf.hist(1e6 * np.concatenate(works), bins=40, density=True, histtype="step", color=colour, label=name)
            drawn = True
    if not drawn and not results.frequencies():
        return None
    top.set_xlabel("t f, four cycles (thin: one packing; thick: mean)")
    top.set_ylabel("F·v/|v| [mN]")
    top.set_xlim(0, 4)
    top.set_ylim(-2.2, 2.2)
    pdf.set_xlabel("W_T as stated [µN s]")
    pdf.set_ylabel("PDF [1/(µN s)]")
    legend(pdf, fontsize=7)
    for label, colour in COLOURS.items():
        curve(stated, results, "work_stated", 1e6, f"k_B = {label:g}", color=colour, k_B=label)
        curve(real, results, "input", 1e6, f"k_B = {label:g}", color=colour, k_B=label)
    for axis in (stated, real):
        for label, colour in COLOURS.items():
            axis.axvline(second_resonance(label), color=colour, linewidth=0.8, zorder=0)
    frequency_axis(stated, "mean W_T as stated [µN s]")
    frequency_axis(real, "work per cycle [µJ]")
    legend(real, fontsize=7)
    return figure


CLAIM = Claim("F6", "Work per cycle", "Fig. 6", ("free", "k_B"), judge, draw)
