"""What windows say about candidates: noise from replicates, signatures, generalised least squares, nulls.

Everything is whitened with the covariance of replicates: the recalibrated scene simulated, filmed, and put through
the same estimate. Their mean is the estimator's own bias (it smooths velocities, which looks like drag).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular

from ..criteria import current
from ..hypothesis import Term
from ..linear import basis


@dataclass(frozen=True)
class Noise:
    """Of the innovations of one film: bias (W, D) [m], and per window the lower root of the covariance (W, D, D).

    residuals : (N, W, D) of the replicates, without their mean [m];  replicates : (N, W, D) their innovations [m];
    both empty where there were none
    """

    bias: np.ndarray
    roots: np.ndarray
    residuals: np.ndarray
    replicates: np.ndarray
    parts: dict[tuple[int, bytes], np.ndarray] = field(default_factory=dict, repr=False)  # roots of what was seen
    others: list[Noise] = field(default_factory=list, repr=False)  # see ``by_others``

    def whiten(self, innovations: np.ndarray, windows: Sequence[int] | np.ndarray | None = None) -> np.ndarray:
        """Innovations or their changes (W, D) [m] of some windows in standard deviations, (w, D).

        What was not seen (NaN) gives zeros.
        """
        chosen = range(len(innovations)) if windows is None else windows
        out = np.zeros((len(chosen), innovations.shape[1]))
        for k, w in enumerate(chosen):
            row = innovations[w]
            seen = np.isfinite(row)
            if seen.all():
                out[k] = solve_triangular(self.roots[w], row, lower=True)
            elif seen.any():
                key = int(w), seen.tobytes()
                root = self.parts.get(key)
                if root is None:
                    part = self.roots[w][seen]
                    root = self.parts[key] = np.linalg.cholesky(part @ part.T)
                out[k, seen] = solve_triangular(root, row[seen], lower=True)
        return out

    def by_others(self) -> list[Noise]:
        """For each replicate the noise that all others tell: its own would flatter it."""
        if not self.others:
            self.others.extend(
                replicate_noise(np.delete(self.replicates, k, axis=0)) for k in range(len(self.replicates))
            )
        return self.others


def ensemble_noise(predicted: np.ndarray, windows: np.ndarray, sigma: float) -> Noise:
    """First guess of the noise from the members' own spread: (W, M, D) [m], NaN outside ``windows``."""
    count, members, size = predicted.shape
    inside = predicted[windows] - predicted[windows].mean(axis=1, keepdims=True)
    flat = np.nan_to_num(inside.reshape(-1, size))
    freedom = max(len(windows) * (members - 1), 1)
    covariance = _shrunk(flat.T @ flat / freedom * (1 + 1 / members), freedom) + sigma**2 * np.eye(size)
    root = np.linalg.cholesky(covariance)
    none = np.zeros((0, count, size))
    return Noise(np.zeros((count, size)), np.repeat(root[None], count, axis=0), none, none)


def mean_of_replicates(innovations: np.ndarray) -> np.ndarray:
    """(W, D) [m] of (N, W, D); zero where no replicate was seen."""
    known = np.isfinite(innovations)
    mean: np.ndarray = np.where(known, innovations, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return mean


def replicate_noise(innovations: np.ndarray) -> Noise:
    """Noise from the innovations of replicates (N, W, D) [m]: one bias for each window, one covariance, a size each.

    NaN where nothing was seen; a number that hardly ever was gets no weight.
    """
    criteria = current().windows.signatures
    number, count, size = innovations.shape
    bias = mean_of_replicates(innovations)
    known = np.isfinite(innovations).sum(axis=0)
    left = (innovations - bias) * np.sqrt(known / np.maximum(known - 1, 1))
    valid = np.isfinite(left) & (known > 1)
    flat = np.where(valid, left, 0.0).reshape(-1, size)
    share = np.maximum(valid.reshape(-1, size).mean(axis=0), 1.0 / len(flat))
    flat = flat / np.sqrt(share)
    covariance = _shrunk(flat.T @ flat / len(flat), len(flat) * (number - 1) / number)
    covariance = covariance + criteria.finest**2 * np.eye(size)
    rare = share * len(flat) < criteria.windows
    covariance[rare] = covariance[:, rare] = 0.0
    covariance[rare, rare] = criteria.unknown**2
    root = np.linalg.cholesky(covariance)
    white = solve_triangular(root, flat.T, lower=True).T.reshape(number, count, size)
    # some phases of the cycle are noisier than others
    scale = (np.sum(white**2, axis=(0, 2)) / size + 4.0) / (number + 4.0)
    # the bias is known no better than that many replicates tell
    roots = root * np.sqrt(scale * (1 + 1 / number))[:, None, None]
    return Noise(bias, roots, left * np.sqrt(1 + 1 / number), innovations)


def _shrunk(covariance: np.ndarray, samples: float) -> np.ndarray:
    """Half way to its diagonal, more where there are few samples (Ledoit & Wolf 2004, J. Multivar. Anal. 88, 365).

    One covariance serves windows that are not alike: what is fine in it belongs to none of them.
    """
    size = len(covariance)
    share = max(size / (size + 3.0 * samples), current().windows.signatures.shrunk)
    return (1 - share) * covariance + share * np.diag(np.diag(covariance))


def to_values(term: Term, amounts: np.ndarray) -> np.ndarray:
    """Values of a term's numbers for amounts in units of their scales; amount zero is a law that is absent."""
    return np.array(
        [float(np.clip(f.neutral + a * f.scale, f.low, f.high)) for f, a in zip(term.free, amounts, strict=True)]
    )


def limits(term: Term) -> tuple[np.ndarray, np.ndarray]:
    """Amounts at the bounds of a term's numbers."""
    low, high = np.array([((f.low - f.neutral) / f.scale, (f.high - f.neutral) / f.scale) for f in term.free]).T
    return low, high


@dataclass(frozen=True)
class BedSignature:
    """A candidate around the recalibrated scene.

    columns : (n, k) whitened change of the prediction for one unit of each amount
    clear : (n, k) what the adjustables cannot imitate;  surviving : its share of the length
    tried : (k,) amounts used;  other : (k,) amounts at the other end of the change, 0 where that is no law
    windows : how many of the n rows each window has, in their order; may be left out where none is ever left out
    """

    term: Term
    tried: np.ndarray
    other: np.ndarray
    columns: np.ndarray
    clear: np.ndarray
    surviving: float
    windows: tuple[int, ...] = ()

    def best(self, white: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Amounts (k, m) inside the bounds and the fall in chi2 (m,) for whitened innovations (n, m)."""
        if self.surviving < current().windows.signatures.surviving:
            return np.zeros((self.clear.shape[1], white.shape[1])), np.zeros(white.shape[1])
        amounts = np.linalg.lstsq(self.clear, white, rcond=1e-8)[0]
        low, high = limits(self.term)
        amounts = np.clip(amounts, low[:, None], high[:, None])
        explained = self.clear @ amounts
        return amounts, np.maximum(np.sum(2 * white * explained - explained**2, axis=0), 0.0)

    def jackknife(self, white: np.ndarray) -> np.ndarray:
        """The fall in chi2 (m,) without the window that brings most of it, for whitened innovations (n, m).

        A bed that jams or slips once looks like any law that pushes there; what is missing shows in all windows in
        which it acts. As ``best`` gives it where windows are too few to be told apart.
        Source: Hampel et al. 1986, Robust Statistics, ch. 2 (the influence of one observation).
        """
        criteria = current().windows.signatures
        gain = self.best(white)[1]
        if len(self.windows) < criteria.several or self.surviving < criteria.surviving:
            return gain
        low, high = limits(self.term)
        parts = np.split(np.arange(len(white)), np.cumsum(self.windows)[:-1])
        squares = [self.clear[p].T @ self.clear[p] for p in parts]
        products = [self.clear[p].T @ white[p] for p in parts]
        square, product = sum(squares), sum(products)
        for mine, shown in zip(squares, products, strict=True):
            rest, toward = square - mine, product - shown
            amounts = np.clip(np.linalg.pinv(rest, rcond=1e-12, hermitian=True) @ toward, low[:, None], high[:, None])
            gain = np.minimum(gain, np.sum(amounts * (2 * toward - rest @ amounts), axis=0))
        return np.maximum(gain, 0.0)


def make_signature(
    term: Term, tried: np.ndarray, columns: np.ndarray, nuisance: np.ndarray, other: np.ndarray | None = None,
    windows: Sequence[int] = (),
) -> BedSignature:  # fmt: skip
    """``nuisance`` (n, p): whitened changes of the prediction for the adjustables."""
    q = basis(nuisance)
    clear = columns - q @ (q.T @ columns)
    before = float(np.linalg.norm(columns))
    surviving = float(np.linalg.norm(clear)) / before if before > 0 else 0.0
    other = np.zeros(len(tried)) if other is None else other
    return BedSignature(term, tried, other, columns, clear, surviving, tuple(windows))


def off(nuisance: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Whitened innovations with the adjustables projected out."""
    q = basis(nuisance)
    return white - q @ (q.T @ white)


def whole_films(noises: Sequence[Noise], used: Sequence[np.ndarray]) -> np.ndarray:
    """(n, N) whitened innovations without a candidate, each of one replicate from its first window to its last.

    Every replicate is whitened with the bias and the covariance of the others: its own would flatter it.
    """
    number = min(len(noise.replicates) for noise in noises)
    return np.concatenate([_judged_by_others(noise, w)[:number].reshape(number, -1) for noise, w in zip(
        noises, used, strict=True)], axis=1).T  # fmt: skip


def _judged_by_others(noise: Noise, windows: np.ndarray) -> np.ndarray:
    """(N, w, D)"""
    pairs = zip(noise.by_others(), noise.replicates, strict=True)
    return np.stack([o.whiten(t - o.bias) for o, t in pairs])[:, windows]


def recombined(noises: Sequence[Noise], used: Sequence[np.ndarray], count: int, rng: np.random.Generator) -> np.ndarray:
    """(n, count) whitened innovations without a candidate: each window from a replicate drawn at random.

    What the windows of one film have in common is lost here; see ``coherence``.
    """
    rows = []
    for noise, windows in zip(noises, used, strict=True):
        white = _judged_by_others(noise, windows)
        chosen = rng.integers(len(white), size=(count, white.shape[1]))
        drawn = white[chosen, np.arange(white.shape[1])]
        rows.append(drawn.reshape(count, -1).T)
    return np.concatenate(rows)


def coherence(signatures: Sequence[BedSignature], films: np.ndarray, drawn: np.ndarray) -> float:
    """By how much the candidates gain more on whole films of replicates (n, N) than on recombined windows (n, m); >= 1.

    Errors that the windows of one film share add up along a signature.
    """
    whole = sum(float(s.best(films)[1].mean()) for s in signatures)
    apart = sum(float(s.best(drawn)[1].mean()) for s in signatures)
    return max(whole / apart, 1.0) if apart > 0 else 1.0
