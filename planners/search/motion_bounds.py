"""Bounds of the motion of an arm's points while its joints stay within a box.

The joints are moved one after the other, from the last to the first. When joint k moves, the joints before it
are still at the box's centre: its axis is that of the centre posture, and the point is at its distance there
plus the motion by the joints behind. A turn by an angle moves a point by the chord.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.vectors import cross, minus, norm
from regionik.planners.kernels import compiled
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array, Index
from regionik.worlds.chain import Chain
from regionik.worlds.links import LinkCapsule

MAX_PARALLEL_SINE = 1e-12  # sine of the angle between axes that count as parallel


class LinkCapsules(NamedTuple):
    """The capsules of an arm's links for kernels, and the longest levers of their points in any posture.

    A lever is 1 for sliding joints, and 0 for joints behind the point.
    """

    link: Index  # (s,)
    ends: Array  # (s, 2, 3) in the frame of the link [m]
    radius: Array  # (s,) [m]
    levers: Array  # (1 + 2 s, n) distance of the tool and of the ends from each joint's axis, at most [m]


def link_capsules(chain: Chain, solids: Sequence[LinkCapsule]) -> LinkCapsules:
    """Flatten the capsules of an arm; the limits of sliding joints must be finite."""
    ends = np.array([solid.corners for solid in solids]).reshape(-1, 2, 3)
    points = [(len(chain.joints) - 1, chain.T_last_tool[:3, 3])]
    points += [(solid.link, end) for solid, pair in zip(solids, ends, strict=True) for end in pair]
    return LinkCapsules(
        np.array([solid.link for solid in solids], dtype=np.int64),
        ends,
        np.array([solid.radius for solid in solids], dtype=np.float64),
        np.array([longest_levers(chain, link, point)[0] for link, point in points]),
    )


def longest_levers(chain: Chain, link: int, point: Array) -> tuple[Array, float]:
    """Bounds over all postures: distance from each joint's axis, (n,), and from the first joint [m].

    Axes that run parallel keep the part of an offset along them out of the sum.
    """
    levers = np.zeros(len(chain.joints))
    offset, reach, beyond = np.asarray(point), 0.0, 0.0
    for k in range(link, -1, -1):
        joint = chain.joints[k]
        turns = joint.kind == "revolute"
        travel = 0.0 if turns else max(abs(joint.lower), abs(joint.upper))
        reach += float(np.linalg.norm(offset)) + travel
        levers[k] = float(np.linalg.norm(np.cross(joint.axis, offset))) + beyond if turns else 1.0
        if k > 0:
            axis = joint.T_parent_joint[:3, :3] @ joint.axis
            tilt = float(np.linalg.norm(np.cross(axis, chain.joints[k - 1].axis)))
            beyond = float(levers[k]) if turns and tilt < MAX_PARALLEL_SINE else reach
            offset = joint.T_parent_joint[:3, 3]
    return levers, reach


def second_derivatives(chain: Chain, levers: Array) -> Array:
    """Bounds of a point's second derivatives, (dof, dof): the later joint's speed, turned by the earlier one.

    The point's levers (n,) are those of `longest_levers`.
    """
    bend, coupling = np.zeros((len(levers), len(levers))), np.abs(chain.coupling)
    for j, joint in enumerate(chain.joints):
        if joint.kind == "revolute":
            bend[j, j:] = bend[j:, j] = levers[j:]
    folded: Array = coupling.T @ bend @ coupling
    return folded


@compiled
def from_axis(frame: Array, axis: Array, point: Array) -> float:
    """Distance of a point from the axis of a joint [m]."""
    return norm(cross(axis, minus(point, frame[:3, 3])))


@compiled
def chords(arm: SerialArm, half: Array, chord: Array) -> None:
    """Longest chord of the unit circle that the half width of each of all joints (n,) spans; slides' own."""
    for k in range(len(half)):
        chord[k] = 2.0 * math.sin(0.5 * min(half[k], np.pi)) if arm.revolute[k] else half[k]


@compiled
def displacement(
    arm: SerialArm,
    frames: Array,
    axes: Array,
    chord: Array,
    levers: Array,
    last: int,
    first: int,
    point: Array,
) -> float:
    """Most that joints ``last`` down to ``first`` move a point fixed to link ``last`` [m]."""
    moved = 0.0
    for k in range(last, first - 1, -1):
        off = 1.0
        if arm.revolute[k]:
            off = min(from_axis(frames[k], axes[k], point) + moved, levers[k])
        moved += chord[k] * off
    return moved


@compiled
def displacement_from_tool(
    arm: SerialArm, frames: Array, axes: Array, chord: Array, levers: Array, link: int, point: Array
) -> float:
    """Most that a point of a link moves against the tool; ``levers`` are those of the tool [m]."""
    n = len(axes)
    tool = frames[n, :3, 3]
    moved = displacement(arm, frames, axes, chord, levers, n - 1, link + 1, tool)
    off = minus(point, tool)
    for k in range(link, -1, -1):
        if arm.revolute[k]:  # turns tool and point together
            moved += chord[k] * (norm(cross(axes[k], off)) + moved)
    return moved


@compiled
def tool_displacement(
    arm: SerialArm, frames: Array, axes: Array, chord: Array, half: Array, levers: Array
) -> tuple[float, float]:
    """Most that the tool moves, and most that this differs from the linear motion by the Jacobian [m]."""
    n = len(half)
    tool = frames[n, :3, 3]
    moved = bent = 0.0
    for k in range(n - 1, -1, -1):
        if arm.revolute[k]:
            off = min(from_axis(frames[k], axes[k], tool) + moved, levers[k])
            # |turn by d, less its linear part| <= d^2 / 2, and the lever itself has moved
            bent += 0.5 * half[k] * half[k] * off + half[k] * moved
            moved += chord[k] * off
        else:
            moved += chord[k]
    return moved, bent
