"""Self-collision of robots: pairs of solids that may touch, and separation of convex bodies in many poses.

Separation is decided by Gilbert's method: the point of the bodies' Minkowski difference nearest to the origin
is approached in steps, and as soon as its support in that direction lies further away than the radii, a plane
separates them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.obstacles import Prism
from regionik.worlds.robot import BASE, Robot

BODY = -1  # the base's own body, among indices of solids
STEPS = 60  # bodies some hundredths of their size apart need a few; after all, they count as touching
POSTURES, MANY_POSTURES = 64, 2000  # sampled: to find pairs, and to disable some
OFTEN, NEARLY_ALWAYS = 0.1, 0.95  # of the postures
_SEED = 0


@dataclass(frozen=True, eq=False)
class ConvexBody:
    """All points within ``radius`` [m] of the convex hull of ``corners`` (n, 3) [m]."""

    corners: Array
    radius: float = 0.0

    def support(self, T: Array, along: Array) -> Array:
        """Return the corner furthest along directions (n, 3), at poses (n, 4, 4), as (n, 3)."""
        seen = np.argmax(np.einsum("nji,nj->ni", T[:, :3, :3], along) @ self.corners.T, axis=1)
        return _transformed(self.corners[seen], T)


def separated(one: ConvexBody, T_one: Array, other: ConvexBody, T_other: Array) -> NDArray[np.bool_]:
    """Return True for each pair of poses (n, 4, 4) at which a plane between two bodies was found, (n,).

    Where none was found, they touch, or nearly.
    """
    found = np.zeros(len(T_one), dtype=bool)
    left = np.arange(len(T_one))
    v = _transformed(one.corners.mean(0), T_one) - _transformed(other.corners.mean(0), T_other)
    for _ in range(STEPS):
        w = one.support(T_one[left], -v) - other.support(T_other[left], v)
        beyond = (v * w).sum(1) > (one.radius + other.radius) * np.linalg.norm(v, axis=1)
        found[left[beyond]] = True
        step = v - w
        gain, length = (v * step).sum(1), (step * step).sum(1)
        on = ~beyond & (gain > 0)
        if not on.any():
            break
        share = np.minimum(gain[on] / length[on], 1.0)
        left, v = left[on], v[on] - share[:, None] * step[on]
    return found


def base_body(robot: Robot) -> Prism | None:
    """Return the base as a solid in its own frame: the footprint from the floor to ``body_height``.

    None for a base without a footprint.
    """
    if len(robot.footprint) < 3:
        return None
    return Prism(f"base of {robot.name}", Polygon(robot.footprint), 0.0, robot.body_height)


@lru_cache(maxsize=64)
def self_collision_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    """Return the pairs of solids that must keep apart.

    Left out are solids of one link, and of links that one joint connects; of the base, with what is fixed to
    it, and the first link; pairs that touch in every one of `POSTURES` postures within the limits; and those
    that ``robot.unchecked`` names.

    Parameters
    ----------
    robot : Robot

    Returns
    -------
    tuple of (int, int)
        Indices into ``robot.all_solids``, the smaller first; -1 is the base's own body.
    """
    solids, body, frames = robot.all_solids, base_body(robot), _link_frames(robot, POSTURES)
    order = [solid.link for solid in solids]
    bodies = [ConvexBody(solid.corners, solid.radius) for solid in solids]
    poses = [frames[:, solid.link] for solid in solids]
    allowed = {frozenset(names) for names in robot.unchecked}
    pairs: list[tuple[int, int]] = []
    if body is not None:
        block, still = _block(body), frames[:, BASE]
        far = (
            k
            for k in range(len(solids))
            if order[k] - BASE > 1 and {body.name, solids[k].name} not in allowed
        )
        pairs += [(BODY, k) for k in far if separated(block, still, bodies[k], poses[k]).any()]
    for i, k in combinations(range(len(solids)), 2):
        if abs(order[i] - order[k]) < 2 or {solids[i].name, solids[k].name} in allowed:
            continue
        if separated(bodies[i], poses[i], bodies[k], poses[k]).any():
            pairs.append((i, k))
    return tuple(pairs)


def disabled_pairs(robot: Robot, points: Sequence[Array]) -> tuple[list[tuple[str, str]], list[str]]:
    """Return pairs of solids whose bounds touch often though the bodies inside hardly do, and notes on them.

    Parameters
    ----------
    robot : Robot
    points : sequence of (n, 3) arrays
        Of each of ``robot.all_solids``, corners of the hull of the body inside it, in its link's frame [m].

    Returns
    -------
    pairs : list of (str, str)
        Names of solids, for ``Robot.unchecked``.
    notes : list of str
        One for each of these pairs whose bodies may touch.
    """
    frames, solids = _link_frames(robot, MANY_POSTURES), robot.all_solids
    bounds = [ConvexBody(solid.corners, solid.radius) for solid in solids]
    pairs: list[tuple[str, str]] = []
    notes: list[str] = []
    for i, k in self_collision_pairs(robot):
        if i == BODY:
            continue
        T_i, T_k = frames[:, solids[i].link], frames[:, solids[k].link]
        touching = ~separated(bounds[i], T_i, bounds[k], T_k)
        share = touching.mean()
        if share < OFTEN:
            continue
        real = ~separated(ConvexBody(points[i]), T_i[touching], ConvexBody(points[k]), T_k[touching])
        if real.any() and share < NEARLY_ALWAYS:
            continue
        pairs.append((solids[i].name, solids[k].name))
        if real.any():
            notes.append(
                f"the bounds of {solids[i].name} and {solids[k].name} touch in {share:.0%} of postures, the "
                f"links themselves in up to {real.sum() / MANY_POSTURES:.0%}: this pair is not checked"
            )
    return pairs, notes


def _transformed(points: Array, T: Array) -> Array:
    """Return points (n, 3), or one for all, moved by transforms (n, 4, 4)."""
    moved: Array = np.einsum("nij,nj->ni", T[:, :3, :3], np.broadcast_to(points, (len(T), 3))) + T[:, :3, 3]
    return moved


def _link_frames(robot: Robot, count: int) -> Array:
    """Return link frames in the base frame in postures within the limits, (count, dof + 1, 4, 4).

    The last is the base frame itself, instead of the tool's, which carries no solid: index `BASE` finds it.
    """
    frames: Array = robot.T_base_arm @ robot.chain.frames(_postures(robot.chain, count))
    frames[:, BASE] = np.eye(4)
    return frames


def _block(body: Prism) -> ConvexBody:
    outline = np.asarray(body.polygon.exterior.coords)[:-1]
    return ConvexBody(np.concatenate([np.c_[outline, np.full(len(outline), z)] for z in body.z_range]))


def _postures(chain: Chain, count: int) -> Array:
    """Return postures within the limits, (count, dof); without limits, half a turn or a metre each way."""
    span = np.array([np.pi if joint.kind == "revolute" else 1.0 for joint in chain.joints])
    lower, upper = chain.lower, chain.upper
    ends = np.isfinite(lower), np.isfinite(upper)
    low = np.where(ends[0], lower, np.where(ends[1], upper - 2 * span, -span))
    high = np.where(ends[1], upper, np.where(ends[0], lower + 2 * span, span))
    return low + (high - low) * np.random.default_rng(_SEED).random((count, chain.dof))
