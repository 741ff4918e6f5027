"""Kinds of arms: those in one vertical plane, and those on a vertical pivot.

The youBot and most small mobile arms work in one plane: a vertical pivot, three parallel horizontal hinges,
and at most a roll about the last link. In the plane, r points away from the pivot axis and z up.

An arm without a pivot turns with its base: `with_pivot` puts one before it that stands still, and where the
base is placed its turn is given to the base.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain, rot_y, rot_z
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint, nearest_turn
from regionik.worlds.prepared import Prepared, made_once

_AXIS_TOLERANCE = 1e-9
_HINGES = 3
_MAX_HELD_RANGE = 1e-6  # limits nearer to each other than this hold a hinge still [rad]


@dataclass(frozen=True, eq=False)
class PlanarArm(Prepared):
    """A chain as an arm in one vertical plane.

    A bend of link i is its angle from link i - 1, of link 0 from the r axis, counter-clockwise from r to z:
    ``bend = sign * joint + offset`` [rad].
    """

    shoulder: Array  # (2,) first hinge in the arm base frame: r, z [m]
    lengths: Array  # (m,) links from hinge to hinge, the last one to the tool [m]
    sign: Array  # (m,)
    offset: Array  # (m,) [rad]
    lower: Array  # (m,) limits of the bends [rad]
    upper: Array
    pivot_zero: float  # direction of the plane, from above in the arm base frame, at joint zero [rad]
    roll: int | None  # index of the joint that rolls about the last link, if there is one
    tool_along_link: bool  # the tool's axis (its frame's z) points along the last link
    # (3, 3) tool frame at roll zero, seen from a frame whose x lies along the last link and whose y is the
    # plane's normal, r towards z being a turn about -y
    tool_turn: Array
    roll_sign: float  # sense in which the roll joint turns the tool about its own axis; 0 without one
    roll_lower: float  # limits of the roll joint [rad]
    roll_upper: float

    @property
    def hinges(self) -> int:
        return len(self.lengths)

    def bends(self, joints: Array) -> Array:
        """Return the bends (..., m) of joint values (..., dof)."""
        values: Array = self.sign * joints[..., 1 : 1 + self.hinges] + self.offset
        return values

    def hinge_joints(self, bends: Array, near: Array) -> Array:
        """Return the joint values (..., m) of bends, each by the full turn that lies within its limits.

        A joint without limits takes the turn nearest to the joint values ``near`` (..., dof).
        """
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = self.bends(near)
        middle[..., bounded] = (self.lower[bounded] + self.upper[bounded]) / 2
        values: Array = self.sign * (nearest_turn(bends, middle) - self.offset)
        return values


@made_once
def planar_arm(chain: Chain) -> PlanarArm:
    """Return a chain as a planar arm, or raise an `InputError`; cached, as every solver asks for it.

    A vertical pivot, three parallel horizontal hinges in its plane, and at most one roll about the last link.
    """
    if chain.has_mimics:
        raise _not_planar("no joint may mimic another")
    frames = chain.frames(np.zeros(chain.dof))
    origins = frames[:, :3, 3]
    axes = np.array([f[:3, :3] @ j.axis for f, j in zip(frames, chain.joints, strict=False)])
    _check_axes(chain, origins, axes)
    r_axis = _plane(origins, axes)
    turn = np.cross(r_axis, [0.0, 0.0, 1.0])
    if np.abs(origins[1:] @ turn).max() > _AXIS_TOLERANCE:
        raise _not_planar("its hinges and tool must lie in the pivot's plane")
    knots = np.column_stack([origins @ r_axis, origins[:, 2]])[[1, 2, 3, -1]]
    links = np.diff(knots, axis=0)
    lengths = np.hypot(links[:, 0], links[:, 1])
    if lengths.min() < 1e-6:
        raise _not_planar("its hinges and tool must lie apart")
    last = links[-1] / lengths[-1]
    along = last[0] * r_axis + np.array([0.0, 0.0, last[1]])
    rolls = chain.dof > 1 + _HINGES
    roll_lines = np.array([axes[-1], origins[-1] - origins[-2]])
    if rolls and np.abs(np.cross(roll_lines, along)).max() > _AXIS_TOLERANCE:
        raise _not_planar("the joint after the hinges must roll about the last link")
    sign = np.sign(axes[1 : 1 + _HINGES] @ turn)
    offset = np.diff(np.arctan2(links[:, 1], links[:, 0]), prepend=0.0)
    limits = np.array([[j.lower, j.upper] for j in chain.joints[1 : 1 + _HINGES]])
    ends = np.sort(sign[:, None] * limits + offset[:, None], axis=1)
    if np.count_nonzero(limits[:, 1] - limits[:, 0] < _MAX_HELD_RANGE) > 1:
        raise _not_planar("at most one hinge may be held still by its limits")
    pivot_zero, pitch = float(np.arctan2(r_axis[1], r_axis[0])), float(offset.sum())
    last_joint = chain.joints[-1]
    return PlanarArm(
        shoulder=frozen(knots[0], (2,), "shoulder"),
        lengths=frozen(lengths, (_HINGES,), "lengths"),
        sign=sign,
        offset=offset,
        lower=ends[:, 0],
        upper=ends[:, 1],
        pivot_zero=pivot_zero,
        roll=chain.dof - 1 if rolls else None,
        tool_along_link=bool(np.linalg.norm(frames[-1][:3, 2] - along) < _AXIS_TOLERANCE),
        tool_turn=(rot_y(pitch) @ rot_z(-pivot_zero) @ frames[-1])[:3, :3],
        roll_sign=float(np.sign(axes[-1] @ along)) if rolls else 0.0,
        roll_lower=last_joint.lower if rolls else 0.0,
        roll_upper=last_joint.upper if rolls else 0.0,
    )


def _check_axes(chain: Chain, origins: Array, axes: Array) -> None:
    """Refuse all chains but a vertical pivot with three horizontal hinges and at most one joint more."""
    if any(joint.kind != "revolute" for joint in chain.joints):
        raise _not_planar("every joint must be revolute")
    if axes[0, 2] < 1 - _AXIS_TOLERANCE or np.hypot(*origins[0, :2]) > _AXIS_TOLERANCE:
        raise _not_planar("its first axis must be the vertical through its base frame, pointing up")
    hinges = axes[1 : 1 + _HINGES]
    parallel = len(hinges) == _HINGES and np.abs(hinges @ hinges[0]).min() > 1 - _AXIS_TOLERANCE
    if not parallel or abs(hinges[0, 2]) > _AXIS_TOLERANCE:
        raise _not_planar("its first axis must be followed by three parallel horizontal hinges")
    if chain.dof > 2 + _HINGES:
        raise _not_planar("at most one joint may follow the hinges")


def _plane(origins: Array, axes: Array) -> Array:
    """Return the r axis of the arm's plane: towards the first hinge, or the side that it turns upwards."""
    normal = axes[1]
    r_axis = np.array([-normal[1], normal[0], 0.0])
    ahead = float((origins[1] - origins[0]) @ r_axis)
    if abs(ahead) <= _AXIS_TOLERANCE:
        ahead = float(axes[1] @ np.cross(r_axis, [0.0, 0.0, 1.0]))
    return r_axis if ahead > 0 else -r_axis


def _not_planar(what: str) -> InputError:
    return InputError(f"robot: this arm cannot be planned for yet: {what}")


@dataclass(frozen=True)
class ReachBound:
    """A ball swept about the pivot that the tool never leaves."""

    # centre of the ball: distance from the pivot axis, and height over the arm's base frame [m]
    radius: float
    height: float
    length: float  # radius of the ball [m]


@made_once
def with_pivot(chain: Chain) -> Chain:
    """Return the chain itself where it has a vertical pivot, else the chain behind one that stands still.

    That pivot is the vertical through the arm's base frame. `pivot_joints` gives joint values to match.
    """
    try:
        pivot_index(chain)
    except InputError:
        still = Joint("(base)", "revolute", 0.0, 0.0, np.eye(4), np.array([0.0, 0.0, 1.0]))
        return Chain((still, *chain.joints), chain.T_last_tool)
    return chain


def has_pivot(chain: Chain) -> bool:
    """Return True where a chain has a vertical pivot of its own; see `pivot_index`."""
    return with_pivot(chain) is chain


def pivot_joints(chain: Chain, joints: Array) -> Array:
    """Return joint values (..., dof) of a chain as those of the chain `with_pivot`, zero for its pivot."""
    more = with_pivot(chain).dof - chain.dof
    return np.concatenate([np.zeros((*joints.shape[:-1], more)), joints], axis=-1)


@made_once
def pivot_index(chain: Chain) -> int:
    """Return the index, among the active joints, of the vertical pivot: the first, or the first after lifts.

    No other joint mimics it, as the base turns in its place. A chain without one is an `InputError`.

    >>> from regionik.worlds.bundled import robot_named
    >>> pivot_index(robot_named("youbot").chain)
    0
    """
    for joint, T in zip(chain.joints, chain.frames(np.zeros(chain.dof)), strict=False):
        upward = float((T[:3, :3] @ joint.axis)[2])
        if (
            joint.kind == "revolute"
            and upward > 1 - _AXIS_TOLERANCE
            and np.hypot(*T[:2, 3]) <= _AXIS_TOLERANCE
        ):
            if joint.mimic is None and chain.turning[k := chain.names.index(joint.name)]:
                return int(k)
            break
        if joint.kind == "revolute" or abs(upward) < 1 - _AXIS_TOLERANCE:
            break
    raise InputError(
        "robot: expected a first axis that is the vertical through the arm's base frame, pointing up; only "
        "sliding joints that lift it may come before"
    )


def turned_back(chain: Chain, joints: Array, turn: float) -> Array:
    """Return joint values (dof,) with the pivot, if any, turned back by a turn of the base [rad].

    As far as its limits let it.
    """
    if not has_pivot(chain):
        return joints
    pivot = np.arange(chain.dof) == pivot_index(chain)
    return np.clip(joints - turn * pivot, chain.lower, chain.upper)


@made_once
def with_pivot_limits(chain: Chain, lower: float, upper: float) -> Chain:
    """Return the same chain, which has a pivot, with other limits of that [rad]."""
    pivot = chain.active_joints[pivot_index(chain)]
    joints = (replace(one, lower=lower, upper=upper) if one is pivot else one for one in chain.joints)
    return Chain(tuple(joints), chain.T_last_tool)


@made_once
def sliding_chain(chain: Chain) -> Chain:
    """Return the chain after two slides without limits, which take its base frame along x and y."""
    slides = (
        Joint(f"(base {name})", "prismatic", -np.inf, np.inf, np.eye(4), axis)
        for name, axis in zip("xy", np.eye(3)[:2], strict=True)
    )
    return Chain((*slides, *chain.joints), chain.T_last_tool)


@made_once
def reach_bound(chain: Chain) -> ReachBound:
    """Return a bound of an arm's reach, about its pivot or the one that `with_pivot` gives it.

    An `InputError` says which sliding joint, or joint that others mimic, has no limits.
    """
    chain = with_pivot(chain)
    if chain.unbounded:
        raise InputError(f"robot: {chain.unbounded} to be planned for")
    k, steps = pivot_index(chain), chain.link_vectors
    middle = np.zeros(chain.dof)
    middle[:k] = (chain.lower[:k] + chain.upper[:k]) / 2
    pivot = chain.joints.index(chain.active_joints[k])
    T_pivot = chain.frames(middle)[pivot]
    first_step = T_pivot[:3, 3] + T_pivot[:3, :3] @ steps[pivot]
    behind = [joint for joint in chain.joints[pivot:] if joint.kind == "prismatic"]
    travel = sum(max(abs(joint.lower), abs(joint.upper)) for joint in behind)
    travel += sum(joint.upper - joint.lower for joint in chain.joints[:pivot]) / 2
    length = float(sum(np.linalg.norm(step) for step in steps[pivot + 1 :])) + travel
    return ReachBound(float(np.hypot(*first_step[:2])), float(first_step[2]), length)
