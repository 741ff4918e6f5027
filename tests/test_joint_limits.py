"""Joints keep off their limits, by whole turns or as far as the tool lets them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from regionik.mfabrik import MAX_CONTINUED_CHANGE, Solver
from regionik.pipeline import plan
from regionik.planners.solvers.serial_chain import rotation_about
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests import examples
from tests.maths import Array, rot_x
from tests.test_closed_form import ARMS

UR = ARMS["ur"]
MIDDLE = (UR.lower + UR.upper) / 2
FLOOR = Floor(shapely.box(-3, -3, 3, 3))


def ur_robot() -> Robot:
    return Robot("ur", "omni", np.zeros((1, 2)), np.array([0.0, 0.0, 0.5, 0.0]), UR, (), 0.1)


def test_joints_that_wind_are_those_of_more_than_one_turn() -> None:
    assert UR.winding.tolist() == (UR.upper - UR.lower > 2 * np.pi).tolist()
    assert UR.winding.any()
    assert not robot_named("youbot").chain.winding.any()
    endless = Chain((replace(UR.joints[0], lower=-np.inf, upper=np.inf), *UR.joints[1:]), UR.T_last_tool)
    assert not endless.winding[0]


@given(seed=st.integers(0, 10_000))
def test_whole_turns_change_nothing_but_the_distance_from_the_limits(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(UR.lower, UR.upper, (5, UR.dof))
    near = UR.unwound(q)
    np.testing.assert_allclose(UR.forward(near), UR.forward(q), atol=1e-9)
    wound = UR.winding
    assert (np.abs(near - MIDDLE)[:, wound] <= np.pi + 1e-9).all()
    assert (near[:, ~wound] == q[:, ~wound]).all()
    np.testing.assert_allclose(UR.unwound(near), near, atol=1e-9)


@pytest.mark.parametrize("kind", ["point", "direction", "orientation"])
def test_postures_that_are_not_led_on_are_near_the_middle(kind: str) -> None:
    """Of a wrist that turns twice the solver gave any turn, up to its limits."""
    robot, rng = ur_robot(), np.random.default_rng(3)
    solver, met = Solver(robot), 0
    for _ in range(max(4, examples(12))):
        tool = robot.tool(np.zeros((1, 3)), rng.uniform(UR.lower, UR.upper)[None])[0]
        asked = {"direction": tool[:3, 2]} if kind == "direction" else {}
        asked = {"orientation": tool[:3, :3]} if kind == "orientation" else asked
        target = Target(tool[:3, 3], cone=0.05, **asked)
        given_joints = rng.uniform(UR.lower, UR.upper)
        some = [solver(target, np.zeros(3), given_joints)]
        some += solver.self_motion(target, np.zeros(3), given_joints, 12)
        for found in some:
            if not found.converged:
                continue
            met += 1
            away, change = np.abs(found.joints - MIDDLE), np.abs(found.joints - given_joints)
            left = UR.winding & (np.arange(UR.dof) > 0)  # the base shares the pivot's turn
            assert ((away <= np.pi + 1e-9) | (change <= MAX_CONTINUED_CHANGE + 1e-9))[left].all()
    assert met > 12


def _raster(count: int) -> tuple[Target, ...]:
    """Poses along a row on a wall ahead, the tool turning about its axis by more than a turn on the way."""
    facing = rot_x(-np.pi / 2)[:3, :3]  # z towards +y
    targets = []
    for k in range(count):
        turn: Array = facing @ rotation_about(np.array([0.0, 0.0, 1.0]), 0.2 * k)
        targets.append(Target(np.array([0.05 * k, 0.8, 0.8]), cone=0.02, orientation=turn))
    return tuple(targets)


def test_a_row_on_a_wall_keeps_off_the_limits() -> None:
    robot = ur_robot()
    found = plan(World("row", robot, FLOOR, (), _raster(6), Rules(avoidance=False)))
    assert verify(found).ok
    assert found.stats["margins"]["joints"] > 0.03
    middle = (found.motion.joints.min(axis=0) + found.motion.joints.max(axis=0)) / 2
    assert (np.abs(middle - MIDDLE)[UR.winding] <= np.pi + 1e-9).all()


def test_a_given_start_keeps_its_turns() -> None:
    robot = ur_robot()
    world = World("row", robot, FLOOR, (), _raster(2), Rules(avoidance=False))
    first = plan(world).motion
    joints = first.joints[0] + np.array([0, 0, 0, 0, 0, 2 * np.pi * (1 if first.joints[0, 5] < 0 else -1)])
    if not ((joints >= UR.lower) & (joints <= UR.upper)).all():
        joints = first.joints[0]
    started = plan(replace(world, start=Start(first.base[0], joints)))
    np.testing.assert_allclose(started.motion.joints[0], joints, atol=1e-12)
    assert verify(started).ok
