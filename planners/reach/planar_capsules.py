"""Collision bounds of an arm in one plane that hold all over a cell of its postures.

Both ends of a capsule stay within a bound of where they are in the middle of the cell: on the last link the
capsule turns about the tool, on the middle link about the wrist, on the first link about the shoulder, and
with the plane about the target or the pivot axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.convex_bodies import inner_capsule
from regionik.planners.collision.distances import obstacles_from
from regionik.planners.collision.upright_solids import (
    Uprights,
    distance_along,
    inradii,
    least_along,
    uprights_from,
)
from regionik.planners.geometry.vectors import minus, norm
from regionik.planners.kernels import compiled
from regionik.planners.reach.planar_cells import (
    AWAY,
    PITCH,
    TURN,
    YAW,
    ArmMount,
    PlanarCell,
    chord,
)
from regionik.planners.search.box_search import PROOF_SLACK, Verdict, both
from regionik.planners.search.posture_boxes import segment_distance
from regionik.planners.solvers.planar_kinematics import PlanarLinkage
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import BODY, base_body, off_floor, self_collision_pairs

PIVOT, UPPER, MIDDLE, LAST = range(4)  # which link of the plane carries a capsule
SECTIONS = 6  # golden sections along a capsule where a proof is sought
FROM_TARGET, FROM_AXIS = range(2)  # where the motion of a capsule is seen from


class PlaneCapsules(NamedTuple):
    """The capsules of an arm, held by links of its plane."""

    rank: Index  # (s,) `PIVOT`, `UPPER`, `MIDDLE` or `LAST`
    ends: Array  # (s, 2, 3) along the link, square to it in the plane, and off the plane, from its anchor [m]
    radius: Array  # (s,) [m]
    outermost: Mask  # (s,) of the last link that has a solid
    off_floor: Mask  # (s,) that must keep off the floor
    pairs: Index  # (p, 2) capsules that may touch each other
    heeds: Index  # (h,) capsules that may touch the base
    body: Uprights  # the base's own body, in its frame
    deep: Array  # (b,) upper bounds of how far a point of its parts is inside [m]


class NearObstacles(NamedTuple):
    """The obstacles that an arm keeps off near a target."""

    solids: Uprights
    deep: Array  # (m,) upper bounds of how far a point of a solid is inside [m]
    near: Index  # (k,) which of them matter
    owner: Index  # (m,) obstacle that each solid is part of
    floor: int  # obstacle that is the floor, -1 for none
    tool_on: int  # obstacle that the outermost capsules may touch, -1 for none
    clearance: float  # [m]
    tolerance: float  # how far the tool may be off the target [m]


def plane_capsules(robot: Robot, arm: PlanarArm) -> PlaneCapsules:
    """Read the capsules inside the solids of a robot whose arm lies in one plane.

    Boxes count as the capsules inside them. What turns about the last link counts as what it covers at every
    turn, and solids fixed to the base, other than its own body, count as nothing.
    """
    last = max(solid.link for solid in robot.all_solids)
    frames, anchors = _reference(robot, arm)
    rows: list[tuple[int, Array, float, bool, bool]] = []
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
            index[k] = len(rows)
            rows.append((held, placed, thick, solid.link == last, off_floor(robot)[k]))
    pairs = [(index[i], index[k]) for i, k in self_collision_pairs(robot) if i in index and k in index]
    heeds = [index[k] for i, k in self_collision_pairs(robot) if i == BODY and k in index]
    body = base_body(robot)
    block = uprights_from(obstacles_from([] if body is None else [body]).pieces)
    return PlaneCapsules(
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.float64).reshape(-1, 2, 3),
        np.array([row[2] for row in rows], dtype=np.float64),
        np.array([row[3] for row in rows], dtype=np.bool_),
        np.array([row[4] for row in rows], dtype=np.bool_),
        np.array(pairs, dtype=np.int64).reshape(-1, 2),
        np.array(heeds, dtype=np.int64),
        block,
        inradii(block),
    )


def _reference(robot: Robot, arm: PlanarArm) -> tuple[Array, dict[int, tuple[Array, Array]]]:
    """Link frames of some posture in the arm's base frame, and the pose of each link of the plane there.

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


@compiled
def swung(move: float, level: float, off: float, turned: float) -> float:
    """Upper bound of the way of a point that moves in a plane while that turns about a vertical axis [m].

    The two are square to each other, but for what the turn goes inwards, and for how far off the plane the
    point is.
    """
    across = level * turned
    square = move * move + across * across + move * turned * (across + 2.0 * off)
    return math.sqrt(square)


@compiled
def place_capsules(
    capsules: PlaneCapsules, plane: PlanarLinkage, z: float, whole: bool, cell: PlanarCell
) -> None:
    """Write where capsules lie in the middle of a cell, and how far they move; ``whole`` if links meet."""
    half, vary, away = cell.half, cell.vary, cell.middle[AWAY]
    a, c = plane.lengths[0], plane.lengths[2]
    at_last = c * chord(vary[2])
    for s in range(len(capsules.rank)):
        rank = capsules.rank[s]
        r, up, angle = 0.0, 0.0, 0.0
        if rank == UPPER:
            r, up, angle = plane.shoulder_r, plane.shoulder_z, cell.bends[0]
        elif rank == MIDDLE:
            angle = cell.bends[1]
            r, up = away - c * math.cos(cell.bends[2]), z - c * math.sin(cell.bends[2])
        elif rank == LAST:
            r, up, angle = away, z, cell.bends[2]
        cos, sin = math.cos(angle), math.sin(angle)
        for e in range(2):
            along, across = capsules.ends[s, e, 0], capsules.ends[s, e, 1]
            cell.points[s, e, 0] = r + cos * along - sin * across
            cell.points[s, e, 1] = up + sin * along + cos * across
            cell.points[s, e, 2] = capsules.ends[s, e, 2]
            lever = math.sqrt(along * along + across * across)
            from_target, from_axis = half[AWAY], 0.0
            if rank == UPPER:
                from_axis = lever * chord(vary[0])
                from_target = half[AWAY] + from_axis
            elif rank == MIDDLE:
                from_target = at_last + lever * chord(vary[1])
                from_axis = half[AWAY] + from_target
                if whole:  # as a point beyond the elbow
                    beyond = np.hypot(along + plane.lengths[1], across)
                    from_axis = min(from_axis, a * chord(vary[0]) + beyond * chord(vary[1]))
            elif rank == LAST:
                from_target = lever * chord(vary[2])
                from_axis = half[AWAY] + from_target
            cell.moves[s, e, FROM_TARGET], cell.moves[s, e, FROM_AXIS] = from_target, from_axis


@compiled
def _judge_pair(
    solids: Uprights, deep: Array, k: int, ends: Array, moves: Array, reach: float
) -> tuple[Verdict, bool]:
    """Judge whether a segment (2, 3) whose ends may move so far (2,) keeps at least ``reach`` off a solid.

    RULED_OUT where it does not however they move, PROVEN where it does in the middle; and whether that holds
    all over the cell.
    """
    a, b, at_a, at_b = ends[0], ends[1], moves[0], moves[1]
    most = max(at_a, at_b)
    half = 0.5 * norm(minus(b, a))
    if distance_along(solids, k, a, b, 0.5) - half >= reach + most:
        return Verdict.PROVEN, True
    if min(at_a, at_b) >= reach + deep[k]:
        return Verdict.OPEN, False  # too wide a cell to tell
    off = least_along(solids, k, a, b, 0.0, 0.0, reach, reach + most, SECTIONS)
    if off >= reach:
        return Verdict.PROVEN, off >= reach + most
    if least_along(solids, k, a, b, at_a, at_b, reach, reach, SECTIONS) < reach:
        return Verdict.RULED_OUT, True
    return Verdict.OPEN, False


@compiled
def _widen(
    rank: int, plane: PlanarLinkage, cell: PlanarCell, s: int, seen: int, hit: bool, turn: tuple[int, float]
) -> None:
    """Widen the sides of a cell that leave open where a capsule is.

    ``turn`` is the side that turns it out of its plane, and the chord of that turn. Where the capsule is hit
    in the middle, the end that moves less is the one to be shown to be hit everywhere.
    """
    pitch, away = plane.lengths[2] * chord(cell.half[PITCH]), cell.half[AWAY]
    e = 0 if (cell.moves[s, 0, seen] < cell.moves[s, 1, seen]) == hit else 1
    move, known = cell.moves[s, e, seen], 0.0  # what of it comes from the pitch alone
    if rank == PIVOT:
        pitch = 0.0
    elif seen == FROM_TARGET and rank != UPPER:
        known = move if rank == LAST else min(pitch, move)
    share = away / (away + pitch) if away + pitch > 0.0 else 0.0
    r = cell.points[s, e, 0] - (cell.middle[AWAY] if seen == FROM_TARGET else 0.0)
    cell.open[AWAY] = max(cell.open[AWAY], (move - known) * share)
    cell.open[PITCH] = max(cell.open[PITCH], known + (move - known) * (1.0 - share))
    side, turned = turn
    cell.open[side] = max(cell.open[side], turned * np.hypot(r, cell.points[s, e, 2]))


@compiled
def _turn_capsule(
    cell: PlanarCell,
    s: int,
    seen: int,
    axis: tuple[float, float, float],
    turn: tuple[float, float],
    ends: Array,
    moves: Array,
) -> None:
    """Write a capsule's ends (2, 3) with its plane turned about a vertical axis, and how far they move (2,).

    ``axis`` is its x, y, and its distance along the plane; ``turn`` the angle, and the chord of how far that
    may be off.
    """
    x, y, away = axis
    angle, turned = turn
    cos, sin = math.cos(angle), math.sin(angle)
    for e in range(2):
        r, w = cell.points[s, e, 0] - away, cell.points[s, e, 2]
        ends[e, 0], ends[e, 1] = x + cos * r - sin * w, y + sin * r + cos * w
        ends[e, 2] = cell.points[s, e, 1]
        moves[e] = swung(cell.moves[s, e, seen], np.hypot(r, w), abs(w), turned)


@compiled
def judge_obstacles(
    capsules: PlaneCapsules, plane: PlanarLinkage, around: NearObstacles, target: Array, cell: PlanarCell
) -> Verdict:
    """Judge whether the capsules keep their distance from obstacles."""
    mid, turned = cell.middle, chord(cell.half[YAW])
    ends, moves, verdict = np.empty((2, 3)), np.empty(2), Verdict.PROVEN
    for s in range(len(capsules.rank) - 1, -1, -1):
        axis = target[0], target[1], mid[AWAY]
        _turn_capsule(cell, s, FROM_TARGET, axis, (mid[YAW], turned), ends, moves)
        moves += around.tolerance
        for k in around.near:
            if capsules.outermost[s] and around.owner[k] == around.tool_on:
                continue
            if around.owner[k] == around.floor and not capsules.off_floor[s]:
                continue
            reach = capsules.radius[s] + around.clearance - PROOF_SLACK
            one, all_over = _judge_pair(around.solids, around.deep, k, ends, moves, reach)
            if one == Verdict.RULED_OUT:
                return Verdict.RULED_OUT
            if not all_over:
                _widen(capsules.rank[s], plane, cell, s, FROM_TARGET, one == Verdict.OPEN, (YAW, turned))
            verdict = both(verdict, one)
    return verdict


@compiled
def judge_self(capsules: PlaneCapsules, mount: ArmMount, cell: PlanarCell) -> Verdict:
    """Judge whether the capsules keep off each other and off the base."""
    verdict = _judge_self_pairs(capsules, mount.plane, cell)
    if verdict == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    turn, turned = cell.middle[TURN] + mount.zero, chord(cell.half[TURN])
    ends, moves = np.empty((2, 3)), np.empty(2)
    for s in capsules.heeds:
        axis = mount.mount[0], mount.mount[1], 0.0
        _turn_capsule(cell, s, FROM_AXIS, axis, (turn, turned), ends, moves)
        for m in range(len(capsules.body.disc)):
            reach = capsules.radius[s] - PROOF_SLACK
            one, all_over = _judge_pair(capsules.body, capsules.deep, m, ends, moves, reach)
            if one == Verdict.RULED_OUT:
                return Verdict.RULED_OUT
            if not all_over:
                rank = capsules.rank[s]
                _widen(rank, mount.plane, cell, s, FROM_AXIS, one == Verdict.OPEN, (TURN, turned))
            verdict = both(verdict, one)
    return verdict


@compiled
def _judge_self_pairs(capsules: PlaneCapsules, plane: PlanarLinkage, cell: PlanarCell) -> Verdict:
    verdict = Verdict.PROVEN
    for i, k in capsules.pairs:
        off = segment_distance(cell.points[i, 0], cell.points[i, 1], cell.points[k, 0], cell.points[k, 1])
        off -= capsules.radius[i] + capsules.radius[k] - PROOF_SLACK
        least = np.inf
        for seen in range(2):
            one = max(cell.moves[i, 0, seen], cell.moves[i, 1, seen])
            least = min(least, one + max(cell.moves[k, 0, seen], cell.moves[k, 1, seen]))
        if off + least < 0.0:
            return Verdict.RULED_OUT
        if off < least:
            _widen(capsules.rank[i], plane, cell, i, FROM_TARGET, False, (TURN, 0.0))
            _widen(capsules.rank[k], plane, cell, k, FROM_TARGET, False, (TURN, 0.0))
            verdict = Verdict.OPEN if off < 0.0 else verdict
    return verdict
