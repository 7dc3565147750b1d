"""Tracks of round bodies in a film, by trackpy (Allan et al., doi:10.5281/zenodo.60550; Crocker & Grier 1996).

Features are located in each frame (band-passed, so that uneven light does not matter), linked with a prediction of the
velocity, and stubs are dropped. A body that is missed for some frames stays one body; places are never made up.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .backdrop import Shown
from .importers import Imported, finish
from .importers.base import Found, Options
from .importers.build import build
from .importers.units import LENGTHS, MASSES, PIXELS, measure, quantity
from .movie import Film, open_film
from .plausible import check_plausible

WATER = 1000.0  # kg/m^3
MEMORY = 5  # frames for which a body may be missed
SAMPLED = 12  # frames that decide about bright or dark, and how strong a body is


# ---- the scale ----------------------------------------------------------------------------------


def parse_scale(text: str | float) -> float | None:
    """Metres per pixel of ``0.1mm/px``, ``50mm=640px`` or a number; None for ``linked``. Raises InputError."""
    if isinstance(text, str) and text.strip() == "linked":
        return None
    value: float | None
    if isinstance(text, str) and "=" in text:
        known, _, seen = (part.strip() for part in text.partition("="))
        length = quantity(known, LENGTHS)
        pixels = re.fullmatch(rf"([\d.]+)\s*(?:{'|'.join(PIXELS)})?", seen)
        value = length / float(pixels[1]) if length and pixels and float(pixels[1]) > 0 else None
    else:
        value = quantity(text, LENGTHS, per=PIXELS)
    if value is None or not (math.isfinite(value) and value > 0):
        raise InputError(f"should be as 0.1mm/px, 50mm=640px or linked, got {text!r}", where="scale")
    return value


# ---- tracks -------------------------------------------------------------------------------------


def _trackpy() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import trackpy
    except ImportError:
        raise InputError("tracking needs the package trackpy: pip install 'granswim_pymunk[track]'") from None
    trackpy.quiet()
    return trackpy


def _is_dark(frames: list[np.ndarray]) -> bool:
    """Whether the bodies are darker than what is behind them: they are the smaller part of the picture."""
    scores = []
    for frame in frames:
        # the light changes slowly over the picture: take a plane away
        rows, columns = np.mgrid[: frame.shape[0], : frame.shape[1]]
        design = np.stack([np.ones(frame.size), rows.ravel(), columns.ravel()], axis=-1)[::7]
        values = frame.ravel()
        fit, *_ = np.linalg.lstsq(design, values[::7], rcond=None)
        rest = values[::7] - design @ fit
        rest -= np.median(rest)
        scores.append(np.mean(rest**3))
    return float(np.median(scores)) < 0


def _strong(mass: np.ndarray) -> float:
    """The smallest mass of a body: where the masses of features fall into two heaps, what divides them (Otsu)."""
    logs = np.sort(np.log10(mass[mass > 0]))
    if len(logs) < 2:
        return 0.0
    low = np.arange(1, len(logs))
    below = np.cumsum(logs)[:-1] / low
    above = (logs.sum() - np.cumsum(logs)[:-1]) / (len(logs) - low)
    cut = int(np.argmax(low * (len(logs) - low) * (above - below) ** 2))
    if above[cut] - below[cut] < math.log10(2.5):
        return float(10 ** logs[0] / 2)
    return float(10 ** (0.5 * (logs[cut] + logs[cut + 1])))


@dataclass(frozen=True)
class Tracked:
    """frame, particle, x, y [px] of each sighting; whether bodies are dark; the first frames of the film."""

    frame: np.ndarray
    particle: np.ndarray
    x: np.ndarray
    y: np.ndarray
    frames: int
    dark: bool


def track_pixels(
    film: Film,
    radius: float,
    *,
    dark: bool | None = None,
    count: int | None = None,
    search: float | None = None,
    minmass: float | None = None,
    min_frames: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Tracked:
    """Tracks of bodies of a radius [px].

    dark : darker than what is behind them; left out, found
    count : how many there are at most in a frame;  minmass : trackpy's, left out, found
    search : how far a body may come in a frame [px] beyond where it is expected (default: 0.8 of a diameter)
    min_frames : shorter tracks are dropped (default: a tenth of the film, at least 5). Raises InputError.
    """
    import pandas as pd

    trackpy = _trackpy()
    if radius < 1.5:
        raise InputError(f"bodies are {2 * radius:.3g} px across: too few to be found", where="radius")
    # a little larger than the body: its whole edge weighs in, and the mean of it is its centre
    diameter = 2 * round(1.15 * radius) + 1
    sample = _sample(film)
    dark = _is_dark(sample) if dark is None else dark
    options: dict[str, Any] = {"diameter": diameter, "invert": dark, "separation": 1.6 * radius, "topn": count}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        if minmass is None:
            found = [trackpy.locate(frame, **{**options, "topn": None}) for frame in sample]
            minmass = _strong(np.concatenate([np.asarray(f["mass"], dtype=float) for f in found]))
        features, frames = [], 0
        for k, frame in enumerate(film.frames()):
            located = trackpy.locate(frame, minmass=minmass, **options)
            located["frame"] = k
            features.append(located)
            frames = k + 1
            if progress is not None:
                progress(frames)
        features = [f for f in features if len(f)]
        if not features:
            raise InputError("no body is found: is the radius right, are bodies dark or bright?", file=film.path)
        table = pd.concat(features, ignore_index=True)
        reach = search if search is not None else 1.6 * radius
        linked = trackpy.predict.NearestVelocityPredict().link_df(table, reach, memory=MEMORY)
        least = min_frames if min_frames is not None else max(5, frames // 10)
        linked = trackpy.filter_stubs(linked, least)
    if not len(linked):
        raise InputError(f"no body is followed for {least} frames: is the radius right (--search, --min-frames)?",
                         file=film.path)  # fmt: skip
    names = {p: k for k, p in enumerate(sorted(linked["particle"].unique()))}
    return Tracked(
        frame=linked["frame"].to_numpy(dtype=float), particle=np.array([names[p] for p in linked["particle"]]),
        x=linked["x"].to_numpy(dtype=float), y=linked["y"].to_numpy(dtype=float), frames=frames, dark=dark,
    )  # fmt: skip


def _sample(film: Film) -> list[np.ndarray]:
    kept: list[np.ndarray] = []
    every = 1
    for k, frame in enumerate(film.frames()):
        if k % every == 0:
            kept.append(frame)
        if len(kept) >= 2 * SAMPLED:
            kept, every = kept[::2], 2 * every
    if not kept:
        raise InputError("has no frames", file=film.path)
    return kept


def linked_scale(tracked: Tracked, radius: float) -> float:
    """Metres per pixel where bodies of a radius [m] touch their neighbours: centres are a diameter apart."""
    from scipy.spatial import cKDTree

    nearest = []
    for k in np.unique(tracked.frame):
        own = tracked.frame == k
        if own.sum() > 1:
            xy = np.stack([tracked.x[own], tracked.y[own]], axis=-1)
            nearest.append(np.median(cKDTree(xy).query(xy, k=2)[0][:, 1]))
    if not nearest:
        raise InputError("there are no two bodies in a frame", where="scale linked")
    return 2 * radius / float(np.median(nearest))


# ---- to a recording -----------------------------------------------------------------------------


def track(
    movie: str | Path,
    out: str | Path,
    *,
    radius: str | float,
    scale: str | float,
    radius_px: float | None = None,
    mass: str | float | None = None,
    fps: float | None = None,
    dark: bool | None = None,
    count: int | None = None,
    search: float | None = None,
    minmass: float | None = None,
    min_frames: int | None = None,
    progress: Callable[[int], None] | None = None,
    **options: Any,
) -> Imported:
    """Track a film, and write recording, film and pictures of what was found into the folder ``out``.

    radius : of the bodies, ``1.5mm`` or in m;  scale : ``0.1mm/px``, a known length ``50mm=640px``, or ``linked``:
        neighbours touch (then ``radius_px`` says how large a body is in the film)
    mass : of a body, ``10g`` or in kg; left out, that of a ball of water
    fps : frame rate [Hz], left out, the film's;  the rest as in ``track_pixels`` and ``import_recording``
    Raises InputError.
    """
    size = measure(str(radius), LENGTHS, "radius [m]", "radius")
    metres = parse_scale(scale)
    if not size > 0:
        raise InputError(f"should be above zero [m], got {radius!r}", where="radius")
    if metres is None and radius_px is None:
        raise InputError(
            "with the scale of linked bodies say how large they are in the film (--radius-px)", where="scale"
        )
    film = open_film(movie)
    rate = fps if fps is not None else film.rate
    if rate is None:
        raise InputError("the film does not say its frame rate (--fps)", file=movie)
    pixels = radius_px if radius_px is not None else size / float(metres or 1.0)
    tracked = track_pixels(
        film, pixels, dark=dark, count=count, search=search, minmass=minmass, min_frames=min_frames, progress=progress
    )
    notes = [f"bodies are {'dark' if tracked.dark else 'bright'}, {2 * pixels:.3g} px across"]
    if metres is None:
        metres = linked_scale(tracked, size)
        notes.append(f"scale of linked bodies: {1e3 * metres:.4g} mm/px")
    heavy = measure(str(mass), MASSES, "mass [kg]", "mass") if mass is not None else WATER * 4 / 3 * math.pi * size**3
    if mass is None:
        notes.append(f"mass: {heavy:.3g} kg, that of a ball of water, as none was given (--mass)")
    names = [str(p) for p in tracked.particle.tolist()]
    found = Found(
        clock=tracked.frame, counts="frame", body=names, x=tracked.x, y=tracked.y, length="px", y_down=True, notes=notes
    )
    bodies = options.pop("bodies", None) or [f"*:{size!r}:{heavy!r}"]
    said = Options(unit=metres, fps=rate, flip_y=float(film.height - 1), bodies=bodies, **options)
    built = build(found, said, Path(movie))
    try:
        check_plausible(built.recording)
    except InputError as error:
        raise InputError(error.message, file=movie, where=error.where) from None
    done = finish(built.recording, out, "film, tracked with trackpy", built.notes)
    Shown(film, metres, 0.0, (film.height - 1) * metres, rate).keep(done.folder)
    drawn = draw_found(film, tracked, pixels, done.folder / "found.png")
    return replace(done, picture=drawn)


def draw_found(film: Film, tracked: Tracked, radius: float, path: Path) -> Path:
    """Four frames of the film with what was found in them, and the way up to there."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    shown = np.unique(np.linspace(0, tracked.frames - 1, 4).astype(int)).tolist()
    shape = 2 * max(film.height / film.width, 0.25)
    figure = Figure(figsize=(10, 5 * shape), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2).ravel()
    for ax in axes:
        ax.set_axis_off()
    for k, frame in enumerate(film.frames()):
        if k not in shown:
            continue
        ax = axes[shown.index(k)]
        ax.imshow(frame, cmap="gray", vmin=0, vmax=255)
        here = tracked.frame == k
        for body in np.unique(tracked.particle):
            color = f"C{body % 10}"
            way = (tracked.particle == body) & (tracked.frame <= k)
            ax.plot(tracked.x[way], tracked.y[way], color=color, lw=0.7)
            for at in np.flatnonzero(here & (tracked.particle == body)):
                ax.add_patch(Circle((tracked.x[at], tracked.y[at]), radius, fill=False, color=color, lw=1.2))
                ax.annotate(str(body), (tracked.x[at], tracked.y[at]), color=color, fontsize=8)
        ax.set(xlim=(0, film.width), ylim=(film.height, 0), title=f"frame {k}: {int(here.sum())} found")
    figure.savefig(path, dpi=100)
    return path
