"""Tails and quantiles of normal, Student's, chi-squared, F and beta distributions, by ``scipy.special``.

They are those of ``scipy.stats``, by name and argument, which takes as long to import as all else that a command needs.
Arguments are numbers or arrays that broadcast; so is what comes back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import special


class norm:
    """Of mean 0 and variance 1."""

    @staticmethod
    def cdf(x: Any) -> Any:
        """Probability to be at or below x."""
        return special.ndtr(x)

    @staticmethod
    def sf(x: Any) -> Any:
        """Probability to be above x."""
        return special.ndtr(-np.asarray(x))

    @staticmethod
    def ppf(p: Any) -> Any:
        """Where a share p lies below."""
        return special.ndtri(p)

    @staticmethod
    def isf(p: Any) -> Any:
        """Where a share p lies above."""
        return -special.ndtri(p)


class t:
    """Student's, with df degrees of freedom."""

    @staticmethod
    def sf(x: Any, df: Any) -> Any:
        """Probability to be above x."""
        return special.stdtr(df, -np.asarray(x))

    @staticmethod
    def ppf(p: Any, df: Any) -> Any:
        """Where a share p lies below."""
        return special.stdtrit(df, p)


class chi2:
    """Chi-squared with df degrees of freedom."""

    @staticmethod
    def sf(x: Any, df: Any) -> Any:
        """Probability to be above x."""
        return special.chdtrc(df, np.maximum(x, 0.0))

    @staticmethod
    def logsf(x: Any, df: Any) -> Any:
        """Its natural logarithm."""
        with np.errstate(divide="ignore"):
            return np.log(chi2.sf(x, df))

    @staticmethod
    def isf(p: Any, df: Any) -> Any:
        """Where a share p lies above."""
        return special.chdtri(df, p)


class f:
    """Of a ratio of mean squares with dfn over dfd degrees of freedom."""

    @staticmethod
    def sf(x: Any, dfn: Any, dfd: Any) -> Any:
        """Probability to be above x."""
        return special.fdtrc(dfn, dfd, np.maximum(x, 0.0))

    @staticmethod
    def logsf(x: Any, dfn: Any, dfd: Any) -> Any:
        """Its natural logarithm."""
        with np.errstate(divide="ignore"):
            return np.log(f.sf(x, dfn, dfd))


class beta:
    """Beta with exponents a - 1 and b - 1."""

    @staticmethod
    def ppf(p: Any, a: Any, b: Any) -> Any:
        """Where a share p lies below."""
        return special.betaincinv(a, b, p)
