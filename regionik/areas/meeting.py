"""What the criteria of a world leave of the reach of its arm."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from regionik.areas.demand import in_plane
from regionik.planners.reach.paving import paved
from regionik.planners.solvers.planar_arm import LIMIT_SLACK, PlaneArm
from regionik.planners.solvers.posture_criteria import Thresholds, posture_spare, thresholds_of
from regionik.worlds.arrays import Array
from regionik.worlds.criteria import Criteria, kept
from regionik.worlds.errors import InputError
from regionik.worlds.pivot import is_planar
from regionik.worlds.planar import planar_arm
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target, World

Index = NDArray[np.intp]
Rows = tuple[tuple[float, float], ...]


def narrowed(world: World) -> World:
    """The world with the limits that the asked joint margin leaves to its arm."""
    robot = kept(world.robot, world.rules.criteria)
    return world if robot is world.robot else replace(world, robot=robot)


def asked_in(robot: Robot, criteria: Criteria | None) -> tuple[Thresholds, Thresholds] | None:
    """What criteria ask of an arm besides its limits, `thresholds_of` it; None where that is nothing.

    Raises
    ------
    InputError
        Where that is anything and the arm does not work in one plane.
    """
    if criteria is None or (not criteria.manipulability and criteria.effort is None):
        return None
    criteria.check(robot)
    if not is_planar(robot.chain):
        raise InputError(
            f"criteria: {robot.name} does not work in one vertical plane: manipulability and effort are "
            "known for such arms only, valid choices: joint_margin"
        )
    return thresholds_of(robot, criteria)


def distances(
    world: World, pitches: tuple[float, float], heights: Array, owner: Index, reach: Array, *, inner: bool
) -> tuple[Index, Array]:
    """Spans of signed distance within reach, cut to those whose postures meet the criteria together.

    Parameters
    ----------
    world : World
        `narrowed`; its arm works in one plane.
    pitches : (low, high)
        Angles that the last link may take in the plane [rad].
    heights : (n,) array
        Of the tool over the floor [m].
    owner : (m,) array of int
        Height of each span, ascending.
    reach : (m, 2) array
        Without criteria [m].
    inner : bool
        Whether to give what is proven, or what is not ruled out.

    Returns
    -------
    owner : (k,) array of int
    reach : (k, 2) array
    """
    asked = asked_in(world.robot, world.rules.criteria)
    criteria = world.rules.criteria
    if asked is None or criteria is None:
        return owner, reach
    side = 0 if inner or asked[0] is asked[1] else 1
    bounds = np.searchsorted(owner, np.arange(len(heights) + 1)).tolist()
    found = [np.empty((0, 2))]
    for z, a, b in zip(heights.tolist(), bounds[:-1], bounds[1:], strict=True):
        known = tuple((low, high) for low, high in reach[a:b].tolist())
        found.append(_cut(world.robot, criteria, side, pitches, z, known)[0 if inner else 1])
    return np.repeat(np.arange(len(heights)), [len(rows) for rows in found[1:]]), np.concatenate(found)


@lru_cache(maxsize=4096)
def _cut(
    robot: Robot, criteria: Criteria, side: int, pitches: tuple[float, float], z: float, known: Rows
) -> tuple[Array, Array]:
    asked = thresholds_of(robot, criteria)[side]
    return paved(plane_of(robot), asked, pitches, z, np.array(known).reshape(-1, 2))


def meets(robot: Robot, criteria: Criteria | None, joints: Array) -> bool:
    """Whether a posture (dof,) meets criteria at any roll."""
    asked = asked_in(robot, criteria)
    limits = kept(robot, criteria).chain
    over = (joints < limits.lower - LIMIT_SLACK) | (joints > limits.upper + LIMIT_SLACK)
    if limits is not robot.chain and over.any():
        return False
    if asked is None:
        return True
    bends = planar_arm(robot.chain).bends(joints)
    return bool(posture_spare(plane_of(robot), asked[0], bends) >= 0.0)


@lru_cache(maxsize=64)
def plane_of(robot: Robot) -> PlaneArm:
    """An arm in one plane as kernels take it, heights counted from the floor."""
    arm = planar_arm(robot.chain)
    shoulder = float(arm.shoulder[0]), float(arm.shoulder[1] + robot.mount[2])
    return PlaneArm(*shoulder, arm.lengths, arm.lower, arm.upper)


def refuse(world: World, target: Target) -> None:
    """Refuse a target whose criteria cannot be bounded: one that asks the tool across the arm's plane."""
    criteria = world.rules.criteria
    if asked_in(world.robot, criteria) is not None and not in_plane(world.robot.chain, target):
        raise InputError(
            "criteria: a target with a direction needs a tool along the last link for manipulability and "
            "effort, valid choices: joint_margin"
        )
