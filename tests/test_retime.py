"""Timed plans: limits kept at every moment, next to the motion that was verified, as fast as may be."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regionik.output.plan_file import load_plan
from regionik.pipeline import plan, search
from regionik.planners.timing.time_optimal import PathDerivatives, time_optimal_velocities
from regionik.scene import scene_of
from regionik.timing import retime as stage
from regionik.timing.limits import MotionLimits, segments_on_path, tool_velocity
from regionik.timing.parametrization import path_of
from regionik.timing.retime import retime
from regionik.timing.trajectory import trajectory
from regionik.values import Motion, Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.drives import wheel_travel
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.maths import Array
from tests.planned import planned
from tests.soaked import soaked_world
from tests.timed import SLACK, check_limits, each_millisecond

WHEELED = Speeds(wheel_velocity=0.5, base_velocity=1.0, turn_velocity=10.0)
LONG = ("circle", "pipe", "tao1", "tao2")  # ways, of some seconds to plan or to time each
TIMED = ["free", "l_shape", "door", *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]


def speeds_for(name: str) -> Speeds:
    return WHEELED if name in ("circle", "door") else Speeds()


@lru_cache(maxsize=20)
def timed(name: str) -> Plan:
    return retime(planned(name), speeds_for(name))


@pytest.mark.parametrize("name", TIMED)
def test_no_limit_is_exceeded_at_a_thousand_hertz(name: str) -> None:
    found, speeds = timed(name), speeds_for(name)
    robot, look = found.world.robot, each_millisecond(found)
    check_limits(look, speeds, robot.chain)
    if speeds.wheel_velocity is not None:
        rolled = np.abs(wheel_travel(look.base, robot.gauge)) / np.diff(look.time)[:, None]
        assert rolled[:-1].max() <= speeds.wheel_velocity * (
            1 + 1e-4
        )  # by differences, over each millisecond
        ahead = look.base_velocity[:, 0] * np.cos(look.base[:, 2]) + look.base_velocity[:, 1] * np.sin(
            look.base[:, 2]
        )
        rims = np.abs(ahead) + np.abs(look.base_velocity[:, 2]) * robot.gauge / 2
        assert rims.max() <= speeds.wheel_velocity * SLACK


@pytest.mark.parametrize("name", ["free", "door"])
def test_rates_are_those_of_the_motion(name: str) -> None:
    look = each_millisecond(timed(name))
    step = np.diff(look.time)[:, None]
    pairs = ((look.base, look.base_velocity), (look.joints, look.joint_velocity))
    for values, rate in pairs:
        mean = (rate[1:] + rate[:-1]) / 2
        assert np.abs(np.diff(values, axis=0) / step - mean).max() < 5e-3
    assert np.abs(np.diff(look.joint_velocity, axis=0)).max() <= 2 * 1e-3 * SLACK  # no jumps
    assert np.abs(np.diff(look.base_velocity[:, 2])).max() <= 2 * 1e-3 * SLACK
    assert np.abs(look.base_velocity[[0, -1]]).max() < 1e-6
    assert np.abs(look.joint_velocity[[0, -1]]).max() < 1e-6


@pytest.mark.parametrize("name", ["free", "l_shape", "door"])
def test_a_timed_plan_holds_and_its_states_are_where_the_trajectory_is(name: str) -> None:
    found = timed(name)
    assert verify(found).ok
    motion = found.motion
    assert motion.time[0] == 0.0
    assert (np.diff(motion.time) >= 0).all()
    look = trajectory(found).sample(motion.time)
    turned = (look.base[:, 2] - motion.base[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(look.base[:, :2] - motion.base[:, :2]).max() < 1e-9
    assert np.abs(turned).max() < 1e-9
    assert np.abs(look.joints - motion.joints).max() < 1e-9


def tools_along(robot: Robot, motion: Motion, near: float) -> Array:
    """Places of the tool along a motion, so far from each other, (n, 3) [m]."""
    q = np.column_stack([motion.base[:, :2], np.unwrap(motion.base[:, 2]), motion.joints])
    ways = np.linalg.norm(np.diff(robot.tool(q[:, :3], q[:, 3:])[:, :3, 3], axis=0), axis=1)
    at = np.concatenate([k + np.arange(0, 1, 1 / (1 + way // near)) for k, way in enumerate(ways)])
    hops = np.column_stack([np.interp(at, np.arange(len(q)), column) for column in q.T])
    places: Array = robot.tool(hops[:, :3], hops[:, 3:])[:, :3, 3]
    return places


@pytest.mark.parametrize("name", ["l_shape"])
def test_the_tool_strays_from_the_plan_by_the_blend_of_corners_and_that_of_the_path(name: str) -> None:
    found, before = timed(name), planned(name).motion
    robot, near = found.world.robot, 1e-4
    old = tools_along(robot, before, near)
    look = trajectory(found).sample(np.linspace(0, found.motion.time[-1], 50_000))
    new = robot.tool(look.base, look.joints)[:, :3, 3]
    allowed = 2 * Speeds.blend + 2 * near
    assert cKDTree(old).query(new)[0].max() <= allowed
    assert cKDTree(new).query(old)[0].max() <= allowed


@pytest.mark.parametrize("name", ["slab"])
def test_a_wider_blend_is_hardly_slower_where_there_is_no_room_for_it(name: str) -> None:
    """A slab over the motion of 5 mm more was rested at, state after state: twice the time."""
    spent = [float(retime(planned(name), Speeds(blend=blend)).motion.time[-1]) for blend in (2e-4, 5e-3)]
    assert spent[1] <= 1.02 * spent[0]


@pytest.mark.parametrize("name", ["pillar"])
def test_corners_are_cut_where_the_tool_is_lifted_and_not_on_its_path(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, near = planned(name), 1e-4
    robot, found = before.world.robot, retime(before).motion
    with monkeypatch.context() as patch:
        patch.setattr(stage, "CORNERS", replace(stage.CORNERS, lifted_blend=Speeds.blend))
        assert found.time[-1] < 0.98 * retime(before).motion.time[-1]
    off = cKDTree(tools_along(robot, before.motion, near)).query(
        robot.tool(found.base, found.joints)[:, :3, 3]
    )[0]
    lifted = found.kind == "transit"
    assert off[~lifted].max() < 2 * Speeds.blend + near
    assert 10 * Speeds.blend < off[lifted].max() < stage.CORNERS.lifted_blend + near


def engine_alone(found: Plan, finer: int) -> float:
    """Duration by TOPP-RA on a plan's own path, on a grid so many times as fine as its states are."""
    limits, best = MotionLimits(found.world.robot, Speeds()), 0.0
    path = path_of(found.world.robot, found.motion)
    for a, b in path.runs:
        hop = np.repeat(np.arange(a, b), finer)
        grid = np.interp(np.arange(len(hop) + 1) / finer, np.arange(b - a + 1), path.position[a : b + 1])
        looks, most = [], np.full(len(grid), np.inf)
        for share in (0.0, 0.5, 1 - 1e-9):
            z, slope, bend = path.evaluate(grid[:-1] + share * np.diff(grid), hop)
            bound = limits.largest_squared_velocity(z, slope, np.full(len(z), np.inf))
            ways = limits.limited_derivatives(slope, bend)
            looks.append(PathDerivatives(share, *ways[:2]))
            most[:-1], most[1:] = np.minimum(most[:-1], bound), np.minimum(most[1:], bound)
        rate = time_optimal_velocities(grid, looks, ways[2], most)
        best += float((2 * np.diff(grid) / (rate[1:] + rate[:-1])).sum())
    return best


@pytest.mark.parametrize("name", ["l_shape", "wall"])
def test_it_is_nearly_as_fast_as_the_engine_alone(name: str) -> None:
    """As on its own grid, where the engine exceeds limits between grid points; next to a finer one."""
    found = timed(name)
    assert engine_alone(found, 1) * 0.998 <= found.motion.time[-1] <= engine_alone(found, 1) * 1.01
    assert found.motion.time[-1] <= engine_alone(found, 8) * 1.06


def test_a_straight_move_has_the_time_of_the_trapezoid() -> None:
    grid, ones = np.linspace(0, 2, 401), np.ones((400, 1))
    looks = [PathDerivatives(share, ones, 0 * ones) for share in (0.0, 1.0)]
    rate = time_optimal_velocities(grid, looks, np.array([0.5]), np.full(401, 0.25))
    assert (2 * np.diff(grid) / (rate[1:] + rate[:-1])).sum() == pytest.approx(2 / 0.5 + 0.5 / 0.5, rel=1e-3)


def test_tool_speed_is_a_limit_on_the_path_and_told_where_it_is_not_held() -> None:
    found = retime(planned("wall"), Speeds(tool_velocity=0.05))
    told = found.stats["timing"]["tool"]
    look = each_millisecond(found)
    z, velocity, _ = look.columns
    speed = np.linalg.norm(tool_velocity(found.world.robot, z, velocity), axis=1)
    hop = np.clip(np.searchsorted(found.motion.time, look.time, side="right") - 1, 0, len(found.motion) - 2)
    on = segments_on_path(found.motion)[hop]
    assert speed[on].max() <= 0.05 * SLACK
    assert speed[~on].max() > 0.05
    assert told["held"] == pytest.approx(np.mean(speed[on] >= 0.99 * 0.05), abs=0.01)
    assert 0.5 < told["held"] < 1
    place = told["places"][0]
    inside = (look.time >= place["from"]) & (look.time <= place["to"])
    assert speed[inside].max() < 0.99 * 0.05


def test_the_tools_velocity_is_that_of_its_frames() -> None:
    robot, rng = robot_named("youbot-real"), np.random.default_rng(0)
    z, v, h = rng.normal(size=(20, 8)), rng.normal(size=(20, 8)), 1e-6
    after, before = (robot.tool((z + s * h * v)[:, :3], (z + s * h * v)[:, 3:])[:, :3, 3] for s in (1, -1))
    assert np.abs((after - before) / (2 * h) - tool_velocity(robot, z, v)).max() < 1e-6


def test_a_tool_speed_that_joints_do_not_allow_is_refused_with_joint_and_time() -> None:
    slow = Speeds(tool_velocity=0.5, joint_velocity=0.05, base_velocity=9.0, turn_velocity=9.0)
    with pytest.raises(InputError, match=r"0.5 m/s cannot be held at t = [0-9.]+ s: joint_\d would go at"):
        retime(planned("free"), slow, hold=True)
    with pytest.raises(InputError, match="expected a tool speed to hold"):
        retime(planned("free"), hold=True)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"base_velocity": 0.0}, "base_velocity: must be above 0, got 0"),
        ({"joint_velocity": (1.0, np.nan, 1.0, 1.0, 1.0)}, "joint_velocity: must be above 0, got nan"),
        ({"turn_acceleration": -1.0}, "turn_acceleration: must be above 0, got -1"),
        ({"tool_velocity": np.nan}, "tool_velocity: must be above 0, got nan"),
    ],
)
def test_limits_that_are_none_are_refused(given: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Speeds(**given)


def test_other_impossible_requests_are_refused() -> None:
    free = planned("free")
    with pytest.raises(InputError, match=r"expected one number or 5 \(joint_1, .*\), got 2"):
        retime(free, Speeds(joint_velocity=(1.0, 1.0)))
    with pytest.raises(InputError, match="it is not timed"):
        trajectory(free)
    columns = {key: getattr(free.motion, key)[:0] for key in ("base", "joints", "kind", "setpoint", "time")}
    with pytest.raises(InputError, match="no states"):
        retime(replace(free, motion=replace(free.motion, **columns)))
    sunk = free.motion.base + [5.0, 0.0, 0.0]
    with pytest.raises(InputError, match="breaks its own rules"):
        retime(replace(free, motion=replace(free.motion, base=sunk)))
    with pytest.raises(InputError, match="expected from 0 to"):
        trajectory(timed("free")).sample([-1.0])


def test_times_that_fit_no_motion_are_refused() -> None:
    found = timed("free")
    motion = found.motion
    late = motion.time * np.linspace(1, 2, len(motion))
    with pytest.raises(InputError, match="time the plan anew"):
        trajectory(replace(found, motion=replace(motion, time=late)))
    with pytest.raises(InputError, match="no time passes"):
        trajectory(replace(found, motion=replace(motion, time=0 * motion.time)))


def test_plans_are_timed_where_there_are_speeds(tmp_path: object) -> None:
    world = load_world("free")
    assert np.isnan(plan(world).motion.time).all()
    fast = replace(world, speeds=Speeds(base_velocity=0.3, joint_velocity=(1.0, 2.0, 1.0, 1.0, 1.0)))
    found = plan(fast)
    assert not np.isnan(found.motion.time).any()
    joints = tuple(replace(joint, velocity=1.5) for joint in world.robot.chain.joints)
    quick = replace(world, robot=replace(world.robot, chain=Chain(joints, world.robot.chain.T_last_tool)))
    assert not np.isnan(plan(quick).motion.time).any()
    document = world_to_document(fast)
    assert world_from_document(document).speeds == fast.speeds
    document["speeds"] = {"joint_velocity": [1.0, 2.0]}
    with pytest.raises(InputError, match="speeds: joint_velocity: expected one number or 5"):
        world_from_document(document)


def test_a_timed_plan_reads_back_as_the_same_trajectory(tmp_path: pytest.TempPathFactory) -> None:
    found = timed("door")
    path = f"{tmp_path}/plan.json"
    found.save(path)
    again = load_plan(path)
    one, other = each_millisecond(found), each_millisecond(again)
    assert np.array_equal(one.joints, other.joints)
    assert np.array_equal(one.base_velocity, other.base_velocity)


def test_a_robot_that_stays_needs_no_time() -> None:
    robot = robot_named("youbot")
    joints = np.array([0.0, 1.6, -1.0, 0.5, 0.0])
    here: Array = robot.tool(np.zeros(3), joints)[:3, 3]
    start = Start(np.zeros(3), joints)
    world = World(
        "still", robot, Floor(shapely.box(-2, -2, 2, 2)), (), (Target(here),), Rules(clearance=0.0), start
    )
    found = retime(plan(world))
    assert found.motion.time[-1] == 0.0
    assert trajectory(found).sample([0.0]).joints[0] == pytest.approx(joints)


@pytest.mark.parametrize("asked", [Speeds(base_velocity=0.5), Speeds(tool_velocity=0.1)])
def test_a_single_state_needs_no_time(asked: Speeds) -> None:
    """Without a start a path of one set-point is one state."""
    free = load_world("free")
    found = retime(plan(replace(free, task=free.task[:1], start=None)), asked)
    assert found.motion.time.tolist() == [0.0]
    assert found.stats["timing"]["duration"] == 0.0
    assert trajectory(found).sample([0.0]).base_velocity.tolist() == [[0.0, 0.0, 0.0]]


def test_a_world_of_one_set_point_that_the_soak_found_is_timed() -> None:
    assert verify(retime(search(scene_of(soaked_world("overhead", 591))))).ok


@pytest.mark.slow
def test_a_path_on_which_the_engine_stumbles_is_timed() -> None:
    """In metres its linear programs end without an answer at one state, by rounding."""
    timed = retime(search(scene_of(soaked_world("made", 197))))
    assert verify(timed).ok
    assert 0 < timed.motion.time[-1] < np.inf


def test_a_pointer_in_the_tool_keeps_it_from_turning() -> None:
    robot, rng = robot_named("youbot-real"), np.random.default_rng(1)
    q = rng.normal(size=(20, 8))
    other = q + 1e-3 * rng.normal(size=q.shape)
    turns = [robot.tool(one[:, :3], one[:, 3:])[:, :3, :3] for one in (q, other)]
    angle = Rotation.from_matrix(turns[0].swapaxes(1, 2) @ turns[1]).magnitude()
    bare, pointed = (MotionLimits(robot, Speeds(), length).displacement(q, other) for length in (0.0, 2.0))
    assert (pointed >= bare).all()
    assert (pointed >= 2.0 * angle * (1 - 1e-6)).all()
