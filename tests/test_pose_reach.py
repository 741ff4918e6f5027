"""Reach of oriented tools: what is found is there, what is there is found, and no path is too long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from benchmarks.tables.goals import confirm
from regionik.areas.reach_model import ReachQuery
from regionik.areas.reachable import PosedReach
from regionik.parking.fewest_stops import park
from regionik.parking.stop_motion import connect_stops
from regionik.parking.stops import in_sequence
from regionik.pipeline import plan
from regionik.planners.reach import pose_reach as sampled
from regionik.planners.reach.inverse_reachability import Tolerances, aim_at, posture_samples, posture_seeds
from regionik.planners.reach.polar_cells import PolarCells, asked_cells
from regionik.planners.reach.pose_reach import pose_reach
from regionik.planners.solvers.closed_form import Polish, postures_at
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aim
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.postures.arm import aim_of as goal_aim
from regionik.reach_rows import rows_of
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
    for seed in range(3):
        aim, _ = aim_of_posture(chain, seed, kind, 0.05)
        found = pose_reach(chain, HEIGHT, aim).grid
        for k in range(0, len(found.places), 7):
            seen = in_arm_frame(found.places[k], float(found.yaws[k]), HEIGHT, aim)
            error, angle = confirm(chain, seen, found.postures[k])
            assert error <= 1.1e-4
            assert angle <= 0.05 + 0.006
            held = found.postures[k][1:]
            assert ((held >= chain.lower[1:]) & (held <= chain.upper[1:])).all()


@pytest.mark.parametrize("name", ["ur", "panda", "puma"])
def test_the_place_of_a_posture_lies_in_the_reach_of_its_pose(name: str) -> None:
    chain, missed = ARMS[name], 0
    for seed in range(60):
        aim, _ = aim_of_posture(chain, seed, ORIENTATION, 1e-3)
        area = pose_reach(chain, HEIGHT, aim).area
        missed += area.distance(shapely.Point(0.0, 0.0)) > 0.02
    assert missed <= 1  # sampled


@pytest.mark.parametrize("name", ["ur", "puma"])
def test_cells_are_asked_for_branches_that_were_not_led_to(name: str) -> None:
    """Cuts only move outwards, and cells only come back; both are where a closed form has postures."""
    chain, more = ARMS[name], 0
    first, *others = chain.joints
    endless = Chain((replace(first, lower=-np.inf, upper=np.inf), *others), chain.T_last_tool)
    distances, bearings = np.linspace(0.0, 1.2, 13), np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    r, b = (part.ravel() for part in np.meshgrid(distances, bearings, indexing="ij"))
    for seed in range(3):
        aim = aim_of_posture(endless, seed, ORIENTATION, 1e-3)[0]
        aim = aim._replace(position=np.array([0.0, 0.0, aim.position[2] - HEIGHT]))
        found = reached_from(endless, aim, r, b).reshape(13, 24)
        outward = np.where(found[:-1] != found[1:], np.where(found[:-1], 0.0, 1.0), 0.0)
        onward = np.where(found != np.roll(found, -1, axis=1), np.where(found, 0.0, 1.0), 0.0)
        tight = PolarCells(distances, bearings, found, outward, onward)
        none = np.zeros(len(tight.middles[0]), dtype=bool)
        asked = asked_cells(endless, aim, Polish(1e-4, 1e-4, 8), tight, none)
        moved = np.abs(asked.outward - tight.outward)
        assert set(np.round(np.unique(moved), 3)) <= {0.0, 0.125, 0.375}
        assert asked.counted is not None
        i, j = np.nonzero(moved)
        assert reached_from(endless, aim, distances[i] + 0.1 * asked.outward[i, j], bearings[j]).all()
        assert reached_from(endless, aim, *tight.kept(asked.counted[tight.cells]).middles[2].T).all()
        more += len(i)
    assert more > 10


def reached_from(chain: Chain, aim: Aim, distance: Array, bearing: Array) -> NDArray[np.bool_]:
    """Mask of places, by distance and bearing from the target, from which a closed form meets an aim."""
    tools = np.tile(np.eye(4), (len(distance), 1, 1))
    tools[:, :3, :3], tools[:, 2, 3] = aim.turn, aim.position[2]
    tools[:, 0, 3], tools[:, 1, 3] = -distance * np.cos(bearing), -distance * np.sin(bearing)
    met = np.zeros(len(distance), dtype=bool)
    met[postures_at(chain, tools, Polish(1e-4, 1e-4, 8))[1]] = True
    return met


def test_samples_meet_poses_though_few_places_do() -> None:
    """With four joints behind the pivot, places for a pose are a curve: the base comes to it."""
    *first, last = ARMS["ur"].joints
    pivot = replace(first[0], lower=-np.inf, upper=np.inf)
    chain = Chain((pivot, *first[1:]), last.T_parent_joint @ ARMS["ur"].T_last_tool)
    samples, within = posture_samples(chain, 2.0), Tolerances(1e-4, 1e-3, 2.0)
    for seed in range(3):
        aim, _ = aim_of_posture(chain, seed, ORIENTATION, 0.02)
        rise = float(aim.position[2] - HEIGHT)
        postures, places = posture_seeds(chain, samples, rise, aim, within, 64)
        assert len(postures) > 32
        for q, (distance, bearing) in zip(postures, places, strict=True):
            seen = aim_at(aim._replace(position=np.array([0, 0, rise])), distance, bearing, bearing + np.pi)
            error, angle = confirm(chain, seen, q)
            assert error <= 1.1e-4
            assert angle <= 0.022


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


def test_no_path_is_too_long_to_be_kept() -> None:
    """A path of 437 poses was sampled anew each time that it was asked for: 256 were kept."""
    kept = sampled._sampled.cache_info().maxsize
    assert kept is not None
    assert kept >= 4000


@pytest.mark.parametrize("columns", [1, 32])
def test_cells_are_cut_where_their_edges_leave_the_set(columns: int) -> None:
    """A ring, and a disc beside the origin: their areas to the error of chords."""
    distances = np.linspace(0.0, 1.0, 19)
    bearings = np.linspace(0.0, 2 * np.pi, columns, endpoint=False)
    center = np.array([0.0 if columns == 1 else 0.1, 0.0])
    low, high = 0.31, 0.77

    def size(r: Array, b: Array) -> Array:
        away = r[..., None] * np.stack([np.cos(b), np.sin(b)], axis=-1) - center
        length: Array = np.linalg.norm(away, axis=-1)
        return length

    def inside(r: Array, b: Array) -> NDArray[np.bool_]:
        within: NDArray[np.bool_] = (size(r, b) > low) & (size(r, b) < high)
        return within

    def cut(r: tuple[Array, Array], b: tuple[Array, Array]) -> Array:
        shares = np.linspace(0, 1, 401)[:, None, None]
        at = inside(r[0] + shares * (r[1] - r[0]), b[0] + shares * (b[1] - b[0]))
        change = np.argmax(at != at[:1], axis=0)
        return np.where((at != at[:1]).any(axis=0), (change - 0.5) / 400, 0.0)

    r, b = np.meshgrid(distances, bearings, indexing="ij")
    beyond = b + 2 * np.pi / columns
    outward = cut((r[:-1], r[1:]), (b[:-1], b[:-1]))
    onward = cut((r, r), (b, beyond)) if columns > 1 else np.zeros_like(r)
    area = PolarCells(distances, bearings, inside(r, b), outward, onward).area
    assert area.is_valid
    assert area.area == pytest.approx(np.pi * (high**2 - low**2), rel=0.02)


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
        pytest.param("offsets", 61, marks=pytest.mark.slow),
        ("offsets", 96),
        ("offsets", 46),
        pytest.param("offsets", 6, marks=pytest.mark.slow),
        ("urdf arms", 444),
        ("offsets", 2196),
        pytest.param("offsets", 2281, marks=pytest.mark.slow),
        ("offsets", 3646),
        ("slides", 30587),
        ("offsets", 20331),
        ("wrists", 41305),
        ("offsets", 40861),
        ("offsets", 31596),
        pytest.param("offsets", 41956, marks=pytest.mark.slow),
        ("slides", 40352),
        ("urdf arms", 41879),
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
    assert shapely.union_all(rows_of(scene_of(world), [target], query)[2]).equals(sampled)
