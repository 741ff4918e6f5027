"""A floor as edges sorted into square cells: what is near is found, and inside told from outside, locally."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.flat import Index, compiled
from regionik.worlds.arrays import Array

MOST_CELLS = 2_000_000
SPOT = (0.4142135, 0.5857864)  # where a cell's spot lies in it, off the lines on which edges like to lie


class Cells(NamedTuple):
    """Edges of a polygon by cell, as values for kernels; made by `cells_of`.

    Attributes
    ----------
    edges : (m, 4) array
        Both ends of every edge, the inside to its left [m].
    first : (c + 1,) array of int
        Cell k meets the edges ``listed[first[k]:first[k + 1]]``; cells go row by row.
    listed : (l,) array of int
    inside : (c,) array of bool
        Whether the cell's spot is inside the polygon.
    x, y : float
        Corner of the first cell [m].
    size : float
        Of a cell [m].
    columns, rows : int
    """

    edges: Array
    first: Index
    listed: Index
    inside: NDArray[np.bool_]
    x: float
    y: float
    size: float
    columns: int
    rows: int


def cells_of(polygon: BaseGeometry, size: float) -> Cells:
    """Sort the edges of a polygon, of one part or of several, into cells.

    Parameters
    ----------
    polygon : Polygon or MultiPolygon
        [m]
    size : float
        Of a cell; taken larger where there would be too many [m].

    Examples
    --------
    >>> cells = cells_of(shapely.box(0, 0, 2, 2) - shapely.box(1, 1, 1.5, 1.5), 0.5)
    >>> within(cells, 0.9, 0.9), within(cells, 1.2, 1.2), within(cells, 9.0, 0.0)
    (True, False, False)
    """
    rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(polygon)))
    ends, owner = shapely.get_coordinates(rings, return_index=True)
    edges = np.hstack([ends[:-1], ends[1:]])[owner[:-1] == owner[1:]]
    edges = edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)]
    low, high = (np.zeros(2), np.ones(2)) if not len(ends) else (ends.min(axis=0), ends.max(axis=0))
    size = max(size, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    low = low - size / 2
    columns, rows = (np.floor((high - low) / size).astype(np.int64) + 1).tolist()
    first, listed = _sorted(edges, low, size, columns, rows)
    spots = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) + SPOT
    shapely.prepare(polygon)
    inside = shapely.contains_xy(polygon, spots * size + low)
    return Cells(edges, first, listed, inside, float(low[0]), float(low[1]), size, columns, rows)


def _sorted(edges: Array, low: Array, size: float, columns: int, rows: int) -> tuple[Index, Index]:
    """First entry of each cell, and the edges listed by cell; an edge is listed where its box is."""
    ends = (edges.reshape(-1, 2, 2) - low) / size
    begin = np.floor(ends.min(axis=1) - 1e-9).astype(np.int64).clip(0, [columns - 1, rows - 1])
    end = np.floor(ends.max(axis=1) + 1e-9).astype(np.int64).clip(0, [columns - 1, rows - 1])
    wide, tall = (end - begin + 1).T
    edge = np.repeat(np.arange(len(edges)), wide * tall)
    k = np.arange(len(edge)) - np.repeat(np.cumsum(wide * tall) - wide * tall, wide * tall)
    cell = (begin[edge, 1] + k // wide[edge]) * columns + begin[edge, 0] + k % wide[edge]
    order = np.argsort(cell, kind="stable")
    return np.searchsorted(cell[order], np.arange(columns * rows + 1)), edge[order].astype(np.int64)


@compiled
def within(cells: Cells, x: float, y: float) -> bool:
    """Whether a place is inside: the way to it from its cell's spot crosses the edges of the cell alone."""
    column, row = math.floor((x - cells.x) / cells.size), math.floor((y - cells.y) / cells.size)
    if column < 0 or row < 0 or column >= cells.columns or row >= cells.rows:
        return False
    cell = row * cells.columns + column
    sx, sy = cells.x + (column + SPOT[0]) * cells.size, cells.y + (row + SPOT[1]) * cells.size
    dx, dy = x - sx, y - sy
    inside = cells.inside[cell]
    for i in range(cells.first[cell], cells.first[cell + 1]):
        ax, ay, bx, by = cells.edges[cells.listed[i]]
        a, b = dx * (ay - sy) - dy * (ax - sx), dx * (by - sy) - dy * (bx - sx)
        if (a > 0.0) != (b > 0.0):  # the edge crosses the way's line: on the way, or beyond one of its ends?
            ex, ey = bx - ax, by - ay
            here, there = ex * (sy - ay) - ey * (sx - ax), ex * (y - ay) - ey * (x - ax)
            if (here > 0.0) != (there > 0.0):
                inside = not inside
    return bool(inside)
