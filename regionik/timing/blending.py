"""States put into a motion, so that a smooth path through them stays next to the hops between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionik.timing.curve import Curve, running_on
from regionik.timing.limits import Limits
from regionik.values import Motion
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot

ROUNDS = 30  # of putting states in
SHARES = (0.25, 0.5, 0.75)  # of a hop, where the smooth path is compared with it


def curve_of(robot: Robot, motion: Motion) -> Curve:
    """The smooth path through a motion's states."""
    return running_on(robot.drive, motion.base, motion.joints)


def rounded(limits: Limits, motion: Motion, blend: float) -> Motion:
    """A motion with states put in halfway until the smooth path keeps to the hops between all."""
    for _ in range(ROUNDS):
        far = np.flatnonzero(_deviation(limits, motion) > blend)
        if not len(far):
            return motion
        base = limits.robot.drive.between(motion.base[far], motion.base[far + 1], np.full(len(far), 0.5))
        joints = (motion.joints[far] + motion.joints[far + 1]) / 2
        motion = _with(motion, far, base, joints)
    raise InputError(
        f"blend: the smooth path does not come within {blend:g} m of the plan's motion; ask for more"
    )


def resting(robot: Robot, motion: Motion, also: NDArray[np.int64] | None = None) -> Motion:
    """A motion that gives those states twice at which the robot must rest, and others where that is asked."""
    at = curve_of(robot, motion).corners if also is None else also
    at = at[at < len(motion) - 1]
    return _with(motion, at, motion.base[at], motion.joints[at])


def _deviation(limits: Limits, motion: Motion) -> Array:
    """Bound of how far any point of the robot is off each hop on the smooth path, (n - 1,) [m]."""
    off = np.zeros(len(motion) - 1)
    curve, hop = curve_of(limits.robot, motion), np.arange(len(off))
    for share in SHARES:
        z, _, _ = curve.along(curve.position[:-1] + share * curve.hops, hop)
        base = limits.robot.drive.between(curve.base[:-1], curve.base[1:], np.full(len(hop), share))
        joints = curve.joints[:-1] + share * np.diff(curve.joints, axis=0)
        off = np.maximum(off, limits.moved(z[:, :3] - base, z[:, 3:] - joints))
    return off


def put_in(robot: Robot, motion: Motion, count: NDArray[np.int64]) -> Motion:
    """A motion with so many states put into each hop (n - 1,), on its smooth path."""
    curve = curve_of(robot, motion)
    if not count.any():
        return motion
    hop = np.repeat(np.arange(len(count)), count)
    share = np.concatenate([np.arange(1, n + 1) / (n + 1) for n in count[count > 0].tolist()])
    z, _, _ = curve.along(curve.position[hop] + share * curve.hops[hop], hop)
    return _with(motion, hop, z[:, :3], z[:, 3:])


def _with(motion: Motion, hop: NDArray[np.int64], base: Array, joints: Array) -> Motion:
    """A motion with states put into hops, in the order given; they belong to what the hop does."""
    after = np.asarray(motion.kind[hop] == "setpoint")  # a hop from a set-point is what the next state is
    lead = np.where(after, hop + 1, hop)
    between = after & (motion.kind[lead] == "setpoint")
    kind = np.where(between, "step", motion.kind[lead])
    setpoint = np.where(between, motion.setpoint[hop], motion.setpoint[lead])
    return Motion(
        base=np.insert(motion.base, hop + 1, base, axis=0),
        joints=np.insert(motion.joints, hop + 1, joints, axis=0),
        kind=np.insert(motion.kind, hop + 1, kind),
        setpoint=np.insert(motion.setpoint, hop + 1, setpoint),
        time=np.full(len(motion) + len(hop), np.nan),
    )
