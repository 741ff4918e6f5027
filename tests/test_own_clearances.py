"""Obstacles that ask for a clearance of their own, larger or smaller than that of the rules."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

import regionik as rik
from regionik.output.urdf import robot_to_urdf
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.limits import Execution
from regionik.worlds.links import BASE, LinkBox
from regionik.worlds.obstacles import Box, Cylinder, Sphere
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.shadows import Shadow
from tests import examples
from tests.kinds import Solid
from tests.maths import translation
from tests.opinion.judge import posture_objections
from tests.opinion.machine import Facts
from tests.planned import planned
from tests.plans import moved, of_kind, plan_of, plan_text, plan_to_document, straight, world_of
from tests.retold import facts_of

FEW = settings(max_examples=examples(15))
CLEARANCES = st.integers(0, 60).map(lambda k: k / 100)
FLOOR = Floor(shapely.box(-1, -1.5, 3, 1.5))
TASK = tuple(Target(np.array([x, 0.1, 0.25])) for x in (0.3, 0.6, 0.9))
POST, CRATE = (
    Cylinder("post", 0.1, 1.0, np.array([0.6, 0.7, 0.5])),
    Box("crate", np.array([0.4, 0.3, 0.2]), np.array([0.6, -0.5, 0.1]), 0.3),
)
BALL = Sphere("ball", 0.2, np.array([1.2, 0.2, 0.1]))


def room(*solids: Solid, robot: str = "youbot", **rules: object) -> World:
    """Three set-points in a line, and some obstacles about them."""
    return World("room", robot_named(robot), FLOOR, solids, TASK, Rules(**rules))  # type: ignore[arg-type]


def shadow_of(solid: Solid) -> Shadow:
    """What of the floor lies under a solid."""
    shadow = solid.shadow()
    assert shadow is not None
    return shadow


def areas_of(world: World) -> list[shapely.Geometry]:
    """Inner and outer area of each set-point."""
    found = [rik.admissible_area(world, target) for target in world.task]
    return [area for one in found for area in (one.inner, one.outer)]


def off(some: list[shapely.Geometry], others: list[shapely.Geometry]) -> float:
    """By how much areas differ [m2]."""
    return max(a.symmetric_difference(b).area for a, b in zip(some, others, strict=True))


def test_the_clearance_of_the_rules_as_its_own_changes_no_byte() -> None:
    world = load_world("pillar")
    alike = replace(world, obstacles=tuple(replace(one, clearance=0.2) for one in world.obstacles))
    ours, theirs = plan_text(rik.plan(world)), plan_text(rik.plan(alike))
    assert theirs.count('"clearance"') == ours.count('"clearance"') + 1
    told = json.loads(theirs)
    del told["world"]["obstacles"][0]["clearance"]
    assert told == json.loads(ours)


@FEW
@given(CLEARANCES, CLEARANCES, st.sampled_from(["youbot", "youbot-real"]))
@example(0.1, 0.4, "youbot")
@example(0.3, 0.05, "youbot-real")
def test_own_clearances_that_are_all_the_same_are_as_one_of_the_rules(
    rule: float, own: float, robot: str
) -> None:
    solids = POST, CRATE, BALL
    asking = tuple(replace(one, clearance=own) for one in solids)
    scenes = [
        scene_of(room(*some, robot=robot, clearance=clearance, heading="fixed"))
        for some, clearance in ((asking, rule), (solids, own))
    ]
    ours, theirs = ([*path_areas(scene).inner, scene.free_floor.outer.sides[0].free] for scene in scenes)
    assert off(ours, theirs) < 1e-7
    assert off(*(areas_of(scene.world) for scene in scenes)) < 1e-7


@FEW
@given(st.integers(10, 50).map(lambda k: k / 100), st.integers(-5, 30).map(lambda k: k / 100))
@example(0.1, 0.2)
@example(0.2, -0.05)
def test_areas_are_those_of_a_solid_grown_by_the_difference(clearance: float, more: float) -> None:
    """Where the base keeps more than what stands on it, which a grown solid comes nearer to."""
    own = max(0.0, clearance + more)
    grown = replace(POST, radius=POST.radius + own - clearance)
    if grown.radius <= 0:
        return
    ours = areas_of(room(replace(POST, clearance=own), CRATE, clearance=clearance))
    assert off(ours, areas_of(room(grown, CRATE, clearance=clearance))) < 1e-7


@FEW
@given(CLEARANCES, CLEARANCES, st.integers(0, 10**6))
@example(0.35, 0.02, 1)
def test_inner_areas_keep_what_each_asks_for_and_outer_ones_leave_nothing_out(
    post: float, crate: float, seed: int
) -> None:
    world = room(replace(POST, clearance=post), replace(CRATE, clearance=crate), clearance=0.15)
    gaps = [(one, asked) for one, asked in ((POST, post), (CRATE, crate))]
    for target in world.task:
        area = rik.admissible_area(world, target)
        assert area.inner.difference(area.outer.buffer(1e-9)).area < 1e-9
        for solid, asked in gaps:
            assert area.inner.is_empty or shadow_of(solid).distance(area.inner) >= asked
        touching = tuple(replace(one, clearance=0.0) for one in world.obstacles)
        reach = rik.admissible_area(replace(world, obstacles=touching), target).outer
        spots = shapely.points(np.random.default_rng(seed).uniform([0, -1], [1.5, 1], (200, 2)))
        far = np.all(
            [shapely.distance(spots, shadow_of(one).shape(64)) > asked + 1e-3 for one, asked in gaps], 0
        )
        inside = shapely.contains(reach, spots) & far & shapely.contains(FLOOR.polygon, spots)
        assert shapely.contains(area.outer.buffer(1e-6), spots[inside]).all()


def test_a_column_keeps_clear_of_what_lets_the_footprint_near() -> None:
    """Within the footprint and its clearance by the rules, not within what the post asks of the base."""
    column = LinkBox(BASE, "column", translation(0.0, 0.0, 0.565), np.array([0.23, 0.23, 0.55]))
    robot = replace(
        robot_named("youbot-real"),
        body_height=0.29,
        mount=np.array([0.0, 0.0, 0.86, 0.0]),
        base_solids=(column,),
    )
    post = Cylinder("post", 0.1, 0.8, np.array([0.6, 0.5, 0.4]), clearance=0.0)
    world = room(post, clearance=0.3, arm_clearance=0.2, heading="fixed")
    high = tuple(replace(one, position=one.position + [0.0, 0.0, 0.7]) for one in TASK)
    scene = scene_of(replace(world, robot=robot, task=high))
    places = shapely.union_all(path_areas(scene).inner)
    assert places.area > 0.1
    column_there = [shapely.box(x - 0.115, y - 0.115, x + 0.115, y + 0.115)
                    for x, y in shapely.get_coordinates(places).tolist()]  # fmt: skip
    gaps = [shadow_of(post).distance(one) for one in column_there]
    assert 0.2 - 1e-9 <= min(gaps) < 0.201


@pytest.mark.slow
def test_the_bench_is_worked_from_close_by_and_the_workplace_kept_at_its_distance() -> None:
    world, made = load_world("workplace"), planned("workplace")
    assert rik.verify(made, world).ok
    feet = [world.robot.outline(base) for base in made.motion.base]
    bench, workplace = (min(shadow_of(one).distance(foot) for foot in feet) for one in world.obstacles)
    assert 0.03 - 1e-9 <= bench < 0.15
    assert workplace >= 0.5 - 1e-9
    assert posture_objections(plan_to_document(made), *_told(world)) == []
    alike = replace(world, obstacles=tuple(replace(one, clearance=None) for one in world.obstacles))
    with pytest.raises(rik.NoPlanFound):
        rik.plan(alike)


def test_plans_keep_them_and_verification_tells_their_margin() -> None:
    near, wide = replace(CRATE, clearance=0.05), replace(POST, clearance=0.4)
    world = room(near, wide, clearance=0.2)
    world = replace(world, start=Start(np.array([0.0, 0.0, 0.0]), world.robot.carry))
    made = rik.plan(world)
    report = rik.verify(made)
    assert report.ok
    spots = shapely.points(made.motion.base[:, :2])
    left = [
        min(shadow_of(solid).distance(spot) for spot in spots) - asked
        for solid, asked in ((near, 0.05), (wide, 0.4))
    ]
    assert min(left) >= -1e-9
    assert report.margins["clearance"] <= min(left) + 1e-9
    assert posture_objections(plan_to_document(made), *_told(world)) == []
    stricter = replace(world, obstacles=(near, replace(wide, clearance=0.4 + left[1] + 0.01)))
    texts = [one.text for one in of_kind(rik.verify(replace(made, world=stricter)), "clearance")]
    assert all("of post" in text and f"the clearance is {0.41 + left[1]:g} m" in text for text in texts)
    told = posture_objections(plan_to_document(replace(made, world=stricter)), *_told(world))
    assert any("clearance" in text and "post" in text for text in told)


@FEW
@given(st.integers(20, 90))
def test_the_largest_clearance_of_the_rules_leaves_solids_their_own(own: int) -> None:
    """Between a wall that asks for its own and one that asks for that of the rules."""
    asking = Box("asking", np.array([6.0, 0.2, 1.0]), np.array([0.0, 1.4, 0.5]), clearance=own / 100)
    other = Box("other", np.array([6.0, 0.2, 1.0]), np.array([0.0, -1.4, 0.5]))
    world = room(asking, other, clearance=0.05)
    most = rik.admissible_area(world, world.task[1]).clearance
    assert most is not None
    for clearance, open_there in ((most - 1e-4, True), (most + 1e-4, False)):
        changed = replace(world, rules=replace(world.rules, clearance=clearance))
        assert (rik.admissible_area(changed, world.task[1]).inner.area > 0) == open_there


def _told(world: World) -> tuple[str, Facts]:
    return robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot)


def test_verification_asks_each_solid_for_its_own() -> None:
    """The base goes along x from 0 to 0.4 m, a wall 0.3 m beside it and another 0.5 m on its other side."""
    motion = straight()
    near = Box("near", np.array([3.0, 0.2, 1.0]), np.array([0.0, 0.4, 0.5]), clearance=0.3)
    far = Box("far", np.array([3.0, 0.2, 1.0]), np.array([0.0, -0.6, 0.5]), clearance=0.5)
    kept = world_of(motion, near, far)
    assert rik.verify(plan_of(kept, motion)).margins["clearance"] == pytest.approx(0.0, abs=1e-9)
    assert not [one for one in rik.verify(plan_of(kept, motion)).violations if one.kind == "clearance"]
    for side, name in ((0.001, "near"), (-0.001, "far")):
        shifted = moved(motion, 4, base=(0.0, side, 0.0))
        found = of_kind(rik.verify(plan_of(kept, shifted)), "clearance")
        assert {one.text.split(" m of ")[1].split()[0] for one in found} == {name}
        assert max(one.amount for one in found) == pytest.approx(0.001, abs=1e-9)
    erring = replace(kept, rules=replace(kept.rules, execution=Execution(base_error=0.02)))
    assert of_kind(rik.verify(plan_of(erring, motion)), "clearance")[0].amount == pytest.approx(0.02)


def test_a_base_is_told_what_it_comes_too_near_to() -> None:
    world = room(replace(CRATE, clearance=0.0), replace(POST, clearance=0.5), clearance=0.2)
    answer = rik.reach(world, [TASK[1].position], base=[0.6, 0.2, 0.0])
    assert answer.code == ["base-blocked"]
    assert "0.4000 m from post there, and must keep 0.5000 m" in answer.reason[0]
    inside = rik.reach(world, [TASK[1].position], base=[0.6, -0.5, 0.0])
    assert "inside crate" in inside.reason[0]
    beside = rik.reach(world, [TASK[1].position], base=[0.6, -0.25, 0.0])
    assert beside.code != ["base-blocked"]


def test_a_start_too_near_to_it_is_blocked_and_less_of_it_is_a_repair() -> None:
    world = room(replace(POST, clearance=0.5), clearance=0.1)
    world = replace(world, start=Start(np.array([0.6, 0.2, 0.0]), world.robot.carry))
    with pytest.raises(
        rik.NoPlanFound, match=r"0\.400 m from post, and must keep a clearance of 0\.500 m"
    ) as no:
        rik.plan(world)
    repair = next(one for one in no.value.explanation.repairs if one.kind == "clearance")
    assert repair.name == "clearance from post"
    assert 0.39 < repair.amount < 0.4
    assert "lower the clearance from post of 0.5000 m to 0.39" in repair.text


def test_a_start_inside_what_asks_for_no_clearance_is_blocked() -> None:
    world = room(replace(CRATE, clearance=0.0), clearance=0.1)
    world = replace(world, start=Start(np.array([0.6, -0.5, 0.0]), world.robot.carry))
    with pytest.raises(rik.NoPlanFound, match="inside crate"):
        rik.plan(world)
    outside = replace(world, start=Start(np.array([0.6, -0.2, 0.0]), world.robot.carry))
    assert rik.verify(rik.plan(outside)).ok


def test_why_names_it_and_how_much_less_of_it_would_do() -> None:
    """All within the arm's reach lies nearer to the ball than that lets the base come."""
    target = Target(np.array([1.2, 0.2, 0.5]))
    world = replace(room(replace(BALL, clearance=0.8), clearance=0.1), task=(target,))
    found = rik.why(world, target)
    assert found is not None
    assert "nearer than its clearance to ball (0.800 m)" in found.reason
    assert ("clearance", "clearance from ball") in {(one.kind, one.name) for one in found.causes}
    repair = next(one for one in found.repairs if one.kind == "clearance")
    assert repair.name == "clearance from ball"
    eased = replace(world, obstacles=(replace(BALL, clearance=repair.amount),))
    assert rik.reach(eased, [target.position]).reachable.all()
    assert not rik.reach(
        replace(world, rules=replace(world.rules, clearance=0.0)), [target.position]
    ).reachable.any()


def test_world_files_keep_it() -> None:
    document = world_to_document(room(replace(POST, clearance=0.0), CRATE, replace(BALL, clearance=0.25)))
    assert [one.get("clearance") for one in document["obstacles"]] == [0.0, None, 0.25]
    again = world_from_document(document)
    assert [one.clearance for one in again.obstacles] == [0.0, None, 0.25]
    assert world_to_document(again) == document
    with pytest.raises(rik.InputError, match=r"post: clearance: must be at least 0, got -0\.1"):
        replace(POST, clearance=-0.1)
