from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.timing.trajectory import trajectory
from regionik.values import Motion, Plan
from regionik.view.options import VIEW
from regionik.view.plan_picture import display_times, key_frames, turn_quaternions
from regionik.view.timeline import timeline
from regionik.worlds.joints import Joint
from tests import examples
from tests.plans import every_solid, l_shape, synthetic_plan, timed


def _with(plan: Plan, table: np.ndarray, kinds: list[str]) -> Plan:
    n = len(table)
    owner = np.where(np.array(kinds) == "setpoint", 0, -1)
    moved = Motion(table[:, :3], table[:, 3:], np.array(kinds), owner, np.full(n, np.nan))
    return dataclasses.replace(plan, motion=moved)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return synthetic_plan(l_shape())


@pytest.mark.parametrize("world", [l_shape(), every_solid()])
def test_setpoints_are_kept_and_time_runs_on(world: object) -> None:
    plan = synthetic_plan(world)  # type: ignore[arg-type]
    frames = key_frames(plan, display_times(plan))
    assert (np.diff(frames.times) > 0).all()
    assert VIEW.animation.min_duration - 1e-9 <= frames.times[-1] <= VIEW.animation.max_duration + 1e-9
    assert frames.duration == pytest.approx(frames.times[-1] + VIEW.animation.end_pause)
    assert np.isin(frames.passed, frames.times).all()
    at = np.searchsorted(frames.times, frames.passed)
    tools = world.robot.tool(frames.base[at], frames.joints[at])[:, :3, 3]  # type: ignore[attr-defined]
    assert np.allclose(tools, [t.position for t in plan.world.task], atol=1e-9)


def test_a_timed_plan_keeps_its_times_and_goes_as_its_trajectory_does(plan: Plan) -> None:
    moving = timed(plan)
    frames, motion = key_frames(moving, display_times(moving)), moving.motion
    at = motion.kind == "setpoint"
    assert (frames.times[0], frames.times[-1]) == (0.0, motion.time[-1])
    assert np.array_equal(frames.passed, motion.time[at])
    assert np.isin(frames.passed, frames.times).all()
    sample = trajectory(moving).sample(frames.times)
    assert np.abs(frames.joints - sample.joints).max() < 1e-9
    assert np.abs(frames.base - sample.base).max() < 1e-9
    curves = timeline(moving, motion.time)
    rows = np.searchsorted(curves.times, motion.time[at])
    assert np.array_equal(curves.times[rows], motion.time[at])
    assert np.abs(curves.joints[rows] - motion.joints[at]).max() < 1e-9
    assert curves.timed
    assert set(curves.speeds) == {"tool", "base"}


def test_yaw_goes_the_shorter_way_and_big_turns_are_cut(plan: Plan) -> None:
    table = np.zeros((3, 8))
    table[:, 2] = [3.0, -3.0, 3.0]
    table[:, 3] = [0.0, 5.0, -5.0]
    shown = _with(plan, table, ["setpoint", "transit", "step"])
    frames = key_frames(shown, display_times(shown))
    assert frames.base[:, 2].max() == pytest.approx(2 * np.pi - 3)
    assert frames.base[:, 2].min() == pytest.approx(3.0)
    assert np.abs(np.diff(frames.joints[:, 0])).max() <= np.pi / 2 + 1e-9
    middle = int(np.flatnonzero(frames.joints[:, 0] == 5.0)[0])
    assert frames.lifted[1 : middle + 1].all()
    assert not frames.lifted[0]
    assert not frames.lifted[middle + 1 :].any()


def test_a_base_on_wheels_is_shown_on_its_arcs(plan: Plan) -> None:
    robot = dataclasses.replace(plan.world.robot, base="differential")
    rolling = dataclasses.replace(plan, world=dataclasses.replace(plan.world, robot=robot))
    table = np.zeros((4, 8))
    table[1, :3] = 1.0, 1.0, np.pi / 2  # a quarter of a circle round (0, 1)
    table[2, :4] = 1.0, 3.0, np.pi / 2, 0.8
    table[3] = table[2]
    shown = _with(rolling, table, ["setpoint", "transit", "step", "step"])
    frames = key_frames(shown, display_times(shown))
    on_arc = frames.base[:, 1] <= 1.0
    assert on_arc.sum() > 10
    assert np.allclose(np.hypot(frames.base[on_arc, 0], frames.base[on_arc, 1] - 1), 1.0)
    assert np.allclose(frames.base[~on_arc, 0], 1.0)
    assert frames.lifted[1 : on_arc.sum()].all()
    assert not frames.lifted[on_arc.sum() :].any()
    assert (np.diff(frames.times) > 0).all()


@settings(max_examples=examples(50))
@given(
    st.lists(st.floats(-0.99, 0.99), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.floats(-9, 9),
)
def test_quaternions_turn_as_joints_do(axis: list[float], angle: float) -> None:
    joint = Joint("j", "revolute", -10, 10, np.eye(4), np.array(axis))
    x, y, z, w = turn_quaternions(joint.axis, np.array([angle]))[0]
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert np.allclose(turned, joint.transform(angle)[:3, :3], atol=1e-12)
