"""Joints: what moves between two links, and joints that mimic others."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen, one_line, unit_vector
from regionik.worlds.errors import InputError

JointKind = Literal["revolute", "prismatic"]


@dataclass(frozen=True)
class Mimic:
    """The coupling of a joint without a drive to another joint: ``multiplier * joint + offset``."""

    joint: str  # name of an active joint of the same chain
    multiplier: float = 1.0
    offset: float = 0.0  # [rad] or [m]

    def __post_init__(self) -> None:
        if not np.isfinite([self.multiplier, self.offset]).all():
            raise InputError("mimic: expected a finite multiplier and a finite offset")

    def limits(self, lower: float, upper: float) -> tuple[float, float]:
        """Return the limits of what follows a joint that has these limits."""
        low, high = (
            sorted((self.multiplier * lower, self.multiplier * upper)) if self.multiplier else (0.0, 0.0)
        )
        return low + self.offset, high + self.offset

    def leader_limits(self, lower: float, upper: float) -> tuple[float, float]:
        """Return the limits of a joint so that what follows it keeps these limits."""
        if not self.multiplier:
            return -np.inf, np.inf
        low, high = sorted((end - self.offset) / self.multiplier for end in (lower, upper))
        return low, high


@dataclass(frozen=True, eq=False)
class Joint:
    """One motion between two links: a degree of freedom, unless it mimics another joint.

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
    acceleration : float
        Limit of acceleration [rad/s2] or [m/s2].
    mimic : Mimic, optional
        The joint that it follows. A chain gives it the limits that it has by that.
    """

    name: str
    kind: JointKind
    lower: float
    upper: float
    T_parent_joint: Array
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    velocity: float = np.inf
    acceleration: float = np.inf
    mimic: Mimic | None = None

    def __post_init__(self) -> None:
        what = f"joint {self.name}"
        if np.isnan(self.lower) or np.isnan(self.upper) or self.lower > self.upper:
            raise InputError(
                f"{what}: expected lower limit <= upper limit, got {self.lower:g} and {self.upper:g}"
            )
        object.__setattr__(self, "T_parent_joint", frozen(self.T_parent_joint, (4, 4), f"{what}: frame"))
        object.__setattr__(self, "axis", unit_vector(self.axis, f"{what}: axis"))

    def transform(self, value: ArrayLike) -> Array:
        """Return the transform (..., 4, 4) of the joint at values (...,) [rad] or [m]; Rodrigues' formula."""
        q = np.asarray(value)
        T = np.zeros((*q.shape, 4, 4))
        T[...] = np.eye(4)
        if self.kind == "prismatic":
            T[..., :3, 3] = np.multiply.outer(q, self.axis)
            return T
        x, y, z = self.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        s, c = np.sin(q)[..., None, None], np.cos(q)[..., None, None]
        T[..., :3, :3] = np.eye(3) + s * cross + (1 - c) * (cross @ cross)
        return T

    __repr__ = one_line


def nearest_turn(angles: Array, near: Array | float = 0.0) -> Array:
    """Return angles plus whole turns, each the nearest to another one [rad].

    >>> nearest_turn(np.array([4.0, -7.0]), 3.0).round(3).tolist()
    [4.0, 5.566]
    """
    turned: Array = near + np.remainder(angles - near + np.pi, 2 * np.pi) - np.pi
    return turned
