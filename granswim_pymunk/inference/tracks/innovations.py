"""Are the innovations noise? And where are they not: body, time, speed, place, contact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import distributions as stats
from ...joints import arm_of
from ...walls import gap_to_wall
from ..criteria import current
from ..data import Case
from ..noise import Noise, Seen, believable, coloured, periodogram, size_in, slow_part
from ..places import Place
from ..significance import after_looks, normal_score
from .fit import Fitter
from .fitted import Fit
from .nulls import correlation_time


@dataclass(frozen=True)
class Whiteness:
    """Innovations against noise of unit size: ``z`` of the size (0 where sigma was not given), ``memory`` the
    correlation time in frames, ``p`` that white noise would look so."""

    z: float
    memory: float
    p: float


def series_of(fit: Fit, cases: Sequence[Case], white: bool = False) -> list[np.ndarray]:
    """One series for each channel that was used; ``white``: with the memory of the noise taken out."""
    result = []
    for case in cases:
        everything = np.ones(len(case.t), dtype=bool)
        array = fit.white[case.name] if white else case.timed(fit.innovations[case.name], everything)
        for c in range(array.shape[1]):
            column = array[:, c]
            result.append(column[np.isfinite(column)])
    return result


def white_sizes(fit: Fit, cases: Sequence[Case], rng: np.random.Generator, draws: int) -> np.ndarray:
    """(draws,) Sizes that the white part may have, in units of what was believed.

    The fast half of spectra, which no fit of something slow has touched, tells it, as well as so many frequencies do.
    """
    spectra = [periodogram(s) for s in series_of(fit, cases, white=True)]
    fast = [power[len(power) // 2 :] for power in spectra if len(power) > current().noise.frequencies]
    every = np.concatenate(fast) if fast else np.zeros(0)
    level, told = (believable(every), len(every)) if fast else (1.0, current().noise.believed)
    return np.asarray(np.sqrt(level * 2 * told / rng.chisquare(2 * told, size=draws)))


def whiteness(fit: Fit, cases: Sequence[Case], free: int) -> Whiteness:
    """Test the innovations of a fit with ``free`` fitted numbers in all."""
    dof = max(fit.count - free, 1)
    known = all(c.sigma_known for c in cases)
    z = (fit.chi2 - dof) / math.sqrt(2 * dof) if known else 0.0
    p_size = float(stats.chi2.sf(fit.chi2, dof)) if known else 1.0
    # Ljung-Box over all channels
    q, lags = 0.0, 0
    memory = []
    for series in series_of(fit, cases, white=True):
        n = len(series)
        if n < current().noise.spectrum:
            continue
        s = series - series.mean()
        power = float(s @ s)
        if power == 0.0:
            continue
        most = min(10, n // 4)
        for lag in range(1, most + 1):
            rho = float(s[:-lag] @ s[lag:]) / power
            q += n * (n + 2) * rho**2 / (n - lag)
        lags += most
        memory.append(correlation_time(series))
    # fitted numbers take away degrees of freedom here too
    p_memory = float(stats.chi2.sf(q, max(lags - free, 1))) if lags else 1.0
    p = min(1.0, 2 * min(p_size, p_memory))
    return Whiteness(z, float(np.mean(memory)) if memory else 1.0, p)


def memory_of(fit: Fit, cases: Sequence[Case], beside: np.ndarray | None = None) -> Noise:
    """The slow part of the noise, told from what a fit leaves and counted with what it takes away.

    beside : (n, k) directions in ``Fit.used`` of all recordings in turn that are not to be taken for noise
    """
    recordings = seen_by(fit, cases, beside)
    return slow_part(recordings) if recordings else Noise()


def leaves_noise(fit: Fit, cases: Sequence[Case]) -> bool:
    """Whether what a fit made before leaves nothing but the noise that the recordings are now said to have."""
    used = [case for case in cases if case.name in fit.innovations]
    recordings = [
        replace(seen, residuals=np.where(np.isfinite(case.values), seen.residuals, np.nan))  # of what is still there
        for seen, case in zip(seen_by(fit, [replace(c, noise=Noise()) for c in used]), used, strict=True)
    ]
    size = size_in(recordings, used[0].noise) if recordings else math.inf
    return size < _most_of_noise(fit.count - fit.numbers)


def _most_of_noise(freedom: int) -> float:
    """Chi2 over its degrees of freedom that noise may have."""
    return 1 + current().noise.inflated * math.sqrt(2 / max(freedom, 1))


def tells_noise(fit: Fit) -> bool:
    """Whether what a fit leaves says something of the noise: beyond twice the most that noise may be it is physics."""
    return fit.chi2 <= 2 * (1 + current().noise.slow_most ** 2) * fit.count


def seen_by(fit: Fit, cases: Sequence[Case], beside: np.ndarray | None = None) -> list[Seen]:
    """What a fit leaves of each recording, its memory not taken out, and what was fitted to it.

    beside : (n, k) as in ``memory_of``; they stand after the derivatives by the values
    """
    recordings, at = [], 0
    for case in cases:
        if case.name not in fit.innovations:
            continue
        residuals = case.timed(fit.innovations[case.name], np.ones(len(case.t), dtype=bool))
        by_value, by_start = fit.jacobian[case.name]
        if beside is not None:
            by_value = np.hstack([by_value, beside[at : at + len(by_value)]])
        at += len(by_value)
        seen = np.isfinite(residuals)
        count = int(seen.sum())
        spread_out = [np.full((*residuals.shape, by.shape[1]), np.nan) for by in (by_value, by_start)]
        begins = [case.t[s.frames][0] for s in fit.segments[case.name]]
        frames = case.numbers + current().noise.anew * np.searchsorted(begins, case.t, side="right")
        for k, by in enumerate((by_value, by_start)):
            spread_out[k][seen] = by[:count]
            spread_out[k] = np.nan_to_num(coloured(spread_out[k], frames, case.noise))
        ties = np.hstack([by_value[count:], by_start[count:]])
        recordings.append(Seen(residuals, frames, spread_out[0], spread_out[1], ties, fit.used(case.name)[count:]))
    return recordings


def inflation(fit: Fit, cases: Sequence[Case], free: int) -> float:
    """By how much variances grow because innovations are larger than the noise, or remember: 1 for white noise."""
    dof = max(fit.count - free, 1)
    memory = float(np.mean([correlation_time(s) for s in series_of(fit, cases, white=True)] or [1.0]))
    size = fit.chi2 / dof
    if size < _most_of_noise(dof) and memory < current().noise.remembers:
        return 1.0
    return max(1.0, size) * max(1.0, memory)


@dataclass(frozen=True)
class WindowMap:
    """Innovations of short windows, each with a start of its own.

    rows : dicts with case, body, t (2), x (2), y (2), speed (2), z, chi2, dof
    """

    rows: tuple[Mapping[str, Any], ...]


def variance_by_case(fit: Fit, cases: Sequence[Case]) -> dict[str, float]:
    """Variance of the innovations of each recording under the revised scene, at least that of the noise."""
    result = {}
    for case in cases:
        used = fit.used(case.name)
        dof = max(len(used) - len(fit.starts[case.name]), 1)
        result[case.name] = max(float(used @ used) / dof, 1.0)
    return result


def window_map(fitter: Fitter, fit: Fit, scale: Mapping[str, float], pieces: int | None = None) -> WindowMap:
    """Cut every recording into ``pieces`` windows with starts of their own and see which the model cannot follow.

    ``scale``: variance of the innovations of each recording when the physics is right.
    """
    rows: list[dict[str, Any]] = []
    size, pieces = 0, pieces or current().left.pieces
    for case in fitter.cases:
        at = np.flatnonzero(fitter.frames[case.name])
        least = current().noise.correlated
        size = max(len(at) // pieces, least)
        for first in range(0, len(at) - size // 2, size):
            part = np.zeros(len(case.t), dtype=bool)
            part[at[first : first + size]] = True
            if part.sum() < least:
                continue
            inner = Fitter([case], fitter.predictor, {case.name: part}, fitter.stop)
            found = inner.fit(fit.hypothesis, fit.values, fixed=True, evaluations=current().evaluations.window)
            spread, white = scale[case.name], found.white[case.name]
            passing = np.where(part[:, None], fit.white[case.name], np.nan)
            if np.nansum(passing**2) < np.nansum(white**2):
                white = passing  # an impact hid the start from the search: the whole run passes here more closely
            for body in case.bodies:
                columns = [k for k, c in enumerate(case.channels) if c.body == body]
                values = white[:, columns]
                values = values[np.isfinite(values)]
                numbers = sum(int(s.free.sum()) for s in inner.segments[case.name][0].starts if s.body == body)
                dof = max(len(values) - numbers, 1)
                chi2 = float(values @ values) / spread
                row = {"case": case.name, "body": body, "t": (float(case.t[part][0]), float(case.t[part][-1])),
                       "chi2": chi2, "dof": dof,
                       "z": normal_score(float(stats.chi2.sf(chi2, dof)))}  # fmt: skip
                row |= _extent(case, body, part)
                rows.append(row)
    return WindowMap(tuple(rows))


def _extent(case: Case, body: str, part: np.ndarray) -> dict[str, Any]:
    k = case.recording.ids.index(body)
    xy = case.recording.xy[part, k]
    result: dict[str, Any] = {"x": None, "y": None, "speed": None, "gap": None, "before_contact": None}
    gaps = _gaps(case, body)
    if gaps is not None and np.isfinite(gaps[part]).any():
        # a frame in which no other body was seen has no gap
        near = gaps[part][np.isfinite(gaps[part])]
        result["gap"] = (float(near.min()), float(near.max()))
        until = gaps[: np.flatnonzero(part)[-1] + 1]
        # touching within the noise of the two positions
        noise = float(max((s for s, c in zip(case.sigma, case.channels, strict=True) if c.body == body), default=0.0))
        result["before_contact"] = bool(np.nanmin(until) > current().left.touching * noise)
    for axis, name in enumerate("xy"):
        column = xy[:, axis]
        if np.isfinite(column).any():
            result[name] = (float(np.nanmin(column)), float(np.nanmax(column)))
    steps = np.linalg.norm(np.diff(xy, axis=0), axis=1) / np.diff(case.t[part])
    if not np.isfinite(steps).any() and case.recording.angle is not None:
        length = arm_of(case.recording.scene, body)
        steps = np.abs(np.diff(case.recording.angle[part, k])) / np.diff(case.t[part]) * length
    steps = steps[np.isfinite(steps)]
    if len(steps):
        # speeds from neighbouring frames carry their noise: the middle of their spread
        result["speed"] = (float(np.quantile(steps, 0.1)), float(np.quantile(steps, 0.9)))
    return result


def _gaps(case: Case, body: str) -> np.ndarray | None:
    """Smallest gap (T,) [m] between a body and any other that was seen or stands still, None where it is alone."""
    recording = case.recording
    scene = recording.scene
    own = recording.ids.index(body)
    radius = scene.body(body).radius
    others: list[np.ndarray] = []
    for k, name in enumerate(recording.ids):
        if k != own:
            others.append(
                np.linalg.norm(recording.xy[:, k] - recording.xy[:, own], axis=1) - radius - scene.body(name).radius
            )
    for wall in scene.bodies:
        if wall.role == "wall" and wall.initial is not None:
            others.append(
                np.linalg.norm(np.array(wall.initial[:2]) - recording.xy[:, own], axis=1) - radius - wall.radius
            )
    others += [gap_to_wall(recording.xy[:, own], radius, wall, scene.periodic_x) for wall in scene.walls]
    if not others or not np.isfinite(recording.xy[:, own]).any():
        return None
    stacked = np.stack(others)
    stacked[:, np.isnan(stacked).all(axis=0)] = np.inf
    return np.nanmin(stacked, axis=0)


def locate(windows: WindowMap) -> tuple[Place, ...]:
    """Bodies whose windows are not noise, with the times, places and speeds where it is worst.

    A body counts when the combined chi2 of its windows, or of one, does so after looking at all bodies and windows.
    """
    by_body: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in windows.rows:
        by_body.setdefault((row["case"], row["body"]), []).append(row)
    looked = len(windows.rows) + len(by_body)
    places = []
    for (case, body), rows in by_body.items():
        total = sum(r["chi2"] for r in rows), sum(r["dof"] for r in rows)
        p_all = float(stats.chi2.sf(*total))
        worst = max(rows, key=lambda r: r["z"])
        p_one = float(stats.chi2.sf(worst["chi2"], worst["dof"]))
        z, p = after_looks(min(p_all, p_one), looked)
        if p > current().left.places:
            continue
        # all windows that are bad by themselves, else the worst
        level = current().left.windows
        bad = [r for r in rows if stats.chi2.sf(r["chi2"], r["dof"]) * looked < level] or [worst]
        span = {
            key: (min(r[key][0] for r in bad if r[key]), max(r[key][1] for r in bad if r[key]))
            if any(r[key] for r in bad)
            else None
            for key in ("t", "x", "y", "speed", "gap")
        }
        contact = [r["before_contact"] for r in bad]
        before = None if None in contact else all(contact)
        places.append(
            Place(
                (body,), z, p, x=span["x"], y=span["y"], gap=span["gap"], t=span["t"], before_contact=before,
                speed=span["speed"], recording=case,
            )
        )  # fmt: skip
    return tuple(sorted(places, key=lambda place: -place.z))
