"""The second opinion: what it judges, and that it can object."""

from __future__ import annotations

import ast
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import tests.opinion
from regionik.pipeline import search
from regionik.plandocument import plan_to_document
from regionik.regions import admissible_area
from regionik.urdf_text import robot_to_urdf
from regionik.worlds.format import world_to_document
from regionik.worlds.library import load_world, world_names
from tests.opinion.course import halfway
from tests.opinion.judge import objections
from tests.opinion.machine import Machine
from tests.opinion.search import stand_at
from tests.soak import KINDS, against, counterexample, facts_of, judged, soaked_world

SLOW = ("circle", "depot", "pipe", "tao1")  # some seconds each, here or in their plans; in `make soak`


def test_it_shares_nothing_with_what_it_judges() -> None:
    for path in Path(tests.opinion.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.split(".")[0] in ("regionik", "planners", "worlds") for name in names), path


@pytest.mark.parametrize("name", [name for name in world_names() if name not in SLOW])
def test_nothing_against_bundled_worlds(name: str) -> None:
    assert against(search(load_world(name))) == ()


def test_nothing_against_random_worlds() -> None:
    found = [judged(KINDS[n % len(KINDS)], n) for n in range(16)]
    assert {(one.kind, one.seed): one.wrong for one in found if one.wrong} == {}
    verdicts = Counter(one.verdict for one in found)
    assert verdicts["planned"] >= 10
    assert sum(one.claimed for one in found) >= 3


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
            world["rules"]["step"] /= 3
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


@pytest.mark.parametrize(
    "how", ["order", "limits", "targets", "hops", "floor", "clearance", "arm", "path", "self"]
)
def test_a_spoiled_plan_is_objected_to(how: str) -> None:
    world = load_world("pillar")
    document = json.loads(json.dumps(plan_to_document(search(world))))
    spoiled(document, how)
    told = objections(document, robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
    assert any(text.startswith(how) for text in told), told


def test_the_way_on_wheels_is_a_circle() -> None:
    here, there = np.zeros(3), np.array([1.0, 1.0, np.pi / 2])
    for share in (0.0, 0.25, 0.5, 1.0):
        x, y, yaw = halfway("differential", here, there, share)
        assert np.allclose([np.sin(yaw), 1 - np.cos(yaw)], [x, y])
    assert np.allclose(halfway("omni", here, there, 0.5), [0.5, 0.5, np.pi / 4])


@pytest.mark.parametrize("kind", ["floor", "overhead", "made"])
def test_brute_force_finds_what_is_there(kind: str) -> None:
    worlds = [soaked_world(kind, seed) for seed in range(1, 12)]
    reached = [w for w in worlds if not admissible_area(w, w.task[0]).inner.buffer(-0.02).is_empty][:3]
    assert len(reached) == 3
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
