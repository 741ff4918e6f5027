"""Which solids of a robot may run into each other, and the solid of its own base."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.obstacles import Prism
from regionik.worlds.robot import BASE, Robot
from regionik.worlds.solids.separation import Hull, apart

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
