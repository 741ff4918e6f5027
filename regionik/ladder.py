"""Ladder of a whole path: components of the areas of its set-points, with edges where they overlap.

While the tool rests at set-point i the base may go anywhere within one component of its area; the tool goes
on to i + 1 while the base stands in components of both. So a path without lift-offs is a chain of components
with non-empty intersections. Source: M-FABRIK, experiment 4 (areas made for the whole path in advance).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.free_space import MIN_AREA, FreeSpace, PathAreas, component_labels
from regionik.areas.layers import Geometries
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.postures.families import Family

MAX_FLAT_COMPONENTS = 512  # components that are cached as flat polygons
SURE_OVERLAP = 1e-4  # half the side of a square that two areas share beyond doubt [m]

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Ladder:
    """Components of successive areas, and the pairs the base can go between with the tool on the path."""

    count: int  # number of set-points
    component: Geometries  # (m,)
    target: Index  # (m,) set-point of each component, ascending
    family: tuple[Family, ...]
    side: Index  # (m,) side of the free floor, and so the slab of headings, of each component
    floor: Index  # (m,) connected piece of the free floor that holds the component
    overlaps: Callable[[int], Index]  # (e, 2) pairs that overlap, by how many set-points they are apart
    _flats: dict[int, FlatPolygon] = field(init=False, default_factory=dict)

    @cached_property
    def rungs(self) -> Index:
        """First component of every set-point, and the end: ``rungs[i]:rungs[i + 1]`` are those of i."""
        return np.searchsorted(self.target, np.arange(self.count + 1))

    @cached_property
    def empty(self) -> list[int]:
        """Set-points without any component."""
        return np.flatnonzero(np.diff(self.rungs) == 0).tolist()

    def components_at(self, keep: Mask, i: int) -> list[int]:
        """Return the components of set-point i that a mask (m,) selects."""
        return [k for k in range(self.rungs[i], self.rungs[i + 1]) if keep[k]]

    def off(self, piece: int | None) -> list[int]:
        """Return the set-points that have components, but none on a given piece of the free floor."""
        there = set(self.target[self.floor == piece].tolist()) if piece is not None else set()
        return sorted(set(self.target.tolist()) - there)

    def flat(self, k: int) -> FlatPolygon:
        """Return a component for kernels; a few are cached."""
        if k not in self._flats:
            if len(self._flats) >= MAX_FLAT_COMPONENTS:
                self._flats.clear()
            self._flats[k] = FlatPolygon.from_shapely(self.component[k])
        return self._flats[k]

    @cached_property
    def edges(self) -> Index:
        """Pairs of components of neighbouring set-points that overlap, (e, 2)."""
        return self.overlaps(1)

    @cached_property
    def group(self) -> Index:
        """Number of each component, (m,); those of one set-point with the same are joined by turning."""
        return component_labels(len(self.component), self.overlaps(0))

    @cached_property
    def ahead(self) -> list[list[int]]:
        """For each component, those of the next set-point that overlap it or one of its group."""
        return self._neighbours(self.edges)

    @cached_property
    def back(self) -> list[list[int]]:
        """For each component, those of the set-point before that overlap it or one of its group."""
        return self._neighbours(self.edges[:, ::-1])

    def _neighbours(self, pairs: Index) -> list[list[int]]:
        table: list[list[int]] = [[] for _ in range(int(self.group.max(initial=-1)) + 1)]
        size = max(1, len(self.group))
        joined = np.unique(self.group[pairs[:, 0]] * size + pairs[:, 1])
        for group, other in zip((joined // size).tolist(), (joined % size).tolist(), strict=True):
            table[group].append(other)
        return [table[group] for group in self.group.tolist()]


def build_ladder(areas: PathAreas, count: int, free_space: FreeSpace) -> Ladder:
    """Split areas of ``count`` set-points into components, and join those of neighbours that overlap."""
    parts, row = shapely.get_parts(areas.inner, return_index=True)
    whole = shapely.get_type_id(areas.inner)[row] == shapely.GeometryType.POLYGON
    parts[whole] = areas.inner[row[whole]]  # not its copy: for very long paths, memory is mostly areas
    real = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > MIN_AREA)
    parts, row = parts[real], row[real]
    target = areas.target[row]
    kinds, side = tuple(areas.family[k] for k in row), areas.side[row]
    spots = shapely.point_on_surface(parts)
    overlaps = partial(_overlaps, free_space, parts, spots, target, side, kinds, count)
    return Ladder(count, parts, target, kinds, side, _pieces(spots, side, free_space), overlaps)


def _pieces(spots: Geometries, side: Index, free_space: FreeSpace) -> Index:
    """Return the label of the piece of free floor around each spot, -1 for none."""
    piece = np.full(len(spots), -1, dtype=np.intp)
    polygons, sides, label = free_space.pieces
    which, found = shapely.STRtree(polygons).query(spots)
    own = side[which] == sides[found]
    which, found = which[own], found[own]
    held = shapely.intersects(polygons[found], spots[which])  # quick: pieces are prepared, spots are not
    piece[which[held]] = label[found[held]]
    return piece


def _overlaps(
    free_space: FreeSpace,
    parts: Geometries,
    spots: Geometries,
    target: Index,
    side: Index,
    kinds: Sequence[Family],
    count: int,
    ahead: int,
) -> Index:
    """Return the pairs of overlapping components of like posture, ``ahead`` set-points apart."""
    if len(free_space.sides) == 1 and not ahead:  # components of one area are apart
        return np.empty((0, 2), dtype=np.intp)
    facing = np.array([kind.facing for kind in kinds])
    pitch = np.array([kind.pitch for kind in kinds])
    rungs = np.searchsorted(target, np.arange(count + ahead + 1))
    repeat = np.diff(rungs)[target + ahead]
    here = np.repeat(np.arange(len(parts)), repeat)
    there = np.repeat(rungs[target + ahead] - np.cumsum(repeat) + repeat, repeat) + np.arange(len(here))
    turn = np.abs(np.nan_to_num(pitch[here] - pitch[there], nan=0.0))
    alike = (facing[here] == facing[there]) & (np.isnan(pitch[here]) == np.isnan(pitch[there]))
    alike &= (turn < np.pi / 2) & free_space.beside(side[here], side[there])
    here, there = here[alike], there[alike]
    shared = _shared(parts, spots, here, there)
    return np.column_stack([here[shared], there[shared]])


def _shared(parts: Geometries, spots: Geometries, here: Index, there: Index) -> Mask:
    """Return a mask of the pairs that overlap; mostly one holds a square about a spot of the other."""
    shapely.prepare(parts)
    x, y = shapely.get_x(spots), shapely.get_y(spots)
    squares = shapely.box(x - SURE_OVERLAP, y - SURE_OVERLAP, x + SURE_OVERLAP, y + SURE_OVERLAP)
    sure, shared = shapely.contains_properly(parts, squares), np.zeros(len(here), dtype=bool)
    for one, other in ((here, there), (there, here)):
        asked = np.flatnonzero(~shared & sure[one])
        shared[asked] = shapely.contains_properly(parts[other[asked]], squares[one[asked]])
    rest = np.flatnonzero(~shared)
    a, b = parts[here[rest]], parts[there[rest]]
    meet = shapely.intersects(a, b)
    shared[rest[meet]] = shapely.area(shapely.intersection(a[meet], b[meet])) > MIN_AREA
    shapely.destroy_prepared(parts)  # as much memory again as the parts themselves
    return shared
