"""Serial chains: joints, limits, frames and forward kinematics.

The plain numpy forward kinematics here is the reference: `regionik.verify` trusts it and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

JointKind = Literal["revolute", "prismatic"]


@dataclass(frozen=True, eq=False)
class Joint:
    """One degree of freedom.

    Attributes
    ----------
    name : str
    kind : {"revolute", "prismatic"}
    lower, upper : float
        Limits [rad] or [m]; infinite where there are none.
    T_parent_joint : (4, 4) array
        Fixed transform from the parent link to the joint at zero.
    axis : (3,) array
        Unit axis in the joint frame.
    velocity : float
        Speed limit [rad/s] or [m/s].
    """

    name: str
    kind: JointKind
    lower: float
    upper: float
    T_parent_joint: Array
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    velocity: float = np.inf

    def __post_init__(self) -> None:
        if np.isnan(self.lower) or np.isnan(self.upper) or self.lower > self.upper:
            raise InputError(
                f"joint {self.name}: limits must be lower <= upper, got {self.lower} and {self.upper}"
            )
        object.__setattr__(
            self, "T_parent_joint", frozen(self.T_parent_joint, (4, 4), f"joint {self.name}: frame")
        )
        axis = frozen(self.axis, (3,), f"joint {self.name}: axis")
        norm = float(np.linalg.norm(axis))
        if norm < 1e-9:
            raise InputError(f"joint {self.name}: axis must not be zero")
        if abs(norm - 1.0) > 1e-12:  # a unit vector stays as it is, so that files read back equal
            axis = frozen(axis / norm, (3,), "axis")
        object.__setattr__(self, "axis", axis)


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints in order from the arm's base frame to its tool frame.

    Attributes
    ----------
    joints : tuple of Joint
    T_last_tool : (4, 4) array
        Fixed transform from the last joint's link to the tool frame.
    """

    joints: tuple[Joint, ...]
    T_last_tool: Array

    def __post_init__(self) -> None:
        if not self.joints:
            raise InputError("chain: expected at least one joint")
        names = [joint.name for joint in self.joints]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"chain: joint names must differ, got {', '.join(twice)} twice")
        object.__setattr__(self, "T_last_tool", frozen(self.T_last_tool, (4, 4), "tool frame"))

    @property
    def dof(self) -> int:
        return len(self.joints)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def lower(self) -> Array:
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> Array:
        return np.array([joint.upper for joint in self.joints])

    def frames(self, joints: ArrayLike) -> Array:
        """Pose of every link in the arm's base frame, then of the tool.

        Parameters
        ----------
        joints : (..., dof) array_like
            [rad] or [m].

        Returns
        -------
        (..., dof + 1, 4, 4) array
            ``[..., k, :, :]`` is the frame of the link that joint k moves; the last is the tool.
        """
        q = np.asarray(joints, dtype=np.float64)
        if q.shape[-1:] != (self.dof,):
            raise InputError(f"joints: expected {self.dof} values, got shape {q.shape}")
        T = np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4))
        frames = np.empty((*q.shape[:-1], self.dof + 1, 4, 4))
        for k, joint in enumerate(self.joints):
            T = T @ joint.T_parent_joint @ motion(joint, q[..., k])
            frames[..., k, :, :] = T
        frames[..., self.dof, :, :] = T @ self.T_last_tool
        return frames

    def forward(self, joints: ArrayLike) -> Array:
        """Tool frame in the arm's base frame, (..., 4, 4)."""
        tool: Array = self.frames(joints)[..., -1, :, :]
        return tool


def motion(joint: Joint, value: Array) -> Array:
    """Transform of a joint moved by ``value`` (...,), as (..., 4, 4); Rodrigues' formula."""
    T = np.zeros((*np.shape(value), 4, 4))
    T[...] = np.eye(4)
    if joint.kind == "prismatic":
        T[..., :3, 3] = np.multiply.outer(value, joint.axis)
        return T
    x, y, z = joint.axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(value)[..., None, None], np.cos(value)[..., None, None]
    T[..., :3, :3] = np.eye(3) + s * cross + (1 - c) * (cross @ cross)
    return T


def chain_from_dh(rows: Sequence[Sequence[float]], names: Sequence[str] | None = None) -> Chain:
    """Chain from standard Denavit-Hartenberg rows.

    Parameters
    ----------
    rows : sequence of (theta, d, a, alpha, lower, upper)
        [rad] and [m]; ``theta`` is added to the joint's value, limits bound the joint's value.
    names : sequence of str, optional
        Joint names; ``joint_1`` and so on by default.
    """
    if names is not None and len(names) != len(rows):
        raise InputError(f"dh: expected {len(rows)} joint names, got {len(names)}")
    fixed = np.eye(4)
    joints = []
    for k, row in enumerate(rows):
        if len(row) != 6:
            raise InputError(f"dh[{k}]: expected theta, d, a, alpha, lower, upper, got {len(row)} numbers")
        theta, d, a, alpha, lower, upper = row
        name = names[k] if names is not None else f"joint_{k + 1}"
        joints.append(Joint(name, "revolute", lower, upper, fixed @ rot_z(theta)))
        fixed = translation(a, 0.0, d) @ rot_x(alpha)
    return Chain(tuple(joints), fixed)


def translation(x: float, y: float, z: float) -> Array:
    """Pure translation, (4, 4)."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def rot_x(angle: float) -> Array:
    """Rotation about x, (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def rot_y(angle: float) -> Array:
    """Rotation about y, (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def rot_z(angle: float) -> Array:
    """Rotation about z, (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def planar_pose(x: float, y: float, yaw: float, z: float = 0.0) -> Array:
    """Frame at (x, y, z) turned by yaw about z, (4, 4)."""
    return translation(x, y, z) @ rot_z(yaw)


def pose(position: Sequence[float], rpy: Sequence[float]) -> Array:
    """Transform from a position [m] and roll, pitch, yaw [rad] about fixed axes, (4, 4)."""
    roll, pitch, yaw = rpy
    return translation(*position) @ rot_z(yaw) @ rot_y(pitch) @ rot_x(roll)
