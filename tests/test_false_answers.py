"""Answers that were false once: plans that held and should not, areas too large, proofs of too little."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
import trimesh

from regionik.pipeline import plan
from regionik.reachability.reach import reach
from regionik.regions import admissible_area, is_ruled_out, outer_areas
from regionik.scene import scene_of
from regionik.timing.trajectory import trajectory
from regionik.values import Plan, Stop
from regionik.verification.base_clearance import footprint_hulls
from regionik.verification.motion import MotionSegments
from regionik.verification.speeds import deviations
from regionik.verification.timed_segments import timed_segments
from regionik.verification.verifier import verify, verify_answers
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.joints import Joint
from regionik.worlds.limits import Execution, ParkingAccuracy, Speeds
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box, Mesh, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.maths import Array, translation
from tests.plans import motion_of, of_kind, plan_of

FLOOR = Floor([[-3, -3], [3, -3], [3, 3], [-3, 3]])
QUICK = Speeds(joint_velocity=50, joint_acceleration=500, base_velocity=50, base_acceleration=500)


def level_robot(footprint: Array | None = None) -> Robot:
    """An arm of two hinges in one level plane."""
    joints = (
        Joint("j1", "revolute", -3, 3, np.eye(4)),
        Joint("j2", "revolute", -2.5, 2.5, translation(0.5, 0, 0)),
    )
    chain = Chain(joints, translation(0.5, 0, 0))
    outline = np.zeros((1, 2)) if footprint is None else footprint
    return Robot("level", "omni", outline, np.array([0, 0, 0.5, 0]), chain, capsules_along(chain, 0.03))


def lifted(robot: Robot, base: Array, joints: Array, *solids: Sphere, **rules: Any) -> Plan:
    """Two set-points, and states between them with the tool lifted."""
    kinds = ["setpoint", *["transit"] * len(base), "setpoint"]
    owners = [0, *[-1] * len(base), 1]
    rows = [0, *range(len(base)), len(base) - 1]
    motion = motion_of([(base[k], joints[k], *of) for k, *of in zip(rows, kinds, owners, strict=True)])
    task = tuple(Target(robot.tool(base[k], joints[k])[:3, 3]) for k in (0, -1))
    world = World(
        "by hand", robot, FLOOR, solids, task, Rules(clearance=0.0, step=0.1, solid_floor=False, **rules)
    )
    return plan_of(world, motion, lift_offs=1)


def timed(found: Plan, times: Array, speeds: Speeds) -> Plan:
    time = np.concatenate([times[:1], times, times[-1:]])
    return replace(found, world=replace(found.world, speeds=speeds), motion=replace(found.motion, time=time))


def test_times_by_which_joints_leave_the_proven_motion_are_named() -> None:
    """Monotone cubics through states far apart bend away from the lines between them."""
    joints, times = np.array([[-1.0, -1.0], [0.0, 1.0], [1.0, -1.0]]), np.array([0.0, 2.0, 4.0])
    found = timed(lifted(level_robot(), np.zeros((3, 3)), joints), times, QUICK)
    assert "may be" in of_kind(verify(found), "timing")[0].text
    sample = trajectory(found).sample(np.linspace(0, 4, 401))
    line = np.concatenate([a + np.linspace(0, 1, 400)[:, None] * (b - a) for a, b in pairwise(joints)])
    robot = found.world.robot
    tools, proven = (robot.tool(np.zeros((len(q), 3)), q)[:, :3, 3] for q in (sample.joints, line))
    off = np.linalg.norm(tools[:, None] - proven, axis=2).min(axis=1).max()
    segments = MotionSegments(robot, found.motion)
    bound = deviations(segments, timed_segments(segments, QUICK), 0.0).max()
    assert 0.1 < off < bound


def test_splines_that_swing_beyond_their_states_are_named() -> None:
    x = np.array([*np.arange(0, 0.96, 0.05), 0.99, 0.99, 0.95, 0.9, 0.85])
    base, joints = np.column_stack([x, 0 * x, 0 * x]), np.column_stack([np.linspace(0, 0.3, len(x)), 0 * x])
    span = np.full(len(x) - 1, 0.1)
    span[20] = 1.0
    jerks = replace(QUICK, joint_jerk=5000, base_jerk=1e5)
    found = timed(lifted(level_robot(), base, joints), np.concatenate([[0], np.cumsum(span)]), jerks)
    moving = trajectory(found)
    assert moving.sample(np.linspace(0, moving.duration, 2000)).base[:, 0].max() > 1.05
    of_kind(verify(found), "timing")


@pytest.mark.parametrize("turn", [np.pi, -np.pi])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_half_a_turn_is_proven_the_way_that_it_is_driven(turn: float, side: float) -> None:
    robot = level_robot()
    ball = Sphere("ball", 0.2, np.array([0, side, 0.5]))
    found = lifted(robot, np.array([[0, 0, 0], [0, 0, turn]]), np.zeros((2, 2)), ball)
    here, there = found.motion.base[1:3]
    bases = robot.drive.between(here, there, np.linspace(0, 1, 50))
    meets = min(ball.distance(tool) for tool in robot.tool(bases, np.zeros((50, 2)))[:, :3, 3]) < 0
    assert verify(found).ok != meets


def test_a_sheet_in_a_mesh_is_in_the_way() -> None:
    crate = trimesh.creation.box([0.2, 0.2, 0.3])
    corners = np.array([[0.5, -2.9, 0], [0.5, 2.0, 0], [0.5, 2.0, 0.3], [0.5, -2.9, 0.3]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 0, 3], [1, 3, 2]])
    away = crate.vertices + [2.5, 2.5, 0.15]
    mesh = Mesh("panel", np.vstack([corners, away]), np.vstack([faces, np.asarray(crate.faces) + 4]))
    square = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    robot = level_robot(square)
    joints = np.zeros(2)
    task = tuple(Target(robot.tool([x, 0, 0], joints)[:3, 3]) for x in (-1.5, 1.5))
    world = World(
        "sheet", robot, FLOOR, (mesh,), task, Rules(clearance=0.05), Start(np.array([-1.5, 0, 0]), joints)
    )
    sheet = shapely.LineString(corners[:2, :2])
    found = plan(world)
    assert shapely.distance(footprint_hulls(robot, found.motion.base), sheet).min() >= 0.05 - 1e-5


def test_an_obstacle_is_turned_by_a_number() -> None:
    with pytest.raises(InputError, match="crate: yaw"):
        Box("crate", np.ones(3), np.zeros(3), yaw=np.nan)


def standing(*, yaw: float = 0.0, kind: str = "transit", promised: float = 0.1, **rules: Any) -> Plan:
    """Two stops of one set-point each, 8 cm apart."""
    robot, joints, owner = level_robot(), np.array([0.5, 1.0]), -1 if kind == "transit" else 0
    bases = np.array([[0, 0, 0], [0.08, 0, yaw]])
    kinds = ["setpoint", kind, kind, "setpoint"]
    rows = zip((0, 0, 1, 1), kinds, (0, owner, owner, 1), strict=True)
    motion = motion_of([(bases[k], joints, *of) for k, *of in rows])
    task = tuple(Target(robot.tool(base, joints)[:3, 3]) for base in bases)
    asked = Rules(**{"clearance": 0.0, "mode": "stops", "stop_tolerance": 0.1, **rules})
    found = plan_of(World("stops", robot, FLOOR, (), task, asked), motion, lift_offs=int(kind == "transit"))
    return replace(
        found, stops=tuple(Stop(base, (i,), promised, "tolerance") for i, base in enumerate(bases))
    )


def test_stops_promise_what_the_rules_ask_for() -> None:
    assert verify(standing()).ok
    for promised in (0.05, -5.0, np.nan):
        assert "asked for are 0.1 m" in of_kind(verify(standing(promised=promised)), "stops")[0].text
    parked = ParkingAccuracy(np.diag([1e-6] * 3), probability=0.9)
    assert "promises no probability" in of_kind(verify(standing(parking=parked)), "stops")[0].text


def test_the_base_drives_from_stop_to_stop_with_the_tool_lifted() -> None:
    assert "not lifted" in of_kind(verify(standing(kind="step")), "stops")[0].text


def test_a_fixed_heading_holds_at_stops_too() -> None:
    assert verify(standing(heading="fixed")).ok
    of_kind(verify(standing(heading="fixed", yaw=0.5)), "heading")


def test_answers_of_worlds_done_from_stops_are_verified() -> None:
    spots = np.array([[0.5, 0.2, 0.5]])
    world = World("stops", level_robot(), FLOOR, (), (Target(spots[0]),), Rules(clearance=0.0, mode="stops"))
    answer = reach(world, spots)
    assert answer.reachable[0]
    assert verify_answers(world, answer).ok


def hinged(*limits: tuple[float, float], pivot: tuple[float, float] = (-2.0, 2.0)) -> Robot:
    links = zip((0.4, 0.3, 0.2), limits, strict=True)
    rows = [(0, 0.2, 0, -np.pi / 2, *pivot), *((0, 0, length, 0, *ends) for length, ends in links)]
    return Robot("hinged", "omni", np.zeros((1, 2)), np.array([0, 0, 0.2, 0]), Chain.from_dh(rows), ())


def world_with(robot: Robot, *task: Target, start: Start | None = None, **rules: Any) -> World:
    return World("degenerate", robot, FLOOR, (), task, Rules(**{"avoidance": False, **rules}), start)


POSTURE, BASE = np.array([0.3, -0.6, 0.5, 0.4]), np.array([0.3, 0.1, 0.7])


@pytest.mark.parametrize(
    ("robot", "heading"),
    [
        (hinged((-2, 2), (0.5, 0.5), (0.4, 0.4)), "free"),
        (hinged((-0.6, -0.6), (0.5, 0.5), (0.4, 0.4)), "free"),
        (hinged((-2, 2), (-2, 2), (-1, 1), pivot=(0.3, 0.3)), "fixed"),
    ],
)
def test_joints_that_their_limits_hold_still_leave_outer_areas(robot: Robot, heading: str) -> None:
    spot = robot.tool(BASE, POSTURE)[:3, 3]
    start = Start(BASE, POSTURE) if heading == "fixed" else None
    world = world_with(robot, Target(spot), start=start, heading=heading)
    assert not is_ruled_out(scene_of(world))
    assert shapely.distance(outer_areas(scene_of(world), world.task)[0], shapely.Point(BASE[:2])) < 1e-5
    assert reach(world, spot[None]).verdict[0] != "unreachable"


@pytest.mark.parametrize("height", [0.1, 0.35, 0.7])
def test_an_arm_that_cannot_rise_reaches_its_own_height(height: float) -> None:
    chain = Chain((Joint("pivot", "revolute", -2, 2, np.eye(4)),), translation(0.3, 0, 0.3))
    robot = Robot("beam", "omni", np.zeros((1, 2)), np.array([0, 0, height, 0]), chain, ())
    spot = robot.tool(BASE, np.array([0.2]))[:3, 3]
    assert reach(world_with(robot), spot[None]).verdict[0] != "unreachable"


@pytest.mark.parametrize("error", [0.0, 0.01, 0.1])
def test_inner_areas_lie_within_outer_ones_however_far_headings_are_off(error: float) -> None:
    robot = hinged((-2, 2), (-2, 2), (-1, 1), pivot=(-0.02, 0.02))
    off = Execution(heading_error=error)
    area = admissible_area(world_with(robot, heading="fixed", execution=off), np.array([0.9, 0.0, 0.5]))
    assert shapely.area(shapely.difference(area.inner, area.outer)) < 1e-9
    assert area.inner.is_empty == (error > 0.02)


def test_an_arm_that_faces_its_target_has_no_proven_area_where_its_base_cannot() -> None:
    quarter, turns = np.pi / 2, (-2.5, 2.5)
    rows = [
        (0, 0.3, 0, -quarter),
        (0, 0, 0.45, 0),
        (0, 0, 0.4, 0),
        (0, 0.1, 0, quarter),
        (0, 0.1, 0, -quarter),
    ]
    chain = Chain.from_dh([*((*row, *turns) for row in rows), (0, 0.08, 0, 0, -3, 3)])
    outline = np.array([[-0.4, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.4, 0.2]])
    robot = Robot("six", "omni", outline, np.array([0, 0, 0.2, 0]), chain, ())
    T = robot.tool(np.zeros(3), np.array([quarter, -0.9, 1.2, -0.4, 0.8, 0.3]))
    target = Target(T[:3, 3], direction=T[:3, 2], cone=0.4)
    corridor = Floor([[-2, -0.25], [2, -0.25], [2, 0.25], [-2, 0.25]])
    free, faced = (
        admissible_area(
            World("aisle", robot, corridor, (), (target,), Rules(heading=heading, clearance=0.0)), target
        )
        for heading in ("free", "face_target")
    )
    assert free.inner.area > 0.05
    assert faced.inner.is_empty


def test_the_circle_to_park_in_that_is_advised_is_found() -> None:
    half = 0.03457
    strip = Floor([[-0.5, -half], [0.3, -half], [0.3, half], [-0.5, half]])
    robot = hinged((-2, 2), (-2, 2), (-1, 1))
    world = replace(
        world_with(robot, Target(np.array([0.6, 0, 0.4])), mode="stops", stop_tolerance=0.05), floor=strip
    )
    with pytest.raises(NoPlanFound) as refused:
        plan(world)
    advised = float(str(refused.value).split("A stop_tolerance of at most ")[1].split(" m")[0])
    assert 0.033 < advised < half
    plan(replace(world, rules=replace(world.rules, stop_tolerance=advised)))
