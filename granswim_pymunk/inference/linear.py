"""Projections in the space of residuals: what one set of columns can take over from another."""

from __future__ import annotations

import numpy as np

from .criteria import current


def basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the columns (n, k), those that are numerically dependent left out."""
    if columns.shape[1] == 0:
        return columns
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    if columns.shape[1] == 0:
        return columns
    if columns.shape[1] > current().fits.many:
        # many starts hardly depend on one another: the roots of their normal equations do
        values, vectors = np.linalg.eigh(columns.T @ columns)
        kept = values > current().rounding.eigenvalue * values[-1]
        return np.asarray(columns @ (vectors[:, kept] / np.sqrt(values[kept])))
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > current().rounding.singular * s[0]]


def errors_of(columns: np.ndarray) -> np.ndarray:
    """E (k, k) with E E' = (J'J)^-1 of the columns J (n, k): E z are errors of numbers, z standard normal.

    What shows in nothing is left where it is.
    """
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    told, turned = np.linalg.eigh((columns / size).T @ (columns / size))
    told = np.where(told > current().rounding.told * told.max(initial=0.0), told, np.inf)
    return np.asarray(turned / np.sqrt(told) / size[:, None])


def project(columns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Projection of ``vectors`` (n, m) on the span of ``columns`` (n, k)."""
    if columns.shape[1] > current().fits.many:
        size = np.linalg.norm(columns, axis=0)
        columns = columns[:, size > 0] / size[size > 0]
        values, turned = np.linalg.eigh(columns.T @ columns)
        kept = values > current().rounding.eigenvalue * values[-1]
        inner = turned[:, kept].T @ (columns.T @ vectors) / values[kept, None]
        return np.asarray(columns @ (turned[:, kept] @ inner))
    q = basis(columns)
    return np.asarray(q @ (q.T @ vectors))
