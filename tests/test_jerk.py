"""Point to point with limited jerk: ends met, limits kept, and no faster way in sight."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import regionik as rik
from regionik.planners.timing.jerk_limited import KinematicState, jerk_limited
from regionik.worlds.errors import InputError

POSTURES = st.lists(st.floats(0.01, 2.4), min_size=10, max_size=10)


def at_rest(*joints: float) -> KinematicState:
    return KinematicState(np.array(joints), np.zeros(len(joints)), np.zeros(len(joints)))


def rest_to_rest(way: float, velocity: float, acceleration: float, jerk: float) -> float:
    """Duration of one joint by hand: seven phases, fewer where velocity or acceleration is never full [s]."""
    swell = min(acceleration / jerk, np.sqrt(velocity / jerk), np.cbrt(way / (2 * jerk)))
    full = jerk * swell  # acceleration that is reached

    def gone(hold: float) -> float:
        return float(full * (swell + hold) * (2 * swell + hold))

    most = max(velocity / full - swell, 0.0)
    hold = min(most, (-3 * swell + np.sqrt(swell**2 + 4 * way / full)) / 2)
    hold = max(hold, 0.0)
    cruise = max(way - gone(hold), 0.0) / (full * (swell + hold))
    return float(4 * swell + 2 * hold + cruise)


@pytest.mark.parametrize("way", [0.001, 0.1, 1.0, 30.0])
@pytest.mark.parametrize("limits", [(1.0, 2.0, 8.0), (5.0, 1.0, 1.0), (0.2, 4.0, 100.0)])
def test_as_fast_as_by_hand(way: float, limits: tuple[float, float, float]) -> None:
    motion = jerk_limited(at_rest(0.0), at_rest(way), *([limit] for limit in limits))
    assert motion.duration == pytest.approx(rest_to_rest(way, *limits), rel=1e-9)


@given(POSTURES)
def test_ends_are_met_limits_kept_and_the_way_is_straight(numbers: list[float]) -> None:
    robot = rik.load_robot("youbot")
    start, goal = np.array(numbers[:5]), np.array(numbers[5:])
    speeds = rik.Speeds(joint_velocity=0.8, joint_acceleration=1.5)
    motion = rik.point_to_point(robot, start, goal, speeds=speeds, jerk=6.0)
    times = np.linspace(0.0, motion.duration, 400)
    found = motion.at(times)
    np.testing.assert_allclose(found.position[[0, -1]], [start, goal], atol=1e-9)
    np.testing.assert_allclose(found.velocity[[0, -1]], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.acceleration[[0, -1]], 0.0, atol=1e-9)
    assert np.abs(found.velocity).max() <= 0.8 * (1 + 1e-9)
    assert np.abs(found.acceleration).max() <= 1.5 * (1 + 1e-9)
    if motion.duration > 0:
        jerks = np.diff(found.acceleration, axis=0) / np.diff(times)[:, None]
        assert np.abs(jerks).max() <= 6.0 * (1 + 1e-6)
        way = goal - start
        share = (found.position - start) @ way / (way @ way)
        np.testing.assert_allclose(found.position, start + share[:, None] * way, atol=1e-8)


def test_speed_at_the_ends() -> None:
    robot = rik.load_robot("youbot")
    motion = rik.point_to_point(
        robot, np.full(5, 0.5), np.full(5, 1.0), start_velocity=0.2, goal_velocity=[0.1, 0, 0, 0.1, -0.2]
    )
    ends = motion.at([0.0, motion.duration])
    np.testing.assert_allclose(ends.velocity, [[0.2] * 5, [0.1, 0.0, 0.0, 0.1, -0.2]], atol=1e-9)
    assert motion.at(0.3).position.shape == (5,)


def test_nothing_to_do_takes_no_time() -> None:
    posture = np.full(5, 0.5)
    motion = rik.point_to_point(rik.load_robot("youbot"), posture, posture)
    assert motion.duration == 0.0
    assert motion.at(0.0).position.tolist() == posture.tolist()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": [0.0, np.nan, 0.0, 0.0, 0.0]}, "start: "),
        ({"goal": [0.0, 0.5]}, "goal: expected 5"),
        ({"goal": [0.0, 5.0, 0.0, 0.0, 0.0]}, "joint_2: expected 0 to 2.7.*, would be at 5 after "),
        ({"jerk": 0.0}, "jerk limit of joint 1: must be above 0"),
        ({"jerk": [1.0, 1.0, np.nan, 1.0, 1.0]}, "jerk: "),
        ({"start_velocity": 9.0}, "start velocity of joint 1: expected at most"),
        ({"start_velocity": [0.0, -0.5, 0.0, 0.0, 0.0], "start": np.zeros(5)}, "joint_2: .* after"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, object], message: str) -> None:
    asked: dict[str, object] = {"start": np.full(5, 0.5), "goal": np.full(5, 1.0), **changes}
    with pytest.raises(InputError, match=message):
        rik.point_to_point(rik.load_robot("youbot"), asked.pop("start"), asked.pop("goal"), **asked)  # type: ignore[arg-type]


def test_an_end_that_leaves_no_time_to_brake_is_refused() -> None:
    end = KinematicState(np.ones(1), np.full(1, 2.0), np.full(1, -2.0))
    with pytest.raises(InputError, match="ends and limits do not go together"):
        jerk_limited(at_rest(0.0), end, [2.0], [2.0], [8.0])


def test_times_outside_are_refused() -> None:
    motion = jerk_limited(at_rest(0.0), at_rest(1.0), [1.0], [1.0], [1.0])
    with pytest.raises(InputError, match="time: expected 0 to"):
        motion.at(motion.duration + 1.0)
