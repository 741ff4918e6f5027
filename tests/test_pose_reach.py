"""Reach of oriented tools: what is found is there, what is there is found, and no path is too long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from benchmarks.tables.goals import confirm
from regionik.areas.reach_model import ReachQuery
from regionik.areas.reachable import PosedReach
from regionik.parking.fewest_stops import park
from regionik.parking.stop_motion import connect_stops
from regionik.parking.stops import in_sequence
from regionik.pipeline import plan
from regionik.planners.reach.pose_reach import pose_reach
from regionik.planners.solvers.closed_form import postures_at
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aim
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.postures.arm import aim_of as goal_aim
from regionik.reach_table import reach_table_of
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.maths import Array, rot_x, rot_y
from tests.test_closed_form import ARMS, posture
from tests.witnesses import witness

HEIGHT = 0.4  # of the arm's base frame [m]
FLOOR = Floor(shapely.box(-3, -3, 3, 3))


def aim_of_posture(chain: Chain, seed: int, kind: int, cone: float) -> tuple[Aim, Array]:
    """What a random posture does whose base frame stands at the origin."""
    q = posture(chain, seed)
    tool = chain.forward(q)
    spot = tool[:3, 3] + [0.0, 0.0, HEIGHT]
    return Aim(spot, kind, np.ascontiguousarray(tool[:3, :3]), cone), q


@pytest.mark.parametrize("kind", [DIRECTION, ORIENTATION])
@pytest.mark.parametrize("name", ["ur", "panda"])
def test_every_place_has_a_posture_that_meets_the_aim(name: str, kind: int) -> None:
    chain = ARMS[name]
    for seed in range(2):
        aim, _ = aim_of_posture(chain, seed, kind, 0.05)
        found = pose_reach(chain, HEIGHT, aim).grid
        for k in range(0, len(found.places), 7):
            seen = in_arm_frame(found.places[k], float(found.yaws[k]), HEIGHT, aim)
            error, angle = confirm(chain, seen, found.postures[k])
            assert error <= 1.1e-4
            assert angle <= 0.05 + 0.006
            held = found.postures[k][1:]
            assert ((held >= chain.lower[1:]) & (held <= chain.upper[1:])).all()


@pytest.mark.parametrize("name", ["panda", "puma"])
def test_the_place_of_a_posture_lies_in_the_reach_of_its_pose(name: str) -> None:
    chain, missed = ARMS[name], 0
    for seed in range(20):
        aim, _ = aim_of_posture(chain, seed, ORIENTATION, 1e-3)
        area = pose_reach(chain, HEIGHT, aim).area
        missed += area.distance(shapely.Point(0.0, 0.0)) > 0.02
    assert missed <= 1  # sampled


def test_places_within_the_area_are_reached() -> None:
    """Closed forms at places that no sample stood at; the pivot, which the base turns for, has no limits."""
    first, *others = ARMS["panda"].joints
    endless = Chain((replace(first, lower=-np.inf, upper=np.inf), *others), ARMS["panda"].T_last_tool)
    rng = np.random.default_rng(1)
    for seed in range(4):
        aim, _ = aim_of_posture(endless, seed, ORIENTATION, 1e-3)
        area = pose_reach(endless, HEIGHT, aim).area.buffer(-0.005)
        x0, y0, x1, y1 = area.bounds
        points = rng.uniform((x0, y0), (x1, y1), (200, 2))
        points = points[shapely.contains_xy(area, points)][:20]
        tools = np.tile(np.eye(4), (len(points), 1, 1))
        tools[:, :3, :3], tools[:, :3, 3] = aim.turn, aim.position - [0.0, 0.0, HEIGHT]
        tools[:, :2, 3] -= points
        assert len(np.unique(postures_at(endless, tools)[1])) >= 0.95 * len(points)


def posed_task(robot: Robot, seed: int, count: int) -> tuple[Target, ...]:
    """Poses that the arm meets one after the other with its base at the origin."""
    rng, chain = np.random.default_rng(seed), robot.chain
    q = posture(chain, seed) * 0.6
    bend = rng.uniform(-0.02, 0.02, chain.dof)
    tools = robot.tool(
        np.zeros((count, 3)), np.clip(q + np.arange(count)[:, None] * bend, chain.lower, chain.upper)
    )
    return tuple(Target(T[:3, 3], cone=5e-3, orientation=T[:3, :3]) for T in tools)


def robot_on(name: str, turn: Array, height: float) -> Robot:
    """An arm whose first axis is turned away from the vertical."""
    first, *others = ARMS[name].joints
    first = replace(first, T_parent_joint=turn @ first.T_parent_joint)
    chain = Chain((first, *others), ARMS[name].T_last_tool)
    return Robot(name, "omni", np.zeros((1, 2)), np.array([0, 0, height, 0]), chain, (), 0.1)


@pytest.mark.parametrize(
    ("name", "turn"),
    [("ur", np.eye(4)), ("panda", rot_x(np.pi)), ("puma", rot_y(0.4)), ("panda", rot_x(1e-5))],
)
def test_one_stop_serves_poses_that_one_place_is_known_for(name: str, turn: Array) -> None:
    """Also where the first axis is not vertical, and the base turns in its place; this was refused."""
    robot = robot_on(name, turn, 0.9)
    rules = Rules(mode="stops", avoidance=False, tolerance=1e-4)
    found = plan(World("poses", robot, FLOOR, (), posed_task(robot, 3, 8), rules))
    assert len(found.stops) == 1
    assert verify(found).ok


def test_a_stop_goes_on_to_set_points_that_areas_leave_to_the_next() -> None:
    robot = robot_on("ur", np.eye(4), 0.9)
    rules = Rules(mode="stops", avoidance=False, tolerance=1e-4)
    world = World("poses", robot, FLOOR, (), posed_task(robot, 3, 8), rules)
    whole = in_sequence(scene_of(world), park(scene_of(world)))
    group = whole.groups[0]
    assert len(group.setpoints) == 8
    halves = tuple(group.of(some) for some in (group.setpoints[:5], group.setpoints[5:]))
    found = connect_stops(replace(whole, groups=halves, spots=(None, None)), 0)
    assert [stop.setpoints for stop in found.stops] == [group.setpoints]
    assert found.split == ()


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("offsets", 96),
        ("urdf arms", 444),
        ("slides", 30587),
        ("wrists", 41305),
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in (
                *(("offsets", seed) for seed in (61, 46, 6, 2196, 2281, 3646, 20331, 31596, 40861, 41956)),
                ("slides", 40352),
                ("urdf arms", 41879),
            )
        ),
    ],
)
def test_worlds_with_a_witness_that_were_not_planned(kind: str, seed: int) -> None:
    """No place was known from which their tools are turned as asked; of some no way to or along the path.

    One stop is where the robot starts, and no area shows it; one drive begins where only its heading is free.
    Some arms meet poses in their cones only, some cannot fold, and some begin where no area shows a way on.
    """
    assert verify(plan(witness(kind, seed).world)).ok


def test_a_reach_too_thin_for_the_margin_is_kept() -> None:
    """Five joints meet a pose from a thin area only."""
    world = witness("offsets", 1016).world
    target = replace(world.task[0], cone=0.03)
    model = scene_of(world).model(target)
    assert isinstance(model, PosedReach)
    sampled = pose_reach(model.chain, model.height, goal_aim(target)).area
    assert not sampled.is_empty
    assert sampled.buffer(-world.rules.reach_margin, join_style="mitre").is_empty
    query = ReachQuery(world.rules, world.rules.reach_margin, (-np.inf, np.inf))
    assert shapely.union_all(reach_table_of(scene_of(world), [target], query)[2]).equals(sampled)
