"""The observer of windows: standard errors of a law among Gaussian members are those of theory."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk.validation.window_limits import View, observe


def _windows(strays: float = 1.0) -> tuple[list[View], float]:
    """Three windows of 600 members with one covariance, and the standard errors of a known change in all of them."""
    rng = np.random.default_rng(3)
    root, change = rng.normal(size=(4, 4)), np.array([0.5, -0.3, 0.2, 0.4])
    noise = np.full(4, 0.3)
    views = []
    for _ in range(3):
        clean = rng.normal(size=(600, 4)) @ root.T
        film = strays * (root @ rng.normal(size=4) + noise * rng.normal(size=4))
        views.append(View(clean, {"push": clean + change}, noise, film))
    told = change @ np.linalg.solve(root @ root.T + np.diag(noise**2), change)
    return views, float(np.sqrt(3 * told))


@pytest.mark.parametrize("pooled", [True, False])
def test_standard_errors_are_those_of_theory(pooled):
    views, expected = _windows()
    assert observe(views, pooled, 0.0)["push"].errors == pytest.approx(expected, rel=0.1)


def test_weights_that_know_no_correlations_tell_less():
    views, expected = _windows()
    assert observe(views, False, 1.0)["push"].errors < 0.9 * expected


def test_a_film_that_strays_is_seen():
    near, far = (np.mean(np.square(observe(_windows(s)[0], False, 0.0)["push"].film)) for s in (1.0, 5.0))
    assert far == pytest.approx(25 * near, rel=0.3)
