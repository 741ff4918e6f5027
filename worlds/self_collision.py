"""Whether two convex bodies keep apart, in many poses at once.

Each body is all points within a radius of the hull of some corners. A plane between the two is looked for
by Gilbert's method: the point of their difference nearest to the origin is approached in steps, and as soon
as all that is seen in its direction is further away than the radii, there is one.
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

STEPS = 60  # bodies some hundredths of their size apart need a few; after all, they count as touching


@dataclass(frozen=True, eq=False)
class Hull:
    """All points within ``radius`` [m] of the hull of ``corners`` (n, 3) [m]."""

    corners: Array
    radius: float = 0.0


def apart(one: Hull, T_one: Array, other: Hull, T_other: Array) -> NDArray[np.bool_]:
    """In which pairs of poses (n, 4, 4) a plane between two bodies was found, (n,).

    Where it was, they do not touch. Where none was, they do, or nearly.
    """
    found = np.zeros(len(T_one), dtype=bool)
    left = np.arange(len(T_one))
    v = _placed(one.corners.mean(0), T_one) - _placed(other.corners.mean(0), T_other)
    for _ in range(STEPS):
        w = _furthest(one, T_one[left], -v) - _furthest(other, T_other[left], v)
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


def _furthest(hull: Hull, T: Array, along: Array) -> Array:
    """The corner furthest along a direction, in each pose (n, 3)."""
    seen = np.argmax(np.einsum("nji,nj->ni", T[:, :3, :3], along) @ hull.corners.T, axis=1)
    return _placed(hull.corners[seen], T)


def _placed(points: Array, T: Array) -> Array:
    """Points (n, 3), or one, of frames (n, 4, 4)."""
    placed: Array = np.einsum("nij,nj->ni", T[:, :3, :3], np.broadcast_to(points, (len(T), 3))) + T[:, :3, 3]
    return placed


BODY = -1  # stands for the base's own body among indices of solids
POSTURES = 64
_SEED = 0


def base_body(robot: Robot) -> Prism | None:
    """The base as a solid in its own frame: the footprint from the floor to ``body_height``.

    None for a base without a footprint.
    """
    if len(robot.footprint) < 3:
        return None
    return Prism(f"base of {robot.name}", Polygon(robot.footprint), 0.0, robot.body_height)


@lru_cache(maxsize=64)
def self_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    """Pairs of solids that may run into each other.

    Solids of one link, and of links that follow one another among those that carry solids, belong together;
    so do the base, with what is fixed to it, and the first such link. What touches in every one of
    `POSTURES` postures within the limits is built that way, and ``robot.unchecked`` names more such pairs.
    All others must keep apart.

    Parameters
    ----------
    robot : Robot

    Returns
    -------
    tuple of (int, int)
        Indices into ``robot.all_solids``, the smaller first; -1 is the base's own body.
    """
    solids, body, frames = robot.all_solids, base_body(robot), link_frames(robot, POSTURES)
    links = sorted({BASE, *(solid.link for solid in solids)})
    order = [links.index(solid.link) for solid in solids]
    hulls = [Hull(solid.corners, solid.radius) for solid in solids]
    placed = [frames[:, solid.link] for solid in solids]
    allowed = {frozenset(names) for names in robot.unchecked}
    pairs: list[tuple[int, int]] = []
    if body is not None:
        block, still = _block(body), frames[:, BASE]
        far = (k for k in range(len(solids)) if order[k] > 1 and {body.name, solids[k].name} not in allowed)
        pairs += [(BODY, k) for k in far if apart(block, still, hulls[k], placed[k]).any()]
    for i, k in combinations(range(len(solids)), 2):
        if abs(order[i] - order[k]) < 2 or {solids[i].name, solids[k].name} in allowed:
            continue
        if apart(hulls[i], placed[i], hulls[k], placed[k]).any():
            pairs.append((i, k))
    return tuple(pairs)


def link_frames(robot: Robot, count: int) -> Array:
    """Link frames in the base frame in postures within the limits, (count, dof + 1, 4, 4).

    The last is the base frame itself, in the place of the tool's, which carries nothing; so index `BASE`
    finds it.
    """
    frames: Array = robot.T_base_arm @ robot.chain.frames(_postures(robot.chain, count))
    frames[:, BASE] = np.eye(4)
    return frames


def _block(body: Prism) -> Hull:
    outline = np.asarray(body.polygon.exterior.coords)[:-1]
    return Hull(np.concatenate([np.c_[outline, np.full(len(outline), z)] for z in body.z_range]))


def _postures(chain: Chain, count: int) -> Array:
    """Postures within the limits, (count, dof); without limits, half a turn or a metre each way."""
    span = np.array([np.pi if joint.kind == "revolute" else 1.0 for joint in chain.joints])
    lower, upper = chain.lower, chain.upper
    ends = np.isfinite(lower), np.isfinite(upper)
    low = np.where(ends[0], lower, np.where(ends[1], upper - 2 * span, -span))
    high = np.where(ends[1], upper, np.where(ends[0], lower + 2 * span, span))
    return low + (high - low) * np.random.default_rng(_SEED).random((count, chain.dof))


POSTURES_loose = 2000
MANY = 0.1  # of these
NEARLY_ALL = 0.95


def loose_pairs(robot: Robot, bodies: Sequence[Array]) -> tuple[list[tuple[str, str]], list[str]]:
    """Names of pairs that need not keep apart, and notes on those of them whose bodies may touch.

    Parameters
    ----------
    robot : Robot
    bodies : sequence of (n, 3) arrays
        Corners of the hull of what each of ``robot.all_solids`` stands for, in its link's frame [m].
    """
    frames, solids = link_frames(robot, POSTURES_loose), robot.all_solids
    bounds = [Hull(solid.corners, solid.radius) for solid in solids]
    pairs: list[tuple[str, str]] = []
    notes: list[str] = []
    for i, k in self_pairs(robot):
        if i < 0:
            continue
        T_i, T_k = frames[:, solids[i].link], frames[:, solids[k].link]
        touching = ~apart(bounds[i], T_i, bounds[k], T_k)
        share = touching.mean()
        if share < MANY:
            continue
        real = ~apart(Hull(bodies[i]), T_i[touching], Hull(bodies[k]), T_k[touching])
        if real.any() and share < NEARLY_ALL:
            continue
        pairs.append((solids[i].name, solids[k].name))
        if real.any():
            notes.append(
                f"what stands for {solids[i].name} and {solids[k].name} touches in {share:.0%} of postures, "
                f"they themselves in up to {real.sum() / POSTURES_loose:.0%}: whether they touch is not asked"
            )
    return pairs, notes
