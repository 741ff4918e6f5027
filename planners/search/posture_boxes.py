"""Judge of boxes of joint values of an arm on a fixed base: is there a free posture on target?

A box is ruled out when the tool cannot reach the target anywhere in it, or when one capsule of the arm hits
one obstacle, another capsule or the base everywhere in it. What is left is contracted by the reach condition
and tried for a posture from its centre.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.collision.robot_motion import transform_into
from regionik.planners.collision.upright_solids import Uprights, distance_along, least_along, uprights_from
from regionik.planners.geometry.vectors import cross, dot, minus, norm, squared
from regionik.planners.kernels import compiled
from regionik.planners.search.box_search import (
    NO_SIDE,
    PROOF_SLACK,
    Boxes,
    Verdict,
    contract,
    cut_to,
    explore_in_kernel,
)
from regionik.planners.search.motion_bounds import (
    LinkCapsules,
    chords,
    displacement,
    displacement_from_tool,
    tool_displacement,
)
from regionik.planners.solvers.damped_least_squares import solve_symmetric
from regionik.planners.solvers.serial_chain import (
    SerialArm,
    active_levers,
    chain_frames,
    chain_jacobian,
    joint_axes,
    joint_changes,
)
from regionik.worlds.arrays import Array, Index

_BASE_SECTIONS = 20  # golden sections along a link where its distance from the base is measured
MAX_PARALLEL_SINE_SQUARED = 1e-14  # squared sine of the angle between axes that count as parallel


class SelfClearance(NamedTuple):
    """The clearance that an arm keeps from itself and from its base."""

    pairs: Index  # (p, 2) capsules that may touch, the one on the link nearer to the base first
    body: Uprights  # the base in the arm's base frame
    heeds: Index  # (h,) capsules that may touch the base
    clearance: float  # [m]


NO_SELF_CLEARANCE = SelfClearance(
    np.zeros((0, 2), dtype=np.int64), uprights_from([]), np.zeros(0, dtype=np.int64), 0.0
)


@compiled
def _self_clearance(capsules: LinkCapsules, own: SelfClearance, ends: Array) -> float:
    """Least distance of capsules, ends (s, 2, 3), from each other and the base, less the clearance [m]."""
    least = np.inf
    for i, k in own.pairs:
        apart = segment_distance(ends[i, 0], ends[i, 1], ends[k, 0], ends[k, 1])
        least = min(least, apart - capsules.radius[i] - capsules.radius[k])
    for k in own.heeds:
        for m in range(len(own.body.disc)):
            r = capsules.radius[k]
            least = min(
                least,
                least_along(own.body, m, ends[k, 0], ends[k, 1], 0.0, 0.0, -np.inf, least + r, _BASE_SECTIONS)
                - r,
            )
    return least - own.clearance


@compiled
def segment_distance(a: Array, b: Array, c: Array, d: Array) -> float:
    """Distance of the segments a b and c d [m]."""
    px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    qx, qy, qz = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    rx, ry, rz = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    pp, qq = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
    pq = px * qx + py * qy + pz * qz
    pr, qr = px * rx + py * ry + pz * rz, qx * rx + qy * ry + qz * rz
    square = pp * qq - pq * pq
    s = (
        min(1.0, max(0.0, (pq * qr - qq * pr) / square))
        if square > MAX_PARALLEL_SINE_SQUARED * pp * qq
        else 0.0
    )
    best = np.inf
    for _ in range(3):  # each point in turn moves to where it is nearest to the other
        t = min(1.0, max(0.0, (pq * s + qr) / qq)) if qq > 0.0 else 0.0
        s = min(1.0, max(0.0, (pq * t - pr) / pp)) if pp > 0.0 else 0.0
        x, y, z = rx + s * px - t * qx, ry + s * py - t * qy, rz + s * pz - t * qz
        best = min(best, x * x + y * y + z * z)
    return float(np.sqrt(best))


MAX_CONTRACTIONS = 4  # contractions of one box before it is bisected
PROOF_SECTIONS = 10  # golden sections along a link where a proof is sought
CLEARANCE_SECTIONS = 30  # golden sections along a link where its clearance is measured
NEWTON_STEPS = 4  # Newton steps to a posture
NEWTON_DAMPING = 1e-6  # of those steps, in squares of the arm's lever


class _PosedArm(NamedTuple):
    """A box of postures and the arm at its centre, of n joints and s capsules; scratch space."""

    q: Array  # (dof,) the centre, then a posture reached from it
    half: Array  # (dof,) half widths
    spread: Array  # (n,) half widths of all joints
    chord: Array  # (n,) see `motion_bounds.chords`
    shift: Array  # (2, dof) the box contracted, against its centre
    frames: Array  # (n + 1, 4, 4)
    axes: Array  # (n, 3) joint axes in the arm's base frame
    J: Array  # (6, dof)
    row: Array  # (dof,) coefficients of one condition
    ends: Array  # (s, 2, 3) of the capsules' axes, in the arm's base frame [m]


class FixedBase(NamedTuple):
    """A target for an arm on a base that stands still."""

    arm: SerialArm
    capsules: LinkCapsules
    solids: Uprights  # obstacles
    target: Array  # (3,) in the arm's base frame [m]
    tolerance: float  # how far from the target the tool may be [m]
    clearance: float  # least distance from the solids [m]
    own: SelfClearance
    longest: Array  # (dof,) longest lever of each active joint, which chooses the one to bisect [m]
    best: Array  # (1,) largest clearance met below the wanted one with the tool on target, overwritten [m]
    posed: _PosedArm  # overwritten


def fixed_base_for(
    arm: SerialArm,
    capsules: LinkCapsules,
    solids: Uprights,
    target: Array,
    tolerance: float,
    clearance: float,
    own: SelfClearance,
) -> FixedBase:
    """Return the problem of an arm and a target, with scratch space."""
    n, dof, s = len(arm.axis), len(arm.lower), len(capsules.link)
    posed = _PosedArm(
        np.zeros(dof), np.zeros(dof), np.zeros(n), np.zeros(n), np.zeros((2, dof)), np.zeros((n + 1, 4, 4)),
        np.zeros((n, 3)), np.zeros((6, dof)), np.zeros(dof), np.zeros((s, 2, 3)),
    )  # fmt: skip
    longest, best = active_levers(arm, capsules.levers.max(0)), np.full(1, -np.inf)
    return FixedBase(arm, capsules, solids, target, tolerance, clearance, own, longest, best, posed)


@compiled
def explore_postures(task: FixedBase, boxes: Boxes, budget: int) -> Boxes:
    """Bisect the box whose posture is farthest from the obstacles, until one is found."""
    return explore_in_kernel(judge_postures, task, boxes, budget, 1)


@compiled
def judge_postures(task: FixedBase, low: Array, high: Array) -> tuple[Verdict, float, int]:
    """Contract a box and try it for a posture; its key is the clearance of the posture tried."""
    if not may_hold(task, low, high):
        return Verdict.RULED_OUT, 0.0, NO_SIDE
    reaches = _to_target(task) <= task.tolerance
    own = _self_clearance(task.capsules, task.own, task.posed.ends) + task.clearance
    clear = min(_clearance_of(task), own)
    if reaches and clear >= task.clearance:
        return Verdict.PROVEN, clear, _to_bisect(task.longest, low, high)
    if reaches:
        task.best[0] = max(task.best[0], clear)
    return Verdict.OPEN, clear, _to_bisect(task.longest, low, high)


@compiled
def posture_in(task: FixedBase, low: Array, high: Array) -> Array:
    """The posture (n,) that `judge_postures` tried in a box that it has contracted."""
    _centre(task.posed, low, high)
    _to_target(task)
    return task.posed.q.copy()


@compiled
def may_hold(task: FixedBase, low: Array, high: Array) -> bool:
    """Contract a box in place; False where it holds no free posture."""
    posed, levers = task.posed, task.capsules.levers[0]
    for _ in range(MAX_CONTRACTIONS):
        off = _place_box(task, low, high)
        moved, bent = tool_displacement(task.arm, posed.frames, posed.axes, posed.chord, posed.spread, levers)
        if off > task.tolerance + moved + PROOF_SLACK or not _contract_to_target(task, bent):
            return False
        if not cut_to(low, high, posed.q, posed.shift):
            break
    off = _place_box(task, low, high)
    return not (_hits_obstacle(task, off) or _hits_itself(task))


@compiled
def _place_box(task: FixedBase, low: Array, high: Array) -> float:
    """Place the arm at a box's centre, see how far its joints move; the tool's distance from the target."""
    _centre(task.posed, low, high)
    task.posed.spread[:] = joint_changes(task.arm, task.posed.half)
    chords(task.arm, task.posed.spread, task.posed.chord)
    return place_arm(task)


@compiled
def _centre(posed: _PosedArm, low: Array, high: Array) -> None:
    for k in range(len(low)):
        posed.q[k] = 0.5 * (low[k] + high[k])
        posed.half[k] = 0.5 * (high[k] - low[k])


@compiled
def _to_bisect(longest: Array, low: Array, high: Array) -> int:
    """Joint that moves the arm most, `NO_SIDE` where none moves it."""
    side, most = NO_SIDE, PROOF_SLACK
    for k in range(len(low)):
        if longest[k] * (high[k] - low[k]) > most:
            side, most = k, longest[k] * (high[k] - low[k])
    return side


@compiled
def _contract_to_target(task: FixedBase, bent: float) -> bool:
    """Contract ``posed.shift`` by the reach condition; False where nothing is left.

    Along a unit direction u the condition reads |u . (tool - target) + sum u . J_k d_k| <= tolerance + bent.
    Directions square to two columns of the Jacobian, or to one column and its axis, leave few joints in it.
    """
    posed, n = task.posed, len(task.posed.q)
    chain_jacobian(task.arm, posed.frames, posed.J)
    for k in range(n):
        posed.shift[0, k], posed.shift[1, k] = -posed.half[k], posed.half[k]
    u = np.empty(3)
    for i in range(n):
        for j in range(i, n):
            b = posed.axes[i] if i == j else posed.J[:3, j]
            u[0], u[1], u[2] = cross(posed.J[:3, i], b)
            size = norm(u)
            if size > 1e-9:
                u /= size
                if not _contract_along(task, u, bent):
                    return False
    return True


@compiled
def _contract_along(task: FixedBase, u: Array, bent: float) -> bool:
    """Contract by the reach condition along one direction."""
    posed, n = task.posed, len(task.posed.q)
    room, off = task.tolerance + bent + PROOF_SLACK, 0.0
    for i in range(3):
        off += u[i] * (posed.frames[-1, i, 3] - task.target[i])
    for k in range(n):
        posed.row[k] = dot(u, posed.J[:3, k])
    return contract(posed.shift, posed.row, -room - off, room - off)


@compiled
def _hits_obstacle(task: FixedBase, off: float) -> bool:
    """True where a capsule is too near to an obstacle wherever in the box the tool reaches the target."""
    posed, capsules = task.posed, task.capsules
    for s in range(len(capsules.link)):
        link = capsules.link[s]
        a, b = posed.ends[s, 0], posed.ends[s, 1]
        reach = capsules.radius[s] + task.clearance - PROOF_SLACK
        length = norm(minus(b, a))
        known = False
        base_a = base_b = tool_a = tool_b = 0.0
        for k in range(len(task.solids.disc)):
            if distance_along(task.solids, k, a, b, 0.5) - 0.5 * length >= reach:
                continue
            if not known:  # as points of the arm, and as points near a tool that is at the target
                known = True
                base_a, base_b = _moved(task, s, 0)
                tool_a = off + task.tolerance + _moved_from_tool(task, link, a)
                tool_b = off + task.tolerance + _moved_from_tool(task, link, b)
            if (base_a < tool_a or base_b < tool_b) and (
                least_along(task.solids, k, a, b, base_a, base_b, reach, reach, PROOF_SECTIONS) < reach
            ):
                return True
            if (tool_a < base_a or tool_b < base_b) and (
                least_along(task.solids, k, a, b, tool_a, tool_b, reach, reach, PROOF_SECTIONS) < reach
            ):
                return True
    return False


@compiled
def _hits_itself(task: FixedBase) -> bool:
    """True where two capsules, or one and the base, are too near to each other all over the box.

    Two are as far apart as with the joints at the centre, but for what the joints between them move one as
    seen from the other.
    """
    capsules, own, ends = task.capsules, task.own, task.posed.ends
    for i, k in own.pairs:
        room = capsules.radius[i] + capsules.radius[k] + own.clearance - PROOF_SLACK
        apart = segment_distance(ends[i, 0], ends[i, 1], ends[k, 0], ends[k, 1])
        a, b = _moved(task, k, capsules.link[i] + 1)
        if apart + max(a, b) < room:
            return True
    for k in own.heeds:
        room = capsules.radius[k] + own.clearance - PROOF_SLACK
        a, b = _moved(task, k, 0)
        for m in range(len(own.body.disc)):
            if least_along(own.body, m, ends[k, 0], ends[k, 1], a, b, room, room, CLEARANCE_SECTIONS) < room:
                return True
    return False


@compiled
def _moved(task: FixedBase, s: int, first: int) -> tuple[float, float]:
    """Most that the joints from ``first`` on move both ends of a capsule [m]."""
    arm, posed, levers, link = task.arm, task.posed, task.capsules.levers, task.capsules.link[s]
    frames, axes, chord, ends = posed.frames, posed.axes, posed.chord, posed.ends[s]
    return (
        displacement(arm, frames, axes, chord, levers[1 + 2 * s], link, first, ends[0]),
        displacement(arm, frames, axes, chord, levers[2 + 2 * s], link, first, ends[1]),
    )


@compiled
def _moved_from_tool(task: FixedBase, link: int, point: Array) -> float:
    posed, levers = task.posed, task.capsules.levers[0]
    return displacement_from_tool(task.arm, posed.frames, posed.axes, posed.chord, levers, link, point)


@compiled
def place_arm(task: FixedBase) -> float:
    """Place the arm at ``posed.q``; returns the tool's distance from the target [m]."""
    arm, capsules, posed = task.arm, task.capsules, task.posed
    chain_frames(arm, posed.q, posed.frames)
    joint_axes(arm, posed.frames, posed.axes)
    for s in range(len(capsules.link)):
        transform_into(posed.frames[capsules.link[s]], capsules.ends[s], posed.ends[s])
    return norm(minus(posed.frames[-1, :3, 3], task.target))


@compiled
def _clearance_of(task: FixedBase) -> float:
    """Least distance of the capsules from the obstacles, the arm as `place_arm` left it [m]."""
    least = np.inf
    for s in range(len(task.capsules.link)):
        a, b, radius = task.posed.ends[s, 0], task.posed.ends[s, 1], task.capsules.radius[s]
        length = norm(minus(b, a))
        for k in range(len(task.solids.disc)):
            if distance_along(task.solids, k, a, b, 0.5) - 0.5 * length - radius < least:
                least = min(
                    least,
                    least_along(task.solids, k, a, b, 0.0, 0.0, -np.inf, least + radius, CLEARANCE_SECTIONS)
                    - radius,
                )
    return least


@compiled
def _to_target(task: FixedBase) -> float:
    """Damped least squares from ``posed.q`` towards the target, within limits; the distance left [m]."""
    posed, n = task.posed, len(task.posed.q)
    off = place_arm(task)
    damping = NEWTON_DAMPING * squared(np.max(task.capsules.levers[0])) + 1e-300
    A, e = np.empty((3, 3)), np.empty(3)
    for _ in range(NEWTON_STEPS):
        if off <= task.tolerance:
            break
        chain_jacobian(task.arm, posed.frames, posed.J)
        for i in range(3):
            # as far as the near side of what the tolerance allows: the postures differ on all sides of it
            e[i] = (task.target[i] - posed.frames[-1, i, 3]) * (1.0 - 0.9 * task.tolerance / off)
            for j in range(i + 1):
                A[i, j] = damping if i == j else 0.0
                for k in range(n):
                    A[i, j] += posed.J[i, k] * posed.J[j, k]
        solve_symmetric(A, e)
        for k in range(n):
            step = posed.J[0, k] * e[0] + posed.J[1, k] * e[1] + posed.J[2, k] * e[2]
            posed.q[k] = min(task.arm.upper[k], max(task.arm.lower[k], posed.q[k] + step))
        off = place_arm(task)
    return off
