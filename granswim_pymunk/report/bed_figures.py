"""Figures of the report on a swimmer in its bed: where, when, what, how much better."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from .style import (
    COLOURS,
    FLOOR,
    MUTED,
    NAIVE,
    RECALIBRATED,
    REVISED,
    SEEN,
    SHADE,
    WIDTH,
    Drawing,
    legend_above,
    plain,
    styled,
)

if TYPE_CHECKING:
    from ..inference.windows.model import BedFinding

MODELS = ("naive", "recalibrated", "revised")
MAP = "YlOrRd"
BINS = 8


def shown_models(d: BedFinding) -> list[str]:
    """Models that differ: without a law found, revised is recalibrated."""
    models = [m for m in MODELS if m in d.predicted]
    if not d.laws and "revised" in models:
        models.remove("revised")
    if not d.adjustables and "recalibrated" in models:
        models.remove("recalibrated")
    return models


def _reference_model(d: BedFinding) -> str:
    """The model whose misfit is shown: what is left after recalibration, unless that is the cure."""
    return "naive" if d.verdict == "recalibrate" else "recalibrated"


def _disk_rms(d: BedFinding, model: str, number: int) -> np.ndarray:
    """(W, s) root mean square of a disk's innovations after the start [m]."""
    bed = d.beds[number]
    rows = d.likelihood.innovations(d.predicted[model])[number][:, : bed.swimmer_size]
    cut = rows.reshape(len(rows), len(bed.looks), len(bed.rows), 2)[:, 1:]
    return np.sqrt(_mean(cut**2, (1, 3)))


def _replicate_rms(d: BedFinding, number: int) -> np.ndarray:
    """(N, W, s) the same of replicates."""
    bed, noise = d.beds[number], d.likelihood.noises[number]
    rows = noise.residuals[:, :, : bed.swimmer_size]
    cut = rows.reshape(*rows.shape[:2], len(bed.looks), len(bed.rows), 2)[:, :, 1:]
    return np.sqrt(_mean(cut**2, (2, 4)))


def _mean(values: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Mean of what is finite, NaN where nothing is."""
    known = np.isfinite(values)
    count = known.sum(axis=axes)
    total = np.where(known, values, 0.0).sum(axis=axes)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@styled
def map_on_frame(d: BedFinding, z: np.ndarray, window: int) -> Figure:
    """Bodies of the first recording where ``window`` ends, coloured by z (n,) of what they did there."""
    bed = d.beds[0]
    scene, frame = bed.scene, int(bed.starts[window] + bed.looks[-1])
    xy = bed.film.xy[frame].copy()
    for k, b in enumerate(scene.bodies):
        if not b.mobile and b.initial is not None:
            xy[k] = b.initial[:2]
    disks = xy[bed.rows]
    middle = np.nanmean(disks, axis=0) if np.isfinite(disks).any() else np.nanmean(xy, axis=0)
    if scene.periodic_x:
        xy[:, 0] += scene.periodic_x * np.round((middle[0] - xy[:, 0]) / scene.periodic_x)
        xy[bed.rows] = disks
    half = np.array([17.0, 11.0]) * 1e-3
    figure = Figure(figsize=(WIDTH, 4.7), layout="constrained")
    axis = figure.subplots()
    norm = Normalize(0.0, float(np.clip(np.nanmax(z[bed.rows]) if np.isfinite(z[bed.rows]).any() else 4, 4, 12)))
    colour = ScalarMappable(norm, MAP)
    swimmer = set(bed.rows.tolist())
    plain_ones, grains, own = [], [], []
    colours, own_colours = [], []
    for k, b in enumerate(scene.bodies):
        if not np.isfinite(xy[k, 0]) or np.any(np.abs(xy[k] - middle) > half + b.radius):
            continue
        circle = Circle((float(1e3 * xy[k, 0]), float(1e3 * xy[k, 1])), 1e3 * b.radius)
        if k in swimmer:
            own.append(circle)
            own_colours.append(colour.to_rgba(z[k]) if np.isfinite(z[k]) else MUTED)
        elif np.isfinite(z[k]):
            grains.append(circle)
            colours.append(colour.to_rgba(z[k]))
        else:
            plain_ones.append(circle)
    axis.add_collection(PatchCollection(plain_ones, facecolor="#cccccc", edgecolor="#999999", linewidth=0.4))
    axis.add_collection(PatchCollection(grains, facecolor=colours, edgecolor="#b5b5b5", linewidth=0.4))
    axis.add_collection(PatchCollection(own, facecolor=own_colours, edgecolor=SEEN, linewidth=1.6))
    for k in bed.rows:
        if np.isfinite(xy[k, 0]):
            axis.annotate(plain(scene.bodies[k].id), 1e3 * xy[k], ha="center", va="center", fontsize=8)
    axis.set_xlim(1e3 * (middle[0] - half[0]), 1e3 * (middle[0] + half[0]))
    axis.set_ylim(1e3 * (middle[1] - half[1]), 1e3 * (middle[1] + half[1]))
    axis.set_aspect("equal")
    axis.set_xlabel("x (mm)")
    axis.set_ylabel("y (mm)")
    bar = figure.colorbar(colour, ax=axis, shrink=0.75, pad=0.02, extend="max")
    bar.set_label("seen less predicted, in expected spreads")
    bar.outline.set_visible(False)  # type: ignore[operator]
    axis.set_title(f"{1e3 * bed.span:.0f} ms after a start at t = {bed.times[window]:.3f} s ({plain(bed.name)})")
    return figure


@styled
def over_the_cycle(d: BedFinding) -> Figure:
    """Innovations of each disk by the phase of the drive, over those of replicates; all windows of all recordings."""
    model = _reference_model(d)
    ids = [d.beds[0].scene.bodies[k].id for k in d.beds[0].rows]
    table = np.full((len(ids), BINS), np.nan)
    sums = np.zeros((2, len(ids), BINS))
    for number, bed in enumerate(d.beds):
        phases = bed.phases()
        if phases is None or len(bed.rows) != len(ids):
            continue
        own, replicates = _disk_rms(d, model, number) ** 2, _replicate_rms(d, number) ** 2
        for w, part in enumerate(np.floor(BINS * phases).astype(int) % BINS):
            sums[0, :, part] += np.nan_to_num(own[w])
            sums[1, :, part] += np.nan_to_num(replicates[:, w].mean(axis=0))
    good = sums[1] > 0
    table[good] = np.sqrt(sums[0][good] / sums[1][good])
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    axis = figure.subplots()
    norm = Normalize(1.0, max(2.0, float(np.nanmax(table)) if np.isfinite(table).any() else 2.0))
    axis.imshow(table, aspect="auto", cmap=MAP, norm=norm, extent=(0, 1, len(ids) - 0.5, -0.5), interpolation="nearest")
    axis.set_yticks(range(len(ids)), [plain(i) for i in ids])
    axis.set_xlabel("phase of the drive (share of the cycle)")
    axis.set_ylabel("disk, head first")
    bar = figure.colorbar(ScalarMappable(norm, MAP), ax=axis, pad=0.02)
    bar.set_label("misfit over noise")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return figure


@styled
def along_the_body(d: BedFinding) -> Figure:
    """Root mean square of each disk's innovations under each model, and the band of replicates."""
    figure = Figure(figsize=(WIDTH, 2.8), layout="constrained")
    axis = figure.subplots()
    bed = d.beds[0]
    place = np.arange(len(bed.rows))
    replicates = np.sqrt(_mean(_replicate_rms(d, 0) ** 2, (1,)))
    axis.fill_between(place, 1e6 * replicates.min(axis=0), 1e6 * replicates.max(axis=0), color=FLOOR, alpha=0.25,
    linewidth=0)
    handles = []
    for model in shown_models(d):
        rms = np.sqrt(_mean(_disk_rms(d, model, 0) ** 2, (0,)))
        axis.plot(place, 1e6 * rms, "o-", color=COLOURS[model], markersize=4)
        handles.append(Line2D([], [], color=COLOURS[model], marker="o", markersize=4, label=model))
    handles.append(Line2D([], [], color=FLOOR, linewidth=6, alpha=0.4, label="perfect knowledge (replicates)"))
    axis.set_xticks(place, [plain(bed.scene.bodies[k].id) for k in bed.rows])
    axis.set_xlabel("disk, head first")
    axis.set_ylabel("misfit (µm rms)")
    axis.set_ylim(bottom=0)
    legend_above(figure, handles)
    return figure


@styled
def candidates(d: BedFinding, most: int = 20) -> Figure:
    """Gain of each candidate after recalibration, simulated or to first order, and its surviving fraction."""
    trials = sorted(d.trials, key=lambda t: -(t.linear if t.gain is None else t.gain))[:most]
    figure = Figure(figsize=(WIDTH, 0.9 + 0.21 * len(trials)), layout="constrained")
    axis, side = figure.subplots(1, 2, sharey=True, width_ratios=(4, 1))
    for k, t in enumerate(trials):
        named = t.term.label in {law.term.label for law in d.laws}
        colour = REVISED if named else "#8fb3cc"
        if t.gain is None:
            axis.barh(k, max(t.linear, 0.0), height=0.62, facecolor="none", edgecolor=MUTED, linewidth=0.9)
        else:
            axis.barh(k, max(t.gain, 0.0), height=0.62, color=colour)
        # the level is that of gains without the window that brings most
        limit = float(t.gain_at(np.array(d.level))) * (t.linear / t.jackknife if t.jackknife > 0 else 1.0)
        axis.plot([limit, limit], [k - 0.45, k + 0.45], color=FLOOR, linewidth=1.2)
        side.plot([0, t.signature.surviving], [k, k], color=MUTED, linewidth=0.8)
        side.plot(t.signature.surviving, k, "o", color=colour if t.gain is not None else MUTED, markersize=4)
    axis.set_yticks(range(len(trials)), [plain(t.term.label) for t in trials])
    axis.invert_yaxis()
    axis.set_xlabel("fall in χ² (filled: simulated; hollow: to first order)")
    axis.tick_params(axis="y", length=0)
    side.set_xlim(0, 1.05)
    side.set_xlabel("surviving")
    side.tick_params(axis="y", length=0)
    return figure


@styled
def null_histogram(d: BedFinding) -> Figure:
    """The best gain in windows of replicates, and that of the case, each without the window that brings most of it."""
    figure = Figure(figsize=(WIDTH, 2.3), layout="constrained")
    axis = figure.subplots()
    far = d.score > 3 * max(float(d.null.max()), 1.0)
    axis.hist(d.null, bins=30, color="#c9c9c9")
    if far:
        axis.set_xscale("symlog", linthresh=max(float(d.null.max()), 1.0))
    axis.axvline(d.score, color=REVISED if d.laws else SEEN, linewidth=1.6)
    axis.annotate(
        f"this recording: {d.score:.0f}", (d.score, 0.93), xycoords=("data", "axes fraction"), xytext=(-5, 0),
        textcoords="offset points", ha="right" if d.score > np.median(d.null) else "left", va="top", fontsize=8.5,
    )  # fmt: skip
    axis.set_xlabel("best fall in χ² of any candidate")
    axis.set_ylabel("nulls")
    return figure


@styled
def held_out(d: BedFinding) -> Figure:
    """Errors over time, window by window, training and held out."""
    figure = Figure(figsize=(WIDTH, 2.0 * min(len(d.beds), 4) + 0.6), layout="constrained")
    beds = d.beds[-4:]
    axes: list[Axes] = list(figure.subplots(len(beds), 1, squeeze=False).ravel())
    handles = []
    for axis, bed in zip(axes, beds, strict=True):
        number = next(k for k, b in enumerate(d.beds) if b is bed)
        t = bed.times
        order = np.argsort(t)
        replicates = np.sqrt(_mean(_replicate_rms(d, number) ** 2, (2,)))
        axis.fill_between(t[order], 1e6 * replicates.min(axis=0)[order], 1e6 * replicates.max(axis=0)[order],
        color=FLOOR,
                          alpha=0.2, linewidth=0)  # fmt: skip
        if (~bed.training).any():
            begin = float(t[~bed.training].min()) - 0.25 * bed.span
            axis.axvspan(begin, float(bed.film.t[-1]), color=SHADE, zorder=0)
            axis.annotate("held out", (begin, 0.96), xycoords=("data", "axes fraction"), xytext=(4, 0),
                          textcoords="offset points", va="top", fontsize=8, color=FLOOR)  # fmt: skip
        for model in shown_models(d):
            rms = np.sqrt(_mean(_disk_rms(d, model, number) ** 2, (1,)))
            axis.plot(t[order], 1e6 * rms[order], "o-", color=COLOURS[model], markersize=3, linewidth=0.9)
        axis.set_ylim(bottom=0)
        axis.set_ylabel("misfit (µm rms)")
        axis.set_title(plain(bed.name))
    axes[-1].set_xlabel("time of the window's start (s)")
    for model in shown_models(d):
        handles.append(Line2D([], [], color=COLOURS[model], marker="o", markersize=3, label=model))
    handles.append(Line2D([], [], color=FLOOR, linewidth=6, alpha=0.35, label="replicates, least to most"))
    legend_above(figure, handles)
    return figure


@styled
def overlay(d: BedFinding, count: int = 4) -> Figure:
    """The swimmer at the end of some windows: seen, and predicted before and after; deviations enlarged."""
    bed, likelihood = d.beds[0], d.likelihood
    model = _reference_model(d)
    s, looks = len(bed.rows), len(bed.looks)
    size = np.nansum(_disk_rms(d, model, 0) ** 2, axis=1)
    chosen = np.sort(np.argsort(-size)[:count])
    better = "recalibrated" if d.verdict == "recalibrate" else "revised"
    shown = [(model, NAIVE if model == "naive" else RECALIBRATED)]
    if better in shown_models(d):
        shown.append((better, COLOURS[better]))
    seen = likelihood.seen[0][:, : bed.swimmer_size].reshape(-1, looks, s, 2)
    gone = {
        name: likelihood.innovations(d.predicted[name])[0][:, : bed.swimmer_size].reshape(-1, looks, s, 2)
        for name, _ in shown
    }
    worst = max(float(np.nanmax(np.abs(gone[name][chosen, -1]))) for name, _ in shown)
    enlarge = float(max(1.0, np.floor(2.0e-3 / max(worst, 1e-9))))
    figure = Figure(figsize=(WIDTH, 1.75 * ((len(chosen) + 1) // 2) + 0.5), layout="constrained")
    axes = list(figure.subplots((len(chosen) + 1) // 2, 2, squeeze=False).ravel())
    for axis in axes[len(chosen) :]:
        axis.remove()
    for axis, w in zip(axes, chosen, strict=False):
        end = seen[w, -1]
        middle = np.nanmean(end, axis=0)
        axis.plot(*(1e3 * (seen[w, 0] - middle)).T, "-", color=MUTED, linewidth=1)
        axis.plot(*(1e3 * (end - middle)).T, "o-", color=SEEN, markersize=5, linewidth=1)
        for name, colour in shown:
            there = end - middle - enlarge * gone[name][w, -1]
            axis.plot(*(1e3 * there).T, "x", color=colour, markersize=5, markeredgewidth=1.5)
        axis.set_aspect("equal", adjustable="datalim")
        axis.set_title(f"t = {bed.times[w]:.3f} s" + ("" if bed.training[w] else ", held out"))
        axis.set_xlabel("mm")
    handles = [
        Line2D([], [], color=MUTED, label="seen at the start"),
        Line2D([], [], color=SEEN, marker="o", markersize=5, label=f"seen {1e3 * bed.span:.0f} ms later"),
        *(
            Line2D(
                [], [], color=c, marker="x", linestyle="", markeredgewidth=1.5, label=f"{n}, deviation × {enlarge:.0f}"
            )
            for n, c in shown
        ),
    ]
    legend_above(figure, handles, 4)
    return figure


NAMES = ("overlay", "map", "along", "cycle", "candidates", "held_out", "null")


def pictures(d: BedFinding) -> dict[str, Drawing]:
    """The figures of this diagnosis by file name; each is drawn when called."""
    noun = "after recalibration" if _reference_model(d) == "recalibrated" else "of the naive scene"
    where = "Where the mismatch is"
    result = {
        "overlay": Drawing(
            lambda: overlay(d), "Seen and simulated",
            "Predicted and seen. The windows with the largest misfit; deviations of the prediction are enlarged.",
        ),
        "along": Drawing(
            lambda: along_the_body(d), where,
            "The misfit along the swimmer. Root mean square of seen less predicted positions of each disk over all "
            "windows of the first recording, the estimator's own bias taken off; the band is what repeats of the "
            "simulation against itself give.",
        ),
        "candidates": Drawing(
            lambda: candidates(d), "Candidates",
            "The candidates. How far each law alone lets χ² of the training windows fall after recalibration; the "
            "marks are where 1 % of the nulls reach, farther for laws whose noise is larger; right: the share of its "
            "signature that the adjustable parameters cannot imitate.",
        ),
        "held_out": Drawing(
            lambda: held_out(d), "Held-out errors",
            "Window by window. Misfit of the swimmer's disks; the shaded windows were used to find or fit nothing.",
        ),
        "null": Drawing(
            lambda: null_histogram(d), "Could it be chance?",
            "Against chance. The best gain of the same search in windows of simulations in which nothing is missing, "
            "put on the scale of the law that leads here, and that of this recording.",
        ),
    }  # fmt: skip
    shown = d.map
    if shown is not None:
        result["map"] = Drawing(
            lambda: map_on_frame(d, *shown), where,
            "The mismatch on a frame. Each body is coloured by how far it ended from its prediction, in expected "
            "spreads, in the training window with the largest misfit; about 1 is noise. Grains scatter because the "
            "bed is chaotic; what repeats over windows is judged in the figures below.",
        )  # fmt: skip
    if any(b.phases() is not None for b in d.beds):
        result["cycle"] = Drawing(
            lambda: over_the_cycle(d), where,
            f"When in the cycle. Misfit {noun} of each disk by the phase of the drive in the middle of the window, "
            "over that of replicates; 1 is noise.",
        )  # fmt: skip
    return {name: result[name] for name in NAMES if name in result}
