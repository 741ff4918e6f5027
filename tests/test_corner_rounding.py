"""Corners rounded within a distance of the motion, and time stretched only about what exceeds a limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.pipeline import search
from regionik.scene import scene_of
from regionik.smoothing.smooth_motion import Reconnection
from regionik.timing.corner_rounding import rounded
from regionik.timing.jerk_limited_timing import stretched
from regionik.timing.limits import THICKNESS, MotionLimits
from regionik.timing.retime import retime
from regionik.values import Motion
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from tests import examples
from tests.maths import Array
from tests.planned import planned

JERKS = {"base_jerk": 10.0, "turn_jerk": 30.0, "joint_jerk": 30.0}
ASKED = Speeds(
    joint_velocity=1.5,
    joint_acceleration=3.0,
    turn_velocity=1.5,
    turn_acceleration=3.0,
    tool_velocity=0.2,
    blend=3e-4,
    **JERKS,
)
LIMITS = MotionLimits(robot_named("youbot"), ASKED)


def motion_of(q: Array) -> Motion:
    count = len(q)
    return Motion(q[:, :3], q[:, 3:], np.full(count, "step"), np.zeros(count, int), np.full(count, np.nan))


def bent(turns: list[float]) -> Motion:
    """Hops of 5 cm, each turned against the one before, with the arm swinging along."""
    ways = np.cumsum([0.0, *turns])
    base = np.vstack([[0.0, 0.0], np.cumsum(0.05 * np.column_stack([np.cos(ways), np.sin(ways)]), axis=0)])
    joints = np.outer(base[:, 1], [0.5, -0.3, 0.2, 0.0, 0.1]) + [1.0, 1.2, -1.0, 0.8, 0.5]
    return motion_of(np.column_stack([base, np.zeros(len(base)), joints]))


def rounded_within(limits: MotionLimits, motion: Motion, most: Array) -> Motion:
    return rounded(
        limits, motion, np.full(len(motion), limits.blend), most, np.zeros((len(motion), 8), dtype=np.bool_)
    )


@settings(max_examples=examples(8))
@given(st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=12), st.integers(1, 3))
def test_no_point_leaves_the_motion_by_more_than_asked(turns: list[float], held: int) -> None:
    motion = bent(turns)
    room = np.full(len(motion), ASKED.blend)
    room[held] = 0.0
    found = rounded_within(LIMITS, motion, room)
    q, p = (np.column_stack([one.base, one.joints]) for one in (motion, found))
    assert np.array_equal(p[[0, -1]], q[[0, -1]])
    assert (np.abs(p - q[held]).max(1) == 0).any()
    for row in p:  # the nearest place of the motion, along each of its segments
        change = np.diff(q, axis=0)
        share = np.clip(((row - q[:-1]) * change).sum(1) / (change**2).sum(1), 0, 1)
        off = row - q[:-1] - share[:, None] * change
        assert LIMITS.displacement(row - off, row + 0 * off).min() <= ASKED.blend * (1 + 1e-9)


@settings(max_examples=examples(30))
@given(st.integers(0, 2**32 - 1), st.floats(1e-5, 1.0))
def test_no_point_of_a_link_moves_farther_than_the_bound(seed: int, far: float) -> None:
    rng = np.random.default_rng(seed)
    here, there = np.cumsum([rng.uniform(-1, 1, 8), far * rng.uniform(-1, 1, 8)], axis=0)
    bound = LIMITS.displacement(here[None], there[None])[0]
    frames = [LIMITS.robot.frames(q[:3], q[3:]) for q in (here, there)]
    for k in range(LIMITS.robot.chain.dof):
        beside = rng.normal(size=3)
        beside *= rng.uniform(0, THICKNESS) / np.linalg.norm(beside)
        point = rng.uniform() * np.linalg.solve(frames[0][k], frames[0][k + 1])[:3, 3] + beside
        moved = [frame[k, :3, :3] @ point + frame[k, :3, 3] for frame in frames]
        assert np.linalg.norm(moved[1] - moved[0]) <= bound + 1e-12
    for corner in LIMITS.robot.footprint @ [1, 1j]:
        spots = [complex(*q[:2]) + corner * np.exp(1j * q[2]) for q in (here, there)]
        assert abs(spots[1] - spots[0]) <= bound + 1e-12


def test_a_corner_bends_less_the_more_room_there_is() -> None:
    sharpest = []
    for blend in (1e-5, 1e-4, 1e-3):
        motion = bent([0.0, 0.2, 0.0])
        limits = MotionLimits(LIMITS.robot, replace(ASKED, blend=blend))
        base = rounded_within(limits, motion, np.full(len(motion), blend)).base[:, :2]
        hops = np.diff(base, axis=0)
        turn = np.abs(np.diff(np.arctan2(hops[:, 1], hops[:, 0])))
        length = np.linalg.norm(hops, axis=1)
        sharpest.append(float((2 * turn / (length[1:] + length[:-1])).max()))
    assert sharpest[0] > 1.5 * sharpest[1] > 1.5**2 * sharpest[2]


def test_time_is_stretched_where_it_must_be_and_nowhere_else() -> None:
    timed = replace(bent([0.0] * 40), time=np.linspace(0.0, 10.0, 42))
    factor = np.ones(41)
    factor[20] = 1.3
    span, before = (np.diff(one.time) for one in (stretched(LIMITS, timed, factor), timed))
    assert span[20] >= 1.3 * before[20]
    assert (span >= before * (1 - 1e-9)).all()
    assert span[[*range(15), *range(27, 41)]] == pytest.approx(before[[*range(15), *range(27, 41)]])


def test_one_place_over_a_limit_does_not_slow_the_whole() -> None:
    """The robot was 1 in 100 slower everywhere once, and held no speed at all."""
    found = retime(planned("wall"), ASKED)
    assert verify(found).ok
    tool = found.stats["timing"]["tool"]
    assert tool["held_elsewhere"] >= tool["held"] > 0.9
    assert "end" in {one["at"] for one in tool["places"]} <= {"end", "path"}
    assert any("jerk" in one["by"] for one in tool["places"])


@pytest.mark.slow
def test_the_robot_rests_only_about_what_its_rounded_motion_would_touch() -> None:
    """It rested at all states of the drive under the slab, which is without any room to spare: 35 s."""
    found = retime(planned("slab"), ASKED)
    assert found.motion.time[-1] < 25
    assert verify(found).ok


@pytest.mark.slow
def test_the_robot_rests_where_the_tool_comes_to_a_path_that_has_a_speed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It came there slowly, on a corner between two motions, and took longer to the speed than from rest.

    Runs begin where they were found, as one of them does on a corner that is rounded without a speed.
    """
    monkeypatch.setattr(Reconnection, "_way", lambda *_: None)
    before = search(scene_of(load_world("slab")))
    for asked, rests in ((ASKED, True), (replace(ASKED, tool_velocity=None), False)):
        found = retime(before, asked).motion
        lifted = found.kind == "transit"
        first = np.flatnonzero(lifted[:-1] & ~lifted[1:] & (found.setpoint[1:] >= 0))
        assert len(first) == before.lift_offs + 1
        again = [np.array_equal(found.joints[k + 1], found.joints[k + 2]) for k in first.tolist()]
        assert all(again) == rests


@pytest.mark.parametrize("blend", [1e-4, 3e-4, 5e-3])
def test_corners_of_the_path_that_the_blend_has_no_room_for_are_listed(blend: float) -> None:
    """The sine of `pillar` turns by 2.1 to 16.7 degrees at twelve set-points."""
    before = planned("pillar")
    spots = np.array([target.position for target in before.world.task])
    ways = np.diff(spots, axis=0)
    unit = ways / np.linalg.norm(ways, axis=1)[:, None]
    turns = np.arccos(np.clip((unit[:-1] * unit[1:]).sum(1), -1, 1))
    change = 2 * 0.2 * np.sin(turns / 2)  # of the tool's velocity
    sharp = 1 + np.flatnonzero(change**1.5 / (6 * np.sqrt(10.0)) > blend)
    found = [
        one["setpoint"]
        for one in retime(before, replace(ASKED, blend=blend)).stats["timing"]["tool"]["corners"]
    ]
    lifted = before.lift_offs > 0  # the tool does not pass a corner at which it is lifted
    assert set(found) <= set(sharp.tolist())
    assert len(found) >= len(sharp) - 2 * lifted


def test_set_points_stay_within_their_tolerance_however_far_corners_may_be_cut() -> None:
    before = planned("l_shape")
    found = retime(before, replace(ASKED, blend=5e-3))
    assert verify(found).ok
    errors = [one.error for one in found.setpoints]
    assert max(errors) <= before.world.rules.tolerance
    assert found.stats["largest_error"] == max(errors) > 1e-4


def test_a_plan_that_breaks_its_rules_is_refused_whatever_it_lists() -> None:
    before = planned("free")
    with pytest.raises(InputError, match="breaks its own rules"):
        retime(replace(before, setpoints=before.setpoints[:3]), ASKED)


@pytest.mark.slow
def test_a_plan_with_a_drive_is_timed_at_a_tenth_of_a_millimetre_a_second() -> None:
    found = retime(planned("slab"), Speeds(base_velocity=1e-4, joint_velocity=1e-4))
    assert verify(found).ok
    assert found.motion.time[-1] > 10_000
