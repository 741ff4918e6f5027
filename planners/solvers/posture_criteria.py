"""Manipulability of a planar arm, gravity's torques in its hinges, and postures that meet thresholds of both.

Neither depends on where the pivot is turned. With the last link at a pitch, its end in place and the elbow on
one side there is one posture, so that the postures on a target are two curves over the pitch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import TWO_PI
from regionik.planners.kernels import compiled
from regionik.planners.solvers.fabrik import Pair
from regionik.planners.solvers.planar_kinematics import (
    PlanarLinkage,
    fitted_bends,
    limit_margin,
    wrist_triangle,
)
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Criteria
from regionik.worlds.links import LinkMass
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import GRAVITY, Robot

PITCH_SAMPLES = 360  # of the last link, tried for a posture that meets the thresholds
MAX_REFINEMENTS = 30  # of the pitch, where no sampled one meets the thresholds
THRESHOLD_SLACK = 1e-9  # share of a threshold, beyond rounding
COMFORT = 0.01  # share of a threshold, so that a tool moved within its tolerance still meets it


class Thresholds(NamedTuple):
    """Thresholds of a planar arm, for kernels."""

    least: float  # manipulability [m3]
    # (3, 2) gravity's torque at hinge k is the sum, over links i from k on, of ``pull[i, 0] cos(pull[i, 1] +
    # angle)``, angle being that of link i in the plane [N m], [rad]
    pull: Array
    most: Array  # (3,) limits of these torques [N m]


@made_once
def thresholds_of(arm: PlanarArm, robot: Robot, criteria: Criteria) -> tuple[Thresholds, Thresholds]:
    """Thresholds that criteria set an arm in one plane, for inner reach and for outer.

    Masses off the axis of the roll joint pull as the roll turns them. Inner thresholds hold at any roll,
    outer ones may hold at some; without such masses both are one.
    """
    least = criteria.manipulability or 0.0
    pull, loose = _pull(robot, arm)
    limits = criteria.efforts(robot.chain.dof)
    hinges = np.array(limits[1 : 1 + arm.hinges])
    if loose == 0.0:
        both = Thresholds(least, pull, hinges)
        return both, both
    rolls = arm.roll is None or loose <= limits[arm.roll]
    inner = hinges - loose if rolls else np.full(arm.hinges, -np.inf)
    return Thresholds(least, pull, inner), Thresholds(least, pull, hinges + loose)


def _pull(robot: Robot, arm: PlanarArm) -> tuple[Array, float]:
    """Coefficients of the hinges' torques, and the most that masses off the roll axis add to each [N m]."""
    chain = robot.chain
    at_zero = chain.frames(np.zeros(chain.dof))
    r_axis = np.array([np.cos(arm.pivot_zero), np.sin(arm.pivot_zero), 0.0])
    angles = np.cumsum(arm.offset)
    knots = arm.shoulder[0] + 1j * arm.shoulder[1] + np.cumsum([0, *arm.lengths * np.exp(1j * angles)])
    pull, loose = np.zeros(arm.hinges, dtype=complex), 0.0
    for load in robot.loads:
        i = min(load.link, arm.hinges) - 1
        if i < 0:  # what turns with the pivot alone
            continue
        p = _placed(load, at_zero)
        seen = (p @ r_axis + 1j * p[2] - knots[i]) * np.exp(-1j * angles[i])
        if arm.roll is not None and load.link >= arm.roll:
            aside = float(np.hypot(seen.imag, p @ np.cross(r_axis, [0.0, 0.0, 1.0])))
            loose += GRAVITY * load.mass * aside
            seen = complex(seen.real)
        pull[i] += GRAVITY * load.mass * seen
        pull[:i] += GRAVITY * load.mass * arm.lengths[:i]
    return np.column_stack([np.abs(pull), np.angle(pull)]), loose


def _placed(load: LinkMass, frames: Array) -> Array:
    T = frames[load.link]
    p: Array = T[:3, :3] @ load.center + T[:3, 3]
    return p


@compiled
def threshold_margin(
    arm: PlanarLinkage, thresholds: Thresholds, r: float, z: float, a: float, b: float, c: float
) -> float:
    """Least margin of a posture to the thresholds, as a share of them; negative where one is not met.

    Its tool is at (r, z) [m], its links at the angles a, b, c in the plane [rad].
    """
    least = np.inf
    if thresholds.least > 0.0:
        x, y = r - arm.shoulder_r, z - arm.shoulder_z
        # Manipulability, w = sqrt(det(J J^T)): Yoshikawa, Int. J. Robotics Research 4 (1985).
        first = arm.lengths[0] * (math.cos(a) * y - math.sin(a) * x)
        last = arm.lengths[2] * (x * math.sin(c) - y * math.cos(c))
        bent = arm.lengths[1] * arm.lengths[2] * math.sin(c - b)
        # Cauchy-Binet: the sum of the squares of all minors of the hinges' columns; the pivot's is r.
        least = abs(r) * np.sqrt(first * first + last * last + bent * bent) / thresholds.least - 1.0
    torque = 0.0
    for k in range(2, -1, -1):
        angle = a if k == 0 else (b if k == 1 else c)
        torque += thresholds.pull[k, 0] * math.cos(thresholds.pull[k, 1] + angle)
        if not thresholds.most[k] > 0.0:
            return -np.inf
        if thresholds.most[k] < np.inf:
            least = min(least, (thresholds.most[k] - abs(torque)) / thresholds.most[k])
    return least


@compiled
def posture_margin(arm: PlanarLinkage, thresholds: Thresholds, bends: Array) -> float:
    """`threshold_margin` of a posture given by its bends (3,)."""
    r, z, angle = arm.shoulder_r, arm.shoulder_z, 0.0
    for k in range(3):
        angle += bends[k]
        r += arm.lengths[k] * math.cos(angle)
        z += arm.lengths[k] * math.sin(angle)
    a, b = bends[0], bends[0] + bends[1]
    return threshold_margin(arm, thresholds, r, z, a, b, angle)


@compiled
def _at(
    arm: PlanarLinkage, thresholds: Thresholds, r: float, z: float, pitch: float, elbow: float, bends: Array
) -> float:
    """`threshold_margin` of the posture with a pitch and elbow, its bends filled in; -inf for none."""
    lead, root, tip, ok = wrist_triangle(arm, r, z, pitch)
    first, second = lead + elbow * root, lead - elbow * tip
    if not ok or limit_margin(arm, first, second, pitch) < 0.0:
        return -np.inf
    bends[0], bends[1], bends[2] = fitted_bends(arm, first, second, pitch)
    return threshold_margin(arm, thresholds, r, z, first, second, pitch)


@compiled
def posture_within_thresholds(
    arm: PlanarLinkage, thresholds: Thresholds, pitches: Pair, r: float, z: float, near: Array, bends: Array
) -> bool:
    """Fill in bends (3,) of the posture on (r, z) nearest to ``near`` that meets the thresholds by `COMFORT`.

    `PITCH_SAMPLES` of a range are looked at, of the full turn where it is infinite, or the one where both
    ends are the same. Where none will do, pitches ever closer to the best are tried for one that just meets
    them. False where no posture was found.
    """
    low, wide = pitches[0], pitches[1] - pitches[0]
    if not np.isfinite(wide):
        low, wide = 0.0, TWO_PI
    count = PITCH_SAMPLES if wide > 0.0 else 1
    tried, best = np.empty(3), np.zeros(2)
    change, most = np.inf, -np.inf
    for k in range(count):
        tool = low + wide * k / PITCH_SAMPLES
        for elbow in (-1.0, 1.0):
            room = _at(arm, thresholds, r, z, tool, elbow, tried)
            if room > most:
                most, best[0], best[1] = room, tool, elbow
            moved = np.abs(tried - near).max()
            if room > COMFORT and moved < change:
                change = moved
                bends[:] = tried
    if change < np.inf:
        return True
    width = wide / PITCH_SAMPLES
    for _ in range(MAX_REFINEMENTS):
        for side in (-0.5, 0.5):
            tool = min(max(best[0] + side * width, pitches[0]), pitches[1])
            room = _at(arm, thresholds, r, z, tool, best[1], tried)
            if room > most:
                most, best[0] = room, tool
        width *= 0.7
    return _at(arm, thresholds, r, z, best[0], best[1], bends) > THRESHOLD_SLACK
