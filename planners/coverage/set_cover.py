"""Fewest places from which all areas are met: set cover over the faces that the areas cut the floor into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array

LEAST = 1e-10  # faces smaller than this are left out [m2]
CHUNK = 512  # faces compared with all others at once
NODES = 20_000  # of branch and bound, after which the best cover and bound known are given
ROUNDING = 1e-6

Geometries = NDArray[np.object_]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces of an overlay that no other face beats.

    Attributes
    ----------
    polygon : (f,) array of Polygon
    inside : (f, n) array of bool
        Which areas each face lies in.
    """

    polygon: Geometries
    inside: Mask


@dataclass(frozen=True, eq=False)
class Cover:
    """Faces that meet all areas.

    Attributes
    ----------
    chosen : tuple of int
    lower : int
        No fewer faces do: by the linear relaxation, or by branch and bound where that got farther.
    apart : int
        Areas found of which no face meets two: a bound that can be checked by hand.
    optimal : bool
        Whether ``lower`` is met.
    """

    chosen: tuple[int, ...]
    lower: int
    apart: int

    @property
    def optimal(self) -> bool:
        return len(self.chosen) == self.lower


def faces_of(areas: Geometries) -> Faces:
    """Faces of the overlay of areas, without those that lie in a part of the areas of another face only.

    Parameters
    ----------
    areas : (n,) array of polygons
        Valid; what is empty lies in no face.
    """
    lines = shapely.union_all(shapely.boundary(areas[~shapely.is_empty(areas)]))
    polygon = shapely.get_parts(shapely.polygonize([lines]))
    polygon = polygon[shapely.area(polygon) > LEAST]
    inside = np.zeros((len(polygon), len(areas)), dtype=bool)
    shapely.prepare(areas)
    which, area = shapely.STRtree(areas).query(shapely.point_on_surface(polygon), predicate="within")
    inside[which, area] = True
    order = np.lexsort((-shapely.area(polygon), -inside.sum(axis=1)))  # of like faces the largest first
    polygon, inside = polygon[order], inside[order]
    _, first = np.unique(np.packbits(inside, axis=1), axis=0, return_index=True)
    first = np.sort(first)
    polygon, inside = polygon[first], inside[first]
    best = _unbeaten(inside) & inside.any(axis=1)
    return Faces(polygon[best], inside[best])


def _unbeaten(inside: Mask) -> Mask:
    """Rows, all different, that are no part of another row."""
    best = np.ones(len(inside), dtype=bool)
    numbers, size = inside.astype(np.float32), inside.sum(axis=1)
    for a in range(0, len(inside), CHUNK):
        common = numbers[a : a + CHUNK] @ numbers.T
        part = common == size[a : a + CHUNK, None]
        part[np.arange(len(part)), np.arange(a, a + len(part))] = False
        best[a : a + CHUNK] = ~part.any(axis=1)
    return best


def least_cover(inside: Mask, nodes: int = NODES) -> Cover:
    """Fewest faces such that every area holds one of them.

    Parameters
    ----------
    inside : (f, n) array of bool
        Every area must hold some face.
    nodes : int
        Of branch and bound, which has no other limit: the same input gives the same answer.

    Returns
    -------
    Cover
        The greedy one where branch and bound ends without a better one.
    """
    greedy = _greedy(inside)
    table = csr_array(inside.T.astype(np.float64))
    ones = np.ones(len(inside))
    asked = LinearConstraint(table, lb=1.0)
    relaxed = milp(ones, constraints=asked, bounds=Bounds(0, 1))
    lower = int(np.ceil(float(relaxed.fun or 0.0) - ROUNDING))
    chosen = greedy
    if len(greedy) > lower:
        found = milp(
            ones,
            constraints=asked,
            bounds=Bounds(0, 1),
            integrality=np.ones(len(inside), dtype=np.int64),
            options={"node_limit": nodes, "mip_rel_gap": 0.0},
        )
        if found.mip_dual_bound is not None and np.isfinite(found.mip_dual_bound):
            lower = max(lower, int(np.ceil(found.mip_dual_bound - ROUNDING)))
        if found.x is not None:
            exact = np.flatnonzero(found.x > 0.5).tolist()
            chosen = min(greedy, exact, key=len)
    return Cover(tuple(sorted(chosen)), lower, _apart(inside))


def _greedy(inside: Mask) -> list[int]:
    """The face that meets most areas not yet met, again and again."""
    left = np.ones(inside.shape[1], dtype=bool)
    chosen = []
    while left.any():
        best = int(np.argmax(inside[:, left].sum(axis=1)))
        chosen.append(best)
        left &= ~inside[best]
    return chosen


def _apart(inside: Mask) -> int:
    """How many areas were found that share no face, those that share with fewest first."""
    numbers = inside.astype(np.float32)
    near = (numbers.T @ numbers) > 0
    left = np.ones(len(near), dtype=bool)
    count = 0
    for k in np.argsort(near.sum(axis=1), kind="stable").tolist():
        if left[k]:
            left &= ~near[k]
            count += 1
    return count
