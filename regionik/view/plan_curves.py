"""The curves of a plan, before anything draws them: joints, speeds and clearance along the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from regionik.planners.clearance.touching import Bodies, Contact, bodies_from, nearest
from regionik.postures.guard import guard_of
from regionik.timing.limits import tool_velocity
from regionik.timing.sampling import is_timed
from regionik.timing.trajectory import trajectory
from regionik.values import Motion, Plan
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

EVEN = 1000  # instants at which a timed plan is looked at besides its states


@dataclass(frozen=True, eq=False)
class Speeds:
    """How fast a timed plan is at the instants of its curves.

    Attributes
    ----------
    joints : (n, dof) array
        [rad/s], [m/s]
    tool, base : (n,) arrays
        Of the tool's and the base's origin [m/s].
    """

    joints: Array
    tool: Array
    base: Array


@dataclass(frozen=True, eq=False)
class Clearances:
    """Distances at every state, (n,) each [m]; infinite where there is nothing to keep off.

    Attributes
    ----------
    base : (n,) array
        Footprint to the shadow of the nearest solid that the base could hit.
    arm : (n,) array
        The robot's solids to the nearest solid of the world, but for what the tool works on.
    own : (n,) array
        The robot's solids to each other and its base, where these have to keep apart.
    """

    base: Array
    arm: Array
    own: Array


@dataclass(frozen=True, eq=False)
class Curves:
    """What there is to see of a plan along its way.

    Attributes
    ----------
    timed : bool
        Whether places on the way are times [s]; else they are numbers of states, from 1.
    states : (n,) array
        Place of every state.
    along : (m,) array
        Where ``joints`` and ``speeds`` are told.
    joints : (m, dof) array
    speeds : Speeds or None
        None where the plan is not timed.
    clearances : Clearances
    setpoints : (k,) array
        Where set-points are met.
    lifted : (l, 2) array
        From where to where the tool is lifted.
    """

    timed: bool
    states: Array
    along: Array
    joints: Array
    speeds: Speeds | None
    clearances: Clearances
    setpoints: Array
    lifted: Array


def curves_of(plan: Plan) -> Curves:
    """The curves of a plan."""
    motion, timed = plan.motion, is_timed(plan.motion)
    states = motion.time if timed else np.arange(1.0, len(motion) + 1)
    along, joints, speeds = states, motion.joints, None
    if timed:
        along = np.union1d(states, np.linspace(0.0, states[-1], EVEN))
        sample = trajectory(plan).sample(along)
        joints = sample.joints
        speeds = Speeds(
            joints=sample.joint_velocity,
            tool=np.linalg.norm(tool_velocity(plan.world.robot, *sample.columns[:2]), axis=1),
            base=np.hypot(*sample.base_velocity[:, :2].T),
        )
    return Curves(
        timed=timed,
        states=states,
        along=along,
        joints=joints,
        speeds=speeds,
        clearances=clearances(plan),
        setpoints=states[motion.kind == "setpoint"],
        lifted=_lifted(motion, states),
    )


def clearances(plan: Plan) -> Clearances:
    """Distances at every state of a plan."""
    world, motion = plan.world, plan.motion
    contact = guard_of(world).contact
    around = bodies_from(_loose(world.robot), world.solids)
    return Clearances(
        base=_base_clearance(world, motion),
        arm=_least(around, motion, contact) if world.solids else np.full(len(motion), np.inf),
        own=_least(bodies_from(world.robot, ()), motion, None),
    )


def _least(bodies: Bodies, motion: Motion, contact: Contact | None) -> Array:
    """Least distance at every state, negative where something overlaps, (n,) [m]."""
    pairs = zip(motion.base, motion.joints, strict=True)
    return np.array([nearest(bodies, base, joints, contact=contact).distance for base, joints in pairs])


def _loose(robot: Robot) -> Robot:
    """A robot whose solids may touch each other, so that only the world is left to keep off."""
    names = [solid.name for solid in robot.all_solids]
    pairs = tuple(combinations(names, 2))
    return replace(robot, footprint=np.zeros((1, 2)), unchecked=pairs)


def _base_clearance(world: World, motion: Motion) -> Array:
    """Footprint to the nearest shadow at every state, 0 where they meet, (n,) [m]."""
    shadows = [solid.shadow(world.robot.body_height) for solid in world.solids]
    seen = [shadow for shadow in shadows if shadow is not None and not shadow.core.is_empty]
    least = np.full(len(motion), np.inf)
    prints = footprints(world.robot, motion.base)
    for radius in sorted({shadow.radius for shadow in seen}):
        cores = shapely.STRtree([shadow.core for shadow in seen if shadow.radius == radius])
        which, distance = cores.query_nearest(prints, return_distance=True, all_matches=False)
        least[which[0]] = np.minimum(least[which[0]], distance - radius)
    clearance: Array = np.maximum(least, 0.0)
    return clearance


def footprints(robot: Robot, base: Array) -> shapely.Geometry:
    """Outlines of the base at some poses (n, 3) on the floor, an (n,) array of shapes."""
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1)
    corners = robot.footprint @ turn + base[:, None, :2]
    return shapely.convex_hull(shapely.multipoints(corners))


def _lifted(motion: Motion, states: Array) -> Array:
    """From where to where transits last, the hops to and from them included, (l, 2)."""
    transit = motion.kind == "transit"
    hops = transit[:-1] | transit[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], hops, [False]])))
    spans: Array = states[edges].reshape(-1, 2)
    return spans
