"""All postures of arms of six joints at a pose, in closed form; of seven, with one joint swept.

Arms with three axes that meet, at the wrist or at the shoulder, and arms with three parallel axes before two
that meet have closed forms. Seven joints have one where any of them, held, leaves such an arm. Axes that miss
each other by a millimetre count as meeting: damped least squares on the true chain brings every posture to
its pose, and what is not there to rounding is left out.

Source: Pieper, The kinematics of manipulators under computer control (1968); Elias and Wen, IK-Geo (2025).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.kernels import compiled
from regionik.planners.solvers.damped_least_squares import ORIENTATION, Aim, polish
from regionik.planners.solvers.rigid_bodies import span
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.planners.solvers.subproblems import (
    angle_to,
    angles_onto_plane,
    nearest_points,
    position_angles,
    rotated_about,
    row_cross,
    row_dot,
)
from regionik.worlds.arrays import Array, Mask
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint, nearest_turn
from regionik.worlds.prepared import made_once

# values of the joint that is swept; so many times as many where none is found
SWEEP_VALUES, FINER_SWEEP = 16, 4
MAX_AXIS_MISMATCH = 2e-3  # by which axes may miss each other [m], or be out of parallel [rad]
_SWEEP_ORDER = (2, 4, 6, 5, 3, 1, 0)  # joints of seven, the likeliest to be held first

Which = NDArray[np.intp]
Kind = Literal["meeting", "parallel"]


@dataclass(frozen=True)
class Decomposition:
    """The closed form of an arm."""

    swept: int | None  # joint that is held at one value after the other
    reverse: bool  # the form is that of the arm seen from its tool
    kind: Kind  # axes 4 to 6 meet, or axes 2 to 4 are parallel and 5 and 6 meet


class Polish(NamedTuple):
    """Accuracy of a posture on its pose, and the steps of damped least squares that may lead to it."""

    error: float  # [m]
    angle: float  # [rad]
    steps: int  # many are needed at a singular posture only


EXACT_POLISH = Polish(1e-10, 1e-10, 40)


class _Lines(NamedTuple):
    """Axes of m arms of six joints at zero, and the turn of the tool from there: X = E1 ... E6."""

    axes: Array  # (m, 6, 3)
    points: Array  # (m, 6, 3) of each axis [m]
    X: Array  # (m, 4, 4)

    def reversed(self) -> _Lines:
        """The arm seen from its tool, its joints in the other order and sense."""
        back = np.asarray(np.linalg.inv(self.X), dtype=np.float64)
        return _Lines(-self.axes[:, ::-1], self.points[:, ::-1], back)


@made_once
def decomposition(chain: Chain) -> Decomposition | None:
    """Return the closed form of a chain, or None where none is known.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> decomposition(robot_named("youbot").chain) is None
    True
    """
    if chain.has_mimics or chain.dof not in (6, 7) or any(joint.kind != "revolute" for joint in chain.joints):
        return None
    for swept in (None,) if chain.dof == 6 else _SWEEP_ORDER:
        lines = _lines(chain, np.eye(4)[None], swept, np.full(1, 0.3))
        for reverse in (False, True):
            kind = _kind(lines.reversed() if reverse else lines)
            if kind is not None:
                return Decomposition(swept, reverse, kind)
    return None


def postures_at(chain: Chain, tools: Array, within: Polish = EXACT_POLISH) -> tuple[Array, Which]:
    """All postures within limits at tool poses; of arms with seven joints those of a sweep.

    Parameters
    ----------
    chain : Chain
        With a `decomposition`.
    tools : (m, 4, 4) array
        Tool frames in the arm's base frame.
    within : Polish
        To which each posture is brought; others are left out.

    Returns
    -------
    joints : (k, dof) array
        The turn of each that is nearest to the middle of its limits.
    which : (k,) array of int
        Of the m poses; ascending.
    """
    form = decomposition(chain)
    assert form is not None
    if form.swept is None:
        return _solved(chain, form, tools, np.arange(len(tools)), np.zeros(len(tools)), within)
    low, high = _sweep(chain.joints[form.swept])
    found = np.empty((0, chain.dof)), np.empty(0, dtype=np.intp)
    missing = np.arange(len(tools))
    for count in (SWEEP_VALUES, FINER_SWEEP * SWEEP_VALUES):
        values = np.tile(low + (np.arange(count) + 0.5) / count * (high - low), len(missing))
        joints, which = _solved(chain, form, tools, np.repeat(missing, count), values, within)
        found = np.concatenate([found[0], joints]), np.concatenate([found[1], which])
        missing = np.setdiff1d(missing, which)
        if not len(missing):
            break
    order = np.argsort(found[1], kind="stable")
    return found[0][order], found[1][order]


def _sweep(joint: Joint) -> tuple[float, float]:
    """Ends of the values of a joint that are swept: its limits, or a full turn within them [rad]."""
    if joint.upper - joint.lower < 2 * np.pi:
        return joint.lower, joint.upper
    bounded = np.isfinite(joint.lower) and np.isfinite(joint.upper)
    middle = (joint.lower + joint.upper) / 2 if bounded else float(np.clip(0.0, joint.lower, joint.upper))
    return middle - np.pi, middle + np.pi


def _solved(
    chain: Chain, form: Decomposition, tools: Array, which: Which, values: Array, within: Polish
) -> tuple[Array, Which]:
    """Postures (k, dof) at some of the poses, the swept joint at a value for each, then polished."""
    lines = _lines(chain, tools[which], form.swept, values)
    lines = lines.reversed() if form.reverse else lines
    angles, owner = (_meeting if form.kind == "meeting" else _parallel)(lines)
    angles = angles[:, ::-1] if form.reverse else angles
    if form.swept is not None:
        angles = np.insert(angles, form.swept, values[owner], axis=1)
    joints, which = _within_limits(chain, angles), which[owner]
    near = np.isfinite(joints).all(axis=1)
    joints, which = np.ascontiguousarray(joints[near]), which[near]
    arm = serial_arm(chain)
    good = _polished(arm, np.ascontiguousarray(tools[which]), span(arm), within, joints)
    return joints[good], which[good]


def _within_limits(chain: Chain, angles: Array) -> Array:
    """Angles by whole turns within their limits; a little beyond is put back, more is NaN."""
    lower, upper = chain.lower, chain.upper
    middle, bounded = np.clip(0.0, lower, upper), np.isfinite(lower) & np.isfinite(upper)
    middle[bounded] = (lower[bounded] + upper[bounded]) / 2
    near = nearest_turn(angles, middle)
    held = np.clip(near, lower, upper)
    found: Array = np.where(np.abs(near - held) <= 2 * MAX_AXIS_MISMATCH, held, np.nan)
    return found


@compiled
def _polished(arm: SerialArm, tools: Array, reach: float, within: Polish, joints: Array) -> Mask:
    """Mask (k,) of the postures (k, n) that damped least squares brings to their poses; overwritten."""
    met = np.zeros(len(joints), dtype=np.bool_)
    for k in range(len(joints)):
        aim = Aim(tools[k, :3, 3].copy(), ORIENTATION, tools[k, :3, :3].copy(), 0.0)
        error, angle, _ = polish(arm, aim, joints[k], reach, within.error, within.angle, within.steps)
        met[k] = error <= within.error and angle <= within.angle
    return met


def _lines(chain: Chain, tools: Array, swept: int | None, values: Array) -> _Lines:
    """Lines of the six joints that are not swept, for each pose and value of the one that is."""
    frames = chain.frames(np.zeros(chain.dof))
    axes = np.array([T[:3, :3] @ joint.axis for T, joint in zip(frames, chain.joints, strict=False)])
    points, T_zero = frames[:-1, :3, 3], frames[-1]
    axes, points = (np.repeat(one[None], len(tools), axis=0) for one in (axes, points))
    if swept is None:
        return _Lines(axes, points, tools @ np.linalg.inv(T_zero))
    axis, point = axes[:, swept, None], points[:, swept, None]
    turn = values[:, None]
    after = slice(swept + 1, None)
    axes[:, after] = rotated_about(axis, turn, axes[:, after])
    points[:, after] = point + rotated_about(axis, turn, points[:, after] - point)
    T = np.repeat(np.eye(4)[None], len(tools), axis=0)
    T[:, :3, :3] = rotated_about(axis, turn, np.eye(3)).transpose(0, 2, 1)
    T[:, :3, 3] = (point - rotated_about(axis, turn, point))[:, 0]
    left = np.delete(np.arange(chain.dof), swept)
    return _Lines(axes[:, left], points[:, left], tools @ np.linalg.inv(T @ T_zero))


def _kind(lines: _Lines) -> Kind | None:
    """The kind of closed form that lines (of one arm) have, if any."""
    axes, points = lines.axes[0], lines.points[0]
    if _center(lines)[1][0] <= MAX_AXIS_MISMATCH:
        return "meeting"
    h = axes[1]
    aligned = np.linalg.norm(np.cross(axes[2:4], h), axis=1).max() <= MAX_AXIS_MISMATCH
    a, b = nearest_points(points[4], axes[4], points[5], axes[5])
    apart = np.linalg.norm(np.cross(axes[4], axes[5])) > 0.1
    return "parallel" if aligned and apart and np.linalg.norm(a - b) <= MAX_AXIS_MISMATCH else None


def _center(lines: _Lines) -> tuple[Array, Array]:
    """The point (m, 3) nearest to the last three axes, and how far off the farthest is (m,)."""
    h, o = lines.axes[:, 3:], lines.points[:, 3:]
    across = np.eye(3) - h[..., :, None] * h[..., None, :]
    square = across.sum(axis=1) + 1e-12 * np.eye(3)
    center = np.linalg.solve(square, np.einsum("mkij,mkj->mi", across, o)[..., None])[..., 0]
    off = np.linalg.norm(np.einsum("mkij,mkj->mki", across, center[:, None] - o), axis=2).max(axis=1)
    return center, np.where(np.linalg.cond(square) < 1e4, off, np.inf)


def _meeting(lines: _Lines) -> tuple[Array, Which]:
    """Axes 4 to 6 meet: the first three bring their centre to its place, the others turn the tool."""
    center, R = _center(lines)[0], lines.X[:, :3, :3]
    goal = np.einsum("mij,mj->mi", R, center) + lines.X[:, :3, 3]
    first, which = position_angles(lines.axes[:, :3], lines.points[:, :3], center, goal)
    h = lines.axes[which]
    M = R[which]
    for k in range(3):
        M = _back(h[:, k], first[:, k], M)
    fifth = angles_onto_plane(h[:, 3], h[:, 4], h[:, 5], row_dot(h[:, 3], _times(M, h[:, 5])))
    found = []
    for x5 in fifth:
        x4 = angle_to(h[:, 3], rotated_about(h[:, 4], x5, h[:, 5]), _times(M, h[:, 5]))
        x6 = _last_turn(h[:, 5], _back(h[:, 4], x5, _back(h[:, 3], x4, M)))
        found.append(np.column_stack([first, x4, x5, x6]))
    return np.concatenate(found), np.tile(which, 2)


def _parallel(lines: _Lines) -> tuple[Array, Which]:
    """Axes 2 to 4 are parallel and 5 and 6 meet: the part of their point along the parallel ones stays."""
    h, o, R = lines.axes, lines.points, lines.X[:, :3, :3]
    same = h[:, 1]
    center = np.mean(nearest_points(o[:, 4], h[:, 4], o[:, 5], h[:, 5]), axis=0)
    p = _times(R, center) + lines.X[:, :3, 3] - o[:, 0]
    found, owner = [], []
    for x1 in angles_onto_plane(same, -h[:, 0], p, row_dot(same, center - o[:, 0])):
        M = _back(h[:, 0], x1, R)
        for x5 in angles_onto_plane(same, h[:, 4], h[:, 5], row_dot(same, _times(M, h[:, 5]))):
            bent = rotated_about(h[:, 4], -x5, same)
            x6 = angle_to(h[:, 5], _times(M.transpose(0, 2, 1), same), bent)
            across = row_cross(same, h[:, 4])
            # R2 R3 R4 takes what stands across them, seen through joints 5 and 6, to where M takes it.
            seen = rotated_about(h[:, 5], -x6, rotated_about(h[:, 4], -x5, across))
            total = angle_to(same, across, _times(M, seen))
            wrist = rotated_about(same, total, center - o[:, 3])
            g = rotated_about(-h[:, 0], x1, p) + o[:, 0] - o[:, 1] - wrist
            for row in _two_links(same, o[:, 2] - o[:, 1], o[:, 3] - o[:, 2], g):
                found.append(np.column_stack([x1, row[0], row[1], total - row[0] - row[1], x5, x6]))
                owner.append(np.arange(len(p)))
    return np.concatenate(found), np.concatenate(owner)


def _two_links(axis: Array, b: Array, d: Array, g: Array) -> list[tuple[Array, Array]]:
    """Both pairs of angles that bring R1 (b + R2 d) to a point across the axis."""
    b, d, g = (one - row_dot(axis, one)[:, None] * axis for one in (b, d, g))
    seconds = angles_onto_plane(b, axis, d, 0.5 * (row_dot(g, g) - row_dot(b, b) - row_dot(d, d)))
    return [(angle_to(axis, b + rotated_about(axis, x, d), g), x) for x in seconds]


def _times(M: Array, vector: Array) -> Array:
    found: Array = np.einsum("mij,mj->mi", M, vector)
    return found


def _back(axis: Array, angle: Array, M: Array) -> Array:
    """M with a turn about an axis taken off its left."""
    found: Array = rotated_about(axis[:, None], -angle[:, None], M.transpose(0, 2, 1)).transpose(0, 2, 1)
    return found


def _last_turn(axis: Array, M: Array) -> Array:
    """Angle of a turn (m, 3, 3) about its axis, or of the one nearest to it."""
    across = row_cross(axis, np.where(np.abs(axis[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    return angle_to(axis, across, _times(M, across))
