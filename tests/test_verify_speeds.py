"""Speeds and accelerations of timed plans as `verify` bounds them: at every moment, by code of its own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from regionik.timing.limits import MotionLimits
from regionik.timing.parametrization import fastest_times
from regionik.timing.retime import retime
from regionik.timing.trajectory import trajectory
from regionik.values import Motion, Plan
from regionik.verification.motion import MotionSegments
from regionik.verification.timed_segments import TimedSegments
from regionik.verification.verifier import verify
from regionik.worlds.limits import Speeds
from tests.kinds import BaseKind
from tests.maths import Array
from tests.plans import of_kind, plan_of, straight, world_of, youbot
from tests.test_steering import SPEEDS, driven

PARTS = [(0.2, False, 0.3), (0.2, False, 0.4), (0.15, False, -0.2), (0.2, True, 0.8), (0.1, True, 0.7)]
LIMITED = ["base_velocity", "base_acceleration", "turn_velocity", "turn_acceleration"]
LIMITED += ["joint_velocity", "joint_acceleration"]


@cache
def timed(kind: BaseKind) -> Plan:
    return retime(driven(kind, PARTS))


@pytest.mark.parametrize("kind", ["omni", "differential", "car"])
def test_the_polynomials_are_those_of_the_trajectory(kind: BaseKind) -> None:
    """Two codes of one definition: derivatives of joints, heading, and what the base rolls or slides."""
    found = timed(kind)
    course = TimedSegments(MotionSegments(found.world.robot, found.motion))
    base, joints, _ = course.polynomials
    share = np.linspace(0.1, 0.9, 5)
    k, moving = course.moving, trajectory(found)
    for one in share:
        sample = moving.sample(found.motion.time[k] + one * course.span[k])
        powers = np.arange(1, base.shape[1]) * one ** np.arange(base.shape[1] - 1) / course.span[k, None]
        rate = np.einsum("mn,mnk->mk", powers, base[:, 1:])
        assert np.abs(np.einsum("mn,mnk->mk", powers, joints[:, 1:]) - sample.joint_velocity).max() < 1e-6
        assert np.abs(rate[:, -1] - sample.base_velocity[:, 2]).max() < 1e-6
        went = np.hypot(*sample.base_velocity[:, :2].T)
        assert np.abs(np.linalg.norm(rate[:, :-1], axis=1) - went).max() < 1e-6


@pytest.mark.parametrize(
    ("kind", "limit"),
    [
        *(("omni", limit) for limit in LIMITED),
        ("differential", "turn_acceleration"),
        ("car", "base_velocity"),
        ("car", "joint_acceleration"),
    ],
)
def test_what_goes_beyond_a_limit_is_named(kind: BaseKind, limit: str) -> None:
    """A hundredth below what is used of the limit."""
    found = timed(kind)
    whole = verify(found)
    assert whole.ok
    assert 0 < whole.margins["speeds"] < 1
    used = found.stats["timing"]["used"][limit]
    speeds = found.world.speeds
    assert speeds is not None
    own = dict(
        zip(
            ("joint_velocity", "joint_acceleration"),
            speeds.joint_limits(found.world.robot.chain),
            strict=True,
        )
    )
    asked: Any = own[limit][0] if limit in own else getattr(speeds, limit)
    less = replace(
        found, stats={}, world=replace(found.world, speeds=replace(speeds, **{limit: 0.99 * used * asked}))
    )
    report = verify(less)
    assert {one.kind for one in report.violations} == {"speeds"}
    word = "speed" if "velocity" in limit else "acceleration"
    assert any(
        "of its limit between states" in one.text and (word in one.text or "turning" in one.text)
        for one in report.violations
    )


def test_a_car_that_steers_too_fast_is_named() -> None:
    """It stands to steer from one of these arcs to the next."""
    found = retime(driven("car", [(0.2, False, 0.5), (0.2, False, -0.5), (0.2, False, 0.8)]))
    quick = replace(found.world, speeds=replace(SPEEDS, steering_velocity=0.6))
    told = of_kind(verify(replace(found, stats={}, world=quick)), "speeds")
    assert len(told) == 2
    assert all("the steering reaches" in one.text for one in told)


def test_steering_as_a_car_rolls_is_bounded_closely() -> None:
    """From one part of a millisecond to the next it turns hardly less than the bound says."""
    bends = [(0.06, False, bend) for bend in (0.0, 0.07, 0.12, 0.2, 0.12, 0.05)]
    found = retime(driven("car", bends), replace(SPEEDS, steering_velocity=0.3))
    sample = trajectory(found).sample(np.linspace(0.0, found.motion.time[-1], 20_000)[1:-1])
    ahead = np.column_stack([np.cos(sample.base[:, 2]), np.sin(sample.base[:, 2])])
    rolled = (sample.base_velocity[:, :2] * ahead).sum(axis=1)
    angle = np.arctan(found.world.robot.turning_radius * sample.base_velocity[:, 2] / rolled)
    used = float((np.abs(np.diff(angle)) / np.diff(sample.time)).max())
    for share in (1.01, 0.98):
        world = replace(found.world, speeds=replace(SPEEDS, steering_velocity=share * used))
        told = verify(replace(found, stats={}, world=world)).violations
        assert bool(told) == (share < 1), told
        assert all("the steering reaches" in one.text for one in told)


def test_a_car_beyond_its_lock_is_named() -> None:
    """Of arcs that are none too tight, a smooth curvature through them."""
    plan = driven("car", [(0.06, False, bend) for bend in (0.9, 0.95, 1.0, 0.95, 0.9)])
    times = fastest_times(MotionLimits(plan.world.robot, SPEEDS), plan.motion)
    found = replace(plan, motion=replace(plan.motion, time=times), stats={})
    assert any("the steering's lock reaches 1.0" in one.text for one in verify(found).violations)


def test_a_wheel_that_turns_too_fast_is_named() -> None:
    """A wheel goes as the axle's middle does, and by half the gauge for each radian more or less."""
    found, gauge = timed("differential"), 0.4
    times = np.linspace(0.0, found.motion.time[-1], 20_000)
    moved = trajectory(found).sample(times).base_velocity
    quickest = float((np.hypot(*moved[:, :2].T) + gauge / 2 * np.abs(moved[:, 2])).max())
    assert found.world.speeds is not None
    for share in (1.01, 0.99):
        speeds = replace(found.world.speeds, wheel_velocity=share * quickest)
        world = replace(found.world, robot=replace(found.world.robot, gauge=gauge), speeds=speeds)
        told = verify(replace(found, stats={}, world=world)).violations
        assert any("the speed of a wheel" in one.text for one in told) == (share < 1)


def hasty(span: float, bend: float) -> Plan:
    """A plan at rest for a second, whose first joint then moves for no more than that span, and back."""
    motion = straight(1, 0)
    states = [np.zeros(5), np.eye(5)[0] * bend / 2, np.eye(5)[0] * bend]
    joints = np.array([motion.joints[0] + one for one in [states[0], *states]])
    time = np.array([0.0, 1.0, 1.0 + span / 2, 1.0 + span])
    kind, owner = np.array(["setpoint", "step", "step", "step"]), np.zeros(4, dtype=np.int64)
    moved = Motion(np.repeat(motion.base, 4, axis=0), joints, kind, owner, time)
    world = world_of(moved, robot=youbot())
    return plan_of(replace(world, rules=replace(world.rules, tolerance=0.1, path_tolerance=0.1)), moved)


def test_what_happens_within_a_millisecond_counts() -> None:
    """From rest to rest over x in t takes an acceleration of 4 x / t2."""
    x, t = 1e-7, 4e-4
    reached: Array = np.array([4 * x / t**2])
    for limit, is_ok in ((1.01 * reached[0], True), (0.99 * reached[0], False)):
        plan = hasty(t, x)
        world = replace(plan.world, speeds=Speeds(joint_acceleration=float(limit)))
        assert verify(replace(plan, world=world)).ok == is_ok


def test_times_that_fit_no_motion_are_named() -> None:
    found = timed("omni")
    time = found.motion.time.copy()
    time[len(time) // 2 :] += 0.5
    late = replace(found, stats={}, motion=replace(found.motion, time=time))
    assert "passes at these times" in of_kind(verify(late), "speeds")[0].text


def test_a_plan_carries_the_speeds_that_it_was_timed_by() -> None:
    found = timed("omni")
    slow = Speeds(base_velocity=0.05)
    assert retime(found, slow).world.speeds == slow
    assert not verify(replace(found, stats={}, world=replace(found.world, speeds=slow))).ok
