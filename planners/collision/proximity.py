"""What the solids of a robot touch: obstacles, the robot itself and its own base.

Lower bounds of distances come from compiled code (`hulls`, `sweeping`) and say where nothing needs to be
looked at; the distances that are told come from `collision`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.planners.collision.collision_checking import first_stop_on_way, lower_bounds, swept
from regionik.planners.collision.contacts import ROUNDING, exempt_for
from regionik.planners.collision.convex_bodies import Separation
from regionik.planners.collision.distances import hull_separation
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, Exempt, Hulls, bodies_from
from regionik.planners.collision.robot_motion import WORLD, Hop, hop_between, pace, place, stand
from regionik.planners.geometry.polygons import Index
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.self_collision import BODY

__all__ = [
    "Bodies",
    "ContactTargets",
    "Touch",
    "bodies_from",
    "exempt_of",
    "motion_clear",
    "nearest",
    "other",
    "solid_clear",
    "still_clear",
    "way_clear",
    "words",
]

_NO_CONTACT = ContactTargets(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), 0.0)
LOOK = 1e-3  # part of a motion between two looks for a link inside a mesh


class Touch(NamedTuple):
    """What comes nearest to the robot's solids; points in the world."""

    distance: float  # [m], negative where they overlap; infinite where there is nothing
    solid: int  # index into Robot.all_solids, -1 where there is nothing
    kind: Literal["obstacle", "self", "base", "none"]
    other: int  # index of the obstacle, or of the other solid of the robot; -1 otherwise
    on_solid: Array  # (3,) [m]
    on_other: Array  # (3,) [m]


NOTHING = Touch(np.inf, -1, "none", -1, np.full(3, np.nan), np.full(3, np.nan))  # is near


def nearest(
    bodies: Bodies,
    base: ArrayLike,
    joints: ArrayLike,
    *,
    contact: ContactTargets | None = None,
    within: float = np.inf,
) -> Touch:
    """What comes nearest to the robot's solids: an obstacle, another of its solids, or its own base.

    Parameters
    ----------
    bodies : Bodies
    base : (3,) array_like
        x, y [m], yaw [rad].
    joints : (dof,) array_like
    contact : ContactTargets, optional
        What may be touched is not looked at.
    within : float
        Distance beyond which nothing is looked for; from obstacles, beyond the bodies' clearance [m].

    Returns
    -------
    Touch
        Of kind "none" where nothing is within that distance.

    Raises
    ------
    InputError
        When a number is not finite.
    """
    hop = _still(*_state(bodies, base, joints))
    return _nearest(bodies, hop, np.arange(len(bodies.robot.all_solids)), contact, within)


def solid_clear(
    bodies: Bodies,
    base: ArrayLike,
    joints: ArrayLike,
    k: int,
    margin: float,
    *,
    contact: ContactTargets | None = None,
) -> bool:
    """Whether one solid keeps a distance from obstacles, the base, and solids of links nearer to the base.

    Asked of every solid, it looks at every pair once; joints beyond the solid's link do not matter.

    Parameters
    ----------
    bodies : Bodies
    base : (3,) array_like
        x, y [m], yaw [rad].
    joints : (dof,) array_like
    k : int
        Index into ``Robot.all_solids``.
    margin : float
        [m]
    contact : ContactTargets, optional
        As for `nearest`; the place of the tool does depend on all joints.
    """
    hop = _still(*_state(bodies, base, joints))
    return _nearest(bodies, hop, np.array([k]), contact, margin).solid < 0


def motion_clear(
    bodies: Bodies,
    base_a: ArrayLike,
    joints_a: ArrayLike,
    base_b: ArrayLike,
    joints_b: ArrayLike,
    margin: float,
    *,
    contact: ContactTargets | None = None,
) -> Touch | None:
    """Whether every link keeps a distance from everything over the whole motion between two states.

    The base turns the shorter way, and moves straight or, on wheels, along the arc that its heading allows;
    joints move linearly. Proven, not sampled: see `sweeping`.

    Parameters
    ----------
    bodies : Bodies
    base_a, base_b : (3,) array_like
        x, y [m], yaw [rad].
    joints_a, joints_b : (dof,) array_like
    margin : float
        Of the robot's solids from each other, from its own base, and from obstacles beyond the bodies'
        clearance; at least 0 [m].
    contact : ContactTargets, optional
        What may be touched while the tool is near.

    Returns
    -------
    Touch or None
        None when proven clear; otherwise what could not be passed, where the proof ended.

    Raises
    ------
    InputError
        When a number is not finite or the margin is negative.
    """
    if not 0 <= margin < np.inf:
        raise InputError(f"margin: expected a finite number, at least 0, got {margin}")
    bases, joints = zip(_state(bodies, base_a, joints_a), _state(bodies, base_b, joints_b), strict=True)
    return way_clear(bodies, np.stack(bases), np.stack(joints), margin, contact)[1]


def way_clear(
    bodies: Bodies, bases: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> tuple[int, Touch | None]:
    """As `motion_clear`, hop by hop through states (n + 1, 3), (n + 1, dof), finite and writable.

    Returns how many hops are proven clear before the first that is not, and what could not be passed there.
    """
    i, k, m, s = _first_stop(bodies, bases, joints, margin, contact)
    if k < 0:
        return i, None
    hop = hop_between(bases[i], joints[i], bases[i + 1], joints[i + 1], bodies.robot.drive.rolls)
    return i, _touch(bodies, _at(hop, s), k, m)


def still_clear(
    bodies: Bodies, base: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> bool:
    """Whether every link is proven to keep a distance from everything in a state; quicker than `nearest`."""
    return _first_stop(bodies, np.array([base, base]), np.array([joints, joints]), margin, contact)[1] < 0


def _first_stop(
    bodies: Bodies, bases: Array, joints: Array, margin: float, contact: ContactTargets | None
) -> tuple[int, int, int, float]:
    """Hop, solid, row and part of the hop where the proof of a way ends; a solid of -1 where it does not."""
    exempt, rolls = exempt_of(bodies, contact), bodies.robot.drive.rolls
    known = bodies.arm, bodies.mount, bodies.movers, bodies.hulls
    i, k, m, s = first_stop_on_way(*known, bases, joints, rolls, exempt, float(margin))
    for n in range(i if bodies.meshed else 0):
        hop = hop_between(bases[n], joints[n], bases[n + 1], joints[n + 1], rolls)
        within = _swallowed(bodies, hop, exempt)
        if within[0] >= 0:
            return n, *within
    return i, k, m, s


def _state(bodies: Bodies, base: ArrayLike, joints: ArrayLike) -> tuple[Array, Array]:
    """Base and joints, checked; writable, as kernels are compiled for one kind of array alone."""
    dof = bodies.robot.chain.dof
    return np.array(frozen(base, (3,), "base")), np.array(frozen(joints, (dof,), "joints"))


def words(bodies: Bodies, touch: Touch) -> str:
    """Which solid of the robot comes how near to what."""
    if touch.kind == "none":
        return "nothing is near"
    link, what = bodies.robot.all_solids[touch.solid].name, other(bodies, touch)
    if touch.distance < 0:
        return f"{link} overlaps {what} by {-touch.distance:z.4f} m"
    return f"{link} comes within {touch.distance:z.4f} m of {what}"


def other(bodies: Bodies, touch: Touch) -> str:
    """Name of what comes near to the robot."""
    if touch.kind == "obstacle":
        return bodies.obstacles[touch.other].name
    return "the base" if touch.kind == "base" else bodies.robot.all_solids[touch.other].name


def _nearest(bodies: Bodies, hop: Hop, which: Index, contact: ContactTargets | None, within: float) -> Touch:
    lower = np.empty((len(bodies.robot.all_solids), len(bodies.pieces)))
    exempt = exempt_of(bodies, contact)
    bound = lower_bounds(
        bodies.arm, bodies.mount, bodies.movers, bodies.hulls, hop, exempt, which, within, lower
    )
    best, at = np.inf, (-1, -1)
    near = np.argwhere(lower <= bound + ROUNDING)
    for k, m in near[np.argsort(lower[near[:, 0], near[:, 1]], kind="stable")].tolist():
        if lower[k, m] >= min(best, within):
            break
        distance = _measure(bodies, hop, k, m)[0].distance
        if m < bodies.hulls.world:
            distance -= bodies.clearance
        if distance < min(best, within):
            best, at = distance, (k, m)
    if at[0] < 0:
        return NOTHING
    return _touch(bodies, hop, *at)


def _touch(bodies: Bodies, hop: Hop, k: int, m: int) -> Touch:
    """A solid and the piece of a row at the start of a hop, as told to others."""
    found, T = _measure(bodies, hop, k, m)
    frame = int(bodies.hulls.frame[m])
    on_solid = found.on_axis
    on_other = on_solid - found.distance * found.normal
    kind: Literal["obstacle", "self", "base"] = "obstacle"
    if frame != WORLD:
        kind = "base" if bodies.hulls.owner[m] == BODY else "self"
        seen = _frames(bodies, hop, WORLD)[bodies.robot.all_solids[k].link]
        turn = seen[:3, :3] @ T[:3, :3].T
        on_solid, on_other = (turn @ (p - T[:3, 3]) + seen[:3, 3] for p in (on_solid, on_other))
    other = -1 if kind == "base" else int(bodies.hulls.owner[m])
    return Touch(found.distance, k, kind, other, on_solid, on_other)


def _measure(bodies: Bodies, hop: Hop, k: int, m: int) -> tuple[Separation, Array]:
    """Signed distance of a solid from the piece of a row, and the pose of its link, seen as the row is."""
    solid = bodies.robot.all_solids[k]
    T = _frames(bodies, hop, int(bodies.hulls.frame[m]))[solid.link]
    found = hull_separation(bodies.pieces[m], solid.corners @ T[:3, :3].T + T[:3, 3])
    on_solid = found.on_axis - solid.radius * found.normal
    return Separation(float(found.distance - solid.radius), found.normal, on_solid), T


def _frames(bodies: Bodies, hop: Hop, frame: int) -> Array:
    """Frames at the start of a hop."""
    frames = np.empty((bodies.robot.chain.dof + 2, 4, 4))
    place(bodies.arm, bodies.mount, hop, 0.0, frame, frames)
    return frames


def _swallowed(bodies: Bodies, hop: Hop, exempt: Exempt) -> tuple[int, int, float]:
    """A solid inside a mesh whose surface it does not touch; -1, -1, 1 if there is none.

    While the surface is not touched a solid stays inside or outside, so one look is enough unless the tool
    comes and goes.
    """
    boxes = np.empty((len(bodies.robot.all_solids), 2, 3))
    swept(bodies.arm, bodies.mount, bodies.movers, hop, boxes)
    tool = bodies.arm.tool[:3, 3].copy().reshape(1, 3)
    speed = pace(bodies.arm, bodies.mount, hop, bodies.robot.chain.dof - 1, WORLD, tool)[0]
    for k, link in enumerate(bodies.movers.link.tolist()):
        for m in np.flatnonzero(_meet(bodies.hulls, boxes[k])).tolist():
            mesh, s = bodies.pieces[m].mesh, 0.0
            while mesh is not None and s <= 1.0:
                frames = _frames(bodies, _at(hop, s), WORLD)
                left = exempt_for(exempt, bodies.hulls.owner[m], frames[-2, :3, 3])
                left = left if bodies.movers.outermost[k] else -np.inf
                T, within = frames[link], bodies.movers.corners if left < 0 else bodies.movers.core
                if mesh.contains(T[:3, :3] @ within[bodies.movers.first[k]] + T[:3, 3]):
                    return k, m, s
                s += max(abs(left) / speed if speed > 0 else np.inf, LOOK)
    return -1, -1, 1.0


def _meet(hulls: Hulls, box: Array) -> NDArray[np.bool_]:
    """Rows that bound triangles and whose boxes meet a box."""
    meshes = hulls.next > np.arange(len(hulls.next)) + 1
    meet: NDArray[np.bool_] = (box[0] <= hulls.boxes[:, 1]).all(1) & (hulls.boxes[:, 0] <= box[1]).all(1)
    return meshes & meet


def exempt_of(bodies: Bodies, contact: ContactTargets | None) -> Exempt:
    """What may be touched, and how, as kernels take it."""
    one = _NO_CONTACT if contact is None else contact
    return Exempt(one.spots, one.owner, one.reach, bodies.clearance, bodies.kept_depth)


def _still(base: Array, joints: Array) -> Hop:
    """A hop that goes nowhere."""
    return Hop(base, np.zeros(3), 0.0, joints, np.zeros(len(joints)))


def _at(hop: Hop, s: float) -> Hop:
    """A hop that stays where another one is at part s."""
    return _still(np.array(stand(hop, s)), hop.joints + s * hop.bend)
