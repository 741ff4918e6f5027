"""Which solids of a robot may run into each other, and the solid of its own base."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.obstacles import Prism
from regionik.worlds.robot import BASE, LinkSolid, Robot

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
    `POSTURES` postures within the limits is built that way. All other pairs must keep apart.

    Parameters
    ----------
    robot : Robot

    Returns
    -------
    tuple of (int, int)
        Indices into ``robot.all_solids``, the smaller first; -1 is the base's own body.
    """
    solids, body = robot.all_solids, base_body(robot)
    links = sorted({BASE, *(solid.link for solid in solids)})
    order = [links.index(solid.link) for solid in solids]
    frames = robot.T_base_arm @ robot.chain.frames(_postures(robot.chain))
    frames[:, BASE] = np.eye(4)  # in the place of the tool's, which carries nothing
    axes = [_axis(solid) for solid in solids]
    ends = [_placed(frames[:, solid.link], a) for solid, (a, _) in zip(solids, axes, strict=True)]
    pairs: list[tuple[int, int]] = []
    if body is not None:
        away = [
            _from_prism(body, segments) > radius for segments, (_, radius) in zip(ends, axes, strict=True)
        ]
        pairs += [(BODY, k) for k in range(len(order)) if order[k] > 1 and away[k].any()]
    for i, k in combinations(range(len(order)), 2):
        if abs(order[i] - order[k]) < 2:
            continue
        p, q = _nearest_on_segments(ends[i][:, 0], ends[i][:, 1], ends[k][:, 0], ends[k][:, 1])
        if not (np.linalg.norm(p - q, axis=-1) <= axes[i][1] + axes[k][1]).all():
            pairs.append((i, k))
    return tuple(pairs)


def _postures(chain: Chain) -> Array:
    """Postures within the limits, (POSTURES, dof); without limits, half a turn or a metre each way."""
    span = np.array([np.pi if joint.kind == "revolute" else 1.0 for joint in chain.joints])
    lower, upper = chain.lower, chain.upper
    ends = np.isfinite(lower), np.isfinite(upper)
    low = np.where(ends[0], lower, np.where(ends[1], upper - 2 * span, -span))
    high = np.where(ends[1], upper, np.where(ends[0], lower + 2 * span, span))
    return low + (high - low) * np.random.default_rng(_SEED).random((POSTURES, chain.dof))


def _axis(solid: LinkSolid) -> tuple[Array, float]:
    """Ends of the axis (2, 3) and radius of the capsule, or of one that fits along a box's longest side."""
    corners = solid.corners
    if len(corners) == 2:
        return corners, solid.radius
    sides = corners[[4, 2, 1]] - corners[0]
    lengths = np.linalg.norm(sides, axis=1)
    longest, radius = int(np.argmax(lengths)), float(lengths.min() / 2)
    half = sides[longest] * (0.5 - radius / lengths[longest])
    return np.stack([corners.mean(0) - half, corners.mean(0) + half]), radius


def _placed(frames: Array, points: Array) -> Array:
    """Points (k, 3) of a frame in each of its poses (n, 4, 4), as (n, k, 3)."""
    seen: Array = points @ frames[:, :3, :3].swapaxes(1, 2) + frames[:, None, :3, 3]
    return seen


def _from_prism(body: Prism, ends: Array) -> Array:
    """Distances of segments (n, 2, 3) from a convex prism, 0 where they enter it, (n,)."""
    outline = np.asarray(body.polygon.exterior.coords)[:-1]
    after = np.roll(outline, -1, 0)
    starts, stops = [], []
    for one, other in ((body.bottom, body.bottom), (body.top, body.top)):
        starts += [(*p, one) for p in outline]
        stops += [(*p, other) for p in after]
    starts += [(*p, body.bottom) for p in outline]
    stops += [(*p, body.top) for p in outline]
    p, q = _nearest_on_segments(ends[:, None, 0], ends[:, None, 1], np.array(starts), np.array(stops))
    from_edges = np.linalg.norm(p - q, axis=-1).min(1)
    level = shapely.distance(body.polygon, shapely.points(ends[..., :2]))
    over = np.maximum(np.maximum(body.bottom - ends[..., 2], ends[..., 2] - body.top), 0.0)
    from_ends = np.hypot(level, over).min(1)
    nearest: Array = np.where(_enters(body, ends), 0.0, np.minimum(from_edges, from_ends))
    return nearest


def _enters(body: Prism, ends: Array) -> NDArray[np.bool_]:
    """Which segments (n, 2, 3) share a point with a prism: the part between its heights, over its outline."""
    a, b = ends[:, 0], ends[:, 1]
    drop = b[:, 2] - a[:, 2]
    level = drop == 0
    cuts = (np.array([body.bottom, body.top])[:, None] - a[:, 2]) / np.where(level, 1.0, drop)
    cuts = np.where(level, [[0.0], [1.0]], np.clip(np.sort(cuts, axis=0), 0.0, 1.0))
    parts = a[:, None] + cuts.T[..., None] * (b - a)[:, None]
    over = (ends[..., 2].max(1) >= body.bottom) & (ends[..., 2].min(1) <= body.top)
    entered: NDArray[np.bool_] = over & shapely.intersects(body.polygon, shapely.linestrings(parts[..., :2]))
    return entered


def _nearest_on_segments(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Nearest points of the segments from a to b and from c to d, each (..., 3); the two points.

    They are nearest where one of them ends, or where the line square to both stands on both. All five places
    are tried, so that nearly parallel segments need no case of their own.
    """
    a, b, c, d = np.broadcast_arrays(a, b, c, d)
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = _dot(u, u), _dot(u, v), _dot(v, v), _dot(u, w), _dot(v, w)
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel, or of no length: the other places tell
        square = (uv * vw - vv * uw) / (uu * vv - uv * uv)
        ends = np.stack([np.zeros_like(uu), np.ones_like(uu), -uw / uu, (uv - uw) / uu, square])
        s = np.clip(np.nan_to_num(ends, nan=0.0, posinf=0.0, neginf=0.0), 0.0, 1.0)
        t = np.clip(np.nan_to_num((s * uv + vw) / vv, nan=0.0, posinf=0.0, neginf=0.0), 0.0, 1.0)
    p, q = a + s[..., None] * u, c + t[..., None] * v
    best = np.argmin(_dot(p - q, p - q), axis=0)[None, ..., None]
    return np.take_along_axis(p, best, 0)[0], np.take_along_axis(q, best, 0)[0]


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(-1)
    return product
