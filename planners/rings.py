"""Exact reach of a planar arm: at every height, the intervals of r that some posture within limits reaches."""

from __future__ import annotations

import numpy as np

from regionik.planners import kernels
from regionik.worlds.arrays import Array
from regionik.worlds.planar import PlanarArm

_MOST_INTERVALS = 16


def boundary_circles(arm: PlanarArm, shoulder_z: float, pitch: float = np.nan) -> Array:
    """Circles of the plane on which the reach can begin or end: rows of center r, center z, radius.

    The boundary of the reach is made of critical postures: every free bend either turns a rigid rest or
    lines up with it, all others stand at a limit.

    Parameters
    ----------
    arm : PlanarArm
    shoulder_z : float
        Height of the first hinge above the floor [m].
    pitch : float
        Fixed angle of the last link in the plane [rad], NaN where it is free.
    """
    shoulder = complex(arm.shoulder[0], shoulder_z)
    a, b, c = (complex(length) for length in arm.lengths)
    limits = [[bend for bend in (arm.lower[i], arm.upper[i]) if np.isfinite(bend)] for i in range(3)]
    circles: list[tuple[complex, float]] = []
    if np.isfinite(pitch):
        tool = c * np.exp(1j * pitch)
        circles += [(shoulder + tool, abs(a + s * b)) for s in (1, -1)]
        circles += [(shoulder + tool, abs(a + b * np.exp(1j * bend))) for bend in limits[1]]
        circles += [(shoulder + tool + a * np.exp(1j * bend), abs(b)) for bend in limits[0]]
        circles += [(shoulder + tool + b * np.exp(1j * (pitch - bend)), abs(a)) for bend in limits[2]]
    else:
        elbow_turns = [*limits[1], 0.0, np.pi]
        wrist_turns = [*limits[2], 0.0, np.pi]
        for bend in elbow_turns:
            upper = a + b * np.exp(1j * bend)
            circles += [(shoulder, abs(abs(upper) + s * c)) for s in (1, -1)]
            circles += [(shoulder, abs(upper + c * np.exp(1j * (bend + w)))) for w in limits[2]]
            for first in limits[0]:
                circles.append((shoulder + upper * np.exp(1j * first), abs(c)))
        for bend in wrist_turns:
            rest = abs(b + c * np.exp(1j * bend))
            circles += [(shoulder, abs(abs(a) + s * rest)) for s in (1, -1)]
            circles += [(shoulder + a * np.exp(1j * first), rest) for first in limits[0]]
    rows = np.array([[center.real, center.imag, radius] for center, radius in circles])
    unique: Array = np.unique(rows.round(12), axis=0)
    return unique


def reach_intervals(arm: PlanarArm, shoulder_z: float, heights: Array, pitch: float = np.nan) -> list[Array]:
    """Intervals of signed r within reach, for every height.

    Parameters
    ----------
    arm : PlanarArm
    shoulder_z : float
        Height of the first hinge above the floor [m].
    heights : (n,) array
        Tool heights above the floor [m].
    pitch : float
        Fixed angle of the last link in the plane [rad], NaN where it is free.

    Returns
    -------
    list of (k, 2) arrays
        Ascending; none crosses r = 0, so that each lies in front of the axis or behind it.
    """
    circles = boundary_circles(arm, shoulder_z, pitch)
    centers, radii = np.ascontiguousarray(circles[:, :2]), np.ascontiguousarray(circles[:, 2])
    distinct, where = np.unique(heights, return_inverse=True)
    out = np.empty((_MOST_INTERVALS, 2))
    found = []
    for z in distinct:
        n = kernels.reach_intervals(
            arm.shoulder[0], shoulder_z, arm.lengths, arm.lower, arm.upper, pitch, centers, radii, z, out
        )
        found.append(out[:n].copy())
    return [found[k] for k in where]
