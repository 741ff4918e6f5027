"""The solver of arms on a fixed base: every answer confirmed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from benchmarks.tables.batch import solve_batch
from benchmarks.tables.goals import ArmPosture, aim_at, solve_goal
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aim
from regionik.planners.solvers.multistart_ik import ArmSolver
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from tests import examples
from tests.maths import Array, translation

FREE = (-np.inf, np.inf)


def six_axes() -> Chain:
    """An industrial arm with a spherical wrist and limits."""
    h = np.pi / 2
    rows = [
        (0, 0.4, 0.025, -h, -2.9, 2.9),
        (0, 0, 0.455, 0, -2.3, 1.9),
        (0, 0, 0.035, -h, -2.0, 2.7),
        (0, 0.42, 0, h, -3.2, 3.2),
        (0, 0, 0, -h, -2.1, 2.1),
        (0, 0.08, 0, 0, -6.1, 6.1),
    ]
    return Chain.from_dh(rows)


def six_skewed() -> Chain:
    """Six axes whose wrist does not meet in a point."""
    h = np.pi / 2
    rows = [
        (0, 0.089, 0, h, -6.2, 6.2),
        (0, 0, -0.425, 0, -6.2, 6.2),
        (0, 0, -0.392, 0, -6.2, 6.2),
        (0, 0.109, 0, h, -6.2, 6.2),
        (0, 0.095, 0, -h, -6.2, 6.2),
        (0, 0.082, 0, 0, -6.2, 6.2),
    ]
    return Chain.from_dh(rows)


def lifted() -> Chain:
    """A torso lift under an arm of seven joints."""
    lift = Joint("lift", "prismatic", 0.0, 0.4, np.eye(4))
    arm = robot_named("pioneer7").chain
    joints = tuple(replace(joint, lower=-2.6, upper=2.6) for joint in arm.joints)
    return Chain((lift, *joints), arm.T_last_tool)


def telescope() -> Chain:
    """A pivot, a hinge, a sliding boom and a wrist."""
    turn = robot_named("hinge5").chain.joints[1].T_parent_joint
    joints = (
        Joint("pivot", "revolute", -3.0, 3.0, np.eye(4)),
        Joint("hinge", "revolute", -1.5, 0.5, turn),
        Joint("boom", "prismatic", 0.2, 0.9, np.eye(4), np.array([1.0, 0, 0])),
        Joint("wrist", "revolute", -2.0, 2.0, translation(0.1, 0, 0)),
    )
    return Chain(joints, translation(0.2, 0.0, 0.0))


def planar(*lengths: float) -> Chain:
    return Chain.from_dh([(0, 0, length, 0, *FREE) for length in lengths])


CHAINS = {
    "youbot": robot_named("youbot").chain,
    "pioneer7": robot_named("pioneer7").chain,
    "dof10": robot_named("dof10").chain,
    "six_axes": six_axes(),
    "six_skewed": six_skewed(),
    "lifted": lifted(),
    "telescope": telescope(),
}
POSES = ("pioneer7", "dof10", "six_axes", "six_skewed", "lifted")


def postures(chain: Chain, count: int, seed: int) -> Array:
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    return np.random.default_rng(seed).uniform(lower, upper, (count, chain.dof))


def home(chain: Chain) -> Array:
    return np.clip(np.zeros(chain.dof), chain.lower, chain.upper)


def angle_between(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def check(chain: Chain, solver: ArmSolver, aim: Aim, answer: ArmPosture) -> None:
    """What holds of every answer, found or not."""
    tool = chain.forward(answer.joints)
    assert np.isfinite(answer.joints).all()
    assert (answer.joints >= chain.lower).all()
    assert (answer.joints <= chain.upper).all()
    assert answer.error == pytest.approx(np.linalg.norm(tool[:3, 3] - aim.position), abs=1e-12)
    angle = 0.0
    if aim.kind == DIRECTION:
        angle = angle_between(tool[:3, 2], aim.turn[:, 2])
    elif aim.kind == ORIENTATION:
        turn = aim.turn @ tool[:3, :3].T
        angle = float(np.arccos(np.clip(0.5 * (np.trace(turn) - 1), -1, 1)))
    assert answer.angle_error == pytest.approx(angle, abs=1e-6)
    within = answer.error <= solver.effort.tolerance and answer.angle_error <= solver.effort.angle_tolerance
    assert answer.converged == within
    assert answer.steps[0] == "passes"


@pytest.mark.parametrize("name", CHAINS)
def test_positions(name: str) -> None:
    chain = CHAINS[name]
    solver = ArmSolver(chain, tolerance=1e-6)
    targets = chain.forward(postures(chain, 300, 1))[:, :3, 3]
    answers = solve_batch(solver, targets, home(chain))
    assert answers.converged.all()
    errors = np.linalg.norm(chain.forward(answers.joints)[:, :3, 3] - targets, axis=1)
    assert (errors <= 1e-6).all()
    assert (answers.joints >= chain.lower).all()
    assert (answers.joints <= chain.upper).all()


@pytest.mark.parametrize("name", POSES)
@pytest.mark.parametrize("whole", [False, True], ids=["direction", "orientation"])
def test_poses(name: str, whole: bool) -> None:
    chain = CHAINS[name]
    solver = ArmSolver(chain, tolerance=1e-5, angle_tolerance=1e-4)
    met = 0
    for T in chain.forward(postures(chain, 100, 2)):
        goal = aim_at(T[:3, 3], orientation=T[:3, :3]) if whole else aim_at(T[:3, 3], direction=T[:3, 2])
        answer = solve_goal(solver, goal, home(chain))
        check(chain, solver, goal, answer)
        met += answer.converged
    assert met >= 98


def test_the_roll_of_a_direction_is_free() -> None:
    chain = CHAINS["pioneer7"]
    T = chain.forward(postures(chain, 1, 3)[0])
    solver = ArmSolver(chain, tolerance=1e-5, angle_tolerance=1e-5)
    for roll in (0.0, 1.0, 2.0):
        start = postures(chain, 1, 4)[0] + roll
        answer = solve_goal(solver, aim_at(T[:3, 3], direction=3.0 * T[:3, 2]), start)
        assert answer.converged
        assert angle_between(chain.forward(answer.joints)[:3, 2], T[:3, 2]) <= 1e-5


@pytest.mark.parametrize("name", CHAINS)
def test_same_bytes_every_time(name: str) -> None:
    chain = CHAINS[name]
    T = chain.forward(postures(chain, 20, 5))
    runs = []
    for _ in range(2):
        solver = ArmSolver(chain, tolerance=1e-5)
        runs.append([solve_goal(solver, aim_at(t[:3, 3], orientation=t[:3, :3]), home(chain)) for t in T])
    for a, b in zip(*runs, strict=True):
        assert a.joints.tobytes() == b.joints.tobytes()
        assert (a.error, a.iterations, a.restarts, a.steps) == (b.error, b.iterations, b.restarts, b.steps)


def test_batch_is_one_by_one() -> None:
    chain = CHAINS["youbot"]
    solver = ArmSolver(chain, tolerance=1e-6)
    targets = chain.forward(postures(chain, 50, 6))[:, :3, 3]
    starts = postures(chain, 50, 7)
    together = solve_batch(solver, targets, starts)
    for i, (target, start) in enumerate(zip(targets, starts, strict=True)):
        alone = solve_goal(solver, aim_at(target), start)
        assert alone.joints.tobytes() == together.joints[i].tobytes()
        assert alone.iterations == together.iterations[i]
        assert alone.error == pytest.approx(together.error[i], abs=1e-15)
        assert alone.converged == together.converged[i]


def test_in_place_already_is_no_pass() -> None:
    robot = robot_named("pioneer7")
    T = robot.chain.forward(robot.carry)
    for goal in (
        aim_at(T[:3, 3]),
        aim_at(T[:3, 3], direction=T[:3, 2]),
        aim_at(T[:3, 3], orientation=T[:3, :3]),
    ):
        answer = solve_goal(ArmSolver(robot.chain), goal, robot.carry)
        assert (answer.iterations, answer.steps, answer.converged) == (0, ("passes",), True)
        np.testing.assert_array_equal(answer.joints, robot.carry)


def test_joints_that_do_not_matter_stay() -> None:
    chain = CHAINS["youbot"]
    start = np.array([0.1, 1.0, 0.5, 1.0, 1.234])
    target = chain.forward(postures(chain, 1, 8)[0])[:3, 3]
    assert solve_goal(ArmSolver(chain), aim_at(target), start).joints[4] == 1.234


def test_joints_without_limits_take_the_nearest_turn() -> None:
    robot = robot_named("dof10")
    start = robot.carry + 6 * np.pi
    for target in robot.chain.forward(postures(robot.chain, 20, 9))[:, :3, 3]:
        answer = solve_goal(ArmSolver(robot.chain), aim_at(target), start)
        assert answer.converged
        assert (np.abs(answer.joints - start) <= np.pi + 1e-12).all()


def test_steps_tell_what_led_to_the_answer() -> None:
    seen = set()
    for chain, posed in ((robot_named("hinge5").chain, False), (CHAINS["six_skewed"], True)):
        solver = ArmSolver(chain, tolerance=1e-6, restarts=3)
        for T in chain.forward(postures(chain, 100, 0)):
            answer = solve_goal(
                solver, aim_at(T[:3, 3], orientation=T[:3, :3] if posed else None), home(chain)
            )
            assert ("restarts" in answer.steps) == (answer.restarts > 0)
            seen.add(answer.steps)
    assert seen == {("passes",), ("passes", "polish"), ("passes", "restarts", "polish")}


def test_a_start_outside_the_limits_is_taken_into_them() -> None:
    chain = CHAINS["youbot"]
    answer = solve_goal(ArmSolver(chain), aim_at([0.3, 0.1, 0.3]), np.full(5, 9.0))
    assert answer.converged
    assert (answer.joints <= chain.upper).all()


NO_LENGTH = planar(0.0, 0.0, 0.0)
ONE = planar(1.0)
STRAIGHT = np.array([np.pi / 2, 0, 0, 0])


@pytest.mark.parametrize(
    ("chain", "joints", "target", "met"),
    [
        pytest.param(NO_LENGTH, [0, 0, 0], [0, 0, 0], True, id="no length, in place"),
        pytest.param(NO_LENGTH, [0, 0, 0], [0.5, 0, 0], False, id="no length"),
        pytest.param(planar(1, 0, 1), [0, 0, 0], [0.3, -0.7, 0], True, id="a link of no length"),
        pytest.param(ONE, [0.3], [0, -1, 0], True, id="one joint"),
        pytest.param(ONE, [0.0], [-1, 0, 0], True, id="one joint, half a turn"),
        pytest.param(ONE, [0.3], [0, 0.5, 0], False, id="one joint, inside"),
        pytest.param(ONE, [0.3], [0, 0, 0], False, id="one joint, at the root"),
        pytest.param(ONE, [0.3], [0.8, 0, 0.6], False, id="one joint, off its circle"),
        pytest.param(planar(1, 1, 1, 1), STRAIGHT, [0, -3, 0], True, id="straight, aimed away"),
        pytest.param(planar(1, 1, 1, 1), STRAIGHT, [0, 2, 0], True, id="straight, target on the arm"),
        pytest.param(planar(1, 1, 1, 1), STRAIGHT, [0, 0, 0], True, id="at the root"),
        pytest.param(planar(1, 1, 1, 1), STRAIGHT, [0, -4, 0], True, id="full stretch, behind"),
        pytest.param(planar(1, 1, 1, 1), STRAIGHT, [2.4, 3.2, 0], True, id="full stretch"),
        pytest.param(planar(1, 1, 1, 1), STRAIGHT, [0, 5, 0], False, id="too far"),
        pytest.param(planar(3, 1, 1), [0, 1, 1], [0.4, 0, 0], False, id="too near"),
        pytest.param(planar(3, 1, 1), [0, 1, 1], [1, 0, 0], True, id="folded, just"),
        pytest.param(planar(1, 1), [0, 0], [0, 0, 1], False, id="off the plane"),
        pytest.param(CHAINS["pioneer7"], np.zeros(7), [0, 0, 0.1489], True, id="pioneer, at its root"),
        pytest.param(CHAINS["pioneer7"], np.zeros(7), [0, 0, -0.2961], True, id="pioneer, stretched down"),
        pytest.param(CHAINS["youbot"], [0, 1, 0, 1, 0], [0.2, 0, -0.3], False, id="limits"),
    ],
)
def test_degenerate(chain: Chain, joints: ArrayLike, target: ArrayLike, met: bool) -> None:
    solver, goal = ArmSolver(chain), aim_at(target)
    answer = solve_goal(solver, goal, joints)
    check(chain, solver, goal, answer)
    assert answer.converged == met


def test_full_stretch_to_the_micrometre() -> None:
    chain = planar(1, 1, 1, 1)
    answer = solve_goal(ArmSolver(chain, tolerance=1e-6), aim_at([2.4, 3.2, 0]), STRAIGHT)
    assert answer.converged


def test_a_direction_that_cannot_be_met_is_missed() -> None:
    # The tool axis of a planar arm stays normal to the plane.
    chain = planar(1, 1, 1)
    solver, goal = ArmSolver(chain), aim_at([1.5, 0.5, 0], direction=[1, 0, 1])
    answer = solve_goal(solver, goal, [0.1, 0.2, 0.3])
    check(chain, solver, goal, answer)
    assert not answer.converged


def test_a_lift_goes_where_the_arm_cannot() -> None:
    chain = CHAINS["lifted"]
    target = np.array([0.1, 0.1, 0.85])  # above what the arm alone reaches, 0.59 m
    answer = solve_goal(ArmSolver(chain), aim_at(target), home(chain))
    assert answer.converged
    assert 0.2 < answer.joints[0] <= 0.4
    assert not solve_goal(ArmSolver(chain), aim_at([0, 0, 1.2]), home(chain)).converged


@settings(max_examples=examples(60))
@given(
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=5),
    st.lists(st.sampled_from([0.0, np.pi / 2, -np.pi / 2, 0.7]), min_size=5, max_size=5),
    st.tuples(*[st.floats(-3, 3)] * 3),
)
def test_never_nan(lengths: list[float], twists: list[float], target: tuple[float, ...]) -> None:
    chain = Chain.from_dh([(0, 0, a, t, -2.5, 2.5) for a, t in zip(lengths, twists, strict=False)])
    solver, goal = ArmSolver(chain, restarts=2), aim_at(target)
    check(chain, solver, goal, solve_goal(solver, goal, np.full(chain.dof, 0.2)))


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: ArmSolver(ONE, tolerance=0.0), "tolerance: expected a number above 0"),
        (lambda: ArmSolver(ONE, restarts=-1), "restarts: expected 0 or more"),
        (lambda: solve_goal(ArmSolver(ONE), aim_at([1, 0, 0]), [0, 0]), "joints: expected 1"),
        (lambda: solve_batch(ArmSolver(ONE), [[1, 0, 0]], [[0], [0]]), "joints: expected 1 rows"),
        (lambda: solve_batch(ArmSolver(ONE), [1, 0, 0], [0]), "positions: expected n x 3"),
    ],
)
def test_bad_input_is_named(make, expected: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=expected):
        make()
