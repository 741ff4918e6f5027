import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from regionik.planners.reach.floor_distances import inside, is_near, parts_of

FLOOR = [
    Polygon([(0, 0), (4, 0), (4, 3), (0, 3)], [[(1, 1), (2, 1), (2, 2), (1, 2)]]),
    Polygon([(5, 0), (6, 0), (5.5, 3)]),
    shapely.Point(5, 5).buffer(0.7),
]
PARTS = parts_of(FLOOR)
SPOT = st.tuples(st.floats(-1, 7), st.floats(-1, 7))


@given(SPOT)
def test_inside_is_that_of_the_polygons(spot: tuple[float, float]) -> None:
    point, floor = shapely.Point(spot), shapely.MultiPolygon(FLOOR)
    if floor.boundary.distance(point) > 1e-9:
        assert inside(PARTS, *spot) == floor.contains(point)


@given(SPOT, st.floats(0.01, 10))
def test_what_is_near_is_near_the_polygons(spot: tuple[float, float], by: float) -> None:
    away = shapely.MultiPolygon(FLOOR).distance(shapely.Point(spot))
    if np.abs(away - by) > 1e-9:
        assert is_near(PARTS, *spot, by) == (away < by)
