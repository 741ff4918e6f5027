"""Occupied cells of a grid of cubes, and few boxes that they make up."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Box

MAX_BOXES = 1000  # of one scan or map: checks of plans look at each
MAX_SPAN = 2**20  # cells along an axis, as three indices make one whole number
MAX_CELLS = 2_000_000  # of an octomap


def occupied_cells(points: Array, side: float, least: int) -> Index:
    """Return indices (n, 3) of the cells of a side [m] that hold at least so many of the points (k, 3) [m].

    The corner of cell 0, 0, 0 is the origin; cells hold the points on their lower faces.
    """
    cells = np.floor(points / side)
    if np.ptp(cells, axis=0).max() >= MAX_SPAN:
        raise InputError(f"voxel: expected one of which a scan is at most {MAX_SPAN} long, got {side:g} m")
    low = cells.min(axis=0).astype(np.int64)
    found, counts = np.unique(_numbered(cells.astype(np.int64) - low), return_counts=True)
    return _indices(found[counts >= least]) + low


def coarser(cells: Index, factor: int) -> Index:
    """Return the cells (m, 3), so many times as long, that some cells (n, 3) lie in."""
    larger = cells // factor
    low = larger.min(axis=0)
    return _indices(np.unique(_numbered(larger - low))) + low


def boxes_of(name: str, cells: Index, side: float) -> tuple[Box, ...]:
    """Return boxes that fill exactly the cells (n, 3) of a grid of a side [m], numbered after a name.

    Raises
    ------
    InputError
        For more than `MAX_BOXES`, with the side that makes few enough.
    """
    spans = merged(cells)
    if len(spans) > MAX_BOXES:
        way = "keep less of it by z"
        for factor in (2, 4, 8, 16):
            count = len(merged(coarser(cells, factor)))
            if count <= MAX_BOXES:
                way = f"voxel: {factor * side:g} makes {count}; or {way}"
                break
        told = f"expected cells that make at most {MAX_BOXES} boxes, these make {len(spans)}"
        raise InputError(f"voxel: {told}: {way}")
    names = [name] if len(spans) == 1 else [f"{name} {k + 1}" for k in range(len(spans))]
    sizes, centers = (spans[:, 1] - spans[:, 0]) * side, spans.sum(axis=1) / 2 * side
    return tuple(Box(one, size, center) for one, size, center in zip(names, sizes, centers, strict=True))


def merged(cells: Index) -> Index:
    """Return boxes (m, 2, 3) of indices, low and high, that fill cells (n, 3) and do not overlap.

    Cells are joined to bars along one axis, equal bars to plates along the next, equal plates to boxes along
    the third; of all orders of axes the one with fewest boxes is taken.
    """
    single = np.stack([cells, cells + 1], axis=1)
    ways = []
    for order in permutations(range(3)):
        boxes = single
        for axis in order:
            boxes = _joined(boxes, axis)
        ways.append(boxes)
    return min(ways, key=len)


def _joined(boxes: Index, axis: int) -> Index:
    """Return boxes (m, 2, 3), those joined that follow one another along an axis and are else the same."""
    others = [k for k in range(3) if k != axis]
    across = boxes[:, :, others].reshape(len(boxes), 4)
    order = np.lexsort([boxes[:, 0, axis], *across.T])
    boxes, across = boxes[order], across[order]
    follows = (across[1:] == across[:-1]).all(axis=1) & (boxes[1:, 0, axis] == boxes[:-1, 1, axis])
    first = np.flatnonzero(np.concatenate([[True], ~follows]))
    last = np.append(first[1:], len(boxes)) - 1
    joined = boxes[first].copy()
    joined[:, 1, axis] = boxes[last, 1, axis]
    return joined


def _numbered(cells: Index) -> Index:
    """Return one whole number for each three indices from 0 to `MAX_SPAN`."""
    numbers: Index = (cells[:, 0] * MAX_SPAN + cells[:, 1]) * MAX_SPAN + cells[:, 2]
    return numbers


def _indices(numbers: Index) -> Index:
    return np.stack([numbers // MAX_SPAN**2, numbers // MAX_SPAN % MAX_SPAN, numbers % MAX_SPAN], axis=1)
