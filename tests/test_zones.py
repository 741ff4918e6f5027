"""Zones of the floor that the base stays inside or outside; the arm may be over them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

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
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.zones import Keep, Zone
from tests import examples
from tests.opinion.judge import posture_objections
from tests.planned import planned
from tests.plans import moved, of_kind, plan_of, plan_to_document, straight, world_of
from tests.retold import facts_of

FEW = settings(max_examples=examples(12))
TASK = tuple(Target(np.array([x, 0.1, 0.25])) for x in (0.3, 0.6, 0.9))
POST = Cylinder("post", 0.1, 0.1, np.array([0.6, 0.8, 0.05]))
WHOLE = shapely.box(-1, -1.5, 3, 1.5)
OUT, IN = (
    Zone("out", "out", shapely.box(0.5, -0.6, 1.1, 0.0)),
    Zone("in", "in", shapely.box(-0.5, -1, 1.3, 0.8)),
)


def room(*zones: Zone, floor: shapely.Polygon = WHOLE, robot: str = "youbot", **rules: object) -> World:
    """Three set-points in a line, and a post beside them."""
    kept = Rules(clearance=0.1, **rules)  # type: ignore[arg-type]
    return World("room", robot_named(robot), Floor(floor), (POST,), TASK, kept, zones=zones)


@st.composite
def some_zones(draw: st.DrawFn) -> tuple[Zone, ...]:
    """A box to keep in, a box to keep out of, or both."""
    tenths = st.integers(0, 10).map(lambda k: k / 10)
    x, y, wide = draw(tenths), draw(tenths) - 0.5, 0.2 + draw(tenths)
    out = Zone("out", "out", shapely.box(x, y - 0.4, x + wide, y))
    within = Zone("in", "in", shapely.box(x - 1.0, y - 1.3, x + 0.6, y + 0.9))
    return draw(st.sampled_from([(out,), (within,), (out, within)]))


@FEW
@given(some_zones(), st.sampled_from(["youbot", "youbot-real"]), st.booleans())
@example((OUT, IN), "youbot-real", True)
@example((OUT,), "youbot", False)
def test_zones_are_the_floor_cut(zones: tuple[Zone, ...], robot: str, fixed: bool) -> None:
    cut: shapely.Geometry = WHOLE
    for zone in zones:
        cut = cut & zone.polygon if zone.keep == "in" else cut - zone.polygon
    if not isinstance(cut, shapely.Polygon) or cut.is_empty:
        return
    rules = {"heading": "fixed"} if fixed else {}
    ours = scene_of(room(*zones, robot=robot, **rules))
    theirs = scene_of(room(floor=cut, robot=robot, **rules))
    areas = [[*path_areas(one).inner, one.ground.outer.free] for one in (ours, theirs)]
    assert max(a.symmetric_difference(b).area for a, b in zip(*areas, strict=True)) < 1e-9


@FEW
@given(some_zones(), st.integers(0, 10**6))
@example((OUT, IN), 1)
def test_areas_keep_to_them_and_leave_nothing_else_out(zones: tuple[Zone, ...], seed: int) -> None:
    world, free = room(*zones), room()
    spots = shapely.points(np.random.default_rng(seed).uniform([-0.5, -1.0], [1.8, 1.2], (300, 2)))
    may = np.all([shapely.contains(zone.polygon, spots) == (zone.keep == "in") for zone in zones], axis=0)
    for target in world.task:
        area, whole = rik.admissible_area(world, target), rik.admissible_area(free, target)
        assert area.inner.difference(area.outer.buffer(1e-9)).area < 1e-9
        assert not shapely.contains(area.inner, spots[~may]).any()
        assert shapely.contains(
            area.outer.buffer(1e-9), spots[may & shapely.contains(whole.outer, spots)]
        ).all()


@pytest.mark.parametrize(("keep", "side"), [("in", -1.0), ("out", 1.0)])
def test_verification_refuses_a_base_that_leaves_or_enters_one(keep: Keep, side: float) -> None:
    """The base goes along x from 0 to 0.4 m, at y = 0: the edge of the zone."""
    motion = straight()
    zone = Zone("strip", keep, shapely.box(-2, -1, 2, 0))
    edge = replace(world_of(motion), zones=(zone,))
    report = rik.verify(plan_of(edge, motion))
    assert report.margins["zone"] == pytest.approx(0.0, abs=1e-9)
    assert not [one for one in report.violations if one.kind == "zone"]
    kept = moved(motion, 4, base=(0.0, 0.003 * side, 0.0))
    off = moved(motion, 4, base=(0.0, -0.003 * side, 0.0))
    assert not [one for one in rik.verify(plan_of(edge, kept)).violations if one.kind == "zone"]
    found = of_kind(rik.verify(plan_of(edge, off)), "zone")
    where = "outside" if keep == "in" else "in"
    assert all(f"the base is {where} the zone strip" in one.text for one in found)
    assert max(one.amount for one in found) == pytest.approx(0.003, abs=1e-6)


def test_verification_looks_between_states_and_adds_what_execution_may_take() -> None:
    motion = straight(between=0)
    thin = replace(world_of(motion), zones=(Zone("pole", "out", shapely.box(0.04, -0.01, 0.06, 0.01)),))
    assert "0.0" in of_kind(rik.verify(plan_of(thin, motion)), "zone")[0].text
    beside = replace(world_of(motion), zones=(Zone("pole", "out", shapely.box(0.04, 0.01, 0.06, 0.03)),))
    at_states = rik.verify(plan_of(beside, motion)).margins["zone"]  # as that of the floor is
    assert at_states == pytest.approx(np.hypot(0.04, 0.01), abs=1e-9)
    erring = replace(beside, rules=replace(beside.rules, execution=Execution(base_error=0.015)))
    assert of_kind(rik.verify(plan_of(erring, motion)), "zone")


def test_the_walkway_stays_free_and_is_what_makes_the_difference() -> None:
    world, found = load_world("walkway"), planned("walkway")
    report = rik.verify(found, world)
    assert report.ok
    assert 0 <= report.margins["zone"] < 0.1
    feet = shapely.union_all([world.robot.outline(base) for base in found.motion.base])
    (walkway,) = world.zones
    assert feet.intersection(walkway.polygon).area < 1e-9
    assert found.tools()[:, 0].max() > walkway.polygon.bounds[0] + 0.15  # the arm is over it
    told = robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot)
    assert posture_objections(plan_to_document(found), *told) == []
    wider = replace(world, zones=(replace(walkway, polygon=shapely.box(1.0, -1.2, 2.3, 1.2)),))
    assert of_kind(rik.verify(replace(found, world=wider)), "zone")
    entered = posture_objections(plan_to_document(replace(found, world=wider)), *told)
    assert any("floor" in text for text in entered)


def test_a_zone_that_cuts_floor_off_is_named() -> None:
    """The second set-point can be reached from beyond the walkway alone."""
    walkway = Zone("walkway", "out", shapely.box(1.1, -1.5, 1.5, 1.5))
    near, far = Target(np.array([0.3, 0.1, 0.25])), Target(np.array([2.4, 0.1, 0.25]))
    world = replace(room(walkway), task=(near, far))
    world = replace(world, start=Start(np.zeros(3), world.robot.carry))
    with pytest.raises(rik.NoPlanFound, match="the zone walkway cuts it off") as no:
        rik.plan(world)
    causes = no.value.explanation.causes  # a way round it would lead off the floor
    assert {(one.kind, one.name) for one in causes} == {("zone", "walkway"), ("floor", "edge of the floor")}
    assert rik.plan(replace(world, zones=())).setpoints


def test_a_target_that_zones_alone_keep_out_of_reach_is_proven_so() -> None:
    cell = Zone("cell", "in", shapely.box(-1, -1.5, 0.4, 1.5))
    world = room(cell, Zone("far off", "out", shapely.box(-1, -1.5, -0.9, -1.4)))
    target = Target(np.array([2.0, 0.1, 0.25]))
    answer = rik.reach(world, [target.position])
    assert answer.code == ["zone-blocked"]
    assert "the base would be outside the zone cell" in answer.reason[0]
    found = rik.why(world, target)
    assert found is not None
    assert found.verdict == "unreachable"
    assert [(one.kind, one.name) for one in found.causes] == [("zone", "cell")]
    assert "What rules it out is the zone cell, by itself." in found.reason


def test_a_start_in_a_zone_is_refused_and_so_is_a_base_that_is_asked_about() -> None:
    walkway = Zone("walkway", "out", shapely.box(-0.2, -1.5, 0.2, 1.5))
    world = room(walkway)
    answer = rik.reach(world, [TASK[0].position], base=[0.0, 0.0, 0.0])
    assert answer.code == ["zone-blocked"]
    assert "the base stands in the zone walkway there" in answer.reason[0]
    at_edge = rik.reach(world, [TASK[0].position], base=[0.2, -0.3, 0.0])
    assert at_edge.code != ["zone-blocked"]
    started = replace(world, start=Start(np.zeros(3), world.robot.carry))
    with pytest.raises(rik.NoPlanFound, match="is in the zone walkway; the base must start outside it") as no:
        rik.plan(started)
    assert no.value.explanation.verdict == "start-blocked"
    moves = [one for one in no.value.explanation.repairs if one.kind == "move-start"]
    assert moves
    assert abs(abs(moves[0].vector[0]) - 0.2) < 0.01
    cell = replace(started, zones=(Zone("cell", "in", shapely.box(0.1, -1.5, 2, 1.5)),))
    with pytest.raises(rik.NoPlanFound, match="is outside the zone cell; the base must start inside it"):
        rik.plan(cell)


def test_fields_and_stops_keep_to_them() -> None:
    walkway = Zone("walkway", "out", shapely.box(0.5, -1.5, 1.0, 1.5))
    world = room(walkway)
    field = rik.reach_field(world, world.task, cell=0.1)
    x, y = np.meshgrid(field.x, field.y)
    inside = shapely.contains(walkway.polygon, shapely.points(x, y))
    assert field.values.max() > 0
    assert field.values[inside].max() == 0
    parked = rik.plan(replace(world, rules=replace(world.rules, mode="stops", stop_tolerance=0.02)))
    assert rik.verify(parked).ok
    for stop in parked.stops:
        assert walkway.polygon.distance(shapely.Point(stop.base[:2])) >= 0.02 - 1e-9


def test_areas_say_what_a_zone_takes() -> None:
    world = room(Zone("walkway", "out", shapely.box(0.5, -1.5, 1.0, 1.5)))
    taken = {part.name: part for part in rik.admissible_area(world, TASK[1]).causes if part.kind == "zone"}
    assert taken.keys() == {"walkway"}
    assert taken["walkway"].polygon.difference(shapely.box(0.499, -1.5, 1.001, 1.5)).area < 1e-9


def test_world_files_keep_them() -> None:
    holed = shapely.box(0, 0, 1, 1) - shapely.box(0.4, 0.4, 0.6, 0.6)
    document = world_to_document(
        room(Zone("cell", "in", shapely.box(-1, -1, 2, 1)), Zone("ring", "out", holed))
    )
    again = world_from_document(document)
    assert world_to_document(again) == document
    assert [(zone.name, zone.keep) for zone in again.zones] == [("cell", "in"), ("ring", "out")]
    assert "zones" not in world_to_document(room())
    other = rik.verify(
        plan_of(replace(world_of(straight()), zones=again.zones[:1]), straight()), world_of(straight())
    )
    assert any("zones: only in the plan" in one.text for one in other.violations)


def test_geojson_has_them(tmp_path: Path) -> None:
    world = world_of(straight())
    zone = Zone("walkway", "out", shapely.box(2, 0, 3, 1))
    made = plan_of(replace(world, zones=(zone,)), straight())
    rik.export(made, tmp_path / "plan.geojson", "geojson")
    features = json.loads((tmp_path / "plan.geojson").read_text())["features"]
    (found,) = [one for one in features if one["properties"]["part"] == "zone"]
    assert (found["properties"]["name"], found["properties"]["keep"]) == ("walkway", "out")
    assert shapely.equals(shapely.geometry.shape(found["geometry"]), zone.polygon)


def test_zones_that_leave_nothing_are_refused() -> None:
    with pytest.raises(rik.InputError, match="zones: expected that they leave some of the floor"):
        room(Zone("all", "out", shapely.box(-2, -2, 4, 2)))
    with pytest.raises(rik.InputError, match="keep: expected one of in, out"):
        Zone("odd", "off", shapely.box(0, 0, 1, 1))  # type: ignore[arg-type]
