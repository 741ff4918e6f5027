"""FABRIK-R's passes: plain FABRIK in the plane, rigid bodies everywhere, the paper's tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.tables.batch import solve_batch
from benchmarks.tables.goals import aim_at, solve_goal
from regionik.planners.solvers.fabrikr import (
    backward_pass,
    backward_step,
    clamped_turn,
    forward_pass,
    posture_of,
)
from regionik.planners.solvers.multistart_ik import ArmSolver
from regionik.planners.solvers.rigid_bodies import arm_model, bodies_of
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from tests.maths import Array, rot_x, rot_y, rot_z, translation

ARMS = ("hinge5", "dof10", "pioneer7")
FREE = (-np.inf, np.inf)


def odd_arm() -> Chain:
    """Skew axes, offsets, a slide in the middle: nothing lines up."""
    frames = [
        translation(0.1, 0, 0.2) @ rot_z(0.4),
        rot_x(1.3) @ translation(0.05, 0.02, 0.1),
        translation(0, 0.3, 0.1) @ rot_y(-0.7),
        translation(0.25, 0.03, 0) @ rot_x(0.8),
        translation(0.2, 0, 0.05),
        translation(0.0, 0.1, 0.1) @ rot_y(1.2),
    ]
    axes = [[0, 0, 1.0], [0, 0, 1.0], [1.0, 2.0, -1.0], [0, 1.0, 0], [0, 1.0, 0], [1.0, 0, 1.0]]
    joints = [
        Joint(
            f"j{k}", "prismatic" if k == 3 else "revolute", -0.5 if k == 3 else -3.0, 3.0, T, np.array(axis)
        )
        for k, (T, axis) in enumerate(zip(frames, axes, strict=True))
    ]
    return Chain(tuple(joints), translation(0.1, 0.05, 0.2) @ rot_y(0.5))


def lifted_arm() -> Chain:
    """A torso lift under the pioneer arm."""
    arm = robot_named("pioneer7").chain
    lift = Joint("lift", "prismatic", 0.0, 0.4, np.eye(4))
    return Chain((lift, *arm.joints), arm.T_last_tool)


CHAINS = {name: robot_named(name).chain for name in (*ARMS, "youbot")} | {
    "odd": odd_arm(),
    "lifted": lifted_arm(),
}


def with_limits(chain: Chain, limit: float) -> Chain:
    return Chain(
        tuple(replace(joint, lower=-limit, upper=limit) for joint in chain.joints), chain.T_last_tool
    )


def reachable(chain: Chain, count: int, seed: int) -> Array:
    """Tool points of postures drawn evenly from the limits, or from a whole turn."""
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    q = np.random.default_rng(seed).uniform(lower, upper, (count, chain.dof))
    points: Array = chain.forward(q)[:, :3, 3]
    return points


@pytest.mark.parametrize(
    ("target", "iterations", "error"),
    [((2.8, 2.8), 77, 9.863800e-4), ((2.4, 2.4), 7, 8.681949e-4), ((2.0, 2.0), 3, 4.956507e-4)],
)
def test_parallel_axes_are_plain_fabrik(target: tuple[float, float], iterations: int, error: float) -> None:
    # Tao et al., row 1 of tables 1 to 3: four hinges, links of 1, straight along y.
    chain = Chain.from_dh([(0, 0, 1, 0, *FREE)] * 4)
    bodies = arm_model(chain).pointing
    posture = posture_of(bodies, np.array([np.pi / 2, 0, 0, 0]))
    goal, left = np.array([*target, 0.0]), [np.inf]
    while left[-1] > 1e-3:
        forward_pass(bodies, goal, posture)
        backward_pass(bodies, posture)
        left.append(float(np.linalg.norm(posture.outer[-1] - goal)))
    assert len(left) - 1 == iterations
    assert f"{left[-1]:.6e}" == f"{error:.6e}"
    assert (np.diff(left) < 0).all()
    solver = ArmSolver(chain, restarts=0, polish=False)
    answer = solve_goal(solver, aim_at(goal), [np.pi / 2, 0, 0, 0])
    assert answer.iterations == iterations
    assert f"{answer.error:.6e}" == f"{error:.6e}"


def test_one_pass_is_the_textbook_step() -> None:
    bodies = arm_model(Chain.from_dh([(0, 0, length, 0, *FREE) for length in (1.0, 0.7, 0.5)])).pointing
    posture = posture_of(bodies, np.array([0.3, 0.4, -0.9]))
    goal, points, d = np.array([0.9, 1.1, 0.0]), posture.outer.copy(), [1.0, 0.7, 0.5]
    points[3] = goal
    for i in (2, 1, 0):
        points[i] = points[i + 1] + d[i] * (points[i] - points[i + 1]) / np.linalg.norm(
            points[i] - points[i + 1]
        )
    forward_pass(bodies, goal, posture)
    np.testing.assert_allclose(posture.outer, points, atol=1e-14)
    points[0] = 0.0
    for i in (0, 1, 2):
        points[i + 1] = points[i] + d[i] * (points[i + 1] - points[i]) / np.linalg.norm(
            points[i + 1] - points[i]
        )
    backward_pass(bodies, posture)
    np.testing.assert_allclose(posture.outer, points, atol=1e-14)


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("whole", [False, True], ids=["pointing", "posing"])
def test_bodies_stay_rigid_and_within_limits(name: str, whole: bool) -> None:
    chain = CHAINS[name]
    bodies = arm_model(chain).posing if whole else arm_model(chain).pointing
    n = len(bodies.slide)
    rng = np.random.default_rng(1)
    goals = reachable(chain, 20, 2)
    for goal in goals:
        q = rng.uniform(np.maximum(chain.lower, -3), np.minimum(chain.upper, 3))
        posture = posture_of(bodies, q)
        np.testing.assert_allclose(posture.outer[-1], chain.forward(q)[:3, 3], atol=1e-13)
        for _ in range(3):
            forward_pass(bodies, goal, posture)
            np.testing.assert_array_equal(posture.outer[-1], goal)
            for k in range(1, n):
                turn = chain.joints[k].transform(posture.joints[k])
                step = (bodies.arm.fixed[k] @ turn)[:3, :3]
                np.testing.assert_allclose(posture.turns[k - 1] @ step, posture.turns[k], atol=1e-12)
            backward_pass(bodies, posture)
            q[:n] = posture.joints
            assert (q >= chain.lower).all()
            assert (q <= chain.upper).all()
            np.testing.assert_allclose(posture.outer[-1], chain.forward(q)[:3, 3], atol=1e-12)
            np.testing.assert_allclose(posture.turns, chain.frames(q)[:n, :3, :3], atol=1e-12)


@pytest.mark.parametrize("name", CHAINS)
def test_points_lie_on_their_axes_and_travel_with_both_bodies(name: str) -> None:
    chain = CHAINS[name]
    bodies = arm_model(chain).posing
    q = np.linspace(0.1, 0.4, chain.dof)
    posture, frames = posture_of(bodies, q), chain.frames(q)
    for k in np.flatnonzero(bodies.arm.revolute):
        axis = frames[k, :3, :3] @ chain.joints[k].axis
        for point in (posture.outer[k], posture.inner[k]):
            assert np.linalg.norm(np.cross(point - frames[k, :3, 3], axis)) < 1e-12


def test_equation_6_makes_the_next_axis_normal_to_the_line() -> None:
    # hinge5: the pivot turns the hinges' common axis normal to the line to the first point beyond them.
    chain = robot_named("hinge5").chain
    bodies = arm_model(chain).pointing
    assert bodies.outward_aim.tolist() == [-1, 2, 3, -1, 5]
    assert bodies.outward_goal[0] == 4  # FIND_CONCURRENT passes over the parallel hinges
    rng = np.random.default_rng(3)
    for goal in reachable(chain, 20, 4):
        posture = posture_of(bodies, rng.uniform(-3, 3, 5))
        forward_pass(bodies, goal, posture)
        line = posture.outer[4] - bodies.root
        backward_step(bodies, 0, posture)
        axis = posture.turns[0] @ bodies.next_axis[0]
        assert abs(axis @ line) < 1e-12


def test_hinges_and_pivots_that_meet_share_their_point() -> None:
    bodies = arm_model(robot_named("pioneer7").chain).pointing
    np.testing.assert_allclose(
        np.linalg.norm(bodies.outer, axis=1), [0, 0.15, 0, 0.145, 0, 0.075, 0.075], atol=1e-15
    )
    np.testing.assert_allclose(bodies.root, [0, 0, 0.1489], atol=1e-15)
    assert bodies.outward_aim[[1, 3]].tolist() == [2, 4]  # pivots point their links


def test_joints_that_do_not_move_the_tool_point_are_left_out() -> None:
    chain = robot_named("youbot").chain
    assert len(arm_model(chain).pointing.slide) == 4
    assert len(arm_model(chain).posing.slide) == 5


@pytest.mark.parametrize(
    ("wanted", "now", "lower", "upper", "expected"),
    [
        (0.5, 0.0, -1.0, 1.0, 0.5),
        (2.0, 0.0, -1.0, 1.0, 1.0),
        (-2.0, 0.0, -1.0, 1.0, -1.0),
        (3.5, -2.5, -4.0, 4.0, 3.5 - 2 * np.pi),
        (0.5, 6.0, -np.inf, np.inf, 0.5 + 2 * np.pi),
        (0.5, 6.0, -np.inf, 6.1, 0.5),
        (0.5, -6.0, -0.5, np.inf, 0.5),
        (np.pi, 0.0, -1.0, 1.5, 1.5),
    ],
)
def test_held(wanted: float, now: float, lower: float, upper: float, expected: float) -> None:
    assert clamped_turn(wanted, now, lower, upper) == pytest.approx(expected, abs=1e-12)


def test_arms_of_the_paper() -> None:
    tips = {name: robot_named(name).chain.forward(robot_named(name).carry)[:3, 3] for name in ARMS}
    for name, height in (("hinge5", 0.34), ("dof10", 0.9), ("pioneer7", 0.5939)):
        np.testing.assert_allclose(tips[name], [0, 0, height], atol=1e-12)


def test_passes_and_many_restarts_meet_every_target() -> None:
    robot = robot_named("hinge5")
    targets = reachable(robot.chain, 200, 0)
    passes = solve_batch(
        ArmSolver(robot.chain, tolerance=1e-6, restarts=40, polish=False), targets, robot.carry
    )
    assert passes.converged.sum() >= 199


def test_pioneer7() -> None:
    robot = robot_named("pioneer7")
    targets = reachable(robot.chain, 200, 0)
    rough = solve_batch(ArmSolver(robot.chain, tolerance=1e-2, polish=False), targets, robot.carry)
    assert rough.converged.all()
    assert rough.iterations.mean() <= 2.0
    assert solve_batch(ArmSolver(robot.chain, tolerance=1e-6), targets, robot.carry).converged.all()


@pytest.mark.parametrize("name", ARMS)
def test_with_limits(name: str) -> None:
    chain = with_limits(robot_named(name).chain, np.radians(150))
    targets = reachable(chain, 1000, 1)
    answers = solve_batch(ArmSolver(chain, tolerance=1e-5), targets, np.zeros(chain.dof))
    assert answers.converged.sum() >= 999
    assert (np.abs(answers.joints) <= np.radians(150)).all()


def test_a_single_prismatic_joint_follows_the_target() -> None:
    lift = Chain((Joint("lift", "prismatic", -0.2, 0.5, np.eye(4)),), translation(0.3, 0, 0))
    bodies = bodies_of(serial_arm(lift))
    for height, expected in ((0.3, 0.3), (0.9, 0.5), (-1.0, -0.2)):
        posture = posture_of(bodies, np.zeros(1))
        forward_pass(bodies, np.array([0.3, 0.0, height]), posture)
        backward_pass(bodies, posture)
        assert posture.joints[0] == pytest.approx(expected, abs=1e-15)
