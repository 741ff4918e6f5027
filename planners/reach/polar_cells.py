"""Cells of a polar grid, cut where their edges leave a set: an area from samples (marching squares).

Of an arm that has a closed form, what the samples did not find is asked of that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.reach.options import REACH
from regionik.planners.solvers.closed_form import Polish, decomposition, postures_at
from regionik.planners.solvers.damped_least_squares import ORIENTATION, Aim
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.chain import Chain

OPTIONS = REACH.pose


@dataclass(frozen=True, eq=False)
class PolarCells:
    """Cells between neighbouring distances and bearings that have a corner in a set."""

    distances: Array  # (r,) ascending from 0 [m]
    bearings: Array  # (b,) evenly round the full turn [rad]; one stands for all
    members: Mask  # (r, b) grid points in the set
    outward: Array  # (r - 1, b) share of the edge to the next distance at which it leaves the set
    onward: Array  # (r, b) the same of the edge to the next bearing
    counted: Mask | None = None  # (r - 1, b) cells that count; None for all whose corners in it share an edge

    @cached_property
    def _corners(self) -> Mask:
        """Corners in the set (4, r - 1, b), in their order round the cell."""
        after = np.roll(self.members, -1, axis=1)
        return np.stack([self.members[:-1], self.members[1:], after[1:], after[:-1]])

    @cached_property
    def cells(self) -> tuple[Index, Index]:
        """Indices of the cells that count, of distance and of bearing."""
        if self.counted is not None:
            some = self.counted
        else:
            a, b, c, d = self._corners
            some = (a | b | c | d) & ~((a == c) & (b == d) & (a != b))
        r, b = np.nonzero(some)
        return r.astype(np.int64), b.astype(np.int64)

    @property
    def whole(self) -> int:
        """Number of the cells with all four corners in the set."""
        return int(np.count_nonzero(self._corners[:, *self.cells].all(axis=0)))

    @cached_property
    def _vertices(self) -> tuple[Array, Mask]:
        """Corners and cuts round each cell (m, 8, 2), as shares of it, and which of them it has."""
        r, b = self.cells
        after = (b + 1) % len(self.bearings)
        corners = self._corners[:, r, b]
        cut = corners != np.roll(corners, -1, axis=0)
        zero, one = np.zeros(len(r)), np.ones(len(r))
        out, there = self.outward[r, b], self.outward[r, after]
        near, far = self.onward[r, b], self.onward[r + 1, b]
        outward = [zero, out, one, one, one, there, zero, zero]
        onward = [zero, zero, zero, far, one, one, one, near]
        shares = np.array([outward, onward]).transpose(2, 1, 0)
        real = np.stack([corners, cut], axis=1).reshape(8, -1).T
        return shares, real

    @property
    def middles(self) -> tuple[Index, Index, Array]:
        """Cells that count, and the middle of each: distance [m] and bearing [rad], (m, 2)."""
        (r, b), (shares, real) = self.cells, self._vertices
        middle = (shares * real[:, :, None]).sum(axis=1) / real.sum(axis=1)[:, None]
        wide, turn = self.distances[1], 2 * np.pi / len(self.bearings)
        distance, bearing = self.distances[r] + wide * middle[:, 0], self.bearings[b] + turn * middle[:, 1]
        return r, b, np.column_stack([distance, bearing])

    def selected(self, some: Mask) -> PolarCells:
        """Only those of the cells that a mask (m,) names."""
        r, b = self.cells
        counted = np.zeros((len(self.distances) - 1, len(self.bearings)), dtype=np.bool_)
        counted[r[some], b[some]] = True
        return replace(self, counted=counted)

    @property
    def area(self) -> BaseGeometry:
        """All cells that count as one shape about the origin, straight from vertex to vertex [m]."""
        if len(self.bearings) == 1:
            return self._round_about.area
        (r, b), (shares, real) = self.cells, self._vertices
        if not len(r):
            return Polygon()
        wide, turn = self.distances[1], 2 * np.pi / len(self.bearings)
        # What two cells share is computed from the same numbers, so that their edges are the same.
        out, on = np.moveaxis(shares, 2, 0)
        after = ((b + 1) % len(self.bearings))[:, None] * turn
        step = np.where(on == 1.0, after, b[:, None] * turn + turn * on)
        farther = self.distances[r][:, None] + wide * out
        distance = np.where(out == 1.0, self.distances[r + 1][:, None], farther)
        points = distance[..., None] * np.stack([np.cos(step), np.sin(step)], axis=-1)
        return _joined(points, real)

    @property
    def _round_about(self) -> PolarCells:
        """The same set with a bearing for every side of the circle."""

        def spun(values: NDArray) -> NDArray:  # type: ignore[type-arg]
            return np.repeat(values, OPTIONS.bearings_around, axis=1)

        return PolarCells(
            self.distances,
            np.linspace(0.0, 2 * np.pi, OPTIONS.bearings_around, endpoint=False),
            spun(self.members),
            spun(self.outward),
            spun(self.onward),
            None if self.counted is None else spun(self.counted),
        )


def _joined(points: Array, real: Mask) -> BaseGeometry:
    """Polygons of those of their points (m, 8, 2) that are real, as one shape; they share whole edges."""
    ring, corner = np.repeat(np.arange(len(points)), real.sum(axis=1)), points[real]
    first = np.searchsorted(ring, np.arange(len(points)))
    before = np.arange(len(ring)) - 1
    before[first] = np.searchsorted(ring, np.arange(len(points)), side="right") - 1
    own = (corner != corner[before]).any(axis=1)  # a cut may be at a corner; those at the origin are one
    own &= np.bincount(ring[own], minlength=len(points))[ring] >= 3
    if not own.any():
        return Polygon()
    ring = np.unique(ring[own], return_inverse=True)[1]
    rings = shapely.linearrings(corner[own], indices=ring)
    return shapely.coverage_union_all(shapely.polygons(rings))


def can_ask(chain: Chain, kind: int) -> bool:
    """True where a closed form knows all postures at an aim of a kind at once."""
    form = decomposition(chain) if kind == ORIENTATION else None
    return form is not None and form.swept is None


def closed_form_cells(chain: Chain, aim: Aim, within: Polish, cells: PolarCells, met: Mask) -> PolarCells:
    """Cells that count, their cuts moved outward as far as a closed form knows postures there.

    Parameters
    ----------
    chain : Chain
        One that `can_ask`, from a base frame at heading zero.
    aim : Aim
        Above the origin.
    within : Polish
        Accuracy that postures have on it.
    met : (m,) array of bool
        Cells in whose middle a posture is known.
    """
    found, middles = cells.members, cells.middles[2]
    edges = np.concatenate([_cut(found[:-1], found[1:], 0), _cut(found, np.roll(found, -1, axis=1), 1)])
    sides = cells.outward.copy(), cells.onward.copy()
    cuts = np.array([sides[side][i, j] for side, i, j in edges.tolist()])
    inside = found[edges[:, 1], edges[:, 2]]
    shares = cuts + np.where(inside, 1.0, -1.0) * np.array(OPTIONS.moved_cuts)[:, None]
    wide, turn = cells.distances[1], 2 * np.pi / len(cells.bearings)
    out, on = np.where(edges[:, 0] == 0, shares, 0.0), np.where(edges[:, 0] == 1, shares, 0.0)
    places = np.stack([(edges[:, 1] + out) * wide, (edges[:, 2] + on) * turn], axis=-1)
    real = (shares > 0.0) & (shares < 1.0)
    known = _known(chain, aim, within, np.concatenate([places[real], middles[~met]]))
    real[real] = known[: np.count_nonzero(real)]
    moved = np.where(real[0], np.where(real[1], shares[1], shares[0]), cuts)
    for (side, i, j), share in zip(edges.tolist(), moved.tolist(), strict=True):
        sides[side][i, j] = share
    counted = met.copy()
    counted[~met] = known[len(known) - np.count_nonzero(~met) :]
    return PolarCells(cells.distances, cells.bearings, found, *sides).selected(counted)


def _cut(members: Mask, there: Mask, side: int) -> Index:
    """Edges of a side with one end in the reach: side, and indices of distance and bearing, (k, 3)."""
    i, j = np.nonzero(members != there)
    return np.column_stack([np.full(len(i), side), i, j])


def _known(chain: Chain, aim: Aim, within: Polish, places: Array) -> Mask:
    """Mask of the distances and bearings (m, 2) from which a posture meets an aim."""
    distance, bearing = places.T
    tools = np.tile(np.eye(4), (len(places), 1, 1))
    tools[:, :3, :3] = aim.turn
    tools[:, 0, 3], tools[:, 1, 3] = -distance * np.cos(bearing), -distance * np.sin(bearing)
    tools[:, 2, 3] = aim.position[2]
    known = np.zeros(len(places), dtype=np.bool_)
    if len(places):
        known[postures_at(chain, tools, within)[1]] = True
    return known
