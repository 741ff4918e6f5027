"""Motions optimised for time: never slower, verified, with the same set-points, lift-offs and limits."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import regionik as rik
from regionik.planners.smoothing.least_time import least_time
from regionik.planners.smoothing.options import LEAST_TIME
from regionik.planners.smoothing.path_smoothing import HalfSpaces
from regionik.planners.smoothing.timed_states import LeastTimeProblem, TimedStates, states_between
from regionik.worlds.scene import Heading
from tests.maths import Array
from tests.planned import planned
from tests.test_known_motions import WAVE, along, through
from tests.timed import check_limits, each_millisecond

WORLDS = ["pipe", *(pytest.param(name, marks=pytest.mark.slow) for name in ("shelf", "slab", "wall", "tao2"))]


@lru_cache(maxsize=20)
def both(name: str) -> tuple[rik.Plan, rik.Plan]:
    """A bundled world's plan timed, and optimised for time."""
    return rik.retime(planned(name), rik.Speeds()), rik.retime(planned(name), rik.Speeds(), optimise=True)


def pace(state: Array, end: Array, count: int, velocity: float) -> LeastTimeProblem:
    """A problem from state to state, between which all is free, of two sections of so many segments."""
    n, m = 2 * count + 1, len(state)
    lower, upper = np.full((n, m), -np.inf), np.full((n, m), np.inf)
    for row, value in ((0, state), (-1, end)):
        lower[row] = upper[row] = value
    nothing = HalfSpaces(np.empty(0, dtype=np.int64), np.empty((0, m)), np.empty(0), np.empty(0))
    return LeastTimeProblem(
        np.repeat([0, 1], count),
        np.full(m - 1, velocity),
        np.ones(m - 1),
        lower,
        upper,
        lambda states: nothing,
        lambda states: 0 * states,
        lambda states: (nothing.state, np.empty(0), np.empty((0, 2, m))),
        np.full(2 * count, np.inf),
        2,
    )


@pytest.mark.parametrize(("velocity", "least"), [(10.0, 2.0), (0.5, 2.5)], ids=["bang-bang", "cruising"])
@pytest.mark.parametrize("way", [(1, 0, 0, 0), (0, 0, 0, -1), (0.6, -0.8, 1, 1)], ids=["x", "joint", "all"])
def test_a_free_way_from_rest_to_rest_takes_the_least_time(
    way: tuple[float, ...], velocity: float, least: float
) -> None:
    """Full acceleration, cruising where speed is limited, full braking: 2 sqrt(way), or way / v + v."""
    end, count = np.array(way, dtype=float), 12
    problem = pace(np.zeros(4), end, count, velocity)
    rows = np.linspace(0, 1, 2 * count + 1)[:, None]
    detour = np.sin(2 * np.pi * rows) * [0.1, 0.1, 0.0, 0.2]
    begun = TimedStates(
        rows * end + detour, np.tile(end / 6, (2 * count + 1, 1)), np.full(2, 6 / (2 * count))
    )
    begun.rates[[0, -1]] = 0.0
    found = least_time(problem, begun)
    assert least * 0.99 < problem.duration(found.spans) < 1.03 * least
    assert found.states[[0, -1]] == pytest.approx(np.stack([np.zeros(4), end]))


@pytest.mark.parametrize(("count", "most"), [(12, LEAST_TIME.max_rounds), (600, 7)])
def test_long_motions_have_fewer_rounds(count: int, most: int) -> None:
    """Half-spaces are asked for once before the rounds, and once in each."""
    problem, looks = pace(np.zeros(4), np.ones(4), count, 10.0), list[int]()

    def counted(states: Array) -> HalfSpaces:
        looks.append(len(states))
        return HalfSpaces(np.empty(0, dtype=np.int64), np.empty((0, 4)), np.empty(0), np.empty(0))

    rows = np.linspace(0, 1, 2 * count + 1)[:, None]
    slow = TimedStates(rows * np.ones(4), np.full((2 * count + 1, 4), 0.1), np.full(2, 5 / count))
    slow.rates[[0, -1]] = 0.0
    found = least_time(replace(problem, half_spaces_at=counted), slow)
    assert 1 < len(looks) <= most + 1
    assert problem.duration(found.spans) < 10.0


def test_splines_of_sections_meet_with_one_slope() -> None:
    rng = np.random.default_rng(3)
    problem = pace(np.zeros(4), np.ones(4), 4, 1.0)
    timed = TimedStates(rng.normal(size=(9, 4)), rng.normal(size=(9, 4)), np.array([0.2, 0.3]))
    for k in (4, 4, 2):
        spans = timed.spans[problem.section[[k - 1, k]]]
        sides = [states_between(problem, timed, np.array([k - 1]), np.array([1 - d])) for d in (0, 1e-6)]
        ahead = states_between(problem, timed, np.array([k]), np.array([1e-6]))
        before, after = (sides[0] - sides[1]) / spans[0] / 1e-6, (ahead - sides[0]) / spans[1] / 1e-6
        assert np.abs(before - after).max() < 1e-3
        if k == 4:
            assert before[0] == pytest.approx(timed.rates[4], abs=1e-3)


@pytest.mark.parametrize("name", WORLDS)
def test_a_motion_that_is_optimised_is_quicker_and_holds(name: str) -> None:
    before, after = both(name)
    assert after.motion.time[-1] < 0.9 * before.motion.time[-1]
    assert rik.verify(after).ok


@pytest.mark.parametrize("name", WORLDS)
def test_set_points_lift_offs_and_start_stay(name: str) -> None:
    before, after = both(name)
    worked = [one.motion.setpoint[one.motion.kind == "setpoint"].tolist() for one in (before, after)]
    assert worked[0] == worked[1]
    assert before.lift_offs == after.lift_offs
    lifted = [np.diff(one.motion.kind == "transit", prepend=False) for one in (before, after)]
    assert lifted[0].sum() == lifted[1].sum()
    if before.world.start is not None:
        assert np.array_equal(before.motion.base[0], after.motion.base[0])
        assert np.array_equal(before.motion.joints[0], after.motion.joints[0])


@pytest.mark.parametrize("name", WORLDS)
def test_no_limit_is_exceeded_at_a_thousand_hertz(name: str) -> None:
    found, speeds = both(name)[1], rik.Speeds()
    look = each_millisecond(found)
    check_limits(look, speeds, found.world.robot.chain)
    step = np.diff(look.time)[:, None]
    mean = np.diff(look.joints, axis=0) / step - (look.joint_velocity[1:] + look.joint_velocity[:-1]) / 2
    assert np.abs(mean).max() < 5e-3


@pytest.mark.parametrize("name", ["pipe"])
def test_an_optimised_plan_is_the_same_every_time(name: str, tmp_path: object) -> None:
    again = rik.retime(planned(name), rik.Speeds(), optimise=True)
    texts = []
    for k, one in enumerate((both(name)[1], again)):
        rik.save_plan(one, f"{tmp_path}/{k}.json")
        with open(f"{tmp_path}/{k}.json", encoding="utf-8") as file:
            texts.append(json.load(file))
    assert texts[0] == texts[1]


@pytest.mark.parametrize(
    ("limits", "share"),
    [
        ({"tool_velocity": 0.3}, 0.95),
        ({"base_jerk": 10.0, "turn_jerk": 20.0, "joint_jerk": 30.0}, 0.9),
    ],
    ids=["tool", "jerk"],
)
def test_other_limits_are_kept_too(limits: dict[str, float], share: float) -> None:
    speeds = rik.Speeds(**limits)
    before, after = (rik.retime(planned("pipe"), speeds, optimise=chosen) for chosen in (False, True))
    assert after.motion.time[-1] < share * before.motion.time[-1]
    assert rik.verify(after).ok


def test_the_base_stands_at_its_stops() -> None:
    world = rik.load_world("shelf")
    given = rik.plan(replace(world, rules=replace(world.rules, mode="stops")))
    before, after = (rik.retime(given, rik.Speeds(), optimise=chosen) for chosen in (False, True))
    assert after.motion.time[-1] < 0.9 * before.motion.time[-1]
    assert rik.verify(after).ok
    for stop in after.stops:
        bases = [after.setpoints[i].base for i in stop.setpoints]
        assert bases == pytest.approx(np.tile(stop.base, (len(bases), 1)), abs=1e-9)


@pytest.mark.parametrize("name", ["door"])
def test_a_base_on_wheels_keeps_its_motion(name: str) -> None:
    before, after = (rik.retime(planned(name), rik.Speeds(), optimise=chosen) for chosen in (False, True))
    assert np.array_equal(before.motion.time, after.motion.time)
    assert np.array_equal(before.motion.base, after.motion.base)


@pytest.mark.parametrize("heading", ["fixed", "face_target"])
def test_a_rule_of_heading_is_kept(heading: Heading) -> None:
    change, sines, least = WAVE
    given = through(along(change, {k: one for k, one in sines.items() if k != 3}, 101), heading)
    given = replace(given, motion=replace(given.motion, joints=given.motion.joints * [0, 1, 1, 1, 1]))
    found = rik.retime(given, rik.Speeds(base_velocity=0.5, joint_velocity=1.5, blend=2e-3), optimise=True)
    assert rik.verify(found).ok
    assert found.motion.time[-1] < 0.9 * least
    if heading == "fixed":
        assert np.abs(found.motion.base[:, 2]).max() < 1e-9
    else:
        assert np.abs(found.motion.joints[found.motion.kind == "setpoint", 0]).max() < 1e-9
