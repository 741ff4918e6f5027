"""Motions along smooth ways whose least time is known, from states that are sampled along them.

The ways are sums of sines. The least times are from a reachability analysis on 1,200 segments of each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from regionik.timing.inserted_states import blended, refined
from regionik.timing.limits import MotionLimits
from regionik.timing.parametrization import path_of
from regionik.timing.retime import retime
from regionik.values import Configuration, Motion, Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import without_limits
from regionik.worlds.scene import Floor, Heading, Rules, Target, World
from tests.maths import Array

QUICK = Speeds(base_velocity=0.5, joint_velocity=1.5)
JERK = replace(QUICK, base_jerk=10.0, turn_jerk=20.0, joint_jerk=30.0)
FLOOR = Floor([[-2, -2], [3.5, -2], [3.5, 2], [-2, 2]])
BEGIN = np.array([0.0, 0.0, 0.0, 0.0, 1.1, -0.9, 0.9, 0.0])  # x, y, yaw and the joints of the youBot
Sines = Mapping[int, tuple[float, float, float]]
Way = tuple[Mapping[int, float], Sines, float]
# Change of coordinates over the way; height, frequency and phase of the sine of some; least time [s].
WAVE: Way = ({0: 1.5}, {4: (0.35, 2, 0), 5: (0.45, 2, 0.9), 6: (0.4, 3, 0.4)}, 6.607)
CIRCLE: Way = (
    {},
    {0: (0.3, 1, np.pi / 2), 1: (0.3, 1, 0), 4: (0.2, 1, 0.5), 5: (0.3, 2, 1.1)},
    4.330,
)
SWING: Way = (
    {0: 1.0, 1: 0.5, 2: 0.8},
    {0: (0.15, 1.5, 0.3), 1: (0.2, 2, 0), 3: (0.5, 1.5, 0.2)}
    | {4: (0.3, 2.5, 1), 5: (0.4, 2, 2), 6: (0.3, 3, 0)},
    6.363,
)


def along(change: Mapping[int, float], sines: Sines, count: int) -> Array:
    """States (count, 8) evenly along a way."""
    u = np.linspace(0.0, 1.0, count)
    q = np.tile(BEGIN, (count, 1))
    for k, far in change.items():
        q[:, k] += far * u
    for k, (height, often, phase) in sines.items():
        q[:, k] += height * (np.sin(2 * np.pi * often * u + phase) - np.sin(phase))
    return q


def through(q: Array, heading: Heading = "free") -> Plan:
    """A plan through states (n, 8), 21 of which are set-points."""
    robot, every = without_limits(robot_named("youbot")), (len(q) - 1) // 20
    rows = np.arange(0, len(q), every)
    tools = robot.tool(q[rows, :3], q[rows, 3:])[:, :3, 3]
    rules = Rules(clearance=0.0, step=2.0, path_tolerance=0.05, solid_floor=False, heading=heading)
    world = World(
        name="known", robot=robot, floor=FLOOR, obstacles=(), task=tuple(map(Target, tools)), rules=rules
    )
    kind = np.where(np.isin(np.arange(len(q)), rows), "setpoint", "step")
    motion = Motion(q[:, :3], q[:, 3:], kind, np.arange(len(q)) // every, np.full(len(q), np.nan))
    found = tuple(Configuration(row[:3], row[3:], 0.0, 0, True) for row in q[rows])
    return Plan(world, 0, found, motion, (), 0)


@pytest.mark.parametrize("way", [WAVE, CIRCLE, SWING], ids=["wave", "circle", "swing"])
@pytest.mark.parametrize(("count", "blend"), [(401, 2e-4), (101, 2e-3)], ids=["dense", "sparse"])
def test_dense_states_of_a_smooth_motion_lose_hardly_any_time(way: Way, count: int, blend: float) -> None:
    change, sines, least = way
    timed = retime(through(along(change, sines, count)), replace(QUICK, blend=blend))
    assert timed.motion.time[-1] <= 1.03 * least
    assert verify(timed).ok


@pytest.mark.parametrize("way", [CIRCLE, SWING], ids=["circle", "swing"])
def test_a_limit_of_jerk_makes_no_motion_faster(way: Way) -> None:
    change, sines, _ = way
    given = through(along(change, sines, 201))
    assert retime(given, JERK).motion.time[-1] >= retime(given, QUICK).motion.time[-1]


def test_a_base_that_faces_its_targets_does_so_when_it_is_timed_too() -> None:
    """The rounding of corners turned the pivot, and the robot rested at the set-points for that."""
    q = along({0: 1.5, 1: 0.4}, {1: (0.2, 1.5, 0), 4: (0.3, 2, 0), 3: (0.01, 9, 0)}, 61)
    q[::3, 3] = 0.0
    given = through(q, heading="face_target")
    assert verify(given).ok
    timed = retime(given, QUICK)
    moving = np.linalg.norm(np.diff(timed.motion.joints, axis=0), axis=1) > 0
    assert moving.all()
    assert timed.motion.joints[timed.motion.kind == "setpoint", 0] == pytest.approx(0.0, abs=1e-12)


def test_a_joint_that_leaves_its_limit_does_not_pass_it_before() -> None:
    """The splines swing beyond, and the states on them broke the rules: the robot rested there."""
    limits = MotionLimits(robot_named("youbot"), QUICK)
    least = float(limits.robot.chain.lower[1])
    q = along({0: 0.5}, {}, 11)
    q[:, 4] = least + np.maximum(np.arange(11) - 5, 0) * 0.05
    motion = Motion(
        q[:, :3], q[:, 3:], np.repeat("step", 11), np.zeros(11, dtype=np.int64), np.full(11, np.nan)
    )
    found = refined(limits, blended(limits, motion))
    assert found.joints[:, 1].min() >= least
    path = path_of(limits.robot, found)
    k = np.repeat(np.arange(len(found) - 1), 9)
    share = np.tile(np.arange(1, 10) / 10, len(found) - 1)
    z, _, _ = path.evaluate(path.position[k] + share * path.lengths[k], k)
    assert z[:, 4].min() >= least - 2e-5
