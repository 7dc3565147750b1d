"""A stream, which is fitted as a drag c and the push c u, told as the drag and the velocity u."""

from __future__ import annotations

from typing import Any

import numpy as np

from .significance import half_interval


def flow_of(
    values: np.ndarray, covariance: np.ndarray | None, drift: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray | None]:
    """(c, u_x, u_y) [kg/s, m/s] of (c, c u_x, c u_y) [kg/s, N], and their covariance to first order.

    drift [m/s] : to which the fitted push is relative
    """
    c, wx, wy = (float(v) for v in values)
    c = max(c, 1e-12)
    told = np.array([c, wx / c + drift[0], wy / c + drift[1]])
    if covariance is None:
        return told, None
    jacobian = np.array([[1.0, 0.0, 0.0], [-wx / c**2, 1 / c, 0.0], [-wy / c**2, 0.0, 1 / c]])
    return told, jacobian @ covariance @ jacobian.T


def told_flow(
    flow: tuple[np.ndarray, np.ndarray | None], names: tuple[str, str]
) -> dict[str, tuple[Any, Any, Any, str]]:
    """What the verdict says of a stream: by ``names`` of drag and velocity (value, low, high, unit), 95 %."""
    value = [float(v) for v in flow[0]]
    low: list[float | None] = [None] * 3
    high: list[float | None] = [None] * 3
    if flow[1] is not None:
        half = [half_interval(float(v)) for v in np.diag(flow[1])]
        low = [max(value[0] - half[0], 0.0), *(v - h for v, h in zip(value[1:], half[1:], strict=True))]
        high = [v + h for v, h in zip(value, half, strict=True)]
    return {
        names[0]: (value[0], low[0], high[0], "kg/s"),
        names[1]: (value[1:], low[1:], high[1:], "m/s"),
    }
