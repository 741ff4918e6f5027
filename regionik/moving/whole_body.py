"""Ways of base and arm together that RRTConnect finds where nothing simpler does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.moving.base_motion import Driver
from regionik.moving.interpolation import Interpolator
from regionik.planners.driving.sampling import State, connect
from regionik.postures.poses import Pose, axis_of, pose_of, turn_to
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

ITERATIONS = 3000  # of RRTConnect
STRIDE = 1.0  # its longest motion, metres and radians together


@dataclass(frozen=True, eq=False)
class WholeBodyPlanner:
    """The space of arm axis, heading and joints over one piece of free floor, for an omnidirectional base."""

    world: World
    interpolator: Interpolator
    driver: Driver
    piece: int

    def way(self, here: Pose, there: Pose) -> list[Pose] | None:
        """Poses from one to another, both included, with clear straight motions between them."""
        start, goal = self._row(here, here), self._row(there, here)
        lower, upper = self._box(start, goal)

        def free(state: State) -> bool:
            at = self._pose(self._read(state))
            return self.driver.inside(at, self.piece) and self.interpolator.guard.clear(at)

        def clear(p: State, q: State) -> bool:
            return self._goes(self._pose(self._read(p)), self._pose(self._read(q)))

        seed = self.driver.seed
        path = connect(
            lower, upper, start, goal, free, clear, seed=seed, iterations=ITERATIONS, stride=STRIDE
        )
        if path is None:
            return None
        return self._shortened([here, *(self._pose(self._read(q)) for q in path[1:-1]), there])

    def _goes(self, here: Pose, there: Pose) -> bool:
        """Whether a straight motion stays on the free floor, and keeps the arm clear."""
        states = self.driver.direct(here, there, self.piece)
        return states is not None and self.interpolator.clear([here, *states, there])

    def _shortened(self, poses: list[Pose]) -> list[Pose]:
        """Poses without those that a straight motion, proven clear, can leave out."""
        kept, k = [poses[0]], 0
        while k < len(poses) - 1:
            ahead = range(len(poses) - 1, k + 1, -1)
            k = next((m for m in ahead if self._goes(poses[k], poses[m])), k + 1)
            kept.append(poses[k])
        return kept

    def _row(self, pose: Pose, near: Pose) -> Array:
        """A pose as axis, heading and joints in one row, the heading within half a turn of another's."""
        yaw = near.base[2] + turn_to(near.base, pose.base)[2]
        return np.array([*axis_of(self.world.robot, pose.base), yaw, *pose.joints])

    def _pose(self, q: Array) -> Pose:
        return Pose(pose_of(self.world.robot, q[:2], float(q[2])), q[3:])

    def _read(self, state: State) -> Array:
        q = np.array([state[i] for i in range(3 + self.world.robot.chain.dof)])
        if self.world.rules.heading == "fixed" and self.world.start is not None:
            q[2] = self.world.start.base[2]
        return q

    def _box(self, start: Array, goal: Array) -> tuple[Array, Array]:
        """Where to sample: the floor's extent, a turn about the start's heading, joint limits."""
        chain = self.world.robot.chain
        ends = np.stack([start, goal])
        low, high = ends.min(axis=0), ends.max(axis=0)
        low[:2], high[:2] = self.driver.extent(self.piece)
        if self.world.rules.heading != "fixed":
            low[2], high[2] = start[2] - np.pi, start[2] + np.pi
        unbounded = ~(np.isfinite(chain.lower) & np.isfinite(chain.upper))
        low[3:] = np.where(unbounded, low[3:] - np.pi, chain.lower)
        high[3:] = np.where(unbounded, high[3:] + np.pi, chain.upper)
        return low, high
