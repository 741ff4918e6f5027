"""The tool goes on along its path: laws of what a stretch hands back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.mfabrik import Solver
from regionik.moving.base_motion import BasePath, Candidate
from regionik.moving.drivers import driver_for
from regionik.moving.path_following import PathFollower, PathSegment, SegmentPoint, follows_orientation
from regionik.moving.path_search import path_search
from regionik.postures.families import FRONT, Family
from regionik.postures.poses import MotionState, Pose
from regionik.pruning import whole_path
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.bodies import LARGEST_BEND, pose_between
from tests.kinds import Solid
from tests.maths import rot_x, wrap
from tests.measures import axis_of, pose_of


def world_of(name: str, solids: tuple[Solid, ...] = (), **rules: object) -> World:
    robot = robot_named(name)
    far = {"youbot": 0.25, "hinge5": 0.15, "dof10": 0.4, "pioneer7": 0.25}[name]
    task = tuple(Target(np.array([x, 0.0, far])) for x in (0.5, 0.6))
    floor = Floor(shapely.box(-1, -1, 2, 1))
    return World(name, robot, floor, solids, task, Rules(**rules))  # type: ignore[arg-type]


def follower(world: World) -> PathFollower:
    free_space, _, pruned = whole_path(scene_of(world))
    collision, ladder = scene_of(world).collision, pruned.ladder
    driver = driver_for(scene_of(world), free_space, 0)
    return PathFollower(scene_of(world), ladder, collision, driver.paths(ladder))


def spots_at(world: World, i: int, axis: tuple[float, float], near: Pose | None = None) -> list[Candidate]:
    """Configurations at set-point i with the arm axis on a spot, the least changed first."""
    here = Pose(pose_of(world.robot, np.array(axis), 0.0), world.robot.carry)
    if near is not None:
        here = Pose(pose_of(world.robot, np.array(axis), near.base[2]), near.joints)
    found = Solver(world.robot).self_motion(world.task[i].position, here.base, here.joints, 48)
    return [Candidate(one, i) for one in found]


def check(world: World, here: Pose, rows: list[MotionState], goal: Candidate) -> None:
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
            assert scene_of(world).collision.clear(at)
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
    left = [spot for spot in spots_at(world, 0, (0.4, -0.3)) if scene_of(world).collision.clear(spot.pose)]
    right = [spot for spot in spots_at(world, 1, (0.7, -0.3)) if scene_of(world).collision.clear(spot.pose)]
    assert left
    assert right
    assert all(walk.follow(0, a, b) is None for a in left[:2] for b in right[:2])
    proximity = walk.stops[0]
    assert proximity.kind == "obstacle"
    assert scene_of(world).collision.other(proximity) == "board"
    free = replace(world, obstacles=())
    followed = [follower(free).follow(0, a, b) for a in left[:2] for b in right[:2]]
    assert any(rows is not None for rows in followed)


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


def test_a_tool_that_leans_out_between_two_looks_is_seen() -> None:
    """It was met at three places on the way, and rose past its cone between them; found on a path of B*."""
    cone = 1e-3
    here, there = (Target(np.array([x, 0.0, 0.5]), cone=cone, orientation=np.eye(3)) for x in (0.0, 0.01))
    for shares, good in (((0.7, 0.997, 0.7), False), ((0.99, 0.99, 0.99), True), ((0.5, 0.7, 0.6), True)):
        tools = np.array([rot_x(share * cone) for share in shares])
        assert follows_orientation(here, there, tools) is good


def test_the_base_does_not_go_on_through_a_wall_from_where_no_area_shows() -> None:
    """Base and joints together may come to a place beyond the wall, off the area that is named for it."""
    wall = Box("wall", np.array([4.0, 0.02, 0.04]), np.array([0.0, 0.34, 0.02]))
    task = tuple(Target(np.array([x, 0.0, 0.4])) for x in (0.0, 0.05))
    rules = Rules(clearance=0.02, avoidance=False)
    floor = Floor(shapely.box(-2, -2, 2, 2))
    scene = scene_of(World("wall", robot_named("youbot"), floor, (wall,), task, rules))
    free_space, _, pruned = whole_path(scene)
    search, areas = path_search(scene, pruned.ladder, free_space, 0), pruned.ladder.component

    def at(i: int, k: int, beyond: int) -> Candidate:
        spot = shapely.shortest_line(areas[k], areas[beyond]).coords[0]
        return Candidate(search.sampler.solver(k)(task[i], np.array([*spot, 0.0]), scene.robot.carry), k)

    for own, other in ((0, 1), (1, 0)):  # areas of the first set-point; those of the second follow them
        goal = at(1, own + 2, other)
        assert search.step(1, at(0, own, other), goal, no_others) is not None
        assert search.step(1, replace(at(0, other, own), component=own), goal, no_others) is None


def no_others(i: int, here: Candidate) -> Iterator[Candidate]:
    return iter(())
