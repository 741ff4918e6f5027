"""Solids of the robot along a motion, and the pieces of the world's that they may come near to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from regionik.planners.collision.distances import Obstacles, obstacles_among, obstacles_from
from regionik.verification.motion import Mask, MotionSegments, chord_deviation
from regionik.verification.options import VERIFICATION
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Prism, Solid
from regionik.worlds.scene import World

PROOFS, SOLIDS = VERIFICATION.proofs, VERIFICATION.solids


@dataclass(frozen=True, eq=False)
class LinkSolids:
    """The robot's solids along a motion: all points within a radius of the hull of some corners."""

    segments: MotionSegments

    @cached_property
    def corners(self) -> tuple[Array, ...]:
        """Of each solid (k, 3), in its link's frame [m]."""
        return tuple(solid.corners for solid in self.segments.robot.all_solids)

    @cached_property
    def radii(self) -> Array:
        return np.array([solid.radius for solid in self.segments.robot.all_solids])

    @property
    def last(self) -> Mask:
        """Solids of the last link that has any."""
        links = np.array([solid.link for solid in self.segments.robot.all_solids])
        return links == links.max()

    @cached_property
    def acceleration(self) -> Array:
        """Upper bound for any point of each solid, (solids, segments): the largest of its corners'."""
        bound = self.segments.acceleration_bound
        solids = self.segments.robot.all_solids
        return np.array([np.max([bound(solid.link, p) for p in solid.corners], axis=0) for solid in solids])

    def place(self, base: Array, joints: Array) -> tuple[Array, Array]:
        """Corners of all solids in the world, (m, solids, k, 3), and the tool, (m, 3).

        Of a solid with fewer corners than k the first one is repeated.
        """
        robot = self.segments.robot
        arm = robot.frames(base, joints)
        T_world_base = robot.T_world_arm(base) @ np.linalg.inv(robot.T_base_arm)
        frames = np.concatenate([arm, T_world_base[:, None]], axis=1)  # the base last, at its index
        most = max(len(corners) for corners in self.corners)
        hulls = [
            frames[:, solid.link, None, :3, 3]
            + np.concatenate([corners, np.repeat(corners[:1], most - len(corners), axis=0)])
            @ frames[:, solid.link, :3, :3].swapaxes(1, 2)
            for solid, corners in zip(robot.all_solids, self.corners, strict=True)
        ]
        return np.stack(hulls, axis=1), arm[:, -1, :3, 3]


def obstacles_near(world: World, segments: MotionSegments) -> Obstacles:
    """The solids, or of many those that the arm may come near to or a tool may touch, large ones cut."""
    solids = world.arm_solids
    if len(solids) < SOLIDS.min_many and all(_corners(solid) < SOLIDS.min_many for solid in solids):
        return obstacles_from(solids)
    low, high = _places(world, segments)
    bounds = np.array([solid.bounds[:, :2].ravel() for solid in solids])
    tree = shapely.STRtree(shapely.box(*low.T, *high.T))
    near = np.unique(tree.query(shapely.box(*bounds.T))[0]).tolist()
    region = _cells_around(low, high)
    return obstacles_among(solids, ((k, part) for k in near for part in _parts(solids[k], region)))


def _places(world: World, segments: MotionSegments) -> tuple[Array, Array]:
    """Boxes on the floor in which the arm moves, and in which its tool may touch, (n, 2) each [m]."""
    links = LinkSolids(segments)
    bulge = chord_deviation(links.acceleration, np.ones(1)).max(initial=PROOFS.margin_range)
    within = links.radii.max() + world.arm_clearance + bulge
    hulls = links.place(segments.motion.base, segments.motion.joints)[0][..., :2]
    low, high = hulls.min((1, 2)) - within, hulls.max((1, 2)) + within
    task = np.array([target.position[:2] for target in world.task]).reshape(-1, 2)
    touched = world.rules.tool_contact
    low = np.concatenate([low, np.minimum(low[:-1], low[1:]), task - touched])
    high = np.concatenate([high, np.maximum(high[:-1], high[1:]), task + touched])
    return low, high


def _cells_around(low: Array, high: Array) -> shapely.Geometry:
    """Union of boxes, each grown to whole cells with one more on every side."""
    corners = np.floor(low / SOLIDS.cell) - 1, np.ceil(high / SOLIDS.cell) + 1
    cells = np.unique(np.concatenate(corners, axis=1), axis=0)
    return shapely.union_all(shapely.box(*(cells * SOLIDS.cell).T))


def _corners(solid: Solid) -> int:
    return int(shapely.get_num_coordinates(solid.polygon)) if isinstance(solid, Prism) else 0


def _parts(solid: Solid, region: shapely.Geometry) -> list[Solid]:
    """The solid, or of a prism with many corners what lies in a region: cuts are a cell and more off."""
    if not isinstance(solid, Prism) or _corners(solid) < SOLIDS.min_many:
        return [solid]
    parts = shapely.get_parts(shapely.intersection(solid.polygon, region))
    return [replace(solid, polygon=part) for part in parts if part.area > 0]
