"""How a solve went, by iteration, and base and arm that follow a target as it moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.worlds.bundled import robot_named
from tests.kinds import Heading
from tests.known_arms import NAMES, known_robot
from tests.maths import Array
from tests.random_arms import KINDS, random_robot

TOLERANCE = 1e-4
STEP = 0.004  # of the target between two calls [m]


def mid_posture(robot: rik.Robot) -> Array:
    """Joints a little beside the middle of their limits, where arms are not stretched."""
    lower, upper = np.maximum(robot.chain.lower, -1.5), np.minimum(robot.chain.upper, 1.5)
    joints: Array = np.minimum((lower + upper) / 2 + 0.3, upper)
    return joints


def circle(start: Array, count: int) -> Array:
    """Points on a level circle from a point, 0.2 m across."""
    angles = STEP / 0.1 * np.arange(1, count + 1)
    return start + 0.1 * np.column_stack([np.sin(angles), 1 - np.cos(angles), np.zeros(count)])


def robots() -> dict[str, rik.Robot]:
    known = {name: known_robot(name) for name in NAMES}
    drawn = {kind: random_robot(kind, np.random.default_rng(5)) for kind in KINDS[:-1]}
    return {"youbot": robot_named("youbot"), **known, **drawn}


ROBOTS = robots()


@pytest.mark.parametrize("name", ROBOTS)
def test_a_history_ends_where_the_solve_does(name: str) -> None:
    robot = ROBOTS[name]
    solver, rng = rik.Solver(robot, tolerance=TOLERANCE), np.random.default_rng(0)
    base, joints = np.array([0.1, 0.2, 0.3]), mid_posture(robot)
    for point in robot.tool([0.5, -0.2, 1.0], joints)[:3, 3] + rng.uniform(
        [-0.1, -0.1, -0.2], [0.1, 0.1, -0.05], (4, 3)
    ):
        found, history = solver(point, base, joints), solver.history(point, base, joints)
        assert len(history) == found.iterations + 1
        assert history[0] == pytest.approx(np.linalg.norm(robot.tool(base, joints)[:3, 3] - point), abs=1e-12)
        assert found.converged
        assert history[-1] == pytest.approx(found.error, abs=1e-9)
        assert (history[:-1] > TOLERANCE).all()  # it ends as soon as the target is met


def test_a_start_on_target_has_a_history_of_itself() -> None:
    robot = robot_named("youbot")
    joints = mid_posture(robot)
    point = robot.tool(np.zeros(3), joints)[:3, 3]
    np.testing.assert_allclose(rik.Solver(robot).history(point, np.zeros(3), joints), [0.0], atol=1e-12)


def test_a_history_out_of_reach_never_gets_there() -> None:
    robot = known_robot("UR5")
    solver = rik.Solver(robot, shapely.box(-0.1, -0.1, 0.1, 0.1))
    history = solver.history([4.0, 0.0, 0.5], np.zeros(3), mid_posture(robot))
    least = solver([4.0, 0.0, 0.5], np.zeros(3), mid_posture(robot)).error
    assert least > 2.0
    assert history.min() >= least - 1e-9  # a walk may come nearer than any iteration


def test_a_history_of_a_direction_is_refused() -> None:
    robot, target = robot_named("youbot"), rik.Target(np.array([1.0, 0.0, 0.2]), direction=-np.eye(3)[2])
    with pytest.raises(
        rik.InputError, match="history: expected a point alone, got a target with a direction"
    ):
        rik.Solver(robot).history(target, np.zeros(3), mid_posture(robot))


@pytest.mark.parametrize("name", ROBOTS)
def test_base_and_arm_follow_a_target_in_small_steps(name: str) -> None:
    robot, base, count = ROBOTS[name], np.array([0.3, -0.4, 0.7]), 160
    live = rik.LiveSolver(robot, base, mid_posture(robot), tolerance=TOLERANCE)
    state = live.base, live.joints
    before = np.concatenate(state)
    np.testing.assert_allclose(before, [*base, *mid_posture(robot)], atol=1e-12)
    for point in circle(robot.tool(*state)[:3, 3], count):
        assert live(point)
        off = np.linalg.norm(robot.tool(live.base, live.joints)[:3, 3] - point)
        assert off == pytest.approx(live.error, abs=1e-9)
        assert off <= TOLERANCE
        assert (live.joints >= robot.chain.lower).all()
        assert (live.joints <= robot.chain.upper).all()
        now = np.concatenate([live.base, live.joints])
        assert np.abs(now - before).max() < 10 * STEP  # it does not leap
        before = now
    assert live.base is state[0]
    assert live.joints is state[1]


@pytest.mark.parametrize("asked", ["direction", "orientation"])
def test_base_and_arm_follow_poses(asked: str) -> None:
    robot = known_robot("UR5")
    live = rik.LiveSolver(robot, np.zeros(3), mid_posture(robot))
    tool = robot.tool(live.base, live.joints)
    turned: dict[str, Any] = (
        {"direction": tool[:3, 2]} if asked == "direction" else {"orientation": tool[:3, :3]}
    )
    for point in circle(tool[:3, 3], 50):
        assert live(rik.Target(point, cone=0.01, **turned))
        now = robot.tool(live.base, live.joints)
        assert now[:3, 2] @ tool[:3, 2] >= np.cos(0.01) - 1e-9
        if asked == "orientation":
            assert np.arccos(np.clip((np.trace(now[:3, :3].T @ tool[:3, :3]) - 1) / 2, -1, 1)) <= 0.01 + 1e-6


@pytest.mark.parametrize("heading", ["free", "fixed", "face_target"])
def test_a_base_that_follows_keeps_to_its_area_and_heading(heading: Heading) -> None:
    robot, area = robot_named("youbot"), shapely.box(-0.05, -0.05, 0.05, 0.05)
    live = rik.LiveSolver(robot, np.zeros(3), mid_posture(robot), area, heading=heading)
    start = robot.tool(live.base, live.joints)[:3, 3]
    last, met = np.inf, []
    for share in np.linspace(0, 1, 100):
        met.append(live(start + share * np.array([3.0, 0.0, 0.0])))
        x, y = robot.mount[:2]
        c, s = np.cos(live.base[2]), np.sin(live.base[2])
        axis = live.base[:2] + [c * x - s * y, s * x + c * y]
        assert area.distance(shapely.Point(axis)) < 1e-9
        if heading == "fixed":
            assert live.base[2] == 0.0
        last = live.error
    assert met[1]
    assert not met[-1]
    assert last > 2.0


def test_what_a_live_solver_is_given_is_checked() -> None:
    robot, joints = robot_named("youbot"), mid_posture(robot_named("youbot"))
    with pytest.raises(rik.InputError, match="live solver: tolerance must be above 0, got 0"):
        rik.LiveSolver(robot, np.zeros(3), joints, tolerance=0)
    with pytest.raises(rik.InputError, match="base"):
        rik.LiveSolver(robot, np.zeros(2), joints)
    with pytest.raises(rik.InputError, match="heading must be one of free, face_target, fixed"):
        rik.LiveSolver(robot, np.zeros(3), joints, heading="any")  # type: ignore[arg-type]
    live = rik.LiveSolver(robot, np.zeros(3), joints)
    with pytest.raises(rik.InputError, match="position"):
        live([np.nan, 0.0, 0.0])
