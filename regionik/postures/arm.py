"""Goals of the tool, and the interface of the solvers that bring an arm to them.

`planar_solver` solves arms that work in one vertical plane, `serial_solver` any other. Both take the pivot as
endless: `mfabrik` shares its turn between joint and base.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.solvers.damped_least_squares import (
    DIRECTION,
    ORIENTATION,
    POSITION,
    Aim,
    turns_left,
)
from regionik.planners.solvers.serial_chain import rotation_about
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target

Goal = Literal["point", "direction", "orientation"]

CONE_SHARE = 0.5  # of a cone that arms are solved to; the rest is left for the way between two states
ANGLE_SLACK = 1e-9  # rounding allowed at the edge of a cone [rad]
UNTOLD = np.empty(0)  # history of a solve that nobody asks for
_ANY_TURN = np.zeros((3, 3))  # for kernels that do not read it


@dataclass(frozen=True, eq=False)
class ArmSolution:
    """Place of the arm axis and joints that reach a target, the pivot counted from a given heading."""

    axis: Array  # (2,) [m]
    joints: Array  # (dof,)
    error: float  # [m]
    iterations: int
    angle: float = 0.0  # by which the tool points, or is turned, out of its cone [rad]
    meets: bool = True  # the thresholds of the criteria


class Arm(Protocol):
    """Inverse kinematics of an arm on a base with a given heading."""

    def reach(
        self,
        target: Target,
        axis: Array,
        yaw: float,
        joints: Array,
        area: FlatPolygon,
        mobile: bool,
        history: Array = UNTOLD,
    ) -> ArmSolution:
        """Bring the tool to a target; a mobile base follows inside the area, any other stays.

        Of a point and a mobile base as many errors as the history holds are written there, by iteration [m].
        """

    def least_change(self, target: Target, axis: Array, yaw: float, joints: Array) -> ArmSolution | None:
        """Return the posture on target that changes least, on a fixed base."""

    def self_motion(
        self, target: Target, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[ArmSolution]:
        """Return postures on target of many kinds, on a fixed base."""


def goal_of(target: Target) -> Goal:
    """Return what a set-point asks of the tool: its point alone, its axis too, or its whole frame."""
    if target.orientation is not None:
        return "orientation"
    return "point" if target.direction is None else "direction"


def aim_of(target: Target) -> Aim:
    """Return a target as kernels take it, its cone as narrow as arms are solved to."""
    turn, kind = _ANY_TURN, POSITION
    if target.orientation is not None:
        turn, kind = np.array(target.orientation), ORIENTATION
    elif target.direction is not None:
        turn, kind = np.outer(target.direction, [0.0, 0.0, 1.0]), DIRECTION
    return Aim(np.array(target.position), kind, turn, CONE_SHARE * target.cone)


def goal_error(target: Target, tool: Array) -> tuple[float, float]:
    """Error of a tool frame (4, 4) in position [m], and in axis or turn where one is asked [rad]."""
    return float(np.linalg.norm(tool[:3, 3] - target.position)), deviation(target, tool[:3, :3])


def deviation(target: Target, turn: Array) -> float:
    """Angle between a tool frame (3, 3) and the axis or frame of a target; 0 where it has none [rad]."""
    if target.orientation is not None:
        left = target.orientation.T @ turn
        twist = (left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1])
        return float(np.arctan2(np.linalg.norm(twist), left[0, 0] + left[1, 1] + left[2, 2] - 1.0))
    if target.direction is not None:
        return _angle(turn[:, 2], target.direction)
    return 0.0


def goal_between(a: Target, b: Target, share: float) -> Target:
    """Goal at a share of the way; see `goals_between`."""
    if share <= 0.0:
        return a
    return b if share >= 1.0 else goals_between(a, b, np.array([share]))[0]


def goals_between(a: Target, b: Target, shares: Array) -> list[Target]:
    """Goals at shares (n,) of the way: the tool goes straight, its axis or its frame turns evenly.

    A direction goes along the shorter arc, an orientation the shorter way; what only one end asks for is not
    asked on the way. The cone goes evenly from one to the other.
    """
    if a is b or not len(shares):
        return [a] * len(shares)
    asked: list[dict[str, Any]] = [{}] * len(shares)
    if a.orientation is not None and b.orientation is not None:
        way = turns_left(np.array([ORIENTATION]), b.orientation[None].copy(), a.orientation[None].copy())[0]
        angle = float(np.linalg.norm(way))
        axis = way / max(angle, 1e-300)
        turns = np.array([rotation_about(axis, share * angle) for share in shares.tolist()])
        asked = [{"orientation": turn} for turn in turns @ a.orientation]
    elif a.direction is not None and b.direction is not None:
        asked = [{"direction": _along_arc(a.direction, b.direction, share)} for share in shares.tolist()]
    positions = a.position + shares[:, None] * (b.position - a.position)
    cones = a.cone + shares * (b.cone - a.cone)
    rows = zip(positions, cones.tolist(), asked, strict=True)
    return [Target(position, cone=cone, **axes) for position, cone, axes in rows]


def _along_arc(a: Array, b: Array, share: float) -> Array:
    """Direction at a share of the arc between two (spherical linear interpolation)."""
    angle = _angle(a, b)
    if angle < 1e-9 or np.pi - angle < 1e-9:  # the same, or no arc is the shorter one
        return a if share < 0.5 else b
    way: Array = (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    return way / np.linalg.norm(way)


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
