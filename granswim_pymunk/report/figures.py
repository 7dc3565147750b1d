"""The pictures of a diagnosis, each a function that returns a matplotlib Figure and can be used alone.

    figure = overlay(diagnosis)
    figure.savefig("overlay.png")

No window system is touched: figures are built without pyplot and saved by the Agg canvas.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator

from ..inference.mechanisms import APPARATUS
from ..inference.significance import Null
from ..inference.tracks.innovations import Whiteness
from ..inference.tracks.model import TrackFinding
from ..inference.tracks.name import Trial
from ..laws import all_laws
from .style import (
    COLOURS,
    FLOOR,
    MUTED,
    REVISED,
    SEEN,
    WIDTH,
    Drawing,
    compact,
    legend_above,
    plain,
    prefixed,
    shortened,
    styled,
)
from .track_drawing import LABELS, SIZES, models
from .track_forms import drawn_over, flexible
from .track_innovations import innovations, windows
from .track_overlay import errors_over_time, overlay
from .words import number

# ---- 4. candidates ------------------------------------------------------------------------------


EQUAL, OTHER = "#8fbbd9", "#bcbcbc"  # bars of laws that cannot be told from what is named, and of all others


@styled
def candidates(diagnosis: TrackFinding, most: int = 18) -> Figure:
    """Candidates ranked: misfit each takes away, surviving fraction, test inside the training part."""
    trials = list(diagnosis.trials)
    if diagnosis.flexible is not None:
        trials.append(diagnosis.flexible)
    trials.sort(key=lambda t: (t.fit is None, -t.gain))
    # a law looked for from several sides is one candidate: its best fit
    best: dict[str, Trial] = {}
    for trial in trials:
        best.setdefault(trial.term.label, trial)
    shown = list(best.values())[:most]
    found = {t.term.label for t in diagnosis.found}
    same = {t.term.label for t, alike in diagnosis.rivals if alike}
    figure = Figure(figsize=(WIDTH, 0.27 * max(len(shown), 1) + 1.25), layout="constrained")
    left, middle, right = figure.subplots(1, 3, sharey=True, width_ratios=[2.6, 1, 1.5])
    count = max(diagnosis.recalibrated.count, 1)
    # laws that were named together come first, as one row
    together = len(diagnosis.found) > 1 and " + ".join(t.term.label for t in diagnosis.found)
    before = max(diagnosis.recalibrated.chi2, 1e-300) / count
    after = [max(t.fit.chi2, 1e-300) / count for t in shown if t.fit is not None]
    if together:
        after.append(max(diagnosis.revised.chi2, 1e-300) / count)
        left.barh(-1, after[-1] - before, left=before, height=0.66, color=REVISED)
        left.text(before, -1, " " + compact(after[-1]), va="center", fontsize=7.5, color="white")
        if math.isfinite(diagnosis.inner.get(together, math.nan)):
            right.plot(diagnosis.inner[together], -1, "o", color=REVISED, markersize=5.5)
    for row, trial in enumerate(shown):
        colour = REVISED if trial.label in found else EQUAL if trial.label in same else OTHER
        _bar(left, row, trial, (before, count), colour)
        middle.plot([0, trial.signature.surviving], [row, row], color="#d0d0d0", linewidth=1, zorder=1)
        middle.plot(trial.signature.surviving, row, "o", color=SEEN if trial.fit else MUTED, markersize=4)
        if math.isfinite(trial.inner) and trial.inner > 0:
            right.plot(trial.inner, row, "o", color=colour if colour != OTHER else "#777777", markersize=5.5)
    names = []
    for trial in shown:
        mark = " ≈" if trial.term.label in same else ""
        names.append(plain(trial.term.label) + (" °" if trial.mechanism in APPARATUS else "") + mark)
    first = -1 if together else 0
    first_row = "both together" if len(diagnosis.found) == 2 else "all together"
    left.set_yticks(range(first, len(shown)), [first_row] * -first + names)
    labels = left.get_yticklabels()
    if together:
        labels.pop(0).set_fontweight("bold")
    for label, trial in zip(labels, shown, strict=True):
        if trial.term.label in found:
            label.set_fontweight("bold")
        elif trial.fit is None:
            label.set_color("#777777")
    left.set_ylim(max(len(shown), 1) - 0.4, first - 0.6)
    low, high = min([*after, 1.0, before]), max([before, *after])
    _falling_axis(left, low, high, top=before)
    left.axvline(1.0, color=FLOOR, linestyle=(0, (1, 1.5)), zorder=1)
    left.set_xlabel("misfit left [χ² per number]")
    middle.set_xlim(-0.08, 1.08)
    middle.set_xticks([0, 0.5, 1], ["0", "½", "1"])
    middle.set_xlabel("surviving\nfraction")
    base = diagnosis.inner.get("recalibrated", float("nan"))
    if math.isfinite(base) and base > 0:
        right.axvline(base, color=COLOURS["recalibrated"], linewidth=1.4, linestyle=(0, (1.4, 1.2)))
        scores = [t.inner for t in shown if math.isfinite(t.inner) and t.inner > 0] + [base]
        if together and diagnosis.inner.get(together, 0.0) > 0:
            scores.append(diagnosis.inner[together])
        _falling_axis(right, min(scores), max(scores))
    right.set_xlabel("inner test\n[−2 ln p\nper number]")  # the layout leaves no room for what is wider than the axes
    for axis in (left, middle, right):
        axis.tick_params(axis="y", length=0)
        axis.spines["left"].set_visible(False)
    handles: list[Any] = [Patch(facecolor=REVISED, label="named")] if found else []
    if same:
        handles.append(Patch(facecolor=EQUAL, label="≈ cannot be told apart"))
    handles.append(Line2D([], [], color=FLOOR, linestyle=(0, (1, 1.5)), label="noise"))
    if math.isfinite(base):
        line = (0, (1.4, 1.2))
        handles.append(Line2D([], [], color=COLOURS["recalibrated"], linestyle=line, label="without any of them"))
    legend_above(figure, handles)
    return figure


def _bar(axis: Axes, row: int, trial: Trial, without: tuple[float, int], colour: str) -> None:
    """The misfit that a candidate takes away, of chi2 per number ``without`` it, and of how many numbers."""
    before, count = without
    if trial.fit is None:
        why = " " + _why_not(trial.reason)
        ground = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}  # no line runs through the words
        axis.text(before, row, why, va="center", fontsize=7.5, color="#666666", style="italic", bbox=ground)
        return
    # the axis runs from much misfit to little: a longer bar takes more away
    axis.barh(row, trial.fit.chi2 / count - before, left=before, height=0.66, color=colour)
    inside = colour == REVISED and trial.gain > 0.3 * count * before
    axis.text(
        before, row, " " + compact(trial.fit.chi2 / count), va="center", fontsize=7.5, ha="left",
        color="white" if inside else SEEN,
    )  # fmt: skip


def _falling_axis(axis: Axes, low: float, high: float, top: float | None = None) -> None:
    """A logarithmic x axis that runs from large to small numbers; ``top``: where it begins."""
    axis.set_xscale("log")
    room = 1.5 * (high / low) ** 0.04
    axis.set_xlim(top if top is not None else high * room, low / room)
    _few_log_ticks(axis, low, high)


def _why_not(reason: str) -> str:
    return reason.removeprefix("dropped: ") or "not fitted"


def _few_log_ticks(axis: Axes, low: float, high: float) -> None:
    """Two to four labelled ticks on a logarithmic x axis, also within one decade."""
    decades = math.log10(high * 1.8 / (low / 1.8))
    if decades > 2.0:
        step = 1 if decades < 5 else 2 if decades < 8 else 3
        ticks = [10.0**k for k in range(-12, 16, step)]
    else:
        ticks = [
            m * 10.0**k for k in range(-9, 12) for m in ((1, 2, 5) if decades > 0.9 else (1, 1.5, 2, 3, 5, 7))
        ]
    inside = [t for t in ticks if low / 1.8 <= t <= high * 1.8]
    while len(inside) > 5:
        inside = inside[::2]
    axis.xaxis.set_major_locator(FixedLocator(inside))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(lambda v, _: _tick(v))


def _tick(value: float) -> str:
    return f"{value:g}" if 1e-3 <= value < 1e4 else compact(value).replace("1.0×", "")


# ---- 5. held-out errors -------------------------------------------------------------------------


@styled
def held_out(diagnosis: TrackFinding, most: int = 40) -> Figure:
    """Held-out errors by recording; open rings: starts fitted to whole recordings.

    Where there is one recording only, its training error stands beside."""
    names = models(diagnosis)
    # two values of one place lie side by side
    reference = diagnosis.held["naive"].by_case
    rows: list[tuple[str, dict[str, float], dict[str, float]]] = []
    for case in [c for c in diagnosis.cases if c.scored.any()]:
        values = {
            n: diagnosis.held[n].by_case[case.name] for n in names if case.name in diagnosis.held[n].by_case
        }
        everything = {n: (diagnosis.held[n].whole_by_case or {}).get(case.name) for n in names}
        rows.append((case.name, values, {n: v for n, v in everything.items() if v is not None}))
    rows.sort(key=lambda row: -reference.get(row[0], 0.0))
    if len(rows) == 1:
        name = rows[0][0]
        in_training = {n: diagnosis.train[n].rms for n in names if n in diagnosis.train}
        rows = [
            ("training", {n: v for n, v in in_training.items() if v is not None}, {}),
            ("held out" if diagnosis.train["naive"].by_case.get(name) else name, *rows[0][1:]),
        ]
    rows = rows[:most]
    every = [v for _, a, b in rows for v in (*a.values(), *b.values()) if v > 0]
    floor = diagnosis.floor[1]
    if floor:
        every.append(floor)
    unit = (diagnosis.cases[0].unit if diagnosis.cases else "m rms").split()[0]
    factor, label = prefixed(unit, max(every, default=1.0))
    figure = Figure(figsize=(WIDTH, 0.27 * len(rows) + 1.05), layout="constrained")
    axis = figure.add_subplot()
    for row, (_, values, whole) in enumerate(rows):
        ends = [v * factor for v in values.values()]
        if len(ends) > 1:
            axis.plot([min(ends), max(ends)], [row, row], color="#d4d4d4", linewidth=1.4, zorder=1)
        for name, error in values.items():
            # the later ones are smaller: where two coincide both are seen
            axis.plot(error * factor, row, "o", color=COLOURS[name], markersize=SIZES[name], zorder=3)
        for name, error in whole.items():
            axis.plot(
                error * factor, row, "o", markerfacecolor="white", markeredgecolor=COLOURS[name],
                markersize=5, markeredgewidth=1.1, zorder=2,
            )  # fmt: skip
    if floor:
        axis.axvline(floor * factor, color=FLOOR, linestyle=(0, (1, 1.5)), zorder=1)
    axis.set_yticks(range(len(rows)), [shortened(r[0], 30) for r in rows])
    axis.set_ylim(len(rows) - 0.4, -0.6)
    axis.tick_params(axis="y", length=0)
    axis.spines["left"].set_visible(False)
    if every and max(every) > 8 * min(every):
        axis.set_xscale("log")
        axis.set_xlim(min(every) * factor / 1.6, max(every) * factor * 1.6)
        _few_log_ticks(axis, min(every) * factor, max(every) * factor)
    else:
        axis.set_xlim(0, max(every, default=1.0) * factor * 1.1)
    axis.set_xlabel(f"error [{label} rms]")
    handles: list[Any] = [
        Line2D([], [], color=COLOURS[n], marker="o", markersize=5.5, linestyle="none", label=LABELS[n])
        for n in names
    ]
    if floor:
        handles.append(Line2D([], [], color=FLOOR, linestyle=(0, (1, 1.5)), label="noise floor"))
    if any(whole for _, _, whole in rows):
        handles.append(
            Line2D([], [], markerfacecolor="white", markeredgecolor="#555555", marker="o", markersize=5,
                   linestyle="none", label="start fitted to the whole")
        )  # fmt: skip
    legend_above(figure, handles)
    return figure


# ---- 6. nulls -----------------------------------------------------------------------------------


@styled
def null_histogram(null: Null) -> Figure:
    """Best gains that the same search finds in noise, and where this case lies."""
    gains = np.asarray(null.gains, dtype=float)
    figure = Figure(figsize=(WIDTH, 2.3), layout="constrained")
    axis = figure.add_subplot()
    far = null.case > 4 * max(float(gains.max()), 1e-12)
    low = max(float(gains.min()), 0.02 * float(np.median(gains)), 1e-9)
    high = max(float(gains.max()), low * 1.5)
    if far:
        axis.set_xscale("log")
        # as fine as the spread of the replicates asks for
        bins = np.geomspace(
            low / 1.05, high * 1.05, max(6, min(30, int(math.sqrt(max(len(gains), 1)) * 1.5)))
        )
        axis.set_xlim(low / 2, null.case * 3)
    else:
        bins = np.linspace(0.0, max(high, null.case) * 1.05, 40)
        axis.set_xlim(0.0, max(high, null.case) * 1.12)
    counts, *_ = axis.hist(
        np.clip(gains, bins[0], bins[-1]),
        bins=bins.tolist(),
        color="#b4b4b4",
        edgecolor="white",
        linewidth=0.5,
    )
    top = max(float(np.max(counts)), 1.0)
    colour = REVISED if null.p <= 0.01 else "#555555"
    axis.plot([null.case, null.case], [0, 0.8 * top], color=colour, linewidth=2)
    axis.plot(null.case, 0.8 * top, "v", color=colour, markersize=7)
    right = null.case > (math.sqrt(low * null.case) if far else 0.6 * axis.get_xlim()[1])
    axis.annotate(
        f"this case, {compact(null.case)}\n{p_text(null)}", (null.case, 0.8 * top),
        xytext=(-8 if right else 8, 0),
        textcoords="offset points", ha="right" if right else "left", va="center", color=colour, fontsize=9,
    )  # fmt: skip
    axis.set_ylim(0, top * 1.08)
    axis.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    axis.set_xlabel("best gain of the whole search [fall in χ²]")
    axis.set_ylabel(f"of {len(gains)} tries in noise")
    return figure


def p_text(null: Null) -> str:
    """p as it may be claimed: never below one over the number of tries plus one."""
    reach = int(np.sum(null.gains >= null.case))
    return f"p ≤ {null.p:.2g}" if reach == 0 else f"p = {null.p:.2g}"


# ---- all of them --------------------------------------------------------------------------------


NAMES = (
    "overlay", "errors_over_time", "innovations", "windows", "flexible", "candidates", "held_out", "null",
)  # fmt: skip


def whiteness_text(white: Whiteness, known: bool) -> str:
    """How far innovations are from noise (HTML); ``known``: the size of the noise was given."""
    size = f"χ² {number(white.z, 2)} s.d. from that of noise, " if known else ""
    p = "p &lt; 10<sup>−16</sup>" if white.p < 1e-16 else f"p = {number(white.p, 2)}"
    if white.memory < 1.05:
        return f"{size}each frame on its own, {p}"
    return f"{size}alike over {white.memory:.{1 if white.memory < 10 else 0}f} frames, {p}"


def pictures(found: TrackFinding) -> dict[str, Drawing]:
    """The figures of this diagnosis by file name, in the order of the page; each is drawn when called."""
    several = (
        " The recordings shown are the held-out ones, at most 12, those with the largest naive error."
        if len(found.cases) > 12
        else ""
    )
    known = all(c.sigma_known for c in found.cases if not c.held_out)
    before, after = (whiteness_text(white, known) for white in (found.white_recalibrated, found.white_revised))
    result = {
        "overlay": Drawing(
            lambda: overlay(found), "Seen and simulated",
            "Seen track and simulation. Grey: held out, never looked at before the verdict was fixed. In the plane, "
            "disks are drawn to scale where they start (open) and where they end (filled; coloured rings: where the "
            "simulation ends)." + several,
            "Seen track with the naive and the revised simulation over it",
        ),
        "errors_over_time": Drawing(
            lambda: errors_over_time(found), "Seen and simulated",
            "Seen minus predicted over time; with several measured numbers in a frame, their root mean square.",
            "Seen minus predicted over time, before and after",
        ),
        "innovations": Drawing(
            lambda: innovations(found), "Is what remains noise?",
            "Innovations of the training part: seen minus predicted in standard deviations of the noise, by body. "
            f"Right: their root mean square; noise alone gives 1. Before: {before}"
            + (f". After: {after}." if found.found else "."),
            "Innovations over time and by body in standard deviations, before and after",
        ),
    }  # fmt: skip
    windowed, flexed, null = found.windows, found.flexible, found.null
    if windowed is not None and windowed.rows:
        result["windows"] = Drawing(
            lambda: windows(windowed, found.cases), "Where the mismatch is",
            "The training part in short windows, each started anew, under the scene as recalibrated: where a body does "
            "not do what the scene says even over a short time. z is that of χ² against what remains when the physics "
            "is right.",
            "Map of short windows coloured by their misfit",
        )  # fmt: skip
    if found.verdict == "unmodelled" and flexed is not None:
        band = " (band: central 95 %)." if drawn_over(all_laws()[flexed.mechanism]) != "place" else "."
        result["flexible"] = Drawing(
            lambda: flexible(found), "The force without a name",
            f"The fitted force without a name, over what the recordings visit{band}",
            "The force that no named law gives",
        )  # fmt: skip
    if found.trials:
        same = "; ≈ cannot be told apart from the law named" if any(alike for _, alike in found.rivals) else ""
        result["candidates"] = Drawing(
            lambda: candidates(found), "Candidates",
            "Every candidate refitted by simulation, alone. Bars run from the misfit without it to the misfit with it "
            "(the number: fall in χ²), so the longest takes most away. Surviving fraction: the share of its signature "
            "that recalibration cannot imitate. Inner test: prediction of a part of the training data that the fit did "
            "not see; further right is better. The choice rests on both, and on few numbers where candidates are "
            f"alike. ° apparatus{same}.",
            "Candidates ranked by gain, with surviving fraction and inner test",
        )  # fmt: skip
    if any(e.by_case for e in found.held.values()):
        result["held_out"] = Drawing(
            lambda: held_out(found), "Held-out errors", "Errors by recording; the same as in the table, taken apart.",
            "Held-out errors by recording",
        )  # fmt: skip
    if null is not None and len(null.gains):
        result["null"] = Drawing(
            lambda: null_histogram(null), "Could it be chance?",
            "The same search on what remains, with its phases shuffled: the best gain it finds in noise of the same "
            "spectrum.",
            "Histogram of the best gains found in noise, with this case marked",
        )  # fmt: skip
    return result
