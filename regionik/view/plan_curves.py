"""The curves of a plan as plain values: joints, speeds and clearances along the motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from regionik.planners.clearance.proximity import Bodies, ContactTargets, bodies_from, nearest
from regionik.postures.arm_guard import guard_of
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import is_timed, trajectory
from regionik.values import Motion, Plan
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

SAMPLES = 1000  # of a timed plan, at even times besides its states


@dataclass(frozen=True, eq=False)
class SpeedCurves:
    """Speeds of a timed plan at the samples of its curves.

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
class ClearanceCurves:
    """Distances at every state, (n,) each [m]; infinite where there is nothing to avoid.

    Attributes
    ----------
    base : (n,) array
        Footprint to the shadow of the nearest solid that the base could hit.
    arm : (n,) array
        The robot's solids to the nearest solid of the world, apart from allowed contact of the tool.
    own : (n,) array
        The robot's solids to each other and to its base, where these have to keep apart.
    """

    base: Array
    arm: Array
    own: Array


@dataclass(frozen=True, eq=False)
class PlanCurves:
    """Curves of a plan along its motion.

    Attributes
    ----------
    timed : bool
        Whether abscissas are times [s]; else they are numbers of states, from 1.
    states : (n,) array
        Abscissa of every state.
    along : (m,) array
        Abscissas of ``joints`` and ``speeds``.
    joints : (m, dof) array
    speeds : SpeedCurves or None
        None where the plan is not timed.
    clearances : ClearanceCurves
    setpoints : (k,) array
        Abscissas of set-points.
    lifted : (l, 2) array
        Intervals in which the tool is lifted.
    """

    timed: bool
    states: Array
    along: Array
    joints: Array
    speeds: SpeedCurves | None
    clearances: ClearanceCurves
    setpoints: Array
    lifted: Array


def plan_curves(plan: Plan) -> PlanCurves:
    """Return the curves of a plan."""
    motion, timed = plan.motion, is_timed(plan.motion)
    states = motion.time if timed else np.arange(1.0, len(motion) + 1)
    along, joints, speeds = states, motion.joints, None
    if timed:
        along = np.union1d(states, np.linspace(0.0, states[-1], SAMPLES))
        sample = trajectory(plan).sample(along)
        joints = sample.joints
        speeds = SpeedCurves(
            joints=sample.joint_velocity,
            tool=np.linalg.norm(tool_velocity(plan.world.robot, *sample.columns[:2]), axis=1),
            base=np.hypot(*sample.base_velocity[:, :2].T),
        )
    return PlanCurves(
        timed=timed,
        states=states,
        along=along,
        joints=joints,
        speeds=speeds,
        clearances=clearances(plan),
        setpoints=states[motion.kind == "setpoint"],
        lifted=_lifted(motion, states),
    )


def clearances(plan: Plan) -> ClearanceCurves:
    """Return the distances at every state of a plan."""
    world, motion = plan.world, plan.motion
    contact = guard_of(world).contact
    around = bodies_from(_without_self_collision(world.robot), world.solids)
    return ClearanceCurves(
        base=_base_clearance(world, motion),
        arm=_distances(around, motion, contact) if world.solids else np.full(len(motion), np.inf),
        own=_distances(bodies_from(world.robot, ()), motion, None),
    )


def _distances(bodies: Bodies, motion: Motion, contact: ContactTargets | None) -> Array:
    """Least distance at every state, negative where something overlaps, (n,) [m]."""
    pairs = zip(motion.base, motion.joints, strict=True)
    return np.array([nearest(bodies, base, joints, contact=contact).distance for base, joints in pairs])


def _without_self_collision(robot: Robot) -> Robot:
    """A robot whose solids may touch each other, so that only distances to the world count."""
    names = [solid.name for solid in robot.all_solids]
    pairs = tuple(combinations(names, 2))
    return replace(robot, footprint=np.zeros((1, 2)), unchecked=pairs)


def _base_clearance(world: World, motion: Motion) -> Array:
    """Footprint to the nearest shadow at every state, 0 where they meet, (n,) [m]."""
    shadows = [solid.shadow(world.robot.body_height) for solid in world.solids]
    shown = [shadow for shadow in shadows if shadow is not None and not shadow.core.is_empty]
    nearest_shadow = np.full(len(motion), np.inf)
    prints = footprints(world.robot, motion.base)
    for radius in sorted({shadow.radius for shadow in shown}):
        cores = shapely.STRtree([shadow.core for shadow in shown if shadow.radius == radius])
        which, distance = cores.query_nearest(prints, return_distance=True, all_matches=False)
        nearest_shadow[which[0]] = np.minimum(nearest_shadow[which[0]], distance - radius)
    clearance: Array = np.maximum(nearest_shadow, 0.0)
    return clearance


def footprints(robot: Robot, base: Array) -> shapely.Geometry:
    """Return the outlines of the base at poses (n, 3), an (n,) array of polygons."""
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1)
    corners = robot.footprint @ turn + base[:, None, :2]
    return shapely.convex_hull(shapely.multipoints(corners))


def _lifted(motion: Motion, states: Array) -> Array:
    """Intervals of transits, the motions to and from them included, (l, 2)."""
    transit = motion.kind == "transit"
    lifted = transit[:-1] | transit[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lifted, [False]])))
    spans: Array = states[edges].reshape(-1, 2)
    return spans
