"""Tails and quantiles are those of scipy.stats, which no command waits for."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from granswim_pymunk import distributions

X = np.array([-2.0, 0.0, 0.3, 1.0, 9.0, 80.0])
P = np.array([1e-12, 0.01, 0.5, 0.975])


@pytest.mark.parametrize(
    ("name", "function", "first", "shape"),
    [
        ("norm", "cdf", X, ()), ("norm", "sf", X, ()), ("norm", "ppf", P, ()), ("norm", "isf", P, ()),
        ("t", "sf", X, (3.5,)), ("t", "ppf", P, (2,)), ("t", "ppf", P, (np.inf,)),
        ("chi2", "sf", X, (4,)), ("chi2", "logsf", X, (1.5,)), ("chi2", "isf", P, (7,)),
        ("f", "sf", X, (3, 11.5)), ("f", "logsf", X, (3, 11)), ("beta", "ppf", P, (3, 9)),
    ],
)  # fmt: skip
def test_they_are_those_of_scipy_stats(name, function, first, shape):
    ours, theirs = (getattr(getattr(m, name), function)(first, *shape) for m in (distributions, stats))
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def test_commands_do_without_it():
    code = (
        "import sys, granswim_pymunk.inference, granswim_pymunk.run, granswim_pymunk.sweep, granswim_pymunk.report;"
        "sys.exit('scipy.stats' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
