"""Least squares with few shared numbers and many that belong to one recording each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..criteria import current


class Secant:
    """Derivatives that are updated by what a step showed, as long as they foresaw it: a run for each number is saved.

    J + (r - r_0 - J s) (D^2 s)'/(s' D^2 s), s the step in the numbers, D the lengths of the columns of J.
    Source: Broyden 1965, Math. Comput. 19, 577.
    """

    def __init__(self) -> None:
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._updates = 0

    def anew(self, z: np.ndarray, residuals: np.ndarray, jacobian: np.ndarray) -> None:
        """Derivatives (n, k) of the residuals (n,) at z (k,), taken by runs."""
        self._last, self._updates = (np.array(z), residuals, jacobian), 0

    def at(self, z: np.ndarray, residuals: np.ndarray) -> np.ndarray | None:
        """Derivatives (n, k) at z (k,), None where they should be taken by runs."""
        if self._last is None or self._updates == current().fits.updates:
            return None
        before, there, jacobian = self._last
        step = z - before
        missed = residuals - there - jacobian @ step
        weight = np.sum(jacobian**2, axis=0) * step
        most = current().fits.straight * np.linalg.norm(residuals - there)
        if not weight @ step > 0 or not np.linalg.norm(missed) < most:
            return None
        self._last = np.array(z), residuals, jacobian + np.outer(missed, weight / (weight @ step))
        self._updates += 1
        return self._last[2]


@dataclass
class Blocks:
    """Residuals of one recording and their derivatives: r (n,), by shared numbers (n, p), by its own (n, q).

    The derivatives are of the prediction: residuals fall by them.
    """

    residuals: np.ndarray
    by_value: np.ndarray
    by_start: np.ndarray
    normal: np.ndarray | None = None  # by_start' by_start (q, q), where it is known from before
    seen: int | None = None  # how many rows were measured, where those after them tie starts to one another


Numbers = tuple[np.ndarray, list[np.ndarray]]


@dataclass(frozen=True)
class Problem:
    """What is to be made small.

    evaluate : of values and starts, the residuals of each recording;  loss : of these residuals, what is to fall
    differentiate : of values, starts, residuals and whether derivatives by starts are taken anew, the blocks there,
        each row weighted as the loss asks for (iterated weights)
    """

    evaluate: Callable[[np.ndarray, list[np.ndarray]], list[np.ndarray]]
    differentiate: Callable[[np.ndarray, list[np.ndarray], list[np.ndarray], bool], list[Blocks]]
    loss: Callable[[list[np.ndarray]], float]


def descend(
    problem: Problem,
    begin: Numbers,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    stale: bool,
    evaluations: int,
    tolerance: float | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[np.ndarray, list[np.ndarray], bool]:
    """Levenberg-Marquardt with the numbers of each recording eliminated and bounds on the shared ones.

    Returns values and starts, and whether the search came to its end rather than to that of its ``evaluations``.

    stale : the derivatives by starts are those of a neighbouring fit: kept as long as steps are as good as promised;
    where starts are tied closely (``Blocks.seen``) twice as long each time new ones made them no better: then the
    valley is bent
    Ends where chi2 falls by less than ``tolerance`` of itself, or by what no decision hangs on, after ``evaluations``,
    or when told.
    Source: Moré 1978, Lecture Notes in Mathematics 630, 105; the elimination is the bundle adjustment of
    Triggs et al. 2000.
    """
    evaluate, differentiate, loss = problem.evaluate, problem.differentiate, problem.loss
    low, high = bounds
    values, starts = np.clip(begin[0], low, high), [s.copy() for s in begin[1]]
    residuals = evaluate(values, starts)
    chi2 = loss(residuals)
    criteria = current().fits
    tolerance = criteria.ends if tolerance is None else tolerance
    damping, used, fresh = criteria.damping, 1, not stale
    age, patience = 0, 1  # steps since derivatives by starts were taken, and for how many they are kept whatever comes
    if stop():
        return values, starts, False
    blocks = differentiate(values, starts, residuals, fresh)
    closely = any(b.seen is not None for b in blocks)
    while used < evaluations and not stop():
        step, steps, promised = gauss_newton(blocks, values, bounds, damping)
        new_values = np.clip(values + step, low, high)
        new_starts = [s + d for s, d in zip(starts, steps, strict=True)]
        found = evaluate(new_values, new_starts)
        used += 1
        now = loss(found)
        good = (chi2 - now) / promised if promised > 0 else 0.0
        if np.isfinite(now) and now < chi2:
            fall = chi2 - now
            values, starts, residuals, chi2 = new_values, new_starts, found, now
            damping = max(damping / criteria.softer, criteria.least) if good > criteria.good else damping
            if fall < max(tolerance * chi2, criteria.enough):
                return values, starts, True
            poor = good < criteria.renewed
            patience = min(2 * patience, evaluations) if poor and fresh else patience
            age = 1 if fresh else age + 1
            fresh = not stale or (poor and (age >= patience or not closely))
            blocks = differentiate(values, starts, residuals, fresh)
        elif not fresh:
            fresh = True
            blocks = differentiate(values, starts, residuals, True)
        else:
            damping = max(criteria.harder * damping, criteria.again)
            if damping > criteria.stiff or promised < max(tolerance * chi2, criteria.enough):
                return values, starts, True
    return values, starts, False


def gauss_newton(
    blocks: Sequence[Blocks], values: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], damping: float
) -> tuple[np.ndarray, list[np.ndarray], float]:
    """Steps of the shared and of the other numbers, and the fall of chi2 they promise."""
    p = len(values)
    normal, gradient = np.zeros((p, p)), np.zeros(p)
    own = []
    for b in blocks:
        h = (b.by_start.T @ b.by_start) if b.normal is None else b.normal.copy()
        g = b.by_start.T @ b.residuals
        cross = b.by_start.T @ b.by_value
        # what ties starts to one another, however narrowly, leaves them free to move together
        size, least = np.diag(h).copy(), 1e-12 * max(float(np.diag(h).max(initial=0.0)), 1e-300)
        if b.seen is not None:
            size = np.sum(b.by_start[: b.seen] ** 2, axis=0)
        h[np.diag_indices_from(h)] += damping * size + least
        factor = cho_factor(h, check_finite=False) if len(g) else None
        solved = cho_solve(factor, np.column_stack([g, cross]), check_finite=False) if len(g) else np.zeros((0, p + 1))
        normal += b.by_value.T @ b.by_value - cross.T @ solved[:, 1:]
        gradient += b.by_value.T @ b.residuals - cross.T @ solved[:, 0]
        own.append((solved, size))
    power = sum((np.sum(b.by_value**2, axis=0) for b in blocks), np.zeros(p))
    if any(b.seen is not None for b in blocks):
        power = np.where(power > 0, np.maximum(np.diag(normal), 1e-12 * power), 0.0)
    step = _bounded(normal, gradient, values, bounds, damping, power)
    steps = [solved[:, 0] - solved[:, 1:] @ step for solved, _ in own]
    left = [b.residuals - b.by_value @ step - b.by_start @ s for b, s in zip(blocks, steps, strict=True)]
    promised = sum(float(b.residuals @ b.residuals) - float(r @ r) for b, r in zip(blocks, left, strict=True))
    return step, steps, promised


def _bounded(
    normal: np.ndarray, gradient: np.ndarray, values: np.ndarray, bounds: tuple[np.ndarray, np.ndarray],
    damping: float, size: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Solve for the shared numbers; those that would leave their bounds stop there, and the others again."""
    p = len(values)
    step = np.zeros(p)
    scale = np.sqrt(np.maximum(size, 1e-300))
    open_ = size > 0
    for _ in range(p + 1):
        if not open_.any():
            break
        rest = gradient - normal @ np.where(open_, 0.0, step)
        part = normal[np.ix_(open_, open_)] / np.outer(scale[open_], scale[open_])
        part = part + (damping + 1e-12) * np.eye(len(part))
        step[open_] = np.linalg.lstsq(part, rest[open_] / scale[open_], rcond=1e-12)[0] / scale[open_]
        room = np.clip(values + step, *bounds) - values
        stopped = open_ & (np.abs(room - step) > current().rounding.column * np.abs(step))
        if not stopped.any():
            break
        step[stopped] = room[stopped]
        open_ &= ~stopped
    return step
