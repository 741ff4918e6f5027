"""Exact reach of a planar arm: at every height, the intervals of r that a posture within limits reaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionik.planners import kernels
from regionik.planners.flat import compiled
from regionik.worlds.arrays import Array
from regionik.worlds.planar import PlanarArm

_MOST_INTERVALS = 16


FREE = (-np.inf, np.inf)


def boundary_circles(arm: PlanarArm, shoulder_z: float, pitches: tuple[float, float] = FREE) -> Array:
    """Circles of the plane on which the reach can begin or end: rows of center r, center z, radius.

    The boundary of the reach is made of critical postures: every free bend either turns a rigid rest or
    lines up with it, all others, or the pitch, stand at a limit.

    Parameters
    ----------
    arm : PlanarArm
    shoulder_z : float
        Height of the first hinge above the floor [m].
    pitches : (low, high)
        Angles that the last link may take in the plane [rad]; equal where it is fixed.
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


def reach_intervals(
    arm: PlanarArm,
    shoulder_z: float,
    heights: Array,
    pitches: tuple[float, float] = FREE,
    *,
    front: bool = True,
    back: bool = True,
) -> list[Array]:
    """Intervals of signed r within reach, for every height.

    Parameters
    ----------
    arm : PlanarArm
    shoulder_z : float
        Height of the first hinge above the floor [m].
    heights : (n,) array
        Tool heights above the floor [m].
    pitches : (low, high)
        Angles that the last link may take in the plane [rad]; equal where it is fixed.
    front, back : bool
        Which of r > 0 and r < 0 to look at.

    Returns
    -------
    list of (k, 2) arrays
        Ascending; none crosses r = 0, so that each lies in front of the axis or behind it.
    """
    owner, spans = reach_spans(arm, shoulder_z, heights, pitches, front=front, back=back)
    return np.split(spans, np.searchsorted(owner, np.arange(1, len(heights))))


def reach_spans(
    arm: PlanarArm,
    shoulder_z: float,
    heights: Array,
    pitches: tuple[float, float] = FREE,
    *,
    front: bool = True,
    back: bool = True,
) -> tuple[NDArray[np.intp], Array]:
    """As `reach_intervals`, in one table: the height of each interval, ascending, (m,), and (m, 2)."""
    circles = boundary_circles(arm, shoulder_z, pitches)
    centers, radii = np.ascontiguousarray(circles[:, :2]), np.ascontiguousarray(circles[:, 2])
    plane = kernels.PlaneArm(float(arm.shoulder[0]), shoulder_z, arm.lengths, arm.lower, arm.upper)
    out, counts = np.empty((len(heights), _MOST_INTERVALS, 2)), np.empty(len(heights), dtype=np.int64)
    order = np.argsort(heights, kind="stable")
    _spans(plane, *pitches, centers, radii, np.asarray(heights), order, front, back, out, counts)
    real = np.arange(_MOST_INTERVALS) < counts[:, None]
    return np.repeat(np.arange(len(heights)), counts), out[real]


@compiled
def _spans(
    arm: kernels.PlaneArm,
    pitch_low: float,
    pitch_high: float,
    centers: Array,
    radii: Array,
    heights: Array,
    order: NDArray[np.intp],
    front: bool,
    back: bool,
    out: Array,
    counts: NDArray[np.int64],
) -> None:
    """Write the intervals of every height, and how many there are; heights alike are looked at once."""
    last = -1
    for i in order:
        if last >= 0 and heights[i] == heights[last]:
            out[i] = out[last]
            counts[i] = counts[last]
        else:
            counts[i] = kernels.reach_intervals(
                arm, pitch_low, pitch_high, centers, radii, heights[i], front, back, out[i]
            )
        last = i
