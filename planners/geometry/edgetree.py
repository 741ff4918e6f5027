"""The edges of an area in a tree of boxes: the same answers as `flat` gives, without asking every edge.

The tree is a full binary one kept as an array: node i has the children 2 i and 2 i + 1, and the last half of
the nodes are leaves of a few edges each. Edges of a ring follow each other, so that neighbours share a leaf.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.flat import ON_EDGE, Index, compiled, nearest_on_segment
from regionik.worlds.arrays import Array

LEAF = 4  # edges


class EdgeTree(NamedTuple):
    """Edges of an area, as values for kernels; made by `tree_of`.

    Attributes
    ----------
    edges : (m, 4) array
        Both ends of every edge; none where there is no area [m].
    boxes : (2 n, 4) array
        Least x, y and largest x, y of every node; the first row is not used [m].
    """

    edges: Array
    boxes: Array


@compiled
def tree_of(vertices: Array, starts: Index) -> EdgeTree:
    """Sort the edges of flat rings into a tree.

    Examples
    --------
    >>> tree = tree_of(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]), np.array([0, 4]))
    >>> clamp(tree, 1.0, 3.0, 0), clamp(tree, 1.0, 0.5, 3)
    ((1.0, 1.0, 3), (1.0, 0.5, 3))
    """
    edges = np.empty((len(vertices), 4))
    for r in range(len(starts) - 1):
        last = starts[r + 1] - 1
        for k in range(starts[r], starts[r + 1]):
            edges[k, 0], edges[k, 1] = vertices[last, 0], vertices[last, 1]
            edges[k, 2], edges[k, 3] = vertices[k, 0], vertices[k, 1]
            last = k
    leaves = 1
    while leaves * LEAF < len(edges):
        leaves *= 2
    boxes = np.empty((2 * leaves, 4))
    for i in range(2 * leaves - 1, -1, -1):
        for j in range(2):
            low, high = np.inf, -np.inf
            if 0 < i < leaves:
                low = min(boxes[2 * i, j], boxes[2 * i + 1, j])
                high = max(boxes[2 * i, 2 + j], boxes[2 * i + 1, 2 + j])
            for k in range(max(0, i - leaves) * LEAF, min((i - leaves + 1) * LEAF, len(edges))):
                low, high = min(low, edges[k, j], edges[k, 2 + j]), max(high, edges[k, j], edges[k, 2 + j])
            boxes[i, j], boxes[i, 2 + j] = low, high
    return EdgeTree(edges, boxes)


@compiled
def beyond(i: int) -> int:
    """The next node that is not below this one; 0 behind the last."""
    while i & 1:
        i >>= 1
    return i + 1 if i > 0 else 0


@compiled
def _gap2(boxes: Array, i: int, x: float, y: float) -> float:
    """Square of the distance to a box."""
    beside = max(0.0, boxes[i, 0] - x, x - boxes[i, 2])
    above = max(0.0, boxes[i, 1] - y, y - boxes[i, 3])
    gap2: float = beside * beside + above * above
    return gap2


@compiled
def _crossed_oddly(tree: EdgeTree, x: float, y: float) -> bool:
    """Whether a ray from the point crosses the edges an odd number of times."""
    edges, boxes = tree
    leaves, inside, i = len(boxes) // 2, False, 1
    while i > 0:
        if y < boxes[i, 1] or y >= boxes[i, 3] or x > boxes[i, 2]:
            i = beyond(i)
        elif i < leaves:
            i *= 2
        else:
            first = (i - leaves) * LEAF
            for k in range(first, min(first + LEAF, len(edges))):
                ay, by = edges[k, 1], edges[k, 3]
                if (ay > y) != (by > y):
                    ax, bx = edges[k, 0], edges[k, 2]
                    side = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
                    if (side > 0.0) == (by > ay):
                        inside = not inside
            i = beyond(i)
    return inside


@compiled
def likely(tree: EdgeTree, x: float, y: float) -> int:
    """An edge that may be the nearest: of every two boxes into the nearer one."""
    edges, boxes = tree
    leaves, i = len(boxes) // 2, 1
    while i < leaves:
        i *= 2
        if _gap2(boxes, i + 1, x, y) < _gap2(boxes, i, x, y):
            i += 1
    return int(min((i - leaves) * LEAF, len(edges) - 1))


@compiled
def nearest(tree: EdgeTree, x: float, y: float, edge: int) -> tuple[float, float, int]:
    """Nearest point of the edges and the edge it lies on, of several as near the first.

    The search begins with ``edge``, and is over soon where that is near.
    """
    edges, boxes = tree
    leaves = len(boxes) // 2
    best_x, best_y = nearest_on_segment(edges[edge, 0], edges[edge, 1], edges[edge, 2], edges[edge, 3], x, y)
    best = (best_x - x) * (best_x - x) + (best_y - y) * (best_y - y)
    i = 1
    while i > 0:
        if _gap2(boxes, i, x, y) > best:
            i = beyond(i)
        elif i < leaves:
            i *= 2
        else:
            first = (i - leaves) * LEAF
            for k in range(first, min(first + LEAF, len(edges))):
                px, py = nearest_on_segment(edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3], x, y)
                gap2 = (px - x) * (px - x) + (py - y) * (py - y)
                if gap2 < best or (gap2 == best and k < edge):
                    best, best_x, best_y, edge = gap2, px, py, k
            i = beyond(i)
    return best_x, best_y, edge


@compiled
def clamp(tree: EdgeTree, x: float, y: float, edge: int) -> tuple[float, float, int]:
    """The point itself when it is inside or on the boundary, else the nearest point there, and its edge.

    ``edge`` is as in `nearest`, and is given back where the point is inside.
    """
    if _crossed_oddly(tree, x, y):
        return x, y, edge
    near_x, near_y, edge = nearest(tree, x, y, edge)
    if (near_x - x) ** 2 + (near_y - y) ** 2 <= ON_EDGE * ON_EDGE:
        return x, y, edge
    return near_x, near_y, edge
