"""A planar arm on its base for kernels, and what base and joints are in the arm's plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled
from regionik.planners.solvers.base_placement import Turning, share_turn
from regionik.planners.solvers.fabrik import Pair, PlanarLinks, Triple, bend_limits, direction
from regionik.planners.solvers.planar_kinematics import PlanarLinkage
from regionik.worlds.arrays import Array


class PlanarSetup(NamedTuple):
    """A planar arm on its base and what is asked of both."""

    plane: PlanarLinkage  # heights counted from the floor
    links: PlanarLinks  # the same for passes
    # sign, offset: (3,) ``bend = sign * joint + offset`` [rad]
    sign: Array
    offset: Array
    restarts: Array  # (k, 3) bends to start again from [rad]
    mount: Array  # (2,) the arm axis in the base frame [m]
    plane_zero: float  # direction of the arm's plane, seen from the base, with the pivot at zero [rad]
    turning: Turning
    facing: int  # 1, or -1 to reach over the arm's back: the target then lies at negative r
    pitch: float  # of the last link in the plane, NaN where it is free [rad]
    tolerance: float  # [m]
    max_passes: int  # from each start


def links_of(plane: PlanarLinkage) -> PlanarLinks:
    """A planar arm as passes take it."""
    first, second, last = map(bend_limits, plane.lower.tolist(), plane.upper.tolist())
    a, b, c = plane.lengths.tolist()
    return PlanarLinks((plane.shoulder_r, plane.shoulder_z), (a, b, c), (first, second, last))


@compiled
def at_heading(setup: PlanarSetup, yaw: float) -> PlanarSetup:
    """The setup with the base kept at a heading [rad]."""
    lower, upper, heading, _, _ = setup.turning
    return PlanarSetup(
        setup.plane, setup.links, setup.sign, setup.offset, setup.restarts, setup.mount, setup.plane_zero,
        Turning(lower, upper, heading, yaw, yaw), setup.facing, setup.pitch, setup.tolerance,
        setup.max_passes,
    )  # fmt: skip


class PlanarState(NamedTuple):
    """Arm axis on the floor [m], direction of the arm's plane [rad], bends of the links [rad]."""

    x: float
    y: float
    yaw: float
    bends: Triple


@compiled
def write_state(setup: PlanarSetup, found: PlanarState, near: Triple, base: Array, joints: Array) -> bool:
    """Write a state into base and joints, which hold those before; whether the heading is within its span.

    Bends of joints without limits are taken to the turn nearest to ``near``.
    """
    for i in range(3):
        middle = 0.5 * (setup.plane.lower[i] + setup.plane.upper[i])
        if not np.isfinite(middle):
            middle = near[i]
        bend = middle + wrap(found.bends[i] - middle)
        joints[1 + i] = setup.sign[i] * (bend - setup.offset[i])
    joints[0], base[2], fits = share_turn(found.yaw - setup.plane_zero, base[2], joints[0], setup.turning)
    dx, dy = to_axis(setup, base[2])
    base[0], base[1] = found.x - dx, found.y - dy
    return fits


@compiled
def state_of(setup: PlanarSetup, base: Array, joints: Array) -> PlanarState:
    """Arm axis, plane and bends of a base and joints."""
    dx, dy = to_axis(setup, base[2])
    bends = (
        setup.sign[0] * joints[1] + setup.offset[0],
        setup.sign[1] * joints[2] + setup.offset[1],
        setup.sign[2] * joints[3] + setup.offset[2],
    )
    return PlanarState(base[0] + dx, base[1] + dy, base[2] + setup.plane_zero + joints[0], bends)


@compiled
def to_axis(setup: PlanarSetup, yaw: float) -> Pair:
    """From the base to the arm axis [m]."""
    c, s = direction(yaw)
    return c * setup.mount[0] - s * setup.mount[1], s * setup.mount[0] + c * setup.mount[1]
