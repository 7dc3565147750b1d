"""Predictions as sums of simulated means, their uncertainty, and the fit of a few numbers to what was seen.

Every run is one draw: mean under its scene plus the packing's own. A prediction is a sum of means with
coefficients k_i (a soft run enters only in differences, so that softness drops out), its variance in units of the
spread between packings is sum k_i^2/n_i. All runs of all scenes together give that spread.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ... import distributions as stats
from ..criteria import current
from ..hypothesis import Free
from .runs import Runner
from .summaries import Condition

Point = tuple[str, bool]  # label of a scene, soft or not
Sum = dict[Point, float]  # coefficients


def add(*parts: tuple[float, Mapping[Point, float]]) -> Sum:
    total: Sum = {}
    for factor, part in parts:
        for point, k in part.items():
            total[point] = total.get(point, 0.0) + factor * k
    return {point: k for point, k in total.items() if k != 0.0}


@dataclass
class Means:
    """Means of the compared numbers for every scene run, and the spread of single runs around them.

    ``test``: of the held-out part of the time instead of the training part. ``inflation``: mean square of other
    packings over that of the runs that the covariance was made of. ``folds``: parts of the residuals, each with the
    covariance by those that are not in it. ``tail``: degrees of freedom of the t distribution of a packing's numbers.
    """

    runner: Runner
    conditions: Sequence[Condition]
    test: bool = False
    mean: dict[str, dict[Point, tuple[np.ndarray, int]]] = field(default_factory=dict)
    residuals: dict[str, np.ndarray] = field(default_factory=dict)  # (k, p), leverage taken out
    single: dict[str, dict[Point, np.ndarray]] = field(default_factory=dict)  # (n, p) of every run
    covariance: dict[str, np.ndarray] = field(default_factory=dict)
    dof: dict[str, int] = field(default_factory=dict)
    inflation: dict[str, float] = field(default_factory=dict)
    folds: dict[str, list[tuple[np.ndarray, np.ndarray]]] = field(default_factory=dict)
    tail: dict[str, float] = field(default_factory=dict)
    _part: dict[str, np.ndarray] = field(default_factory=dict)  # of each residual: which of the folds it is in
    _seen: dict[tuple[str, str, bool, int], np.ndarray] = field(default_factory=dict)

    def view(self, condition: Condition):
        return condition.test if self.test else condition.view

    def refresh(self) -> None:
        """Take in all runs done so far."""
        for condition in self.conditions:
            view = self.view(condition)
            if view is None:
                continue
            self.mean[condition.name] = {}
            values: dict[Point, np.ndarray] = {}
            self.single[condition.name] = values
            # sorted: the order in which threads finish must not show in the last digits
            for (name, label, soft), runs in sorted(self.runner.tracks.items()):
                if name != condition.name or (name, label, soft) in self.runner.failures:
                    continue
                rows = []
                for number, xy in sorted(runs.items()):
                    if not np.isfinite(xy[view.last]).all():
                        continue  # it ended with the training part
                    key = (name, label, soft, number)
                    if key not in self._seen:
                        self._seen[key] = view.observe(xy)
                    rows.append(self._seen[key])
                if rows:
                    values[label, soft] = np.array(rows)
            several = [y for (label, _), y in values.items() if label == "naive" and len(y) > 1]
            least = current().rounding.nothing
            usual = np.mean([y.var(axis=0, ddof=1) for y in several], axis=0) if several else None
            left, parts, dof, folds = [], [], 0, current().packings.folds
            for place, (point, y) in enumerate(values.items()):
                self.mean[condition.name][point] = (y.mean(axis=0), len(y))
                if len(y) < 2:
                    continue
                apart = _apart(y)
                # a law that makes the motion wilder says nothing about the spread of the scene without it
                if usual is None or float(np.mean(apart**2 / np.maximum(usual, least))) < current().packings.wild:
                    left.append(apart)
                    # two runs, less their mean, are one number with both signs: they stay together
                    parts.append(np.full(2, place % folds) if len(y) == 2 else np.arange(len(y)) % folds)
                    dof += len(y) - 1
            if not left:
                continue
            self.residuals[condition.name] = np.concatenate(left)
            part = np.concatenate(parts)
            self._part[condition.name] = part if np.ptp(part) else np.arange(len(part)) % folds
            self.dof[condition.name] = dof
        self._spread()

    def _spread(self) -> None:
        """Covariances, such that what took no part in them has a mean square of one in their units.

        Estimates from few runs are too narrow for other packings: by how much is told by leaving every fifth run out.
        """
        groups: dict[tuple, list[str]] = {}
        bends: dict[tuple, np.ndarray] = {}
        for c in self.conditions:
            if c.name in self.residuals:
                view = self.view(c)
                groups.setdefault(view.numbers(), []).append(c.name)
                bends[view.numbers()] = view.bends()
        for numbers, names in groups.items():
            rows = {name: self.residuals[name] for name in names}
            found = covariances(rows, self.dof, bends[numbers])
            inside = float(_squares(rows, found).mean()) / len(numbers)
            folds, parts = current().packings.folds, []
            fewer = {name: max(round(self.dof[name] * (1 - 1 / folds)), 1) for name in names}
            for fold in range(folds):
                inner = {name: self._part[name] == fold for name in names}
                left = {name: r[inner[name]] for name, r in rows.items()}
                others = covariances({n: r[~inner[n]] for n, r in rows.items()}, fewer, bends[numbers])
                parts.append((left, others))
            squares = np.concatenate([_squares(*part) for part in parts])
            outside = float(squares.mean()) / len(numbers)
            tail = tail_of(squares / outside, len(numbers))
            for name in names:
                self.covariance[name] = found[name] * outside
                self.inflation[name] = outside / inside
                self.tail[name] = tail
                self.folds[name] = [(left[name], others[name] * outside) for left, others in parts]

    def nu(self, condition: Condition) -> float:
        """Degrees of freedom of t of what one recording's packing adds; a mean over packings has no tail."""
        return math.inf if condition.averaged else self.tail[condition.name]

    def apart(self, condition: Condition, points: Collection[Point]) -> tuple[np.ndarray, int]:
        """(k, p) runs of some scenes less the mean of each, leverage taken out, and their degrees of freedom."""
        found = [y for point, y in self.single[condition.name].items() if point in points and len(y) > 1]
        empty = np.zeros((0, len(self.view(condition).numbers())))
        return np.concatenate([empty, *map(_apart, found)]), sum(len(y) - 1 for y in found)

    def predict(self, condition: Condition, coefficients: Mapping[Point, float]) -> tuple[np.ndarray, float]:
        """Predicted numbers (p,) and their variance in units of the spread. KeyError where a scene was not run."""
        found = self.mean[condition.name]
        total = np.zeros(len(self.view(condition).numbers()))
        variance = 0.0
        for point, k in coefficients.items():
            mean, n = found[point]
            total = total + k * mean
            variance += k * k / n
        return total, variance


def _apart(y: np.ndarray) -> np.ndarray:
    """(n, p) less the mean, such that the mean square is the variance."""
    found: np.ndarray = (y - y.mean(axis=0)) * np.sqrt(len(y) / (len(y) - 1))
    return found


def covariances(
    rows: Mapping[str, np.ndarray], dof: Mapping[str, int], turn: np.ndarray
) -> dict[str, np.ndarray]:  # fmt: skip
    """(p, p) of each recording from its residuals (k, p): own standard deviations, correlations of all together.

    turn : (p, p) into numbers that are hardly correlated, see ``View.bends``. There correlations are shrunk: what is
        lost of them costs least
    """
    rows = {name: r @ turn.T for name, r in rows.items()}
    deviations = {name: np.sqrt((r**2).sum(axis=0) / max(len(r), 1)) for name, r in rows.items()}
    typical = np.sqrt(np.mean([d**2 for d in deviations.values()], axis=0))
    scaled = []
    for name, r in rows.items():
        # few runs of one recording lean on the others of the same kind
        n, lean = dof[name], current().packings.lean
        s2 = (n * deviations[name] ** 2 + lean * typical**2) / (n + lean)
        deviations[name] = np.maximum(np.sqrt(s2), 1e-12)
        scaled.append(r / deviations[name])
    z = np.concatenate(scaled)
    p = z.shape[1]
    r = (z.T @ z) / len(z)
    size = np.sqrt(np.maximum(np.diag(r), 1e-300))
    r = r / np.outer(size, size)
    # Schaefer & Strimmer 2005, Stat. Appl. Genet. Mol. Biol. 4, 32: shrink correlations towards none
    off = ~np.eye(p, dtype=bool)
    noise = float(((1 - r[off] ** 2) ** 2).sum()) / max(sum(dof[name] for name in rows), 1)
    share = min(max(noise / max(float((r[off] ** 2).sum()), 1e-300), 0.05), 1.0) if p > 1 else 0.0
    r = np.where(off, (1 - share) * r, 1.0)
    back = np.linalg.inv(turn)
    return {name: back @ (r * np.outer(d, d)) @ back.T for name, d in deviations.items()}


def tail_of(squares: np.ndarray, p: int) -> float:
    """Degrees of freedom of a t distribution of p numbers, by squares (k,) of draws in units of their covariance.

    Of a list, the most likely: few packings do not tell it closely.
    """

    def likelihood(nu: float) -> float:
        if math.isinf(nu):
            factor = 0.5 * p * math.log(2.0)
        else:
            factor = math.lgamma(0.5 * nu) - math.lgamma(0.5 * (nu + p)) + 0.5 * p * math.log(nu - 2)
        return -0.5 * float(np.sum(heavy(squares, p, nu))) - len(squares) * factor

    return max(current().packings.tails, key=likelihood)


def heavy(square: np.ndarray | float, p: int, nu: float) -> np.ndarray | float:
    """What a sum of squares of p numbers in units of their covariance counts for: -2 log of the density of t.

    (nu + p) log(1 + square/(nu - 2)); the square itself where nu is infinite. Some packings are farther off
    than a normal distribution has any, in all their numbers: a gain of 30 is little of 220, and much of 60.
    """
    if math.isinf(nu):
        return square
    return (nu + p) * np.log1p(square / (nu - 2))


def heavy_weight(square: np.ndarray | float, p: int, nu: float) -> np.ndarray | float:
    """The derivative of ``heavy`` by the square: by it each recording counts in least squares."""
    if math.isinf(nu):
        return np.ones_like(square)
    return (nu + p) / (nu - 2 + square)


def _squares(rows: Mapping[str, np.ndarray], covariance: Mapping[str, np.ndarray]) -> np.ndarray:
    """(k,) sums of squares of residuals (k, p), of all recordings, in units of their spread."""
    return np.concatenate([np.sum(r.T * np.linalg.solve(covariance[name], r.T), axis=0) for name, r in rows.items()])


@dataclass
class Model:
    """A prediction that depends on numbers u: anchor + sum_k (u_k - centre_k) slope_k, filmed by a camera.

    anchor, slopes : for each condition;  camera : name of the camera's number for each of u, or None
    """

    name: str
    free: tuple[Free, ...]
    centre: np.ndarray
    anchor: dict[str, Sum]
    slopes: tuple[dict[str, Sum], ...]
    camera: tuple[str | None, ...]

    def sums(self, condition: str, u: np.ndarray) -> Sum:
        parts = [(1.0, self.anchor[condition])]
        for k, slope in enumerate(self.slopes):
            if self.camera[k] is None:
                parts.append((float(u[k] - self.centre[k]), slope.get(condition, {})))
        return add(*parts)

    def predict(self, means: Means, condition: Condition, u: np.ndarray) -> tuple[np.ndarray, float]:
        mean, variance = means.predict(condition, self.sums(condition.name, u))
        shown = {name: float(u[k]) for k, name in enumerate(self.camera) if name is not None}
        if shown:
            view = means.view(condition)
            mean = view.filmed(mean, **shown)
        return mean, variance


@dataclass
class Fit:
    """The best numbers of a model.

    objective : -2 log likelihood, summed over conditions, see ``heavy``;  chi2 : squares in units of the covariance
    weights : of each condition, see ``heavy_weight``
    covariance : (k, k) of the numbers;  left : for each condition the innovation (p,) and its covariance (p, p)
    scatter : (k,) variance by the runs near the fit, in units of ``covariance``, where such were done
    """

    model: Model
    u: np.ndarray
    covariance: np.ndarray
    objective: float
    chi2: float
    left: dict[str, tuple[np.ndarray, np.ndarray]]
    count: int
    dof: int  # of the spread's estimate
    weights: dict[str, float]
    scatter: np.ndarray | None = None

    def weighed(self, power: int = 1) -> float:
        """chi2 of the conditions, each times its weight to a power."""
        return sum(
            self.weights[name] ** power * float(r @ np.linalg.solve(v, r)) for name, (r, v) in self.left.items()
        )

    @property
    def told(self) -> np.ndarray:
        """(k, k) covariance that intervals are told by: wider where the fit is poor, or runs near it scatter more."""
        wide = np.full(len(self.u), max(self.weighed() / max(self.count - len(self.u), 1), 1.0))
        wide = np.sqrt(wide if self.scatter is None else np.maximum(wide, self.scatter))
        return self.covariance * np.outer(wide, wide)

    def interval(self, k: int) -> tuple[float, float]:
        """Central 95 % of number k, by Student's t with the dof of the spread."""
        free = self.model.free[k]
        half = float(stats.t.ppf(0.975, max(self.dof, 2))) * float(np.sqrt(max(self.told[k, k], 0.0)))
        return max(float(self.u[k]) - half, free.low), min(float(self.u[k]) + half, free.high)


def spread_of(means: Means, condition: Condition, variance: float, error: np.ndarray) -> np.ndarray:
    """(p, p) covariance of seen less predicted: the recording's own packing, the prediction's error, the tracking."""
    own = 0.0 if condition.averaged else 1.0
    total: np.ndarray = means.covariance[condition.name] * (own + variance) + error
    return total


def fit(
    model: Model, means: Means, conditions: Sequence[Condition], seen: Mapping[str, np.ndarray] | None = None,
    rounds: int | None = None, start: np.ndarray | None = None,
) -> Fit:  # fmt: skip
    """Gauss-Newton on the generalised least squares; the covariance follows the numbers from round to round."""
    u = (model.centre if start is None else start).copy()
    low = np.array([f.low for f in model.free])
    high = np.array([f.high for f in model.free])
    steps = np.array([max(abs(f.scale), 1e-300) for f in model.free])

    def evaluate(u: np.ndarray):
        left, spreads = {}, {}
        for c in conditions:
            y = c.seen if seen is None else seen[c.name]
            mean, h = model.predict(means, c, u)
            left[c.name] = y - mean
            spreads[c.name] = spread_of(means, c, h, c.error)
        return left, spreads

    tails = {c.name: means.nu(c) for c in conditions}

    def value(left, spreads) -> tuple[float, dict[str, float]]:
        squares, total = {}, 0.0
        for name, r in left.items():
            factor = np.linalg.cholesky(spreads[name])
            z = np.linalg.solve(factor, r)
            squares[name] = float(z @ z)
            total += float(heavy(squares[name], len(r), tails[name])) + 2 * float(np.log(np.diag(factor)).sum())
        return total, squares

    def weights(squares: Mapping[str, float]) -> dict[str, float]:
        return {name: float(heavy_weight(q, len(left[name]), tails[name])) for name, q in squares.items()}

    falls = current().packings.falls
    left, spreads = evaluate(u)
    best = value(left, spreads)
    covariance = np.zeros((len(u), len(u)))
    for _ in range((current().packings.rounds if rounds is None else rounds) if len(u) else 0):
        whitened, columns, counted = [], [], weights(best[1])
        for c in conditions:
            factor = np.linalg.cholesky(spreads[c.name]) / math.sqrt(counted[c.name])
            base, _ = model.predict(means, c, u)
            jacobian = []
            for k in range(len(u)):
                step = stride(u[k], steps[k], high[k])
                moved = u.copy()
                moved[k] += step
                jacobian.append((model.predict(means, c, moved)[0] - base) / step)
            whitened.append(np.linalg.solve(factor, left[c.name]))
            columns.append(np.linalg.solve(factor, np.array(jacobian).T))
        a, b = np.concatenate(columns), np.concatenate(whitened)
        size = np.maximum(np.sqrt((a**2).sum(axis=0)), 1e-300)
        covariance = np.linalg.pinv((a / size).T @ (a / size), rcond=1e-10) / np.outer(size, size)
        change = _bounded(a, b, u, low, high, size)
        took = moved_far = False
        for share in current().packings.steps:
            tried = np.clip(u + share * change, low, high)
            l2, s2 = evaluate(tried)
            now = value(l2, s2)
            if now[0] < best[0] - falls[0]:
                took = True
                moved_far = best[0] - now[0] > falls[1]
                u, left, spreads, best = tried, l2, s2, now
                break
        if not took or not moved_far:
            break
    count = sum(len(r) for r in left.values())
    dof = min((means.dof[c.name] for c in conditions), default=0)
    # weights from few runs are not the best ones: the numbers scatter more than the formula says
    covariance = covariance * (1 + count / max(len(conditions), 1) / max(dof, 1))
    return Fit(
        model, u, covariance, best[0], sum(best[1].values()), {k: (left[k], spreads[k]) for k in left}, count, dof,
        weights(best[1]),
    )  # fmt: skip


def stride(value: float, scale: float, high: float) -> float:
    """By how much a number is moved for a derivative: away from its upper bound."""
    step = current().packings.slope * scale
    return -step if value + step > high else step


def _bounded(a: np.ndarray, b: np.ndarray, u, low, high, size) -> np.ndarray:
    from scipy.optimize import lsq_linear

    lower, upper = (low - u) * size - 1e-12, (high - u) * size + 1e-12
    found: np.ndarray = lsq_linear(a / size, b, (lower, upper)).x
    return found / size


def whitened(fit_: Fit) -> np.ndarray:
    """(n,) innovations of all conditions in units of their spread, uncorrelated."""
    return np.concatenate([np.linalg.solve(np.linalg.cholesky(v), r) for r, v in fit_.left.values()])
