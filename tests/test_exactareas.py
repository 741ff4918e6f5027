"""Areas bounded by arcs, against polygons within them and around them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import ground_of
from regionik.areas.sectors import ARC_POINTS, ring_sectors
from regionik.areas.standing import by_heading
from regionik.exactareas import exact_areas
from regionik.planners.geometry.cells import cells_of, within
from regionik.planners.geometry.ringarcs import Outline, Sectors, holds, measures, nearest_place, outlines
from regionik.postures.families import FRONT
from regionik.regions import path_areas
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError

FINE = 1024  # vertices of a circle


def floor_of(seed: int) -> BaseGeometry:
    """A floor with holes, in parts, some of its edges along the lines of a grid."""
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0, 6, (14, 2)), rng.uniform(0.05, 0.6, (14, 2))
    boxes = shapely.box(*(centres - sizes).round(1).T, *(centres + sizes).round(1).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0])
    wall = shapely.box(2.9, -1, 3.1, 7)
    taken = [*np.where(rng.random(14) < 0.5, boxes, discs), *([wall] if seed % 2 else [])]
    return shapely.box(0, 0, 6, 6) - shapely.union_all(taken)


def sectors_of(seed: int, count: int) -> Sectors:
    """Rings and ring sectors; some without a hole, some centred on corners of the grid."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 1, count) * (rng.random(count) < 0.7)
    center = rng.uniform(-0.5, 6.5, (count, 2))
    center[::5] = center[::5].round(1)
    half = np.where(rng.random(count) < 0.5, np.pi, rng.uniform(0.05, np.pi, count))
    return Sectors(center, low, low + rng.uniform(0.02, 1, count), rng.uniform(-7, 7, count), half)


def bounds(floor: BaseGeometry, rings: Sectors) -> tuple[np.ndarray, np.ndarray]:
    """Polygons within rings, and around them, cut to a floor."""
    real = rings.low / np.cos(np.pi / FINE) < rings.high
    assert real.all()
    inner, outer = (ring_sectors(*rings, margin, FINE) for margin in (0.0, None))
    return shapely.intersection(inner, floor), shapely.intersection(outer, floor)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [0.1, 0.2, 5.0])
def test_cells_tell_inside_from_outside(seed: int, size: float) -> None:
    floor = floor_of(seed)
    cells = cells_of(floor, size)
    points = np.random.default_rng(seed).uniform(-1, 7, (4000, 2))
    found = np.array([within(cells, x, y) for x, y in points.tolist()])
    np.testing.assert_array_equal(found, shapely.contains_xy(floor, points))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_measures_lie_between_those_of_polygons(seed: int) -> None:
    floor, rings = floor_of(seed), sectors_of(seed, 60)
    found = measures(outlines(cells_of(floor, 0.2), rings), rings.center)
    inner, outer = bounds(floor, rings)
    assert (found >= shapely.area(inner) - 1e-9).all()
    assert (found <= shapely.area(outer) + 1e-9).all()


@pytest.mark.parametrize("seed", range(4))
def test_nearest_places_and_held_ones_are_those_of_polygons(seed: int) -> None:
    floor, rings = floor_of(seed), sectors_of(seed, 60)
    cells = cells_of(floor, 0.2)
    outline = outlines(cells, rings)
    inner, outer = bounds(floor, rings)
    points = np.random.default_rng(seed).uniform(-1, 7, (40, 2))
    for i in range(60):
        if inner[i].is_empty:
            continue
        for x, y in points.tolist():
            held = holds(cells, rings, i, x, y)
            assert not shapely.contains_xy(inner[i], x, y) or held
            assert not held or outer[i].distance(shapely.Point(x, y)) < 1e-9
            px, py = nearest_place(cells, rings, outline, i, x, y)
            far = float(np.hypot(px - x, py - y))
            assert outer[i].distance(shapely.Point(x, y)) - 1e-9 <= far
            assert far <= inner[i].distance(shapely.Point(x, y)) + 1e-9


def test_what_bounds_an_area_goes_round_it() -> None:
    floor, rings = floor_of(1), sectors_of(3, 80)
    outline = outlines(cells_of(floor, 0.2), rings)
    for i in range(80):
        ends = [_ends(piece, rings.center[i]) for piece in outline.pieces[slice(*outline.first[i : i + 2])]]
        for place in (end for pair in ends for end in pair):
            begun = sum(np.hypot(*(place - a)) < 1e-7 for a, _ in ends)
            assert begun == sum(np.hypot(*(place - b)) < 1e-7 for _, b in ends)


def _ends(piece: np.ndarray, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a piece begins and ends, passed with the area to its left."""
    if piece[4] == 0.0:
        return piece[:2], piece[2:4]
    angles = piece[:2] if piece[4] > 0 else piece[1::-1]
    ends = center + abs(piece[4]) * np.column_stack([np.cos(angles), np.sin(angles)])
    return ends[0], ends[1]


def test_no_floor_has_no_areas() -> None:
    rings = sectors_of(0, 5)
    assert not measures(outlines(cells_of(Polygon(), 0.2), rings), rings.center).any()


@pytest.mark.parametrize("name", ["free", "pillar", "l_shape"])
def test_areas_of_worlds_hold_their_polygons(name: str) -> None:
    world = load_world(name)
    exact, polygons = exact_areas(world, facings=(FRONT,)), path_areas(world, facings=(FRONT,))
    np.testing.assert_array_equal(exact.target, polygons.target)
    assert (exact.measure >= shapely.area(polygons.inner) - 1e-9).all()
    rings = ring_sectors(*exact.rings, None, ARC_POINTS)
    around = ground_of(world).inner.subtract(rings)
    assert (exact.measure <= shapely.area(around) + 1e-9).all()
    for row, area in enumerate(polygons.inner):
        if area.is_empty:
            continue
        spot = area.representative_point()
        assert exact.holds(row, [spot.x, spot.y])
        near = exact.nearest(row, [0.0, 0.0])
        assert near is not None
        assert np.hypot(*near) <= area.distance(shapely.Point(0, 0)) + 1e-9


def test_areas_of_one_slab_of_headings() -> None:
    world = load_world("pillar")
    side = by_heading(world).sides[0]
    exact = exact_areas(world, side=side)
    assert len(exact.measure) == len(exact.target) == len(exact.family)
    assert isinstance(exact.outline, Outline)


def test_other_arms_are_refused() -> None:
    world = load_world("free")
    with pytest.raises(InputError, match="one vertical plane"):
        exact_areas(replace(world, robot=robot_named("pioneer7")))
