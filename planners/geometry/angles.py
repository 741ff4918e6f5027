"""Angles wrapped to one turn and fitted into limits, compiled."""

from __future__ import annotations

import numpy as np

from regionik.planners.kernels import compiled

TWO_PI = 2.0 * np.pi
_PER_TURN = 1.0 / TWO_PI


@compiled
def wrap(angle: float) -> float:
    """Angle wrapped to (-pi, pi]."""
    turned: float = angle - TWO_PI * np.ceil((angle - np.pi) * _PER_TURN)
    return turned


@compiled
def fit(angle: float, lower: float, upper: float) -> tuple[float, float]:
    """The angle plus whole turns within limits, or else the nearer limit; and how far beyond it is."""
    middle = 0.0
    if np.isfinite(lower) and np.isfinite(upper):
        middle = 0.5 * (lower + upper)
    near = middle + wrap(angle - middle)
    if near < lower:
        return lower, lower - near
    if near > upper:
        return upper, near - upper
    return near, 0.0
