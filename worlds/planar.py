"""Arms that work in one vertical plane through their first axis.

The youBot and most small mobile arms are built so: a vertical pivot, then parallel horizontal hinges,
then at most a roll about the last link. In the plane, r points away from the pivot axis and z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

_ALIGNED = 1e-9


@dataclass(frozen=True, eq=False)
class PlanarArm:
    """The planar reading of a chain.

    Attributes
    ----------
    shoulder : (2,) array
        First hinge in the arm base frame: r, z [m].
    lengths : (m,) array
        Links from hinge to hinge, the last one to the tool [m].
    sign, offset : (m,) array
        Bend of link i against link i - 1 (of link 0 against the r axis), counter-clockwise from r to
        z: ``bend = sign * joint + offset`` [rad].
    lower, upper : (m,) array
        Limits of the bends [rad].
    pivot_lower, pivot_upper : float
        Limits of the first joint [rad].
    pivot_zero : float
        Direction of the plane, seen from above in the arm base frame, at joint zero [rad].
    roll : int or None
        Index of the joint that rolls about the last link, if there is one.
    """

    shoulder: Array
    lengths: Array
    sign: Array
    offset: Array
    lower: Array
    upper: Array
    pivot_lower: float
    pivot_upper: float
    pivot_zero: float
    roll: int | None

    @property
    def hinges(self) -> int:
        return len(self.lengths)

    def bends(self, joints: Array) -> Array:
        """Bends (..., m) of joint values (..., dof)."""
        values: Array = self.sign * joints[..., 1 : 1 + self.hinges] + self.offset
        return values

    def hinge_joints(self, bends: Array, near: Array) -> Array:
        """Joint values (..., m) of bends, each taken to the turn that lies within its limits.

        Where a joint has no limits, to the turn nearest to the joint values ``near`` (..., dof).
        """
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = self.bends(near)
        middle[..., bounded] = (self.lower[bounded] + self.upper[bounded]) / 2
        turned = middle + np.remainder(bends - middle + np.pi, 2 * np.pi) - np.pi
        values: Array = self.sign * (turned - self.offset)
        return values


def planar_arm(chain: Chain) -> PlanarArm:
    """Read a chain as a planar arm.

    Raises
    ------
    InputError
        When the chain is not: vertical pivot, three parallel horizontal hinges in the pivot's
        plane, and at most one roll about the last link.
    """
    frames = chain.frames(np.zeros(chain.dof))
    origins = frames[:, :3, 3]
    axes = np.array([f[:3, :3] @ j.axis for f, j in zip(frames, chain.joints, strict=False)])
    if any(joint.kind != "revolute" for joint in chain.joints):
        raise _not_planar("every joint must be revolute")
    pivot = chain.joints[0]
    if abs(axes[0, 2]) < 1 - _ALIGNED or np.hypot(*origins[0, :2]) > _ALIGNED:
        raise _not_planar("its first axis must be the vertical through its base frame")
    normal = axes[1] if chain.dof > 1 else np.zeros(3)
    hinges = 1
    while 1 + hinges < chain.dof and abs(axes[1 + hinges] @ normal) > 1 - _ALIGNED:
        hinges += 1
    if hinges != 3 or abs(normal[2]) > _ALIGNED:
        raise _not_planar("its first axis must be followed by three parallel horizontal hinges")
    rolls = range(1 + hinges, chain.dof)
    if len(rolls) > 1:
        raise _not_planar("at most one joint may follow the hinges")
    # At joint zero the plane is spanned by r (horizontal, normal to the hinges) and z; hinges turn from r
    # to z when their axis is r x z.
    r_axis = np.array([-normal[1], normal[0], 0.0])
    along = (origins - origins[0]) @ r_axis
    if along[1] < -_ALIGNED or (abs(along[1]) <= _ALIGNED and axes[1] @ _turn(r_axis) < 0):
        r_axis = -r_axis
    turn = _turn(r_axis)
    if np.abs(origins[1:] @ turn).max() > _ALIGNED:
        raise _not_planar("its hinges and tool must lie in the pivot's plane")
    points = np.column_stack([origins @ r_axis, origins[:, 2]])
    knots = np.vstack([points[1 : 1 + hinges], points[-1]])
    links = np.diff(knots, axis=0)
    lengths = np.hypot(links[:, 0], links[:, 1])
    if lengths.min() < 1e-6:
        raise _not_planar("its hinges and tool must lie apart")
    if rolls:
        last = frames[-2][:3, :3] @ chain.joints[-1].axis
        if np.linalg.norm(np.cross(last[[0, 1, 2]], origins[-1] - knots_3d(knots[-2], r_axis))) > _ALIGNED:
            raise _not_planar("the joint after the hinges must roll about the last link")
    sign = np.sign(axes[1 : 1 + hinges] @ turn)
    absolute = np.arctan2(links[:, 1], links[:, 0])
    offset = np.diff(absolute, prepend=0.0)
    limits = np.array([[j.lower, j.upper] for j in chain.joints[1 : 1 + hinges]])
    ends = np.sort(sign[:, None] * limits + offset[:, None], axis=1)
    up = np.sign(axes[0, 2])
    zero = float(np.arctan2(r_axis[1], r_axis[0]))
    if up < 0:
        raise _not_planar("its first axis must point up")
    return PlanarArm(
        shoulder=frozen(points[1], (2,), "shoulder"),
        lengths=frozen(lengths, (hinges,), "lengths"),
        sign=sign,
        offset=offset,
        lower=ends[:, 0],
        upper=ends[:, 1],
        pivot_lower=pivot.lower,
        pivot_upper=pivot.upper,
        pivot_zero=zero,
        roll=chain.dof - 1 if rolls else None,
    )


def knots_3d(knot: Array, r_axis: Array) -> Array:
    """A point of the plane at pivot zero, in the arm base frame."""
    point: Array = knot[0] * r_axis + np.array([0.0, 0.0, knot[1]])
    return point


def _turn(r_axis: Array) -> Array:
    """Axis about which a link turns from r to z."""
    return np.cross(r_axis, [0.0, 0.0, 1.0])


def _not_planar(what: str) -> InputError:
    return InputError(f"robot: this arm cannot be planned for yet: {what}")
