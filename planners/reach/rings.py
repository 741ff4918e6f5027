"""Exact reach of a planar arm: at every height, the intervals of r that a posture within limits reaches."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from regionik.planners.kernels import compiled
from regionik.planners.solvers.fabrik import Pair
from regionik.planners.solvers.planar_kinematics import PlanarLinkage, intervals_at_height
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array, Index

MAX_INTERVALS = 16  # at one height
MIN_END_DISTANCE = 1e-7  # ends that are nearer to each other than this may be taken for each other [m]
TURNING_WIDTH = 1e-6  # of a turning height: ends at heights this near to one are searched anew [m]

FREE = (-np.inf, np.inf)


def boundary_circles(arm: PlanarArm, shoulder_z: float, pitches: Pair = FREE) -> Array:
    """Circles of the plane on which the reach can begin or end: rows of center r, center z, radius [m].

    The boundary of the reach is made of critical postures: every free bend either turns a rigid rest or
    lines up with it, all others, or the pitch, stand at a limit. Arguments are those of `reach_spans`.
    """
    shoulder = complex(arm.shoulder[0], shoulder_z)
    limits = [[bend for bend in (arm.lower[i], arm.upper[i]) if np.isfinite(bend)] for i in range(3)]
    circles: list[tuple[complex, float]] = []
    if pitches[0] != pitches[1]:
        circles += _free_circles(arm, shoulder, limits)
    for pitch in set(pitches):
        if np.isfinite(pitch):
            circles += _pitched_circles(arm, shoulder, limits, pitch)
    rows = np.array([[center.real, center.imag, radius] for center, radius in circles])
    unique: Array = np.unique(rows.round(12), axis=0)
    return unique


def _free_circles(
    arm: PlanarArm, shoulder: complex, limits: list[list[float]]
) -> list[tuple[complex, float]]:
    """Critical circles with a free last link."""
    a, b, c = (complex(length) for length in arm.lengths)
    circles: list[tuple[complex, float]] = []
    for bend in [*limits[1], 0.0, np.pi]:
        upper = a + b * np.exp(1j * bend)
        circles += [(shoulder, abs(abs(upper) + s * abs(c))) for s in (1, -1)]
        circles += [(shoulder, abs(upper + c * np.exp(1j * (bend + w)))) for w in limits[2]]
        circles += [(shoulder + upper * np.exp(1j * first), abs(c)) for first in limits[0]]
    for bend in [*limits[2], 0.0, np.pi]:
        rest = abs(b + c * np.exp(1j * bend))
        circles += [(shoulder, abs(abs(a) + s * rest)) for s in (1, -1)]
        circles += [(shoulder + a * np.exp(1j * first), rest) for first in limits[0]]
    return circles


def _pitched_circles(
    arm: PlanarArm, shoulder: complex, limits: list[list[float]], pitch: float
) -> list[tuple[complex, float]]:
    """Critical circles with the last link held at a pitch."""
    a, b, c = (complex(length) for length in arm.lengths)
    wrist = shoulder + c * np.exp(1j * pitch)
    circles = [(wrist, abs(a + s * b)) for s in (1, -1)]
    circles += [(wrist, abs(a + b * np.exp(1j * bend))) for bend in limits[1]]
    circles += [(wrist + a * np.exp(1j * bend), abs(b)) for bend in limits[0]]
    circles += [(wrist + b * np.exp(1j * (pitch - bend)), abs(a)) for bend in limits[2]]
    return circles


def reach_intervals(arm: PlanarArm, shoulder_z: float, heights: Array, pitches: Pair = FREE) -> list[Array]:
    """Intervals of signed r within reach for every height, (k, 2) each; see `reach_spans`."""
    owner, spans = reach_spans(arm, shoulder_z, heights, pitches)
    return np.split(spans, np.searchsorted(owner, np.arange(1, len(heights))))


def reach_spans(
    arm: PlanarArm,
    shoulder_z: float,
    heights: Array,
    pitches: Pair = FREE,
    *,
    front: bool = True,
    back: bool = True,
) -> tuple[NDArray[np.intp], Array]:
    """Intervals of signed r within reach at all heights in one table.

    Parameters
    ----------
    shoulder_z : float
        Height of the first hinge above the floor [m].
    heights : (n,) array
        Tool heights above the floor [m].
    pitches : (low, high)
        Angles that the last link may take in the plane [rad]; equal where it is fixed.
    front, back : bool
        Which of r > 0 and r < 0 to take.

    Returns
    -------
    owner : (m,) array of int
        Index of the height of each interval, ascending.
    spans : (m, 2) array
        Ascending for each height; none crosses r = 0, so that each lies in front of the axis or behind it.
    """
    circles, turns = _boundary(arm, shoulder_z, pitches)
    plane = PlanarLinkage(float(arm.shoulder[0]), shoulder_z, arm.lengths, arm.lower, arm.upper)
    out, counts = np.empty((len(heights), MAX_INTERVALS, 2)), np.empty(len(heights), dtype=np.int64)
    order = np.argsort(heights, kind="stable")
    _spans(plane, pitches, (circles, turns), np.asarray(heights)[order], (front, back), out, counts)
    out[order], counts[order] = out.copy(), counts.copy()
    real = np.arange(MAX_INTERVALS) < counts[:, None]
    return np.repeat(np.arange(len(heights)), counts), out[real]


@lru_cache(maxsize=4096)
def _boundary(arm: PlanarArm, shoulder_z: float, pitches: Pair) -> tuple[Array, Array]:
    """Boundary circles and their turning heights."""
    circles = boundary_circles(arm, shoulder_z, pitches)
    return circles, turning_heights(circles)


def turning_heights(circles: Array) -> Array:
    """Heights between which the same circles bound the reach in the same order, ascending (k,).

    Those where circles (n, 3) begin, end, cross each other or cross the axis.
    """
    r, z, radius = circles.T
    i, j = np.triu_indices(len(circles), 1)
    apart = np.hypot(r[j] - r[i], z[j] - z[i])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (apart**2 + radius[i] ** 2 - radius[j] ** 2) / (2 * apart)
        beside = np.sqrt(radius[i] ** 2 - along**2)
        middle = z[i] + along * (z[j] - z[i]) / apart
        swing = beside * (r[j] - r[i]) / apart
        axis = np.sqrt(radius**2 - r**2)
    found = np.concatenate(
        [z - radius, z + radius, z - axis, z + axis, middle - swing, middle + swing, middle]
    )
    return np.sort(found[np.isfinite(found)])


@compiled
def _spans(
    arm: PlanarLinkage,
    pitches: Pair,
    boundary: tuple[Array, Array],
    heights: Array,
    sides: tuple[bool, bool],
    out: Array,
    counts: Index,
) -> None:
    """Write the intervals of every height, ascending, and how many there are.

    Ends are searched once between two turning heights; there they stay on their circles.
    """
    circles, turns = boundary
    ends = np.empty((MAX_INTERVALS, 2), np.int64)
    between, known, turn = -1, False, 0
    for i, z in enumerate(heights):
        while turn < len(turns) and turns[turn] < z:
            turn += 1
        near = (turn < len(turns) and turns[turn] - z < TURNING_WIDTH) or (
            turn > 0 and z - turns[turn - 1] < TURNING_WIDTH
        )
        if known and between == turn and not near:
            counts[i] = counts[i - 1]
            for k in range(counts[i]):
                out[i, k, 0], out[i, k, 1] = _end(circles, ends[k, 0], z), _end(circles, ends[k, 1], z)
        else:
            counts[i] = intervals_at_height(arm, pitches, circles, z, sides[0], sides[1], out[i])
            known, between = not near and _apart(circles, z), turn
            for k in range(2 * counts[i]):
                ends[k // 2, k % 2] = _named(circles, z, out[i, k // 2, k % 2])


@compiled
def _end(circles: Array, name: int, z: float) -> float:
    """Place of a circle's near or far side at a height; the axis behind the last of them."""
    k = name // 2
    if k == len(circles):
        return 0.0
    dz = z - circles[k, 1]
    h = np.sqrt(circles[k, 2] * circles[k, 2] - dz * dz)
    return float(circles[k, 0] - h if name % 2 == 0 else circles[k, 0] + h)


@compiled
def _named(circles: Array, z: float, r: float) -> int:
    """Number of the side of a circle that is at a place at a height, or of the axis, as `_end` takes it."""
    for name in range(2 * len(circles)):
        if abs(z - circles[name // 2, 1]) <= circles[name // 2, 2] and _end(circles, name, z) == r:
            return name
    return 2 * len(circles)


@compiled
def _apart(circles: Array, z: float) -> bool:
    """True where sides of circles and the axis keep their distance at a height: none is another."""
    places, count = np.zeros(2 * len(circles) + 1), 1
    for name in range(2 * len(circles)):
        if abs(z - circles[name // 2, 1]) <= circles[name // 2, 2]:
            places[count] = _end(circles, name, z)
            count += 1
    return bool((np.diff(np.sort(places[:count])) >= MIN_END_DISTANCE).all())
