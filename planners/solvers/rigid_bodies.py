"""A chain as rigid bodies between points on its axes: the form in which FABRIK-R passes read it.

Body k moves with joint k and carries the axes of joints k and k + 1, or the tool. A joint point may be slid
along its own axis without changing the motion; each axis has its *outer* point, at the common normal with
the axis after it, and its *inner* point, at the common normal with the axis before it, so that hinges and
pivots that meet share their point. Joints count from 0, and point n is the tool's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.worlds.arrays import Array, Index
from regionik.worlds.chain import Chain
from regionik.worlds.prepared import made_once

MAX_PARALLEL_ANGLE = 1e-3  # axes that differ by less than this angle count as parallel [rad]
MAX_MEETING_SHARE = 1e-5  # lengths below this part of the arm's reach count as none


class RigidBodies(NamedTuple):
    """Rigid bodies for kernels; every array has one row a joint."""

    arm: SerialArm
    root: Array  # (3,) outer point of the first axis in the arm's base frame [m]
    # outer, inner: (n, 3) in the frame of link k: from the outer (inner) point of axis k to that of axis k +
    # 1, or to the tool. A prismatic joint adds its travel along its axis.
    outer: Array
    inner: Array
    slide: Array  # (n,) from the inner to the outer point, along the axis [m]
    next_axis: Array  # (n, 3) axis of joint k + 1 in the frame of link k; zeros for the last
    # outward_aim, inward_aim: (n,) the point that joint k points at in a pass, or -1 where eq. (6) decides
    # its turn: then the axis ``..._plane`` must become normal to the line to the point ``..._goal``
    outward_aim: Index
    outward_plane: Index
    outward_goal: Index
    inward_aim: Index
    inward_plane: Index
    inward_goal: Index
    last: int  # the last revolute joint (0 where there is none)
    start_goal: int  # point whose plane the last body takes at the target; -1 where all axes are parallel


@dataclass(frozen=True, eq=False)
class ArmModel:
    """A chain prepared once for kernels; made by `arm_model`."""

    chain: Chain

    @cached_property
    def serial(self) -> SerialArm:
        return serial_arm(self.chain)

    @cached_property
    def pointing(self) -> RigidBodies:
        """Bodies up to the last joint that moves the tool's point: all that a position needs."""
        arm, length = self.serial, span(self.serial)
        count, tool = len(arm.axis), arm.tool
        while count > 1 and arm.revolute[count - 1] and not self.chain.has_mimics:
            p = tool[:3, 3]
            if np.linalg.norm(np.cross(arm.axis[count - 1], p)) > 1e-12 * length:
                break
            tool, count = arm.fixed[count - 1] @ tool, count - 1
        parts = {key: part[:count] for key, part in arm._asdict().items() if key != "tool"}
        return bodies_of(arm._replace(tool=tool, **parts))

    @cached_property
    def posing(self) -> RigidBodies:
        """All bodies: what a tool direction or orientation needs."""
        return bodies_of(self.serial)


@made_once
def arm_model(chain: Chain) -> ArmModel:
    """Prepare a chain; kept for the last few."""
    return ArmModel(chain)


def bodies_of(arm: SerialArm) -> RigidBodies:
    """Slide the joint points and decide each joint's rule (paper 001, Algorithms 1 and 2)."""
    n = len(arm.axis)
    after = [arm.fixed[k + 1] if k + 1 < n else arm.tool for k in range(n)]
    next_axis = np.array([after[k][:3, :3] @ arm.axis[k + 1] if k + 1 < n else np.zeros(3) for k in range(n)])
    out, inn = _slides(arm, after, next_axis)
    ends = np.array([after[k][:3, 3] for k in range(n)])
    outer, inner = ends - out[:, None] * arm.axis, ends - inn[:, None] * arm.axis
    outer[:-1] += out[1:, None] * next_axis[:-1]
    inner[:-1] += inn[1:, None] * next_axis[:-1]
    root = arm.fixed[0][:3, 3] + arm.fixed[0][:3, :3] @ arm.axis[0] * out[0]
    outward = np.array([_rule(arm, next_axis, outer, out - inn, k, 1) for k in range(n)])
    inward = np.array([_rule(arm, next_axis, inner, out - inn, k, -1) for k in range(n)])
    last = max((k for k in range(n) if arm.revolute[k]), default=0)
    goal = _concurrent(arm, next_axis, inner, last, -1)
    turns = [k for k in range(last) if arm.revolute[k]]
    planar = all(_parallel(arm, next_axis, k) for k in turns) and len(turns) == last
    first = -1 if planar else goal
    rules = [np.ascontiguousarray(column) for column in (*outward.T, *inward.T)]
    return RigidBodies._make([arm, root, outer, inner, out - inn, next_axis, *rules, last, first])


def span(arm: SerialArm) -> float:
    """Length of the arm laid straight, joint origin to joint origin; 1 for an arm without length [m]."""
    length = float(np.linalg.norm(arm.fixed[1:, :3, 3], axis=1).sum() + np.linalg.norm(arm.tool[:3, 3]))
    return length if length > 0 else 1.0


def _slides(arm: SerialArm, after: list[Array], next_axis: Array) -> tuple[Array, Array]:
    """Outer and inner point of every axis, as distances along it from the joint's origin."""
    n, length = len(arm.axis), span(arm)
    out, inn = np.zeros(n), np.full(n, np.nan)
    for k in range(n - 1, -1, -1):
        if not arm.revolute[k]:
            continue
        u, p = arm.axis[k], after[k][:3, 3]
        end = p if k == n - 1 else p + out[k + 1] * next_axis[k]
        out[k] = u @ end
        if (
            k < n - 1
            and arm.revolute[k + 1]
            and np.linalg.norm(np.cross(u, next_axis[k])) > MAX_PARALLEL_ANGLE
        ):
            c = u @ next_axis[k]
            here, there = np.array([[1, -c], [c, -1]]) @ [u @ p, next_axis[k] @ p] / (1 - c * c)
            # Nearly parallel axes meet far away: such a point would only amplify rounding.
            if max(abs(here), abs(there)) < 2 * length:
                out[k], inn[k + 1] = here, there
    return out, np.where(np.isnan(inn), out, inn)


def _parallel(arm: SerialArm, next_axis: Array, k: int) -> bool:
    """True where axes k and k + 1, both revolute, are parallel."""
    return bool(np.linalg.norm(np.cross(arm.axis[k], next_axis[k])) <= MAX_PARALLEL_ANGLE)


def _rule(
    arm: SerialArm, next_axis: Array, links: Array, slide: Array, k: int, way: int
) -> tuple[int, int, int]:
    """Rule by which joint k turns, outward (``way`` 1) or inward (-1): its aim, plane and goal."""
    n, length = len(arm.axis), span(arm)
    last = n if way > 0 else 0
    if k == last:
        return last, -1, -1
    g = k + way
    slid = not arm.revolute[k]
    while g not in (last, n) and not arm.revolute[g]:
        g, slid = g + way, True
    if g in (last, n):
        return g, -1, -1
    if slid:
        turn = np.eye(3)
        lo, hi = min(k, g), max(k, g)
        for i in range(lo + 1, hi + 1):
            turn = turn @ arm.fixed[i][:3, :3]
        parallel = bool(np.linalg.norm(np.cross(arm.axis[lo], turn @ arm.axis[hi])) <= MAX_PARALLEL_ANGLE)
    else:
        body = k if way > 0 else g
        parallel = _parallel(arm, next_axis, body)
        # The link lies along the next pivot's axis: the pivot must point, it cannot turn the link.
        own = links[body] - slide[g] * (next_axis[body] if way > 0 else arm.axis[body])
        if np.linalg.norm(own) < MAX_MEETING_SHARE * length and abs(slide[g]) > MAX_MEETING_SHARE * length:
            return g, -1, -1
    return (g, -1, -1) if parallel else (-1, g, _concurrent(arm, next_axis, links, g, way))


def _concurrent(arm: SerialArm, next_axis: Array, links: Array, i: int, way: int) -> int:
    """Algorithm 2, FIND_CONCURRENT: the first point beyond i, and off it, that lies on a differing axis."""
    n, length = len(arm.axis), span(arm)
    last = n if way > 0 else 0
    differs, apart, j = False, False, i
    while j != last:
        body = j if way > 0 else j - 1
        apart = (
            apart or bool(np.linalg.norm(links[body]) > MAX_MEETING_SHARE * length) or not arm.revolute[body]
        )
        j += way
        if j == n:
            break
        if arm.revolute[j] and not differs:
            differs = not (arm.revolute[j - way] and _parallel(arm, next_axis, body))
        if differs and apart:
            break
    return j
