"""Postures that reach targets with the base off its place, by damped least squares of `verify` alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionik.verification.options import VERIFICATION
from regionik.verification.tool_path import tool_deviations
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

OPTIONS = VERIFICATION.postures

Mask = NDArray[np.bool_]


def postures_on_target(
    world: World, targets: Sequence[Target], poses: Array, joints: Array
) -> tuple[Array, Array]:
    """Postures (n, dof) led to targets with the base held, and by how much they miss beyond the tolerances.

    Each is led from its joints (n, dof), within their limits, with the base at its pose (n, 3). Where the
    target is met the excess (n,) is at most 0 [m] or [rad].
    """
    chain, close = world.robot.chain, OPTIONS.close_share * world.rules.tolerance
    goals, left = _Goals.of(targets, close), np.arange(len(joints))
    q = np.clip(joints, chain.lower, chain.upper)
    # Six joints and more turn the tool the shortest way at first, then by its angle alone, as fewer do.
    whole = OPTIONS.iterations // 2 if chain.dof >= 6 else 0
    for n in range(OPTIONS.iterations):
        residual, J = _residual_and_jacobian(world, goals.only(left), poses[left], q[left])
        J = J if n < whole else _angle_alone(residual, J)
        open_ = np.abs(residual).max(axis=1) >= close
        left, residual, J = left[open_], residual[open_], J[open_]
        if not len(left):
            break
        here, step = q[left], _damped_step(J, residual)
        for _ in range(chain.dof):
            blocked = ((here <= chain.lower) & (step < 0)) | ((here >= chain.upper) & (step > 0))
            if not blocked.any():
                break
            J = np.where(blocked[:, None, :], 0.0, J)
            step = _damped_step(J, residual)
        q[left] = np.clip(here + np.clip(step, -OPTIONS.max_step, OPTIONS.max_step), chain.lower, chain.upper)
    return q, _excess(world, targets, poses, q)


class _Goals(NamedTuple):
    positions: Array  # (n, 3) [m]
    frames: Array  # (n, 3, 3) asked tool frame, or a direction in its last column
    framed: Mask  # (n,) a frame is asked
    directed: Mask  # (n,) a direction or a frame is asked
    cones: Array  # (n,) hardly narrower than asked: at the end of the reach no tool may turn farther [rad]

    @classmethod
    def of(cls, targets: Sequence[Target], close: float) -> _Goals:
        frames = np.zeros((len(targets), 3, 3))
        for k, target in enumerate(targets):
            if target.orientation is not None:
                frames[k] = target.orientation
            elif target.direction is not None:
                frames[k, :, 2] = target.direction
        cones = np.array([target.cone for target in targets])
        return cls(
            np.array([target.position for target in targets]),
            frames,
            np.array([target.orientation is not None for target in targets]),
            np.array([target.direction is not None for target in targets]),
            np.maximum(cones - 2 * close, cones / 2),
        )

    def only(self, some: NDArray[np.intp]) -> _Goals:
        columns: tuple[Any, ...] = self
        return _Goals(*(column[some] for column in columns))


def _damped_step(J: Array, residual: Array) -> Array:
    """Damped least squares J^T (J J^T + d^2 I)^-1 r, (n, dof)."""
    transposed = J.transpose(0, 2, 1)
    A = J @ transposed + OPTIONS.damping**2 * np.eye(J.shape[1])
    return (transposed @ np.linalg.solve(A, residual[..., None]))[..., 0]


def _residual_and_jacobian(world: World, goals: _Goals, poses: Array, q: Array) -> tuple[Array, Array]:
    """Position residual and turn left beyond the cone, (n, 6), and their Jacobian, (n, 6, dof)."""
    chain, frames = world.robot.chain, world.robot.frames(poses, q)
    tool = frames[:, -1]
    turn = _turn_left(goals, tool[:, :3, :3])
    turns, z = chain.turn_jacobian(frames).transpose(0, 2, 1), tool[:, :3, 2]
    rolls = np.where(goals.framed[:, None], 0.0, np.einsum("na,nak->nk", z, turns))
    turning = turns - z[:, :, None] * rolls[:, None]  # a roll about a direction is free
    turning[(turn == 0.0).all(axis=1)] = 0.0
    linear = chain.point_jacobian(frames, tool[:, :3, 3], len(chain.joints)).transpose(0, 2, 1)
    J: Array = np.concatenate([linear, turning], axis=1)
    return np.column_stack([goals.positions - tool[:, :3, 3], turn]), J


def _angle_alone(residual: Array, J: Array) -> Array:
    """The Jacobian with only that part of each turn that changes the angle which is left."""
    size = np.linalg.norm(residual[:, 3:], axis=1)
    axis = residual[:, 3:] / np.maximum(size, 1e-300)[:, None]
    turning = axis[:, :, None] * np.einsum("na,nak->nk", axis, J[:, 3:])[:, None]
    return np.concatenate([J[:, :3], turning], axis=1)


def _turn_left(goals: _Goals, R: Array) -> Array:
    """Rotation vectors (n, 3) that bring tool frames (n, 3, 3) into their cones; zeros where they are."""
    turn = np.zeros((len(R), 3))
    framed, pointed = goals.framed, goals.directed & ~goals.framed
    if framed.any():
        turn[framed] = Rotation.from_matrix(goals.frames[framed] @ R[framed].transpose(0, 2, 1)).as_rotvec()
    if pointed.any():
        z, asked = R[pointed, :, 2], goals.frames[pointed, :, 2]
        axis = np.cross(z, asked)
        sine = np.linalg.norm(axis, axis=1)
        angle = np.arctan2(sine, (z * asked).sum(axis=1))
        turn[pointed] = axis * (angle / np.maximum(sine, 1e-300))[:, None]
    size = np.linalg.norm(turn, axis=1)
    beyond = np.maximum(size - goals.cones, 0.0) / np.maximum(size, 1e-300)
    return turn * beyond[:, None]


def _excess(world: World, targets: Sequence[Target], poses: Array, q: Array) -> Array:
    """Amount by which tools miss tolerance or cone, at most 0 where they do not, (n,) [m] or [rad]."""
    tool = world.robot.tool(poses, q)[:, :3]
    positions = np.array([target.position for target in targets])
    excess: Array = np.linalg.norm(tool[:, :, 3] - positions, axis=1) - world.rules.tolerance
    for k, (target, R) in enumerate(zip(targets, tool[:, :, :3], strict=True)):
        excess[k] = max([excess[k], *(angle - target.cone for _, angle in tool_deviations(target, R))])
    return excess
