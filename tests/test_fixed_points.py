"""Outer reach of poses: no posture that meets a direction or an orientation stands outside of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regionik.planners.reach.level_reach import fixed_point_reach
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aim
from regionik.reachability.reach import reach
from regionik.regions import reach_of
from regionik.scene import scene_of
from regionik.worlds.arms import with_pivot
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples
from tests.maths import Array
from tests.measures import axis_of
from tests.random_arms import ARMS, random_arm, random_robot
from tests.test_poses import robot_of, six_axes
from tests.test_reach_model import across

FLOOR = Floor(shapely.box(-9, -9, 9, 9))


def posture(chain: Chain, rng: np.random.Generator) -> Array:
    """Some joints anywhere, some in the middle or at an end of their limits, where the reach ends."""
    low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
    high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
    share = np.where(rng.random(chain.dof) < 0.5, rng.uniform(0, 1, chain.dof), rng.choice([0, 0.5, 1]))
    q: Array = low + share * (high - low)
    return q


def tilted(turn: Array, cone: float, rng: np.random.Generator) -> Array:
    """What may be asked of a tool (3, 3) that misses it by the whole cone, or by less."""
    axis = rng.normal(size=3)
    angle = cone * rng.choice([1.0, rng.random()])
    asked: Array = turn @ Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return asked


@settings(max_examples=examples(40))
@given(st.sampled_from(ARMS), st.integers(0, 10_000), st.booleans(), st.booleans(), st.floats(1e-3, 1.2))
def test_every_posture_has_the_fixed_points_in_reach(
    kind: str, seed: int, framed: bool, coarse: bool, cone: float
) -> None:
    rng = np.random.default_rng(seed)
    chain, height = with_pivot(random_arm(kind, rng)), 0.3
    for q in (posture(chain, rng) for _ in range(2)):
        tool = chain.forward(q)
        asked = tilted(tool[:3, :3], cone, rng)
        turn = asked if framed else np.outer(asked[:, 2], [0.0, 0.0, 1.0])
        aim = Aim(tool[:3, 3] + [0, 0, height], ORIENTATION if framed else DIRECTION, turn, cone)
        bounds = list(fixed_point_reach(chain, height, aim, coarse=coarse))
        assert len(bounds) >= 2
        for center, rings in bounds:
            assert ((rings[:, 0] <= np.hypot(*center)) & (np.hypot(*center) <= rings[:, 1])).any()


def robots(kind: str, rng: np.random.Generator) -> Robot:
    if kind in ARMS:
        return random_robot(kind, rng)
    return across(robot_of("youbot")) if kind == "across" else robot_of(kind)


@pytest.mark.parametrize("kind", [*ARMS, "across", "pioneer7", "six axes"])
def test_the_place_of_every_posture_is_in_the_outer_area_of_its_pose(kind: str) -> None:
    rng = np.random.default_rng(ARMS.index(kind) if kind in ARMS else 9)
    for k in range(3):
        robot = robots(kind, rng)
        base = rng.uniform(-3, 3, 3)
        tool, cone = robot.tool(base, posture(robot.chain, rng)), float(rng.uniform(0.01, 0.5))
        asked = tilted(tool[:3, :3], cone, rng)
        turned: dict[str, Any] = {"orientation": asked} if k % 2 else {"direction": asked[:, 2]}
        target = Target(tool[:3, 3], cone=cone, **turned)
        outer = reach_of(scene_of(World("bare", robot, FLOOR)), target, coarse=k < 2)
        assert outer.distance(shapely.Point(axis_of(robot, base))) < 1e-6


@pytest.mark.parametrize("end", [1.0, -1.0])
@pytest.mark.parametrize("framed", [False, True])
def test_a_wrist_at_its_highest_or_lowest_uses_the_whole_cone(end: float, framed: bool) -> None:
    """The arm is straight up or down and the tool level, but asked for as tilted as the cone lets it be."""
    robot, cone = six_axes(), 0.3
    ways = np.array([[0.0, way, 0.0, turn, 0.0, 0.0] for way in (-1, 1) for turn in (-2, -1, 0, 1)])
    tools = robot.tool(np.zeros((len(ways), 3)), np.pi / 2 * ways)
    tool = tools[np.argmax(end * tools[:, 2, 3])]
    assert abs(tool[2, 2]) < 1e-9
    axis = np.cross(tool[:3, 2], [0.0, 0.0, end])
    turn = Rotation.from_rotvec(-cone * axis).as_matrix() @ tool[:3, :3]
    turned = {"orientation": turn} if framed else {"direction": turn[:, 2]}
    target = Target(tool[:3, 3], cone=cone, **turned)
    outer = reach_of(scene_of(World("straight", robot, FLOOR)), target)
    assert outer.distance(shapely.Point(axis_of(robot, np.zeros(3)))) < 1e-6


@pytest.mark.parametrize("goal", ["direction", "orientation"])
def test_a_pose_whose_wrist_is_out_of_reach_is_unreachable(goal: str) -> None:
    """The tool's point would be reached, and was all that was looked at: such a target was undecided."""
    robot = six_axes()
    up = np.array([0.0, 0.0, float(robot.mount[2]) + 0.98])
    for sign, verdict in ((-1.0, "unreachable"), (1.0, "reachable")):  # the tool down from above, or up
        turn = np.diag([1.0, sign, sign])
        target = Target(up, turn[:, 2], 0.05)
        if goal == "orientation":
            target = Target(up, cone=0.05, orientation=turn)
        world = World("above", robot, FLOOR, rules=Rules(avoidance=False))
        assert reach(world, [target]).verdict.tolist() == [verdict]
    assert reach(world, [Target(up)]).verdict.tolist() == ["reachable"]
