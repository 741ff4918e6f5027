"""What M-FABRIK asks of an arm, asked of arms in one plane and of all others."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from regionik.areas.reachable import planar_reach, reach_model
from regionik.mfabrik import Solver
from regionik.planners.reach.level_reach import inner_reach, outer_reach
from regionik.postures.families import FRONT, Family
from regionik.postures.planar_solver import PlanarSolver
from regionik.postures.serial_solver import SerialSolver, serial_solver
from regionik.worlds.arms import reach_bound
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.robot import Robot, without_limits
from regionik.worlds.scene import Target
from tests.bodies import on_lift, with_lift
from tests.kinds import Heading
from tests.maths import Array, translation, wrap
from tests.measures import axis_of, pose_of

COUNT = 20
BARE = ("hinge5", "pioneer7")
SERIAL = (*BARE, "lifted")


def robot_of(name: str) -> Robot:
    if name == "lifted":
        return on_lift(robot_named("youbot-real"))
    return with_lift() if name == "lift" else robot_named(name)


def postures(robot: Robot, rng: np.random.Generator, count: int = COUNT) -> Array:
    low = np.where(np.isfinite(robot.chain.lower), robot.chain.lower, -np.pi)
    high = np.where(np.isfinite(robot.chain.upper), robot.chain.upper, np.pi)
    return rng.uniform(low, high, (count, robot.chain.dof))


def within(robot: Robot, joints: Array) -> bool:
    return bool((joints >= robot.chain.lower - 1e-9).all() and (joints <= robot.chain.upper + 1e-9).all())


@pytest.mark.parametrize("heading", ["free", "face_target", "fixed"])
@pytest.mark.parametrize("name", BARE)
def test_every_target_is_reached_wherever_it_is(name: str, heading: Heading) -> None:
    robot, rng = robot_named(name), np.random.default_rng(1)
    away = rng.uniform(-2, 2, (COUNT, 2))
    targets = robot.tool(np.column_stack([away, np.zeros(COUNT)]), postures(robot, rng))[:, :3, 3]
    bases, joints = rng.uniform(-1, 1, (COUNT, 3)), postures(robot, rng)
    solver = Solver(robot, heading=heading)
    found = solver.batch(targets, bases, joints)
    tools = robot.tool(found.base, found.joints)[:, :3, 3]
    errors = np.linalg.norm(tools - targets, axis=1)
    assert found.converged.all()
    assert errors.max() <= solver.tolerance * (1 + 1e-9)
    np.testing.assert_allclose(errors, found.error, atol=1e-12)
    turned = np.array([wrap(turn) for turn in found.base[:, 2] - bases[:, 2]])
    if heading == "face_target":
        assert (found.joints[:, 0] == 0.0).all()
    else:  # an endless pivot takes all of the turn
        assert np.abs(turned).max() < 1e-12
    for k in range(COUNT):
        one = solver(targets[k], bases[k], joints[k])
        np.testing.assert_array_equal(one.base, found.base[k])
        np.testing.assert_array_equal(one.joints, found.joints[k])
        assert (one.error, one.iterations) == (found.error[k], found.iterations[k])


@pytest.mark.parametrize("name", [*SERIAL, "youbot", "youbot-real"])
def test_hold_keeps_the_axis_and_the_limits(name: str) -> None:
    robot, rng = robot_of(name), np.random.default_rng(2)
    bases = rng.uniform(-1, 1, (COUNT, 3))
    targets = robot.tool(bases, postures(robot, rng))[:, :3, 3]
    solver = Solver(robot)
    reached = 0
    for target, base, joints in zip(targets, bases, postures(robot, rng), strict=True):
        found = solver.hold(target, base, joints)
        np.testing.assert_allclose(axis_of(robot, found.base), axis_of(robot, base), atol=1e-12)
        assert within(robot, found.joints)
        tool = robot.tool(found.base, found.joints)[:3, 3]
        if found.converged:
            assert np.linalg.norm(tool - target) <= solver.tolerance * (1 + 1e-9)
        reached += found.converged
    # A planar arm held in one family does not reach what only the other one does.
    assert reached == COUNT or (reach_model(robot, "point").exact and reached > COUNT / 2)


@pytest.mark.parametrize("name", SERIAL)
def test_the_base_stays_in_its_area(name: str) -> None:
    robot, rng = robot_of(name), np.random.default_rng(3)
    area = shapely.Point(0.3, -0.2).buffer(0.4) - shapely.box(0.2, -1, 0.4, 1)
    solver, reached = Solver(robot, area), 0
    for joints in postures(robot, rng):
        spot = rng.uniform([-0.1, -0.6], [0.7, 0.2])
        stand = pose_of(robot, spot, float(rng.uniform(-3, 3)))
        target = robot.tool(stand, postures(robot, rng, 1)[0])[:3, 3]
        found = solver(target, rng.uniform(-1, 1, 3), joints)
        assert area.distance(shapely.Point(axis_of(robot, found.base))) < 1e-9
        assert within(robot, found.joints)
        reached += found.converged
    assert reached > COUNT / 2


def test_both_ways_reach_the_same_targets() -> None:
    robot, rng = without_limits(robot_named("youbot")), np.random.default_rng(4)
    plane = planar_reach(robot).solver(Family(FRONT), 1e-4)
    assert isinstance(plane, PlanarSolver)
    # One roll more, and the arm is no longer read as planar.
    roll = Joint("more", "revolute", -np.pi, np.pi, translation(0, 0, 0))
    longer = Chain((*robot.chain.joints, roll), robot.chain.T_last_tool)
    chain = Chain((*robot.chain.joints[:-1], *longer.joints[-2:]), robot.chain.T_last_tool)
    serial = serial_solver(chain, 0.0, 1e-4)
    assert isinstance(serial, SerialSolver)
    nowhere = Solver(robot)._flat
    for _ in range(COUNT):
        target = np.array([*rng.uniform(-1, 1, 2), rng.uniform(0.0, 0.5)])
        axis, yaw, joints = rng.uniform(-1, 1, 2), float(rng.uniform(-3, 3)), postures(robot, rng, 1)[0]
        one = plane.reach(Target(target), axis, yaw, joints, nowhere, True)
        other = serial.reach(Target(target), axis, yaw, np.append(joints, 0.0), nowhere, True)
        for solver_chain, found in ((robot.chain, one), (chain, other)):
            tool = _tool(solver_chain, found.axis, yaw, found.joints)
            assert found.error <= 1e-4
            assert np.linalg.norm(tool - target) == pytest.approx(found.error, abs=1e-9)


def _tool(chain: Chain, axis: Array, yaw: float, joints: Array) -> Array:
    tool, (c, s) = chain.forward(joints)[:3, 3], (np.cos(yaw), np.sin(yaw))
    return np.array([axis[0] + c * tool[0] - s * tool[1], axis[1] + s * tool[0] + c * tool[1], tool[2]])


@pytest.mark.parametrize("name", [*SERIAL, "youbot", "youbot-real"])
def test_self_motion_is_of_many_kinds_and_on_target(name: str) -> None:
    robot = robot_of(name)
    base = np.array([0.2, 0.1, 0.4])
    low = robot.T_base_arm[2, 3] + reach_bound(robot.chain).height
    far = 0.6 * reach_bound(robot.chain).length
    target = np.array([*axis_of(robot, base), low]) + [far, 0.0, 0.1]
    found = Solver(robot).self_motion(target, base, robot.carry, 24)
    joints = np.array([one.joints for one in found])
    changes = np.abs(joints - robot.carry).max(axis=1)
    chain = robot.chain
    near = (np.minimum(joints - chain.lower, chain.upper - joints) < chain.spare).any(axis=1)
    assert len(found) >= 3
    assert (np.diff(near.astype(int)) >= 0).all()  # those next to a limit come last
    assert all((np.diff(changes[near == some]) >= 0).all() for some in (False, True))
    assert np.abs(joints[:, None] - joints).max(axis=2)[~np.eye(len(found), dtype=bool)].min() > 1e-3
    for one in found:
        tool = robot.tool(one.base, one.joints)[:3, 3]
        assert np.linalg.norm(tool - target) <= 1e-3 * (1 + 1e-9)
        assert within(robot, one.joints)
        np.testing.assert_allclose(axis_of(robot, one.base), axis_of(robot, base), atol=1e-12)


@pytest.mark.parametrize("name", [*BARE, "youbot"])
def test_least_change_goes_back_to_where_it_came_from(name: str) -> None:
    robot, rng = robot_of(name), np.random.default_rng(6)
    solver, base, near = Solver(robot), np.array([0.3, -0.1, 0.2]), 0
    for joints in postures(robot, rng):
        target = robot.tool(base, joints)[:3, 3]
        nudged = np.clip(
            joints + rng.uniform(-0.02, 0.02, joints.shape), robot.chain.lower, robot.chain.upper
        )
        found = solver.least_change(target, base, nudged)
        if found is None:
            continue
        tool = robot.tool(found.base, found.joints)[:3, 3]
        assert np.linalg.norm(tool - target) <= solver.tolerance * (1 + 1e-9)
        assert within(robot, found.joints)
        near += np.abs(found.joints - nudged).max() < 0.3
    assert near > COUNT / 3


@pytest.mark.parametrize("name", SERIAL)
def test_proven_reach_lies_within_its_bound_and_is_reached(name: str) -> None:
    robot = robot_of(name)
    span, mount = reach_bound(robot.chain), float(robot.mount[2])
    for rise in span.height + np.array([-0.3, 0.0, 0.5]) * span.length:
        bound = outer_reach(robot.chain, float(rise))
        rings = inner_reach(robot.chain, float(rise))
        assert rings
        assert (np.diff(np.array(rings).ravel()) > 0).all()
        assert bound[0][0] <= rings[0][0]
        assert rings[-1][1] <= bound[-1][1]
        solver = Solver(robot)
        for low, high in rings:
            for away in np.linspace(low + 0.005, high - 0.005, 5):
                base = pose_of(robot, np.zeros(2), 0.0)
                assert solver.hold([away, 0.0, mount + rise], base, robot.carry).converged
    beyond = span.height + span.length + 0.01
    assert inner_reach(robot.chain, beyond) == outer_reach(robot.chain, beyond) == ()


@pytest.mark.parametrize("name", [*SERIAL, "youbot", "youbot-real"])
def test_the_tool_never_leaves_its_span(name: str) -> None:
    robot = robot_of(name)
    span = reach_bound(robot.chain)
    tools = robot.chain.forward(postures(robot, np.random.default_rng(7), 500))[:, :3, 3]
    away = np.hypot(tools[:, 0], tools[:, 1])
    # The ball turns about the pivot: nearest at one of its two places in the plane of tool and pivot.
    gaps = [np.hypot(away - side * span.radius, tools[:, 2] - span.height) for side in (1, -1)]
    assert (np.minimum(*gaps) <= span.length + 1e-9).all()
