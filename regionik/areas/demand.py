"""What a set-point asks of the tool: for arms, for kernels, and on the way from one set-point to the next."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, POSITION, Aim
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.pivot import is_planar
from regionik.worlds.planar import planar_arm
from regionik.worlds.scene import Target

_ANY_TURN = np.zeros((3, 3))  # what kernels are given where they do not look
HELD = 0.5  # share of a cone that arms are solved to; the rest is left for the way between two states


def in_plane(chain: Chain, target: Target) -> bool:
    """Whether the arm meets the target in its own plane; any other is solved as a chain of rigid bodies."""
    return is_planar(chain) and (target.direction is None or planar_arm(chain).tool_along_link)


def aim_of(target: Target) -> Aim:
    """The target as kernels take it, its cone as narrow as arms are solved to."""
    turn, kind = _ANY_TURN, POSITION
    if target.orientation is not None:
        turn, kind = np.array(target.orientation), ORIENTATION
    elif target.direction is not None:
        turn, kind = np.outer(target.direction, [0.0, 0.0, 1.0]), DIRECTION
    return Aim(np.array(target.position), kind, turn, HELD * target.cone)


def misses(target: Target, tool: Array) -> tuple[float, float]:
    """How far a tool frame (4, 4) is off in position [m], and in axis or turn where one is asked [rad]."""
    return float(np.linalg.norm(tool[:3, 3] - target.position)), deviation(target, tool[:3, :3])


def deviation(target: Target, turn: Array) -> float:
    """Angle by which a tool frame (3, 3) is off what the target asks; 0 where it asks for none [rad]."""
    if target.orientation is not None:
        left = target.orientation.T @ turn
        twist = (left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1])
        return float(np.arctan2(np.linalg.norm(twist), left[0, 0] + left[1, 1] + left[2, 2] - 1.0))
    if target.direction is not None:
        return _angle(turn[:, 2], target.direction)
    return 0.0


def between(a: Target, b: Target, share: float) -> Target:
    """What the tool does at a share of the way: it goes straight, its axis or its frame turns evenly.

    A direction goes along the shorter arc, an orientation the shorter way; what only one end asks for,
    nothing on the way does. The cone goes evenly from one to the other.
    """
    if a is b or share <= 0.0:
        return a
    if share >= 1.0:
        return b
    position, cone = a.position + share * (b.position - a.position), a.cone + share * (b.cone - a.cone)
    if a.orientation is not None and b.orientation is not None:
        way = Rotation.from_matrix(a.orientation.T @ b.orientation).as_rotvec()
        turn = a.orientation @ Rotation.from_rotvec(share * way).as_matrix()
        return Target(position, cone=cone, orientation=turn)
    if a.direction is not None and b.direction is not None:
        return Target(position, _along_arc(a.direction, b.direction, share), cone)
    return Target(position)


def _along_arc(a: Array, b: Array, share: float) -> Array:
    angle = _angle(a, b)
    if angle < 1e-9 or np.pi - angle < 1e-9:  # the same, or no arc is the shorter one
        return a if share < 0.5 else b
    way: Array = (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    return way / np.linalg.norm(way)


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
