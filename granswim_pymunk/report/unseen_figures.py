"""Figures of the report on a bed that is not seen: angles, numbers, speeds, candidates, nulls, held-out errors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..inference.criteria import current
from ..inference.packings.checks import prediction
from ..inference.packings.response import spread_of
from ..inference.significance import at_alarm
from .style import (
    COLOURS,
    FLOOR,
    MUTED,
    NAIVE,
    REVISED,
    SEEN,
    WIDTH,
    Drawing,
    legend_above,
    panels,
    shortened,
    styled,
)

if TYPE_CHECKING:
    from ..inference.packings.conclude import Finding
    from ..inference.packings.summaries import Condition


def models(f: Finding) -> list[str]:
    """Scenes that differ: naive, recalibrated if something is adjustable, revised if a law was found."""
    return ["naive", *(["recalibrated"] if f.search.adjust else []), *(["revised"] if f.found else [])]


def _handles(f: Finding, seen: str = "", **look: str) -> list[Line2D]:
    """Lines for the legend: what was seen, where it is shown, and the models."""
    first = [Line2D([], [], color=SEEN, marker="o", ls="", label=seen)] if seen else []
    return first + [Line2D([], [], color=COLOURS[m], label=m, **look) for m in models(f)]  # type: ignore[arg-type]


def _polar(c: Condition, numbers: np.ndarray, test: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude [rad] and lag behind the head [cycles] of the segments' first harmonic."""
    view = c.test if test and c.test is not None else c.any_view
    names = view.numbers()
    cos = np.array([v for v, n in zip(numbers, names, strict=True) if n.kind == "cos" and n.harmonic == 1])
    sin = np.array([v for v, n in zip(numbers, names, strict=True) if n.kind == "sin" and n.harmonic == 1])
    amplitude = float(c.scene.laws_named("bending")[0].values["amplitude"])
    # a sin(turn - lag) = a (sin cos - cos sin)
    lag = np.unwrap(np.arctan2(-cos, sin) if amplitude >= 0 else np.arctan2(cos, -sin))
    return np.hypot(cos, sin), lag / (2 * math.pi)


@styled
def angles(f: Finding, conditions: list[Condition]) -> Figure:
    s = f.search
    figure, axes = panels(2 * len(conditions), columns=2, height=2.1, top=0.35)
    for k, c in enumerate(conditions):
        segments = np.arange(len(c.any_view.masses) - 1)
        rows = s.means.residuals[c.name]
        for which in models(f):
            found, colour = prediction(f, s.means, c, which), COLOURS[which]
            if found is None:
                continue
            mean = found[0]
            cloud = [_polar(c, mean + row) for row in rows]
            for axis, here, every in zip(axes[2 * k :][:2], _polar(c, mean), zip(*cloud, strict=True), strict=True):
                wide = np.std(np.array(every) - here, axis=0)
                axis.plot(segments, here, color=colour)
                if which != "recalibrated":
                    axis.fill_between(segments, here - wide, here + wide, color=colour, alpha=0.18, lw=0)
        for axis, here in zip(axes[2 * k : 2 * k + 2], _polar(c, c.seen), strict=True):
            axis.plot(segments, here, "o", color=SEEN, ms=4)
            axis.set_xlabel("segment, from the head")
        axes[2 * k].set_ylabel("amplitude [rad]")
        axes[2 * k + 1].set_ylabel("lag [cycles]")
        axes[2 * k].set_title(shortened(f"{c.name}, {c.frequency:g} Hz"))
    legend_above(figure, _handles(f, "seen"))
    return figure


@styled
def innovations(f: Finding, conditions: list[Condition]) -> Figure:
    s = f.search
    figure, axes = panels(len(conditions), columns=1, height=2.0, top=0.35)
    for axis, c in zip(axes, conditions, strict=True):
        names = c.numbers
        for which in models(f):
            found, colour = prediction(f, s.means, c, which), COLOURS[which]
            if found is None:
                continue
            v = spread_of(s.means, c, found[1], c.error)
            axis.plot(np.arange(len(names)), (c.seen - found[0]) / np.sqrt(np.diag(v)), "o", color=colour, ms=3)
        axis.axhspan(-2, 2, color=FLOOR, alpha=0.15, lw=0)
        kinds = [(n.kind, n.harmonic) for n in names]
        starts = [k for k in range(len(names)) if k == 0 or kinds[k] != kinds[k - 1]]
        said = {"mean": "mean", "cos": "cos", "sin": "sin", "head_cos": "head", "drift": "drift", "length": "d"}
        ticks = [k for k in starts if names[k].kind in said]
        axis.set_xticks(ticks)
        axis.set_xticklabels(
            [said[names[k].kind] + (f" {names[k].harmonic}" if names[k].kind in ("cos", "sin") else "") for k in ticks],
            rotation=30, ha="left", va="top", rotation_mode="anchor",
        )  # fmt: skip
        for k in starts:
            axis.axvline(k - 0.5, color=MUTED, lw=0.4)
        axis.set_ylabel("seen - predicted\n[spreads]")
        axis.set_title(shortened(f"{c.name}, {c.frequency:g} Hz"))
    legend_above(figure, _handles(f, marker="o", ls=""))
    return figure


@styled
def speeds(f: Finding, conditions: list[Condition]) -> Figure:
    s = f.search
    layers = sorted({c.layers for c in conditions}, key=lambda v: -1.0 if v is None else v)
    figure, axes = panels(len(layers), columns=2, height=2.6, top=0.35, sharey=True)
    for axis, layer in zip(axes, layers, strict=True):
        members = sorted((c for c in conditions if c.layers == layer), key=lambda c: c.frequency)
        x = [c.frequency for c in members]
        for which in models(f):
            points = []
            for c in members:
                means = s.means if c.view is not None else s.test
                found = prediction(f, means, c, which)
                if found is not None:
                    wide = math.sqrt(float(means.covariance[c.name][0, 0]) * found[1])
                    points.append((c.frequency, float(found[0][0]), wide))
            if points:
                p = np.array(points)
                axis.errorbar(p[:, 0], 1e3 * p[:, 1], 1e3 * p[:, 2], color=COLOURS[which], capsize=2)
        for c in members:
            held = c.view is None
            seen, error = (c.seen_test, c.error_test) if held else (c.seen, c.error)
            axis.errorbar(
                c.frequency, 1e3 * seen[0], 1e3 * math.sqrt(error[0, 0]), fmt="o", color=SEEN, ms=4,
                mfc="white" if held else SEEN,
            )  # fmt: skip
        axis.set_xlabel("frequency [Hz]")
        axis.set_ylabel("speed [mm/s]")
        if layer is not None:
            axis.set_title(f"{layer:g} layers")
        if len(set(x)) == 1:
            axis.set_xlim(x[0] - 1, x[0] + 1)
    legend_above(figure, _handles(f, "measured"))
    return figure


@styled
def candidates(f: Finding) -> Figure:
    trials = sorted((t for t in f.search.trials if not t.reason), key=lambda t: -t.gain)[:16]
    figure = Figure(figsize=(WIDTH, 0.6 + 0.24 * len(trials)), layout="constrained")
    axis = figure.subplots()
    chosen = {t.candidate.label for t in f.found}
    y = np.arange(len(trials))
    colours = [REVISED if t.candidate.label in chosen else MUTED for t in trials]
    axis.barh(y, [max(t.gain, 0.0) for t in trials], color=colours)
    axis.set_yticks(y)
    axis.set_yticklabels([f"{shortened(t.candidate.label, 34)} ({t.surviving:.2f})" for t in trials])
    axis.invert_yaxis()
    if f.search.nulls is not None:
        axis.axvline(at_alarm(f.search.nulls.best), color=SEEN, lw=0.8, ls="--")
    below = 100 * (1 - current().verdict.alarm)
    axis.set_xlabel(f"fall of the misfit (chi2); dashed: {below:.3g} % of the nulls stay below")
    return figure


@styled
def nulls(f: Finding) -> Figure:
    found = f.search.nulls
    assert found is not None
    figure = Figure(figsize=(WIDTH, 2.2), layout="constrained")
    axes = figure.subplots(1, 2)
    top = max((t.gain for t in f.search.trials if not t.reason), default=0.0)
    for axis, sample, here, label in (
        (axes[0], found.chi2, f.search.naive.chi2, "misfit (chi2) of the naive scene"),
        (axes[1], found.best, top, "gain of the best candidate (chi2)"),
    ):
        axis.hist(sample, bins=30, color=MUTED)
        axis.axvline(here, color=NAIVE, lw=1.6)
        if here > 20 * np.median(sample) + 1:
            axis.set_xscale("symlog", linthresh=max(float(np.quantile(sample, 0.99)), 1.0))
        axis.set_xlabel(label)
        axis.set_ylabel("nulls")
    return figure


@styled
def held_out(f: Finding) -> Figure:
    figure = Figure(figsize=(WIDTH, 2.0), layout="constrained")
    axis = figure.subplots()
    names = ["naive", "recalibrated", "revised", "noise_floor"]
    colours = [*(COLOURS[name] for name in names[:3]), FLOOR]
    for offset, part, alpha in ((-0.2, f.train, 0.5), (0.2, f.held, 1.0)):
        for k, (name, colour) in enumerate(zip(names, colours, strict=True)):
            value = part.get(name)
            if value is not None:
                axis.bar(k + offset, 1e3 * value, 0.38, color=colour, alpha=alpha)
    axis.set_xticks(range(4))
    axis.set_xticklabels([n.replace("_", " ") for n in names])
    axis.set_ylabel("error [mm rms]")
    axis.set_title("left: fitted, right: held out")
    return figure


NAMES = ("angles", "innovations", "speed", "candidates", "held_out", "nulls")


def pictures(f: Finding) -> dict[str, Drawing]:
    """The figures of this diagnosis by file name, those that apply; each is drawn when called."""
    tracked = [c for c in f.search.training if not c.any_view.curve]
    curves = [c for c in f.search.conditions if c.any_view.curve]
    result = {}
    if tracked:
        result["angles"] = Drawing(
            lambda: angles(f, tracked[:4]), "Seen and simulated",
            "Amplitude of the segments' angle and how far it lags behind the head, along the body: seen (black), "
            "predicted, and one standard deviation between packings (shaded).",
        )  # fmt: skip
        result["innovations"] = Drawing(
            lambda: innovations(f, tracked), "Is what remains noise?",
            "Seen less predicted, in standard deviations between packings, before and after: each dot is one "
            "number (mean and harmonics of the angles, stroke of the head, drift, distance of disks).",
        )  # fmt: skip
    if curves:
        result["speed"] = Drawing(
            lambda: speeds(f, curves), "Seen and simulated",
            "Speed of the swimmer, head first, against frequency: measured with its standard error, and simulated "
            "with the error of the mean over packings; open symbols were held out.",
        )  # fmt: skip
    if any(not t.reason for t in f.search.trials):
        result["candidates"] = Drawing(
            lambda: candidates(f), "Candidates",
            "Candidates: how much each explains (fall of the misfit, adjustables refitted) and, in brackets, the share "
            "of its signature that recalibration cannot imitate.",
        )  # fmt: skip
    if any(v is not None for v in f.held.values()):
        result["held_out"] = Drawing(
            lambda: held_out(f), "Held-out errors",
            "Error of the predicted motion over one cycle, all disks, on what was fitted and on what was held out.",
        )  # fmt: skip
    if f.search.nulls is not None:
        result["nulls"] = Drawing(
            lambda: nulls(f), "Could it be chance?",
            "The same search on simulated recordings of the recalibrated physics in other packings, and on this one.",
        )  # fmt: skip
    return result
