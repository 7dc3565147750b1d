"""Readings of the bending law, and convergence: not figures of the paper, but what its figures rest on."""

import numpy as np
from matplotlib.figure import Figure

from ..analysis.speed import mean_error
from .claim import OPEN, Claim, Finding, above, number, within
from .draw import curve, frequency_axis, styled
from .f3 import peaked
from .f7 import growth
from .plans import FIRST, READINGS, THREE, Point, convergence
from .results import TAIL, Results

NAMES: dict[str, Point] = {
    "leader, gamma_B 100 1/s": {},
    "elastic": {"form": "elastic"},
    "head_axis": {"form": "head_axis"},
    "gamma_B 1000 1/s, as printed": {"gamma_B": 1.0e3},
    "k_B times 0.25": {"k_B_scale": 0.25},
    "k_B times 1.47, as first taken": FIRST,
}
assert [r for r in NAMES.values() if r] == list(READINGS)


def statements(results: Results, reading: Point) -> list[tuple[str, str, str, int]]:
    """(statement, measured, verdict, packings) of what a reading gives."""
    rows = []
    verdict, text, n = peaked(results, dict(reading))
    rows.append(("F4: fastest at 9 Hz of 4, 9, 15 Hz", text, verdict, n))
    speed = results.mean("speed", **reading, frequency=9.0)
    rows.append(("swims head first at 9 Hz", number(*speed[:2], "mm/s", 1e3), above(speed[0], speed[1]), speed[2]))
    for f, says, test in (
        (4.0, "F2: rod at 4 Hz (lag below pi/4)", lambda m, e: within(m, e, -np.pi / 4, np.pi / 4)),
        (9.0, "F2: wavy at 9 Hz (lag above pi/2)", lambda m, e: above(m, e, np.pi / 2)),
    ):
        lags = results.values("segment_lag", **reading, frequency=f)
        mean, error = map(float, mean_error(lags[:, -1] - lags[:, 0])) if len(lags) else (np.nan, np.nan)
        rows.append((says, number(mean, error, "rad"), test(mean, error) if len(lags) else OPEN, len(lags)))
    d, e, n = results.difference("tail_swing", {**reading, "frequency": 9.0}, {**reading, "frequency": 15.0})
    rows.append(("F2: tail quieter at 15 than at 9 Hz", f"by {number(d, e, 'mm', 1e3)}", above(d, e), n))
    d, e, n = results.difference("swimmer_energy", {**reading, "frequency": 15.0}, {**reading, "frequency": 9.0})
    rows.append(("F7: swimmer's energy rises from 9 to 15 Hz", f"by {number(d, e, 'µJ', 1e6)}", above(d, e), n))
    low, high = (growth(results, "bed_energy", *pair, **reading) for pair in ((4.0, 9.0), (9.0, 15.0)))
    n = min(len(low), len(high))
    d, e = map(float, mean_error(high[:n] - 0.5 * low[:n])) if n else (np.nan, np.nan)
    text = f"d ln E/d ln f less half of that below 9 Hz: {number(d, e)}"
    rows.append(("F7: bed's energy saturates above 9 Hz", text, above(-d, e), n))
    slow, fast = {**reading, "frequency": 4.0}, {**reading, "frequency": 9.0}
    d, e, n = results.difference("lean_x", slow, fast, lambda v: v[TAIL])
    rows.append(("F5: pushes on the tail shift ahead from 4 to 9 Hz", f"by {number(d, e)}", above(d, e), n))
    d, e, n = results.difference("push_peak", fast, slow)
    rows.append(("F6: peaks of F.v/|v| are higher at 9 than at 4 Hz", f"by {number(d, e, 'mN', 1e3)}", above(d, e), n))
    return rows


def judge(results: Results) -> list[Finding]:
    return [
        Finding(says=f"{says} [{name}]", measured=measured, verdict=verdict, packings=n)
        for name, reading in NAMES.items()
        for says, measured, verdict, n in statements(results, reading)
        if n
    ]


@styled
def draw(results: Results) -> Figure | None:
    figure = Figure(figsize=(6.8, 1.1 * len(NAMES)), layout="constrained")
    rows = figure.subplots(len(NAMES), 4, width_ratios=(1.5, 1, 1, 1))
    for axis in rows[1:, 0]:
        axis.sharey(rows[0, 0])
    drawn = False
    for line, (name, reading) in zip(rows, NAMES.items(), strict=True):
        curve(line[0], results, "speed", 1e3, color="#0072b2", **reading)
        line[0].axhline(0, color="#bbbbbb", linewidth=0.8, zorder=0)
        line[0].set_xlim(0, 21)
        line[0].set_title(name, fontsize=8)
        line[0].set_ylabel("v [mm/s]")
        for axis, f in zip(line[1:], sorted(THREE), strict=True):
            shapes = results.shapes(**reading, frequency=f)
            if shapes:
                drawn = True
                for k, shape in enumerate(shapes[0]):
                    axis.plot(*(1e3 * shape.T), color="#0072b2", alpha=0.15 + 0.85 * k / len(shapes[0]), linewidth=0.8)
            axis.set_xlim(-9, 21)
            axis.set_ylim(-9, 9)
            axis.set_xticks([])
            axis.set_yticks([])
            axis.set_title(f"{f:g} Hz", fontsize=8)
    frequency_axis(rows[-1][0], "v [mm/s]")
    return figure if drawn else None


# one sample of 2.5 s at each frequency by an independent code with the same laws and numbers, k_B as first taken [m/s]
INDEPENDENT = {4.0: 6.7e-3, 9.0: 8.0e-3, 11.0: 8.0e-3, 15.0: 0.1e-3}


def free_speeds(results: Results) -> list[tuple[str, list[tuple[float, float, int]]]]:
    """Free speed at the frequencies of ``INDEPENDENT`` in several definitions and with other numerics:
    (what, [(mean, 95 % half width, packings) at each frequency])."""
    rows = []
    for name, what in (
        ("speed", "as used: along the body, cycles after settling"),
        ("speed_x", "towards −x, cycles after settling"),
        ("speed_early", "towards −x, before that"),
        ("speed_late", "towards −x, second half after settling"),
        ("speed_whole", "towards −x, all of the time"),
        ("speed_head", "towards −x, all of the time, the head alone"),
    ):
        rows.append((what, [results.mean(name, frequency=f) for f in INDEPENDENT]))
    for change in convergence(results.setting):
        rows.append((changed(change), [results.mean("speed", **change, frequency=f) for f in INDEPENDENT]))
    for name, reading in list(NAMES.items())[1:]:
        rows.append((f"`{name}`", [results.mean("speed", **reading, frequency=f) for f in INDEPENDENT]))
    own = [results.mean("speed", **FIRST, stored="bed_9Hz", frequency=f) for f in INDEPENDENT]
    rows.append(("the same in that code's own bed, from its 0.2 s on", own))
    return rows


def spread(results: Results, frequency: float) -> float:
    """Standard deviation over packings [m/s] of the free speed with the k_B first taken."""
    values = results.values("speed", **FIRST, frequency=frequency)
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


SAME = 0.2  # of the free speed: changes below count as none


def judge_convergence(results: Results) -> list[Finding]:
    usual = results.mean("speed", frequency=9.0)
    findings = [
        Finding(
            says="free speed at 9 Hz", measured=number(*usual[:2], "mm/s", 1e3),
            verdict="used" if usual[2] else OPEN, value=usual[0], error=usual[1], unit="m/s", packings=usual[2],
            note=f"contacts {results.setting.softness:g} times softer than the paper's",
        )
    ]  # fmt: skip
    bound = SAME * usual[0]
    for change in convergence(results.setting):
        d, e, n = results.difference("speed", {**change, "frequency": 9.0}, {"frequency": 9.0})
        own = results.mean("speed", **change, frequency=9.0)
        findings.append(
            Finding(
                says=f"the free speed at 9 Hz does not depend on {WHAT[', '.join(change)]}",
                measured=f"{changed(change)}: {number(*own[:2], 'mm/s', 1e3)}, differs by {number(d, e, 'mm/s', 1e3)}",
                verdict=within(d, e, -bound, bound) if np.isfinite(bound) else OPEN,
                value=d, error=e, unit="m/s", packings=n, note=f"holds: within {100 * SAME:.0f} % of the free speed",
            )
        )  # fmt: skip
    return findings


WHAT = {
    "dt": "the time step",
    "width": "the size of the box",
    "softness": "the stiffness of contacts",
    "packing_fraction": "the packing fraction",
    "width, packing_fraction": "the size of the box where the bed is packed the denser, with the same area to spare",
}


def changed(change: Point) -> str:
    """What a point of the convergence block changes, in words."""
    words = {
        "dt": lambda v: f"step {1e6 * v:g} µs, half of the usual",
        "width": lambda v: f"box {1e3 * v:g} mm long",
        "packing_fraction": lambda v: f"packing fraction {v:g}",
        "softness": lambda v: "contacts as stiff as the paper's" if v == 1.0 else f"contacts {v:g} times softer",
    }
    return ", ".join(words[key](value) for key, value in change.items())


@styled
def draw_convergence(results: Results) -> Figure | None:
    rows = [("as used", results.mean("speed", frequency=9.0))]
    rows += [(changed(c), results.mean("speed", **c, frequency=9.0)) for c in convergence(results.setting)]
    rows = [(name, row) for name, row in rows if row[2]]
    if not rows:
        return None
    figure = Figure(figsize=(5.2, 2.0), layout="constrained")
    axis = figure.subplots()
    for k, (_, (mean, error, _)) in enumerate(rows):
        axis.errorbar(1e3 * mean, k, xerr=1e3 * np.nan_to_num(error), fmt="o", color="#0072b2", capsize=2)
    axis.set_yticks(range(len(rows)), [f"{name} (n = {row[2]})" for name, row in rows])
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlabel("free speed at 9 Hz [mm/s]")
    axis.set_xlim(left=0)
    return figure


READING = Claim(
    "readings", "Readings of the bending law", "Eq. 3, section II",
    ("free", "readings", "convergence", "convergence_15", "stored"), judge, draw,
)  # fmt: skip
CONVERGED = Claim(
    "convergence", "Step, stiffness and size of the box", "section II", ("free", "convergence"), judge_convergence,
    draw_convergence,
)  # fmt: skip
