"""A car's steering in a timed motion: its lock, and how fast it turns, bounded at every moment.

On a segment the way rolled and the heading are polynomials of a share; f and g are their derivatives. The
steering angle is atan(R g / f), of a wheel one turning radius R ahead of the axle. A factor common to f and g
changes nothing of it: such are zeros where the base begins or ends to roll while the arm goes on.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.verification.motion import Indices, MotionSegments
from regionik.verification.timed_segments import (
    SLIPPED,
    TimedSegments,
    bernstein_parts,
    product,
    substitution,
)
from regionik.worlds.arrays import Array

STEERED = 1e-5  # angle that a car's steering need not be turned for [rad]
ZERO = 1e-9  # of derivatives at an end of a segment, as a share of the largest
MOST = 1e9  # share of a limit where nothing bounds it


def steering_shares(
    segments: MotionSegments, course: TimedSegments, limit: float
) -> Iterator[tuple[str, Array, Indices]]:
    """Shares of a car's lock, and of the limit of its steering's rate, that segments use at the most."""
    k, ways, share_rates = course.rolling()
    f, g = _without_common_zeros(ways) * np.array([1.0, segments.robot.turning_radius])[:, None, None]
    far = np.abs(segments.rolled[k])
    room = [np.sign(segments.rolled[k])[:, None] * f - side * g for side in (-1, 1)]
    least = np.minimum(*(_parts(one).min(axis=(0, 2)) for one in room))
    yield "the steering's lock", 1 - least / (far + SLIPPED), k

    turning = product(_derivative(g), f) - product(g, _derivative(f))
    square = limit * (product(f, f) + product(g, g))
    yield "the steering", _largest_share(product(product(turning, turning), share_rates), square), k

    time = segments.motion.time
    with np.errstate(divide="ignore", invalid="ignore"):
        begun, ended = np.arctan(g[:, 0] / f[:, 0]), np.arctan(g.sum(axis=1) / f.sum(axis=1))
        turned = np.abs(begun[1:] - ended[:-1])
        rate = np.where(turned > STEERED, turned / (time[k[1:]] - time[k[:-1] + 1]), 0.0)
    yield "the steering", np.minimum(rate / limit, MOST), k[1:]


def _largest_share(used: Array, limit: Array) -> Array:
    """Upper bounds (m,) for the roots of polynomials (m, n) as shares of the squares of others (m, k)."""
    most = product(limit, limit)
    beyond = np.zeros((len(used), max(used.shape[1], most.shape[1])))
    beyond[:, : used.shape[1]] += used
    beyond[:, : most.shape[1]] -= most
    over, most = _parts(beyond).max(axis=2), _parts(most)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = 1 + over / np.where(over > 0, np.maximum(most.min(axis=2), 0.0), most.max(axis=2))
    found: Array = np.sqrt(np.clip(np.nan_to_num(square, nan=0.0), 0.0, MOST**2).max(axis=0))
    return found


def _derivative(polynomials: Array) -> Array:
    """Of polynomials (m, n), constant first, (m, n - 1)."""
    found: Array = polynomials[:, 1:] * np.arange(1, polynomials.shape[1])
    return found


def _parts(polynomials: Array) -> Array:
    """Bernstein coefficients of polynomials (m, n) on parts of the interval from 0 to 1, (parts, m, n)."""
    return np.stack(list(bernstein_parts(polynomials)))


def _without_common_zeros(ways: Array) -> Array:
    """Derivatives, (2, m, 3), of cubics (2, m, 4), less factors of zeros at an end that both have."""
    found = np.stack([_derivative(one) for one in ways])
    for _ in range(2):  # at the start, then, seen from there, at the end
        zero = (np.abs(found[..., 0]) <= ZERO * np.abs(found).sum(axis=2).max(axis=0)).all(axis=0)
        shifted = np.concatenate([found[..., 1:], np.zeros_like(found[..., :1])], axis=2)
        found = np.where(zero[:, None], shifted, found) @ substitution(3, 1.0, -1.0).T
    return found
