"""The arm keeps clear of the floor: in every check of a posture, in verification, and in what is said."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

import regionik as rik
from regionik.output.urdf import robot_to_urdf
from regionik.pipeline import plan, why
from regionik.planners.avoidance.avoiding_fabrik import links_clear
from regionik.planners.collision.proximity import nearest
from regionik.postures.collision_checker import MAX_SPARE
from regionik.postures.poses import Pose
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from regionik.worlds.self_collision import off_floor, postures_off_floor, rest_posture
from tests import examples
from tests.maths import Array
from tests.opinion.judge import posture_objections
from tests.plans import motion_of, plan_of, plan_to_document, world_of
from tests.retold import facts_of

HALL = Floor(shapely.box(-3, -3, 3, 3))
HERE = np.zeros(3)


def alone(name: str = "youbot") -> Robot:
    """A robot whose links may pass through one another, so that the floor alone decides."""
    robot = robot_named(name)
    return replace(robot, unchecked=tuple(combinations([solid.name for solid in robot.solids], 2)))


ROBOT = alone()


def lowest(joints: Array) -> float:
    """Height of the lowest point of the links that must keep off the floor [m]."""
    frames = ROBOT.frames(HERE, joints)
    heights = [
        (solid.corners @ frames[solid.link, 2, :3] + frames[solid.link, 2, 3]).min() - solid.radius
        for solid, heeds in zip(ROBOT.solids, off_floor(ROBOT), strict=True)
        if heeds
    ]
    return float(min(heights))


def posture(seed: int) -> Array:
    values: Array = np.random.default_rng(seed).uniform(ROBOT.chain.lower, ROBOT.chain.upper)
    return values


def at_rest(joints: Array, **rules: float) -> Plan:
    """A plan of one state."""
    motion = motion_of([(HERE, joints, "setpoint", 0)])
    return plan_of(world_of(motion, robot=ROBOT, rules=Rules(clearance=0.0, **rules)), motion)  # type: ignore[arg-type]


def test_links_that_stand_on_the_floor_need_not_keep_off_it() -> None:
    assert off_floor(ROBOT) == (False, True, True, True)  # the first turns on the pivot alone
    sunk = replace(ROBOT, mount=np.array([0.0, 0.0, -0.2, 0.0]))
    assert off_floor(sunk) == (False, False, True, True)  # the second is never out of it


def test_arms_are_not_carried_in_the_floor() -> None:
    """On a low mount zeros dip into the floor."""
    low = replace(ROBOT, mount=np.array([0.0, 0.0, -0.1, 0.0]))
    rest = rest_posture(low)
    assert rest is not None
    assert postures_off_floor(low, rest[None], 0.01).all()
    assert not postures_off_floor(low, np.zeros((1, 5)), 0.0).any()
    assert postures_off_floor(low, rest[None], 9.0).tolist() == [False]


@settings(max_examples=examples(60), deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.04]))
@example(471, 0.04)  # two links deep in the floor, the second the deeper
def test_all_checks_agree_with_the_height_of_the_lowest_point(seed: int, clearance: float) -> None:
    joints = posture(seed)
    made = at_rest(joints, arm_clearance=clearance, tool_contact=0.0)
    room, collision = lowest(joints) - clearance, scene_of(made.world).collision
    if abs(room - MAX_SPARE) < 1e-5 or abs(room) < 1e-5:
        return
    assert collision.clear(Pose(HERE, joints)) == (room > MAX_SPARE)
    proximity = nearest(collision.bodies, HERE, joints)
    assert proximity.distance == pytest.approx(room + clearance, abs=1e-6)
    clear = links_clear(collision.bodies, HERE, np.full(3, 9.0), 0.0)
    frames = ROBOT.chain.frames(joints)
    assert all(clear(k, frames[k]) for k in range(5)) == (room > 0)
    assert verify(made).ok == (room > 0)
    document, urdf = plan_to_document(made), robot_to_urdf(ROBOT, HALL.polygon)
    assert bool(posture_objections(document, urdf, facts_of(ROBOT))) == (room < 0)


def test_what_is_not_solid_stops_nothing() -> None:
    joints = next(one for one in map(posture, range(99)) if lowest(one) < -0.1)
    assert verify(at_rest(joints, solid_floor=False)).ok
    found = verify(at_rest(joints, tool_contact=0.0)).violations
    assert {one.kind for one in found} == {"arm"}
    assert all("overlaps the floor by" in one.text for one in found)


def test_a_dip_between_two_states_is_found() -> None:
    """The arm turns over about its shoulder, through a posture in which it hangs down."""
    ahead, back = np.array([0.0, 0.4, 0.0, 1.57, 0.0]), np.array([0.0, -0.4, 0.0, 1.57, 0.0])
    free = replace(ROBOT.chain.joints[1], lower=-np.pi, upper=np.pi)
    chain = replace(ROBOT.chain, joints=(ROBOT.chain.joints[0], free, *ROBOT.chain.joints[2:]))
    raised = replace(ROBOT, chain=chain, mount=np.array([0.0, 0.0, 0.3, 0.0]))
    motion = motion_of([(HERE, ahead, "setpoint", 0), (HERE, back, "transit", -1)])
    rules = Rules(clearance=0.0, tool_contact=0.0)
    world = world_of(motion, robot=raised, rules=rules)
    ends = [Pose(HERE, ahead), Pose(HERE, back)]
    assert verify(plan_of(world, motion, 1)).ok == (scene_of(world).collision.first_obstruction(ends) is None)
    low = replace(world, robot=replace(raised, mount=np.zeros(4)))
    stopped = scene_of(low).collision.first_obstruction(ends)
    assert stopped is not None
    assert scene_of(low).collision.cause(stopped).kind == "floor"


@pytest.mark.parametrize(("depth", "holds"), [(0.0, False), (0.036, True)])
def test_a_tool_may_touch_the_floor_as_deep_as_the_rules_say(depth: float, holds: bool) -> None:
    """The set-point lies on the floor; the last link ends round in the tool point, 35 mm thick."""
    low, high = 0.0, 1.5
    while high - low > 1e-9:
        bend = (low + high) / 2
        joints = np.array([0.0, bend, -bend, 0.0, 0.0])
        low, high = (low, bend) if ROBOT.chain.forward(joints)[2, 3] > 0 else (bend, high)
    report = verify(at_rest(np.array([0.0, low, -low, 0.0, 0.0]), contact_depth=depth, tool_contact=0.3))
    assert report.ok == holds
    assert np.isfinite(report.margins["contact"])


def test_a_target_below_the_floor_is_unreachable_and_told() -> None:
    target = Target(np.array([0.5, 0.0, -0.05]))
    hall = World("hall", robot_named("youbot"), HALL, task=(target,))
    assert reach(hall, [target]).verdict == ("unreachable",)
    assert reach(replace(hall, rules=Rules(solid_floor=False)), [target]).verdict == ("reachable",)
    found = why(hall, target)
    assert found is not None
    assert "the floor" in found.reason
    assert {cause.kind for cause in found.causes} == {"floor"}


LINE = tuple(Target(spot) for spot in np.linspace([0.5, 0.0, 0.25], [1.8, 0.1, 0.25], 4))
YARD = Floor(shapely.box(-0.5, -1.5, 3, 1.5))
ROOM = World("room", robot_named("youbot"), YARD, task=LINE, rules=Rules(clearance=0.1))
CORNERS = np.array([[1.0, 0.0, -0.02], [1.4, 0.0, -0.3], [1.0, 0.4, -0.3], [0.7, -0.3, -0.3]])
UNDER = (
    Box("pit", np.array([1.0, 1.0, 0.5]), np.array([1.0, 0.0, -0.3])),
    Box("pipe", np.array([0.5, 2.9, 0.005]), np.array([1.2, 0.0, -0.01])),
    Sphere("ball of earth", 0.5, np.array([1.0, 0.0, -0.501])),
    Cylinder("shaft up to the floor", 0.3, 1.0, np.array([1.0, 0.0, -0.5])),
    Prism("trench", np.array([[0.8, -1.4], [1.2, -1.4], [1.2, 1.4]]), -0.4, -0.001),
    Mesh("stone", CORNERS, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])),
)


@pytest.fixture(scope="module")
def driven() -> Plan:
    return plan(ROOM)


@pytest.mark.parametrize("sunk", UNDER, ids=[solid.name for solid in UNDER])
def test_what_lies_under_the_floor_is_in_nobodys_way(sunk: Solid, driven: Plan) -> None:
    """It cut the base off, and set-points over it were said to be unreachable."""
    world = replace(ROOM, obstacles=(sunk,))
    for target in LINE:
        mine, bare = rik.admissible_area(world, target), rik.admissible_area(ROOM, target)
        assert mine.inner.equals(bare.inner)
        assert mine.outer.equals(bare.outer)
    assert reach(world, LINE).reachable.all()
    assert why(world) is None
    assert verify(replace(driven, world=world)).ok
    bottomless = replace(world, rules=replace(world.rules, solid_floor=False))
    assert scene_of(bottomless).world.solids == (sunk,)


def test_a_pit_under_the_floor_changes_neither_plan_nor_stops(driven: Plan) -> None:
    world = replace(ROOM, obstacles=UNDER[:1])
    np.testing.assert_array_equal(plan(world).motion.base, driven.motion.base)
    parked = replace(ROOM, rules=replace(ROOM.rules, mode="stops"))
    mine, bare = rik.stops(replace(parked, obstacles=UNDER[:1])), rik.stops(parked)
    assert [stop.setpoints for stop in mine] == [stop.setpoints for stop in bare]
