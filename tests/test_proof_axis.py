"""The proof that the tool's frame keeps to its cone between two set-points, against dense sampling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.values import Motion
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target
from tests.bodies import random_robot
from tests.maths import Array
from tests.plans import Proof, far_off, proofs_of

SAMPLES = 400


def hop(rng: np.random.Generator, robot: Robot, most: float) -> Motion:
    """One hop from a set-point to the next."""
    base = rng.uniform(-3, 3, (1, 3)) + np.array([[0.0], [1.0]]) * rng.uniform(-most, most, 3)
    joints = rng.uniform(-2, 2, (1, robot.chain.dof))
    joints = joints + np.array([[0.0], [1.0]]) * rng.uniform(-most, most, robot.chain.dof)
    return Motion(base, joints, np.array(["setpoint", "setpoint"]), np.array([0, 1]), np.full(2, np.nan))


def frames(robot: Robot, motion: Motion) -> Array:
    """Tool orientations on the way, (SAMPLES, 3, 3)."""
    share = np.linspace(0, 1, SAMPLES)[:, None]
    base, joints = (a[:1] + share * (a[1:] - a[:1]) for a in (motion.base, motion.joints))
    turns: Array = robot.tool(base, joints)[:, :3, :3]
    return turns


def farthest(turns: Array, ends: Array) -> float:
    """Farthest that frames come from the even turn between two, which is sampled too."""
    way = Rotation.from_matrix(ends[0].T @ ends[1]).as_rotvec()
    arc = ends[0] @ Rotation.from_rotvec(np.linspace(0, 1, SAMPLES)[:, None] * way).as_matrix()
    traces = np.einsum("aij,bij->ab", turns, arc)
    return float(np.arccos(np.clip((traces.max(axis=1) - 1) / 2, -1, 1)).max())


def told(robot: Robot, motion: Motion, ends: Array, cone: float) -> tuple[Proof, ...]:
    spots = robot.tool(motion.base, motion.joints)[:, :3, 3]
    task = tuple(Target(p, cone=cone, orientation=R) for p, R in zip(spots, ends, strict=True))
    return proofs(robot, motion, task)


def proofs(robot: Robot, motion: Motion, task: tuple[Target, ...]) -> tuple[Proof, ...]:
    """Of frames and of axes."""
    return proofs_of(replace(far_off(robot), task=task), motion, "orientation", "direction")


def test_a_frame_is_proven_in_its_cone_where_it_is_and_only_there() -> None:
    rng, proven, refused = np.random.default_rng(0), 0, 0
    for _ in range(60):
        robot = replace(random_robot(rng, int(rng.integers(2, 6))), solids=())
        motion = hop(rng, robot, float(rng.uniform(0.1, 0.8)))
        turns = frames(robot, motion)
        nudge = Rotation.from_rotvec(rng.uniform(-0.05, 0.05, (2, 3))).as_matrix()
        ends = turns[[0, -1]] @ nudge
        far = farthest(turns, ends)
        for cone in (0.9 * far, 1.01 * far + 2e-3):
            found, axis = told(robot, motion, ends, cone)
            if cone > far:
                assert not found.violations
                assert axis.margin == np.inf  # the frame takes the axis along
                assert found.margin >= 0
                proven += 1
            else:
                assert found.violations
                assert "frame" in found.violations[0].text
                refused += 1
    assert proven == refused == 60


def test_a_frame_that_leaves_its_cone_between_two_states_is_told() -> None:
    """Both ends are met to the letter; on the way the base's turn and the arm's do not cancel."""
    rng = np.random.default_rng(1)
    robot = random_robot(rng, 4)
    motion = hop(rng, robot, 1.5)
    turns = frames(robot, motion)
    ends = turns[[0, -1]]
    far = farthest(turns, ends)
    assert far > 0.05
    found, _ = told(robot, motion, ends, 0.8 * far)
    assert [violation.state for violation in found.violations] == [0]
    assert "between states 1 and 2" in found.violations[0].text


def test_what_only_one_set_point_asks_is_not_asked_on_the_way() -> None:
    rng = np.random.default_rng(2)
    robot = random_robot(rng, 4)
    motion = hop(rng, robot, 0.5)
    spots, turns = robot.tool(motion.base, motion.joints)[:, :3, 3], frames(robot, motion)
    task = (Target(spots[0], cone=0.001, orientation=turns[0]), Target(spots[1], turns[-1][:, 2], 0.001))
    frame, axis = proofs(robot, motion, task)
    assert frame.margin == np.inf
    assert axis.violations
