"""How every reader of a plan fills in the way of the base between two states."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array
from regionik.worlds.robot import BaseKind

BULGE = 5e-4  # that a line through points of the way may cut off an arc [m]


def on_way(kind: BaseKind, here: Array, there: Array, share: ArrayLike) -> Array:
    """Base poses on the way from some poses to others, headings running on from the first.

    Parameters
    ----------
    kind : {"omni", "differential", "car"}
        The first moves straight. The others roll along the arc whose heading lies along the chord in the
        middle of the turn; what of the chord lies across that no wheel can roll, and it is slid evenly.
    here, there : (..., 3) arrays
        x, y [m], yaw [rad]; the base turns the shorter way.
    share : (...,) array_like
        0 at ``here``, 1 at ``there``.

    Returns
    -------
    (..., 3) array

    Examples
    --------
    >>> quarter = np.array([1.0, 1.0, np.pi / 2])
    >>> on_way("differential", np.zeros(3), quarter, 0.5).round(3).tolist()
    [0.707, 0.293, 0.785]
    """
    share = np.asarray(share, dtype=np.float64)
    slide, length = _hop(kind, here, there)
    if kind == "omni":
        return here + share[..., None] * slide
    half = share * slide[..., 2] / 2
    chord, middle = share * length * np.sinc(half / np.pi), here[..., 2] + half
    pose: Array = here + share[..., None] * slide
    pose[..., 0] += chord * np.cos(middle)
    pose[..., 1] += chord * np.sin(middle)
    return pose


def travel(kind: BaseKind, base: Array) -> float:
    """Length of the way through base poses (n, 3) [m]."""
    slide, length = _hop(kind, base[:-1], base[1:])
    return float((np.hypot(slide[:, 0], slide[:, 1]) + np.abs(length)).sum())


def lengths(kind: BaseKind, base: Array) -> Array:
    """Way that is rolled over each hop through base poses (n, 3), backwards below 0, (n - 1,) [m]."""
    return _hop(kind, base[:-1], base[1:])[1]


def wheels(base: Array, gauge: float) -> Array:
    """Way of the left and right wheel over each hop through base poses (n, 3), (n - 1, 2) [m].

    Parameters
    ----------
    base : (n, 3) array
        Of a base that turns on the spot.
    gauge : float
        Distance between its wheels [m].
    """
    slide, length = _hop("differential", base[:-1], base[1:])
    turn = slide[:, 2] * gauge / 2
    return np.column_stack([length - turn, length + turn])


def cuts(kind: BaseKind, base: Array) -> Array:
    """Where to look at the way through base poses (n, 3) so that lines between are near it, (m,).

    In poses: 2.5 is halfway from the third to the fourth. All poses are among them.
    """
    slide, length = _hop(kind, base[:-1], base[1:])
    pieces = np.ceil(np.sqrt(np.abs(length * slide[:, 2]) / (8 * BULGE))).astype(int)
    parts = [k + np.arange(max(n, 1)) / max(n, 1) for k, n in enumerate(pieces.tolist())]
    return np.concatenate([*parts, [len(base) - 1.0]])


def sampled(kind: BaseKind, base: Array, index: Array) -> Array:
    """Base poses (m, 3) where `cuts` says."""
    hop = np.minimum(index.astype(int), max(len(base) - 2, 0))
    return on_way(kind, base[hop], base[np.minimum(hop + 1, len(base) - 1)], index - hop)


def trace(kind: BaseKind, base: Array) -> Array:
    """A line on the floor along the way through base poses (n, 3), (m, 2) [m]."""
    return sampled(kind, base, cuts(kind, base))[:, :2]


def _hop(kind: BaseKind, here: Array, there: Array) -> tuple[Array, Array]:
    """What is slid and turned evenly (..., 3), and the way that is rolled besides (...,) [m]."""
    step = np.array(there - here)
    step[..., 2] -= 2 * np.pi * np.ceil((step[..., 2] - np.pi) / (2 * np.pi))
    if kind == "omni":
        return step, np.zeros(step.shape[:-1])
    half = step[..., 2] / 2
    tangent = np.stack([np.cos(here[..., 2] + half), np.sin(here[..., 2] + half)], -1)
    along = (step[..., :2] * tangent).sum(-1)
    step[..., :2] -= along[..., None] * tangent
    return step, along / np.sinc(half / np.pi)
