"""Tools that must point somewhere or be turned some way, with every kind of arm: laws of what is planned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.mfabrik import Solver
from regionik.pipeline import plan
from regionik.postures.arm import goal_between
from regionik.regions import admissible_area, path_areas
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.maths import Array, rot_x, rot_z
from tests.measures import axis_of, deviation, goal_error

FLOOR = Floor(shapely.box(-2, -2, 4, 3))
AT_WALL = np.column_stack([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])  # the tool's z axis along -y
WALL = Box("wall", np.array([4.5, 0.1, 1.4]), np.array([1.75, -0.05, 0.7]))


def six_axes() -> Robot:
    """An industrial arm of six axes on a base that drives any way."""
    h, far = np.pi / 2, 6.2
    rows = [
        (0, 0.1625, 0, h, -far, far),
        (0, 0, -0.425, 0, -far, far),
        (0, 0, -0.3922, 0, -3.1, 3.1),
        (0, 0.1333, 0, h, -far, far),
        (0, 0.0997, 0, -h, -far, far),
        (0, 0.0996, 0, 0, -far, far),
    ]
    chain = Chain.from_dh(rows)
    corners = np.array([[0.3, 0.25], [-0.3, 0.25], [-0.3, -0.25], [0.3, -0.25]])
    carry = np.array([0, -2.2, 2.2, -1.5, -1.5, 0])
    mount = np.array([0.1, 0, 0.3, 0])
    return Robot("six axes", "omni", corners, mount, chain, capsules_along(chain, 0.04), 0.3, carry)


def robot_of(name: str) -> Robot:
    return six_axes() if name == "six axes" else robot_named(name)


def with_roll(robot: Robot, lower: float, upper: float) -> Robot:
    *others, last = robot.chain.joints
    last = replace(last, lower=lower, upper=upper)
    return replace(robot, chain=Chain((*others, last), robot.chain.T_last_tool))


def wave(count: int, height: float, far: float) -> Array:
    share = np.linspace(0, 1, count)
    return np.column_stack([0.3 + far * share, np.zeros(count), height + 0.03 * np.sin(7 * share)])


def tools_on_the_way(found: Plan) -> list[tuple[Target, Array]]:
    """Tool frames at the states between set-points, with what is asked there."""
    motion, task = found.motion, found.world.task
    frames = found.world.robot.tool(motion.base, motion.joints)
    return [
        (task[i], frame) for i, kind, frame in zip(motion.setpoint, motion.kind, frames, strict=True)
        if kind == "setpoint"
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["youbot", "six axes"])
def test_a_wall_is_sprayed_with_the_tool_turned_as_asked(name: str) -> None:
    robot, height = (robot_named("youbot"), 0.3) if name == "youbot" else (six_axes(), 0.8)
    task = tuple(Target(spot, cone=0.2, orientation=AT_WALL) for spot in wave(9, height, 0.5))
    start = Start(np.array([0.3, 1.2, 0.0]), robot.carry)
    rules = Rules(clearance=0.05, tool_contact=0.1, contact_depth=0.04)  # as thick as the last links are
    found = plan(World("spray", robot, FLOOR, (WALL,), task, rules, start))
    report = verify(found)
    assert report.ok
    assert found.lift_offs == 0
    assert report.margins["orientation"] > 0
    for target, frame in tools_on_the_way(found):
        error, angle = goal_error(target, frame)
        assert error <= 1e-3 + 1e-9
        assert angle <= target.cone + 1e-9


@pytest.mark.parametrize(("name", "height", "lean"), [("pioneer7", 0.2, 0.0), ("hinge5", 0.16, -2.0)])
def test_an_arm_in_no_plane_points_its_tool(name: str, height: float, lean: float) -> None:
    robot = robot_named(name)
    ways = [np.array([np.cos(a), np.sin(a), lean]) for a in np.linspace(0.0, 0.4, 6)]
    task = tuple(Target(p, d, 0.2) for p, d in zip(wave(6, height, 0.15), ways, strict=True))
    found = plan(World("point", robot, FLOOR, (), task, Rules(clearance=0.05)))
    assert verify(found).ok
    assert all(goal_error(target, frame)[1] <= 0.2 + 1e-9 for target, frame in tools_on_the_way(found))


def test_a_tool_across_the_last_link_takes_a_direction() -> None:
    robot = robot_named("youbot")
    chain = replace(robot.chain, T_last_tool=robot.chain.T_last_tool @ rot_x(np.pi / 2))
    task = tuple(Target(p, np.array([0, 0, -1.0]), 0.1) for p in wave(3, 0.25, 0.05))
    assert verify(plan(World("across", replace(robot, chain=chain), FLOOR, (), task))).ok
    turned = World("fixed", replace(robot, chain=chain), FLOOR, (), task, Rules(heading="fixed"))
    assert verify(plan(turned)).ok


def test_a_turn_beyond_the_roll_is_explained() -> None:
    robot = with_roll(robot_named("youbot"), -0.2, 0.2)
    reasons = []
    for quarter in range(2):
        task = (
            Target(
                np.array([0.3, 0, 0.3]), cone=0.1, orientation=AT_WALL @ rot_z(np.pi / 2 * quarter)[:3, :3]
            ),
        )
        try:
            assert verify(plan(World("roll", robot, FLOOR, (), task))).ok
        except NoPlanFound as failure:
            reasons.append(failure.explanation)
    assert len(reasons) == 1
    assert reasons[0].verdict == "unreachable"
    assert reasons[0].causes[0].kind == "direction"
    assert "turned about its axis" in reasons[0].reason
    assert "not proven" not in reasons[0].reason


def test_a_direction_out_of_reach_is_explained() -> None:
    down = Target(np.array([0.3, 0, 0.6]), np.array([0, 0, -1.0]), 0.1)
    for target, what in (
        (down, "tool direction"),
        (Target(down.position, cone=0.1, orientation=rot_x(np.pi)[:3, :3]), "axis as its"),
    ):
        with pytest.raises(NoPlanFound) as failure:
            plan(World("high", robot_named("youbot"), FLOOR, (), (target,)))
        assert what in failure.value.explanation.reason


@pytest.mark.parametrize("name", ["youbot", "youbot-real", "pioneer7", "hinge5", "six axes"])
@pytest.mark.parametrize("kind", ["direction", "orientation"])
def test_places_of_the_inner_area_truly_serve(name: str, kind: str) -> None:
    """Targets made from postures: the solver meets them from places all over their areas."""
    robot, rng = robot_of(name), np.random.default_rng(5)
    low = np.where(np.isfinite(robot.chain.lower), robot.chain.lower, -np.pi)
    high = np.where(np.isfinite(robot.chain.upper), robot.chain.upper, np.pi)
    asked, met, areas = 0, 0, 0
    for q in rng.uniform(low, high, (6, robot.chain.dof))[:3]:
        frame = robot.tool(np.zeros(3), q)
        turn = frame[:3, :3]
        target = Target(frame[:3, 3], cone=0.2, orientation=turn)
        if kind == "direction":
            target = Target(frame[:3, 3], turn[:, 2], 0.2)
        world = World("bare", robot, FLOOR)
        spot = axis_of(robot, np.zeros(3))
        assert admissible_area(world, target).outer.distance(shapely.Point(spot)) < 1e-6  # q itself proves it
        rows = path_areas(scene_of(world), [target])
        areas += len(rows.inner) > 0
        for part, family in zip(rows.inner, rows.family, strict=True):
            base = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-3, 3)])
            found = Solver(robot, part, family=family)(target, base, robot.carry)
            asked, met = asked + 1, met + found.converged
            error, angle = goal_error(target, robot.tool(found.base, found.joints))
            if found.converged:
                assert part.distance(shapely.Point(axis_of(robot, found.base))) < 1e-9
                assert error <= 1e-3 * (1 + 1e-9)
                assert angle <= target.cone + 1e-9
            within = (found.joints >= robot.chain.lower - 1e-9) & (found.joints <= robot.chain.upper + 1e-9)
            assert within.all()
    assert areas == 3
    assert met == asked


@pytest.mark.parametrize("name", ["youbot", "pioneer7", "six axes"])
def test_a_solver_without_an_area_brings_the_base_along(name: str) -> None:
    robot, rng = robot_of(name), np.random.default_rng(6)
    low = np.where(np.isfinite(robot.chain.lower), robot.chain.lower, -np.pi)
    high = np.where(np.isfinite(robot.chain.upper), robot.chain.upper, np.pi)
    met = 0
    targets = []
    for q in rng.uniform(low, high, (12, robot.chain.dof)):
        frame = robot.tool(np.array([*rng.uniform(-1, 1, 2), rng.uniform(-3, 3)]), q)
        targets.append(Target(frame[:3, 3], cone=0.1, orientation=frame[:3, :3]))
    bases, joints = np.zeros((12, 3)), np.tile(robot.carry, (12, 1))
    many = Solver(robot).batch(targets, bases, joints)
    for k, target in enumerate(targets):
        one = Solver(robot)(target, bases[k], joints[k])
        np.testing.assert_array_equal(one.joints, many.joints[k])
        error, angle = goal_error(target, robot.tool(one.base, one.joints))
        assert one.converged == (error <= 1e-3 * (1 + 1e-9) and angle <= 0.1 + 1e-9)
        met += one.converged
    assert met >= 9


def test_what_is_asked_between_two_targets_turns_evenly() -> None:
    rng = np.random.default_rng(7)
    for _ in range(50):
        turn = rot_z(rng.uniform(-3, 3))[:3, :3] @ rot_x(rng.uniform(-3, 3))[:3, :3]
        spin = rot_x(rng.uniform(-2, 2))[:3, :3]
        for a, b in (
            (
                Target(rng.normal(size=3), cone=0.1, orientation=turn),
                Target(rng.normal(size=3), orientation=turn @ spin),
            ),
            (Target(rng.normal(size=3), turn[:, 2], 0.1), Target(rng.normal(size=3), (turn @ spin)[:, 2])),
        ):
            frame = np.eye(4)
            frame[:3, :3] = turn @ spin
            whole = deviation(a, frame[:3, :3])
            for share in (0.0, 0.3, 1.0):
                asked = goal_between(a, b, share)
                assert deviation(asked, frame[:3, :3]) == pytest.approx((1 - share) * whole, abs=1e-9)
                assert deviation(asked, turn) == pytest.approx(share * whole, abs=1e-9)
                np.testing.assert_allclose(asked.position, (1 - share) * a.position + share * b.position)
    bare = Target(np.zeros(3))
    assert goal_between(a, bare, 0.5).direction is None
    assert goal_between(a, bare, 0.0) is a
