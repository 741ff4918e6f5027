"""The tool goes on along its path: laws of what a stretch hands back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.avoid import Spot
from regionik.basepaths import AxisLine, tracks_for
from regionik.driving import driver_for
from regionik.guard import guard_of
from regionik.hops import Hops
from regionik.mfabrik import Solver, axis_of, pose_of
from regionik.pipeline import whole_path
from regionik.planners.kernels import wrap
from regionik.poses import LARGEST_BEND, Pose, Row, between
from regionik.reachable import FRONT, Family
from regionik.stretch import Leg, Stretcher
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.library import robot_named
from regionik.worlds.obstacles import Box, Solid
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World


def world_of(name: str, solids: tuple[Solid, ...] = (), **rules: object) -> World:
    robot = robot_named(name)
    far = {"youbot": 0.25, "hinge5": 0.15, "dof10": 0.4, "pioneer7": 0.25}[name]
    task = tuple(Target(np.array([x, 0.0, far])) for x in (0.5, 0.6))
    floor = Floor(shapely.box(-1, -1, 2, 1))
    return World(name, robot, floor, solids, task, Rules(**rules))  # type: ignore[arg-type]


def stretcher(world: World) -> Stretcher:
    standing, _, pruned = whole_path(world)
    guard, ladder = guard_of(world), pruned.ladder
    tracks = tracks_for(world, ladder, standing, driver_for(world, Hops(world, guard), standing, 0))
    return Stretcher(world, ladder, guard, tracks)


def spots_at(world: World, i: int, axis: tuple[float, float], near: Pose | None = None) -> list[Spot]:
    """Configurations at set-point i with the arm axis on a spot, the least changed first."""
    here = Pose(pose_of(world.robot, np.array(axis), 0.0), world.robot.carry)
    if near is not None:
        here = Pose(pose_of(world.robot, np.array(axis), near.base[2]), near.joints)
    found = Solver(world.robot).self_motion(world.task[i].position, here.base, here.joints, 48)
    return [Spot(one, i) for one in found]


def check(world: World, here: Pose, rows: list[Row], goal: Spot) -> None:
    poses = [here, *(row.pose for row in rows)]
    p, q = (target.position for target in world.task)
    assert {(row.kind, row.setpoint) for row in rows} == {("step", 0)}
    for a, b in zip(poses[:-1], poses[1:], strict=True):
        assert np.abs(b.joints - a.joints).max() <= LARGEST_BEND
        assert abs(wrap(b.base[2] - a.base[2])) <= LARGEST_BEND
        assert np.hypot(*(b.base - a.base)[:2]) <= world.rules.step + 1e-9
        for share in np.linspace(0, 1, 9):
            at = between(a, b, float(share))
            tool = world.robot.tool(at.base, at.joints)[:3, 3]
            along = np.clip((tool - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            assert np.linalg.norm(tool - p - along * (q - p)) <= world.rules.path_tolerance
            assert guard_of(world).clear(at)
    tool = world.robot.tool(poses[-1].base, poses[-1].joints)[:3, 3]
    assert np.linalg.norm(tool - q) <= world.rules.tolerance
    np.testing.assert_allclose(
        axis_of(world.robot, poses[-1].base), axis_of(world.robot, goal.pose.base), atol=1e-9
    )


@pytest.mark.parametrize("name", ["youbot", "hinge5", "dof10", "pioneer7"])
def test_the_tool_stays_on_its_way(name: str) -> None:
    world = world_of(name)
    walk = stretcher(world)
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
    walk = stretcher(world)
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
    walk = stretcher(world)
    left = [spot for spot in spots_at(world, 0, (0.4, -0.3)) if guard_of(world).clear(spot.pose)]
    right = [spot for spot in spots_at(world, 1, (0.7, -0.3)) if guard_of(world).clear(spot.pose)]
    assert left
    assert right
    assert all(walk.follow(0, a, b) is None for a in left[:2] for b in right[:2])
    touch = walk.stops[0]
    assert touch.kind == "obstacle"
    assert guard_of(world).other(touch) == "board"
    free = replace(world, obstacles=())
    followed = [stretcher(free).follow(0, a, b) for a in left[:2] for b in right[:2]]
    assert any(rows is not None for rows in followed)


def test_a_leg_goes_straight_from_end_to_end() -> None:
    rng = np.random.default_rng(0)
    axis, spots, joints = (tuple(rng.normal(size=(2, n))) for n in (2, 3, 5))
    families = Family(FRONT, pitch=3.0), Family(FRONT, pitch=-3.0)
    leg = Leg(AxisLine(*axis), (Target(spots[0]), Target(spots[1])), joints, families)
    shares = np.array([0.0, 0.3, 1.0])
    places, asked = leg.track.places(shares), [leg.target(share).position for share in shares.tolist()]
    assert np.isnan(places[:, 2]).all()
    pairs = (places[:, :2], axis), (asked, spots), (leg.points(shares), spots), (leg.wished(shares), joints)
    for values, (a, b) in pairs:
        np.testing.assert_allclose(values, a + shares[:, None] * (b - a))
    pitches = [wrap(leg.pitch(share) - 3.0) for share in shares.tolist()]
    np.testing.assert_allclose(pitches, shares * (2 * np.pi - 6.0))  # the shorter way round
    assert leg.length == pytest.approx(max(np.linalg.norm(p[1] - p[0]) for p in (axis, spots)))


def test_a_path_between_two_rooms_has_no_shared_place() -> None:
    """Where areas do not overlap there is nothing to follow: the ladder says so before any arm moves."""
    robot: Robot = robot_named("youbot")
    wall = Box("wall", np.array([0.1, 4.0, 0.1]), np.array([0.55, 0.0, 0.05]))
    task = (Target(np.array([0.0, 0.0, 0.25])), Target(np.array([1.1, 0.0, 0.25])))
    floor = Floor(shapely.box(-1, -1, 2, 1))
    with pytest.raises(NoPlanFound):
        whole_path(World("rooms", robot, floor, (wall,), task, Rules()))
