"""Motions of base and arm between two states: poses of links, and bounds of their speed, compiled.

Between two states the base turns evenly the shorter way while it slides evenly or, on wheels, rolls along one
arc; joints move evenly. Time runs from 0 to 1 on a motion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.driving.arcs import arc_end, arc_towards
from regionik.planners.geometry.vectors import cross, plus, row, scaled, squared, turned
from regionik.planners.kernels import compiled
from regionik.planners.solvers.serial_chain import SerialArm, chain_on, joint_values
from regionik.worlds.arrays import Array, Index

WORLD, BASE = -2, -1  # frames of hulls that no link carries
_HERE = np.eye(4)


class MobileArm(NamedTuple):
    """An arm on a base that drives."""

    arm: SerialArm
    mount: Array  # (4, 4) pose of the arm's base frame on the base
    rolls: bool  # whether the base rolls along arcs; others slide


class MotionSegment(NamedTuple):
    """A motion between two states."""

    base: Array  # (3,) base pose at the start: x, y [m], yaw [rad]
    # (3,) added to it evenly: all of the way of a base that slides, the turn alone of one that rolls
    drive: Array
    arc: float  # length rolled along the heading, negative in reverse [m]
    # joints, bend: (n,) values of all joints at the start, and what is added to them evenly [rad] or [m]
    joints: Array
    bend: Array


@compiled
def segment_between(
    base_a: Array, joints_a: Array, base_b: Array, joints_b: Array, rolls: bool
) -> MotionSegment:
    """The motion between two states; the base turns the shorter way, half a turn to the left."""
    drive, arc = base_b - base_a, 0.0
    drive[2] -= 2 * math.pi * np.ceil((drive[2] - math.pi) / (2 * math.pi))
    if rolls:
        x, y, yaw = base_a[0], base_a[1], base_a[2]
        arc, drive[0], drive[1] = arc_towards(x, y, yaw, x + drive[0], y + drive[1], drive[2])
    return MotionSegment(base_a, drive, arc, joints_a, joints_b - joints_a)


@compiled
def motion_between(
    robot: MobileArm, base_a: Array, joints_a: Array, base_b: Array, joints_b: Array
) -> MotionSegment:
    """The motion between two states, their joints the active ones (dof,)."""
    a, b = joint_values(robot.arm, joints_a), joint_values(robot.arm, joints_b)
    return segment_between(base_a, a, base_b, b, robot.rolls)


@compiled
def at_rest(base: Array, joints: Array) -> MotionSegment:
    """A motion that stays in a state, with values of all joints (n,)."""
    return MotionSegment(base, np.zeros(3), 0.0, joints, np.zeros(len(joints)))


@compiled
def base_at(motion: MotionSegment, s: float) -> tuple[float, float, float]:
    """Base pose at time s of a motion: x, y [m], yaw [rad]."""
    x, y, yaw = motion.base
    x, y, yaw = arc_end(x, y, yaw, s * motion.arc, s * motion.drive[2])
    return x + s * motion.drive[0], y + s * motion.drive[1], yaw


@compiled
def bases_between(knots: Array, leg: Index, share: Array, rolls: bool) -> Array:
    """Base poses (n, 3) at shares (n,) of legs (n,), on the way that every reader of a plan fills in.

    Headings run on from the first knot of a leg; where they are NaN, they stay so.
    """
    bases, still = np.empty((len(leg), 3)), np.empty(0)
    for n in range(len(leg)):
        motion = segment_between(knots[leg[n]], still, knots[leg[n] + 1], still, rolls)
        if rolls:
            bases[n, 0], bases[n, 1], bases[n, 2] = base_at(motion, share[n])
        else:
            bases[n] = motion.base + share[n] * motion.drive
    return bases


@compiled
def link_frames(robot: MobileArm, motion: MotionSegment, s: float, frame: int, frames: Array) -> None:
    """Write the frames of links, tool and base (n + 2, 4, 4) at time s of a motion.

    They are seen from a link, the base or the world; the base comes last, so that its link is ``BASE``.
    """
    arm, mount, joints = robot.arm, robot.mount, motion.joints + s * motion.bend
    if frame == WORLD:
        x, y, yaw = base_at(motion, s)
        _on_floor(mount, x, y, yaw, frames[0])
        chain_on(arm, joints, frames)
        _on_floor(_HERE, x, y, yaw, frames[BASE])
    elif frame == BASE:
        frames[0], frames[BASE] = mount, _HERE
        chain_on(arm, joints, frames)
    else:
        frames[0] = _HERE
        chain_on(arm, joints, frames)
        frames[BASE] = _HERE
        _see_from(mount, frames[BASE:])
        _see_from(frames[frame].copy(), frames)


@compiled
def _on_floor(pose: Array, x: float, y: float, yaw: float, out: Array) -> None:
    """Write a pose (4, 4) on a base, seen from the world."""
    c, z = math.cos(yaw), math.sin(yaw)
    for j in range(4):
        out[0, j] = c * pose[0, j] - z * pose[1, j]
        out[1, j] = z * pose[0, j] + c * pose[1, j]
        out[2, j], out[3, j] = pose[2, j], pose[3, j]
    out[0, 3] += x
    out[1, 3] += y


@compiled
def _see_from(pose: Array, frames: Array) -> None:
    """Have frames (n, 4, 4) seen from a pose (4, 4)."""
    for T in frames:
        for j in range(4):
            x, y, z = T[0, j], T[1, j], T[2, j]
            if j == 3:
                x, y, z = x - pose[0, 3], y - pose[1, 3], z - pose[2, 3]
            for i in range(3):
                T[i, j] = pose[0, i] * x + pose[1, i] * y + pose[2, i] * z


@compiled
def tool_frames(robot: MobileArm, bases: Array, joints: Array, shares: Array) -> Array:
    """Tool frames in the world at k times of every motion between states (n + 1, ...), (n, k, 4, 4)."""
    tools = np.empty((len(bases) - 1, len(shares), 4, 4))
    frames = np.empty((len(robot.arm.axis) + 2, 4, 4))
    for i in range(len(tools)):
        motion = motion_between(robot, bases[i], joints[i], bases[i + 1], joints[i + 1])
        for k in range(len(shares)):
            link_frames(robot, motion, shares[k], WORLD, frames)
            tools[i, k] = frames[-2]
    return tools


@compiled
def count_on_line(
    robot: MobileArm,
    bases: Array,
    joints: Array,
    line: Array,
    shares: Array,
    most: tuple[float, float, float],
) -> int:
    """Count motions between states (n + 1, ...) that lead the tool along a line, up to one that does not.

    The line (n + 1, 3) is where the tool is at every state, straight in between [m]; it is looked at at some
    shares of a motion. ``most`` says how far the tool may be off it [m], and how much a joint or the heading,
    and the base's place, may change in one motion [rad], [m].
    """
    stray, bend, step = most
    frames = np.empty((len(robot.arm.axis) + 2, 4, 4))
    for n in range(len(bases) - 1):
        motion = motion_between(robot, bases[n], joints[n], bases[n + 1], joints[n + 1])
        way = bases[n + 1] - bases[n]
        if np.hypot(way[0], way[1]) > step or max(abs(motion.drive[2]), np.abs(motion.bend).max()) > bend:
            return n
        for s in shares:
            link_frames(robot, motion, s, WORLD, frames)
            off = 0.0
            for i in range(3):
                off += squared(frames[-2, i, 3] - s * (line[n + 1, i] - line[n, i]) - line[n, i])
            if off > stray * stray:
                return n
    return len(bases) - 1


@compiled
def transform_into(frame: Array, points: Array, out: Array) -> None:
    """Write points (n, 3) of a frame, seen from where the frame is seen."""
    for k in range(len(points)):
        x, y, z = points[k]
        for i in range(3):
            out[k, i] = frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z + frame[i, 3]


@compiled
def speed_bounds(
    robot: MobileArm, motion: MotionSegment, link: int, frame: int, points: Array
) -> tuple[float, float]:
    """Upper bounds of speed [m] and acceleration [m] of points fixed to a link, seen from a frame.

    Frame by frame from the link inwards: a joint that turns at rate w under a point that moves at speed v at
    a distance r of its axis adds w r to the speed and w^2 r + 2 w v to the acceleration.
    """
    arm, mount = robot.arm, robot.mount
    far, lever = 0.0, 0.0  # from the joint's origin, and from its axis
    x, y, z = arm.axis[link, 0], arm.axis[link, 1], arm.axis[link, 2]
    for p in points:
        square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
        along = x * p[0] + y * p[1] + z * p[2]
        far = max(far, math.sqrt(square))
        lever = max(lever, math.sqrt(max(0.0, square - along * along)))
    speed, acceleration = 0.0, 0.0
    for k in range(link, max(frame, BASE), -1):
        rate = abs(motion.bend[k])
        if arm.revolute[k]:
            acceleration += rate * rate * lever + 2 * rate * speed
            speed += rate * lever
        else:
            speed += rate
            far += max(abs(motion.joints[k]), abs(motion.joints[k] + motion.bend[k]))
        step = arm.fixed[k]
        far += math.sqrt(squared(step[0, 3]) + squared(step[1, 3]) + squared(step[2, 3]))
        lever = far
    if frame == WORLD:
        rate = abs(motion.drive[2])
        lever = far + np.hypot(mount[0, 3], mount[1, 3])
        acceleration += rate * (rate * lever + 2 * speed + abs(motion.arc))
        speed += rate * lever + np.hypot(motion.drive[0], motion.drive[1]) + abs(motion.arc)
    return speed, acceleration


@compiled
def tool_speed(robot: MobileArm, motion: MotionSegment, frame: int) -> float:
    """Upper bound of the speed of the tool point, seen from a frame [m]."""
    tool = robot.arm.tool[:3, 3].copy().reshape(1, 3)
    return speed_bounds(robot, motion, len(robot.arm.axis) - 1, frame, tool)[0]


@compiled
def link_twist(
    robot: MobileArm, motion: MotionSegment, frames: Array, s: float, link: int, frame: int
) -> tuple[Array, Array]:
    """The twist of a link at time s, seen from a frame: a point p of it moves at V + W x p, both (3,)."""
    V, W, arm = np.zeros(3), np.zeros(3), robot.arm
    if frame == WORLD:
        W[2] = motion.drive[2]
        x, y, yaw = base_at(motion, s)
        V[0] = motion.drive[0] + motion.arc * math.cos(yaw) + W[2] * y
        V[1] = motion.drive[1] + motion.arc * math.sin(yaw) - W[2] * x
    for k in range(max(frame, BASE) + 1, link + 1):
        moves = w = scaled(turned(frames[k], row(arm.axis, k)), motion.bend[k])
        if arm.revolute[k]:
            W[0], W[1], W[2] = plus(W, w)
            moves = cross(frames[k, :3, 3], w)
        V[0], V[1], V[2] = plus(V, moves)
    return V, W
