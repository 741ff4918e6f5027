"""Point and segment queries on flat polygons, against shapely and against geometry known by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from numba import njit
from shapely import box
from shapely.geometry import LineString, MultiPolygon, Point, Polygon

from regionik.planners.geometry.polygons import (
    FlatPolygon,
    clamp,
    contains,
    nearest_on_boundary,
    segment_in_either,
    segment_inside,
)
from regionik.planners.kernels import compiled
from tests.maths import Array


def random_area(seed: int) -> Polygon | MultiPolygon:
    """A room with boxes and discs taken out; holes, bays and several parts."""
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0, 10, (25, 2)), rng.uniform(0.1, 1.2, (25, 2))
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0])
    solids = np.where(rng.random(25) < 0.5, boxes, discs)
    free: Polygon | MultiPolygon = box(0, 0, 10, 10) - shapely.union_all(solids)
    return free


def sees(flat: FlatPolygon, a: Array | tuple[float, float], b: Array | tuple[float, float]) -> bool:
    return bool(segment_inside(flat.vertices, flat.starts, a[0], a[1], b[0], b[1]))


@pytest.mark.parametrize("seed", range(2))
def test_points_agree_with_shapely(seed: int) -> None:
    area = random_area(seed)
    flat = FlatPolygon.from_shapely(area)
    points = np.random.default_rng(seed).uniform(-1, 11, (3_000, 2))
    inside = np.array([contains(flat.vertices, flat.starts, *p) for p in points])
    near = np.array([nearest_on_boundary(flat.vertices, flat.starts, *p) for p in points])
    held = np.array([clamp(flat.vertices, flat.starts, *p) for p in points])
    assert 0.2 < inside.mean() < 0.8
    np.testing.assert_array_equal(inside, shapely.contains_xy(area, *points.T))
    gaps = shapely.distance(area.boundary, shapely.points(points))
    np.testing.assert_allclose(np.hypot(*(near - points).T), gaps, atol=1e-12)
    np.testing.assert_array_equal(held, np.where(inside[:, None], points, near))


@pytest.mark.parametrize("seed", range(2))
def test_nearest_points_are_inside_and_clamp_keeps_them(seed: int) -> None:
    flat = FlatPolygon.from_shapely(random_area(seed))
    for p in np.random.default_rng(seed).uniform(-1, 11, (2000, 2)):
        spot = clamp(flat.vertices, flat.starts, *p)
        assert contains(flat.vertices, flat.starts, *spot)
        assert clamp(flat.vertices, flat.starts, *spot) == spot


@pytest.mark.parametrize("seed", range(2))
def test_segments_agree_with_shapely_outside_the_tolerance_band(seed: int) -> None:
    area = random_area(seed)
    flat = FlatPolygon.from_shapely(area)
    rng = np.random.default_rng(seed + 100)
    a = rng.uniform(0, 10, (3_000, 2))
    b = a + rng.normal(0, 1, a.shape)
    # Half the ends are put on the boundary or on a vertex, where rounding decides.
    a[:700] = [nearest_on_boundary(flat.vertices, flat.starts, *p) for p in a[:700]]
    b[300:1000] = flat.vertices[rng.integers(len(flat.vertices), size=700)]
    seen = np.array([sees(flat, p, q) for p, q in zip(a, b, strict=True)])
    lines = shapely.linestrings(np.stack([a, b], axis=1))
    grown, shrunk = area.buffer(2e-9), area.buffer(-1e-8)
    shapely.prepare([grown, shrunk])
    assert 0.1 < seen.mean() < 0.9
    assert shapely.covers(grown, lines[seen]).all()
    assert not shapely.covers(shrunk, lines[~seen]).any()
    free_ends = slice(1000, None)
    np.testing.assert_array_equal(seen[free_ends], shapely.covers(area, lines[free_ends]))


@pytest.mark.parametrize("seed", range(3))
def test_a_segment_in_two_polygons_together_lies_in_their_union(seed: int) -> None:
    rng, seen = np.random.default_rng(seed), {True: 0, False: 0}
    for _ in range(150):
        spots, sizes = rng.uniform(-0.7, 0.7, (2, 2)), rng.uniform(0.6, 1.2, 2)
        one, other = (Point(p).buffer(r) - Point(p).buffer(0.3) for p, r in zip(spots, sizes, strict=True))
        a, b = rng.uniform(-1, 1, (2, 2))
        whole, line = one | other, LineString([a, b])
        inside, beside = (line.intersection(whole.buffer(by)).length for by in (-1e-6, 1e-6))
        if beside - inside > 1e-3:
            continue
        p, q = (FlatPolygon.from_shapely(part) for part in (one, other))
        found = segment_in_either(p.vertices, p.starts, q.vertices, q.starts, *a, *b)
        assert found == whole.buffer(1e-9).covers(line)
        seen[bool(found)] += 1
    assert min(seen.values()) > 10


def test_a_thin_wall_is_a_wall() -> None:
    flat = FlatPolygon.from_shapely(box(0, 0, 2, 2) - box(1, 0.5, 1 + 1e-10, 1.5))
    assert not sees(flat, (0.5, 1.0), (1.5, 1.0))
    assert sees(flat, (0.5, 0.4), (1.5, 0.4))


@compiled
def _sum_of_product(x: float, y: float, z: float) -> float:
    return x * y + z


@njit(fastmath={"contract"})
def _asked_for_it(x: float, y: float, z: float) -> float:
    return _sum_of_product(x, y, z)


def test_a_kernel_rounds_alike_whoever_calls_it_first() -> None:
    """The rest that a product has beyond 53 bits is not kept, though the caller may keep it."""
    x = 1.0 + 2.0**-30
    assert _asked_for_it(x, x, -1.0 - 2.0**-29) == 0.0
    assert _sum_of_product(x, x, -1.0 - 2.0**-29) == 0.0
