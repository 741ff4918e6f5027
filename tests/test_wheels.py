"""Ways on wheels: exact ends and curvature, inside the floor, as short as OMPL's, same seed same way."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from ompl import base as ob
from shapely import box
from shapely.geometry import MultiPolygon, Point, Polygon

from regionik.planners.driving.arcs import WheeledPath, path_of_motions
from regionik.planners.driving.footprint import arc_is_free
from regionik.planners.driving.footprint_scene import FootprintScene, footprint_scene
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.pose_planner import (
    SPIN,
    Steering,
    drive_wheeled,
    steer,
)
from regionik.planners.driving.reeds_shepp import words_between
from regionik.planners.geometry.shortest_paths import shortest_path
from regionik.worlds.errors import InputError
from regionik.worlds.shadows import Shadow
from tests import examples
from tests.maths import Array, arc_end, wrap

RADIUS = 0.7
MORE = [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, *range(2, 6)))]
SPOT = st.floats(-4, 4, allow_subnormal=False)
POSE = st.tuples(SPOT, SPOT, st.floats(-np.pi, np.pi, allow_subnormal=False)).map(np.array)
LONG = np.array([[0.4, -0.19], [0.4, 0.19], [-0.18, 0.19], [-0.18, -0.19]])  # axle near the tail


def point_in(free: Polygon | MultiPolygon) -> FootprintScene:
    """Scene of a footprint that is a single point."""
    return footprint_scene([[0.0, 0.0]], free)


def clutter(seed: int) -> Polygon:
    """Largest part of a floor of 10 m with 30 obstacles."""
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0, 10, (30, 2)), rng.uniform(0.2, 0.9, (30, 2))
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0], quad_segs=4)
    free = box(0, 0, 10, 10) - shapely.union_all(np.where(rng.random(30) < 0.5, boxes, discs))
    part: Polygon = max(shapely.get_parts(free), key=lambda p: p.area)
    return part


def two_poses(free: Polygon, seed: int) -> list[Array]:
    """Poses at least 4 m apart and 0.15 m from the edge."""
    rng, poses = np.random.default_rng(seed), list[Array]()
    while len(poses) < 2:
        p = np.array([*rng.uniform(0, 10, 2), rng.uniform(-np.pi, np.pi)])
        if free.buffer(-0.15).contains(Point(p[:2])) and all(np.hypot(*(p - q)[:2]) > 4 for q in poses):
            poses.append(p)
    return poses


def random_pairs(count: int, seed: int) -> list[tuple[Array, Array]]:
    """Pairs of poses, a fifth of them on a grid where words degenerate."""
    rng, pairs = np.random.default_rng(seed), []
    for k in range(count):
        far = (0.5, 2.0, 5.0, 20.0)[k % 4]
        ends = rng.uniform((-far, -far, -np.pi), (far, far, np.pi), (2, 3))
        if k % 5 == 0:
            ends[:, :2] = np.round(ends[:, :2] * 2 / RADIUS) * RADIUS / 2
            ends[:, 2] = np.round(ends[:, 2] * 4 / np.pi) * np.pi / 4
        pairs.append((ends[0], ends[1]))
    return pairs


def shortest_length(free: Polygon, start: Array, goal: Array) -> float:
    """Length of the shortest path of a point without headings."""
    points = shortest_path(free, start[:2], goal[:2])
    assert points is not None
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


@cache
def engine() -> ob.StateSpace:
    space = ob.ReedsSheppStateSpace(RADIUS)
    bounds = ob.RealVectorBounds(2)
    bounds.setLow(-100)
    bounds.setHigh(100)
    space.setBounds(bounds)
    return space


def engine_distance(a: Array, b: Array) -> float:
    space = engine()
    states = [space.allocState(), space.allocState()]
    for state, pose in zip(states, (a, b), strict=True):
        state.setXY(float(pose[0]), float(pose[1]))
        state.setYaw(float(wrap(pose[2])))
    return float(space.distance(*states))


def shortest(a: Array, b: Array) -> float:
    return float(words_between(a, b, RADIUS)[1][0])


def at_the_end(word: Array, start: Array) -> Array:
    x, y, yaw = start
    for length, turn in word:
        x, y, yaw = arc_end(x, y, yaw, length, turn)
    return np.array([x, y, yaw])


def off(a: Array, b: Array) -> float:
    """Largest difference of two poses, headings modulo a turn."""
    return float(max(*np.abs(a - b)[:2], abs(wrap(a[2] - b[2]))))


def holds(way: WheeledPath, free: Polygon | MultiPolygon, start: Array, goal: Array) -> None:
    """What every way in a polygon promises, looked at every 2 mm by shapely."""
    assert off(way.start, start) == 0
    assert off(way.end, goal) <= 1e-9
    poses = way.sample(0.002)
    np.testing.assert_allclose(poses[[0, -1]], [way.start, way.end], atol=1e-12)
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max(initial=0.0) <= 0.002 + 1e-9
    assert shapely.distance(free, shapely.points(poses[:, :2])).max() <= 2e-9
    chords = np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
    assert way.length * (1 - 1e-5) - 1e-9 <= chords <= way.length + 1e-9


def test_curves_are_as_short_as_those_of_ompl() -> None:
    for a, b in random_pairs(800, seed=1):
        words, lengths = words_between(a, b, RADIUS)
        assert lengths[0] == pytest.approx(engine_distance(a, b), abs=1e-9)
        assert (np.diff(lengths) >= 0).all()
        for word in words[:3]:
            assert off(at_the_end(word, a), b) <= 1e-9
            bent = word[word[:, 1] != 0]
            np.testing.assert_allclose(np.abs(bent[:, 0] / bent[:, 1]), RADIUS, rtol=1e-14)


@given(POSE, POSE)
@settings(max_examples=examples(200))
def test_reeds_shepp_is_symmetric(a: Array, b: Array) -> None:
    there, back = shortest(a, b), shortest(b, a)
    assert there == pytest.approx(back, abs=1e-9)
    assert np.hypot(*(b - a)[:2]) - 1e-9 <= there


@given(POSE, POSE, st.floats(-2, 2), st.floats(-6, 6))
@settings(max_examples=examples(100))
def test_curves_do_not_care_where_the_world_is(a: Array, b: Array, shift: float, turn: float) -> None:
    c, s = np.cos(turn), np.sin(turn)
    ends = [np.array([c * p[0] - s * p[1] + shift, s * p[0] + c * p[1] - shift, p[2] + turn]) for p in (a, b)]
    assert shortest(a, b) == pytest.approx(shortest(ends[0], ends[1]), rel=0, abs=1e-6)


def test_free_arcs_by_dense_sampling() -> None:
    """Against 400 points an arc: those that leave by more than the sampling can miss are refused."""
    free = clutter(3)
    scene = point_in(free)
    rng = np.random.default_rng(0)
    seen = {True: 0, False: 0}
    for _ in range(400):
        x, y, yaw = *rng.uniform(0, 10, 2), rng.uniform(-4, 4)
        length, turn = rng.normal() * 2, rng.choice([0.0, 1e-7, 1.0, 2.0]) * rng.uniform(-3, 3)
        points = np.array([arc_end(x, y, yaw, s * length, s * turn) for s in np.linspace(0, 1, 401)])[:, :2]
        outside = float(shapely.distance(free, shapely.points(points)).max())
        inside = bool(arc_is_free(scene, np.array([x, y, yaw]), length, turn))
        seen[inside] += 1
        if inside:
            assert outside <= 1e-9
        else:
            # Between two samples an arc can leave by no more than half their distance.
            edge = shapely.distance(
                free.exterior.union(shapely.union_all(free.interiors)), shapely.points(points)
            )
            assert outside > 0 or edge.min() <= abs(length) / 800 + 1e-9
    assert min(seen.values()) > 50


GAP = 2e-9  # above an eighth of a full circle's acceleration after 16 halvings, (2 pi)**2 / 8 / 4**16 [m]


@pytest.mark.parametrize(
    ("turn", "inside"), [(np.pi, True), (np.pi / 2, True), (2 * np.pi, True), (-np.pi, False)]
)
def test_arcs_come_near_but_do_not_touch(turn: float, inside: bool) -> None:
    """A circle in a square is free where every gap is 2 nm; what touches a side or leaves is not."""
    wide, backwards = point_in(box(-1 - GAP, -GAP, 1 + GAP, 2 + GAP)), np.array([0.0, 0.0, np.pi])
    assert arc_is_free(wide, np.zeros(3), abs(turn), turn) is inside
    assert arc_is_free(wide, backwards, -abs(turn), turn) is inside
    for low in (0.0, -GAP):  # the top, which half a circle comes to
        tight = point_in(box(-1 - GAP, -GAP, 1 + GAP, 2 + low))
        assert arc_is_free(tight, np.zeros(3), abs(turn), turn) is (inside and turn < np.pi)


@pytest.mark.parametrize("seed", MORE[:4])
def test_cars_in_clutter(seed: int) -> None:
    free = clutter(seed + 1)
    start, goal = two_poses(free, seed + 101)
    way = drive_wheeled(point_in(free), start, goal, turning_radius=0.3, seed=0)
    holds(way, free, start, goal)
    assert {segment.kind for segment in way.segments} <= {"line", "arc"}
    assert all(abs(segment.length / segment.turn) >= 0.3 - 1e-12 for segment in way.segments if segment.turn)
    tight = shortest_length(free, start, goal)
    assert tight - 1e-9 <= way.length <= 2 * tight + 2


@pytest.mark.parametrize("seed", MORE)
def test_differential_in_clutter(seed: int) -> None:
    free = clutter(seed)
    start, goal = two_poses(free, seed + 100)
    way = drive_wheeled(point_in(free), start, goal, seed=0)
    holds(way, free, start, goal)
    assert {segment.kind for segment in way.segments} <= {"line", "turn"}
    tight = shortest_length(free, start, goal)
    assert tight - 1e-9 <= way.length <= 2 * tight


def nose_first(a: Array, b: Array) -> Array:
    """Turn, line and turn that drive forwards from pose to pose."""
    ahead = np.arctan2(b[1] - a[1], b[0] - a[0])
    return np.array([[0.0, wrap(ahead - a[2])], [np.hypot(*(b - a)[:2]), 0.0], [0.0, wrap(b[2] - ahead)]])


def test_reversing_is_as_long_as_driving_forwards_and_turns_no_more() -> None:
    """Wherever a long base can go forwards it is steered, as far, and turning as much or less."""
    scene, base = footprint_scene(LONG, clutter(0)), Steering(SPIN, 0.0, 0.2)
    less, motions, rng = 0, np.zeros((5, 2)), np.random.default_rng(2)
    for _ in range(200):
        a = rng.uniform((0, 0, -np.pi), (10, 10, np.pi))
        b = np.array([*(a[:2] + rng.uniform(-1.5, 1.5, 2)), rng.uniform(-np.pi, np.pi)])
        forwards = path_of_motions(a, nose_first(a, b), "straight")
        if not all(arc_is_free(scene, one.start, one.length, one.turn) for one in forwards.segments):
            continue
        assert steer(scene, base, a, b, np.inf, motions) < np.inf
        assert np.abs(motions[:, 0]).sum() == pytest.approx(forwards.length, abs=1e-9)
        assert np.abs(motions[:, 1]).sum() <= forwards.turning + 1e-9
        less += np.abs(motions[:, 1]).sum() < forwards.turning - 0.1
    assert less > 8


def test_a_leg_behind_is_driven_backwards() -> None:
    way = drive_wheeled(point_in(box(0, 0, 4, 1)), [3, 0.5, 0], [1, 0.5, 0], seed=0)
    assert [segment.kind for segment in way.segments] == ["line"]
    assert way.segments[0].length == pytest.approx(-2)


def test_a_car_parks_sideways() -> None:
    way = drive_wheeled(point_in(box(0, 0, 4, 4)), [1, 1, 0], [1, 1.5, 0], turning_radius=0.5, seed=0)
    assert way.method == "straight"
    assert {segment.length > 0 for segment in way.segments} == {False, True}
    assert way.length == pytest.approx(engine_distance_at(0.5, [1, 1, 0], [1, 1.5, 0]), abs=1e-9)


def engine_distance_at(radius: float, a: list[float], b: list[float]) -> float:
    scale = RADIUS / radius
    ends = [np.array([p[0] * scale, p[1] * scale, p[2]]) for p in (a, b)]
    return engine_distance(ends[0], ends[1]) / scale


def test_footprints_on_wheels() -> None:
    """A long base in a slalom: every pose of the way, looked at by shapely, keeps floor and clearance."""
    floor = box(0, 0, 6, 3)
    obstacles = [Shadow(box(1.8, 0, 2.1, 1.7)), Shadow(box(3.8, 1.2, 4.1, 3)), Shadow(Point(5, 0.6), 0.15)]
    scene = footprint_scene(LONG, floor, obstacles, 0.05)
    start, goal = np.array([0.8, 0.6, 0.3]), np.array([5.2, 2.2, 1.5])
    ways = [
        drive_wheeled(scene, start, goal, seed=0),
        drive_wheeled(scene, start, goal, turning_radius=0.45, seed=0),
    ]
    for way in ways:
        assert off(way.end, goal) <= 1e-9
        for x, y, yaw in way.sample(0.01):
            c, s = np.cos(yaw), np.sin(yaw)
            body = Polygon(LONG @ np.array([[c, s], [-s, c]]) + [x, y])
            assert floor.covers(body)
            assert all(shadow.core.distance(body) > 0.05 + shadow.radius - 1e-9 for shadow in obstacles)
    assert not any(segment.kind == "turn" for segment in ways[1].segments)


def test_standing_still_is_no_way_at_all() -> None:
    here = [0.5, 0.5, 1.0]
    for way in (
        drive_wheeled(point_in(box(0, 0, 1, 1)), here, here, seed=0),
        drive_wheeled(point_in(box(0, 0, 1, 1)), here, here, turning_radius=0.3, seed=0),
    ):
        assert (way.method, way.segments, way.length) == ("still", (), 0.0)
        assert way.sample(0.1).tolist() == [here]


def test_a_turn_alone() -> None:
    way = drive_wheeled(point_in(box(0, 0, 1, 1)), [0.5, 0.5, 3.0], [0.5, 0.5, -3.0], seed=0)
    assert [segment.kind for segment in way.segments] == ["turn"]
    assert way.turning == pytest.approx(2 * np.pi - 6)


SCRIPT = """
import json
from shapely import box
from regionik.planners.driving.footprint_scene import footprint_scene
from regionik.planners.driving.pose_planner import drive_wheeled
from tests import examples
free = footprint_scene([[0, 0]], box(0, 0, 6, 3) - box(1.8, 0, 2.1, 1.9) - box(3.8, 1.2, 4.1, 3))
drive_wheeled(free, [0.5, 0.5, 0], [1, 2, 1], turning_radius=0.3, seed=WARM)
way = drive_wheeled(free, [0.8, 0.6, 0.3], [5.2, 2.2, 1.5], turning_radius=0.4, seed=3)
print(json.dumps([way.method, way.sample(0.05).tolist()]))
"""


@pytest.mark.slow
def test_same_seed_same_way_in_every_process() -> None:
    runs = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT.replace("WARM", str(warm))],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for warm in (1, 2)
    ]
    assert runs[0] == runs[1]
    assert json.loads(runs[0])[0] == "ompl"


def test_a_car_does_not_turn_round_in_a_passage() -> None:
    """A long car in a passage hardly wider than itself can only go to and fro."""
    scene = footprint_scene(LONG, box(0, 0, 4, 0.4))
    with pytest.raises(NoPathError, match=r"no way with a turning radius of 1 m .* was found in"):
        drive_wheeled(scene, [2, 0.2, 0], [2, 0.2, np.pi], turning_radius=1.0, seed=0)


def test_a_footprint_that_does_not_fit() -> None:
    scene = footprint_scene(LONG, box(0, 0, 2, 1))
    with pytest.raises(NoPathError, match=r"goal \(1.900, 0.500, 0.000 rad\): the footprint does not fit"):
        drive_wheeled(scene, [0.5, 0.5, 0], [1.9, 0.5, 0], seed=0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": -1}, "seed: expected a whole number from 0 up, got -1"),
        ({"start": [0, 0]}, r"start: expected 3 numbers, got shape \(2,\)"),
        ({"goal": [0, 0, np.inf]}, "goal: every number must be finite"),
    ],
)
def test_bad_input(change: dict[str, object], words: str) -> None:
    case: dict[str, Any] = {"start": [0.5, 0.5, 0], "goal": [0.6, 0.5, 0], "seed": 0, **change}
    scene = point_in(box(0, 0, 1, 1))
    with pytest.raises(InputError, match=words):
        drive_wheeled(scene, turning_radius=1.0, **case)
    with pytest.raises(InputError, match=words):
        drive_wheeled(scene, **case)
