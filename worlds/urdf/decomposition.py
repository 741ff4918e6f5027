"""Decomposition of a robot's links into a few parts to bound: large meshes are cut, small solids merged.

A mesh is cut by a plane where the bounds of the halves together are much smaller than the bound of the whole.
The hull of the surface's corners on one side, and of those that the cut makes, contains all of the solid on
that side: nothing sticks out of its bound. Where there are too many solids, those of one link that fit
together best share a bound.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, product

import numpy as np

from regionik.worlds.arrays import Array, Index
from regionik.worlds.links import BASE, LinkSolid
from regionik.worlds.urdf.bounding import (
    bounding_solid,
    convex_hull,
    fast_oriented_box,
    oriented_box,
    rough_volume,
)
from regionik.worlds.urdf.options import URDF

OPTIONS = URDF.bounding

_CUTS = np.linspace(0, 1, 7)[1:-1]  # places tried along each side of the bounding box


@dataclass(frozen=True, eq=False)
class CollisionPart:
    """Part of a link that one solid bounds, in the frame of the link that a joint moves."""

    link: int
    name: str
    points: Array  # (n, 3) corners of a hull that contains it [m]
    triangles: Array  # (m, 3, 3) surface of a mesh; empty for parts that are not to be cut [m]
    exact: LinkSolid | None = None  # its solid, where that is known
    sources: frozenset[str] = frozenset()  # names of the file's links that it is of

    @cached_property
    def rough(self) -> float:
        """Volume of a solid around it, found fast [m^3]."""
        return rough_volume(self.points)

    @cached_property
    def solid(self) -> LinkSolid:
        """Solid that bounds it."""
        return self.exact or bounding_solid(self.link, self.name, self.points)


def mesh_part(link: int, name: str, triangles: Array, sources: frozenset[str] = frozenset()) -> CollisionPart:
    """Return a mesh, given by its triangles (m, 3, 3), as a part."""
    return CollisionPart(link, name, convex_hull(triangles.reshape(-1, 3)), triangles, sources=sources)


def decompose(parts: Iterable[CollisionPart], most: int = OPTIONS.max_solids) -> tuple[CollisionPart, ...]:
    """Return the parts to bound: all that are given, cut where that pays, merged beyond ``most``."""
    return tuple(_cut(_merged(_distinct(parts), most), most))


def _distinct(parts: Iterable[CollisionPart]) -> list[CollisionPart]:
    """Return each part once, as some files name the same mesh of a link twice."""
    found = {(part.link, part.points.tobytes()): part for part in reversed(list(parts))}
    return list(reversed(found.values()))


# --- cutting


def _cut(parts: list[CollisionPart], most: int) -> list[CollisionPart]:
    """Return parts cut into pieces, first where that saves most volume a piece, up to ``most``."""
    chosen = [[part] for part in parts]
    offers = {k: found for k, part in enumerate(parts) if len(found := _cuttings(part)) > 1}
    spare = most - len(parts)
    while spare > 0:
        worth = {
            (k, j): (_rough(chosen[k]) - _rough(way)) / (len(way) - len(chosen[k]))
            for k, ways in offers.items()
            for j, way in enumerate(ways)
            if 0 < len(way) - len(chosen[k]) <= spare
        }
        enough = {
            key: saved
            for key, saved in worth.items()
            if saved > OPTIONS.min_saved_share * parts[key[0]].rough
        }
        if not enough:
            break
        k, j = max(enough, key=lambda key: (enough[key], -key[0], -key[1]))
        spare -= len(offers[k][j]) - len(chosen[k])
        chosen[k] = offers[k][j]
    return [part for pieces in chosen for part in _numbered(pieces)]


def _rough(parts: list[CollisionPart]) -> float:
    return sum(part.rough for part in parts)


def _numbered(pieces: list[CollisionPart]) -> list[CollisionPart]:
    if len(pieces) == 1:
        return pieces
    return [replace(part, name=f"{part.name} part {k + 1}") for k, part in enumerate(pieces)]


def _cuttings(part: CollisionPart) -> list[list[CollisionPart]]:
    """Return the part whole, in halves, and with either half or both cut again."""
    if not len(part.triangles):
        return [[part]]
    turn = oriented_box(part.points)[0][:3, :3]
    ways = [[[half], _halves(half, turn)] for half in _halves(part, turn)]
    return [[part], *(list(chain.from_iterable(pieces)) for pieces in product(*ways))]


def _halves(part: CollisionPart, turn: Array) -> list[CollisionPart]:
    """Return both sides of the plane that leaves the smallest boxes, among planes square to box axes."""
    some = part.triangles[:: 1 + len(part.triangles) // OPTIONS.max_sampled]
    least, cut = np.inf, (turn[:, 0], np.inf)
    for axes in (turn, fast_oriented_box(part.points)[0][:3, :3]):
        for normal, offset in _planes(part.points, axes):
            boxes = sum(_box(half.reshape(-1, 3) @ axes) for half in _sides(some, normal, offset))
            if boxes < least:
                least, cut = boxes, (normal, offset)
    halves = _sides(part.triangles, *cut)
    return [mesh_part(part.link, part.name, half, part.sources) for half in halves]


def _sides(triangles: Array, normal: Array, offset: float) -> list[Array]:
    """Return the triangles on either side of a plane, where there are any."""
    both = clip_triangles(triangles, normal, offset), clip_triangles(triangles, -normal, -offset)
    return [side for side in both if len(side)]


def _box(points: Array) -> float:
    """Return the volume of the box around points along their axes [m^3]."""
    return float(np.prod(np.ptp(points, axis=0)))


def _planes(points: Array, axes: Array) -> Iterator[tuple[Array, float]]:
    """Yield planes through points, square to axes (columns): (normal, offset along it)."""
    along = points @ axes
    for normal, low, high in zip(axes.T, along.min(0), along.max(0), strict=True):
        yield from ((normal, float(low + share * (high - low))) for share in _CUTS)


def clip_triangles(triangles: Array, normal: Array, offset: float) -> Array:
    """Return what of triangles (m, 3, 3) is on the side that a plane's normal points to, as triangles."""
    height = triangles @ normal - offset
    above = height >= 0
    count = above.sum(1)
    parts = [triangles[count == 3]]
    for kept in (1, 2):
        which = np.flatnonzero(count == kept)
        lone = np.argmax(above[which] == (kept == 1), axis=1)  # the corner that is alone on its side
        order = (lone[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles[which], order[:, :, None], 1), 1, 0)
        p, q, r = np.moveaxis(np.take_along_axis(height[which], order, 1), 1, 0)
        ab = a + (p / (p - q))[:, None] * (b - a)
        ac = a + (p / (p - r))[:, None] * (c - a)
        rows = [(a, ab, ac)] if kept == 1 else [(ab, b, c), (ab, c, ac)]
        parts += [np.stack(row, axis=1) for row in rows]
    return np.concatenate(parts)


# --- merging


def _merged(parts: list[CollisionPart], most: int) -> list[CollisionPart]:
    """Return parts of which neighbours on one link are merged, first those whose common box grows least."""
    groups = [[part] for part in parts]
    if len(parts) <= most:
        return parts
    low, high = (np.array([end(part.points, axis=0) for part in parts]) for end in (np.min, np.max))
    link = np.array([part.link for part in parts])
    growth = np.array([_growth(k, low, high, link) for k in range(len(parts))])
    for _ in range(len(parts) - most):
        k, i = np.unravel_index(int(np.argmin(growth)), growth.shape)
        if growth[k, i] == np.inf:
            break
        groups[k] += groups[i]
        low[k], high[k] = np.minimum(low[k], low[i]), np.maximum(high[k], high[i])
        groups[i], link[i] = [], BASE - 1 - i  # no link has this number
        growth[i], growth[:, i] = np.inf, np.inf
        growth[k] = growth[:, k] = _growth(int(k), low, high, link)
    return [_merge_group(group) for group in groups if group]


def _growth(k: int, low: Array, high: Array, link: Index) -> Array:
    """Return by how much the common box of group ``k`` and each other is larger than both boxes, (n,) [m^3].

    Boxes lie along the link's axes; infinite for itself and for groups of other links.
    """
    size = np.prod(high - low, axis=1)
    both = np.prod(np.maximum(high[k], high) - np.minimum(low[k], low), axis=1)
    unfit = (link != link[k]) | (np.arange(len(link)) == k)
    growth: Array = np.where(unfit, np.inf, both - size[k] - size)
    return growth


def _merge_group(group: list[CollisionPart]) -> CollisionPart:
    if len(group) == 1:
        return group[0]
    points = convex_hull(np.concatenate([part.points for part in group]))
    sources = frozenset().union(*(part.sources for part in group))
    name = f"{group[0].name} and more"
    return CollisionPart(group[0].link, name, points, np.empty((0, 3, 3)), sources=sources)
