"""Timed plans of bases on wheels: their turning rate has no jumps, and a car's steering takes its time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import box

from regionik.timing.retime import retime
from regionik.timing.smooth_path import SLIP, SLIPPED, smooth_path
from regionik.timing.trajectory import trajectory
from regionik.values import Plan
from regionik.verification import speeds
from regionik.verification.verifier import verify
from regionik.worlds.drives import CarDrive
from regionik.worlds.limits import Speeds
from regionik.worlds.scene import Floor, Rules
from tests import examples
from tests.kinds import BaseKind
from tests.maths import Array, arc_end
from tests.plans import drive, plan_of, world_of, youbot
from tests.soak import against
from tests.test_retime import timed
from tests.timed import SLACK

RADIUS = 0.4  # of the car's tightest arc [m]
SPEEDS = Speeds(base_velocity=0.6, turn_velocity=1.2, turn_acceleration=1.5, steering_velocity=0.7)
STEP = 1e-3  # of time, at which trajectories are differentiated [s]
SAME = 1e-7  # of angles of steering [rad]

Arc = tuple[float, bool, float]
ARCS = st.lists(st.tuples(st.floats(0.02, 0.25), st.booleans(), st.floats(-1.0, 1.0)), min_size=2, max_size=7)


def driven(kind: BaseKind, parts: list[Arc]) -> Plan:
    """A plan that drives along arcs: lengths, whether in reverse, parts of the car's largest curvature."""
    base, swing = [(0.0, 0.0, 0.3)], np.zeros((len(parts) + 1, 5))
    for length, reverse, bend in parts:
        base.append(arc_end(*base[-1], -length if reverse else length, bend * length / RADIUS))
    swing[:, 0] = 0.1 * np.arange(len(base))
    motion = drive(*base)
    motion = replace(motion, joints=motion.joints + swing)
    robot = replace(youbot(), base=kind, turning_radius=RADIUS if kind == "car" else 0.0)
    world = world_of(motion, robot=robot, rules=Rules(clearance=0.0, step=0.3))
    floor = Floor(box(-4.0, -4.0, 4.0, 4.0))
    return plan_of(replace(world, floor=floor, speeds=SPEEDS), motion, 1)


def rows(found: Plan) -> Array:
    moving = trajectory(found)
    return moving.sample(np.arange(0.0, moving.duration, STEP)).columns[0]


@pytest.mark.parametrize("kind", ["car", "differential"])
@settings(max_examples=examples(8))
@given(ARCS)
def test_limits_hold_for_what_is_differentiated_by_numbers(kind: BaseKind, parts: list[Arc]) -> None:
    """A second difference is a mean of accelerations."""
    q = rows(retime(driven(kind, parts)))
    gained = np.diff(q, 2, axis=0) / STEP**2
    assert np.abs(gained[:, 2]).max() <= SPEEDS.turn_acceleration * SLACK
    assert np.hypot(*gained[:, :2].T).max() <= SPEEDS.base_acceleration * SLACK
    assert np.abs(np.diff(q[:, 2])).max() <= SPEEDS.turn_velocity * STEP * SLACK


@pytest.mark.parametrize("kind", ["car", "differential"])
@settings(max_examples=examples(4))
@given(ARCS)
def test_wheels_hardly_slip_between_states_and_all_stay_next_to_the_arcs(
    kind: BaseKind, parts: list[Arc]
) -> None:
    plan = driven(kind, parts)
    found = retime(plan)
    moving = trajectory(found)
    sample = moving.sample(np.linspace(0.0, moving.duration, 500))
    yaw, (x, y) = sample.base[:, 2], sample.base_velocity[:, :2].T
    assert np.abs(y * np.cos(yaw) - x * np.sin(yaw)).max() < SLIP * np.hypot(x, y).max()
    shares = np.linspace(0, 1, 400)
    ways = [plan.world.robot.drive.between(a, b, s) for a, b in pairwise(plan.motion.base) for s in shares]
    off = np.linalg.norm(np.array(ways)[:, None, :2] - sample.base[::10, :2], axis=2).min(axis=0)
    assert off.max() < 2 * SPEEDS.blend + 0.25 / 400


WINDING = [(0.29, False, bend) for bend in (0.05, 0.25, 0.45, 0.65, 0.85)]


@pytest.mark.parametrize("jerk", [None, 5.0])
def test_wheels_hardly_slip_however_far_the_motion_may_leave_its_arcs(jerk: float | None) -> None:
    limits = replace(SPEEDS, base_jerk=jerk, turn_jerk=jerk, joint_jerk=jerk)
    found = retime(driven("differential", WINDING), replace(limits, blend=1.0))
    assert verify(found).ok
    assert np.abs(np.diff(found.motion.base, axis=0)).max(axis=1).min() > 0  # it rests nowhere
    moving, time = trajectory(found), found.motion.time
    for k in np.flatnonzero(np.diff(time) > 0).tolist():
        times = np.linspace(time[k], time[k + 1], 200)
        sample = moving.sample(times)
        yaw, (x, y) = sample.base[:, 2], sample.base_velocity[:, :2].T
        aside = abs(np.trapezoid(y * np.cos(yaw) - x * np.sin(yaw), times))
        assert aside <= SLIPPED + SLIP * np.trapezoid(np.hypot(x, y), times) + 1e-9


@pytest.mark.parametrize("jerk", [None, 5.0])
def test_wheels_that_slip_farther_are_named(jerk: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    limits = replace(SPEEDS, base_jerk=jerk, turn_jerk=jerk, joint_jerk=jerk)
    found = retime(driven("differential", WINDING), limits)
    monkeypatch.setattr(speeds, "SLIP", 0.0)
    monkeypatch.setattr(speeds, "SLIPPED", 1e-7)
    report = verify(replace(found, stats={}))
    assert {one.kind for one in report.violations} == {"speeds"}
    assert "the slip of the wheels" in report.violations[0].text


def test_a_car_stands_while_it_steers_and_its_arcs_stay_as_tight_as_they_are() -> None:
    """Half lock to the left, full lock to the right: 45 degrees and 26.6 degrees of steering."""
    found = retime(driven("car", [(0.2, False, 0.5), (0.2, False, -1.0), (0.2, True, 1.0)]))
    time, base = found.motion.time, found.motion.base
    stands = [(a, b) for (a, p), (b, q) in pairwise(zip(time, base, strict=True)) if (p == q).all() and b > a]
    assert [b - a for a, b in stands] == [pytest.approx((np.arctan(0.5) + np.pi / 4) / 0.7, abs=1e-9)]
    (began, ended) = stands[0]
    still = trajectory(found).sample(np.linspace(began, ended, 5)[1:-1])
    assert not still.base_velocity.any()
    assert not still.joint_velocity.any()
    assert not still.base_acceleration.any()
    q = rows(found)
    went, turned = np.hypot(*np.diff(q[:, :2], axis=0).T), np.abs(np.diff(q[:, 2]))
    fast = went > 1e-5
    assert (turned[fast] / went[fast]).max() <= 1 / RADIUS + 1e-6


def test_a_car_turns_its_steering_while_the_arm_moves() -> None:
    plan = driven("car", [(0.2, False, 1.0), (0.0, False, 0.0), (0.2, False, -1.0)])
    joints = plan.motion.joints.copy()
    joints[2:, 0] += 1.0  # takes longer than the steering
    found = retime(
        replace(plan, motion=replace(plan.motion, joints=joints)), replace(SPEEDS, steering_velocity=5.0)
    )
    still = (np.diff(found.motion.base, axis=0) == 0).all(1) & (
        np.diff(found.motion.joints, axis=0) == 0
    ).all(1)
    assert still.any()
    assert (np.diff(found.motion.time)[still] == 0).all()


def test_a_car_waits_for_its_steering_however_little_its_arm_turns_off() -> None:
    """The arm moves on as the base begins to roll: no corner, but the steering is not turned yet."""
    found = retime(driven("car", [(0.01, False, 1.0), (0.0, False, 0.0), (0.01, False, -1.0)]))
    still = (np.diff(found.motion.base, axis=0) == 0).all(axis=1)
    assert np.diff(found.motion.time)[still].sum() >= np.pi / 2 / 0.7 - 1e-9


GENTLY = st.lists(st.floats(-0.08, 0.08), min_size=3, max_size=12)


@settings(max_examples=examples(8))
@given(st.floats(-0.6, 0.6), GENTLY, st.floats(0.05, 2.0))
def test_a_car_steers_as_it_rolls_where_its_curvature_changes_little(
    first: float, changes: list[float], rate: float
) -> None:
    bends = np.clip(first + np.concatenate([[0.0], np.cumsum(changes)]), -0.7, 0.7)
    found = retime(
        driven("car", [(0.06, False, bend) for bend in bends.tolist()]),
        replace(SPEEDS, steering_velocity=rate),
    )
    time, base = found.motion.time, found.motion.base
    assert np.abs(np.diff(base, axis=0)).max(axis=1).min() > 0  # it rests nowhere
    sample = trajectory(found).sample(np.linspace(0.0, time[-1], 4000)[1:-1])
    ahead = np.column_stack([np.cos(sample.base[:, 2]), np.sin(sample.base[:, 2])])
    rolled = (sample.base_velocity[:, :2] * ahead).sum(axis=1)
    steering = np.arctan(RADIUS * sample.base_velocity[:, 2] / rolled)
    assert np.abs(steering).max() <= np.pi / 4 + SAME
    turned = np.abs(np.diff(steering)) / np.diff(sample.time)
    assert turned.max() <= rate * SLACK + 1e-3  # wheels slip a little
    assert against(found) == ()


def test_a_car_at_its_lock_stands_to_steer_however_little() -> None:
    """A smooth curvature that comes to the lock goes beyond it."""
    found = retime(driven("car", [(0.1, False, 1.0), (0.1, False, 0.95), (0.1, False, 1.0)]))
    assert int((np.diff(found.motion.base, axis=0) == 0).all(axis=1).sum()) == 2


def test_a_car_need_not_steer_for_what_is_rounding() -> None:
    """A base that stands while its arm moves may creep by nanometres, on any arc."""
    plan = driven("car", [(0.2, False, 0.5), (0.0, False, 0.0), (0.0, False, 0.0), (0.2, False, 0.5)])
    x, y, yaw = plan.motion.base[1].tolist()
    base = plan.motion.base.copy()
    base[2:4] = x, y, yaw = arc_end(x, y, yaw, 4e-9, -4e-9 / RADIUS)
    base[4] = arc_end(x, y, yaw, 0.2, 0.5 * 0.2 / RADIUS)
    found = retime(replace(plan, motion=replace(plan.motion, base=base)))
    assert found.motion.time[-1] < retime(plan).motion.time[-1] + 1e-3


def test_where_a_car_stands_its_steering_has_no_rate() -> None:
    """Between two long motions of the arm a tiny one, in which the base creeps by 0.2 nm."""
    base = np.array(
        [
            [1.0609996490708202, -0.7278588136993009, -3.281504462523861],
            [1.061015394033314, -0.7278610306974229, -3.281455175385654],
            [1.0610153942693419, -0.7278610307306513, -3.2814551761244997],
            [1.061031112771363, -0.7278632432135622, -3.281405972157777],
        ]
    )
    joints = np.array([[0.0], [0.293575], [0.2935794], [0.586659]])
    path = smooth_path(CarDrive(0.3226), base, joints)
    at = path.position[1] + np.linspace(0.0, 0.99, 9) * path.lengths[1]
    assert not path.steering_rate(at, np.ones(9, dtype=np.int64)).any()


def test_a_car_that_stops_to_roll_stands_to_steer() -> None:
    """Its arm goes on meanwhile; where it steers as it rolls its curvature would jump there."""
    steering = [(0.02, False, 0.2), (0.02, False, 0.25), (0.0, False, 0.0), (0.02, False, 0.25)]
    assert corners(steering) == [2, 3]
    even = [(0.02, False, 0.25), (0.02, False, 0.25), (0.0, False, 0.0), (0.02, False, 0.25)]
    assert corners(even) == []


def corners(parts: list[Arc]) -> list[int]:
    motion = driven("car", parts).motion
    found: list[int] = smooth_path(CarDrive(RADIUS), motion.base, motion.joints).corners().tolist()
    return found


@pytest.mark.parametrize(
    ("kind", "less", "told"),
    [
        ("differential", {"turn_acceleration": 1.0}, "differences: the heading gains"),
        ("car", {"steering_velocity": 0.5}, "differences: the steering turns"),
    ],
)
def test_the_second_opinion_objects_to_lower_limits_alone(
    kind: BaseKind, less: dict[str, float], told: str
) -> None:
    found = retime(driven(kind, [(0.2, False, 0.5), (0.2, False, -1.0), (0.2, True, 0.3)]))
    assert against(found) == ()
    world = replace(found.world, speeds=replace(SPEEDS, **less))
    assert any(text.startswith(told) for text in against(replace(found, world=world)))


def test_small_changes_of_curvature_cost_little_time() -> None:
    """A base that stopped at each of the 88 changes would take 18 s."""
    assert timed("door").motion.time[-1] < 8.0
