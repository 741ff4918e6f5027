"""FABRIK-R (paper 001) for any serial chain: steps of single bodies, and passes over all of them.

A pass works on a `Posture`, which it overwrites joint by joint: what it has passed is new, what lies ahead is
old. Every body stays rigid, so joint values are exact after each backward pass. A step is a choice
(`backward_choice`) and a placement (`backward_place`), so that a caller may put another value between them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import TWO_PI, wrap
from regionik.planners.geometry.vectors import (
    Vector,
    across,
    cross,
    dot,
    minus,
    norm,
    plus,
    put,
    rotated,
    row,
    scaled,
    turned,
    turned_back,
)
from regionik.planners.kernels import compiled
from regionik.planners.solvers.rigid_bodies import RigidBodies
from regionik.planners.solvers.serial_chain import rotate_about
from regionik.worlds.arrays import Array

MIN_LENGTH = 1e-13  # lengths, and products of lengths, that are rounding and give no direction [m, m^2]
TIE_TOLERANCE = 1e-9  # candidates this near to each other are equally good [m, rad]


class Posture(NamedTuple):
    """Poses of the bodies in the arm's base frame; passes write into it."""

    joints: Array  # (n,)
    turns: Array  # (n, 3, 3) orientation of every link
    # outer, inner: (n + 1, 3) outer and inner points of the axes, then the tool point [m]
    outer: Array
    inner: Array


@compiled
def posture_of(bodies: RigidBodies, joints: Array) -> Posture:
    """Posture with the joints at ``joints``, which are copied."""
    n = len(bodies.slide)
    posture = Posture(joints[:n].copy(), np.empty((n, 3, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3)))
    for k in range(n):
        backward_place(bodies, k, posture.joints[k], posture)
    return posture


@compiled
def backward_pass(bodies: RigidBodies, posture: Posture) -> None:
    """From the root out to the tool."""
    for k in range(len(posture.joints)):
        backward_step(bodies, k, posture)


@compiled
def forward_pass(bodies: RigidBodies, target: Array, posture: Posture) -> None:
    """From the target in to the root, the last body free to turn."""
    forward_start(bodies, target, posture)
    for k in range(len(posture.joints) - 1, 0, -1):
        forward_step(bodies, k, posture)


@compiled
def backward_step(bodies: RigidBodies, k: int, posture: Posture) -> None:
    """Choose joint k and place body k."""
    backward_place(bodies, k, backward_choice(bodies, k, posture), posture)


@compiled
def forward_step(bodies: RigidBodies, k: int, posture: Posture) -> None:
    """Choose joint k from the far side and place body k - 1 (k > 0)."""
    forward_place(bodies, k, forward_choice(bodies, k, posture), posture)


@compiled
def backward_choice(bodies: RigidBodies, k: int, posture: Posture) -> float:
    """Value of joint k, within its limits, that the old points ahead ask for."""
    arm, base = bodies.arm, np.empty((3, 3))
    _joint_turn(bodies, k, posture, base)
    axis = turned(base, row(arm.axis, k))
    if k == 0:  # a forward pass has pulled the root away
        posture.outer[0] = posture.inner[0] = bodies.root
    here, now = row(posture.outer, k), posture.joints[k]
    if not arm.revolute[k]:
        start = plus(here, turned(base, row(bodies.outer, k)))
        travel = dot(axis, minus(row(posture.outer, k + 1), start))
        slid: float = min(max(travel, arm.lower[k]), arm.upper[k])
        return slid
    aim = bodies.outward_aim[k]
    ahead = aim if aim >= 0 else bodies.outward_plane[k]
    link = turned(base, _span_out(bodies, k, ahead, posture.joints))
    if aim >= 0:
        wanted = pointing_turn(axis, link, minus(row(posture.outer, aim), here), now)
        return clamped_turn(wanted, now, arm.lower[k], arm.upper[k])
    normal = turned(base, _axis_out(bodies, k, ahead))
    line = minus(here, row(posture.outer, bodies.outward_goal[k]))
    nearest = minus(row(posture.outer, min(ahead + 1, len(posture.joints))), here)
    return planar_turn(axis, normal, line, link, nearest, now, arm.lower[k], arm.upper[k], 1.0)


@compiled
def backward_place(bodies: RigidBodies, k: int, value: float, posture: Posture) -> None:
    """Put joint k at ``value`` and place body k after body k - 1."""
    arm, turn, base = bodies.arm, posture.turns[k], np.empty((3, 3))
    posture.joints[k] = value
    if k == 0:
        posture.outer[0] = posture.inner[0] = bodies.root
    _joint_turn(bodies, k, posture, base)
    link = row(bodies.outer, k)
    if arm.revolute[k]:
        spin = np.empty((3, 3))
        rotate_about(arm.axis[k], value, spin)
        matmul3(base, spin, turn)
    else:
        turn[:] = base
        link = plus(link, scaled(row(arm.axis, k), value))
    point = plus(row(posture.outer, k), turned(turn, link))
    put(posture.outer, k + 1, point)
    if k + 1 < len(posture.joints):
        point = minus(point, scaled(turned(turn, row(bodies.next_axis, k)), bodies.slide[k + 1]))
    put(posture.inner, k + 1, point)


@compiled
def forward_start(bodies: RigidBodies, target: Array, posture: Posture) -> None:
    """Put the tool on the target and turn the last body into the plane of the point that it follows.

    The last axis keeps its old direction less the part along the line to that point, and the axis' own point
    comes to lie on that line. Where all axes are parallel it is a FABRIK step in their plane.
    """
    n = len(posture.joints)
    c, goal = bodies.last, bodies.start_goal
    turn = posture.turns[n - 1]
    axis = turned(posture.turns[c], row(bodies.arm.axis, c))
    tool = (target[0], target[1], target[2])
    lever = across(minus(row(posture.outer, n), row(posture.outer, c)), axis)
    if goal < 0:
        new_axis, line = axis, across(minus(tool, row(posture.outer, c)), axis)
    else:
        line = minus(tool, row(posture.inner, goal))
        new_axis = across(axis, scaled(line, 1.0 / max(norm(line), MIN_LENGTH)))
    if min(norm(lever), norm(line), norm(new_axis)) > MIN_LENGTH:
        turn_frame(lever, axis, line, new_axis, turn)
    put(posture.outer, n, tool)
    put(posture.inner, n, tool)
    place_behind(bodies, n - 1, posture)


@compiled
def forward_start_posed(bodies: RigidBodies, target: Array, turn: Array, posture: Posture) -> None:
    """Put the tool on the target with the last link turned as ``turn`` (3, 3) says."""
    n = len(posture.joints)
    posture.turns[n - 1] = turn
    posture.outer[n] = posture.inner[n] = target
    place_behind(bodies, n - 1, posture)


@compiled
def forward_choice(bodies: RigidBodies, k: int, posture: Posture) -> float:
    """Value of joint k > 0, within its limits, that the old points behind ask for; body k stands."""
    arm, now = bodies.arm, posture.joints[k]
    axis, here = turned(posture.turns[k], row(arm.axis, k)), row(posture.inner, k)
    aim = bodies.inward_aim[k]
    behind = aim if aim >= 0 else bodies.inward_plane[k]
    link = turned(posture.turns[k], _span_in(bodies, k, behind, posture.joints))
    if not arm.revolute[k]:
        travel = now + dot(axis, minus(plus(here, link), row(posture.inner, behind)))
        slid: float = min(max(travel, arm.lower[k]), arm.upper[k])
        return slid
    # Seen from body k, the body before it turns the other way.
    if aim >= 0:
        wanted = -pointing_turn(axis, link, minus(row(posture.inner, aim), here), -now)
        return clamped_turn(wanted, now, arm.lower[k], arm.upper[k])
    normal = turned(posture.turns[k], _axis_in(bodies, k, behind))
    line = minus(here, row(posture.inner, bodies.inward_goal[k]))
    nearest = minus(row(posture.inner, max(behind - 1, 0)), here)
    return planar_turn(axis, normal, line, link, nearest, now, arm.lower[k], arm.upper[k], -1.0)


@compiled
def forward_place(bodies: RigidBodies, k: int, value: float, posture: Posture) -> None:
    """Put joint k > 0 at ``value`` and place body k - 1 before body k."""
    arm, turn = bodies.arm, posture.turns[k]
    back = np.empty((3, 3))
    if arm.revolute[k]:
        spin = np.empty((3, 3))
        rotate_about(arm.axis[k], -value, spin)
        matmul3(turn, spin, back)
    else:
        back[:] = turn
        shift = scaled(turned(turn, row(arm.axis, k)), posture.joints[k] - value)
        put(posture.inner, k, plus(row(posture.inner, k), shift))
        put(posture.outer, k, row(posture.inner, k))
    posture.joints[k] = value
    matmul3_transposed(back, arm.fixed[k], posture.turns[k - 1])
    place_behind(bodies, k - 1, posture)


@compiled
def _joint_turn(bodies: RigidBodies, k: int, posture: Posture, out: Array) -> None:
    """Orientation of link k at joint value 0, from that of link k - 1."""
    if k == 0:
        out[:] = bodies.arm.fixed[0, :3, :3]
    else:
        matmul3(posture.turns[k - 1], bodies.arm.fixed[k], out)


@compiled
def place_behind(bodies: RigidBodies, k: int, posture: Posture) -> None:
    """Points of axis k from the orientation of link k and the inner point ahead of it."""
    turn, link, axis = posture.turns[k], row(bodies.inner, k), row(bodies.arm.axis, k)
    if not bodies.arm.revolute[k]:
        link = plus(link, scaled(axis, posture.joints[k]))
    point = minus(row(posture.inner, k + 1), turned(turn, link))
    put(posture.inner, k, point)
    put(posture.outer, k, plus(point, scaled(turned(turn, axis), bodies.slide[k])))


@compiled
def _span_out(bodies: RigidBodies, k: int, ahead: int, joints: Array) -> Vector:
    """From the outer point of axis k to that of axis ``ahead``, over slides, in the frame of link k."""
    v = row(bodies.outer, ahead - 1)
    for i in range(ahead - 1, k, -1):
        v = turned(bodies.arm.fixed[i], plus(v, scaled(row(bodies.arm.axis, i), joints[i])))
        v = plus(v, row(bodies.outer, i - 1))
    return v


@compiled
def _span_in(bodies: RigidBodies, k: int, behind: int, joints: Array) -> Vector:
    """Inner point of axis k to that of axis ``behind``, over slides, with link k at joint value 0."""
    arm = bodies.arm
    v = (0.0, 0.0, 0.0)
    for i in range(behind, k):
        v = plus(v, row(bodies.inner, i))
        if not arm.revolute[i]:
            v = plus(v, scaled(row(arm.axis, i), joints[i]))
        v = turned_back(arm.fixed[i + 1], v)
    return scaled(v, -1.0)


@compiled
def _axis_out(bodies: RigidBodies, k: int, ahead: int) -> Vector:
    """Axis ``ahead`` in the frame of link k, over slides."""
    v = row(bodies.next_axis, ahead - 1)
    for i in range(ahead - 1, k, -1):
        v = turned(bodies.arm.fixed[i], v)
    return v


@compiled
def _axis_in(bodies: RigidBodies, k: int, behind: int) -> Vector:
    """Axis ``behind`` in link k's frame at joint value 0, over slides."""
    v = row(bodies.arm.axis, behind)
    for i in range(behind, k):
        v = turned_back(bodies.arm.fixed[i + 1], v)
    return v


@compiled
def clamped_turn(wanted: float, now: float, lower: float, upper: float) -> float:
    """The turn of ``wanted`` within the limits, nearest to ``now``; else the nearer limit [rad]."""
    value = now + wrap(wanted - now)
    if lower <= value <= upper:
        return value
    above = lower + (wanted - lower) % TWO_PI if np.isfinite(lower) else upper - (upper - wanted) % TWO_PI
    if lower <= above <= upper:
        return above
    return upper if above - upper <= TWO_PI - (above - lower) else lower


@compiled
def pointing_turn(axis: Vector, link: Vector, line: Vector, now: float) -> float:
    """Turn about ``axis`` that points ``link`` along ``line`` as far as it can; ``now`` where none does."""
    link, line = across(link, axis), across(line, axis)
    c, s = dot(link, line), dot(axis, cross(link, line))
    if np.hypot(c, s) <= MIN_LENGTH * norm(link):
        return now
    angle: float = math.atan2(s, c)
    return angle


@compiled
def planar_turn(
    axis: Vector,
    normal: Vector,
    line: Vector,
    link: Vector,
    nearest: Vector,
    now: float,
    lower: float,
    upper: float,
    sense: float,
) -> float:
    """Eq. (6): the turn about ``axis`` that makes ``normal`` normal to ``line``.

    Of two roots the one within the limits wins, then the one of the smallest circumference (the end of
    ``link`` nearest to the next point), then the smaller turn. Where there is no root, the closest
    approach.
    """
    K1, K2 = dot(line, normal), dot(axis, normal) * dot(line, axis)
    a, K3 = K1 - K2, dot(line, cross(axis, normal))
    R = np.hypot(a, K3)
    if R <= MIN_LENGTH:
        return clamped_turn(now, now, lower, upper)
    delta = math.atan2(K3, a)
    half = math.atan2(np.sqrt(max(0.0, (R - K2) * (R + K2))), -K2)
    best, best_out, best_gap, best_turn = now, np.inf, np.inf, np.inf
    for side in (1.0, -1.0):
        wanted = sense * (delta + side * half)
        value = clamped_turn(wanted, now, lower, upper)
        out = abs(wrap(value - wanted))
        gap = norm(minus(rotated(axis, sense * value, link), nearest))
        turn = abs(value - now)
        better = out < best_out - TIE_TOLERANCE
        if not better and out <= best_out + TIE_TOLERANCE:
            better = gap < best_gap - TIE_TOLERANCE or (gap <= best_gap + TIE_TOLERANCE and turn < best_turn)
        if better:
            best, best_out, best_gap, best_turn = value, out, gap, turn
    return best


@compiled
def turn_frame(x: Vector, z: Vector, new_x: Vector, new_z: Vector, turn: Array) -> None:
    """Turn ``turn`` (3, 3) as that takes the directions x, z (at right angles) to new_x, new_z."""
    x, z = scaled(x, 1.0 / norm(x)), scaled(z, 1.0 / norm(z))
    new_x, new_z = scaled(new_x, 1.0 / norm(new_x)), scaled(new_z, 1.0 / norm(new_z))
    y, new_y = cross(z, x), cross(new_z, new_x)
    for j in range(3):
        column = (turn[0, j], turn[1, j], turn[2, j])
        a, b, c = dot(x, column), dot(y, column), dot(z, column)
        for i in range(3):
            turn[i, j] = a * new_x[i] + b * new_y[i] + c * new_z[i]


@compiled
def matmul3(A: Array, B: Array, out: Array) -> None:
    """A B of the 3 x 3 parts."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@compiled
def matmul3_transposed(A: Array, B: Array, out: Array) -> None:
    """A B^T of the 3 x 3 parts."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[j, 0] + A[i, 1] * B[j, 1] + A[i, 2] * B[j, 2]
