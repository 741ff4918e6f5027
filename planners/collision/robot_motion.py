"""Solids of links, what they keep away from, and a motion between two states, as values for kernels."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.driving.arcs import arc_end, arc_towards
from regionik.planners.geometry.polygons import Index, compiled
from regionik.planners.solvers.serial_chain import SerialArm, chain_frames, chain_on
from regionik.worlds.arrays import Array

WORLD, BASE = -2, -1  # frames of hulls that no link carries
_HERE = np.eye(4)


class Hop(NamedTuple):
    """A motion between two states: the base slides and turns evenly, and rolls along its heading besides."""

    base: Array  # (3,) x, y [m], yaw [rad]
    drive: Array  # (3,) what is added to it evenly: all of the way of an omnidirectional base
    arc: float  # what a base on wheels rolls, below 0 in reverse [m]
    joints: Array  # (dof,)
    bend: Array  # (dof,) what is added to them


@compiled
def hop_between(base_a: Array, joints_a: Array, base_b: Array, joints_b: Array, rolls: bool) -> Hop:
    """The motion between two states; the base turns the shorter way, and slides there or rolls."""
    drive, arc = base_b - base_a, 0.0
    drive[2] = (drive[2] + math.pi) % (2 * math.pi) - math.pi
    if rolls:
        x, y, yaw = base_a[0], base_a[1], base_a[2]
        arc, drive[0], drive[1] = arc_towards(x, y, yaw, x + drive[0], y + drive[1], drive[2])
    return Hop(base_a, drive, arc, joints_a, joints_b - joints_a)


@compiled
def stand(hop: Hop, s: float) -> tuple[float, float, float]:
    """Base pose at part s of a hop."""
    x, y, yaw = arc_end(hop.base[0], hop.base[1], hop.base[2], s * hop.arc, s * hop.drive[2])
    return x + s * hop.drive[0], y + s * hop.drive[1], yaw


@compiled
def place(arm: SerialArm, mount: Array, hop: Hop, s: float, frame: int, frames: Array) -> None:
    """Write the frames of links, tool and base (n + 2, 4, 4) at part s of a hop.

    They are seen from a link, the base or the world; the base comes last, so that its link is ``BASE``.
    """
    joints = hop.joints + s * hop.bend
    if frame == WORLD:
        x, y, yaw = stand(hop, s)
        _on_floor(mount, x, y, yaw, frames[0])
        chain_on(arm, joints, frames)
        _on_floor(_HERE, x, y, yaw, frames[BASE])
    elif frame == BASE:
        frames[0], frames[BASE] = mount, _HERE
        chain_on(arm, joints, frames)
    else:
        chain_frames(arm, joints, frames)
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
def tools_on(arm: SerialArm, mount: Array, bases: Array, joints: Array, rolls: bool, shares: Array) -> Array:
    """Tool frames in the world at k parts of every hop through states (n + 1, ...), (n, k, 4, 4)."""
    tools, frames = np.empty((len(bases) - 1, len(shares), 4, 4)), np.empty((len(arm.axis) + 2, 4, 4))
    for i in range(len(tools)):
        hop = hop_between(bases[i], joints[i], bases[i + 1], joints[i + 1], rolls)
        for k in range(len(shares)):
            place(arm, mount, hop, shares[k], WORLD, frames)
            tools[i, k] = frames[-2]
    return tools


@compiled
def hops_led(
    arm: SerialArm,
    mount: Array,
    bases: Array,
    joints: Array,
    rolls: bool,
    line: Array,
    shares: Array,
    stray: float,
    bend: float,
    step: float,
) -> int:
    """How many hops through states (n + 1, ...) lead the tool along a line before the first that does not.

    Parameters
    ----------
    line : (n + 1, 3) array
        Where the tool is at every state; it goes straight in between [m].
    shares : (k,) array
        Parts of a hop at which it is looked at.
    stray : float
        What it may be off [m].
    bend, step : float
        Most that a joint or the heading, and the base's place, may change on a hop [rad], [m].
    """
    frames = np.empty((len(arm.axis) + 2, 4, 4))
    for n in range(len(bases) - 1):
        hop = hop_between(bases[n], joints[n], bases[n + 1], joints[n + 1], rolls)
        way = bases[n + 1] - bases[n]
        if math.hypot(way[0], way[1]) > step or max(abs(hop.drive[2]), np.abs(hop.bend).max()) > bend:
            return n
        for s in shares:
            place(arm, mount, hop, s, WORLD, frames)
            off = 0.0
            for i in range(3):
                off += (frames[-2, i, 3] - s * (line[n + 1, i] - line[n, i]) - line[n, i]) ** 2
            if off > stray * stray:
                return n
    return len(bases) - 1


@compiled
def put(frame: Array, points: Array, out: Array) -> None:
    """Write points (n, 3) of a frame, seen from where the frame is seen."""
    for k in range(len(points)):
        for i in range(3):
            out[k, i] = (
                frame[i, 0] * points[k, 0]
                + frame[i, 1] * points[k, 1]
                + frame[i, 2] * points[k, 2]
                + frame[i, 3]
            )


@compiled
def pace(arm: SerialArm, mount: Array, hop: Hop, link: int, frame: int, points: Array) -> tuple[float, float]:
    """Most speed [m per hop] and acceleration [m per hop^2] of points fixed to a link, seen from a frame.

    Frame by frame from the link inwards: a joint that turns at rate w under a point that moves at speed v at
    a distance r of its axis adds w^2 r + 2 w v to the acceleration and w r to the speed.
    """
    far, lever = 0.0, 0.0  # from the joint's origin, and from its axis
    x, y, z = arm.axis[link, 0], arm.axis[link, 1], arm.axis[link, 2]
    for p in points:
        square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
        along = x * p[0] + y * p[1] + z * p[2]
        far = max(far, math.sqrt(square))
        lever = max(lever, math.sqrt(max(0.0, square - along * along)))
    speed, acceleration = 0.0, 0.0
    for k in range(link, max(frame, BASE), -1):
        rate = abs(hop.bend[k])
        if arm.revolute[k]:
            acceleration += rate * rate * lever + 2 * rate * speed
            speed += rate * lever
        else:
            speed += rate
            far += max(abs(hop.joints[k]), abs(hop.joints[k] + hop.bend[k]))
        step = arm.fixed[k]
        far += math.sqrt(step[0, 3] ** 2 + step[1, 3] ** 2 + step[2, 3] ** 2)
        lever = far
    if frame == WORLD:
        rate = abs(hop.drive[2])
        lever = far + math.hypot(mount[0, 3], mount[1, 3])
        acceleration += rate * (rate * lever + 2 * speed + abs(hop.arc))
        speed += rate * lever + math.hypot(hop.drive[0], hop.drive[1]) + abs(hop.arc)
    return speed, acceleration


@compiled
def twist(
    arm: SerialArm, hop: Hop, frames: Array, s: float, link: int, frame: int, V: Array, W: Array
) -> None:
    """Write how a link moves, seen from a frame: a point p of it has velocity V + W x p [m per hop]."""
    V[:] = 0.0
    W[:] = 0.0
    if frame == WORLD:
        W[2] = hop.drive[2]
        x, y, yaw = stand(hop, s)
        V[0] = hop.drive[0] + hop.arc * math.cos(yaw) + W[2] * y
        V[1] = hop.drive[1] + hop.arc * math.sin(yaw) - W[2] * x
    w = np.empty(3)
    for k in range(max(frame, BASE) + 1, link + 1):
        T = frames[k]
        for i in range(3):
            w[i] = hop.bend[k] * (
                T[i, 0] * arm.axis[k, 0] + T[i, 1] * arm.axis[k, 1] + T[i, 2] * arm.axis[k, 2]
            )
        if arm.revolute[k]:
            for i in range(3):
                W[i] += w[i]
            V[0] += T[1, 3] * w[2] - T[2, 3] * w[1]
            V[1] += T[2, 3] * w[0] - T[0, 3] * w[2]
            V[2] += T[0, 3] * w[1] - T[1, 3] * w[0]
        else:
            for i in range(3):
                V[i] += w[i]


@compiled
def bases_between(knots: Array, leg: Index, share: Array, rolls: bool) -> Array:
    """Base poses (n, 3) at shares (n,) of legs (n,), on the way that every reader of a plan fills in.

    Headings run on from the first knot of a leg; where they are NaN, they stay so.
    """
    bases, still = np.empty((len(leg), 3)), np.empty(0)
    for n in range(len(leg)):
        hop = hop_between(knots[leg[n]], still, knots[leg[n] + 1], still, rolls)
        if rolls:
            bases[n, 0], bases[n, 1], bases[n, 2] = stand(hop, share[n])
        else:
            bases[n] = hop.base + share[n] * hop.drive
    return bases
