"""Wide cones about a direction: the pitch of an arm in one plane is as free in areas as the tool is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.areas.reach_model import ReachQuery
from regionik.areas.reachable import reach_model
from regionik.mfabrik import Solver
from regionik.pipeline import plan
from regionik.planners.geometry.cones import pitches_within, swings_about, swings_within
from regionik.postures.families import BACK, FRONT
from regionik.reach_table import reach_table_of
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.limits import Criteria
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples
from tests.kinds import Goal
from tests.maths import Array, rot_z
from tests.measures import deviation, pose_of

YOUBOT = robot_named("youbot")
FLOOR = Floor(shapely.box(-2.0, -2.0, 3.0, 2.0))
EVERY = (-np.inf, np.inf)


def axis_at(swing: float, pitch: float) -> Array:
    return np.array([math.cos(pitch) * math.cos(swing), math.cos(pitch) * math.sin(swing), math.sin(pitch)])


def angle(a: Array, b: Array) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def drawn(rng: np.random.Generator) -> tuple[float, float]:
    """Pitch of an axis and half angle of a cone about it, also at what is upright and nearly all round."""
    pitch = float(rng.choice([rng.uniform(-1.57, 1.57), -np.pi / 2, 0.0, np.pi / 2]))
    return pitch, float(rng.choice([rng.uniform(0.01, 0.4), rng.uniform(0.4, 3.14), 1.0, np.pi / 2]))


def test_pitches_within_a_cone_are_those_at_no_more_than_its_angle() -> None:
    rng = np.random.default_rng(0)
    for _ in range(2000):
        (pitch, cone), (swing, other) = drawn(rng), rng.uniform(-np.pi, np.pi, 2)
        found = pitches_within(pitch, cone, float(swing))
        inside = found is not None and abs((other - found[0] + np.pi) % (2 * np.pi) - np.pi) <= found[1]
        off = angle(axis_at(0.0, pitch), axis_at(float(swing), float(other)))
        assert inside == (off <= cone) or abs(off - cone) < 1e-7


def test_swings_and_pitches_lie_in_the_cone_and_about_it() -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
        pitch, cone = drawn(rng)
        within, about = swings_within(pitch, cone), swings_about(pitch, cone)
        for one in within:
            for swing in (-one.half, 0.0, one.half, rng.uniform(-one.half, one.half)):
                for other in (*one.pitches, rng.uniform(*one.pitches)):
                    assert angle(axis_at(0.0, pitch), axis_at(swing, other)) <= cone + 1e-7
        wide = about[0].half
        for swing, other in rng.uniform((0.0, -np.pi / 2), (np.pi, np.pi / 2), (100, 2)):
            if angle(axis_at(0.0, pitch), axis_at(swing, other)) > cone:
                continue
            assert any(swing <= one.half and one.pitches[0] <= other <= one.pitches[1] for one in about)
            # as near as is said: a step of pitch, or of swing
            near = [
                max(swing - one.half - 2 * wide / 64, one.pitches[0] - other, other - one.pitches[1])
                for one in within
            ]
            assert min(near) <= min(max(0.02, cone / 6), 0.1) + 1e-9


@pytest.mark.parametrize("goal", ["direction", "orientation"])
def test_areas_hold_places_that_work_and_outer_ones_all_of_them(goal: Goal) -> None:
    """Inner places have a posture in the cone that the solver finds; outer ones hold those of postures."""
    rng, arm = np.random.default_rng(2), reach_model(YOUBOT, goal)
    held, seen, wider = 0, 0, 0
    for _ in range(examples(40)):
        q = rng.uniform(YOUBOT.chain.lower, YOUBOT.chain.upper)
        tool = YOUBOT.tool(np.zeros((1, 3)), q[None])[0]
        cone = float(rng.choice([0.05, 0.3, 1.0, 2.0, 3.0]))
        tilt = rng.normal(size=3)
        turn = _turned(tilt / np.linalg.norm(tilt), 0.98 * cone * rng.random()) @ tool[:3, :3]
        asked = {"direction": turn[:, 2]} if goal == "direction" else {"orientation": turn}
        target = Target(tool[:3, 3], cone=cone, **asked)
        outer = reach_table_of(scene_of(_world(target)), [target], ReachQuery(Rules(), None, EVERY))[2]
        mount = YOUBOT.mount[:2]
        assert shapely.distance(shapely.union_all(outer), shapely.Point(mount)) < 1e-9
        query = ReachQuery(Rules(), 1e-4, EVERY)
        inner = reach_table_of(scene_of(_world(target)), [target], query)
        wider += shapely.union_all(inner[2]).distance(shapely.Point(mount)) < 0.03
        seen += 1
        for family, shape in zip(inner[1], inner[2], strict=True):
            x0, y0, x1, y1 = shape.bounds
            spots = rng.uniform((x0, y0), (x1, y1), (12, 2))
            for spot in spots[shapely.contains_xy(shape, spots)][:2]:
                solver = Solver(YOUBOT, tolerance=1e-4, family=family)
                found = solver.hold(target, pose_of(YOUBOT, spot, 0.3), YOUBOT.carry)
                assert found.converged
                there = YOUBOT.tool(found.base[None], found.joints[None])[0]
                assert deviation(target, there[:3, :3]) <= cone + 1e-8
                held += 1
    assert held > seen
    assert wider >= 0.9 * seen
    assert arm.exact


def _turned(axis: Array, by: float) -> Array:
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Array = np.eye(3) + np.sin(by) * cross + (1 - np.cos(by)) * cross @ cross
    return turn


def _world(*task: Target, **rules: object) -> World:
    return World("cone", YOUBOT, FLOOR, (), task, Rules(clearance=0.1, **rules))  # type: ignore[arg-type]


@pytest.mark.parametrize("heading", [0.0, 2.5])
@pytest.mark.parametrize(("pitch", "cone"), [(-np.pi / 2, 1.0), (-np.pi / 2, 3.0), (0.4, 1.2), (-0.9, 0.9)])
def test_what_a_tilted_tool_reaches_is_planned(pitch: float, cone: float, heading: float) -> None:
    """Straight down at 0.3 m nothing is in reach of a youBot; within the cone about it there is."""
    axis = rot_z(heading)[:3, :3] @ axis_at(0.0, pitch)
    world = _world(*(Target(np.array([0.5 + 0.1 * k, 0.0, 0.3]), axis, cone) for k in range(2)))
    found = plan(world)
    assert verify(found).ok
    assert not admissible_area(world, world.task[0]).inner.is_empty


def test_a_cone_of_half_a_turn_asks_for_nothing() -> None:
    spot = np.array([0.5, 0.0, 0.3])
    free = Target(spot, np.array([0.0, 0.0, 1.0]), np.pi)
    assert free.direction is None
    assert Target(spot, cone=np.pi, orientation=np.eye(3)).orientation is None
    bare = admissible_area(_world(Target(spot)), Target(spot))
    assert admissible_area(_world(free), free).inner.equals(bare.inner)
    nearly = Target(spot, np.array([0.0, 0.0, 1.0]), np.pi - 1e-5)
    assert admissible_area(_world(nearly), nearly).inner.area > 0.999 * bare.inner.area


def test_postures_that_lean_meet_criteria() -> None:
    criteria = Criteria(manipulability=0.004, joint_margin=0.02)
    world = _world(Target(np.array([0.5, 0.0, 0.3]), np.array([0.0, 0.0, -1.0]), 1.4), criteria=criteria)
    found = plan(world)
    assert verify(found).ok


def test_both_sides_of_the_arm_take_part() -> None:
    """Of a cone that holds the vertical, one family leans forwards and back."""
    target = Target(np.array([0.5, 0.0, 0.3]), np.array([0.2, 0.0, -1.0]), 1.0)
    kinds = reach_model(YOUBOT, "direction").families(target, (FRONT, BACK), inner=True)
    assert len(kinds) == 2
    low, high = (pick(pick(band.pitches) for band in kinds[0].bands) for pick in (min, max))
    assert low < -np.pi / 2 or high > np.pi / 2
    narrow = replace(target, cone=0.1)
    assert len(reach_model(YOUBOT, "direction").families(narrow, (FRONT, BACK), inner=True)) == 4
