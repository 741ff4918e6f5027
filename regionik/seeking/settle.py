"""Many bare points at once: those that compiled loops decide, by the areas that single ones are decided by.

They know arms in one plane. Every place of an inner floor works, so a place found there is an answer; where
the reach meets no place of any outer floor there is none. What lies between, in the last millimetres of reach
or floor, and what the arm's obstacles leave in doubt, stays open.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from regionik.areas.ground import Side, ground_of
from regionik.areas.standing import Standing, anywhere, by_heading, outer_by_heading
from regionik.planners.clearance.bulkreach import find, meet, near_boxes
from regionik.planners.geometry.collision import obstacles_from, solids_within
from regionik.postures.guard import guard_of
from regionik.seeking.flatworld import floor_of, keep_of, reach_of, stance_of
from regionik.worlds.arrays import Array
from regionik.worlds.planar_arm import is_planar, planar_arm
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
        meet(stance_of(world, side.span), reach_of(world), floor_of(side), targets, state)
    return state


def _look(world: World, standing: Standing, targets: Array, kind: Kinds, base: Array, joints: Array) -> None:
    """Look for configurations of those that are open, side by side, and confirm them."""
    rows = np.flatnonzero(kind == OPEN)
    asked, owners, found = targets[rows], _owners(world, targets[rows]), np.zeros(len(rows), dtype=bool)
    bases, q = np.full((len(rows), 3), np.nan), np.full((len(rows), joints.shape[1]), np.nan)
    for side in standing.sides:
        stance = stance_of(world, side.span)
        find(stance, reach_of(world), floor_of(side), keep_of(world), asked, owners, found, bases, q)
    for some in np.array_split(np.flatnonzero(found), max(1, -(-len(rows) // CHUNK))):
        found[some] = _confirmed(world, asked[some], bases[some], q[some])
    kind[rows[found]] = REACHED
    base[rows[found]], joints[rows[found]] = bases[found], q[found]


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
