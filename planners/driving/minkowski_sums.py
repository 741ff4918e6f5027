"""Minkowski sums with one convex shape, corners (k, 2) [m]."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.planners.driving.footprint_scene import edges_of
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.worlds.arrays import Array


def minkowski_sum(area: BaseGeometry, shape: Array) -> BaseGeometry:
    """Minkowski sum of an area and a convex shape: the area moved by a corner, its edges by all of it."""
    if area.is_empty:
        return area
    ends = edges_of(FlatPolygon.from_shapely(area))
    spots = np.concatenate([ends[:, None, :2] + shape, ends[:, None, 2:] + shape], axis=1)
    grown = shapely.convex_hull(shapely.multipoints(spots))
    whole: BaseGeometry = shapely.union_all([shapely.transform(area, lambda p: p + shape[0]), *grown])
    return whole


def grown_by_disc(shape: Array, radius: float, sides: int, *, outside: bool) -> Array:
    """Corners of a convex shape, counter-clockwise, grown by a polygon round a disc, or inside it.

    By the sides of both in the order of their directions: shapely's buffer rounds the number of sides.
    """
    if radius == 0:
        return shape
    turns = 2 * np.pi * np.arange(sides) / sides
    corner = radius / np.cos(np.pi / sides) if outside else radius
    disc = corner * np.column_stack([np.cos(turns), np.sin(turns)])
    sides_of_both = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in (shape, disc)])
    order = np.argsort(np.arctan2(*sides_of_both.T[::-1]) % (2 * np.pi), kind="stable")
    lowest = sum(ring[np.lexsort(ring.T)[0]] for ring in (shape, disc))
    corners: Array = lowest + np.cumsum(sides_of_both[order], axis=0)
    return corners


def minkowski_sums(pieces: Sequence[Array], shape: Array) -> NDArray[np.object_]:
    """Minkowski sums of convex pieces with a convex shape, as hulls of all sums of their corners."""
    if not pieces:
        return np.empty(0, dtype=object)
    closed = np.concatenate([shape, shape[:1]])  # a line has two corners at least
    points = (np.concatenate(pieces)[:, None] + closed).reshape(-1, 2)
    owner = np.repeat(np.arange(len(pieces)), [len(closed) * len(piece) for piece in pieces])
    lines = shapely.linestrings(points, indices=owner)  # several times as quick to make as points
    sums: NDArray[np.object_] = shapely.convex_hull(lines)
    return sums
