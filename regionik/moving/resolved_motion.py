"""Base and arm go on together: the least motion of base and joints that leads the tool on its path.

Where an arm has few joints, the places from which a base of some heading meets a pose lie on a line, which no
lattice of places finds; where it has many, postures found place by place may be of another kind each. Here
the base's motion, its rolling and turning if it is on wheels, is that of more joints. From state to state the
tool's way is resolved into motion of all of them, the least by their speeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.areas.standing import room_for
from regionik.moving.path_following import TOOL_STRIDE, proven_hops
from regionik.moving.resolved_states import ResolvedStates
from regionik.planners.driving.footprint import arc_is_free, slide_is_free
from regionik.planners.solvers.aims import in_columns
from regionik.postures.arm import aim_of, goals_between
from regionik.postures.arm_guard import Guard
from regionik.postures.poses import Pose, arrays
from regionik.worlds.arms import reach_bound
from regionik.worlds.scene import Target, World

STRIDE = 0.06  # of the tool from state to state, as a share of the arm's reach, and `TOOL_STRIDE` at the most
TURN_STRIDE = 0.1  # of its frame [rad]


@dataclass(frozen=True, eq=False)
class ResolvedMotion:
    """Motion of a robot with its tool on the path of a world."""

    world: World
    guard: Guard

    def onward(self, i: int, here: Pose, turning: float = 1.0) -> list[Pose] | None:
        """States with the tool on its path from set-point i to the next; None where no such way is free.

        How lightly the base turns is weighed by ``turning``.
        """
        asked = self._asked(i)
        aims = in_columns([aim_of(target) for target in asked])
        poses = [here]
        for k in range(len(asked)):
            pose = self.states.state(aims.part(slice(k, k + 1)), poses[-1], turning=turning)
            if pose is None or math.dist(poses[-1].base[:2], pose.base[:2]) > self.world.rules.step:
                return None
            poses.append(pose)
        return poses[1:] if self._holds([self.world.task[i], *asked], poses) else None

    @cached_property
    def _stride(self) -> float:
        return min(TOOL_STRIDE, STRIDE * reach_bound(self.world.robot.chain).length)

    @cached_property
    def states(self) -> ResolvedStates:
        return ResolvedStates(self.world, self.guard)

    def _asked(self, i: int) -> list[Target]:
        """Targets at most a stride apart from set-point i to the next, that one the last."""
        a, b = self.world.task[i : i + 2]
        turn = 0.0
        if a.direction is not None and b.direction is not None:
            turn = math.acos(min(max(float(a.direction @ b.direction), -1.0), 1.0))
        way = math.dist(a.position, b.position)
        count = max(1, math.ceil(way / self._stride), math.ceil(turn / TURN_STRIDE))
        return [*goals_between(a, b, np.arange(1, count) / count), b]

    def drives(self, poses: list[Pose]) -> bool:
        """Whether the base's way through poses is proven free."""
        bases, _ = arrays(poses)
        drive, room = self.world.robot.drive, room_for(self.world)
        hops = zip(bases[:-1], bases[1:], drive.rolled(bases), np.diff(bases[:, 2]), strict=True)
        return all(
            arc_is_free(room, a, float(rolled), float(turn)) if drive.rolls else slide_is_free(room, a, b)
            for a, b, rolled, turn in hops
        )

    def _holds(self, asked: list[Target], poses: list[Pose]) -> bool:
        """Whether the base's way is free, and the tool led along its path with the arm clear."""
        line = np.array([target.position for target in asked])
        return self.drives(poses) and proven_hops(self.guard, poses, line, asked)[0] == len(asked) - 1
