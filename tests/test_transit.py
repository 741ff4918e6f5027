"""Motion with the tool lifted: laws of its states, for ways that are folded and ways that are sampled."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from regionik.moving import transit
from regionik.moving.drivers import WheeledDriver, WheeledPaths, driver_for
from regionik.moving.transit import TransitPlanner
from regionik.planners.driving import pose_planner
from regionik.planners.driving.arcs import MAX_TURN_STEP
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.sampling import connect_poses
from regionik.postures.poses import Pose, distinct
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.scene import Floor, Rules, World
from tests.bodies import LARGEST_BEND, pose_between
from tests.kinds import BaseKind, Heading, Solid
from tests.maths import Array, wrap
from tests.measures import axis_of, pose_of

HERE = np.array([-0.9, -0.7, 0.3])
THERE = np.array([1.0, 0.8, -2.9])


def world_of(name: str, *solids: Solid, heading: Heading = "free") -> World:
    rules = Rules(clearance=0.02, step=0.1, heading=heading)
    return World(name, robot_named(name), Floor(shapely.box(-2, -2, 2, 2)), solids, (), rules)


def carrier(world: World) -> TransitPlanner:
    return TransitPlanner(
        scene_of(world),
        scene_of(world).collision,
        driver_for(scene_of(world), scene_of(world).free_floor.anywhere, 0),
    )


def posed(world: World, base: np.ndarray, *bends: float) -> Pose:
    joints = np.array(world.robot.carry)
    joints[: len(bends)] += bends
    return Pose(base, np.clip(joints, world.robot.chain.lower, world.robot.chain.upper))


def check(world: World, here: Pose, way: list[Pose], there: Pose) -> None:
    robot, poses = world.robot, [here, *way, there]
    free = scene_of(world).ground.inner.free
    for a, b in zip(poses[:-1], poses[1:], strict=True):
        assert np.hypot(*(b.base - a.base)[:2]) <= world.rules.step + 1e-9
        assert abs(wrap(b.base[2] - a.base[2])) <= LARGEST_BEND
        assert np.abs(b.joints - a.joints).max() <= LARGEST_BEND + 1e-9
        for share in np.linspace(0, 1, 5):
            at = pose_between(a, b, float(share), world.robot)
            assert scene_of(world).collision.clear(at)
            assert free.distance(shapely.Point(axis_of(robot, at.base))) < 1e-3
            assert (at.joints >= robot.chain.lower - 1e-9).all()
            assert (at.joints <= robot.chain.upper + 1e-9).all()


@pytest.mark.parametrize("name", ["youbot", "dof10"])
def test_a_base_stands_while_the_arm_swings(name: str) -> None:
    world = world_of(name)
    here, there = posed(world, HERE, 0.9, -0.2), posed(world, HERE, -0.9, 0.3)
    way = carrier(world).swung(here, there, 0)
    assert way is not None
    check(world, here, way, there)
    assert all(np.array_equal(pose.base, HERE) for pose in way)
    assert carrier(world).swung(here, here, 0) == []


@pytest.mark.parametrize("name", ["youbot", "pioneer7"])
def test_an_arm_that_cannot_fold_is_driven_as_it_is(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_of(name)
    here, there = posed(world, HERE, 0.5, -0.2), posed(world, THERE, -0.5, 0.2)
    monkeypatch.setattr(TransitPlanner, "folded", lambda *_: None)
    way = carrier(world).driven(here, there, 0)
    assert way is not None
    check(world, here, way, there)
    poses = [here, *way, there]
    assert all((a.base != b.base).any() or (a.joints != b.joints).any() for a, b in pairwise(poses))


@pytest.mark.parametrize("name", ["youbot-real", "dof10"])
def test_folded_ways_over_open_floor(name: str) -> None:
    pillar = Box("pillar", np.array([0.2, 0.2, 0.5]), np.array([0.1, 0.05, 0.25]))
    world = world_of(name, pillar)
    here, there = posed(world, HERE, 0.5, -0.2), posed(world, THERE, -0.5, 0.2)
    way = carrier(world).folded(here, there, 0)
    assert way is not None
    check(world, here, way, there)
    turns = np.abs([wrap(b.base[2] - a.base[2]) for a, b in zip([here, *way], [*way, there], strict=True)])
    assert turns.max() <= MAX_TURN_STEP + 1e-9
    again = carrier(world).folded(here, there, 0)
    assert again is not None
    assert [pose.joints.tolist() for pose in again] == [pose.joints.tolist() for pose in way]


@given(st.floats(0.0, 2.0), st.floats(-3.0, 3.0), st.floats(0.02, 0.5))
def test_a_base_that_turns_round_its_arm_keeps_its_steps(way: float, turn: float, step: float) -> None:
    world = world_of("youbot-real")
    world = replace(world, rules=replace(world.rules, step=step))
    here = posed(world, np.zeros(3))
    start = axis_of(world.robot, here.base)
    there_base = np.array([*(start + (way, 0.0)), turn])
    there_base[:2] -= axis_of(world.robot, np.array([0.0, 0.0, turn]))
    there = posed(world, there_base)
    route = np.array([axis_of(world.robot, pose.base) for pose in (here, there)])
    states = carrier(world).driver.states(here, there, route)
    bases = [pose.base for pose in [here, *states, there]]
    assert np.hypot(*np.diff(bases, axis=0)[:, :2].T).max() <= step


def test_the_arm_draws_back_where_it_cannot_fold() -> None:
    lid = Box("lid", np.array([0.6, 0.6, 0.02]), np.array([0.6, 0.0, 0.4]))
    world = world_of("youbot", lid)
    flat = np.array([0.0, 0.3, 0.0, 1.2, 0.0])
    here = Pose(np.array([0.25, 0.0, 0.0]), flat)
    there = posed(world, np.array([-0.8, 0.5, 0.0]))
    assert scene_of(world).collision.clear(here)
    bare = replace(world, obstacles=())
    way = carrier(world).folded(here, there, 0)
    straight = carrier(bare).folded(here, there, 0)
    assert way is not None
    assert straight is not None
    check(world, here, way, there)
    assert carrier(world).obstruction(here, there, 0) is not None
    assert carrier(bare).obstruction(here, there, 0) is None


@pytest.mark.parametrize("heading", ["free", "fixed"])
def test_sampled_ways_in_a_narrow_place(heading: Heading) -> None:
    post = Cylinder("post", 0.03, 0.8, np.array([0.3, 0.0, 0.6]))
    world = world_of("youbot", post, heading=heading)
    out = np.array([0.0, 0.4, 0.0, 1.2, 0.0])
    left, right = (Pose(np.zeros(3), out + [turn, 0, 0, 0, 0]) for turn in (0.5, -0.5))
    here = carrier(world)
    way = here.sampled(left, right, 0)
    assert way is not None
    check(world, left, way, right)
    assert here.driver.methods == {"whole body": 1}
    again = carrier(world).sampled(left, right, 0)
    assert again is not None
    assert [pose.joints.tolist() for pose in again] == [pose.joints.tolist() for pose in way]
    if heading == "fixed":
        assert max(abs(pose.base[2]) for pose in way) < 1e-5


def test_ways_of_the_arm_alone_lead_round_things() -> None:
    post = Cylinder("post", 0.03, 0.8, np.array([0.3, 0.0, 0.6]))
    world = world_of("youbot", post)
    out = np.array([0.0, 0.4, 0.0, 1.2, 0.0])
    left, right = (Pose(np.zeros(3), out + [turn, 0, 0, 0, 0]) for turn in (0.5, -0.5))
    planner = carrier(world)
    assert not planner.collision.passes([left, right])
    way = planner.arm_way(left, right.joints)
    assert way is not None
    assert np.array_equal(way[-1].joints, right.joints)
    check(world, left, way[:-1], way[-1])


def test_the_arm_of_a_base_on_wheels_is_led_round_things(monkeypatch: pytest.MonkeyPatch) -> None:
    """From under a lid it cannot fold straight away, nor the base draw back: no way was looked for."""
    monkeypatch.setattr(transit, "WITHDRAWALS", (0.0,))
    lid = Box("lid", np.array([0.6, 0.6, 0.02]), np.array([0.6, 0.0, 0.4]))
    world = world_of("youbot", lid)
    world = replace(world, robot=replace(world.robot, base="differential"))
    here = Pose(np.array([0.25, 0.0, 0.0]), np.array([0.0, 0.3, 0.0, 1.2, 0.0]))
    there = posed(world, np.array([-0.8, 0.5, 0.0]))
    assert carrier(world).folded(here, there, 0) is None
    one, again = carrier(world), carrier(world)
    way, same = one.sampled(here, there, 0), again.sampled(here, there, 0)
    assert way is not None
    assert same is not None
    check(world, here, way, there)
    assert one.driver.methods["arm alone"] == 1
    assert [pose.joints.tolist() for pose in same] == [pose.joints.tolist() for pose in way]


def test_no_way_out_of_a_pen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transit, "OPTIONS", replace(transit.OPTIONS, max_iterations=100))
    pen = tuple(
        Box(name, np.array([*size, 1.0]), np.array([*middle, 0.7]))
        for name, size, middle in (
            ("north", (0.5, 0.02), (0.0, 0.24)),
            ("south", (0.5, 0.02), (0.0, -0.24)),
            ("east", (0.02, 0.5), (0.24, 0.0)),
            ("west", (0.02, 0.5), (-0.24, 0.0)),
        )
    )
    world = world_of("youbot", *pen)
    inside, outside = posed(world, np.zeros(3)), posed(world, np.array([-1.0, 0.0, 0.0]))
    assert scene_of(world).collision.clear(inside)
    assert carrier(world).folded(inside, outside, 0) is None
    assert carrier(world).sampled(inside, outside, 0) is None
    proximity = carrier(world).obstruction(inside, outside, 0)
    assert proximity is not None
    assert scene_of(world).collision.other(proximity) == "west"


def test_no_way_of_the_arm_axis_ends_where_only_a_heading_has_room() -> None:
    world = world_of("youbot")
    far = scene_of(world).ground.far
    inside, outside = (posed(world, np.array([2.0 - gap, 0.0, 0.0])) for gap in (far + 0.1, far - 0.01))
    assert len(carrier(world).driver.route(inside, inside, 0))
    with pytest.raises(NoPathError):
        carrier(world).driver.route(inside, outside, 0)


def test_short_ways_are_not_folded() -> None:
    world = world_of("youbot")
    here, there = posed(world, np.zeros(3), 0.1), posed(world, np.array([0.15, 0.0, 0.0]), 0.2)
    way = carrier(world).folded(here, there, 0)
    assert way is not None
    joints = np.array([pose.joints for pose in [here, *way, there]])
    assert (np.diff(joints[:, 0]) >= -1e-12).all()
    assert np.ptp(joints[:, 1:], axis=0).max() < 1e-12


SIDES = np.array([[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]])


def rolling(base: BaseKind, *solids: Solid) -> World:
    """A base of some length on wheels."""
    world = world_of("youbot", *solids)
    return replace(world, robot=replace(world.robot, base=base, footprint=SIDES, turning_radius=0.4))


def gap(world: World, base: np.ndarray, solid: Solid) -> float:
    """From the outline of a base to the shadow of a solid [m]."""
    c, s = np.cos(base[2]), np.sin(base[2])
    outline = shapely.Polygon(world.robot.footprint @ np.array([[c, s], [-s, c]]) + base[:2])
    shadow = solid.shadow(below=world.robot.body_height)
    assert shadow is not None
    return float(outline.distance(shadow.core)) - shadow.radius


@pytest.mark.parametrize("base", ["differential", "car"])
def test_wheels_retreat_along_their_heading_where_it_is_free(base: BaseKind) -> None:
    wall = Box("wall", np.array([0.1, 4.0, 0.3]), np.array([0.6, 0.0, 0.15]))
    world = rolling(base, wall)
    driver, here = carrier(world).driver, posed(world, np.zeros(3))
    (back,) = driver.retreats(here, 0.4, 0)  # straight ahead is the wall
    assert back[-1].base == pytest.approx([-0.4, 0.0, 0.0])
    assert all(gap(world, pose.base, wall) >= world.rules.clearance for pose in back)
    (still,) = driver.retreats(here, 0.0, 0)
    assert all(np.array_equal(pose.base, here.base) for pose in still)
    assert driver.inside(here, 0)
    assert not driver.inside(posed(world, np.array([0.3, 0.0, 0.0])), 0)
    assert (driver.extent(0) == [[-2, -2], [2, 2]]).all()


@pytest.mark.parametrize("base", ["differential", "car"])
def test_wheels_go_straight_to_another_posture_only_where_they_stand(base: BaseKind) -> None:
    world = rolling(base)
    driver, here = carrier(world).driver, posed(world, np.zeros(3))
    way = driver.direct(here, posed(world, np.zeros(3), 0.5, 0.5), 0)
    assert way
    assert all(np.array_equal(pose.base, here.base) for pose in way)
    assert driver.direct(here, posed(world, np.array([0.0, 0.2, 0.0])), 0) is None


@pytest.mark.parametrize("base", ["differential", "car"])
def test_a_berth_is_kept_all_the_way(base: BaseKind) -> None:
    post = Cylinder("post", 0.1, 0.3, np.array([0.0, 0.05, 0.15]))
    world = rolling(base, post)
    here, there = (posed(world, np.array([x, 0.0, 0.0])) for x in (-1.2, 1.2))
    route = carrier(world).driver.route(here, there, 0, 0.2)
    assert min(gap(world, pose, post) for pose in route) >= world.rules.clearance + 0.2


@pytest.mark.parametrize("spare", [0.01, 0.1, 0.3])
def test_ways_stay_on_the_floor_however_wide_their_berth(spare: float) -> None:
    post = Cylinder("post", 0.4, 0.3, np.array([0.0, 0.0, 0.15]))
    world = world_of("youbot", post)
    driver = carrier(world).driver
    floor = driver.free_space.pieces.polygon[0].buffer(1e-6)
    near, far = np.hypot(*np.array(floor.interiors[0].coords).T).max() + 1e-6, floor.bounds[2]
    berth = (np.sqrt(2) * far - near) / (1 + np.sqrt(2)) - spare  # which little more than the corners leave
    for angle in np.radians([20.0, 30.0, 40.0]):
        ends = [near * np.array([np.cos(at), np.sin(at)]) for at in np.pi / 4 + np.array([-angle, angle])]
        assert not floor.covers(shapely.LineString(ends))  # the post is between
        here, there = (posed(world, pose_of(world.robot, end, 0.0)) for end in ends)
        assert floor.covers(shapely.LineString(driver.route(here, there, 0, berth)))


def test_poses_apart_by_rounding_are_one_and_both_ends_stay() -> None:
    base, joints, hair = np.zeros(3), np.zeros(2), 2.5e-10
    first, second, last = (Pose(base + x, joints) for x in (0.0, 0.1, 0.2))
    near = [Pose(one.base + hair, one.joints - hair) for one in (first, second, last)]
    assert distinct([first, near[0], second, near[1], near[2], last]) == [first, second, last]
    assert distinct([first, near[0]]) == [first]


def test_a_base_on_wheels_is_searched_a_way_once_and_none_while_the_tool_is_on_its_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is asked of the sampling planner is counted: the wall has to be driven round."""
    wall, asked = Box("wall", np.array([0.1, 2.4, 0.3]), np.array([0.0, 0.0, 0.15])), list[int]()

    def connected(*given: Any, **options: Any) -> Array | None:
        asked.append(options["seed"])
        return connect_poses(*given, **options)

    monkeypatch.setattr(pose_planner, "connect_poses", connected)
    world = world_of("youbot", wall)
    car = replace(world, robot=replace(world.robot, base="car", turning_radius=0.3))
    here, there = posed(car, np.array([-1.0, 0.0, 0.0])), posed(car, np.array([1.0, 0.0, 0.0]))
    driver = WheeledDriver(scene_of(car), scene_of(car).free_floor.anywhere, 0)
    assert not list(WheeledPaths(driver).between(0, 0, here.base, there.base))
    assert not asked
    near = here.base + (-0.3, 0.0, 0.0)
    assert len(list(WheeledPaths(driver).between(0, 0, here.base, near))) == 3
    way = driver.route(here, there, 0)
    searched = len(asked)
    assert searched
    np.testing.assert_array_equal(driver.route(here, replace(there, joints=there.joints + 0.1), 0), way)
    assert len(asked) == searched
