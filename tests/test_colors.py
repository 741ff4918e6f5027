"""Colours agree with verdicts: no robot of a plan that holds stands in red, no fine set-point is red."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from regionik.papers.tracker import can_track
from regionik.pipeline import search
from regionik.planners.collision.proximity import nearest
from regionik.reachability.field import reach_field, reach_slice
from regionik.regions import outer_areas
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.view.figures import field_image
from regionik.view.floor_view import floor_view, shown_floor
from regionik.view.live import LiveAreas, failing_setpoints, live_areas, live_picture
from regionik.view.options import VIEW
from regionik.view.picture import Color, Picture
from regionik.view.plan_picture import picture_of_plan
from regionik.view.timeline import bodies_around
from regionik.view.world_picture import GHOST_WORDS, picture_of_world, shown_start
from regionik.worlds.bundled import robot_named, world_names
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.scene import World
from tests import MINUTES, examples
from tests.measures import axis_of
from tests.planned import planned
from tests.test_random_worlds import random_world
from tests.test_whatif import crowded


def drawn(picture: Picture, path: str) -> BaseGeometry:
    """What of the floor a mesh covers."""
    corners = [body.mesh.vertices[body.mesh.faces][..., :2] for body in picture.bodies if body.path == path]
    return shapely.union_all(shapely.polygons(np.concatenate(corners))) if corners else shapely.Polygon()


def assert_true(plan: Plan) -> None:
    picture, floor = picture_of_plan(plan), floor_view(plan)
    motion = plan.motion
    places = shapely.points(axis_of(plan.world.robot, motion.base))
    at_work = places[motion.kind == "setpoint"]
    outer = outer_areas(scene_of(plan.world), plan.world.task)
    for red in (drawn(picture, "floor/rejected"), floor.rejected):
        assert not shapely.contains(red, places).any()
    for used, dead_end in (
        (drawn(picture, "areas/strong"), drawn(picture, "areas/pale")),
        (floor.strong, floor.pale),
    ):
        detail = 3 * max(VIEW.floor.detail, float((floor.high - floor.low).max()) / 2000)
        seen = np.array([area.admissible.area > detail**2 for area in plan.areas])  # others are not drawn
        shown = shapely.dwithin(used, at_work, detail)
        # Bands of a wide cone leave a rim of its areas out, in which a tool may lean.
        rim = [not shown[i] and bool(outer[i].buffer(detail).contains(at_work[i])) for i in range(len(shown))]
        wide = np.array([target.direction is not None for target in plan.world.task])
        assert (shown | (rim & wide))[seen].all()
        assert not shapely.contains(dead_end.buffer(-detail), at_work).any()
    assert_swatches(picture)


def assert_swatches(picture: Picture) -> None:
    """The legend has the colours that are drawn, all of them, and no others."""
    shown = [body for body in picture.bodies if len(body.mesh.faces)]
    assert [entry.label for entry in picture.legend] == list(dict.fromkeys(b.label for b in shown if b.label))
    for body in shown:
        if body.layer is not None:
            assert body.opacity == 1.0  # else what lies below would change it
        if body.label and body.label not in ("robot", GHOST_WORDS):
            assert body.color == next(e.color for e in picture.legend if e.label == body.label)
            assert body.colors is None


def assert_live(world: World) -> LiveAreas:
    """A set-point is red if and only if the verdict is no, the one that it names among them."""
    areas = live_areas(world)
    failing = failing_setpoints(areas)
    assert failing.any() == (areas.explanation is not None)
    if areas.explanation is not None and areas.explanation.setpoint is not None:
        assert failing[areas.explanation.setpoint]
    picture = live_picture(areas)
    red = [entry for entry in picture.legend if entry.color == Color.MISSING]
    assert bool(red) == bool(failing.any())
    assert_swatches(picture)
    return areas


@pytest.mark.parametrize("name", ["pillar", "shelf"])
def test_a_plan_that_holds_stands_in_no_red_and_in_no_dead_end(name: str) -> None:
    assert_true(planned(name))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if name == "circle" else ())  # it is another two minutes
        for name in sorted(set(world_names()) - {"pillar", "shelf"})
    ],
)
def test_so_do_the_plans_of_all_bundled_worlds(name: str) -> None:
    assert_true(planned(name))


@pytest.mark.parametrize("name", ["pillar", "wall"])
def test_no_set_point_of_a_world_that_is_planned_is_red(name: str) -> None:
    assert assert_live(load_world(name)).explanation is None


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=MINUTES if name in ("circle", "depot", "door") else pytest.mark.slow)
        for name in sorted(set(world_names()) - {"pillar", "wall"})
    ],
)
def test_nor_one_of_any_bundled_world_that_areas_decide(name: str) -> None:
    world = load_world(name)
    assert (assert_live(world).explanation is None) or can_track(scene_of(world))


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=pytest.mark.slow if seed < 10 else MINUTES) for seed in range(100)]
)
def test_colours_and_verdicts_agree_on_random_worlds(seed: int) -> None:
    world = random_world(seed)
    areas = assert_live(world)
    try:
        found = search(scene_of(world))
    except NoPlanFound:
        return
    assert areas.explanation is None
    assert_true(found)


@settings(max_examples=examples(12), deadline=None)
@given(st.integers(0, 400))
def test_a_robot_without_a_start_stands_in_nothing(seed: int) -> None:
    world = replace(random_world(seed), start=None)
    picture = picture_of_world(world)
    assert_swatches(picture)
    pose = shown_start(world)
    ghosts = {body.label for body in picture.bodies if body.path.startswith("robot")}
    assert ghosts == (set() if pose is None else {GHOST_WORDS})
    if pose is not None:
        assert nearest(bodies_around(world), *pose).distance > 0
        place = shapely.points(axis_of(world.robot, pose[0]))
        assert shown_floor(world).free.buffer(3 * VIEW.floor.detail).contains(place)


def test_a_robot_hemmed_in_is_not_drawn() -> None:
    world = crowded()
    walled = replace(world, start=None, rules=replace(world.rules, clearance=5.0))
    assert shown_start(walled) is None
    assert not any(body.path.startswith("robot") for body in picture_of_world(walled).bodies)


def spoiled(seed: int) -> World:
    """A crowded hall of which some versions can be done and some cannot."""
    rng = np.random.default_rng(seed)
    world = crowded(seed)
    task = list(world.task)
    if seed % 2:
        k = int(rng.integers(len(task)))
        task[k] = replace(task[k], position=task[k].position + (0.0, 0.0, 2.0))
    robot = robot_named("youbot-real" if seed % 3 == 0 else "youbot")
    return replace(world, robot=robot, task=tuple(task))


@settings(max_examples=examples(8), deadline=None)
@given(st.integers(0, 400))
def test_a_live_set_point_is_red_if_and_only_if_the_verdict_is_no(seed: int) -> None:
    assert_live(spoiled(seed))


def test_fields_show_floor_solids_and_targets_by_a_scale_that_fits() -> None:
    world = load_world("pillar")
    field = reach_field(world, [t.position for t in world.task[:3]], cell=0.2)
    assert np.allclose(field.targets, [t.position for t in world.task[:3]])
    words = field_image(field, ".svg").decode()
    for word in ("targets reached", "edge of the floor", "obstacles", "targets"):
        assert f"<!-- {word} -->" in words
    sliced = field_image(reach_slice(world, 0.25, cell=0.2), ".svg").decode()
    assert "<!-- reachable -->" in sliced
    assert "<!-- targets -->" not in sliced
