"""Plans timed with limited jerk: kept at every moment, on wheels too, and proven by code of its own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings

from regionik.output.plan_file import load_plan
from regionik.timing import retime as stage
from regionik.timing.limits import MotionLimits
from regionik.timing.retime import retime
from regionik.timing.smooth_path import SLIP
from regionik.timing.trajectory import SplineTrajectory, trajectory
from regionik.values import Plan, Report, Violation
from regionik.verification.motion import MotionSegments
from regionik.verification.timed_segments import timed_segments
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from tests import examples
from tests.kinds import BaseKind
from tests.maths import Array
from tests.planned import planned
from tests.plans import of_kind
from tests.soak import against
from tests.test_steering import ARCS, SPEEDS, Arc, driven

JERKS = {"base_jerk": 4.0, "turn_jerk": 6.0, "joint_jerk": 5.0}
KINDS: tuple[BaseKind, ...] = ("omni", "differential", "car")
PARTS = [(0.2, False, 0.3), (0.2, False, 0.4), (0.15, False, -0.2), (0.2, True, 0.8), (0.1, True, 0.7)]
STEP = 1e-3  # of time, at which trajectories are differentiated [s]
SLACK = 1 + 1e-5


@cache
def timed(kind: BaseKind) -> Plan:
    return retime(driven(kind, PARTS), replace(SPEEDS, **JERKS))


def differences(found: Plan, order: int) -> Array:
    """Means of derivatives of base and joints by time."""
    moving = trajectory(found)
    rows = moving.sample(np.arange(0.0, moving.duration, STEP)).columns[0]
    return np.diff(rows, order, axis=0) / STEP**order


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=examples(4))
@given(ARCS)
@example(parts=[(0.0625, False, 0.0), (0.03125, False, 0.5)])  # wheels come within rounding of a state
def test_limits_hold_for_what_is_differentiated_by_numbers(kind: BaseKind, parts: list[Arc]) -> None:
    """A third difference is a mean of jerks."""
    found = retime(driven(kind, parts), replace(SPEEDS, **JERKS))
    assert verify(found).ok
    assert verify(found).margins["jerk"] < 1
    jerk, gained = differences(found, 3), differences(found, 2)
    noise = 1e-14 / STEP**3  # rounding of positions
    assert np.hypot(*jerk[:, :2].T).max() <= JERKS["base_jerk"] * SLACK + 8 * noise
    assert np.abs(jerk[:, 2]).max() <= JERKS["turn_jerk"] * SLACK + 8 * noise
    assert np.abs(jerk[:, 3:]).max() <= JERKS["joint_jerk"] * SLACK + 8 * noise
    assert np.hypot(*gained[:, :2].T).max() <= SPEEDS.base_acceleration * SLACK
    assert np.abs(gained[:, 2]).max() <= SPEEDS.turn_acceleration * SLACK


@pytest.mark.parametrize("kind", KINDS)
def test_rates_are_derivatives_and_wheels_hardly_slip(kind: BaseKind) -> None:
    found = timed(kind)
    moving = trajectory(found)
    assert isinstance(moving, SplineTrajectory)
    middle, h = np.linspace(0.0, moving.duration, 400)[1:-1], 1e-5
    here, before, after = (moving.sample(middle + shift).columns for shift in (0.0, -h, h))
    for order in (0, 1):
        slope = (after[order] - before[order]) / (2 * h)
        assert np.abs(slope - here[order + 1]).max() < 1e-7
    if kind != "omni":
        yaw, (x, y) = here[0][:, 2], here[1][:, :2].T
        assert np.abs(y * np.cos(yaw) - x * np.sin(yaw)).max() < SLIP * np.hypot(x, y).max()


@pytest.mark.parametrize("kind", KINDS)
def test_states_are_passed_and_at_rest_nothing_accelerates(kind: BaseKind) -> None:
    found = timed(kind)
    motion = found.motion
    look = trajectory(found).sample(motion.time)
    turned = (look.base[:, 2] - motion.base[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(look.base[:, :2] - motion.base[:, :2]).max() < 1e-9
    assert np.abs(turned).max() < 1e-9
    assert np.abs(look.joints - motion.joints).max() < 1e-9
    rests = np.flatnonzero(
        (np.diff(motion.base, axis=0) == 0).all(1) & (np.diff(motion.joints, axis=0) == 0).all(1)
    )
    rests = np.concatenate([[0, len(motion) - 1], rests])
    assert max(np.abs(rates[rests]).max() for rates in look.columns[1:]) < 1e-6


def rate(polynomials: Array, span: Array) -> Array:
    """By time, of polynomials of a share of it."""
    found: Array = polynomials[:, 1:] * np.arange(1, polynomials.shape[1])[:, None] / span[:, None, None]
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_the_polynomials_are_those_of_the_trajectory(kind: BaseKind) -> None:
    """Two codes of one definition, to the third derivative."""
    found = timed(kind)
    course = timed_segments(MotionSegments(found.world.robot, found.motion), found.world.speeds)
    k, span = course.moving, course.piece_span
    again = np.append(False, k[1:] == k[:-1])
    start = found.motion.time[k] + np.where(again, span, 0.0)
    for share in (0.1, 0.5, 0.9):
        base, joints, slip = course.polynomials
        times = start + share * span
        sample = trajectory(found).sample(times)
        jerk = sample.jerk
        assert jerk is not None
        value = []
        for _ in range(4):
            value.append(
                [np.einsum("mnk,n->mk", p, share ** np.arange(p.shape[1])) for p in (base, joints, slip)]
            )
            base, joints, slip = (rate(p, span) for p in (base, joints, slip))
        assert np.abs(value[1][1] - sample.joint_velocity).max() < 1e-6
        assert np.abs(value[2][1] - sample.joint_acceleration).max() < 1e-5
        assert np.abs(value[3][1] - jerk[:, 3:]).max() < 1e-4
        assert np.abs(value[3][0][:, -1] - jerk[:, 2]).max() < 1e-4
        went = value[1][0][:, :-1]
        if kind != "omni":
            went = (
                went * np.column_stack([np.cos(sample.base[:, 2]), np.sin(sample.base[:, 2])]) + value[1][2]
            )
        assert np.abs(np.hypot(*went.T) - np.hypot(*sample.base_velocity[:, :2].T)).max() < 1e-6
        if kind != "omni":
            assert np.abs(went - sample.base_velocity[:, :2]).max() < 1e-6


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("limit", JERKS)
def test_what_goes_beyond_a_limit_is_named(kind: BaseKind, limit: str) -> None:
    """A hundredth below what is used of the limit."""
    found = timed(kind)
    used, asked = found.stats["timing"]["used"][limit], JERKS[limit]
    speeds = replace(found.world.speeds, **{limit: 0.99 * used * asked})  # type: ignore[type-var]
    report = verify(replace(found, stats={}, world=replace(found.world, speeds=speeds)))
    assert {one.kind for one in report.violations} == {"jerk"}
    assert all("jerk" in one.text and "of its limit between states" in one.text for one in report.violations)
    assert report.margins["jerk"] < 0


@pytest.mark.parametrize("kind", ["differential", "car"])
def test_no_segment_has_more_jerk_of_the_base_than_is_told(kind: BaseKind) -> None:
    """Along the heading and across it: on arcs that are driven steadily nearly all of it is across."""
    found, limit = timed(kind), 1e-3
    speeds = replace(found.world.speeds, base_jerk=limit)  # type: ignore[type-var]
    report = verify(replace(found, stats={}, world=replace(found.world, speeds=speeds)))
    told: dict[int, float] = {}  # by segment, of as many as a report lists
    for one in report.violations:
        if one.text.startswith("the base's jerk") and one.state is not None:
            told[one.state] = max(told.get(one.state, 0.0), (1 + one.amount) * limit)
    jerk = np.hypot(*differences(found, 3)[:, :2].T)
    begins = STEP * np.arange(len(jerk))
    here, there = (
        np.searchsorted(found.motion.time, t, side="right") - 1 for t in (begins, begins + 3 * STEP)
    )
    known = np.flatnonzero((here == there) & np.isin(here, list(told)))
    assert len(known) > 1000
    assert (jerk[known] <= [told[k] * SLACK + 1e-4 for k in here[known].tolist()]).all()


def test_the_second_opinion_objects_to_lower_limits_alone() -> None:
    found = timed("omni")
    assert against(found) == ()
    for limit, told in (("base_jerk", "the base jerks"), ("joint_jerk", "a joint jerks")):
        speeds = replace(found.world.speeds, **{limit: 0.5 * JERKS[limit]})  # type: ignore[type-var]
        texts = against(replace(found, world=replace(found.world, speeds=speeds)))
        assert any(text.startswith(f"differences: {told}") for text in texts)


@pytest.mark.parametrize("kind", ["speeds", "jerk"])
def test_bounds_that_are_slightly_over_slow_the_motion_there_and_rest_it_nowhere(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """The robot rested at each of 358 set-points of a circle, as the bounds of three segments were over."""

    def strict(plan: Plan) -> Report:
        report, span = verify(plan), float(plan.motion.time[-1])
        if span > 1.001 * before:
            return report
        over = Violation(kind, len(plan.motion) // 2, None, 0.004, "the bound is over")
        return replace(report, ok=False, violations=(over,))

    before = float(timed("omni").motion.time[-1])
    monkeypatch.setattr(stage, "verify", strict)
    found = retime(driven("omni", PARTS), replace(SPEEDS, **JERKS))
    assert 1.001 * before < found.motion.time[-1] < 1.1 * before
    assert len(found.motion) == len(timed("omni").motion)


def test_one_limit_of_jerk_alone() -> None:
    found = retime(driven("omni", PARTS), replace(SPEEDS, joint_jerk=2.0))
    assert set(found.stats["timing"]["used"]) >= {"joint_jerk", "base_acceleration"}
    assert "base_jerk" not in found.stats["timing"]["used"]
    assert np.abs(differences(found, 3)[:, 3:]).max() <= 2.0 * SLACK + 1e-4


def test_a_bundled_plan_holds_near_its_path_and_reads_back(tmp_path: pytest.TempPathFactory) -> None:
    before = planned("l_shape")
    found = retime(before, Speeds(tool_velocity=0.2, base_jerk=10.0, turn_jerk=30.0, joint_jerk=30.0))
    assert verify(found).ok
    limits, spline = MotionLimits(found.world.robot, Speeds()), trajectory(found)
    time = found.motion.time
    for share in (0.3, 0.5, 0.8):  # near the segments that were verified
        moves = np.flatnonzero(np.diff(time) > 0)
        sample = spline.sample(time[moves] + share * np.diff(time)[moves])
        q, a, b = (
            sample.columns[0],
            *(np.column_stack([found.motion.base, found.motion.joints])[moves + k] for k in (0, 1)),
        )
        b[:, 2] = a[:, 2] + (b[:, 2] - a[:, 2] + np.pi) % (2 * np.pi) - np.pi
        q[:, 2] = a[:, 2] + (q[:, 2] - a[:, 2] + np.pi) % (2 * np.pi) - np.pi
        part = ((q - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1)
        off = q - a - part[:, None] * (b - a)
        assert limits.displacement(q - off, q).max() <= 1.5 * Speeds.blend
    path = f"{tmp_path}/plan.json"
    found.save(path)
    assert np.array_equal(trajectory(load_plan(path)).sample(time).joints, spline.sample(time).joints)


@pytest.mark.parametrize("limited", [True, False])
def test_a_wider_blend_makes_corners_quicker(limited: bool) -> None:
    jerks = {"base_jerk": 10.0, "turn_jerk": 30.0, "joint_jerk": 30.0} if limited else {}
    wide, narrow = (retime(planned("l_shape"), Speeds(**jerks, blend=blend)) for blend in (1e-3, 1e-4))
    assert wide.motion.time[-1] < 0.95 * narrow.motion.time[-1]


def test_limits_in_world_files(tmp_path: pytest.TempPathFactory) -> None:
    found = timed("omni")
    document = world_to_document(found.world)
    assert world_from_document(document).speeds == found.world.speeds
    document["speeds"] = {"joint_jerk": [1.0, 2.0]}
    with pytest.raises(InputError, match="speeds: joint_jerk: expected one number or 5"):
        world_from_document(document)
    with pytest.raises(InputError, match="turn_jerk: must be above 0, got 0"):
        Speeds(turn_jerk=0.0)


def test_times_that_fit_no_motion_are_refused() -> None:
    found = timed("omni")
    still = replace(found, stats={}, motion=replace(found.motion, time=0 * found.motion.time))
    with pytest.raises(InputError, match="time the plan anew"):
        trajectory(still)
    assert "without jumps of acceleration passes" in of_kind(verify(still), "speeds")[0].text
