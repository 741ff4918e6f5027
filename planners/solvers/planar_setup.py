"""A planar arm on its base as one record for kernels, and what base and joints are in the arm's plane."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled
from regionik.planners.solvers.base_placement import Turning, share_turn
from regionik.planners.solvers.fabrik import Pair, PlanarLinks, Triple, bend_limits, direction
from regionik.planners.solvers.planar_kinematics import PlanarLinkage
from regionik.worlds.arrays import Array

Record = NDArray[Any]


class PlanarSetup(NamedTuple):
    """A planar arm on its base and what is asked of both.

    Kernels take it as the one row of `record_of`, in which every field stands under its name.
    """

    shoulder: Array  # (2,) r, z of the first hinge, heights counted from the floor [m]
    lengths: Array  # (3,) [m]
    # lower, upper: (3,) limits of the bends [rad]
    lower: Array
    upper: Array
    limits: Array  # (3, 7) the same as `fabrik.limit_vectors` has them
    # sign, offset: (3,) ``bend = sign * joint + offset`` [rad]
    sign: Array
    offset: Array
    restarts: Array  # (k, 3) bends to start again from [rad]
    mount: Array  # (2,) the arm axis in the base frame [m]
    plane_zero: float  # direction of the arm's plane, seen from the base, with the pivot at zero [rad]
    turning: Turning  # as `Turning` has them
    facing: int  # 1, or -1 to reach over the arm's back: the target then lies at negative r
    pitch: float  # of the last link in the plane, NaN where it is free [rad]
    tolerance: float  # [m]
    max_passes: int  # from each start


def record_of(setup: PlanarSetup) -> Record:
    """The setup as an array of one record: numba takes that several times as fast as a tuple of many."""
    fields = {name: np.asarray(value) for name, value in setup._asdict().items()}
    kind = np.dtype((np.record, [(name, value.dtype, value.shape) for name, value in fields.items()]))
    record = np.empty(1, kind)
    for name, value in fields.items():
        record[name] = value
    record.flags.writeable = False
    return record


class PlanarState(NamedTuple):
    """Arm axis on the floor [m], direction of the arm's plane [rad], bends of the links [rad]."""

    x: float
    y: float
    yaw: float
    bends: Triple


@compiled
def write_state(
    setup: PlanarSetup, turning: Turning, found: PlanarState, near: Triple, base: Array, joints: Array
) -> bool:
    """Write a state into base and joints, which hold those before; whether the heading is within its span.

    Bends of joints without limits are taken to the turn nearest to ``near``.
    """
    for i in range(3):
        middle = 0.5 * (setup.lower[i] + setup.upper[i])
        if not np.isfinite(middle):
            middle = near[i]
        bend = middle + wrap(found.bends[i] - middle)
        joints[1 + i] = setup.sign[i] * (bend - setup.offset[i])
    joints[0], base[2], fits = share_turn(found.yaw - setup.plane_zero, base[2], joints[0], turning)
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


@compiled
def linkage_of(setup: PlanarSetup) -> PlanarLinkage:
    return PlanarLinkage(setup.shoulder[0], setup.shoulder[1], setup.lengths, setup.lower, setup.upper)


@compiled
def links_of(setup: PlanarSetup) -> PlanarLinks:
    limits = bend_limits(setup.limits[0]), bend_limits(setup.limits[1]), bend_limits(setup.limits[2])
    lengths = setup.lengths[0], setup.lengths[1], setup.lengths[2]
    return PlanarLinks((setup.shoulder[0], setup.shoulder[1]), lengths, limits)


@compiled
def turning_of(setup: PlanarSetup) -> Turning:
    return Turning(
        setup.turning[0], setup.turning[1], int(setup.turning[2]), setup.turning[3], setup.turning[4]
    )
