"""How bases get about: all readings of a way agree with one another and with rolling wheels."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regionik.planners.driving.arcs import arc_towards
from regionik.verification import motion as verification_motion
from regionik.verification.motion import MotionSegments
from regionik.worlds.drives import MAX_CHORD_ERROR, DifferentialDrive, OmnidirectionalDrive, drive_of
from tests.bodies import motion_through
from tests.kinds import BaseKind
from tests.maths import Array, arc_end
from tests.plans import youbot

WHEELS: tuple[BaseKind, ...] = ("differential", "car")
turns = st.floats(-3.1, 3.1)
arcs = st.floats(-2.0, 2.0)
poses = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-7, 7)).map(np.array)


def rolled(start: Array, length: float, turn: float, n: int = 2000) -> Array:
    """Poses of a base that rolls, from many small steps along the heading in the middle of each."""
    headings = start[2] + turn * (np.arange(n) + 0.5) / n
    steps = length / n * np.column_stack([np.cos(headings), np.sin(headings)])
    spots = start[:2] + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.column_stack([spots, start[2] + turn * np.arange(n + 1) / n])


@pytest.mark.parametrize("kind", WHEELS)
@given(poses, arcs, turns)
def test_the_way_of_a_base_that_rolls(kind: BaseKind, start: Array, length: float, turn: float) -> None:
    drive, way = drive_of(kind, 0.4), rolled(start, length, turn)
    share = np.linspace(0, 1, len(way))
    np.testing.assert_allclose(drive.between(start, way[-1], share)[:, :2], way[:, :2], atol=1e-5)
    np.testing.assert_allclose(drive.between(start, way[-1], share)[:, 2], way[:, 2], atol=1e-9)
    assert drive.travel(way[[0, -1]]) == pytest.approx(abs(length), abs=1e-5)


@given(poses, arcs, turns)
def test_lengths_come_back_from_where_they_lead(start: Array, length: float, turn: float) -> None:
    x, y, _ = arc_end(start[0], start[1], start[2], length, turn)
    found, *missed = arc_towards(start[0], start[1], start[2], x, y, turn)
    assert found == pytest.approx(length, abs=1e-12)
    assert np.abs(missed).max() < 1e-14 * (1 + np.abs(start).max())


@pytest.mark.parametrize("kind", ["omni", *WHEELS])
@given(st.integers(0, 10_000))
def test_what_plans_are_filled_in_with_is_what_verify_assumes(kind: BaseKind, seed: int) -> None:
    """Also where wheels would slip: the way ends where the next state stands."""
    rng = np.random.default_rng(seed)
    base = rng.uniform(-3, 3, (6, 3))
    base[3] = base[2]
    base[4, 2] = base[3, 2]
    drive, robot = drive_of(kind), replace(youbot(), base=kind)
    segments = MotionSegments(robot, motion_through(base, np.zeros((6, 5))))
    hop, s = np.repeat(np.arange(5), 7), np.tile(np.linspace(0, 1, 7), 5)
    found = drive.between(base[hop], base[hop + 1], s)
    np.testing.assert_allclose(segments.base_at(hop, s), found, atol=1e-12)
    np.testing.assert_allclose(found[6::7, :2], base[1:, :2], atol=1e-12)
    assert drive.travel(base) == pytest.approx(segments.base_length.sum())
    assert np.abs(np.cos(found[6::7, 2]) - np.cos(base[1:, 2])).max() < 1e-12


def test_an_omnidirectional_base_goes_straight_whatever_it_turns() -> None:
    way = OmnidirectionalDrive().between(np.zeros(3), np.array([2.0, 1.0, 3.0]), np.linspace(0, 1, 5))
    np.testing.assert_allclose(way, np.outer(np.linspace(0, 1, 5), [2, 1, 3]), atol=1e-15)


def test_lines_through_the_cuts_stay_near_the_way() -> None:
    base = np.array([[0, 0, 0], [1, 1, np.pi / 2], [1, 2, np.pi / 2], [1, 2, 0.0], [1, 2, 0.0]])
    index = DifferentialDrive().cuts(base)
    assert np.isin(np.arange(5), index).all()
    np.testing.assert_allclose(DifferentialDrive().sampled(base, index)[np.isin(index, np.arange(5))], base)
    fine = DifferentialDrive().between(base[0], base[1], np.linspace(0, 1, 500))[:, :2]
    line = DifferentialDrive().trace(base)[: int(np.searchsorted(index, 1.0)) + 1]
    off = [np.abs(np.hypot(*(point - [0, 1])) - 1) for point in (line[:-1] + line[1:]) / 2]
    assert max(off) <= MAX_CHORD_ERROR
    assert np.abs(np.hypot(*(fine - [0, 1]).T) - 1).max() < 1e-12
    assert len(index) < 40
    assert OmnidirectionalDrive().cuts(base).tolist() == [0, 1, 2, 3, 4]
    assert drive_of("car", 0.4).trace(base[:1]).tolist() == [[0, 0]]


def test_a_robot_knows_its_drive() -> None:
    robots = [replace(youbot(), base=kind, turning_radius=0.4) for kind in get_args(BaseKind)]
    assert [robot.drive.kind for robot in robots] == list(get_args(BaseKind))
    assert [robot.drive.turning_radius for robot in robots] == [0.0, 0.0, 0.4]
    assert [robot.drive.rolls for robot in robots] == [False, True, True]


def test_verification_asks_a_drive_for_its_kind_of_motion_alone() -> None:
    """It has kinematics of its own, so that a fault in the planner's cannot hide in both."""
    files = list(Path(verification_motion.__file__).parent.glob("*.py"))
    asked = {name for file in files for name in re.findall(r"\bdrive\.(\w+)", file.read_text("utf-8"))}
    assert asked == {"rolls", "turning_radius"}
    assert not any("worlds.drives" in file.read_text("utf-8") for file in files)
