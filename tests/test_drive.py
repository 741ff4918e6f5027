"""Base drives: which method answers, determinism, and answers that are always found or refused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from ompl import util
from shapely import box
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.driving.point_planner import NoPathError, PointPath, drive_point
from regionik.planners.driving.sampling import PlanningProblem, connect
from regionik.planners.geometry.polygons import FlatPolygon, segment_inside
from regionik.worlds.errors import RegionikError
from tests.maths import Array

SQUARE = box(-0.5, -1.5, 3, 1.5) - box(1.0, -0.2, 1.6, 0.4).buffer(0.2)  # experiment 2
BLOCK = box(-0.5, -1.5, 3, 1.5) - box(1.175, -0.45, 1.425, 0.45).buffer(0.2)  # experiment 2b


def clutter(seed: int) -> Polygon | MultiPolygon:
    rng = np.random.default_rng(seed)
    centres, sizes = rng.uniform(0, 10, (30, 2)), rng.uniform(0.2, 0.9, (30, 2))
    boxes = shapely.box(*(centres - sizes).T, *(centres + sizes).T)
    discs = shapely.buffer(shapely.points(centres), sizes[:, 0], quad_segs=4)
    free: Polygon | MultiPolygon = box(0, 0, 10, 10) - shapely.union_all(
        np.where(rng.random(30) < 0.5, boxes, discs)
    )
    return free


def maze() -> Polygon:
    """Rooms of 1 mm behind one another: too narrow to be hit by chance."""
    walls = [box(0.1 * k, 0.001 * (1 - k % 2), 0.1 * k + 0.099, 1 - 0.001 * (k % 2)) for k in range(1, 20)]
    free = box(0, 0, 2, 1) - shapely.union_all(walls)
    part: Polygon = max(shapely.get_parts(free), key=lambda p: p.area)
    return part


def holds(free: Polygon | MultiPolygon, answer: PointPath, start: Array, goal: Array, step: float) -> None:
    """What every drive promises."""
    flat = FlatPolygon.from_shapely(free)
    points = answer.points
    np.testing.assert_allclose(points[[0, -1]], [start, goal], atol=1e-9)
    assert (np.hypot(*np.diff(points, axis=0).T) <= step + 1e-9).all()
    for p, q in zip(points[:-1], points[1:], strict=True):
        assert segment_inside(flat.vertices, flat.starts, *p, *q)


def test_a_free_way_is_driven_straight() -> None:
    answer = drive_point(BLOCK, [0, 0], [0.9, 0], step=0.25)
    assert answer.method == "straight"
    np.testing.assert_allclose(answer.points, np.linspace([0, 0], [0.9, 0], 5), atol=1e-15)


def test_standing_still_is_one_point() -> None:
    answer = drive_point(BLOCK, [0.2, 0.1], [0.2, 0.1], step=0.25)
    assert answer.method == "straight"
    assert answer.points.tolist() == [[0.2, 0.1]]


def test_experiment_2_is_driven_by_algorithm_2() -> None:
    start, goal = np.array([0.7896162428305282, 0.1585664255264057]), np.array([1.0723551929579735, -0.4])
    answer = drive_point(SQUARE, start, goal, step=0.25)
    assert answer.method == "steps"
    assert len(answer.points) == 5
    holds(SQUARE, answer, start, goal, 0.25)


@pytest.mark.parametrize("step", [0.10, 0.20, 0.30])
def test_experiment_2b_is_driven_round_the_block(step: float) -> None:
    start, goal = np.array([0.887, 0.044]), np.array([1.625, 0.033])
    answer = drive_point(BLOCK, start, goal, step=step)
    assert answer.method == "shortest"
    holds(BLOCK, answer, start, goal, step)
    length = np.hypot(*np.diff(answer.points, axis=0).T).sum()
    assert 1.5 < length < 1.75  # round one end of the block or the other


@pytest.mark.parametrize("seed", range(12))
def test_every_pair_of_points_is_connected_or_refused(seed: int) -> None:
    free = clutter(seed)
    parts = shapely.get_parts(free)
    points = np.random.default_rng(seed).uniform(0, 10, (60, 2))
    points = points[shapely.contains_xy(free, *points.T)]
    part = np.array([np.flatnonzero(shapely.contains_xy(parts, *p))[0] for p in points])
    for k in range(0, len(points) - 1, 2):
        start, goal = points[k], points[k + 1]
        if part[k] == part[k + 1]:
            holds(free, drive_point(free, start, goal, step=0.3), start, goal, 0.3)
        else:
            with pytest.raises(NoPathError, match="do not join"):
                drive_point(free, start, goal, step=0.3)


def test_a_way_too_narrow_for_sampling_is_found() -> None:
    free = maze()
    start, goal = np.array([0.05, 0.5]), np.array([1.9995, 0.5])
    answer = drive_point(free, start, goal, step=0.2)
    assert answer.method == "shortest"
    holds(free, answer, start, goal, 0.2)


def test_a_map_of_thousands_of_corners_is_crossed_without_detours() -> None:
    rng = np.random.default_rng(0)
    discs = shapely.buffer(shapely.points(rng.uniform(0, 45, (1000, 2))), rng.uniform(0.1, 0.5, 1000))
    free = max(shapely.get_parts(box(0, 0, 45, 45) - shapely.union_all(discs)), key=lambda part: part.area)
    points = rng.uniform(0, 45, (20, 2))
    points = points[shapely.contains_xy(free, *points.T)][:10]
    for start, goal in zip(points[::2], points[1::2], strict=True):
        answer = drive_point(free, start, goal, step=0.5)
        holds(free, answer, start, goal, 0.5)
        assert np.hypot(*np.diff(answer.points, axis=0).T).sum() < 1.1 * np.hypot(*(goal - start))


def test_ends_are_held_to_the_boundary_by_rounding_only() -> None:
    answer = drive_point(box(0, 0, 1, 1), [-1e-10, 0.5], [1 + 1e-10, 0.5], step=0.5)
    assert answer.points[[0, -1]].tolist() == [[0.0, 0.5], [1.0, 0.5]]
    with pytest.raises(NoPathError, match=r"start \(-0.100, 0.500\) is 0.1 m outside"):
        drive_point(box(0, 0, 1, 1), [-0.1, 0.5], [0.5, 0.5], step=0.5)
    with pytest.raises(NoPathError, match=r"goal \(0.500, 1.200\) is 0.2 m outside"):
        drive_point(box(0, 0, 1, 1), [0.1, 0.5], [0.5, 1.2], step=0.5)


def test_a_refusal_says_from_where_to_where() -> None:
    apart = MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    with pytest.raises(RegionikError, match=r"start \(0.500, 0.500\) and goal \(2.500, 0.500\) are in parts"):
        drive_point(apart, [0.5, 0.5], [2.5, 0.5], step=0.1)


def sampled(seed: int) -> list[list[float]]:
    """RRTConnect's path round the block."""
    flat = FlatPolygon.from_shapely(BLOCK)
    ends = np.array([0.887, 0.044]), np.array([1.625, 0.033])
    box_of = flat.vertices.min(axis=0), flat.vertices.max(axis=0)
    path = connect(PlanningProblem(*box_of, *ends, flat.holds, flat.sees), seed=seed, iterations=2000)
    assert path is not None
    return path.tolist()


def test_same_seed_same_sampled_path_whatever_was_planned_before() -> None:
    first = [sampled(seed) for seed in range(4)]
    assert len({str(path) for path in first}) == 4
    util.RNG().uniform01()
    assert [sampled(seed) for seed in (3, 1, 0, 2)] == [first[k] for k in (3, 1, 0, 2)]


SCRIPT = """
import json, sys
from tests.test_drive import sampled
print(json.dumps({seed: sampled(seed) for seed in json.loads(sys.argv[1])}, sort_keys=True))
"""


@pytest.mark.slow
def test_same_seed_same_sampled_path_in_another_process() -> None:
    def run(seeds: list[int]) -> str:
        command = [sys.executable, "-c", SCRIPT, json.dumps(seeds)]
        root = Path(__file__).parent.parent
        return subprocess.run(command, capture_output=True, text=True, check=True, cwd=root).stdout

    forward, backward = run([0, 1, 2]), run([2, 1, 0])
    assert forward == backward
    assert json.loads(forward) == {str(seed): sampled(seed) for seed in (0, 1, 2)}


def test_ompl_keeps_silent_and_its_log_level(capfd: pytest.CaptureFixture[str]) -> None:
    before = util.getLogLevel()
    sampled(5)
    assert util.getLogLevel() == before
    assert capfd.readouterr() == ("", "")
