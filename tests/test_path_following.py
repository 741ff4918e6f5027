"""The tool goes on along its path: laws of what a stretch hands back."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
import shapely

from regionik.mfabrik import Solver
from regionik.moving.base_motion import BasePath, Candidate
from regionik.moving.drivers import driver_for
from regionik.moving.path_following import PathFollower, PathSegment, SegmentPoint, _solve, turned_as_asked
from regionik.planners.geometry.polylines import between as between_knots
from regionik.planners.geometry.polylines import leg_lengths
from regionik.postures.families import FRONT, Family
from regionik.postures.poses import Pose, Row
from regionik.pruning import whole_path
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.drives import drive_of
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.bodies import LARGEST_BEND, pose_between
from tests.kinds import BaseKind, Solid
from tests.maths import rot_x, wrap
from tests.measures import axis_of, pose_of


def world_of(name: str, solids: tuple[Solid, ...] = (), **rules: object) -> World:
    robot = robot_named(name)
    far = {"youbot": 0.25, "hinge5": 0.15, "dof10": 0.4, "pioneer7": 0.25}[name]
    task = tuple(Target(np.array([x, 0.0, far])) for x in (0.5, 0.6))
    floor = Floor(shapely.box(-1, -1, 2, 1))
    return World(name, robot, floor, solids, task, Rules(**rules))  # type: ignore[arg-type]


def follower(world: World) -> PathFollower:
    standing, _, pruned = whole_path(scene_of(world))
    guard, ladder = scene_of(world).guard, pruned.ladder
    driver = driver_for(scene_of(world), standing, 0)
    return PathFollower(scene_of(world), ladder, guard, driver.paths(ladder))


def spots_at(world: World, i: int, axis: tuple[float, float], near: Pose | None = None) -> list[Candidate]:
    """Configurations at set-point i with the arm axis on a spot, the least changed first."""
    here = Pose(pose_of(world.robot, np.array(axis), 0.0), world.robot.carry)
    if near is not None:
        here = Pose(pose_of(world.robot, np.array(axis), near.base[2]), near.joints)
    found = Solver(world.robot).self_motion(world.task[i].position, here.base, here.joints, 48)
    return [Candidate(one, i) for one in found]


def check(world: World, here: Pose, rows: list[Row], goal: Candidate) -> None:
    poses = [here, *(row.pose for row in rows)]
    p, q = (target.position for target in world.task)
    assert {(row.kind, row.setpoint) for row in rows} == {("step", 0)}
    for a, b in zip(poses[:-1], poses[1:], strict=True):
        assert np.abs(b.joints - a.joints).max() <= LARGEST_BEND
        assert abs(wrap(b.base[2] - a.base[2])) <= LARGEST_BEND
        assert np.hypot(*(b.base - a.base)[:2]) <= world.rules.step + 1e-9
        for share in np.linspace(0, 1, 9):
            at = pose_between(a, b, float(share), world.robot)
            tool = world.robot.tool(at.base, at.joints)[:3, 3]
            along = np.clip((tool - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            assert np.linalg.norm(tool - p - along * (q - p)) <= world.rules.path_tolerance
            assert scene_of(world).guard.clear(at)
    tool = world.robot.tool(poses[-1].base, poses[-1].joints)[:3, 3]
    assert np.linalg.norm(tool - q) <= world.rules.tolerance
    np.testing.assert_allclose(
        axis_of(world.robot, poses[-1].base), axis_of(world.robot, goal.pose.base), atol=1e-9
    )


@pytest.mark.parametrize("name", ["youbot", "hinge5", "dof10", "pioneer7"])
def test_the_tool_stays_on_its_way(name: str) -> None:
    world = world_of(name)
    walk = follower(world)
    first = spots_at(world, 0, (0.3, 0.1))[0]
    done = 0
    for axis in ((0.3, 0.1), (0.35, 0.15), (0.4, 0.0)):
        for goal in spots_at(world, 1, axis, first.pose)[:3]:
            rows = walk.follow(0, first, goal)
            if rows is not None:
                check(world, first.pose, rows, goal)
                done += 1
    assert done >= 1


def test_an_elbow_that_would_have_to_jump_is_refused() -> None:
    world = world_of("youbot")
    walk = follower(world)
    here, there = spots_at(world, 0, (0.1, 0.0)), spots_at(world, 1, (0.2, 0.0))
    ups = [spot for spot in here if spot.pose.joints[2] < -0.4]
    downs = [spot for spot in there if spot.pose.joints[2] > 0.4]
    assert ups
    assert downs
    passed = [walk.follow(0, ups[0], down) for down in downs]
    for down, rows in zip(downs, passed, strict=True):
        if rows is not None:  # only by way of the stretched arm, bit by bit
            check(world, ups[0].pose, rows, down)
            assert min(abs(row.pose.joints[2]) for row in rows) < LARGEST_BEND


def test_a_board_on_the_way_stops_it_and_is_told() -> None:
    board = Box("board", np.array([0.02, 0.35, 0.4]), np.array([0.55, -0.275, 0.4]))
    world = world_of("youbot", (board,), tool_contact=0.0)
    walk = follower(world)
    left = [spot for spot in spots_at(world, 0, (0.4, -0.3)) if scene_of(world).guard.clear(spot.pose)]
    right = [spot for spot in spots_at(world, 1, (0.7, -0.3)) if scene_of(world).guard.clear(spot.pose)]
    assert left
    assert right
    assert all(walk.follow(0, a, b) is None for a in left[:2] for b in right[:2])
    touch = walk.stops[0]
    assert touch.kind == "obstacle"
    assert scene_of(world).guard.other(touch) == "board"
    free = replace(world, obstacles=())
    followed = [follower(free).follow(0, a, b) for a in left[:2] for b in right[:2]]
    assert any(rows is not None for rows in followed)


def test_a_way_goes_evenly_from_knot_to_knot() -> None:
    rng = np.random.default_rng(0)
    axes, spots, joints = (rng.normal(size=size) for size in ((3, 2), (2, 3), (2, 5)))
    base = BasePath(False, np.column_stack([axes, np.full(3, np.nan)]), np.array([0.0, 0.4, 1.0]))
    families = Family(FRONT, pitch=3.0), Family(FRONT, pitch=-3.0)
    way = PathSegment(base, (Target(spots[0]), Target(spots[1])), joints, families, stride=0.25)
    np.testing.assert_allclose(way.points, spots[0] + base.tool[:, None] * (spots[1] - spots[0]))
    lengths = np.hypot(*np.diff(axes, axis=0).T), np.diff(base.tool) * np.linalg.norm(spots[1] - spots[0])
    np.testing.assert_allclose(leg_lengths(base.knots), lengths[0])
    shares = np.cumsum([0.0, *np.add(*lengths)]) / np.sum(lengths)
    np.testing.assert_allclose(way.wished, joints[0] + shares[:, None] * (joints[1] - joints[0]))
    counts = np.ceil(np.maximum(*lengths) / way.stride).astype(int)
    assert way.places() == [SegmentPoint(n, k / counts[n]) for n in (0, 1) for k in range(1, counts[n] + 1)]
    leg, share = np.array([0, 1, 1]), np.array([0.5, 0.25, 1.0])
    places = base.places(leg, share)
    assert np.isnan(places[:, 2]).all()
    expected = [(axes[0] + axes[1]) / 2, 0.75 * axes[1] + 0.25 * axes[2], axes[2]]
    np.testing.assert_allclose(places[:, :2], expected)
    asked = [way.target(SegmentPoint(int(k), float(s))).position for k, s in zip(leg, share, strict=True)]
    np.testing.assert_allclose(asked, between_knots(way.points, leg, share), atol=1e-12)
    assert asked[2].tolist() == spots[1].tolist()
    assert wrap(way.pitch(SegmentPoint(0, 0.5)) - 3.0) == 0.0  # both ends of the leg lie nearer to the first
    assert wrap(way.pitch(SegmentPoint(1, 0.5)) - 3.0) == pytest.approx(
        0.5 * (2 * np.pi - 6.0)
    )  # the shorter way


def test_an_arm_that_was_led_round_something_goes_on_from_where_it_is() -> None:
    rng = np.random.default_rng(1)
    joints, off = rng.normal(size=(2, 5)), rng.normal(size=5)
    base = BasePath(False, np.zeros((3, 3)), np.array([0.0, 0.3, 1.0]))
    way = PathSegment(base, (Target(np.zeros(3)), Target(np.ones(3))), joints, (Family(FRONT),) * 2, 0.1)
    here, at = SegmentPoint(0, 0.5), SegmentPoint(1, 0.5)
    asked = joints[0] + np.array([[0.15], [0.65]]) * (joints[1] - joints[0])
    for away in (np.zeros(5), off):
        near = Pose(np.zeros(3), asked[0] + away)
        np.testing.assert_allclose(way.wish(near, here, at), asked[1] + away, atol=1e-12)


@pytest.mark.parametrize("kind", get_args(BaseKind))
def test_a_base_on_a_leg_is_where_readers_of_a_plan_take_it_to_be(kind: BaseKind) -> None:
    rng = np.random.default_rng(0)
    knots = rng.uniform([-2.0, -2.0, -7.0], [2.0, 2.0, 7.0], (40, 3))
    leg, share = rng.integers(0, 39, 100), rng.uniform(0.0, 1.0, 100)
    drive = drive_of(kind, 0.4)
    places = BasePath(drive.rolls, knots, np.linspace(0.0, 1.0, 40)).places(leg, share)
    np.testing.assert_allclose(places, drive.between(knots[leg], knots[leg + 1], share), atol=1e-12)


@pytest.mark.parametrize("heading", [np.nan, 0.4])
def test_states_of_one_call_are_those_solved_one_by_one(heading: float) -> None:
    rng = np.random.default_rng(3)
    robot = robot_named("youbot")
    solver, found = Solver(robot, tolerance=1e-5), 0
    ends = Target(np.array([0.0, 0.0, 0.25])), Target(np.array([0.03, 0.02, 0.24]))
    for _ in range(30):
        axes = rng.uniform([-0.45, -0.1], [-0.35, 0.1]) + np.linspace(0.0, 0.05, 5)[:, None] * rng.normal(
            size=2
        )
        knots = np.column_stack([axes, np.full(5, heading)])
        first = solver.hold(ends[0], np.array([*axes[0], 0.3]), robot.carry).joints
        joints = first + rng.uniform(-0.2, 0.2, (2, 5))
        way = PathSegment(
            BasePath(False, knots, np.linspace(0, 1, 5)), ends, joints, (Family(FRONT),) * 2, 0.1
        )
        leg, share = np.arange(4), np.full(4, 1.0)
        near = Pose(np.array([*axes[0], 0.3]), joints[0])
        rows = between_knots(way.points, leg, share), way.base.places(leg, share), way.wished[1:]
        bases, postures = solver.along(*rows, LARGEST_BEND / 2, near.base, near.joints)
        for n in range(4):
            one = _solve(solver, way, SegmentPoint(n, 1.0), near, way.wished[n + 1])
            assert (one is None) == (n >= len(bases))
            if one is None:
                break
            np.testing.assert_allclose(bases[n], one.base, atol=1e-9)
            np.testing.assert_allclose(postures[n], one.joints, atol=1e-9)
            near, found = one, found + 1
    assert found > 60


def test_a_path_between_two_rooms_has_no_shared_place() -> None:
    """Where areas do not overlap there is nothing to follow: the ladder says so before any arm moves."""
    robot: Robot = robot_named("youbot")
    wall = Box("wall", np.array([0.1, 4.0, 0.1]), np.array([0.55, 0.0, 0.05]))
    task = (Target(np.array([0.0, 0.0, 0.25])), Target(np.array([1.1, 0.0, 0.25])))
    floor = Floor(shapely.box(-1, -1, 2, 1))
    with pytest.raises(NoPlanFound):
        whole_path(scene_of(World("rooms", robot, floor, (wall,), task, Rules())))


def test_a_base_on_wheels_that_is_there_but_for_rounding_stands_while_the_tool_goes_on() -> None:
    world = world_of("pioneer7")
    paths = follower(replace(world, robot=replace(world.robot, base="differential"))).paths
    here = np.array([0.3, 0.0, 0.0])
    for way in paths.between(0, 1, here, here + [1e-12, 0.0, 0.0]):
        assert len(way.knots) >= 2
        assert way.tool[[0, -1]].tolist() == [0.0, 1.0]


def test_a_tool_that_leans_out_between_two_looks_is_seen() -> None:
    """It was met at three places on the way, and rose past its cone between them; found on a path of B*."""
    cone = 1e-3
    here, there = (Target(np.array([x, 0.0, 0.5]), cone=cone, orientation=np.eye(3)) for x in (0.0, 0.01))
    for shares, good in (((0.7, 0.997, 0.7), False), ((0.99, 0.99, 0.99), True), ((0.5, 0.7, 0.6), True)):
        tools = np.array([rot_x(share * cone) for share in shares])
        assert turned_as_asked(here, there, tools) is good
