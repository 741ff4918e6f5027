"""The smallest repairs: one world for each kind, the repair made again, and what brute force says of less."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from regionik.explain.changes import repaired
from regionik.pipeline import plan, why
from regionik.pruning import spans
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import Explanation, Repair
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import MINUTES
from tests.why_cases import as_small_as_brute_force, cases, part_of, smaller

SHOULDER, REACH = 0.147, 0.033 + 0.155 + 0.135 + 0.2175  # of the youbot, stretched level [m]
PLATE = Box("plate", np.array([0.6, 8.0, 0.1]), np.array([0.0, 0.0, 0.05]))
WIDE, SMALL = shapely.box(-4, -4, 4, 4), shapely.box(-0.05, 0.3, 0.05, 0.5)


def of_kind(found: Explanation | None, kind: str) -> Repair:
    assert found is not None
    return next(repair for repair in found.repairs if repair.kind == kind)


def hall(name: str, target: Target, floor: shapely.Polygon = WIDE, *obstacles: Box) -> World:
    rules = Rules(clearance=0.3, reach_margin=0.0)
    return World(name, robot_named("youbot"), Floor(floor), obstacles, (target,), rules)


BEHIND = hall("behind", Target(np.array([0.0, 0.0, SHOULDER])), WIDE, PLATE)
HIGH = hall("high", Target(np.array([0.0, 0.0, SHOULDER + REACH + 0.1])))
BESIDE = hall("beside", Target(np.array([0.0, 0.0, 0.3]), np.array([1.0, 0.0, 0.0]), 0.3), SMALL)


@cache
def told(name: str) -> Explanation | None:
    world = next(one for one in (BEHIND, HIGH, BESIDE) if one.name == name)
    return why(world, world.task[0])


@pytest.mark.parametrize(
    ("kind", "world"),
    [
        ("clearance", BEHIND),
        ("move-target", BEHIND),
        ("move-obstacle", BEHIND),
        ("move-target", HIGH),
        ("raise", HIGH),
        pytest.param("cone", BESIDE, marks=pytest.mark.slow),
    ],
)
def test_a_target_is_mended_by_as_little_as_brute_force_finds(kind: str, world: World) -> None:
    repair = of_kind(told(world.name), kind)
    changed = repaired(scene_of(world), repair)
    assert reach(changed.world, changed.task).reachable.all()
    assert as_small_as_brute_force(world, repair)
    assert not as_small_as_brute_force(world, part_of(world, repair, 1.2))


def test_a_base_beside_the_tools_direction_wants_a_wider_cone() -> None:
    found = told("beside")
    assert found is not None
    assert {cause.kind for cause in found.causes} == {"floor", "direction"}
    cone = of_kind(found, "cone")
    assert (cone.unit, cone.vector) == ("rad", ())
    assert np.arctan2(0.3, 0.05) <= cone.amount < np.arctan2(0.5, 0.05)  # from the corners of the floor
    ends = [replace(BESIDE.task[0], cone=share * cone.amount) for share in (1.0, 0.95)]
    assert reach(BESIDE, ends).reachable.tolist() == [True, False]


PATH = load_world("pillar")
UNBROKEN = replace(PATH, rules=replace(PATH.rules, max_lift_offs=0))
NEARLY = replace(UNBROKEN, rules=replace(UNBROKEN.rules, clearance=0.108))


@pytest.mark.parametrize(
    ("kind", "world"),
    [
        ("lift-off", UNBROKEN),
        pytest.param("move-obstacle", UNBROKEN, marks=pytest.mark.slow),
        pytest.param("clearance", UNBROKEN, marks=pytest.mark.slow),
        pytest.param("raise", NEARLY, marks=MINUTES),
    ],
)
def test_a_path_is_mended_by_as_little_as_brute_force_finds(kind: str, world: World) -> None:
    found = why(world)
    assert found is not None
    repair = of_kind(found, kind)
    assert plan(repaired(scene_of(world), repair).world)
    assert not any(spans(scene_of(less)) for less in smaller(world, repair))
    if kind == "lift-off":
        assert (found.verdict, found.setpoint) == ("ladder-broken", 10)
        assert [one.name for one in found.causes] == ["rules.max_lift_offs", "pillar", "rules.clearance"]
        assert {"clearance", "move-obstacle"} <= {one.kind for one in found.repairs}
        assert "inner areas alone" in found.reason
        assert (repair.name, repair.amount) == ("set-point 11", 1.0)
    else:
        assert any(spans(scene_of(less)) for less in smaller(world, part_of(world, repair, 1.2)))


@pytest.mark.parametrize(
    ("seed", "longest"),
    [
        pytest.param(668, 0.25, id="straight down the arm runs into a ball, for another 0.16 m"),
        pytest.param(
            716,
            0.11,
            id="along the shortest way of the base the arm touches a box until 0.168 m",
            marks=MINUTES,
        ),
    ],
)
def test_a_way_round_what_the_arm_would_touch(seed: int, longest: float) -> None:
    (world,) = cases([seed])
    repair = of_kind(why(world, world.task[0]), "move-target")
    assert repair.amount < longest
    changed = repaired(scene_of(world), repair)
    assert reach(changed.world, changed.task).reachable.all()
    # What the arm touches comes and goes along a direction.
    assert as_small_as_brute_force(world, repair, near=0.1)
