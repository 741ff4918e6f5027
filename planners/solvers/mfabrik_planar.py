"""M-FABRIK for an arm that works in one vertical plane, on a base that drives every way, compiled.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, with joint limits held in both passes and
restarts where they stall the passes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled
from regionik.planners.solvers.base_placement import BaseArea, Turning, move_to_area, share_turn
from regionik.planners.solvers.fabrik import (
    ANY,
    Knots,
    Pair,
    PlanarLinks,
    Triple,
    backward_reaching,
    bend_limits,
    bends_of,
    direction,
    forward_reaching,
    knots_at,
)
from regionik.planners.solvers.planar_kinematics import (
    PlanarLinkage,
    fitted_bends,
    nearest_posture,
    widest_posture,
)
from regionik.worlds.arrays import Array, Index, Mask


class PlanarSetup(NamedTuple):
    """A planar arm on its base and what is asked of both."""

    plane: PlanarLinkage  # heights counted from the floor
    links: PlanarLinks  # the same for passes
    # sign, offset: (3,) ``bend = sign * joint + offset`` [rad]
    sign: Array
    offset: Array
    restarts: Array  # (k, 3) bends to start again from [rad]
    mount: Array  # (2,) the arm axis in the base frame [m]
    plane_zero: float  # direction of the arm's plane, seen from the base, with the pivot at zero [rad]
    turning: Turning
    facing: int  # 1, or -1 to reach over the arm's back: the target then lies at negative r
    pitch: float  # of the last link in the plane, NaN where it is free [rad]
    tolerance: float  # [m]
    max_passes: int  # from each start


def links_of(plane: PlanarLinkage) -> PlanarLinks:
    """A planar arm as passes take it."""
    first, second, last = map(bend_limits, plane.lower.tolist(), plane.upper.tolist())
    a, b, c = plane.lengths.tolist()
    return PlanarLinks((plane.shoulder_r, plane.shoulder_z), (a, b, c), (first, second, last))


@compiled
def _at_heading(setup: PlanarSetup, yaw: float) -> PlanarSetup:
    """The setup with the base kept at a heading [rad]."""
    lower, upper, heading, _, _ = setup.turning
    return PlanarSetup(
        setup.plane, setup.links, setup.sign, setup.offset, setup.restarts, setup.mount, setup.plane_zero,
        Turning(lower, upper, heading, yaw, yaw), setup.facing, setup.pitch, setup.tolerance,
        setup.max_passes,
    )  # fmt: skip


class _PlanarState(NamedTuple):
    """Arm axis on the floor [m], direction of the arm's plane [rad], bends of the links [rad]."""

    x: float
    y: float
    yaw: float
    bends: Triple


@compiled
def _write_state(setup: PlanarSetup, state: _PlanarState, near: Triple, base: Array, joints: Array) -> bool:
    """Write a state into base and joints, which hold those before; whether the heading is within its span.

    Bends of joints without limits are taken to the turn nearest to ``near``.
    """
    for i in range(3):
        middle = 0.5 * (setup.plane.lower[i] + setup.plane.upper[i])
        if not np.isfinite(middle):
            middle = near[i]
        bend = middle + wrap(state.bends[i] - middle)
        joints[1 + i] = setup.sign[i] * (bend - setup.offset[i])
    joints[0], base[2], fits = share_turn(state.yaw - setup.plane_zero, base[2], joints[0], setup.turning)
    dx, dy = _to_axis(setup, base[2])
    base[0], base[1] = state.x - dx, state.y - dy
    return fits


@compiled
def _state_of(setup: PlanarSetup, base: Array, joints: Array) -> _PlanarState:
    """Arm axis, plane and bends of a base and joints."""
    dx, dy = _to_axis(setup, base[2])
    bends = (
        setup.sign[0] * joints[1] + setup.offset[0],
        setup.sign[1] * joints[2] + setup.offset[1],
        setup.sign[2] * joints[3] + setup.offset[2],
    )
    return _PlanarState(base[0] + dx, base[1] + dy, base[2] + setup.plane_zero + joints[0], bends)


@compiled
def _to_axis(setup: PlanarSetup, yaw: float) -> Pair:
    """From the base to the arm axis [m]."""
    c, s = direction(yaw)
    return c * setup.mount[0] - s * setup.mount[1], s * setup.mount[0] + c * setup.mount[1]


# passes in which the error must come down to this share, for a start to go on
STALL_WINDOW, MAX_STALL_SHARE = 10, 0.9
MIN_AXIS_DISTANCE = 1e-12  # a target so near to the axis, seen from above, does not turn the plane [m]
_PITCH_SLACK = 1e-9  # rounding allowed where the pitch of the last link is fixed [rad]

NO_VERTICES, NO_RINGS = np.empty((0, 2)), np.zeros(1, np.int64)  # of an area that is not asked


class _PlanarGoal(NamedTuple):
    """Target of the tool [m]; facing, pitch and tolerance as in `PlanarSetup`."""

    target: Triple
    facing: int
    pitch: float
    tolerance: float


@compiled
def planar_passes(
    links: PlanarLinks, area: BaseArea, goal: _PlanarGoal, start: _PlanarState, most: int, patience: int,
    history: Array,
) -> tuple[float, int, _PlanarState]:  # fmt: skip
    """M-FABRIK, Algorithm 1, from one start: error [m], passes and the nearest state met in the area.

    It ends after ``most`` passes, or ``patience`` of them without progress. As many errors as the history
    holds are written there, pass by pass.
    """
    x, y, z = start.x, start.y, goal.target[2]
    u, v = direction(start.yaw)
    tool = direction(goal.pitch) if np.isfinite(goal.pitch) else ANY
    knots = knots_at(links, start.bends)
    error = _distance(goal, x, y, (u, v), knots)  # M-FABRIK, Alg. 1 l. 8
    stays = _may_stay(area, goal, start)
    if error <= goal.tolerance and stays:
        return error, 0, start
    passes, mark, least = 0, np.inf, error if stays else np.inf
    near_x, near_y, near_u, near_v, near = x, y, u, v, knots
    u, v, r = _aim(goal, x, y, u, v)
    while passes < most:  # l. 9
        passes += 1
        root, knots = forward_reaching(links, tool, (r, z), knots)  # l. 11
        if area.mobile:
            shift, before = root - links.shoulder[0], r
            x, y = move_to_area(area, x + shift * u, y + shift * v)  # l. 13: ProjectPoint, l. 15-19
            u, v, r = _aim(goal, x, y, u, v)
            knots = _shifted(knots, r - before)
        knots = backward_reaching(links, tool, (r, z), knots)  # l. 21
        error = _miss(links, goal, tool, r, knots)  # l. 23
        history[passes - 1 : passes] = error
        if error < least:
            least, near_x, near_y, near_u, near_v, near = error, x, y, u, v, knots
        if error <= goal.tolerance:
            break
        if passes % patience == patience - 1:
            if error > MAX_STALL_SHARE * mark:
                break
            mark = error
    return least, passes, _PlanarState(near_x, near_y, math.atan2(near_v, near_u), bends_of(links, near))


@compiled
def _distance(goal: _PlanarGoal, x: float, y: float, plane: Pair, knots: Knots) -> float:
    """Distance of the tool from the target, the arm axis at a place [m]."""
    ex, ey = x + knots[4] * plane[0] - goal.target[0], y + knots[4] * plane[1] - goal.target[1]
    ez = knots[5] - goal.target[2]
    return math.sqrt(ex * ex + ey * ey + ez * ez)


@compiled
def _may_stay(area: BaseArea, goal: _PlanarGoal, start: _PlanarState) -> bool:
    """True where a start on target is an answer: its base in the area, its last link at the pitch.

    A base that has become inadmissible must move even where the tool is in place already.
    """
    if area.mobile and move_to_area(area, start.x, start.y) != (start.x, start.y):
        return False
    a, b, c = start.bends
    return not np.isfinite(goal.pitch) or abs(wrap(a + b + c - goal.pitch)) <= _PITCH_SLACK


@compiled
def _aim(goal: _PlanarGoal, x: float, y: float, u: float, v: float) -> Triple:
    """The plane's direction towards the target, the old one where that is straight above; the target's r."""
    dx, dy = goal.target[0] - x, goal.target[1] - y
    rho = math.sqrt(dx * dx + dy * dy)
    if rho > MIN_AXIS_DISTANCE:
        u, v = goal.facing * dx / rho, goal.facing * dy / rho
    return u, v, goal.facing * rho


@compiled
def _shifted(knots: Knots, by: float) -> Knots:
    """Knots moved along r."""
    return knots[0] + by, knots[1], knots[2] + by, knots[3], knots[4] + by, knots[5]


@compiled
def _miss(links: PlanarLinks, goal: _PlanarGoal, tool: Pair, r: float, knots: Knots) -> float:
    """Distance of the tool from the target [m], larger than the tolerance where a fixed pitch is not met."""
    er, ez = knots[4] - r, knots[5] - goal.target[2]
    error = math.sqrt(er * er + ez * ez)
    if tool != ANY:
        link_r, link_z = knots[4] - knots[2], knots[5] - knots[3]
        along, across = link_r * tool[0] + link_z * tool[1], link_r * tool[1] - link_z * tool[0]
        off = abs(math.atan2(across, along))
        if off > _PITCH_SLACK:
            error += goal.tolerance + off * links.lengths[2]
    return error


@compiled
def _planar_restarts(
    arm: PlanarLinkage, links: PlanarLinks, restarts: Array, area: BaseArea, goal: _PlanarGoal,
    start: _PlanarState, most: int, history: Array,
) -> tuple[float, int, _PlanarState]:  # fmt: skip
    """M-FABRIK with restarts: the given posture, then ``restarts`` (k, 3), then the widest one at the base.

    Limits can stall the passes, and a start that stalls is left for the next one; where none converges, all
    are followed to the end. Last the arm's self-motion is searched, so that no admissible place is given up.

    Returns
    -------
    error [m], passes (all starts together), the answer, or the nearest state met where there is none
    """
    total, count, nearest, least = 0, len(restarts) + 1, start, np.inf
    for attempt in range(2 * count):  # once over the starts in a hurry, once to the end
        k, patience = attempt % count, STALL_WINDOW if attempt < count else most + 1
        bends = start.bends if k == 0 else (restarts[k - 1, 0], restarts[k - 1, 1], restarts[k - 1, 2])
        begun = _PlanarState(start.x, start.y, start.yaw, bends)
        error, passes, found = planar_passes(links, area, goal, begun, most, patience, history[total:])
        total += passes
        if error <= goal.tolerance:
            if total > 0:  # to the last digit within the limits
                found = _fitted(arm, found)
            return error, total, found
        if error < least:
            least, nearest = error, found
    widest, found = _widest(arm, links, area, goal, start)
    if np.isfinite(widest):
        history[total : total + 1] = widest
        return widest, total + 1, found
    nearest = _fitted(arm, nearest)
    off = _distance(goal, nearest.x, nearest.y, direction(nearest.yaw), knots_at(links, nearest.bends))
    return off if off > goal.tolerance else least, total, nearest  # else it is the pitch that is missed


@compiled
def _fitted(arm: PlanarLinkage, state: _PlanarState) -> _PlanarState:
    """The state with its bends within the limits, to the last digit."""
    a, b, c = state.bends
    return _PlanarState(state.x, state.y, state.yaw, fitted_bends(arm, a, a + b, a + b + c))


@compiled
def _widest(
    arm: PlanarLinkage, links: PlanarLinks, area: BaseArea, goal: _PlanarGoal, start: _PlanarState
) -> tuple[float, _PlanarState]:
    """The widest posture from the base, or where the floor is free from any distance.

    Returns the error [m], infinite where there is none, and the posture.
    """
    x, y, z, facing = start.x, start.y, goal.target[2], goal.facing
    unbounded = area.mobile and len(area.rings) <= 1
    if area.mobile:
        x, y = move_to_area(area, x, y)
    dx, dy = goal.target[0] - x, goal.target[1] - y
    rho = math.sqrt(dx * dx + dy * dy)
    yaw = math.atan2(facing * dy, facing * dx) if rho > MIN_AXIS_DISTANCE else start.yaw
    far = arm.lengths[0] + arm.lengths[1] + arm.lengths[2] + abs(arm.shoulder_r)
    bends = np.empty(3)
    for k in range(201 if unbounded else 1):
        if k > 0:
            rho = (k - 0.5) / 200.0 * far
            x = goal.target[0] - facing * rho * math.cos(yaw)
            y = goal.target[1] - facing * rho * math.sin(yaw)
        if widest_posture(arm, goal.pitch, facing * rho, z, bends, 1440 if k == 0 else 360):
            found = _PlanarState(x, y, yaw, (bends[0], bends[1], bends[2]))
            knots = knots_at(links, found.bends)
            return np.hypot(knots[4] - facing * rho, knots[5] - z), found
    return np.inf, start


@compiled
def solve_planar(
    setup: PlanarSetup, area: BaseArea, target: Array, base: Array, joints: Array, history: Array
) -> tuple[float, int, bool]:
    """Move base (3,) and joints (dof,), which are overwritten, so that the tool reaches a target (3,).

    The history (k,) is overwritten with the errors after the first k passes [m].

    Returns
    -------
    error [m], passes, True where the target is met at a heading within its span
    """
    goal = _PlanarGoal((target[0], target[1], target[2]), setup.facing, setup.pitch, setup.tolerance)
    start = _state_of(setup, base, joints)
    error, passes, found = _planar_restarts(
        setup.plane, setup.links, setup.restarts, area, goal, start, setup.max_passes, history
    )
    fits = _write_state(setup, found, start.bends, base, joints)
    return error, passes, fits and error <= goal.tolerance


@compiled
def least_change(setup: PlanarSetup, target: Array, base: Array, joints: Array) -> tuple[float, bool]:
    """The posture on a target whose bends change least, the arm axis held; overwrites base and joints.

    Returns the largest change of a bend, infinite where there is no such posture [rad], and whether the
    heading is within its span.
    """
    start, bends, near = _state_of(setup, base, joints), np.empty(3), np.empty(3)
    near[0], near[1], near[2] = start.bends
    dx, dy = target[0] - start.x, target[1] - start.y
    r, yaw = setup.facing * np.hypot(dx, dy), math.atan2(setup.facing * dy, setup.facing * dx)
    change = nearest_posture(setup.plane, setup.pitch, r, target[2], near, bends)
    if not np.isfinite(change):
        return change, False
    found = _PlanarState(start.x, start.y, yaw, (bends[0], bends[1], bends[2]))
    return change, _write_state(setup, found, start.bends, base, joints)


@compiled
def solve_planar_many(
    setup: PlanarSetup, area: BaseArea, targets: Array, bases: Array, joints: Array
) -> tuple[Array, Index, Mask]:
    """`solve_planar` for rows of targets (n, 3); bases (n, 3) and joints (n, dof) are overwritten."""
    n, untold = len(targets), np.empty(0)
    errors, passes, met = np.empty(n), np.empty(n, np.int64), np.empty(n, np.bool_)
    for k in range(n):
        errors[k], passes[k], met[k] = solve_planar(setup, area, targets[k], bases[k], joints[k], untold)
    return errors, passes, met


@compiled
def solve_planar_along(
    setup: PlanarSetup, targets: Array, places: Array, wished: Array, bend: float, base: Array, joints: Array
) -> tuple[Array, Array]:
    """Base poses (k, 3) and joints (k, dof) along a path, each from the one before, until none is found.

    The arm axis is held at each place. FABRIK from the wished posture is tried first, then the posture of
    least change where its passes stall or the arm would jump.

    Parameters
    ----------
    targets : (n, 3) array [m]
    places : (n, 3) array
        Base poses; where the heading is free it is NaN, and the place is that of the arm axis [m], [rad].
    wished : (n, dof) array
        The pivot's value does not matter: the heading decides on it.
    bend : float
        Change of a joint against the wished posture that counts as a jump [rad].
    base, joints : (3,), (dof,) arrays
        The state before the first.
    """
    held = BaseArea(NO_VERTICES, NO_RINGS, False)
    bases, postures, untold = places.copy(), wished.copy(), np.empty(0)
    yaw, pivot = base[2], joints[0]
    for i in range(len(targets)):
        one, near = setup, wished[i].copy()
        near[0] = pivot
        if np.isnan(places[i, 2]):
            dx, dy = _to_axis(setup, yaw)
            bases[i, 0], bases[i, 1], bases[i, 2] = places[i, 0] - dx, places[i, 1] - dy, yaw
        else:
            one = _at_heading(setup, places[i, 2])
        start = bases[i].copy()
        postures[i] = near
        _, _, met = solve_planar(one, held, targets[i], bases[i], postures[i], untold)
        if not met or np.abs(postures[i, 1:] - near[1:]).max() > bend:
            bases[i], postures[i] = start, near
            _, met = least_change(one, targets[i], bases[i], postures[i])
            if not met:
                return bases[:i], postures[:i]
        if not np.isnan(places[i, 2]):
            bases[i] = places[i]
        yaw, pivot = bases[i, 2], postures[i, 0]
    return bases, postures
