"""Triangles in a tree of boxes: which of them are nearer to a hull than another has said, if any.

The tree is a full binary one kept as an array: node i has the children 2 i and 2 i + 1, and the last half of
the nodes are leaves of a few triangles each. Triangles that share a leaf lie beside each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.geometry.hulls import extremes, hull_gap
from regionik.planners.geometry.polygons import compiled
from regionik.worlds.arrays import Array

LEAF = 4  # triangles


class FaceTree(NamedTuple):
    """Triangles, as values for kernels; made by `face_tree`.

    Attributes
    ----------
    triangles : (m, 3, 3) array
        Corners, in the order of the leaves [m].
    boxes : (2 n, 6) array
        Least x, y, z and largest x, y, z of every node; the first row is not used [m].
    """

    triangles: Array
    boxes: Array


def face_tree(vertices: Array, faces: NDArray[np.int64]) -> FaceTree:
    """Sort triangles into a tree, each half of a node along its longest side."""
    leaves = 1
    while leaves * LEAF < len(faces):
        leaves *= 2
    corners = vertices[faces]
    triangles = np.ascontiguousarray(corners[_by_leaf(corners.mean(1), np.arange(len(faces)), leaves)])
    sides = np.full((leaves * LEAF, 6), np.inf)  # least, and minus the largest: both grow towards the least
    sides[: len(triangles)] = np.hstack([triangles.min(1), -triangles.max(1)])
    boxes = np.full((2 * leaves, 6), np.inf)
    boxes[leaves:] = sides.reshape(leaves, LEAF, 6).min(1)
    while leaves > 1:
        leaves //= 2
        boxes[leaves : 2 * leaves] = boxes[2 * leaves : 4 * leaves].reshape(leaves, 2, 6).min(1)
    boxes[:, 3:] *= -1
    return FaceTree(triangles, boxes)


def _by_leaf(middles: Array, which: NDArray[np.int64], leaves: int) -> NDArray[np.int64]:
    """The triangles in the order of their leaves, of which only the last are not full."""
    if len(which) <= LEAF:
        return which
    half, longest = LEAF * leaves // 2, int(np.ptp(middles[which], axis=0).argmax())
    ranked = which[np.argsort(middles[which, longest], kind="stable")]
    parts = (_by_leaf(middles, part, leaves // 2) for part in (ranked[:half], ranked[half:]))
    return np.concatenate(list(parts))


@compiled
def _beyond(i: int) -> int:
    """The next node that is not below this one; 0 behind the last."""
    while i & 1:
        i >>= 1
    return i + 1 if i > 0 else 0


@compiled
def nearest_face(tree: FaceTree, A: Array, most: float, way: Array, spot: Array) -> float:
    """Distance of the hull of A from the triangles, where it is less than ``most``, else that [m].

    Parameters
    ----------
    tree : FaceTree
    A : (n, 3) array
        [m]
    most : float
        [m]
    way : (3,) array
        A unit direction from the triangles to A, the better the faster. Overwritten, where something is
        nearer, with that in which it is.
    spot : (3,) array
        Overwritten likewise with the point of A nearest to the triangles.
    """
    triangles, boxes = tree
    low, high = np.empty(3), np.empty(3)
    for d in range(3):
        low[d], high[d] = A[:, d].min(), A[:, d].max()
    along, place = np.empty(3), np.empty(3)
    leaves, least, i = len(boxes) // 2, most, 1
    while i > 0:
        square = 0.0
        for d in range(3):
            aside = max(boxes[i, d] - high[d], low[d] - boxes[i, 3 + d], 0.0)
            square += aside * aside
        if square >= least * least:
            i = _beyond(i)
        elif i < leaves:
            i *= 2
        else:
            first = (i - leaves) * LEAF
            for k in range(first, min(first + LEAF, len(triangles))):
                if extremes(A, triangles[k], way)[2] >= least:
                    continue
                along[:] = 0.0
                gap = max(hull_gap(A, triangles[k], 0.0, along, place)[0], 0.0)
                if gap < least:
                    least = gap
                    way[:] = along
                    spot[:] = place
            i = _beyond(i)
    return least
