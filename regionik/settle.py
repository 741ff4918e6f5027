"""Many bare points at once: those that compiled loops decide, by the areas that single ones are decided by.

They know arms in one plane. Every place of an inner floor works, so a place found there is an answer; where
the reach meets no place of any outer floor there is none. What lies between, in the last millimetres of reach
or floor, and what the arm's obstacles leave in doubt, stays open.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from regionik.ground import EVERY, Side, ground_of
from regionik.guard import SPARE, guard_of
from regionik.planners.bulkreach import Keep, Reach, Stance, find, meet, near_boxes
from regionik.planners.collision import obstacles_from, solids_within
from regionik.planners.kernels import PlaneArm
from regionik.planners.ringfloor import Parts, parts_of
from regionik.planners.rings import boundary_circles
from regionik.standing import Standing, anywhere, by_heading, outer_by_heading
from regionik.worlds.arrays import Array
from regionik.worlds.pivot import is_planar
from regionik.worlds.planar import planar_arm
from regionik.worlds.scene import World

CHUNK = 20_000  # configurations that are confirmed together
SLACK = 1e-9  # rounding allowed at a bound [m] or [rad]

REACHED, NO_POSTURE, NO_FLOOR, CROWDED, OPEN = range(5)  # what becomes of a target
WHY = {
    NO_POSTURE: "It cannot be reached from anywhere: at its height no posture within limits brings the tool "
    "of {robot} there, wherever the base stands.",
    NO_FLOOR: "It cannot be reached from the floor: the arm of {robot} does not reach that far from the "
    "places where the base may stand.",
    CROWDED: "It cannot be reached: wherever the arm of {robot} could reach it from, the base is nearer to "
    "an obstacle than its clearance of {clearance:.3f} m, or off the floor.",
}

Kinds = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Settled:
    """What the loops came to.

    Attributes
    ----------
    kind : (n,) array of int
        `REACHED`; or `NO_POSTURE`, `NO_FLOOR`, `CROWDED` where there is proven to be no place; or `OPEN`.
    base : (n, 3) array
        NaN where there is none.
    joints : (n, dof) array
    """

    kind: Kinds
    base: Array
    joints: Array


@lru_cache(maxsize=8)
def is_covered(world: World) -> bool:
    """Whether the loops know the world's robot and rules: no criteria, no heading that binds the pivot."""
    chain = world.robot.chain
    if not is_planar(chain) or world.rules.criteria is not None:
        return False
    arm = planar_arm(chain)
    return world.rules.heading != "fixed" or arm.pivot_upper - arm.pivot_lower >= 2 * np.pi


def settled(world: World, positions: Array) -> Settled:
    """Decide points (n, 3) of a world that `is_covered`, as far as that is quickly done."""
    targets = np.array(positions, dtype=np.float64)
    kind = _ruled_out(world, targets)
    base, joints = np.full((len(targets), 3), np.nan), np.full((len(targets), world.robot.chain.dof), np.nan)
    _look(world, anywhere(world), targets, kind, base, joints)
    if by_heading(world) is not anywhere(world) and (kind == OPEN).any():
        _look(world, by_heading(world), targets, kind, base, joints)
        left = np.flatnonzero(kind == OPEN)
        shut = _state(world, outer_by_heading(world), targets[left]) < 2
        kind[left[shut]] = CROWDED
    return Settled(kind, base, joints)


def reasons(world: World, kind: Kinds) -> list[str]:
    """Why targets that are ruled out are, one for each kind of `Settled`; empty for others."""
    name, clearance = world.robot.name, world.rules.clearance
    known = {one: text.format(robot=name, clearance=clearance) for one, text in WHY.items()}
    return [known.get(one, "") for one in kind.tolist()]


def _ruled_out(world: World, targets: Array) -> Kinds:
    """What no place for the circle inside the footprint reaches; `OPEN` where that is not proven."""
    cut, whole = _outer(world)
    state = _state(world, cut, targets)
    away = np.flatnonzero(state == 1)
    bare = _state(world, whole, targets[away])
    kind = np.array([NO_POSTURE, NO_FLOOR, OPEN])[state]
    kind[away[bare == 2]] = CROWDED
    return kind


@lru_cache(maxsize=8)
def _outer(world: World) -> tuple[Standing, Standing]:
    """Where the circle inside the footprint may be, with obstacles and without."""
    outer = ground_of(world).outer
    return Standing((outer,)), Standing((Side(outer.floor, np.empty(0, dtype=object)),))


def _state(world: World, standing: Standing, targets: Array) -> Kinds:
    """0 where no posture reaches a target's height, 1 where none does from the floor of any side, else 2."""
    state = np.zeros(len(targets), dtype=np.int64)
    for side in standing.sides:
        meet(_stance(world, side.span), _reach(world), _parts(side), targets, state)
    return state


def _look(world: World, standing: Standing, targets: Array, kind: Kinds, base: Array, joints: Array) -> None:
    """Look for configurations of those that are open, side by side, and confirm them."""
    rows = np.flatnonzero(kind == OPEN)
    asked, owners, found = targets[rows], _owners(world, targets[rows]), np.zeros(len(rows), dtype=bool)
    bases, q = np.full((len(rows), 3), np.nan), np.full((len(rows), joints.shape[1]), np.nan)
    for side in standing.sides:
        stance = _stance(world, side.span)
        find(stance, _reach(world), _parts(side), _keep(world), asked, owners, found, bases, q)
    for some in np.array_split(np.flatnonzero(found), max(1, -(-len(rows) // CHUNK))):
        found[some] = _confirmed(world, asked[some], bases[some], q[some])
    kind[rows[found]] = REACHED
    base[rows[found]], joints[rows[found]] = bases[found], q[found]


@lru_cache(maxsize=128)
def _stance(world: World, span: tuple[float, float]) -> Stance:
    """How the robot stands with its heading in a span."""
    robot, arm = world.robot, planar_arm(world.robot.chain)
    low, high = arm.pivot_lower, arm.pivot_upper
    if world.rules.heading == "face_target":
        low = high = min(max(0.0, low), high)
    shoulder = float(arm.shoulder[0]), float(arm.shoulder[1] + robot.mount[2])
    plane = PlaneArm(*shoulder, *map(_own, (arm.lengths, arm.lower, arm.upper)))
    zero, yaw, turn = float(arm.pivot_zero + robot.mount[3]), 0.0, np.inf
    if world.start is not None:
        yaw = float(world.start.base[2])
    if span != EVERY:
        yaw, turn = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    sign, offset, mount, carry = map(_own, (arm.sign, arm.offset, robot.mount[:2], robot.carry))
    return Stance(plane, sign, offset, zero, low, high, mount, yaw, turn + SLACK, carry)


@lru_cache(maxsize=8)
def _reach(world: World) -> Reach:
    arm = planar_arm(world.robot.chain)
    circles = boundary_circles(arm, float(arm.shoulder[1] + world.robot.mount[2]))
    return Reach(_own(circles[:, :2]), _own(circles[:, 2]), world.rules.reach_margin)


@lru_cache(maxsize=8)
def _keep(world: World) -> Keep:
    guard, bodies = guard_of(world), guard_of(world).bodies
    return Keep(bodies.arm, _own(bodies.mount), bodies.movers, bodies.hulls, SPARE, guard.on)


def _own(values: Array) -> Array:
    """A copy that kernels take: writable and in order, so that they are compiled once."""
    return np.array(values, dtype=np.float64, order="C")


@lru_cache(maxsize=256)
def _parts(side: Side) -> Parts:
    parts = shapely.get_parts(side.free)
    return parts_of([part for part in parts if isinstance(part, Polygon) and part.area > 0])


def _owners(world: World, targets: Array) -> NDArray[np.int64]:
    """Obstacle that the last link may touch at each target, -1 for none."""
    owners = np.full(len(targets), -1, dtype=np.int64)
    hulls, by = guard_of(world).bodies.hulls, world.rules.tool_contact
    near = np.zeros(len(targets), dtype=bool)
    near_boxes(hulls.boxes[: hulls.world], targets, by, near)
    obstacles = obstacles_from(world.solids)
    for i in np.flatnonzero(near & (by > 0)).tolist():
        owners[i] = next((k for _, k in solids_within(obstacles, targets[i], by)), -1)
    return owners


def _confirmed(world: World, targets: Array, base: Array, joints: Array) -> NDArray[np.bool_]:
    """Whether tools are on their targets with joints within limits, by forward kinematics."""
    chain = world.robot.chain
    error = np.linalg.norm(world.robot.tool(base, joints)[:, :3, 3] - targets, axis=1)
    within = (joints >= chain.lower - SLACK) & (joints <= chain.upper + SLACK)
    good: NDArray[np.bool_] = (error <= world.rules.tolerance + SLACK) & within.all(1)
    return good
