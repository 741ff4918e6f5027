"""What keeps the arm off things: poses and motions judged under a world's rules.

`verify` judges finished plans again, by other code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from regionik.planners.collision import Obstacles, box_gaps, hull_separation, obstacles_from
from regionik.planners.touching import Bodies, Contact, Touch, bodies_from, motion_clear, nearest
from regionik.poses import Pose
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause
from regionik.worlds.scene import World

SPARE = 5e-4  # kept beyond what the rules want, so that what is planned can be proven [m]


@dataclass(frozen=True, eq=False)
class Guard:
    """Solids of robot and world, and what the rules say about their touching.

    Attributes
    ----------
    world : World
    bodies : Bodies
    contact : Contact
        Where the last link may touch.
    obstacles : Obstacles
        The world's solids alone, for one link at a time.
    """

    world: World
    bodies: Bodies
    contact: Contact
    obstacles: Obstacles

    @property
    def on(self) -> bool:
        """Whether the rules want the arm led round things."""
        return self.world.rules.avoidance

    def touch(self, pose: Pose) -> Touch:
        """What comes too near to the arm, of kind "none" where nothing does."""
        return nearest(self.bodies, pose.base, pose.joints, contact=self.contact, within=SPARE)

    def clear(self, pose: Pose) -> bool:
        """Whether every link keeps clear."""
        return not self.on or self.touch(pose).kind == "none"

    def stop(self, here: Pose, there: Pose) -> Touch | None:
        """What keeps the motion between two states from being proven clear."""
        if not self.on:
            return None
        a, b = (here.base, here.joints), (there.base, there.joints)
        return motion_clear(self.bodies, *a, *b, SPARE, contact=self.contact)

    def link_clear(self, link: int, T_world_link: Array, spot: Array) -> bool:
        """Whether one link keeps clear of the world's solids while the tool works at a spot."""
        margin = self.bodies.clearance + SPARE
        for solid in self.world.robot.solids:
            if solid.link != link:
                continue
            corners = solid.corners @ T_world_link[:3, :3].T + T_world_link[:3, 3]
            low, high = corners.min(axis=0)[None, None], corners.max(axis=0)[None, None]
            near = box_gaps(self.obstacles, low, high)[0] < solid.radius + margin
            if link == self._last:
                near &= ~np.isin(self.obstacles.owner, self._owners(spot))
            for k in np.flatnonzero(near):
                gap = hull_separation(self.obstacles.pieces[k], corners).distance - solid.radius
                if gap < margin:
                    return False
        return True

    @property
    def _last(self) -> int:
        return max((solid.link for solid in self.world.robot.solids), default=-1)

    def _owners(self, spot: Array) -> Array:
        """Solids that may be touched by a tool that is at a spot."""
        away = np.linalg.norm(self.contact.spots - spot, axis=1)
        owners: Array = self.contact.owner[away <= self.contact.reach]
        return owners

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
        if touch.kind == "obstacle":
            return Cause("obstacle", self.other(touch), max(0.0, self.bodies.clearance - touch.distance))
        return Cause("self", self.other(touch), max(0.0, -touch.distance))


@lru_cache(maxsize=8)
def guard_of(world: World) -> Guard:
    """The guard of a world; kept for the last few worlds."""
    bodies = bodies_from(world.robot, world.solids, world.rules.arm_clearance)
    obstacles = obstacles_from(world.solids)
    contact = _contact(world, obstacles)
    return Guard(world, bodies, contact, obstacles)


def _contact(world: World, obstacles: Obstacles) -> Contact:
    """Each set-point with the solid that it lies on or in, or is nearest to within ``tool_contact``."""
    reach = world.rules.tool_contact
    spots, owners = [], []
    for target in world.task:
        spot = target.position[None, None]
        near = np.unique(obstacles.owner[box_gaps(obstacles, spot, spot)[0] <= reach])
        gaps = [world.solids[k].distance(target.position) for k in near]
        if gaps and min(gaps) <= reach:
            spots.append(target.position)
            owners.append(int(near[np.argmin(gaps)]))
    return Contact(np.array(spots).reshape(-1, 3), np.array(owners, dtype=np.int64), reach)
