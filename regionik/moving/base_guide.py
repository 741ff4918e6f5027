"""A base path through the areas of a run, to which base and joints are drawn while they go on together.

The least motion from state to state does not look ahead: it brings the base up against a post and leaves it
there. The areas know the way round, as a set-point has places on both sides of the post that are connected
behind it. So the path of the arm axis that drives least, in even steps and away from the edges of areas, is
searched on a lattice of places. It is a wish: what follows it is proven as ever, and turns as it must.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt, minimum_filter1d

from regionik.areas.layers import Geometries
from regionik.moving.options import MOVING
from regionik.worlds.arrays import Array, Index

OPTIONS = MOVING.guide


class BaseGuide(NamedTuple):
    """Places of the arm axis along a run, (n, 2), and how deep in its area each is, (n,) [m]."""

    first: int  # set-point of the first
    places: Array
    depth: Array

    def at(self, i: int) -> Array:
        """Return the place (2,) for a set-point."""
        place: Array = self.places[i - self.first]
        return place

    @property
    def narrow(self) -> list[int]:
        """Set-points whose areas leave less room than those about them, the narrowest first."""
        least = minimum_filter1d(self.depth, max(1, len(self.depth) // OPTIONS.max_narrow))
        found = np.flatnonzero(self.depth == least)
        apart = found[np.diff(found, prepend=-2) > 1]  # of each row of them the first
        ordered: list[int] = (self.first + apart[np.argsort(self.depth[apart], kind="stable")]).tolist()
        return ordered[: OPTIONS.max_narrow]


class _Layer(NamedTuple):
    """Cells (nx, ny) about the areas of a set-point, and the cheapest ways there."""

    corner: Index  # (2,) of the lattice, the first
    depth: Array  # in the areas, 0 outside [m]
    cost: Array  # of the way there, infinite for none
    step: Index  # its last, a row of the lattice's


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Places a spacing apart."""

    origin: Array  # (2,) [m]
    reach: float  # of the arm, to which all lengths are in proportion [m]

    @property
    def spacing(self) -> float:
        return OPTIONS.spacing * self.reach

    @cached_property
    def steps(self) -> Index:
        """Steps of the base from cell to cell, (n, 2), the short ones first."""
        far = range(-OPTIONS.max_cells, OPTIONS.max_cells + 1)
        found = np.array([step for step in product(far, far) if math.hypot(*step) <= OPTIONS.max_cells])
        ordered: Index = found[np.argsort(np.linalg.norm(found, axis=1), kind="stable")]
        return ordered

    def places(self, cells: Array | Index) -> Array:
        """Return the places of cells, each (..., 2)."""
        places: Array = self.origin + self.spacing * cells
        return places

    def layer(self, areas: Geometries, before: _Layer | None) -> _Layer:
        """Return the cells of some areas, ways to which go on from those of the set-point before."""
        corner, depth = self._depth(areas)
        nearness = np.maximum(1 - depth / (OPTIONS.edge_margin * self.reach), 0.0)
        cost = np.where(depth > 0, OPTIONS.edge_cost * (nearness * self.reach) ** 2, np.inf)
        taken = np.zeros(cost.shape, dtype=np.intp)
        if before is not None:
            ways = np.full(cost.shape, np.inf)
            for n, step in enumerate(self.steps):
                longer = _read(before, corner - step, cost.shape) + self.spacing**2 * (step @ step)
                better = longer < ways
                ways[better], taken[better] = longer[better], n
            cost += ways
        return _Layer(corner, depth, cost, taken)

    def _depth(self, areas: Geometries) -> tuple[Index, Array]:
        """Return the first cell about some areas, and the distance from their edge in each, 0 outside [m].

        An area without a cell has the one next to it.
        """
        ends = np.floor((shapely.bounds(areas) - np.tile(self.origin, 2)) / self.spacing).astype(np.intp)
        corner = ends[:, :2].min(axis=0)
        inside = np.zeros(ends[:, 2:].max(axis=0) + 1 - corner, dtype=bool)
        for area, (a, b, c, d) in zip(areas, (ends - np.tile(corner, 2)).tolist(), strict=True):
            cells = np.moveaxis(np.mgrid[a : c + 1, b : d + 1], 0, -1)
            within = shapely.contains_xy(area, *np.moveaxis(self.places(corner + cells), -1, 0))
            within[0, 0] |= not within.any()
            inside[a : c + 1, b : d + 1] |= within
        depth: Array = self.spacing * distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
        return corner, depth


def base_guide(first: int, areas: Sequence[Geometries], reach: float) -> BaseGuide | None:
    """Return a base path from a first set-point on, for an arm of some reach [m]; None where none is found.

    Areas are those of each set-point, one or more.
    """
    lattice = _Lattice(shapely.total_bounds(areas[0])[:2], reach)
    layers = [lattice.layer(areas[0], None)]
    for some in areas[1:]:
        layers.append(lattice.layer(some, layers[-1]))
    if not np.isfinite(layers[-1].cost).any():
        return None
    cells = _traced(layers, lattice.steps)
    along = zip(layers, cells, strict=True)
    depth = [float(layer.depth[tuple(cell - layer.corner)]) for layer, cell in along]
    return BaseGuide(first, lattice.places(cells), np.array(depth))


def _read(layer: _Layer, corner: Index, shape: tuple[int, ...]) -> Array:
    """Return the costs of other cells (nx, ny) from a corner, infinite where there are none."""
    found = np.full(shape, np.inf)
    low = np.maximum(corner, layer.corner)
    high = np.minimum(corner + shape, layer.corner + layer.cost.shape)
    if (low < high).all():
        to, of = (tuple(map(slice, low - own, high - own)) for own in (corner, layer.corner))
        found[to] = layer.cost[of]
    return found


def _traced(layers: list[_Layer], steps: Index) -> Index:
    """Return the cells of the cheapest way, (n, 2)."""
    last = layers[-1]
    cells = [last.corner + np.unravel_index(int(np.argmin(last.cost)), last.cost.shape)]
    for layer in layers[:0:-1]:
        cells.append(cells[-1] - steps[layer.step[tuple(cells[-1] - layer.corner)]])
    return np.array(cells[::-1])
