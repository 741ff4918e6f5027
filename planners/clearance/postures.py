"""Postures of an arm among upright solids: pose, clearance, and the way to a target; compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.clearance.ownbody import NO_OWN, Own
from regionik.planners.geometry.flat import compiled
from regionik.planners.geometry.upright import Uprights, distance_along, least_along
from regionik.planners.reach.sway import Bones
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, chain_jacobian
from regionik.worlds.arrays import Array

FINE = 30  # golden sections along a link where its clearance is measured
STEPS = 4  # Newton steps to a posture
DAMPING = 1e-6  # of those steps, in squares of the arm's lever


class Task(NamedTuple):
    """What is asked: arm, solids, what stands about, target [m], and what the arm keeps from itself."""

    arm: SerialArm
    bones: Bones
    solids: Uprights
    target: Array
    tolerance: float
    clearance: float
    own: Own = NO_OWN


class Scratch(NamedTuple):
    """Room to work in for an arm of n joints and s solids."""

    q: Array  # (n,) centre of a box, then a posture
    half: Array  # (n,) half widths
    chord: Array  # (n,)
    shift: Array  # (2, n) a shrunken box, against the centre
    frames: Array  # (n + 1, 4, 4)
    axes: Array  # (n, 3) joint axes in the arm's base frame
    J: Array  # (6, n)
    ends: Array  # (s, 2, 3) of the solids' axes, in the arm's base frame


def scratch_for(arm: SerialArm, bones: Bones) -> Scratch:
    """Room to work in for an arm and its solids."""
    n, s = len(arm.axis), len(bones.link)
    return Scratch(
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros((2, n)),
        np.zeros((n + 1, 4, 4)),
        np.zeros((n, 3)),
        np.zeros((6, n)),
        np.zeros((s, 2, 3)),
    )


@compiled
def pose(task: Task, work: Scratch) -> float:
    """Frames, axes and ends of the solids at ``work.q``; returns the tool's distance from the target."""
    arm, bones = task.arm, task.bones
    chain_frames(arm, work.q, work.frames)
    n = len(work.q)
    for k in range(n):
        for i in range(3):
            work.axes[k, i] = (
                work.frames[k, i, 0] * arm.axis[k, 0]
                + work.frames[k, i, 1] * arm.axis[k, 1]
                + work.frames[k, i, 2] * arm.axis[k, 2]
            )
    for s in range(len(bones.link)):
        frame = work.frames[bones.link[s]]
        for end in range(2):
            x, y, z = bones.ends[s, end]
            for i in range(3):
                work.ends[s, end, i] = frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z + frame[i, 3]
    square = 0.0
    for i in range(3):
        square += (work.frames[n, i, 3] - task.target[i]) ** 2
    return float(np.sqrt(square))


@compiled
def clearance_of(task: Task, work: Scratch) -> float:
    """Least distance of the solids from the obstacles in the posture that `pose` was called with [m]."""
    least = np.inf
    for s in range(len(task.bones.link)):
        a, b, radius = work.ends[s, 0], work.ends[s, 1], task.bones.radius[s]
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
        for k in range(len(task.solids.disc)):
            if distance_along(task.solids, k, a, b, 0.5) - 0.5 * length - radius < least:
                least = min(
                    least, least_along(task.solids, k, a, b, 0.0, 0.0, -np.inf, least + radius, FINE) - radius
                )
    return least


@compiled
def to_target(task: Task, work: Scratch) -> float:
    """Damped least squares from ``work.q`` towards the target, inside the limits; the distance left."""
    n, levers = len(work.q), task.bones.levers[0]
    off = pose(task, work)
    damping = DAMPING * np.max(levers) ** 2 + 1e-300
    A, e = np.empty((3, 3)), np.empty(3)
    for _ in range(STEPS):
        if off <= task.tolerance:
            break
        chain_jacobian(task.arm, work.frames, work.J)
        for i in range(3):
            # as far as the near side of what the tolerance allows: the postures differ on all sides of it
            e[i] = (task.target[i] - work.frames[n, i, 3]) * (1.0 - 0.9 * task.tolerance / off)
            for j in range(i, 3):
                A[i, j] = damping if i == j else 0.0
                for k in range(n):
                    A[i, j] += work.J[i, k] * work.J[j, k]
        solve_symmetric(A, e)
        for k in range(n):
            step = work.J[0, k] * e[0] + work.J[1, k] * e[1] + work.J[2, k] * e[2]
            work.q[k] = min(task.arm.upper[k], max(task.arm.lower[k], work.q[k] + step))
        off = pose(task, work)
    return off


@compiled
def solve_symmetric(A: Array, b: Array) -> None:
    """Solve A x = b for a positive definite A (3, 3), given by its upper half; x replaces b."""
    p, q, r = A[0, 0], A[0, 1], A[0, 2]
    s, t, u = A[1, 1], A[1, 2], A[2, 2]
    a, d, g = s * u - t * t, r * t - q * u, q * t - r * s
    scale = 1.0 / (p * a + q * d + r * g)
    x = scale * (a * b[0] + d * b[1] + g * b[2])
    y = scale * (d * b[0] + (p * u - r * r) * b[1] + (q * r - p * t) * b[2])
    b[2] = scale * (g * b[0] + (q * r - p * t) * b[1] + (p * s - q * q) * b[2])
    b[0], b[1] = x, y
