"""A plan of one state has no hops: what its states say is all that `verify` can go by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.values import Configuration, Motion, Plan, PlannedArea
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Sphere
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.kinds import Solid
from tests.maths import Array

ROBOT = robot_named("youbot-real")
CANDLE = np.array([0.0, np.pi / 2, 0.0, np.pi / 2, 0.0])  # straight up
ROOMY = shapely.box(-1, -1, 1, 1)
NOWHERE = shapely.Polygon()


def alone(joints: Array, floor: shapely.Polygon = ROOMY, *solids: Solid, **rules: float) -> Plan:
    """One set-point, met by one state at the origin."""
    base = np.zeros(3)
    spot = ROBOT.tool(base, joints)[:3, 3]
    kept = replace(Rules(clearance=0.0, tool_contact=0.0), **rules)  # type: ignore[arg-type]
    world = World("alone", ROBOT, Floor(floor), solids, (Target(spot),), kept)
    motion = Motion(base[None], joints[None], np.array(["setpoint"]), np.array([0]), np.array([np.nan]))
    area = PlannedArea(NOWHERE, NOWHERE, NOWHERE)
    return Plan(world, 0, (Configuration(base, joints, 0.0, 0, True),), motion, (area,), 0)


def kinds(made: Plan) -> set[str]:
    return {violation.kind for violation in verify(made).violations}


def test_one_state_may_hold() -> None:
    assert verify(alone(CANDLE)).ok


@pytest.mark.parametrize(("inset", "held"), [(-0.01, True), (0.01, False), (0.1, False)])
def test_all_of_the_footprint_is_on_the_floor(inset: float, held: bool) -> None:
    floor = shapely.box(float(ROBOT.footprint[:, 0].min()) + inset, -1, 1, 1)
    assert kinds(alone(CANDLE, floor)) == (set() if held else {"floor"})


@pytest.mark.parametrize(("gap", "held"), [(0.051, True), (0.049, False), (0.035, False)])
def test_all_of_the_arms_clearance_is_kept(gap: float, held: bool) -> None:
    frames = ROBOT.frames(np.zeros(3), CANDLE)
    link = next(solid for solid in ROBOT.solids if solid.link == 1)
    middle = (frames[1, :3, 3] + frames[2, :3, 3]) / 2
    ball = Sphere("ball", 0.03, middle + [0.0, 0.03 + link.radius + gap, 0.0])
    assert kinds(alone(CANDLE, ROOMY, ball, arm_clearance=0.05)) == (set() if held else {"arm"})


@pytest.mark.parametrize(("gap", "held"), [(0.201, True), (0.199, False), (0.15, False)])
def test_all_of_the_bases_clearance_is_kept(gap: float, held: bool) -> None:
    ball = Sphere("ball", 0.03, np.array([ROBOT.footprint[:, 0].max() + 0.03 + gap, 0.0, 0.03]))
    assert kinds(alone(CANDLE, ROOMY, ball, clearance=0.2)) == (set() if held else {"clearance"})


def test_links_that_overlap_a_little_overlap() -> None:
    """Of postures drawn at random some overlap deeply, some a little."""
    chain = ROBOT.chain
    depths = []
    for joints in np.random.default_rng(0).uniform(chain.lower, chain.upper, (300, chain.dof)):
        told = [one.amount for one in verify(alone(joints)).violations if one.kind == "self"]
        depths.append(max(told, default=0.0))
    assert depths.count(0.0) > 50
    assert any(1e-5 < depth < 0.04 for depth in depths)


@pytest.mark.parametrize(("contact", "told"), [(0.3, set()), (0.08, {"contact"}), (0.05, {"arm"})])
def test_the_tool_works_on_what_is_near_not_on_what_has_a_box_near(contact: float, told: set[str]) -> None:
    """0.07 m from a ball, whose box along the axes is nearer; the last link is near it far beyond its tip."""
    tool = ROBOT.tool(np.zeros(3), CANDLE)[:3, 3]
    ball = Sphere("ball", 0.1, tool + np.array([1.0, 1.0, 0.0]) * 0.17 / np.sqrt(2))
    assert kinds(alone(CANDLE, ROOMY, ball, arm_clearance=0.1, tool_contact=contact)) == told
