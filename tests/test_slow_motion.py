"""Motions that take hours: timing costs what its states cost, whatever the clock shows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest
import shapely

from regionik.pipeline import plan
from regionik.timing.limit_usage import largest_usage, slowdowns
from regionik.timing.limits import MotionLimits, segments_on_path
from regionik.timing.retime import retime
from regionik.timing.trajectory import trajectory
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.maths import Array
from tests.planned import planned

JERKS = {"base_jerk": 5.0, "joint_jerk": 10.0}


@contextmanager
def counted_states() -> Iterator[list[int]]:
    """States whose frames are computed while this is on, in turn."""
    seen, frames = list[int](), Robot.frames

    def counting(self: Robot, base: Array, joints: Array) -> Array:
        seen.append(int(np.prod(np.shape(base)[:-1])))
        return frames(self, base, joints)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Robot, "frames", counting)
        yield seen


@pytest.mark.parametrize("jerks", [{}, JERKS], ids=["accelerations", "jerks"])
def test_a_motion_a_thousand_times_as_slow_costs_hardly_more(jerks: dict[str, float]) -> None:
    fast, cost = planned("free"), list[int]()
    for speed in (0.1, 1e-4):
        with counted_states() as seen:
            found = retime(fast, Speeds(tool_velocity=speed, **jerks))
        cost.append(sum(seen))
        assert verify(found).ok
    assert cost[1] <= (4 if jerks else 1.5) * cost[0]
    assert len(found.motion) <= 20 * len(fast.motion)
    on_path = segments_on_path(found.motion)
    tools = found.world.robot.tool(found.motion.base, found.motion.joints)[:, :3, 3]
    way = np.linalg.norm(np.diff(tools, axis=0), axis=1)[on_path].sum()
    assert np.diff(found.motion.time)[on_path].sum() == pytest.approx(way / 1e-4, rel=3e-3)
    assert found.stats["timing"]["tool"]["held"] > 0.99


@pytest.mark.parametrize("jerks", [{}, JERKS], ids=["accelerations", "jerks"])
def test_a_seam_at_a_millimetre_a_second_costs_what_it_costs_at_two_hundred(jerks: dict[str, float]) -> None:
    cost = list[int]()
    for speed in (0.2, 1e-3):
        with counted_states() as seen:
            found = retime(seam(), Speeds(tool_velocity=speed, **jerks))
        cost.append(sum(seen))
        assert verify(found).ok
    assert cost[1] <= (2.5 if jerks else 1.6) * cost[0]  # of states, which are half of what timing costs
    assert found.stats["timing"]["tool"]["held"] > 0.99


@cache
def seam() -> Plan:
    """A line of 1.3 m along a floor without obstacles."""
    line = np.linspace([0.5, 0.0, 0.25], [1.8, 0.1, 0.25], 8)
    floor = Floor(shapely.box(-0.5, -1.5, 3.0, 1.5))
    task = tuple(Target(point) for point in line)
    return plan(World("seam", robot_named("youbot"), floor, (), task, Rules(clearance=0.1)))


def test_slow_joints_and_a_slow_base_too() -> None:
    cost = list[int]()
    for speed in (0.5, 1e-4):
        with counted_states() as seen:
            found = retime(planned("free"), Speeds(base_velocity=speed, joint_velocity=speed))
        cost.append(sum(seen))
    assert verify(found).ok
    assert found.motion.time[-1] > 10_000
    assert cost[1] <= 8 * cost[0]


@pytest.mark.parametrize("jerks", [{}, JERKS], ids=["accelerations", "jerks"])
def test_the_largest_use_of_limits_is_that_of_all_instants(jerks: dict[str, float]) -> None:
    """Times stretched by random factors: some limits are exceeded, at instants that are nothing special."""
    found = retime(planned("free"), Speeds(tool_velocity=0.2, **jerks))
    limits, motion = MotionLimits(found.world.robot, found.world.speeds or Speeds()), found.motion
    used, moving = largest_usage(limits, motion), trajectory(found)
    times = np.linspace(0.0, moving.duration, 20_001)[:-1]
    segment = np.searchsorted(motion.time, times, side="right") - 1
    sample = moving.sample(times)
    seen = limits.usage(*sample.columns, limits.tool_speeds(motion)[segment], sample.jerk)
    for name, value in seen.items():
        assert (used[name][segment] >= value * (1 - 1e-4) - 1e-9).all(), name
        assert used[name].max() <= value.max() * (1 + 1e-2) + 1e-9
    assert slowdowns(limits, motion).max() <= 1.0
