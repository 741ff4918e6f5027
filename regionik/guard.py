"""What keeps the arm off things: poses and motions judged under a world's rules.

`verify` judges finished plans again, by other code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from regionik.planners.collision import box_gaps, obstacles_from
from regionik.planners.touching import Bodies, Contact, Touch, bodies_from, motion_clear, nearest
from regionik.poses import Pose
from regionik.worlds.errors import Cause
from regionik.worlds.scene import World

SPARE = 5e-4  # kept beyond the arm's clearance, so that what is planned can be proven [m]
SIGHT = 1.0  # how far the nearest thing is looked for where nothing is clear [m]


@dataclass(frozen=True, eq=False)
class Guard:
    """Solids of robot and world, and what the rules say about their touching.

    Attributes
    ----------
    world : World
    bodies : Bodies
    contact : Contact
        Where the last link may touch.
    margin : float
        Distance that links keep [m].
    """

    world: World
    bodies: Bodies
    contact: Contact
    margin: float

    @property
    def on(self) -> bool:
        """Whether the rules want the arm led round things."""
        return self.world.rules.avoidance

    def touch(self, pose: Pose) -> Touch:
        """What comes nearer to the arm than its margin."""
        return nearest(self.bodies, pose.base, pose.joints, contact=self.contact, within=self.margin)

    def allows(self, touch: Touch) -> bool:
        """Whether a touch keeps the margin."""
        return touch.distance >= self.margin

    def clear(self, pose: Pose) -> bool:
        """Whether every link keeps its margin."""
        return not self.on or self.allows(self.touch(pose))

    def stop(self, here: Pose, there: Pose) -> Touch | None:
        """What keeps the motion between two states from being proven clear."""
        if not self.on:
            return None
        a, b = (here.base, here.joints), (there.base, there.joints)
        return motion_clear(self.bodies, *a, *b, self.margin, contact=self.contact)

    def words(self, touch: Touch) -> str:
        """Which link comes how near to what."""
        link = self.world.robot.solids[touch.solid].name
        if touch.distance < 0:
            return f"{link} overlaps {self.other(touch)} by {-touch.distance:.4f} m"
        return f"{link} comes within {touch.distance:.4f} m of {self.other(touch)}"

    def other(self, touch: Touch) -> str:
        """Name of what the link comes near to."""
        if touch.kind == "obstacle":
            return self.world.solids[touch.other].name
        return "the base" if touch.kind == "base" else self.world.robot.solids[touch.other].name

    def cause(self, touch: Touch) -> Cause:
        """The touch as a cause of a failure; the margin is what is missing [m]."""
        missing = self.margin - touch.distance
        if touch.kind == "obstacle":
            return Cause("obstacle", self.other(touch), missing)
        return Cause("self", self.other(touch), missing)


@lru_cache(maxsize=8)
def guard_of(world: World) -> Guard:
    """The guard of a world; kept for the last few worlds."""
    bodies = bodies_from(world.robot, world.solids)
    return Guard(world, bodies, _contact(world), world.rules.arm_clearance + SPARE)


def _contact(world: World) -> Contact:
    """Each set-point with the solid that it lies on or in, or is nearest to within ``tool_contact``."""
    reach = world.rules.tool_contact
    obstacles = obstacles_from(world.solids)
    spots, owners = [], []
    for target in world.task:
        spot = target.position[None, None]
        near = np.unique(obstacles.owner[box_gaps(obstacles, spot, spot)[0] <= reach])
        gaps = [world.solids[k].distance(target.position) for k in near]
        if gaps and min(gaps) <= reach:
            spots.append(target.position)
            owners.append(int(near[np.argmin(gaps)]))
    return Contact(np.array(spots).reshape(-1, 3), np.array(owners, dtype=np.int64), reach)
