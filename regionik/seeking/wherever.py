"""Whether an arm in one plane has a clear posture for a target from any place of the floor at all."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from regionik.areas.ground import EVERY, GUARD, ground_of
from regionik.areas.standing import room_for
from regionik.planners.clearance.anyplace import (
    FIRST_CELLS,
    FOUND,
    NONE,
    Asked,
    Cells,
    Floors,
    decide,
    first_cells,
    near_solids,
)
from regionik.planners.clearance.bulkreach import MOST_RINGS
from regionik.planners.clearance.planecell import Frame, Look
from regionik.planners.clearance.planecores import cores_of
from regionik.planners.clearance.planehits import Around, Cores
from regionik.planners.geometry.collision import obstacles_from
from regionik.planners.geometry.flat import Index
from regionik.planners.geometry.upright import Uprights, depths, uprights_from
from regionik.planners.solvers.planar_arm import reach_intervals
from regionik.postures.guard import contact_for
from regionik.postures.poses import Pose
from regionik.seeking.flatworld import floor_of, keep_of, own, reach_of, stance_of
from regionik.worlds.arrays import Array
from regionik.worlds.pivot import is_planar
from regionik.worlds.planar import planar_arm
from regionik.worlds.scene import Target, World


class Looked(NamedTuple):
    """What a look at all postures from all places came to.

    Attributes
    ----------
    verdict : {"found", "none", "open"}
        "none" is a proof.
    pose : Pose or None
        The posture found; it is clear, the base is on the floor.
    gap : float
        Diagonal of a box round the places of the arm axis that are left open, 0 where none are [m].
    around : tuple of str
        Names of the obstacles that an arm at the target might touch.
    """

    verdict: Literal["found", "none", "open"]
    pose: Pose | None
    gap: float
    around: tuple[str, ...]


def can_look(world: World) -> bool:
    """Whether `look_everywhere` can be asked: an arm in one plane that is led round things."""
    return world.rules.avoidance and is_planar(world.robot.chain)


def look_everywhere(world: World, target: Target, most: int) -> Looked:
    """Look for a clear posture of an arm in one plane, from every place of the floor and at every heading.

    Parameters
    ----------
    world : World
        One that `can_look`.
    target : Target
    most : int
        Cells of postures that are looked at.
    """
    arm, asked, around = prepared(world), asked_of(world, target), around_of(world, target)
    reach, stance = reach_of(world), stance_of(world, EVERY)
    rings = np.empty((MOST_RINGS, 2))
    found = reach_intervals(
        stance.plane, -np.inf, np.inf, reach.centers, reach.radii, asked.target[2], True, True, rings
    )
    solids, room = len(arm.cores.rank), max(most, FIRST_CELLS * MOST_RINGS)
    cells = Cells(np.empty((room, 4)), np.empty((room, 4)), np.empty(room))
    look = Look(np.empty(3), np.empty((solids, 2, 3)), np.empty((solids, 2, 2)), np.empty(4))
    base, joints = np.empty(3), own(world.robot.carry)
    verdict, gap = decide(
        arm.cores, arm.frame, around, arm.floors, asked, keep_of(world), stance.sign, stance.offset,
        first_cells(arm.frame, asked, rings[:found], cells), cells, look, base, joints,
    )  # fmt: skip
    if verdict == FOUND:
        return Looked("found", Pose(base, joints), 0.0, ())
    names = tuple(world.solids[k].name for k in np.unique(arm.owner[around.near]).tolist())
    return Looked("none" if verdict == NONE else "open", None, gap, names)


class Prepared(NamedTuple):
    """What is the same for all targets of a world."""

    cores: Cores
    frame: Frame
    floors: Floors
    solids: Uprights
    deep: Array
    owner: Index
    far: float  # from a target, beyond which a solid touches no link [m]


@lru_cache(maxsize=8)
def prepared(world: World) -> Prepared:
    """What is the same for all targets of a world."""
    stance, cores = stance_of(world, EVERY), cores_of(world.robot)
    fixed = world.rules.heading == "fixed"
    frame = Frame(
        stance.plane, stance.mount, stance.zero, stance.low, stance.high, stance.yaw if fixed else np.nan
    )
    obstacles = obstacles_from(world.solids)
    whole = [k for k, piece in enumerate(obstacles.pieces) if piece.mesh is None]
    solids = uprights_from([obstacles.pieces[k] for k in whole])
    levers = np.linalg.norm(cores.ends, axis=2).max(initial=0.0) + cores.radius.max(initial=0.0)
    far = stance.plane.lengths.sum() + abs(stance.plane.shoulder_r) + levers + world.rules.arm_clearance
    return Prepared(
        cores,
        frame,
        _floors(world),
        solids,
        depths(solids),
        np.array(obstacles.owner, dtype=np.int64)[whole],
        float(far + world.rules.tolerance),
    )


def around_of(world: World, target: Target) -> Around:
    """The obstacles that an arm at a target might touch."""
    arm, contact, rules = prepared(world), contact_for(world, [target]), world.rules
    near = np.empty(len(arm.owner), dtype=np.int64)
    near = near[: near_solids(arm.solids, own(target.position), arm.far, near)]
    tool_on = int(contact.owner[0]) if len(contact.owner) else -1
    return Around(arm.solids, arm.deep, near, arm.owner, tool_on, rules.arm_clearance, rules.tolerance)


def _floors(world: World) -> Floors:
    ground, room = ground_of(world), room_for(world)
    heart, radius = np.zeros(2), 0.0
    if len(room.corners) > 2:
        outline = Polygon(room.corners)
        middle = shapely.maximum_inscribed_circle(outline).coords[0]
        heart, radius = own(np.array(middle)), outline.exterior.distance(Point(middle))
    inner, outer = floor_of(ground.inner), floor_of(ground.outer)
    return Floors(inner, outer, room, heart, radius, ground.far, GUARD)


def asked_of(world: World, target: Target) -> Asked:
    """A target as the search takes it."""
    position, free = own(target.position), np.array([0.0, 0.0, 1.0])
    seek = world.rules.criteria is None and target.orientation is None
    if target.direction is None:
        return Asked(position, free, np.pi, seek)
    if not planar_arm(world.robot.chain).tool_along_link:
        return Asked(position, free, np.pi, False)
    return Asked(position, own(target.direction), float(target.cone), seek)
