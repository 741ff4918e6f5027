"""Footprints: areas by heading between truth's bounds, motions proven free, corridors passed or refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import affinity, box
from shapely.geometry import LineString, MultiPolygon, Point, Polygon

from regionik.planners.driving.footprint import arc_is_free, fits, slide_is_free
from regionik.planners.driving.footprint_planner import (
    FootprintFloor,
    FootprintPath,
    NarrowPassageError,
    passage_width,
)
from regionik.planners.driving.footprint_scene import footprint_scene, footprint_width
from regionik.planners.driving.heading_slabs import (
    convex_scene,
    free_at_all,
    free_at_some,
    rotation_core,
    rotation_hull,
    slab_areas,
)
from regionik.planners.driving.point_planner import NoPathError
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Floor, Target, World
from regionik.worlds.shadows import Shadow
from tests.maths import Array, arc_end, wrap
from tests.witnesses import witness

YOUBOT = np.array([[0.29, -0.19], [0.29, 0.19], [-0.29, 0.19], [-0.29, -0.19]])
OFFSET = np.array([[0.4, -0.19], [0.4, 0.19], [-0.18, 0.19], [-0.18, -0.19]])
AWAY = np.array([[0.9, -0.19], [0.9, 0.19], [0.3, 0.0]])  # does not hold its own origin
POINT = np.array([[0.1, 0.2]])
FOOTPRINTS = [YOUBOT, OFFSET, AWAY, POINT, np.zeros((1, 2))]

FLOOR = box(0, 0, 7, 6) - box(3, 0, 3.2, 2.5) - box(5, 5, 5.05, 5.05)
OBSTACLES = (
    Shadow(box(2, 2, 2.5, 3)),
    Shadow(Point(4, 4), 0.3),
    Shadow(Polygon([(5, 1), (6, 1.2), (5.5, 2)])),
    Shadow(LineString([(1, 4), (1.6, 4.4), (2, 4)]), 0.02),
    Shadow(box(0.5, 5.2, 0.9, 5.6) - box(0.6, 5.3, 0.8, 5.5)),
)


def placed(footprint: Array, pose: Sequence[float] | Array) -> shapely.Geometry:
    shape = Point(footprint[0]) if len(footprint) == 1 else Polygon(footprint)
    turned = affinity.rotate(shape, pose[2], origin=(0, 0), use_radians=True)
    return affinity.translate(turned, pose[0], pose[1])


def slack(footprint: Array, pose: Sequence[float] | Array, clearance: float) -> float:
    """How much farther the footprint stays from things than it must; negative where it does not."""
    body = placed(footprint, pose)
    inside = FLOOR.boundary.distance(body) if FLOOR.contains(body) else -1.0
    return float(min([inside, *(s.core.distance(body) - s.radius - clearance for s in OBSTACLES)]))


def corridor(width: float, angle: float = 0.0) -> Polygon | MultiPolygon:
    """Two rooms of 2 m, joined by a corridor of 2 m."""
    rooms = box(0, 0, 2, 2) | box(1.9, 1 - width / 2, 4, 1 + width / 2) | box(3.9, 0, 6, 2)
    turned: Polygon | MultiPolygon = affinity.rotate(rooms, angle, origin=(0, 0), use_radians=True)
    return turned


def turned(pose: Sequence[float] | Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * pose[0] - s * pose[1], s * pose[0] + c * pose[1], pose[2] + angle])


def holds(
    answer: FootprintPath, footprint: Array, floor: shapely.Geometry, start: Array, goal: Array
) -> None:
    """Ends, and by shapely every 5 mm: the footprint inside the floor."""
    np.testing.assert_allclose(answer.poses[[0, -1]], [start, goal], atol=1e-9)
    reach = float(np.hypot(*footprint.T).max())
    for p, q in zip(answer.poses[:-1], answer.poses[1:], strict=True):
        change = np.array([*(q - p)[:2], wrap(q[2] - p[2])])
        count = int((np.hypot(*change[:2]) + reach * abs(change[2])) / 0.005) + 2
        for share in np.linspace(0, 1, count):
            assert floor.covers(placed(footprint, p + share * change))


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize(("low", "high"), [(0.7, 0.7), (-0.3, 0.1), (0.0, 2 * np.pi)])
def test_inner_in_truth_in_outer(footprint: Array, low: float, high: float) -> None:
    clearance = 0.05
    (slab,) = slab_areas(footprint, FLOOR, OBSTACLES, clearance, [[low, high]])
    assert slab.inner.difference(slab.outer.buffer(1e-8)).is_empty
    room = footprint_scene(footprint, FLOOR, OBSTACLES, clearance)
    spots = np.random.default_rng(4).uniform((-1, -1), (8, 7), (150, 2))
    # Where areas end is where errors show.
    rings = shapely.get_coordinates([slab.inner, slab.outer])
    edge = rings[:: max(1, len(rings) // 100)]
    spots = np.concatenate([spots, edge + 1e-4, edge - 1e-4])
    in_inner = shapely.contains_xy(slab.inner, *spots.T)
    in_outer = shapely.contains_xy(slab.outer.buffer(1e-9), *spots.T)
    for spot, sure, maybe in zip(spots, in_inner, in_outer, strict=True):
        free = [fits(room, spot[0], spot[1], yaw) for yaw in np.linspace(low, high, 7)]
        assert all(free) or not sure
        assert maybe or not any(free)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize(("low", "high"), [(0.1, 0.2), (1.0, 3.0)])
def test_a_window_shows_a_part_of_the_same_areas(footprint: Array, low: float, high: float) -> None:
    window = shapely.Point(2.0, 2.0).buffer(1.5)
    (whole,) = slab_areas(footprint, FLOOR, OBSTACLES, 0.05, [[low, high]])
    part = convex_scene(footprint, FLOOR, OBSTACLES, 0.05, window=window)
    assert free_at_all(part, low, high).symmetric_difference(whole.inner & window).area < 1e-9
    assert free_at_some(part, low, high).symmetric_difference(whole.outer & window).area < 1e-9


@pytest.mark.filterwarnings("ignore:.*encountered in buffer:RuntimeWarning")
def test_where_edges_nearly_meet_floors_stay_valid_as_they_are_moved() -> None:
    """A random world whose floor, less what stands on it, crossed itself by rounding."""
    sides = scene_of(witness("wrists", 160275).world).free_floor.by_heading.sides
    assert shapely.is_valid([side.floor for side in sides]).all()


@pytest.mark.parametrize("footprint", [YOUBOT, OFFSET])
def test_the_gap_between_inner_and_outer_falls_with_the_slab(footprint: Array) -> None:
    bounds = [[0.4 - w, 0.4 + w] for w in (0.1, 0.05, 0.025, 0.0)]
    areas = slab_areas(footprint, FLOOR, OBSTACLES, 0.05, bounds)
    gaps = [slab.outer.area - slab.inner.area for slab in areas]
    assert gaps[3] < 0.01
    assert gaps[1] < 0.6 * gaps[0]
    assert gaps[2] < 0.6 * gaps[1]


@pytest.mark.parametrize("footprint", [YOUBOT, OFFSET, AWAY])
def test_shapes_round_and_inside_all_rotations(footprint: Array) -> None:
    low, high = -0.2, 0.25
    outer = Polygon(rotation_hull(footprint, low, high))
    corners = rotation_core(footprint, low, high)
    inner = Polygon(corners) if len(corners) else Polygon()
    for yaw in np.linspace(low, high, 40):
        body = placed(footprint, (0, 0, yaw))
        assert outer.contains(body)
        assert body.buffer(1e-12).contains(inner) or inner.is_empty
    swept = shapely.union_all([placed(footprint, (0, 0, yaw)) for yaw in np.linspace(low, high, 400)])
    assert outer.area < swept.convex_hull.area * 1.01
    assert inner.is_empty == (footprint is AWAY)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_fits_is_what_shapely_says(footprint: Array) -> None:
    rng = np.random.default_rng(1)
    room = footprint_scene(footprint, FLOOR, OBSTACLES, 0.05)
    seen = set()
    for _ in range(250):
        pose = rng.uniform((0, 0, -7), (7, 6, 7))
        gap = slack(footprint, pose, 0.05)
        if abs(gap) > 1e-9:
            assert fits(room, *pose) == (gap > 0)
            seen.add(gap > 0)
    assert seen == {True, False}


def test_a_footprint_round_a_hole_or_a_small_thing_does_not_fit() -> None:
    assert not fits(footprint_scene(YOUBOT, FLOOR), 5.02, 5.02, 0.3)
    assert fits(footprint_scene(YOUBOT, box(0, 0, 7, 6)), 5.02, 5.02, 0.3)
    assert not fits(
        footprint_scene(YOUBOT, box(0, 0, 7, 6), [Shadow(box(5, 5, 5.05, 5.05))]), 5.02, 5.02, 0.3
    )
    assert not fits(footprint_scene(YOUBOT, box(0, 0, 7, 6), [Shadow(box(1, 1, 6, 5))]), 4, 3, 0.3)
    assert not fits(footprint_scene(YOUBOT, box(0, 0, 7, 6), [Shadow(Point(5, 5))]), 5.02, 5.02, 0.3)


def path_of(kind: str, rng: np.random.Generator, pose: Array) -> tuple[Array, float, float]:
    """End or nothing, length and turn of a random motion of a kind."""
    length, turn = rng.normal() * 1.5, rng.normal() * 1.5
    if kind == "line":
        return pose, length, 0.0
    return (pose, 0.0, turn) if kind == "spot" else (pose, length, turn)


@pytest.mark.parametrize("kind", ["line", "arc", "spot", "slide"])
@pytest.mark.parametrize("footprint", [YOUBOT, AWAY, POINT])
def test_proven_motions_are_free(kind: str, footprint: Array) -> None:
    """By 80 poses a motion; and hardly any that has a centimetre to spare is refused."""
    rng = np.random.default_rng(7)
    room = footprint_scene(footprint, FLOOR, OBSTACLES, 0.05)
    free = easy = missed = 0
    while easy < 40:
        start, change = rng.uniform((0, 0, -4), (7, 6, 4)), rng.normal(size=3)
        _, length, turn = path_of(kind, rng, start)
        goal = start + change
        shares = np.linspace(0, 1, 80)
        if kind == "slide":
            proven = slide_is_free(room, start, goal)
            poses = [start + s * np.array([*change[:2], wrap(change[2])]) for s in shares]
        else:
            proven = arc_is_free(room, start, length, turn)
            x, y, yaw = start
            poses = [np.array(arc_end(x, y, yaw, s * length, s * turn)) for s in shares]
        if not (proven or slack(footprint, poses[0], 0.05) > 0):
            continue
        least = min(slack(footprint, pose, 0.05) for pose in poses)
        assert least > -1e-9 or not proven
        free += proven
        # Between two samples no point of the footprint comes nearer by more than half its way.
        between = max(
            np.hypot(*(p - q)[:2]) + abs(p[2] - q[2]) for p, q in zip(poses, poses[1:], strict=False)
        )
        if least > 0.01 + between:
            easy += 1
            missed += not proven
    assert missed == 0
    assert free >= easy


def test_a_hair_of_room_is_enough() -> None:
    """A turn in a round pit 1 micrometre wider than the footprint needs, and in one 1 micrometre narrower."""
    reach = float(np.hypot(*YOUBOT[0]))
    for spare, passes in ((1e-6, True), (-1e-6, False)):
        pit = Point(0, 0).buffer((reach + spare) / np.cos(np.pi / 800), quad_segs=200)
        room = footprint_scene(YOUBOT, pit)
        assert arc_is_free(room, np.zeros(3), 0.0, 2 * np.pi) is passes
    lane = footprint_scene(YOUBOT, box(-1, -0.19 - 1e-7, 5, 0.19 + 1e-7))
    assert slide_is_free(lane, np.zeros(3), np.array([4.0, 0, 0]))
    assert arc_is_free(lane, np.zeros(3), 4.0, 0.0)
    assert not arc_is_free(lane, np.zeros(3), 4.0, 1e-4)


@pytest.mark.parametrize("angle", [0.0, 0.37])
@pytest.mark.parametrize("width", [0.6, 0.5, 0.44, 0.385])
def test_a_long_base_passes_a_corridor_lengthwise(width: float, angle: float) -> None:
    floor = corridor(width, angle)
    start, goal = turned((0.5, 1, 1.57), angle), turned((5.5, 1, 0), angle)
    answer = FootprintFloor(YOUBOT, floor).drive(start, goal, seed=0)
    holds(answer, YOUBOT, floor, start, goal)
    # Its circumscribed circle would not: 0.69 m.
    assert floor.buffer(-float(np.hypot(*YOUBOT[0]))).geom_type == "MultiPolygon"


@pytest.mark.parametrize("width", [0.36, 0.379])
def test_a_corridor_that_is_too_narrow_is_refused_with_numbers(width: float) -> None:
    with pytest.raises(NarrowPassageError) as refused:
        FootprintFloor(YOUBOT, corridor(width)).drive([0.5, 1, 1.57], [5.5, 1, 0], seed=0)
    assert str(refused.value) == (
        "no way from (0.500, 1.000, 1.570 rad) to (5.500, 1.000, 0.000 rad): "
        f"its narrowest place is {width:.3f} m wide, the footprint nowhere less than 0.380 m"
    )
    assert refused.value.passage == pytest.approx(width, abs=1e-4)
    assert refused.value.across == pytest.approx(0.38, abs=1e-12)


def test_areas_of_a_round_outline_have_no_more_headings_for_its_many_sides() -> None:
    """Each side along each wall would make slabs five times as many, for a hundredth of the width."""
    room, turns = box(0, 0, 4, 3), 2 * np.pi * np.arange(24) / 24
    counts = []
    for outline in (np.column_stack([0.3 * np.cos(turns), 0.25 * np.sin(turns)]), YOUBOT):
        robot = replace(robot_named("youbot"), footprint=outline)
        world = World("room", robot, Floor(room), (), (Target(np.array([2.0, 1.5, 0.3])),))
        counts.append(len(scene_of(world).free_floor.by_heading.sides))
    assert counts == [24, 32]  # four headings have a side of the rectangle along a wall


def test_obstacles_and_clearance_narrow_a_corridor() -> None:
    hall, posts = box(0, 0, 4, 2), [Shadow(Point(2, 0.4), 0.4), Shadow(Point(2, 1.7), 0.3)]
    start, goal = np.array([0.5, 1.0, 0.0]), np.array([3.5, 1.0, 1.0])
    assert FootprintFloor(YOUBOT, hall, posts, 0.1).drive(start, goal, seed=0).poses.shape[1] == 3
    with pytest.raises(NarrowPassageError, match=r"^no way from .* narrowest place is 0.360 m wide"):
        FootprintFloor(YOUBOT, hall, posts, 0.12).drive(start, goal, seed=0)


def test_a_long_base_does_not_get_round_a_tight_bend_but_a_square_one_does() -> None:
    bend = box(0, 0, 0.45, 3) | box(0, 2.55, 3, 3)
    start, goal = np.array([0.225, 0.8, np.pi / 2]), np.array([2.2, 2.775, 0.0])
    long = np.array([[0.6, -0.19], [0.6, 0.19], [-0.6, 0.19], [-0.6, -0.19]])
    with pytest.raises(NarrowPassageError, match="too long for the bends on the way") as refused:
        FootprintFloor(long, bend).drive(start, goal, seed=0)
    assert refused.value.passage == pytest.approx(0.45, abs=1e-3)
    square = np.array([[0.19, -0.19], [0.19, 0.19], [-0.19, 0.19], [-0.19, -0.19]])
    holds(FootprintFloor(square, bend).drive(start, goal, seed=0), square, bend, start, goal)


def test_same_seed_same_drive() -> None:
    runs = [
        FootprintFloor(YOUBOT, corridor(0.5)).drive([0.5, 1, 1.57], [5.5, 1, 0], seed=s) for s in (3, 4, 3)
    ]
    assert np.array_equal(runs[0].poses, runs[2].poses)
    assert not np.array_equal(runs[0].poses, runs[1].poses)


def test_easy_drives() -> None:
    room = box(0, 0, 3, 3)
    straight = FootprintFloor(YOUBOT, room).drive([1, 1, 0], [2, 2, 3], seed=0)
    assert (straight.method, len(straight.poses)) == ("straight", 2)
    assert FootprintFloor(YOUBOT, room).drive([1, 1, 0], [1, 1, 0], seed=0).poses.tolist() == [[1, 1, 0]]


def test_a_point_drives_like_a_shape() -> None:
    answer = FootprintFloor([[0, 0]], corridor(0.01)).drive([0.5, 1.8, 1.57], [5.5, 0.2, 0], seed=0)
    for p, q in zip(answer.poses[:-1], answer.poses[1:], strict=True):
        assert corridor(0.01).covers(LineString([p[:2], q[:2]]))


def test_widths() -> None:
    triangle = [[0, 0], [1, 0], [0.5, np.sqrt(0.75)]]
    assert footprint_width(triangle) == pytest.approx(np.sqrt(0.75))
    assert footprint_width(YOUBOT) == pytest.approx(0.38)
    assert footprint_width([[1, 1]]) == 0.0
    apart = MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    assert passage_width(apart, Point(0.5, 0.5), Point(2.5, 0.5)) < 1e-6


def test_bad_drives() -> None:
    with pytest.raises(NoPathError, match=r"start \(0.100, 1.000, 0.000 rad\): the footprint does not fit"):
        FootprintFloor(YOUBOT, box(0, 0, 3, 3)).drive([0.1, 1, 0], [2, 2, 0], seed=0)
    with pytest.raises(InputError, match="seed: expected a whole number from 0 up"):
        FootprintFloor(YOUBOT, box(0, 0, 3, 3)).drive([1, 1, 0], [2, 2, 0], seed=-1)
    with pytest.raises(InputError, match="goal: expected 3 numbers"):
        FootprintFloor(YOUBOT, box(0, 0, 3, 3)).drive([1, 1, 0], [2, 2], seed=0)
