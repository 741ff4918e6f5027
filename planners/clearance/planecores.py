"""The capsules inside an arm's links, as links of its plane hold them."""

from __future__ import annotations

import numpy as np

from regionik.planners.clearance.planehits import LAST, MIDDLE, PIVOT, UPPER, Cores
from regionik.planners.clearance.provable import inner_capsule
from regionik.planners.geometry.collision import obstacles_from
from regionik.planners.geometry.upright import depths, uprights_from
from regionik.worlds.arrays import Array
from regionik.worlds.planar_arm import PlanarArm
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import BODY, base_body, self_collision_pairs


def cores_of(robot: Robot, arm: PlanarArm) -> Cores:
    """Capsules inside the solids of an arm in one plane.

    Boxes count as the capsules inside them. What turns about the last link counts as what it covers at every
    turn, and solids fixed to the base, other than its own body, count as nothing.

    Parameters
    ----------
    robot : Robot
    arm : PlanarArm
        Its chain in the plane.

    Returns
    -------
    Cores
    """
    last = max(solid.link for solid in robot.all_solids)
    frames, anchors = _reference(robot, arm)
    rank: list[int] = []
    ends: list[Array] = []
    radius: list[float] = []
    outermost: list[bool] = []
    index: dict[int, int] = {}
    for k, solid in enumerate(robot.solids):
        core = inner_capsule(solid)
        held = min(solid.link, LAST)
        turn, anchor = anchors[held]
        points = core.corners @ frames[solid.link, :3, :3].T + frames[solid.link, :3, 3] - anchor
        placed, thick = points @ turn.T, core.radius
        if arm.roll is not None and solid.link >= arm.roll:
            thick -= float(np.linalg.norm(placed[:, 1:], axis=1).max())
            placed[:, 1:] = 0.0
        if thick > 0.0:
            index[k] = len(rank)
            rank.append(held)
            ends.append(placed)
            radius.append(thick)
            outermost.append(solid.link == last)
    pairs = [(index[i], index[k]) for i, k in self_collision_pairs(robot) if i in index and k in index]
    heeds = [index[k] for i, k in self_collision_pairs(robot) if i == BODY and k in index]
    body = base_body(robot)
    block = uprights_from(obstacles_from([] if body is None else [body]).pieces)
    return Cores(
        np.array(rank, dtype=np.int64),
        np.array(ends, dtype=np.float64).reshape(-1, 2, 3),
        np.array(radius, dtype=np.float64),
        np.array(outermost, dtype=np.bool_),
        np.array(pairs, dtype=np.int64).reshape(-1, 2),
        np.array(heeds, dtype=np.int64),
        block,
        depths(block),
    )


def _reference(robot: Robot, arm: PlanarArm) -> tuple[Array, dict[int, tuple[Array, Array]]]:
    """Link frames of some posture in the arm's base frame, and how each link of the plane lies there.

    A link lies with its anchor at a point; the rows of its matrix run along it, square to it in the plane,
    and off the plane.
    """
    joints = robot.carry.copy()
    joints[0] = 0.0
    frames = robot.chain.frames(joints)
    cos, sin = np.cos(arm.pivot_zero), np.sin(arm.pivot_zero)
    out, off, up = np.array([cos, sin, 0.0]), np.array([-sin, cos, 0.0]), np.array([0.0, 0.0, 1.0])
    floor = -robot.mount[2] * up
    anchors = {PIVOT: (np.array([out, up, off]), floor)}
    at = {UPPER: frames[1, :3, 3], MIDDLE: frames[3, :3, 3], LAST: frames[-1, :3, 3]}
    for rank, angle in zip((UPPER, MIDDLE, LAST), np.cumsum(arm.bends(joints)), strict=True):
        along = np.cos(angle) * out + np.sin(angle) * up
        across = -np.sin(angle) * out + np.cos(angle) * up
        anchors[rank] = np.array([along, across, off]), at[rank]
    return frames, anchors
