"""Fewest points that hit all areas: set cover over their overlay, interval cover in a given order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from regionik.planners.coverage.options import COVERAGE
from regionik.worlds.arrays import Array, Mask

MIN_FACE_AREA = 1e-10  # faces smaller than this are left out [m2]

Geometries = NDArray[np.object_]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class OverlayFaces:
    """Faces of an overlay that no other face dominates."""

    polygon: Geometries  # (f,) of Polygon
    inside: Mask  # (f, n) True where a face lies in an area


@dataclass(frozen=True, eq=False)
class SetCover:
    """Faces that hit all areas."""

    chosen: tuple[int, ...]
    # no fewer faces do: the bound of the linear relaxation, or of branch and bound where that is higher
    lower: int
    # areas found of which no face hits two: how many is a lower bound that can be checked by hand
    apart: tuple[int, ...]


def overlay_faces(areas: Geometries, some: Index | None = None) -> OverlayFaces:
    """Faces of the overlay of areas, without those that only lie in areas of one other face.

    Parameters
    ----------
    areas : (n,) array of polygons
        Valid; an empty one holds no face.
    some : (k,) array of int, optional
        Areas that are laid over each other; of the others it is only known whether a point of each face lies
        in them. By default all.
    """
    laid = areas if some is None else areas[some]
    polygon = np.concatenate([np.empty(0, dtype=object), *map(_faces_that_count, _clusters(laid))])
    inside = _holding(polygon, laid)
    order = np.lexsort((-shapely.area(polygon), -inside.sum(axis=1)))  # of equal faces the largest first
    polygon, inside = polygon[order], inside[order]
    _, first = np.unique(np.packbits(inside, axis=1), axis=0, return_index=True)
    first = np.sort(first)
    polygon, inside = polygon[first], inside[first]
    best = undominated(inside) & inside.any(axis=1)
    return OverlayFaces(polygon[best], inside[best] if some is None else _holding(polygon[best], areas))


def _clusters(areas: Geometries) -> list[Geometries]:
    """Areas that are not empty, those together that meet or have others between them that do."""
    real = areas[~shapely.is_empty(areas)]
    if not len(real):
        return []
    shapely.prepare(real)
    pairs = shapely.STRtree(real).query(real, predicate="intersects")
    graph = coo_array((np.ones(pairs.shape[1], dtype=np.int8), tuple(pairs)), shape=(len(real), len(real)))
    count, label = connected_components(graph, directed=False)
    return [real[label == k] for k in range(count)]


def _faces_that_count(areas: Geometries) -> Geometries:
    """Faces among which are all of the overlay that no other dominates: where all share a place, that."""
    shared = shapely.get_parts(shapely.intersection_all(areas))
    shared = shared[
        (shapely.get_type_id(shared) == shapely.GeometryType.POLYGON) & (shapely.area(shared) > MIN_FACE_AREA)
    ]
    if _holding(shared, areas).all(axis=1).any():
        return shared
    lines = shapely.union_all(shapely.boundary(areas))
    polygon = shapely.get_parts(shapely.polygonize([lines]))
    return polygon[shapely.area(polygon) > MIN_FACE_AREA]


def _holding(faces: Geometries, areas: Geometries) -> Mask:
    """Mask (f, n) of the areas in which a point of each face lies."""
    shapely.prepare(areas)
    spots = shapely.get_coordinates(shapely.point_on_surface(faces))
    inside = np.zeros((len(faces), len(areas)), dtype=bool)
    for column, area in zip(inside.T, areas, strict=True):  # many times as quick as a tree where most overlap
        column[:] = shapely.contains_xy(area, spots)
    return inside


def undominated(inside: Mask) -> Mask:
    """Mask of the rows (f, n), all different, that are no subset of another row."""
    size = inside.sum(axis=1)
    order = np.argsort(-size, kind="stable")
    best, kept = np.zeros(len(inside), dtype=bool), np.empty((0, inside.shape[1]), dtype=np.float32)
    for some in np.split(order, range(COVERAGE.faces_at_once, len(order), COVERAGE.faces_at_once)):
        rows = inside[some].astype(np.float32)
        left = ~(rows @ kept.T == size[some, None]).any(axis=1)
        rows, some = rows[left], some[left]
        part = rows @ rows.T == size[some, None]
        np.fill_diagonal(part, val=False)
        top = ~part.any(axis=1)
        best[some[top]], kept = True, np.vstack([kept, rows[top]])
    return best


def least_cover(inside: Mask, nodes: int = COVERAGE.max_nodes) -> SetCover:
    """Fewest faces such that every area holds one of them.

    Parameters
    ----------
    inside : (f, n) array of bool
        Every area must hold some face.
    nodes : int
        Of branch and bound, which has no limit in time: the same input gives the same answer.

    Returns
    -------
    SetCover
        The greedy one where branch and bound ends without a better one.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp  # takes long to load

    greedy = _greedy(inside)
    incidence = csr_array(inside.T.astype(np.float64))
    ones = np.ones(len(inside))
    covered = LinearConstraint(incidence, lb=1.0)
    relaxed = milp(ones, constraints=covered, bounds=Bounds(0, 1))
    lower = int(np.ceil(float(relaxed.fun or 0.0) - 1e-6))
    chosen = greedy
    if len(greedy) > lower:
        found = milp(
            ones,
            constraints=covered,
            bounds=Bounds(0, 1),
            integrality=np.ones(len(inside), dtype=np.int64),
            options={"node_limit": nodes, "mip_rel_gap": 0.0},
        )
        if found.mip_dual_bound is not None and np.isfinite(found.mip_dual_bound):
            lower = max(lower, int(np.ceil(found.mip_dual_bound - 1e-6)))
        if found.x is not None:
            exact = np.flatnonzero(found.x > 0.5).tolist()
            chosen = min(greedy, exact, key=len)
    return SetCover(tuple(sorted(chosen)), lower, _independent(inside))


def cover_prices(inside: Mask) -> Array:
    """Prices (n,) of areas by the linear relaxation of their least cover; 0 of those that no face hits.

    No face of those known hits areas for more than 1 in all; one that did would make the relaxation less.
    """
    from scipy.optimize import linprog  # takes long to load

    prices, hit = np.zeros(inside.shape[1]), inside.any(axis=0)
    if hit.any():
        incidence = csr_array(inside[:, hit].T.astype(np.float64))
        solved = linprog(np.ones(len(inside)), A_ub=-incidence, b_ub=-np.ones(int(hit.sum())), bounds=(0, 1))
        prices[hit] = -solved.ineqlin.marginals
    return prices


def stride(count: int) -> int:
    """Return every how many of so many areas are laid over each other at first."""
    return -(-count // COVERAGE.max_overlaid)


def least_cover_by_faces(parts: Sequence[Geometries]) -> tuple[Index, OverlayFaces, SetCover]:
    """Faces of the overlays of areas, the overlay that each is of, and the least cover of all areas by them.

    Of many areas only some are laid over each other, as long as the faces that come of it hit all by no more
    than these some need. Else all are, of up to twice as many.

    Parameters
    ----------
    parts : sequence of (n,) arrays of geometry
        Each has a part of every area, which a face of its own overlay may hit.
    """
    count = len(parts[0])
    step = stride(count)
    while True:
        some = np.arange(0, count, step)
        overlays = [overlay_faces(areas, some) for areas in parts]
        which = np.repeat(np.arange(len(parts)), [len(overlay.polygon) for overlay in overlays])
        faces = OverlayFaces(
            np.concatenate([overlay.polygon for overlay in overlays]),
            np.concatenate([overlay.inside for overlay in overlays]),
        )
        bound = least_cover(faces.inside[:, some])
        bound = replace(bound, apart=tuple(some[list(bound.apart)].tolist()))
        if step == 1:
            return which, faces, bound
        if faces.inside.any(axis=0).all():
            cover = least_cover(faces.inside)
            if len(cover.chosen) <= bound.lower or step > 2:
                return which, faces, replace(bound, chosen=cover.chosen)
        step = (step + 1) // 2


def _greedy(inside: Mask) -> list[int]:
    """Greedy cover: the face that hits most areas not yet hit, again and again (Chvatal 1979)."""
    left = np.ones(inside.shape[1], dtype=bool)
    chosen = []
    while left.any():
        best = int(np.argmax(inside[:, left].sum(axis=1)))
        chosen.append(best)
        left &= ~inside[best]
    return chosen


def _independent(inside: Mask) -> tuple[int, ...]:
    """A greedy set of areas of which no two share a face."""
    numbers = inside.astype(np.float32)
    return _apart((numbers.T @ numbers) > 0)


def apart_areas(areas: Geometries) -> tuple[int, ...]:
    """Return a greedy set of areas (n,), none empty, of which no two meet."""
    near = np.eye(len(areas), dtype=bool)
    near[tuple(shapely.STRtree(areas).query(areas, predicate="intersects"))] = True
    return _apart(near)


def _apart(near: Mask) -> tuple[int, ...]:
    """A greedy set of areas of which no two are near (n, n), those that are near to fewest first."""
    left = np.ones(len(near), dtype=bool)
    apart = []
    for k in np.argsort(near.sum(axis=1), kind="stable").tolist():
        if left[k]:
            left &= ~near[k]
            apart.append(k)
    return tuple(apart)


@dataclass(frozen=True, eq=False)
class Run:
    """Steps that can all be done from one point."""

    # first, last: steps, both included
    first: int
    last: int
    # by option of the last step the points from which it ends a chain of linked options
    ends: dict[int, BaseGeometry]


def fewest_runs(options: Geometries, offsets: Index, back: Sequence[Sequence[int]]) -> list[Run]:
    """Greedy runs, each as long as possible, from the first step on; no other cover has fewer.

    A point serves steps i to j where it lies in an option of each, each linked to the one before; it then
    serves every part of that run too. By induction the k-th greedy run ends no earlier than the k-th run of
    any other cover: that one begins no later, and the part of it from the beginning of the greedy run on is a
    run itself, so the greedy run goes at least as far.

    Parameters
    ----------
    options : (m,) array of geometry
        Areas of all steps, those of a step together, in the order of the steps.
    offsets : (n + 1,) array of int
        ``options[offsets[i]:offsets[i + 1]]`` are those of step i.
    back : sequence of sequences of int
        For each option those of the step before that it is linked to.

    Returns
    -------
    list of Run
        They end before a step that has no option at all.
    """
    found: list[Run] = []
    alive: dict[int, BaseGeometry] = {}
    for i in range(len(offsets) - 1):
        span = range(int(offsets[i]), int(offsets[i + 1]))
        ahead = _onward(options, span, back, alive) if alive else {}
        if ahead:
            found[-1] = Run(found[-1].first, i, ahead)
        else:
            ahead = {k: options[k] for k in span if options[k].area > MIN_FACE_AREA}
            if not ahead:
                break
            found.append(Run(i, i, ahead))
        alive = ahead
    return found


def _onward(
    options: Geometries, span: range, back: Sequence[Sequence[int]], alive: dict[int, BaseGeometry]
) -> dict[int, BaseGeometry]:
    """Points from which the run goes on, by option of the next step."""
    ahead: dict[int, BaseGeometry] = {}
    for k in span:
        before = [alive[m] for m in back[k] if m in alive]
        if not before:
            continue
        points = before[0] if len(before) == 1 else shapely.union_all(before)
        shared = _polygons(points & options[k])
        if shared.area > MIN_FACE_AREA:
            ahead[k] = shared
    return ahead


def _polygons(shape: BaseGeometry) -> BaseGeometry:
    """Polygons of a geometry."""
    if shapely.get_type_id(shape) in (3, 6):
        return shape
    parts = shapely.get_parts(shape)
    return shapely.multipolygons([part for part in parts if shapely.get_type_id(part) == 3])
