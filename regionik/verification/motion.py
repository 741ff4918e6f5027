"""Motion between states, and bounds on it that hold everywhere between samples.

On a hop from one state to the next the base turns evenly the shorter way, and joints move evenly. An
omnidirectional base moves straight; one on wheels rolls along one arc, which leaves its heading by half the
turn. A point of the robot then has a bounded acceleration a [m per hop^2], so that over a part of the hop of
length h it stays within a h^2 / 8 of the chord between the part's ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.values import Motion
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

CHUNK = 8192  # parts of hops that are looked at together, so that memory stays small


class Bounds(NamedTuple):
    """Most of a point in a frame on every hop, each (hops,)."""

    distance: Array  # from the frame's origin [m]
    speed: Array  # [m per hop]
    acceleration: Array  # [m per hop^2]


@dataclass(frozen=True, eq=False)
class Journey:
    """All hops of a motion: hop k leads from state k to state k + 1."""

    robot: Robot
    motion: Motion

    @property
    def hops(self) -> int:
        return len(self.motion) - 1

    @cached_property
    def _chord(self) -> Array:
        """From where the base stands to where it will, (hops, 2) [m]."""
        chord: Array = np.diff(self.motion.base[:, :2], axis=0)
        return chord

    @cached_property
    def _tangent(self) -> Array:
        """Heading in the middle of every hop, (hops, 2)."""
        middle = self.motion.base[:-1, 2] + self.turn / 2
        return np.column_stack([np.cos(middle), np.sin(middle)])

    @cached_property
    def arc(self) -> Array:
        """Way that the base rolls on every hop, below 0 in reverse, (hops,) [m]; none if it has no wheels."""
        if not self.robot.drive.rolls:
            return np.zeros(self.hops)
        half = self.turn / 2
        along: Array = (self._chord * self._tangent).sum(1) / np.sinc(half / np.pi)
        return along

    @cached_property
    def slide(self) -> Array:
        """Way of the base on every hop that is not rolled, (hops, 2) [m]; on wheels there should be none."""
        if not self.robot.drive.rolls:
            return self._chord
        across = np.column_stack([-self._tangent[:, 1], self._tangent[:, 0]])
        slide: Array = (self._chord * across).sum(1)[:, None] * across
        return slide

    @cached_property
    def length(self) -> Array:
        """Length of the way of the base on every hop, (hops,) [m]."""
        length: Array = np.abs(self.arc) + np.linalg.norm(self.slide, axis=1)
        return length

    @cached_property
    def turn(self) -> Array:
        """Turn of the base on every hop, the shorter way, (hops,) [rad]."""
        return wrapped(np.diff(self.motion.base[:, 2]))

    @cached_property
    def bend(self) -> Array:
        """Change of every joint on every hop, (hops, dof)."""
        change: Array = np.diff(self.motion.joints, axis=0)
        return change

    def base(self, hop: Indices, s: Array) -> Array:
        """Base pose at part s in [0, 1] of a hop, (m, 3)."""
        pose: Array = self.motion.base[hop] + s[:, None] * np.column_stack([self.slide[hop], self.turn[hop]])
        half = s * self.turn[hop] / 2
        chord, middle = s * self.arc[hop] * np.sinc(half / np.pi), self.motion.base[hop, 2] + half
        pose[:, :2] += chord[:, None] * np.column_stack([np.cos(middle), np.sin(middle)])
        return pose

    def frames(self, hop: Indices, s: Array) -> Array:
        """Link and tool frames in the world, (m, dof + 1, 4, 4)."""
        return self.robot.frames(self.base(hop, s), self.joints(hop, s))

    def joints(self, hop: Indices, s: Array) -> Array:
        """Joint values at part s in [0, 1] of a hop, (m, dof)."""
        values: Array = self.motion.joints[hop] + s[:, None] * self.bend[hop]
        return values

    def between(self, lower: int, link: int, joints: Array) -> Array:
        """Pose of a link in the frame of a lower link, or of the base (-1), (m, 4, 4)."""
        chain = self.robot.chain
        start = self.robot.T_base_arm if lower < 0 else np.eye(4)
        T = np.broadcast_to(start, (len(joints), 4, 4))
        for k in range(lower + 1, link + 1):
            T = T @ chain.joints[k].T_parent_joint @ chain.joints[k].transform(joints[:, k])
        return T

    def acceleration(self, link: int, point: Array) -> Array:
        """Most that a point fixed to a link can accelerate in the world, (hops,) [m per hop^2]."""
        bounds = self.bounds_between(-1, link, point)
        rate = np.abs(self.turn)
        reach = bounds.distance + float(np.hypot(*self.robot.mount[:2]))
        seen = bounds.acceleration + rate**2 * reach + 2 * rate * bounds.speed  # as the base turns under it
        bound: Array = seen + np.abs(self.arc) * rate
        return bound

    def bounds_between(self, lower: int, link: int, point: Array) -> Bounds:
        """Bounds for a point fixed to a link, as seen from a lower link or from the arm's mount (-1).

        Frame by frame from the link down: a joint that turns at rate w under a point that moves at speed v
        at a distance r of its axis adds w^2 r + 2 w v, and w r to the speed.
        """
        chain = self.robot.chain
        far = np.full(self.hops, float(np.linalg.norm(point)))  # from the joint's origin
        arm = np.full(self.hops, float(np.linalg.norm(np.cross(chain.joints[link].axis, point))))  # its axis
        speed, acceleration = np.zeros(self.hops), np.zeros(self.hops)
        for k in range(link, lower, -1):
            rate = np.abs(self.bend[:, k])
            if chain.joints[k].kind == "revolute":
                acceleration += rate**2 * arm + 2 * rate * speed
                speed += rate * arm
            else:
                speed += rate
                far = far + np.maximum(*np.abs([self.motion.joints[:-1, k], self.motion.joints[1:, k]]))
            far = far + float(np.linalg.norm(chain.joints[k].T_parent_joint[:3, 3]))
            arm = far
        return Bounds(far, speed, acceleration)

    @cached_property
    def tool_acceleration(self) -> Array:
        """Bound for the tool's position, (hops,) [m per hop^2]."""
        chain = self.robot.chain
        return self.acceleration(chain.dof - 1, chain.T_last_tool[:3, 3])

    @cached_property
    def swing(self) -> Array:
        """Bound for the unit vector along the tool's axis, (hops,) [1 per hop^2]."""
        turning = [joint.kind == "revolute" for joint in self.robot.chain.joints]
        rate: Array = np.abs(self.turn) + np.abs(self.bend[:, turning]).sum(1)
        return rate**2


def wrapped(angle: Array) -> Array:
    """Angles brought into [-pi, pi)."""
    turned: Array = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return turned


def sag(acceleration: Array, part: Array) -> Array:
    """Most that a point strays from its chord over a part of a hop."""
    return acceleration * part**2 / 8


class Parts(NamedTuple):
    """Parts of hops: from ``low`` to ``high`` in [0, 1] of the hop that belongs to ``item``."""

    item: Indices
    low: Array
    high: Array

    @property
    def middle(self) -> Array:
        return (self.low + self.high) / 2

    def take(self, which: Mask | slice) -> Parts:
        return Parts(self.item[which], self.low[which], self.high[which])

    def halves(self) -> Parts:
        return Parts(
            np.concatenate([self.item, self.item]),
            np.concatenate([self.low, self.middle]),
            np.concatenate([self.middle, self.high]),
        )


class Verdicts(NamedTuple):
    """What is known of some parts; neither proven nor failed means that halves may tell."""

    proven: Mask
    failed: Mask
    stuck: Mask  # so short that halving is given up


class Outcome(NamedTuple):
    """Items that are not proven: where each failed, or where its proof got stuck."""

    failed: dict[int, float]
    stuck: dict[int, float]


def prove(items: int, look: Callable[[Parts], Verdicts]) -> Outcome:
    """Halve parts of hops until each is proven, fails or is too short; all open ones level by level.

    An item that has failed is not looked at again.
    """
    failed: dict[int, float] = {}
    stuck: dict[int, float] = {}
    parts = Parts(np.arange(items), np.zeros(items), np.ones(items))
    while len(parts.item):
        blocks = [parts.take(slice(k, k + CHUNK)) for k in range(0, len(parts.item), CHUNK)]
        seen = [look(block) for block in blocks]
        verdicts = Verdicts(*(np.concatenate(columns) for columns in zip(*seen, strict=True)))
        bad = verdicts.failed & ~verdicts.proven
        for item, s in zip(parts.item[bad].tolist(), parts.middle[bad].tolist(), strict=True):
            failed.setdefault(item, s)
        given_up = verdicts.stuck & ~verdicts.proven & ~bad
        for item, s in zip(parts.item[given_up].tolist(), parts.middle[given_up].tolist(), strict=True):
            stuck.setdefault(item, s)
        open_ = ~verdicts.proven & ~given_up & ~np.isin(parts.item, list(failed))
        parts = parts.take(open_).halves()
    return Outcome(failed, {item: s for item, s in stuck.items() if item not in failed})
