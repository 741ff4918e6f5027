"""Serial chains: limits, frames and forward kinematics.

This plain numpy forward kinematics is the reference: `regionik.verify` relies on it alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.worlds.arrays import Array, Mask, cross, frozen, one_line
from regionik.worlds.errors import InputError, located
from regionik.worlds.joints import Joint, nearest_turn
from regionik.worlds.prepared import Prepared

JOINT_SPARE = np.radians(2)  # that joints keep of their limits where they can [rad] or [m]
SPARE_SHARE = 0.1  # of a joint's range, where that is less
_ROTATION_TOLERANCE = 1e-6  # of a rotation matrix that a file gives


@dataclass(frozen=True, eq=False)
class Chain(Prepared):
    """Joints in order from the arm's base frame to its tool frame.

    Postures are values of its *active* joints, (..., dof); joints that mimic one of these follow it. There is
    one link for each of all n joints.

    Attributes
    ----------
    joints : tuple of Joint
    T_last_tool : (4, 4) array
        Fixed transform from the last joint's link to the tool frame.

    Examples
    --------
    >>> elbow = Joint("elbow", "revolute", -2.0, 2.0, np.eye(4))
    >>> Chain([elbow], translation(0.3, 0.0, 0.0)).forward([0.0])[:3, 3].tolist()
    [0.3, 0.0, 0.0]
    """

    joints: tuple[Joint, ...]
    T_last_tool: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(self.joints))
        if not self.joints:
            raise InputError("chain: expected at least one joint")
        names = [joint.name for joint in self.joints]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"chain: joint names must differ, got {', '.join(twice)} twice")
        active = {joint.name: joint for joint in self.joints if joint.mimic is None}
        object.__setattr__(self, "joints", tuple(_following(joint, active) for joint in self.joints))
        object.__setattr__(self, "T_last_tool", frozen(self.T_last_tool, (4, 4), "tool frame"))

    __repr__ = one_line

    @classmethod
    def from_dh(cls, rows: Sequence[Sequence[float]], names: Sequence[str] | None = None) -> Chain:
        """Return the chain of standard Denavit-Hartenberg rows.

        Parameters
        ----------
        rows : sequence of (theta, d, a, alpha, lower, upper)
            [rad] and [m]; ``theta`` is added to the joint's value, limits bound the joint's value.
        names : sequence of str, optional
            Joint names; ``joint_1`` and so on by default.

        Examples
        --------
        >>> Chain.from_dh([(0, 0, 0.3, 0, -2, 2), (0, 0, 0.2, 0, -2, 2)]).names
        ('joint_1', 'joint_2')
        """
        if names is not None and len(names) != len(rows):
            raise InputError(f"names: expected {len(rows)} joint names, got {len(names)}")
        fixed = np.eye(4)
        joints = []
        for k, row in enumerate(rows):
            if len(row) != 6:
                text = f"expected theta, d, a, alpha, lower, upper, got {len(row)} numbers"
                raise InputError(f"dh[{k}]: {text}")
            theta, d, a, alpha, lower, upper = row
            name = names[k] if names is not None else f"joint_{k + 1}"
            with located("", f"dh[{k}]"):
                joints.append(Joint(name, "revolute", lower, upper, fixed @ rot_z(theta)))
            fixed = translation(a, 0.0, d) @ rot_x(alpha)
        return cls(tuple(joints), fixed)

    def dh_rows(self) -> list[list[float]] | None:
        """Return the rows from which `from_dh` makes exactly this chain again; None where there are none."""
        plain = all(
            joint.kind == "revolute"
            and joint.velocity == joint.acceleration == np.inf
            and joint.axis.tolist() == [0.0, 0.0, 1.0]
            for joint in self.joints
        )
        if not plain or self.has_mimics:
            return None
        frames = [joint.T_parent_joint for joint in self.joints]
        theta = [_angle(-T[0, 1], T[0, 0]) for T in frames]
        rows = []
        for k, (joint, T_next) in enumerate(zip(self.joints, [*frames[1:], self.T_last_tool], strict=True)):
            alpha = _angle(-T_next[1, 2], T_next[2, 2])
            d, a = float(T_next[2, 3]), float(T_next[0, 3])
            rows.append([theta[k], d, a, alpha, float(joint.lower), float(joint.upper)])
        again = Chain.from_dh(rows, self.names)
        made = [*(joint.T_parent_joint for joint in again.joints), again.T_last_tool]
        exact = all(np.array_equal(T, M) for T, M in zip([*frames, self.T_last_tool], made, strict=True))
        return rows if exact else None

    @cached_property
    def active_joints(self) -> tuple[Joint, ...]:
        """Joints that mimic no other: their values are a posture."""
        return tuple(joint for joint in self.joints if joint.mimic is None)

    @property
    def has_mimics(self) -> bool:
        return self.dof < len(self.joints)

    @property
    def dof(self) -> int:
        return len(self.active_joints)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the active joints."""
        return tuple(joint.name for joint in self.active_joints)

    @property
    def lower(self) -> Array:
        return np.array([joint.lower for joint in self.active_joints])

    @property
    def upper(self) -> Array:
        return np.array([joint.upper for joint in self.active_joints])

    def room_to_limits(self, joints: Array) -> Array:
        """Return the least distance of postures (..., dof) to a limit, as a share of its range, (...)."""
        with np.errstate(invalid="ignore"):
            share = np.minimum(joints - self.lower, self.upper - joints) / (self.upper - self.lower)
        least: Array = np.where(np.isnan(share), 0.5, share).min(axis=-1)  # 0.5 without limits
        return least

    @cached_property
    def leaders(self) -> NDArray[np.intp]:
        """Index of the active joint that each joint follows or is, (n,)."""
        return np.array([self.names.index(j.mimic.joint if j.mimic else j.name) for j in self.joints])

    @cached_property
    def multipliers(self) -> Array:
        """Motion of each joint per unit of the active joint that it follows or is, (n,)."""
        return np.array([joint.mimic.multiplier if joint.mimic else 1.0 for joint in self.joints])

    @cached_property
    def offsets(self) -> Array:
        """Values of all joints where the active ones are at zero, (n,)."""
        return np.array([joint.mimic.offset if joint.mimic else 0.0 for joint in self.joints])

    @cached_property
    def coupling(self) -> Array:
        """Derivatives of the values of all joints by those of the active ones, (n, dof)."""
        return self.multipliers[:, None] * np.eye(self.dof)[self.leaders]

    @cached_property
    def turning(self) -> Mask:
        """Mask (dof,) of active joints whose whole turns change nothing: revolute ones that none mimics."""
        led = {joint.mimic.joint for joint in self.joints if joint.mimic}
        return np.array([j.kind == "revolute" and j.name not in led for j in self.active_joints])

    @cached_property
    def winding(self) -> Mask:
        """Mask (dof,) of joints that may turn more than once between their limits, and alone."""
        span = self.upper - self.lower
        found: Mask = self.turning & np.isfinite(span) & (span > 2 * np.pi)
        return found

    def unwound(self, joints: Array) -> Array:
        """Return joint values (..., dof), of those that wind the whole turn nearest to their middle.

        The robot stands the same. Joints that others mimic and those that turn once at most keep theirs.
        """
        found, some = np.array(joints), self.winding
        middle = (self.lower[some] + self.upper[some]) / 2
        found[..., some] = nearest_turn(found[..., some], middle)
        return found

    @cached_property
    def spare(self) -> Array:
        """Distance from their limits that joints (dof,) keep where they can [rad] or [m]."""
        found: Array = np.minimum(JOINT_SPARE, SPARE_SHARE * (self.upper - self.lower))
        return found

    def joint_values(self, joints: ArrayLike) -> Array:
        """Return the values of all joints (..., n) in postures (..., dof)."""
        return self.multipliers * np.asarray(joints, dtype=np.float64)[..., self.leaders] + self.offsets

    @property
    def unbounded(self) -> str | None:
        """Name the joint whose missing limits keep postures from being searched; None if there is none."""
        for joint, leader in zip(self.joints, self.leaders, strict=True):
            led = joint.mimic is not None
            if (joint.kind == "prismatic" or led) and not np.isfinite([joint.lower, joint.upper]).all():
                what = "a joint that others mimic" if led else "a sliding joint"
                return f"joint {self.names[leader]}: {what} needs limits"
        return None

    def frames(self, joints: ArrayLike) -> Array:
        """Return the pose of every link in the arm's base frame, then of the tool.

        Parameters
        ----------
        joints : (..., dof) array_like
            [rad] or [m].

        Returns
        -------
        (..., n + 1, 4, 4) array
            ``[..., k, :, :]`` is the frame of the link that joint k of all n moves; the last is the tool.
        """
        q = np.asarray(joints, dtype=np.float64)
        if q.shape[-1:] != (self.dof,):
            raise InputError(f"joints: expected {self.dof} values, got shape {q.shape}")
        values = np.moveaxis(self.joint_values(q), -1, 0)[..., None, None]
        still, sine, versine, slide = self._motions.reshape(4, -1, *(1,) * (q.ndim - 1), 4, 4)
        steps = still + np.sin(values) * sine + (1 - np.cos(values)) * versine + values * slide
        frames, T = np.empty((*q.shape[:-1], len(self.joints) + 1, 4, 4)), np.eye(4)
        for k in range(len(self.joints)):
            T = T @ steps[k]
            frames[..., k, :, :] = T
        frames[..., -1, :, :] = T @ self.T_last_tool
        return frames

    @cached_property
    def _motions(self) -> Array:
        """Parts (4, n, 4, 4) of all joints' transforms from link to link, by Rodrigues' formula.

        Those of the joint at zero, of its sine, of one less its cosine, and of its value where it slides.
        """
        crosses, slides = np.zeros((2, len(self.joints), 4, 4))
        crosses[self.revolute, :3, :3] = np.cross(self._axes[self.revolute, None], -np.eye(3))
        slides[~self.revolute, :3, 3] = self._axes[~self.revolute]
        T = np.array([joint.T_parent_joint for joint in self.joints])
        return np.array([T, T @ crosses, T @ crosses @ crosses, T @ slides])

    @cached_property
    def revolute(self) -> Mask:
        """Mask (n,) of all joints that turn."""
        return np.array([joint.kind == "revolute" for joint in self.joints])

    @cached_property
    def _axes(self) -> Array:
        return np.array([joint.axis for joint in self.joints])

    def forward(self, joints: ArrayLike) -> Array:
        """Return the tool frame in the arm's base frame, (..., 4, 4)."""
        tool: Array = self.frames(joints)[..., -1, :, :]
        return tool

    def point_jacobian(self, frames: Array, point: Array, moving: ArrayLike) -> Array:
        """Velocities of a point per unit speed of each active joint, (..., dof, 3).

        Link and tool frames (..., n + 1, 4, 4) and point (..., 3) are in one frame [m]; the first ``moving``
        (...) of all joints move the point.
        """
        axes = self._turned_axes(frames)
        turned = cross(axes, point[..., None, :] - frames[..., :-1, :3, 3])
        moves = np.arange(len(self.joints)) < np.asarray(moving)[..., None]
        columns = np.where(moves[..., None], np.where(self.revolute[:, None], turned, axes), 0.0)
        return np.asarray(self.coupling.T @ columns)

    def turn_jacobian(self, frames: Array) -> Array:
        """Angular velocities of the tool per unit speed of each active joint, (..., dof, 3)."""
        columns = np.where(self.revolute[:, None], self._turned_axes(frames), 0.0)
        return np.asarray(self.coupling.T @ columns)

    def _turned_axes(self, frames: Array) -> Array:
        """Axes of all joints where link and tool frames (..., n + 1, 4, 4) are, (..., n, 3)."""
        axes: Array = (frames[..., :-1, :3, :3] @ self._axes[:, :, None])[..., 0]
        return axes

    @property
    def link_vectors(self) -> Array:
        """Origin of the next joint, of the tool at last, in the frame of each link, (n, 3) [m]."""
        T_next = [*(joint.T_parent_joint for joint in self.joints[1:]), self.T_last_tool]
        return np.array([T[:3, 3] for T in T_next])

    @property
    def has_speed_limits(self) -> bool:
        """True where any joint has a limit of speed or acceleration."""
        return any(np.isfinite([one.velocity, one.acceleration]).any() for one in self.active_joints)

    def check_limits(self, joints: Sequence[float], what: str) -> None:
        """Refuse joint values of which one is outside its limits.

        Parameters
        ----------
        joints : sequence of float
            One value a joint [rad] or [m].
        what : str
            Name of the values in the error message.
        """
        if len(joints) != self.dof:
            raise InputError(
                f"{what}: expected {self.dof} values ({', '.join(self.names)}), got {len(joints)}"
            )
        for k, (joint, value) in enumerate(zip(self.active_joints, joints, strict=True)):
            if not joint.lower <= value <= joint.upper:
                limits = f"{joint.lower:.6g} to {joint.upper:.6g}"
                text = f"{joint.name} must be within its limits {limits}, got {value:.6g}"
                raise InputError(f"{what}[{k}]: {text}")


def _following(joint: Joint, active: dict[str, Joint]) -> Joint:
    """Return a joint itself, or the one that mimics an active joint with the limits that this gives it."""
    if joint.mimic is None:
        return joint
    if joint.mimic.joint not in active:
        expected = f"a joint that moves by itself, from the arm's base to its tool ({', '.join(active)})"
        raise InputError(f"joint {joint.name}: mimic: expected {expected}, got {joint.mimic.joint}")
    leader = active[joint.mimic.joint]
    lower, upper = joint.mimic.limits(leader.lower, leader.upper)
    return replace(joint, lower=lower, upper=upper)


def _angle(sine: float, cosine: float) -> float:
    """Return the angle whose sine and cosine are exactly these, if one is near; else the nearest."""
    nearest = float(np.arctan2(sine, cosine)) + 0.0
    candidate = float(np.nextafter(np.nextafter(nearest, -np.inf), -np.inf))
    for _ in range(5):
        if np.sin(candidate) == sine and np.cos(candidate) == cosine:
            return candidate
        candidate = float(np.nextafter(candidate, np.inf))
    return nearest


def translation(x: float, y: float, z: float) -> Array:
    """Return a pure translation, (4, 4)."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def rot_x(angle: float) -> Array:
    """Return a rotation about x, (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def rot_y(angle: float) -> Array:
    """Return a rotation about y, (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def rot_z(angle: float) -> Array:
    """Return a rotation about z, (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def planar_pose(x: float, y: float, yaw: float, z: float = 0.0) -> Array:
    """Return the frame at (x, y, z) turned by yaw about z, (4, 4)."""
    return translation(x, y, z) @ rot_z(yaw)


def pose(position: Sequence[float], rpy: Sequence[float]) -> Array:
    """Return the transform of a position [m] and roll, pitch, yaw [rad] about fixed axes, (4, 4)."""
    roll, pitch, yaw = rpy
    return translation(*position) @ rot_z(yaw) @ rot_y(pitch) @ rot_x(roll)


def spread_postures(chain: Chain, reach: float, count: int, seed: int) -> Array:
    """Return postures (count, dof) drawn evenly within the limits; without any, within a turn or a reach.

    Of joints that turn more than once, by the turn that is nearest to the middle.
    """
    width = np.array([2 * np.pi if joint.kind == "revolute" else reach for joint in chain.active_joints])
    lower = np.where(np.isfinite(chain.lower), chain.lower, chain.upper - width)
    lower = np.where(np.isfinite(lower), lower, -0.5 * width)
    upper = np.where(np.isfinite(chain.upper), chain.upper, lower + width)
    return chain.unwound(np.random.default_rng(seed).uniform(lower, upper, (count, chain.dof)))


def within_half_turns(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return limits with half a turn to either side in place of those that are infinite."""
    return np.where(np.isfinite(lower), lower, -np.pi), np.where(np.isfinite(upper), upper, np.pi)


def check_rotation(matrix: Array) -> Array:
    """Return a matrix (3, 3) itself, once it is known to be a rotation."""
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > _ROTATION_TOLERANCE or np.linalg.det(matrix) < 0:
        raise InputError("expected a rotation matrix (right-handed, unit rows at right angles)")
    return matrix
