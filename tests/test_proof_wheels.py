"""Plans of bases on wheels: what rolls holds, what slips or turns too tightly is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import box

from regionik.values import Motion
from regionik.verification.verifier import verify
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules
from tests.kinds import BaseKind
from tests.maths import Array, arc_end
from tests.plans import FOOTPRINT, drive, only, plan_of, world_of, youbot

RULES = Rules(clearance=0.1, step=0.205)


def on(kind: BaseKind, radius: float = 0.0, footprint: tuple[tuple[float, float], ...] = ((0, 0),)) -> Robot:
    return replace(youbot(footprint), base=kind, turning_radius=radius)


def rolled(*parts: tuple[float, float], start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Motion:
    """One set-point, and from there along arcs, each a length and a turn, with the tool lifted."""
    base = [start]
    for length, turn in parts:
        base.append(arc_end(*base[-1], length, turn))
    return drive(*base)


def report_of(motion: Motion, robot: Robot, **changes: object):  # type: ignore[no-untyped-def]
    world = replace(world_of(motion, robot=robot, rules=RULES), **changes)  # type: ignore[arg-type]
    return verify(plan_of(world, motion, 1))


PARTS = [(0.1, 0.3), (-0.15, 0.4), (0.2, 0.0), (0.0, 1.0), (0.2, -1.5), (0.0, 0.0)]


def test_arcs_lines_and_turns_roll() -> None:
    report = report_of(rolled(*PARTS), on("differential"))
    assert report.ok, report.violations
    assert 0.9e-9 < report.margins["wheels"] <= 1e-9
    assert "wheels" not in report_of(rolled(*PARTS), on("omni")).margins
    assert report.margins["step"] == pytest.approx(0.005, abs=1e-9)  # along the arc, not the chord


@pytest.mark.parametrize("aside", [-3e-9, 2e-9, 1e-3])
def test_slip_is_found_and_told_where(aside: float) -> None:
    motion = rolled(*PARTS)
    base = np.array(motion.base)
    heading = base[2, 2]  # all the way from state 3 to 4
    base[3:, :2] += aside * np.array([-np.sin(heading), np.cos(heading)])
    found = only(report_of(replace(motion, base=base), on("differential")), "wheels")
    assert found.state == 2
    assert found.amount == pytest.approx(abs(aside), rel=1e-4)
    assert "sideways between states 3 and 4 of 7" in found.text


def test_a_car_keeps_its_turning_radius_and_never_turns_on_the_spot() -> None:
    assert report_of(rolled((0.2, 0.4), (-0.2, -0.4)), on("car", 0.5)).ok
    tight = only(report_of(rolled((0.2, 0.4), (0.19, 0.4)), on("car", 0.5)), "wheels")
    assert tight.state == 1
    assert tight.amount == pytest.approx(0.01)
    assert "turns 0.4000 rad on 0.1900 m" in tight.text
    assert "turning radius is 0.5 m" in tight.text
    spot = only(report_of(rolled((0.2, 0.4), (0.0, 0.1)), on("car", 0.5)), "wheels")
    assert spot.state == 1
    assert spot.amount == pytest.approx(0.05)
    assert report_of(rolled((0.2, 0.3)), on("car", 0.5)).margins["wheels"] == pytest.approx(1e-9, rel=0.1)


ARC = rolled((0.2, 2.4), start=(0.0, 0.0, np.pi / 2 - 1.2))  # swings out along x between its ends


def farthest(footprint: tuple[tuple[float, float], ...]) -> Array:
    """The point with the most x that a corner comes to on the arc, densely sampled, (2,)."""
    c, s = np.array(footprint), np.linspace(0, 1, 20_001).tolist()
    x, y, yaw = np.array([arc_end(0.0, 0.0, np.pi / 2 - 1.2, 0.2 * part, 2.4 * part) for part in s]).T[
        ..., None
    ]
    corners = np.stack(
        [
            x + np.cos(yaw) * c[:, 0] - np.sin(yaw) * c[:, 1],
            y + np.sin(yaw) * c[:, 0] + np.cos(yaw) * c[:, 1],
        ],
        -1,
    ).reshape(-1, 2)
    point: Array = corners[corners[:, 0].argmax()]
    return point


@pytest.mark.parametrize("footprint", [((0.0, 0.0),), FOOTPRINT], ids=["point", "box"])
def test_an_arc_that_swings_off_the_floor_between_states(footprint: tuple[tuple[float, float], ...]) -> None:
    """Both ends are on the floor; the arc between is by more or less than a hair."""
    edge = farthest(footprint)[0]
    robot = on("differential", 0.0, footprint)
    for gap, holds in ((1e-4, True), (-1e-4, False)):
        report = report_of(ARC, robot, floor=Floor(box(-2, -2, edge + gap, 2)))
        if holds:
            assert report.ok, report.violations
        else:
            assert "between states" in only(report, "floor").text


@pytest.mark.parametrize("footprint", [((0.0, 0.0),), FOOTPRINT], ids=["point", "box"])
def test_an_arc_that_swings_too_near_to_a_solid(footprint: tuple[tuple[float, float], ...]) -> None:
    edge, height = farthest(footprint)
    robot = on("differential", 0.0, footprint)
    for gap, holds in ((1e-4, True), (-2e-3, False)):
        at = edge + RULES.clearance + 0.3 + gap
        post = Cylinder("post", 0.3, 0.05, np.array([at, height, 0.025]))
        report = report_of(ARC, robot, obstacles=(post,))
        if holds:
            assert report.ok, report.violations
        else:
            assert "post" in only(report, "clearance").text
