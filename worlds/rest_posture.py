"""Posture in which an arm is driven about where nobody says one: clear, and within the base's outline."""

from __future__ import annotations

import numpy as np

from regionik.worlds.arrays import Array, Mask
from regionik.worlds.chain import spread_postures
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import SLIDE, postures_clear, postures_off_floor, solid_frames

CLEAR = (0.01, 0.003, 0.0)  # kept between solids, the first that can be had [m]
NEAR_ENOUGH = 0.02  # by which zeros may be worse than the best posture that was found [m]
_POSTURES, _TRIED = 2000, 40  # drawn at first; the best of a draw that are checked
_SPREADS = (0.5, 0.25, 0.1, 0.05, 0.02)  # of draws about the best posture [rad] or [m]
_ROUND = 150  # postures in each of them
_DECIMALS = 2  # of joint values
_SEED = 0


def rest_posture(robot: Robot) -> Array | None:
    """Return the clear posture whose solids stay most within the footprint and above the floor, (dof,).

    Seeded postures within the joint limits are looked at, then others ever nearer to the best of them, then
    that with single joints at zero. Zeros, or the limits nearest to them, are taken where they are clear and
    hardly worse. None where no posture is clear.
    """
    dof = robot.chain.dof
    zeros = np.clip(np.zeros((1, dof)), robot.chain.lower, robot.chain.upper)
    for margin in CLEAR:
        drawn = spread_postures(robot.chain, SLIDE, _POSTURES, _SEED)
        found = _best(robot, np.concatenate([zeros, drawn]), margin)
        if found is None:
            continue
        rng = np.random.default_rng(_SEED)
        for spread in _SPREADS:
            found = _better(robot, found, found + spread * rng.uniform(-1, 1, (_ROUND, dof)), margin)
        for k in range(dof):
            found = _better(robot, found, np.where(np.arange(dof) == k, zeros, found), margin)
        plain = _clear(robot, zeros, margin)[0]
        worse = overhang(robot, np.stack([zeros[0], found]))
        return zeros[0] if plain and worse[0] <= worse[1] + NEAR_ENOUGH else found
    return None


def overhang(robot: Robot, joints: Array) -> Array:
    """Return how far solids stick out of the footprint, or into the floor if that is more: their mean [m].

    (n,) for postures (n, dof); 0 where all of the arm is within.
    """
    frames, total = solid_frames(robot, joints), np.zeros(len(joints))
    for solid in robot.solids:
        T = frames[:, solid.link]
        corners = solid.corners @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
        out = np.maximum(_outside(robot.footprint, corners[..., :2]), -corners[..., 2])
        total += np.maximum(out.max(1) + solid.radius, 0.0)
    return total / max(len(robot.solids), 1)


def _outside(footprint: Array, points: Array) -> Array:
    """Return how far points (..., 2) are beyond the sides of a convex outline, or from its one corner [m]."""
    if len(footprint) == 1:
        away: Array = np.linalg.norm(points - footprint[0], axis=-1)
        return away
    sides = np.roll(footprint, -1, axis=0) - footprint
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    turn = np.sign(sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0])
    beyond: Array = (turn * (points @ normals.T - (footprint * normals).sum(1))).max(-1)
    return beyond


def _clear(robot: Robot, joints: Array, margin: float) -> Mask:
    """Return True for postures (n, dof) that keep a margin [m] between links and off the floor, (n,)."""
    return postures_off_floor(robot, joints, margin) & postures_clear(robot, joints, margin)


def _better(robot: Robot, found: Array, others: Array, margin: float) -> Array:
    """Return the best of a clear posture (dof,) and others (n, dof)."""
    best = _best(robot, np.concatenate([found[None], others]), margin)
    return found if best is None else best


def _best(robot: Robot, joints: Array, margin: float) -> Array | None:
    """Return the clear one of postures (n, dof), rounded, with least overhang; None where none is clear.

    Of postures with the same overhang, but for a centimetre, the one nearest to zeros.
    """
    rounded = np.clip(np.round(joints, _DECIMALS), robot.chain.lower, robot.chain.upper)
    order = np.lexsort([np.abs(rounded).sum(1), np.round(overhang(robot, rounded), 2)])
    for rows in np.array_split(order, max(1, len(order) // _TRIED)):
        clear = _clear(robot, rounded[rows], margin)
        if clear.any():
            best: Array = rounded[rows[np.argmax(clear)]]
            return best
    return None
