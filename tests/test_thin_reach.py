"""Reach of poses by arms of five joints: thin strips, which no cell of a grid shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.maths import Array
from tests.random_arms import random_robot

CONE = 0.002  # [rad]
FLOOR = Floor(shapely.box(-2.5, -2.5, 2.5, 2.5))


def drawn(kind: str, seed: int) -> tuple[Robot, Array, Target]:
    """Return a robot, where it stands, and the pose to which some posture brings its tool from there."""
    rng = np.random.default_rng([seed, 77])
    robot = random_robot(kind, rng)
    chain = robot.chain
    low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
    high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
    base = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)])
    T = robot.tool(base, rng.uniform(low, high))
    return robot, base, Target(T[:3, 3], orientation=T[:3, :3], cone=CONE)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("offsets", 133),
        ("offsets", 243),
        ("slides", 64),
        ("slides", 94),
        pytest.param("tilted", 23, marks=pytest.mark.slow),
    ],
)
def test_a_pose_that_a_posture_is_known_for_is_reachable(kind: str, seed: int) -> None:
    """From anywhere, not only from where that posture was drawn."""
    robot, base, target = drawn(kind, seed)
    assert robot.chain.dof == 5
    world = World("thin", robot, FLOOR, (), (target,), Rules(clearance=0.0))
    assert rik.reach(world, [target], base=base).verdict.tolist() == ["reachable"]
    answer = rik.reach(world, [target])
    assert answer.verdict.tolist() == ["reachable"]
    assert rik.verify_answers(world, answer, [target]).ok


def test_a_thin_reach_is_found_at_a_heading_that_is_kept() -> None:
    robot, base, target = drawn("offsets", 133)
    rules = Rules(clearance=0.0, heading="fixed")
    world = World("thin", robot, FLOOR, (), (target,), rules, Start(base, robot.carry))
    for asked in (target, replace(target, orientation=None, direction=target.orientation[:, 2])):  # type: ignore[index]
        answer = rik.reach(world, [asked])
        assert answer.verdict.tolist() == ["reachable"]
        assert answer.base[0, 2] == base[2]
        assert rik.verify_answers(world, answer, [asked]).ok
