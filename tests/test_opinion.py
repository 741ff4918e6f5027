"""The second opinion: what it judges, and that it can object."""

from __future__ import annotations

import ast
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

import tests.opinion
from regionik.output.urdf import robot_to_urdf
from regionik.pipeline import search
from regionik.reachability.reach import reach
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.limits import Speeds
from regionik.worlds.links import BASE, LinkBox
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.maths import translation
from tests.opinion.course import Course, halfway
from tests.opinion.judge import objections, posture_objections
from tests.opinion.machine import Facts, Machine
from tests.opinion.search import find_clear, stand_at
from tests.opinion.shortest import Ground, drives, least_turned
from tests.opinion.things import distance_of, placed
from tests.planned import planned
from tests.plans import plan_to_document
from tests.retold import facts_of, machine_of
from tests.soak import against, against_reach, counterexample, judged
from tests.soaked import soaked_world


def taut(radius: float) -> float:
    """The shortest way round a circle about the origin from 1 m before it to 1 m behind it [m]."""
    return float(2 * np.sqrt(1 - radius**2) + radius * (np.pi - 2 * np.arccos(radius)))


JUDGED = ("pillar", "tao3")  # all of them in `make soak` and `.ci/run`


def test_it_shares_nothing_with_what_it_judges() -> None:
    for path in Path(tests.opinion.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.split(".")[0] in ("regionik", "planners", "worlds") for name in names), path


@pytest.mark.parametrize("name", JUDGED)
def test_nothing_against_bundled_worlds(name: str) -> None:
    assert against(planned(name)) == ()


def test_a_ball_in_a_cylinder_is_as_deep_as_its_nearest_way_out() -> None:
    ball, cylinder = coal.Sphere(0.035), coal.Cylinder(0.041, 0.2)
    low, upright = np.eye(4), np.eye(4)
    low[:3, 3] = 0.01, 0.0, -0.095  # 5 mm above its bottom, 31 mm from its side
    for solids in (
        (ball, placed(low), cylinder, placed(upright)),
        (cylinder, placed(upright), ball, placed(low)),
    ):
        assert distance_of(*solids) == pytest.approx(-0.04)


def test_a_depth_that_coal_finds_less_exactly_only_is_taken() -> None:
    """Of two cylinders, where it says -1.8e308 m at a tolerance of 1e-8, whichever comes first."""
    turn = np.array(
        [[-0.365297, -0.273856, 0.889697], [0.104015, -0.961771, -0.253334], [0.925062, 0.0, 0.379817]]
    )
    arm, post = coal.Cylinder(0.035, 0.2175), coal.Cylinder(0.04654412163001045, 0.8)
    T_arm, T_post = np.eye(4), np.eye(4)
    T_arm[:3, :3] = Rotation.from_matrix(turn).as_matrix()
    T_arm[:3, 3], T_post[:3, 3] = [1.41796503, -0.17936798, 0.43343322], [1.54989477, -0.19294242, 0.4]
    for nudge in np.random.default_rng(3).uniform(-1e-6, 1e-6, (200, 3)):
        T_arm[:3, 3] += nudge
        assert distance_of(arm, placed(T_arm), post, placed(T_post)) == pytest.approx(-0.02728, abs=2e-5)


def spoiled(document: dict[str, Any], how: str) -> None:
    """Break one promise of a plan's document."""
    states, world = document["states"], document["world"]
    middle = [k for k, one in enumerate(states) if one["kind"] == "setpoint"][5]
    match how:
        case "order":
            states[middle]["setpoint"] += 1
        case "limits":
            world["rules"]["heading"] = "fixed"
            states[middle]["base"][2] += 0.1
        case "targets":
            states[middle]["joints"][3] += 0.02
        case "hops":
            places = np.array([one["base"][:2] for one in states])
            world["rules"]["step"] = 0.9 * np.linalg.norm(np.diff(places, axis=0), axis=1).max()
        case "floor":
            x, y, _ = states[middle]["base"]
            world["floor"]["polygon"] = [[x, y], [x + 9, y], [x + 9, y + 9]]
        case "clearance":
            world["rules"]["clearance"] *= 1.2
        case "arm":
            x, y, z = states[middle]["tool"]
            world["obstacles"].append({"name": "new", "sphere": {"radius": 0.05, "center": [x, y, z + 0.2]}})
            world["rules"]["tool_contact"] = 0.0
            world["rules"]["arm_clearance"] = 0.1
        case "path":
            world["rules"]["path_tolerance"] = 0.0
        case "self":
            for state in states:
                state["joints"][2] = -2.6
        case "limits: the base does not face":
            world["rules"]["heading"] = "face_target"
        case "criteria: manip":
            world["rules"]["criteria"] = {"manipulability": 1.0}
        case "criteria: joint margin":
            world["rules"]["criteria"] = {"joint_margin": 0.4}
        case "criteria: joint 1 bears":
            world["rules"]["criteria"] = {"effort": 0.5}
        case "lengths":
            lifted = [one["base"] for one in states[middle:] if one["kind"] == "transit"]
            x, y = lifted[len(lifted) // 2][:2]
            wall = {"size": [2.0, 0.01, 0.5], "center": [x, y, 0.25]}
            world["rules"]["clearance"] = 0.0
            world["obstacles"].append({"name": "wall", "box": wall})
        case "pace: a joint goes":
            world["speeds"]["joint_velocity"] *= 0.8
        case "pace: a joint gains":
            world["speeds"]["joint_acceleration"] *= 0.3
        case "pace: the base goes":
            world["speeds"]["base_velocity"] *= 0.8
        case "pace: the base gains":
            world["speeds"]["base_acceleration"] *= 0.3
        case "pace: the tool":
            world["speeds"]["tool_velocity"] *= 0.8
        case "pace: something moves":
            states[middle]["time"] = states[middle + 1]["time"]


HOWS = ["order", "limits", "targets", "hops", "floor", "clearance", "arm", "path", "self"]
HOWS += ["limits: the base does not face", "criteria: manip", "criteria: joint margin"]
HOWS += ["criteria: joint 1 bears", "lengths", "pace: a joint goes", "pace: a joint gains"]
HOWS += ["pace: the base goes", "pace: the base gains", "pace: the tool", "pace: something moves"]


@cache
def sound_plan() -> Plan:
    """A timed one of a robot that carries something."""
    world = load_world("pillar")
    limits = {"joint_velocity": 0.5, "joint_acceleration": 1.0, "base_velocity": 0.3}
    speeds = Speeds(**limits, base_acceleration=0.5, tool_velocity=0.1)
    return retime(search(scene_of(replace(world, robot=replace(world.robot, payload=1.0), speeds=speeds))))


def test_a_sound_plan_is_not_objected_to() -> None:
    assert against(sound_plan()) == ()


@pytest.mark.parametrize("how", HOWS)
def test_a_spoiled_plan_is_objected_to(how: str) -> None:
    world = sound_plan().world
    document = plan_to_document(sound_plan())
    spoiled(document, how)
    told = objections(document, robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
    assert any(text.startswith(how) for text in told), told


@pytest.mark.parametrize(("depth", "reach", "told"), [
    (0.0, 0.3, "deep in new"), (0.1, 0.02, "away from the tool"), (0.1, 0.3, ""),
])  # fmt: skip
def test_a_tool_that_sinks_into_its_work_is_objected_to(depth: float, reach: float, told: str) -> None:
    """A block stands where the tool is at a set-point, round which its link is 35 mm thick."""
    robot, floor = sound_plan().world.robot, sound_plan().world.floor
    document = plan_to_document(sound_plan())
    state = [one for one in document["states"] if one["kind"] == "setpoint"][5]
    document["states"] = [state]
    block = {"size": [0.05, 0.05, 0.05], "center": state["tool"]}
    document["world"]["obstacles"].append({"name": "new", "box": block})
    document["world"]["rules"] |= {"contact_depth": depth, "tool_contact": reach}
    found = posture_objections(document, robot_to_urdf(robot, floor.polygon), facts_of(robot))
    assert [one for one in found if "new" in one and told in one] if told else not found, found


def boxed(obstacles: list[dict[str, Any]], footprint: ArrayLike, clearance: float) -> Ground:
    """The ground of a base on a floor of 4 m by 2 m."""
    floor = {"polygon": [[-2, -1], [2, -1], [2, 1], [-2, 1]]}
    world = {"floor": floor, "obstacles": obstacles, "rules": {"clearance": clearance, "solid_floor": True}}
    robot = load_world("pillar").robot
    facts = replace(facts_of(robot), footprint=np.array(footprint, dtype=float))
    machine = Machine(robot_to_urdf(robot, shapely.box(-2, -1, 2, 1)), facts)
    return Ground(Course({"world": world}, machine))


POINT, SQUARE = [[0, 0]], [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]
PLATE = {"name": "plate", "box": {"size": [0.4, 1.0, 0.5], "center": [0, 0, 0.25]}}
POST = {"name": "post", "cylinder": {"radius": 0.3, "height": 1.0, "center": [0, 0, 0.5]}}
WALL = {"name": "wall", "box": {"size": [0.1, 2.2, 0.5], "center": [0, 0, 0.25]}}
PIER = {"name": "pier", "box": {"size": [0.4, 2.0, 0.5], "center": [0, -0.5, 0.25]}}
HANGING = {"name": "lamp", "box": {"size": [0.4, 2.0, 0.1], "center": [0, 0, 5.0]}}


def test_a_drive_ends_at_every_set_point() -> None:
    drive, target = "transit", "setpoint"
    kinds = [drive, drive, target, "step", target, drive, target, drive, drive, target]
    course: Any = SimpleNamespace(kinds=kinds)
    assert list(drives(course)) == [(0, 2), (4, 6), (6, 9)]
    course = SimpleNamespace(kinds=["setpoint", "setpoint", "transit"])
    assert list(drives(course)) == [(1, 2)]


@pytest.mark.parametrize(
    ("goal", "least"),
    [
        ((1.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, np.pi), np.pi * 0.4),
        ((-2.0, 0.0, 0.0), 2.0),
        ((0.4, 0.4, np.pi / 2), 0.2 * np.pi),
    ],
)
def test_a_car_turns_no_more_tightly_than_it_steers(goal: tuple[float, float, float], least: float) -> None:
    footprint = np.zeros((1, 2))
    car, differential = (Facts(base, footprint, 0.1, 0.4, frozenset()) for base in ("car", "differential"))
    assert least_turned(car, np.zeros(3), np.array(goal)) == pytest.approx(least)
    assert least_turned(differential, np.zeros(3), np.array(goal)) == 0.0


@pytest.mark.parametrize(
    ("things", "footprint", "clearance", "least"),
    [
        pytest.param([], POINT, 0.2, 2.0, id="straight"),
        pytest.param([PLATE], POINT, 0.0, 0.4 + 2 * np.hypot(0.8, 0.5), id="round two corners"),
        pytest.param([POST], POINT, 0.1, taut(0.4), id="round a post"),
        pytest.param([POST], SQUARE, 0.1, taut(0.5), id="round a post with the disc in a footprint"),
        pytest.param([WALL], POINT, 0.0, np.inf, id="nowhere"),
        pytest.param([HANGING], POINT, 0.0, 2.0, id="under it"),
        pytest.param([PIER], POINT, 0.0, 0.4 + 2 * np.hypot(0.8, 0.5), id="round what reaches the edge"),
    ],
)
def test_shortest_ways(things: list[Any], footprint: Any, clearance: float, least: float) -> None:
    ground = boxed(things, footprint, clearance)
    found = ground.shortest(np.array([-1.0, 0]), np.array([1.0, 0]))
    assert found == pytest.approx(least, rel=5e-3)
    assert found <= least + 1e-12
    assert not ground.holds(np.array([3.0, 0.0]))


@pytest.mark.slow
def test_brute_force_sees_what_the_arm_runs_into() -> None:
    world = load_world("pillar")
    spot = world.task[5].position
    machine, document = machine_of(world), world_to_document(replace(world, obstacles=()))
    found = find_clear(document, machine, {"point": spot})
    assert found is not None
    picky = {**document, "rules": {**document["rules"], "criteria": {"manipulability": 1.0}}}
    assert find_clear(picky, machine, {"point": spot}) is None
    ball = {"name": "ball", "sphere": {"radius": 0.05, "center": spot.tolist()}}
    document = {**document, "obstacles": [ball], "rules": {**document["rules"], "tool_contact": 0.0}}
    assert find_clear(document, machine, {"point": spot}) is None


def test_a_claim_is_not_contradicted_by_a_column_in_a_table_top() -> None:
    """Brute force leaves the arm's obstacles out of account, but not those of what stands on the base."""
    mast = LinkBox(BASE, "mast", translation(0.0, 0.0, 0.4), np.array([0.1, 0.1, 0.3]))
    bare, top = robot_named("youbot"), Box("top", np.array([9.0, 9.0, 0.02]), np.array([0.0, 0.0, 0.5]))
    floor, target = Floor(shapely.box(-1, -1, 1, 1)), Target(np.array([0.0, 0.0, 0.25]))
    for robot, met in ((bare, True), (replace(bare, base_solids=(mast,)), False)):
        world = World("under a top", robot, floor, (top,), (target,), Rules())
        assert (counterexample(world, 0) is not None) == met


def test_claims_on_reach_can_be_contradicted(monkeypatch: pytest.MonkeyPatch) -> None:
    world, targets = load_world("pillar"), [Target(np.array([0.5, 0.0, z])) for z in (0.25, 2.0)]
    verdicts, wrong = against_reach(world, targets)
    assert verdicts == ("reachable", "unreachable")
    assert wrong == ()
    honest = reach(world, targets)
    lies = replace(honest, verdict=honest.verdict[::-1], base=honest.base[::-1], joints=honest.joints[::-1])
    monkeypatch.setattr("tests.soak.reach", lambda *_: lies)
    told = against_reach(world, targets)[1]
    assert any("out of reach" in text for text in told)
    assert any("in reach" in text for text in told)


def test_the_way_on_wheels_is_a_circle() -> None:
    here, there = np.zeros(3), np.array([1.0, 1.0, np.pi / 2])
    for share in (0.0, 0.25, 0.5, 1.0):
        x, y, yaw = halfway("differential", here, there, share)
        assert np.allclose([np.sin(yaw), 1 - np.cos(yaw)], [x, y])
    assert np.allclose(halfway("omni", here, there, 0.5), [0.5, 0.5, np.pi / 4])


@pytest.mark.parametrize("kind", ["floor", "overhead", pytest.param("made", marks=pytest.mark.slow)])
def test_brute_force_finds_what_is_there(kind: str) -> None:
    worlds = (soaked_world(kind, seed) for seed in range(1, 12))
    wide = (w for w in worlds if not admissible_area(w, w.task[0]).inner.buffer(-0.02).is_empty)
    reached = list(islice(wide, 2))
    assert len(reached) == 2
    assert all(counterexample(world, 0) is not None for world in reached)


@pytest.mark.parametrize(("kind", "seed"), [("floor", 10), ("overhead", 16)])
def test_areas_are_those_of_brute_force(kind: str, seed: int) -> None:
    """Every place of the inner area works, none outside the outer one does."""
    world = soaked_world(kind, seed)
    area = admissible_area(world, world.task[0])
    document = world_to_document(world)
    machine = Machine(robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
    target = {"point": world.task[0].position, **document["task"][0]}
    rng = np.random.default_rng(seed)
    around = shapely.box(*area.outer.buffer(0.1).bounds)
    low, high = np.array(around.bounds).reshape(2, 2)
    seen = Counter[str]()
    for spot in rng.uniform(low, high, (30, 2)):
        place = shapely.Point(spot)
        found = stand_at(document, machine, target, spot, rng) is not None
        if area.inner.contains(place):
            seen["inside"] += 1
            assert found, f"{spot} is said to serve"
        elif area.outer.disjoint(place):
            seen["outside"] += 1
            assert not found, f"{spot} is said not to serve"
    assert min(seen["inside"], seen["outside"]) > 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        pytest.param("overhead", 3571, id="steps of a base that turns round its arm"),
        pytest.param("urdf", 3084, id="the side of a footprint turns past a post"),
        pytest.param("floor", 4635, id="an upright link beside an upright wall"),
        pytest.param("overhead", 4946, id="an arm led round things still faces its target"),
        pytest.param("wheels", 4798, id="no way to the place that is nominal"),
        pytest.param("stops", 205, id="the base stays at a stop while the tool is lifted"),
        pytest.param("ground", 85, id="a disc beside a round hole in the floor"),
        pytest.param("ground", 407, id="a drive past a corner that stands into the floor"),
    ],
)
def test_worlds_that_the_soak_found(kind: str, seed: int) -> None:
    assert judged(kind, seed).wrong == ()
