"""Fitting by simulation: starts and free numbers together, least squares in observed space."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from .data import Case
from .hypothesis import Failed, Free, Hypothesis, Predictor
from .start import StartBody, describe_starts, first_numbers, number_scales

_POOL = ThreadPoolExecutor(max_workers=max(os.cpu_count() or 1, 1), thread_name_prefix="granswim")

HOPELESS = 1e6  # innovation of a run that failed, in standard deviations: the step is taken back


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    values : (p,) free numbers of the terms;  starts : numbers of each recording's start
    innovations : (T, c) seen minus predicted over sigma, per recording, NaN where not used
    covariance : (p, p) of the values, noise taken as known and white
    chi2, count : sum of squared innovations and how many there are
    jacobian : per recording, d(predicted/sigma)/d(values) and /d(starts), on the used numbers
    limits : of numbers whose 95 % interval was found by profiles, see ``intervals.py``
    """

    hypothesis: Hypothesis
    values: np.ndarray
    starts: Mapping[str, np.ndarray]
    described: Mapping[str, tuple[StartBody, ...]]
    innovations: Mapping[str, np.ndarray]
    chi2: float
    count: int
    covariance: np.ndarray
    jacobian: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    limits: Mapping[int, tuple[float, float]] = field(default_factory=dict)

    @property
    def numbers(self) -> int:
        """How many numbers were fitted, those of the starts included."""
        return len(self.values) + sum(len(s) for s in self.starts.values())

    def interval(self, k: int, inflation: float = 1.0) -> tuple[float, float, float]:
        """Value, low, high of free number k: central 95 %, cut at its bounds."""
        free = self.hypothesis.free[k]
        if k in self.limits:
            return float(self.values[k]), *self.limits[k]
        half = 1.96 * float(np.sqrt(max(self.covariance[k, k], 0.0) * inflation))
        value = float(self.values[k])
        return value, max(value - half, free.low), min(value + half, free.high)

    def used(self, case: str) -> np.ndarray:
        """Innovations of a recording as one vector."""
        array = self.innovations[case]
        return array[np.isfinite(array)]


class Fitter:
    """Fits hypotheses to the same frames of the same recordings."""

    def __init__(
        self,
        cases: Sequence[Case],
        predictor: Predictor,
        frames: Mapping[str, np.ndarray] | None = None,
        stop: Callable[[], bool] = lambda: False,
        weights: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        # (T,) of each recording: how much a frame counts in the fit; 1 where not given
        self.weights = weights or {}
        self.cases = [c for c in cases if (frames[c.name] if frames else c.training).any()]
        self.frames = {c.name: (frames[c.name] if frames else c.training) for c in self.cases}
        self.predictor = predictor
        self.stop = stop
        self.described = {c.name: describe_starts(c, self.frames[c.name]) for c in self.cases}

    # ---- residuals ------------------------------------------------------------------------------

    def _innovations(
        self, case: Case, hypothesis: Hypothesis, values: np.ndarray, numbers: np.ndarray, frames: np.ndarray
    ) -> np.ndarray:
        t0 = float(case.t[self.frames[case.name]][0])
        try:
            predicted = self.predictor(hypothesis, case, values, self.described[case.name], numbers, t0, case.t[frames])
        except Failed:
            return np.where(np.isfinite(case.values[frames]), HOPELESS, np.nan)
        innovations = (case.values[frames] - predicted) / case.sigma
        if case.name in self.weights:
            innovations = innovations * self.weights[case.name][frames, None]
        return innovations

    def fit(
        self,
        hypothesis: Hypothesis,
        values: Sequence[float] | np.ndarray | None = None,
        starts: Mapping[str, np.ndarray] | None = None,
        *,
        fixed: bool = False,
        stages: Sequence[float] = (1.0,),
        evaluations: int = 25,
        held: Collection[int] = (),
    ) -> Fit:
        """Fit starts, and the free numbers unless ``fixed``, on the training frames; those ``held`` stay.

        ``stages``: shares of the frames taken in one after the other, so that a long oscillation is not
        caught a period off. ``values``, ``starts``: where to begin.
        """
        free = hypothesis.free
        x = np.array([f.first for f in free] if values is None else values, dtype=float)
        numbers = {
            c.name: (starts[c.name] if starts and c.name in starts else first_numbers(self.described[c.name])).copy()
            for c in self.cases
        }
        for share in stages:
            x, numbers = self._solve(hypothesis, x, numbers, fixed, share, evaluations, held)
        return self._finish(hypothesis, x, numbers, fixed)

    def fit_widely(self, hypothesis: Hypothesis, base: Fit | None, *, stages: Sequence[float] = (1.0,)) -> Fit:
        """Fit from several beginnings and keep the best: an oscillation has a local minimum in every period.

        Beginnings: gradually from the tracks, from ``base``, from every adjustable on a grid, and from swings
        of other amplitudes (an undamped pendulum follows a decaying one best with an amplitude in between).
        """
        found = [self.fit(hypothesis, None, base.starts if base else None, stages=stages)]
        values = np.array([f.first for f in hypothesis.free], dtype=float)
        beginnings: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        starts = {c.name: first_numbers(self.described[c.name]) for c in self.cases}
        swinging = any(s.form == "pin" for described in self.described.values() for s in described)
        shares = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5) if swinging else (1.0,)
        grid = [values]
        for k, f in enumerate(hypothesis.free):
            for share in np.linspace(0.05, 0.95, 13) if self._bears(f) else ():
                other = values.copy()
                other[k] = f.low + share * (f.high - f.low)
                if np.isfinite(other[k]):
                    grid.append(other)
        for share in shares:
            beginnings += [(v, {name: n * share for name, n in starts.items()}) for v in grid]
        if base is not None:
            beginnings += [(v, dict(base.starts)) for v in grid]
        if len(beginnings) > 1:
            chi2 = list(_POOL.map(lambda b: self._chi2(hypothesis, *b), beginnings))
            for k in np.argsort(chi2)[:3]:
                found.append(self.fit(hypothesis, beginnings[k][0], beginnings[k][1]))
        return min(found, key=lambda fit: fit.chi2)

    def _chi2(self, hypothesis: Hypothesis, values: np.ndarray, starts: Mapping[str, np.ndarray]) -> float:
        total = 0.0
        for c in self.cases:
            r = self._innovations(c, hypothesis, values, starts[c.name], self.frames[c.name])
            total += float(np.nansum(r**2))
        return total

    def _part(self, case: Case, share: float) -> np.ndarray:
        frames = self.frames[case.name]
        if share >= 1.0:
            return frames
        rows = np.flatnonzero(frames)
        part = np.zeros_like(frames)
        part[rows[: max(int(len(rows) * share), min(8, len(rows)))]] = True
        return part

    def _bears(self, free: Free) -> bool:
        return free.cases is None or any(c.name in free.cases for c in self.cases)

    def _solve(self, hypothesis, x, numbers, fixed, share, evaluations, held):
        free = hypothesis.free
        cases = self.cases
        parts = {c.name: self._part(c, share) for c in cases}
        use = {c.name: np.isfinite(c.values[parts[c.name]]) for c in cases}
        # a number that bears on none of these recordings would only run into its bounds and shorten every step
        active = [] if fixed else [k for k, f in enumerate(free) if self._bears(f) and k not in held]
        p = len(active)
        place = {k: n for n, k in enumerate(active)}
        sizes = [len(numbers[c.name]) for c in cases]
        offsets = p + np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        scale = np.concatenate(
            [np.array([free[k].scale for k in active], dtype=float)]
            + [number_scales(self.described[c.name]) for c in cases]
        )
        if not len(scale):
            return x, numbers
        low = np.concatenate([[free[k].low for k in active], np.full(sum(sizes), -np.inf)])
        high = np.concatenate([[free[k].high for k in active], np.full(sum(sizes), np.inf)])

        def unpack(z):
            z = np.clip(z * scale, low, high)
            values = np.array(x)
            values[active] = z[:p]
            return values, {c.name: z[offsets[k] : offsets[k + 1]] for k, c in enumerate(cases)}

        def residuals(z):
            if self.stop():
                raise KeyboardInterrupt
            values, starts = unpack(z)
            seen = _POOL.map(lambda c: self._innovations(c, hypothesis, values, starts[c.name], parts[c.name]), cases)
            last.update(z=np.array(z), seen=dict(zip(parts, seen, strict=True)))
            return np.concatenate([last["seen"][name][use[name]] for name in parts])

        last: dict[str, Any] = {}  # where the solver last looked, and what it saw there
        rows = np.concatenate([[0], np.cumsum([u.sum() for u in use.values()])]).astype(int)

        def jacobian(z):
            values, starts = unpack(z)
            result = np.zeros((rows[-1], len(z)))
            if not last or not np.array_equal(last["z"], z):
                residuals(z)
            for k, c in enumerate(cases):
                here = last["seen"][c.name]
                columns, block = self._jacobian(
                    c, hypothesis, values, starts[c.name], parts[c.name], fixed, here, held
                )
                span = slice(rows[k], rows[k + 1])
                for index, column in zip(columns, block, strict=True):
                    target = place[index] if index >= 0 else offsets[k] - index - 1
                    result[span, target] = -column[use[c.name]] * scale[target]
            return result

        z0 = np.concatenate([x[active]] + [numbers[c.name] for c in cases]) / scale
        # the solver wants to begin strictly inside the bounds
        z0 = np.clip(z0, low / scale + 1e-9, high / scale - 1e-9)
        try:
            # a first-order amount can be far off: what overflows is a step that is taken back
            with np.errstate(all="ignore"):
                solution = least_squares(
                    residuals, z0, jac=jacobian, bounds=(low / scale, high / scale), x_scale="jac",
                    max_nfev=evaluations, xtol=1e-6, ftol=1e-7, gtol=1e-9,
                )  # fmt: skip
        except (ValueError, np.linalg.LinAlgError) as error:
            self.predictor.failures.append(f"fit: {error}")
            return x, numbers
        values, starts = unpack(solution.x)
        return np.array(values), {name: np.array(v) for name, v in starts.items()}

    def _jacobian(self, case, hypothesis, values, numbers, frames, fixed, here, held=()):
        """d(predicted/sigma) by the numbers that bear on this recording: (indices, list of (T, c)).

        Indices below zero are numbers of the start: -1 the first. ``here``: the innovations where they stand.
        Numbers that are ``held`` have none.
        """
        columns: list[int] = []
        changes: list[tuple[np.ndarray, np.ndarray, float]] = []
        if not fixed:
            for k, f in enumerate(hypothesis.free):
                if k in held or (f.cases is not None and case.name not in f.cases):
                    continue
                # a scale may be wider than the bounds: into the wider room, and no further than there is
                step = min(0.1 * f.scale, max(f.high - values[k], values[k] - f.low))
                if values[k] + step > f.high:
                    step = -step
                shifted = np.array(values, dtype=float)
                shifted[k] += step
                columns.append(k)
                changes.append((shifted, numbers, step))
        for k, scale in enumerate(number_scales(self.described[case.name])):
            moved = numbers.copy()
            moved[k] += 0.1 * scale
            columns.append(-k - 1)
            changes.append((np.asarray(values, dtype=float), moved, 0.1 * scale))
        # the compiled loops release the GIL; threads change no bit of the result
        found = list(_POOL.map(lambda c: self._innovations(case, hypothesis, c[0], c[1], frames), changes))
        return columns, [(here - other) / c[2] for other, c in zip(found, changes, strict=True)]

    def sharpened(self, fit: Fit) -> Fit:
        """The fit with derivatives and covariance from central differences, over steps that change chi2 by about one.

        A search does with steps of a tenth of a scale to one side; where two numbers nearly make up for one another,
        the curvature over such a step looks like a difference between them.
        """
        size = np.sqrt(sum(np.sum(by_value**2, axis=0) for by_value, _ in fit.jacobian.values()))
        jacobian = {c.name: self._central(c, fit, size) for c in self.cases}
        return replace(fit, jacobian=jacobian, covariance=np.linalg.pinv(information_of(jacobian, len(fit.values))))

    def _central(self, case: Case, fit: Fit, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``_sensitivity``, by central differences; ``size`` (p,): of derivatives by values, in all recordings."""
        frames, numbers = self.frames[case.name], fit.starts[case.name]
        use = np.isfinite(case.values[frames])
        p = len(fit.values)
        result = np.zeros((int(use.sum()), p + len(numbers)))
        columns: list[int] = []
        ends: list[tuple[np.ndarray, np.ndarray]] = []
        spans: list[float] = []
        for k, f in enumerate(fit.hypothesis.free):
            if f.cases is not None and case.name not in f.cases:
                continue
            step = min(1.0 / size[k], 0.1 * f.scale) if size[k] > 0 else 0.1 * f.scale
            low, high = (float(np.clip(fit.values[k] + side * step, f.low, f.high)) for side in (-1.0, 1.0))
            for end in (low, high):
                moved = fit.values.copy()
                moved[k] = end
                ends.append((moved, numbers))
            columns.append(k)
            spans.append(high - low)
        for k, scale in enumerate(number_scales(self.described[case.name])):
            told = float(np.linalg.norm(fit.jacobian[case.name][1][:, k]))
            step = min(1.0 / told, 0.1 * scale) if told > 0 else 0.1 * scale
            for side in (-1.0, 1.0):
                shifted = numbers.copy()
                shifted[k] += side * step
                ends.append((fit.values, shifted))
            columns.append(p + k)
            spans.append(2 * step)
        seen = list(_POOL.map(lambda e: self._innovations(case, fit.hypothesis, e[0], e[1], frames), ends))
        for column, before, after, span in zip(columns, seen[::2], seen[1::2], spans, strict=True):
            if span > 0:
                result[:, column] = (before - after)[use] / span
        return result[:, :p], result[:, p:]

    def _sensitivity(self, case, hypothesis, values, numbers, frames, fixed, here) -> tuple[np.ndarray, np.ndarray]:
        """d(predicted/sigma) of what was seen in ``frames``, by all values (n, p) and by the numbers of the start."""
        use = np.isfinite(case.values[frames])
        columns, block = self._jacobian(case, hypothesis, values, numbers, frames, fixed, here)
        by_value = np.zeros((int(use.sum()), len(hypothesis.free)))
        by_start = np.zeros((int(use.sum()), len(numbers)))
        for index, column in zip(columns, block, strict=True):
            if index >= 0:
                by_value[:, index] = column[use]
            else:
                by_start[:, -index - 1] = column[use]
        return by_value, by_start

    def _finish(self, hypothesis, x, numbers, fixed) -> Fit:
        innovations, jacobian = {}, {}
        p = len(hypothesis.free)
        chi2, count = 0.0, 0
        for c in self.cases:
            frames = self.frames[c.name]
            full = np.full(c.values.shape, np.nan)
            full[frames] = self._innovations(c, hypothesis, x, numbers[c.name], frames)
            innovations[c.name] = full
            jacobian[c.name] = self._sensitivity(c, hypothesis, x, numbers[c.name], frames, fixed, full[frames])
            used = full[np.isfinite(full)]
            chi2 += float(used @ used)
            count += len(used)
        covariance = np.linalg.pinv(information_of(jacobian, p)) if p and not fixed else np.zeros((p, p))
        return Fit(hypothesis, np.array(x), numbers, self.described, innovations, chi2, count, covariance, jacobian)

    def predict(self, fit: Fit, case: Case, frames: np.ndarray) -> np.ndarray:
        """Predicted channels (T, c) on ``frames`` and all before them, NaN elsewhere. Raises Failed."""
        t0 = float(case.t[self.frames[case.name]][0])
        wanted = case.t >= t0
        wanted &= case.t <= case.t[frames].max()
        out = np.full(case.values.shape, np.nan)
        out[wanted] = self.predictor(
            fit.hypothesis, case, fit.values, fit.described[case.name], fit.starts[case.name], t0, case.t[wanted]
        )
        return out


def information_of(jacobian: Mapping[str, tuple[np.ndarray, np.ndarray]], p: int) -> np.ndarray:
    """(p, p) of the values, the starts projected out."""
    information = np.zeros((p, p))
    for by_value, by_start in jacobian.values():
        projected = by_value - project(by_start, by_value)
        information += projected.T @ projected
    return information


def basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the columns (n, k), those that are numerically dependent left out."""
    if columns.shape[1] == 0:
        return columns
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    if columns.shape[1] == 0:
        return columns
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-7 * s[0]]


def project(columns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Projection of ``vectors`` (n, m) on the span of ``columns`` (n, k)."""
    q = basis(columns)
    return q @ (q.T @ vectors)
