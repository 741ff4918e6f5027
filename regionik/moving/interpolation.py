"""States along base moves, and whether the arm is clear on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from regionik.planners.geometry.polylines import spread_along
from regionik.postures.arm_guard import Guard
from regionik.postures.poses import LARGEST_BEND, Pose, axis_of, turn_to
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TURN_STRIDE = 0.1  # largest turn of the base between two states [rad]


@dataclass(frozen=True, eq=False)
class Interpolator:
    """States between poses, and whether the arm is clear on them."""

    world: World
    guard: Guard

    def along(self, here: Pose, there: Pose, path: Array) -> list[Pose]:
        """States strictly between two poses: axis along a path, heading and joints spread over it."""
        robot = self.world.robot
        turn = turn_to(here.base, there.base)[2]
        # The base moves by no more than the axis does and the mount swings about it.
        way = float(np.hypot(*np.diff(path, axis=0).T).sum())
        way += abs(turn) * float(np.hypot(*robot.mount[:2]))
        step = self.world.rules.step * 0.999
        bend = float(np.abs(there.joints - here.joints).max())
        parts = max(abs(turn) / TURN_STRIDE, bend / LARGEST_BEND, way / step)
        shares, axes = spread_along(np.array(path), step, int(np.ceil(parts)))
        bases = np.column_stack([np.zeros((len(shares), 2)), here.base[2] + shares * turn])
        bases[:, :2] = axes - axis_of(robot, bases)
        joints = here.joints + shares[:, None] * (there.joints - here.joints)
        return [Pose(*pose) for pose in zip(bases, joints, strict=True)]

    def over(self, here: Pose, there: Pose, bases: Array) -> list[Pose]:
        """States strictly between two poses: base through given poses (n, 3), joints spread over its way."""
        drive, change = self.world.robot.drive, there.joints - here.joints
        moves = np.array([turn_to(a, b) for a, b in zip(bases[:-1], bases[1:], strict=True)]).reshape(-1, 3)
        ways = np.hypot(moves[:, 0], moves[:, 1])
        efforts = ways + np.abs(moves[:, 2])
        total = float(efforts.sum())
        shares = efforts / total if total > 0 else np.full(len(moves), 1.0 / max(len(moves), 1))
        most = float(np.abs(change).max()) / LARGEST_BEND
        rows: list[Pose] = []
        last = here
        for move, way, share, base in zip(moves, ways, shares, bases[1:], strict=True):
            next_ = Pose(base, last.joints + share * change)
            parts = max(way / self.world.rules.step, abs(move[2]) / TURN_STRIDE, share * most)
            count = max(1, int(np.ceil(parts * 1.001)))
            parted = np.arange(1, count) / count
            joints = last.joints + parted[:, None] * (next_.joints - last.joints)
            inner = zip(drive.between(last.base, base, parted), joints, strict=True)
            rows += [*(Pose(*pose) for pose in inner), next_]
            last = next_
        return rows[:-1]

    def still(self, here: Pose, there: Pose) -> list[Pose]:
        """States strictly between two postures, the base standing."""
        change = there.joints - here.joints
        count = max(1, int(np.ceil(float(np.abs(change).max()) / LARGEST_BEND * 1.001)))
        return [Pose(here.base, here.joints + k / count * change) for k in range(1, count)]

    def straight(self, here: Pose, there: Pose) -> list[Pose]:
        """States strictly between two poses, the axis moving straight."""
        ends = [axis_of(self.world.robot, pose.base) for pose in (here, there)]
        return self.along(here, there, np.array(ends))

    def clear(self, poses: Sequence[Pose]) -> bool:
        """Whether a motion is proven clear, its two ends aside."""
        return self.guard.stop(poses) is None
