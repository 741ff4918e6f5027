"""Clear postures at one target with the base held: every method in one place, the quick ones first.

A posture may be led on from those that the arm knows. One that touches something may be mended. For a point,
FABRIK-R and FABRIK with obstacle-avoiding rotations try that first, then postures drawn at random and varied,
last all postures box by box, which alone can prove that there is none. For a direction or an orientation
postures are drawn and varied; an arm whose self-motion shows all its postures there has no others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regionik.planners.avoidance.clear_posture import (
    ClearPosture,
    clear_posture,
    clear_posture_at_pose,
    quick_clear_posture,
    sampled_clear_posture,
)
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import PostureTask, is_searchable, search_postures
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.options import POSTURES
from regionik.postures.poses import Pose
from regionik.postures.posture_search import PostureSearch
from regionik.postures.serial_solver import serial_solver
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target

NOT_ASKED = ClearPosture(Verdict.OPEN, None, np.inf, ())


@dataclass(frozen=True, eq=False)
class PostureFinder:
    """Finder of postures that bring the tool to a target with every link clear, the base at given poses."""

    scene: Scene
    target: Target
    collision: CollisionChecker
    seed: int = 0

    def led_on(self, base: Array, starts: int) -> Array:
        """Postures (n, dof), one at most, led on from those that the arm knows.

        There are none for arms to which a place gives their posture.
        """
        if self.scene.model(self.target).exact:
            return np.empty((0, self.scene.robot.chain.dof))
        search = PostureSearch(self.scene.world, self.collision, [self.target])
        return search.neighboring(base, np.arange(1), starts)[1]

    def around(self, pose: Pose) -> ClearPosture:
        """A posture near one that touches something, soon found or not."""
        if self.target.direction is not None:
            return self.sampled(pose, POSTURES.search.pose_samples)
        return quick_clear_posture(self._task(pose.base), pose.joints, seed=self.seed)

    def sampled(self, pose: Pose, samples: int) -> ClearPosture:
        """A posture of so many drawn at random and near the best of them."""
        robot, collision = self.scene.robot, self.collision
        if self.scene.model(self.target).shows_all_postures:
            return NOT_ASKED
        if self.target.direction is None:
            return sampled_clear_posture(self._task(pose.base), pose.joints, samples=samples)
        arm = serial_solver(robot.chain, float(robot.mount[2]), self.scene.rules.tolerance)
        goal = arm.goal_for(self.target)
        return clear_posture_at_pose(
            collision.bodies, pose.base, goal.aim, pose.joints, goal.effort,
            contact=collision.contact, margin=collision.spare, seed=self.seed, samples=samples,
        )  # fmt: skip

    def thorough(self, pose: Pose, most_boxes: int) -> ClearPosture:
        """A posture by every method, or a proof that there is none; for points alone."""
        if self.target.direction is not None:
            return NOT_ASKED
        return clear_posture(self._task(pose.base), pose.joints, seed=self.seed, most_boxes=most_boxes)

    def every(self, base: Array, accept: Callable[[Array], bool], most_boxes: int) -> Verdict:
        """Look at all postures on the target's point until one is accepted; ruled out is a proof.

        Open where the arm is too mobile for that.
        """
        robot = self.scene.robot
        if not is_searchable(robot.chain, robot.solids):
            return Verdict.OPEN
        return search_postures(self._task(base, 0.0), accept, most_boxes).verdict

    def _task(self, base: Array, margin: float | None = None) -> PostureTask:
        collision, tolerance = self.collision, self.scene.rules.tolerance
        spare = collision.spare if margin is None else margin
        return PostureTask(collision.bodies, base, self.target.position, collision.contact, tolerance, spare)
