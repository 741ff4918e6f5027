"""The fewest stops: against going through all ways to cut the path, and what must always hold."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry import Point

from regionik.cli.app import run
from regionik.output.plan_file import load_plan
from regionik.parking.fewest_stops import park
from regionik.parking.placements import PlacementSearch
from regionik.parking.stops import in_sequence, stops
from regionik.pipeline import plan
from regionik.planners.coverage import set_cover
from regionik.planners.coverage.options import COVERAGE
from regionik.planners.coverage.set_cover import least_cover, undominated
from regionik.postures.families import BACK, FRONT
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.verification.stops import within_reachable_circles
from regionik.verification.verifier import verify
from regionik.view.floor_view import floor_view
from regionik.view.plan_picture import picture_of_plan
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.obstacles import Box, Cylinder, Sphere
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests import MINUTES
from tests.soaked import soaked_world
from tests.witnesses import witness

STOPS = Rules(clearance=0.05, mode="stops", step=0.2)
TAU = STOPS.stop_tolerance


def wave(seed: int, count: int = 14) -> World:
    """A wave among posts that the base must keep off and the arm passes over."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, count)
    path = np.column_stack(
        [
            rng.uniform(1.0, 3.0) * share,
            rng.uniform(0.1, 0.6) * np.sin(share * rng.uniform(1, 8)),
            rng.uniform(0.2, 0.4) + 0.05 * np.sin(5 * share),
        ]
    )
    posts = tuple(
        Cylinder(f"post {k}", 0.05, 0.1, np.array([*rng.uniform([-0.3, -0.8], [3.3, 0.8]), 0.05]))
        for k in range(rng.integers(0, 6))
    )
    robot, floor = robot_named("youbot"), Floor(shapely.box(-1.5, -2, 4.5, 2))
    start = Start(np.array([-1.0, -1.5, 0.0]), robot.carry)
    return World(f"wave {seed}", robot, floor, posts, tuple(map(Target, path)), STOPS, start)


def ruled(world: World, **rules: object) -> World:
    return replace(world, rules=replace(world.rules, **rules))  # type: ignore[arg-type]


def fewest(world: World) -> int:
    """By dynamic programming over all ways to cut the path, areas intersected afresh for every part."""
    count = len(world.task)
    areas = {facing: np.empty(count, dtype=object) for facing in (FRONT, BACK)}
    for facing, row in areas.items():
        found = path_areas(scene_of(world), facings=(facing,))
        row[:] = [
            shapely.union_all([part.buffer(-TAU, quad_segs=64) for part in found.inner[found.target == i]])
            for i in range(count)
        ]
    best = [0] + [count + 1] * count
    for last in range(count):
        for first in range(last + 1):
            some = (shapely.intersection_all(row[first : last + 1]).area for row in areas.values())
            if max(some) > 1e-10:
                best[last + 1] = min(best[last + 1], best[first] + 1)
    return best[count]


@pytest.mark.parametrize("seed", range(3))
def test_none_of_all_ways_to_cut_the_path_needs_fewer_stops(seed: int) -> None:
    world = wave(seed)
    found = park(scene_of(world))
    assert len(found.groups) == fewest(world)
    assert len(found.groups) >= found.lower


@pytest.mark.parametrize("seed", range(2))
def test_a_path_backwards_needs_as_many(seed: int) -> None:
    world = wave(seed)
    back = replace(world, task=world.task[::-1])
    assert len(park(scene_of(world)).groups) == len(park(scene_of(back)).groups)


@pytest.mark.parametrize("seed", range(1))
def test_more_clearance_and_more_tolerance_never_need_fewer(seed: int) -> None:
    for key in ("clearance", "stop_tolerance"):
        counts = [len(park(scene_of(ruled(wave(seed), **{key: value}))).groups) for value in (0.0, 0.05, 0.1)]
        assert counts == sorted(counts)


@pytest.mark.parametrize(
    ("criterion", "order"),
    [
        ("tolerance", "given"),
        ("clearance", "any"),
        ("manipulability", "given"),
        ("effort", "any"),
        ("distance", "any"),
    ],
)
def test_every_circle_lies_in_every_area(order: str, criterion: str) -> None:
    world = ruled(wave(1, count=8), order=order, stop_criterion=criterion)
    areas = path_areas(scene_of(world))
    found = stops(world)
    assert sorted(i for stop in found for i in stop.setpoints) == list(range(len(world.task)))
    for stop in found:
        assert stop.tolerance >= TAU * 0.999
        circle = Point(stop.base[:2]).buffer(stop.tolerance - 1e-6)  # the arm stands on the base's middle
        for i in stop.setpoints:
            assert shapely.union_all(areas.inner[areas.target == i]).covers(circle)


CRITERIA = ("tolerance", "clearance", "manipulability", "effort", "distance")


def narrow(world: World, half: float) -> World:
    """The world with a pivot that turns no farther than this to either side."""
    joints, chain = list(world.robot.chain.joints), world.robot.chain
    joints[0] = replace(joints[0], lower=-half, upper=half)
    robot = replace(world.robot, chain=Chain(tuple(joints), chain.T_last_tool))
    return replace(world, robot=robot)


@pytest.mark.parametrize("order", ["given", "any"])
@pytest.mark.parametrize("seed", [pytest.param(0, marks=MINUTES), pytest.param(1, marks=pytest.mark.slow), 2])
def test_the_criterion_chooses_among_fewest_stops(order: str, seed: int) -> None:
    """A pivot that hardly turns once split stops by one criterion and not by another."""
    world = narrow(wave(seed, count=10), 1.0)
    found = [stops(ruled(world, order=order, stop_criterion=criterion)) for criterion in CRITERIA]
    served = [sorted(stop.setpoints for stop in some) for some in found]
    assert all(some == served[0] for some in served)
    assert min(stop.tolerance for some in found for stop in some) >= TAU * 0.999


def scattered(seed: int, half: float) -> World:
    """Thirty holes that an arm with a narrow pivot does from some stops."""
    rng = np.random.default_rng(seed)
    spots = np.column_stack([rng.uniform([0, 0], [1.6, 1.0], (30, 2)), rng.uniform(0.2, 0.4, 30)])
    rules = replace(STOPS, order="any")
    floor = Floor(shapely.box(-1, -1, 2.6, 2))
    return narrow(World(f"{seed}", robot_named("youbot"), floor, (), tuple(map(Target, spots)), rules), half)


def sampled_cover(world: World, spacing: float) -> int:
    """Fewest stops from a grid of places and headings, each set-point by the pivot's bearing alone."""
    joint, x = world.robot.chain.joints[0], np.arange(-0.8, 2.4, spacing)
    axes = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    yaws, served = np.arange(0, 2 * np.pi, np.pi / 18), np.zeros((len(axes), 36, len(world.task)), dtype=bool)
    for facing, turn in ((FRONT, 0.0), (BACK, np.pi)):
        found = path_areas(scene_of(world), facings=(facing,))
        for i, target in enumerate(world.task):
            parts = [shapely.get_parts(area) for area in found.inner[found.target == i]]
            area = shapely.union_all([part.buffer(-TAU) for some in parts for part in some])
            away = target.position[:2] - axes
            spare = np.arcsin(np.minimum(1.0, TAU / np.hypot(*away.T)))[:, None]
            bearing = np.arctan2(away[:, 1], away[:, 0])[:, None] + turn
            pivot = np.mod(bearing - yaws + np.pi, 2 * np.pi) - np.pi
            fits = (pivot >= joint.lower + spare) & (pivot <= joint.upper - spare)
            served[:, :, i] |= shapely.contains_xy(area, *axes.T)[:, None] & fits
    rows = np.unique(served.reshape(-1, len(world.task)), axis=0)
    return len(least_cover(rows[undominated(rows)]).chosen)


@pytest.mark.parametrize(("seed", "half"), [(0, 0.8), pytest.param(1, 0.4, marks=pytest.mark.slow)])
def test_no_cover_from_a_grid_of_places_and_headings_needs_fewer(seed: int, half: float) -> None:
    world = scattered(seed, half)
    assert len(stops(world)) <= sampled_cover(world, 0.1)


@pytest.mark.parametrize("most", [15, 7])
def test_some_of_many_areas_are_enough_for_a_cover_and_a_bound(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = scattered(0, 3.0)
    whole = park(scene_of(world))
    monkeypatch.setattr(set_cover, "COVERAGE", replace(COVERAGE, max_overlaid=most))
    found = park(scene_of(world))
    assert found.lower <= whole.lower
    assert int(found.known["fewest_of_inner_areas"]) <= len(whole.groups) <= len(found.groups)
    assert most < 15 or len(found.groups) == len(whole.groups)
    assert sorted(i for group in found.groups for i in group.setpoints) == list(range(len(world.task)))
    areas = found.parking_areas.areas_at(0)
    for group in found.groups:
        for i in group.setpoints:
            assert areas[i].buffer(1e-9).covers(group.places[0])


def field_of_holes(seed: int) -> World:
    """Two hundred holes all over 4 x 3 m, in any order."""
    rng = np.random.default_rng([seed, 6])
    spots = np.column_stack([rng.uniform([0, 0], [4, 3], (200, 2)), rng.uniform(0.2, 0.4, 200)])
    floor, rules = Floor(shapely.box(-1, -1, 5, 4)), replace(STOPS, order="any")
    return World(f"{seed}", robot_named("youbot"), floor, (), tuple(map(Target, spots)), rules)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
def test_two_hundred_holes_in_any_order_take_as_few_stops_as_is_proven(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One more at most: inner areas are a little smaller than those that the bound is of."""
    path = tmp_path / "holes.world.yaml"
    path.write_text(json.dumps(world_to_document(field_of_holes(seed))))
    assert run(["stops", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert sorted(i for stop in told["stops"] for i in stop["setpoints"]) == list(range(200))
    assert told["unconfirmed"] == []
    assert 0 <= told["stats"]["count"] - told["stats"]["lower_bound"] <= (seed == 3)


def test_what_a_place_serves_does_not_depend_on_what_was_asked_before() -> None:
    """The zero of the arm's plane was taken from a set-point out of its reach where that came first."""
    world = scattered(0, 0.8)
    sequence = in_sequence(scene_of(world), park(scene_of(world)))
    for group in sequence.groups:
        side, fresh = next(iter(group.places)), PlacementSearch(sequence.scene, sequence.parking_areas)
        placement = None if group.spot is None else fresh.at(group, group.spot, side)
        assert placement is not None
        assert placement.setpoints == group.setpoints


@cache
def planned_by(criterion: str) -> Plan:
    return plan(ruled(narrow(wave(0, count=8), 1.0), order="any", stop_criterion=criterion))


@pytest.mark.parametrize("criterion", ["clearance", "distance"])
def test_plans_have_as_many_stops_whatever_the_criterion(criterion: str) -> None:
    found, other = (planned_by(one) for one in ("tolerance", criterion))
    assert [stop.setpoints for stop in found.stops] == [stop.setpoints for stop in other.stops]
    assert set(found.stats["tour"]) == {"drive", "tool", "arm"}


def test_stops_on_both_sides_of_a_wall_are_done_side_by_side() -> None:
    """A straight line through the wall is shorter than the way along it, which the base has to take."""
    wall = Box("wall", np.array([4.0, 0.02, 0.5]), np.array([0.0, 0.0, 0.25]))
    spots = [[x, y, 0.3] for x in (-1.8, -0.6, 0.6, 1.8) for y in (-0.3, 0.3)]
    floor, task = Floor(shapely.box(-3, -1.2, 2, 1.2)), tuple(Target(np.array(spot)) for spot in spots)
    start = Start(np.array([-2.5, -0.8, 0.0]), robot_named("youbot").carry)
    rules = replace(STOPS, order="any", stop_tolerance=0.1)
    world = World("wall", robot_named("youbot"), floor, (wall,), task, rules, start)
    sides = [int(np.sign(stop.base[1])) for stop in stops(world)]
    assert set(sides) == {-1, 1}
    assert np.count_nonzero(np.diff(sides)) == 1


@pytest.mark.parametrize(
    ("seed", "half"),
    [(0, 3.0), (1, 0.4), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((0, 0.4), (1, 3.0)))],
)
def test_any_order_never_needs_more_stops(seed: int, half: float) -> None:
    given, free = (ruled(narrow(wave(seed, 10), half), order=order) for order in ("given", "any"))
    assert len(stops(free)) <= len(stops(given))


def test_the_middle_of_the_largest_circle_has_the_largest_tolerance() -> None:
    world = wave(3, count=7)
    best = [stop.tolerance for stop in stops(world)]
    for criterion in ("clearance", "manipulability", "effort", "distance"):
        other = [stop.tolerance for stop in stops(ruled(world, stop_criterion=criterion))]
        assert all(a <= b + 2e-3 for a, b in zip(other, best, strict=True))


def test_the_shortest_way_is_no_longer_than_that_of_the_middles() -> None:
    for seed in range(2):
        ways = []
        for criterion in ("distance", "tolerance"):
            world = ruled(wave(seed), stop_criterion=criterion)
            spots = np.array([[-1.0, -1.5], *(stop.base[:2] for stop in stops(world))])
            ways.append(np.hypot(*np.diff(spots, axis=0).T).sum())
        assert ways[0] <= ways[1] + 1e-6


def test_no_room_to_park_is_explained() -> None:
    with pytest.raises(NoPlanFound, match="but the base has no circle of radius"):
        stops(ruled(wave(0), stop_tolerance=0.9))


def test_a_heading_that_turns_is_refused() -> None:
    with pytest.raises(InputError, match="expected free or fixed"):
        stops(load_world("free"))
    with pytest.raises(InputError, match=r"order: any needs rules\.mode: stops"):
        plan(ruled(load_world("pillar"), order="any"))


@lru_cache(maxsize=4)
def planned(name: str, order: str = "given") -> Plan:
    return plan(ruled(load_world(name), mode="stops", order=order))


@pytest.mark.parametrize(("name", "order"), [
    ("pillar", "given"),
    ("pillar", "any"),
    ("shelf", "given"),
    pytest.param("shelf", "any", marks=pytest.mark.slow),
])  # fmt: skip
def test_the_base_stands_still_at_every_stop(name: str, order: str) -> None:
    found = planned(name, order)
    assert verify(found).ok
    at = np.flatnonzero(found.motion.kind == "setpoint")
    for stop in found.stops:
        span = slice(at[stop.first], at[stop.last] + 1)
        assert np.ptp(found.motion.base[span], axis=0).max() < 1e-12
        if order == "given":
            assert not (found.motion.kind[span] == "transit").any()
    assert found.stats["stops"]["count"] == len(found.stops) >= found.stats["stops"]["lower_bound"]


def test_a_stop_that_the_arm_cannot_do_in_one_go_is_split_and_told() -> None:
    found = planned("shelf")
    begins = [stop.first for stop in found.stops]
    assert found.stats["stops"]["split_before"]
    assert set(found.stats["stops"]["split_before"]) <= set(begins)


def test_set_points_in_any_order_are_those_of_the_world() -> None:
    found, asked = planned("pillar", "any"), load_world("pillar")
    order = found.stats["order"]
    assert sorted(order) == list(range(len(asked.task)))
    for target, i in zip(found.world.task, order, strict=True):
        assert np.array_equal(target.position, asked.task[i].position)


def test_stops_are_written_and_read_back(tmp_path: Path) -> None:
    found = planned("pillar")
    found.save(tmp_path / "plan.json")
    again = load_plan(tmp_path / "plan.json")
    assert [stop.setpoints for stop in again.stops] == [stop.setpoints for stop in found.stops]
    for one, other in zip(again.stops, found.stops, strict=True):
        assert np.array_equal(one.base, other.base)
        assert (one.tolerance, one.criterion) == (other.tolerance, other.criterion)
    assert verify(again).ok
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "plan.json").read_bytes()


def test_verify_finds_every_broken_promise() -> None:
    found = planned("pillar")
    first, *rest = found.stops
    broken = {
        "promises": (replace(first, tolerance=0.2), *rest),
        "off stop 1": (replace(first, base=first.base + [0.0, 1e-4, 0.0]), *rest),
        "every set-point once": tuple(rest),
    }
    for words, told in broken.items():
        report = verify(replace(found, stops=told))
        assert not report.ok
        assert any(words in violation.text for violation in report.violations), words
    assert not verify(replace(found, stops=())).ok
    found = planned("shelf")  # where the base has more room than the arm has reach
    first, *rest = found.stops
    report = verify(replace(found, stops=(replace(first, tolerance=first.tolerance + 0.3), *rest)))
    assert any("no posture was found that reaches" in violation.text for violation in report.violations)


def test_circles_end_where_postures_are_found_all_round() -> None:
    found = planned("shelf")
    first, *rest = found.stops
    stats = {key: value for key, value in found.stats.items() if key != "margins"}
    broken = replace(found, stops=(replace(first, tolerance=first.tolerance + 0.3), *rest), stats=stats)
    assert not verify(broken).ok
    mended = within_reachable_circles(broken)
    assert verify(mended).ok
    assert TAU <= mended.stops[0].tolerance < broken.stops[0].tolerance
    again = within_reachable_circles(mended)  # what holds is told as it is
    assert [one.tolerance for one in again.stops] == [one.tolerance for one in mended.stops]


@pytest.mark.slow
def test_tools_that_point_are_verified_all_over_the_circles() -> None:
    asked = load_world("wall")
    found = plan(ruled(replace(asked, task=asked.task[:6]), mode="stops"))
    assert verify(found).ok
    away = tuple(replace(target, direction=-target.direction) for target in found.world.task)  # type: ignore[operator]
    report = verify(replace(found, world=replace(found.world, task=away)))
    assert any("no posture was found that reaches" in violation.text for violation in report.violations)


def test_circles_that_end_where_the_cone_does_are_verified() -> None:
    """At their rims no posture turns the tool any further than to the edge of its cone; found by the soak."""
    asked = soaked_world("made", 47)
    world = replace(asked, task=asked.task[2:7], obstacles=(), start=None)
    found = plan(ruled(world, mode="stops", heading="free"))
    assert verify(found).ok
    away = tuple(replace(target, cone=target.cone - 0.05) for target in found.world.task)
    assert not verify(replace(found, world=replace(found.world, task=away))).ok


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 12, 87, 98, 112])
def test_worlds_done_from_stops_that_the_soak_found_are_planned(seed: int) -> None:
    """They were refused: at rims by a search that kept tools from rolling, at a start too tight to turn."""
    world = soaked_world("stops", seed)
    outside = [one for one in world.obstacles if all(one.distance(t.position) >= 0 for t in world.task)]
    plan(replace(world, obstacles=tuple(outside)))  # set-points in solids are out of reach of a thick tool


def test_a_circle_that_outer_areas_would_hold_is_not_ruled_out() -> None:
    with pytest.raises(NoPlanFound) as refused:
        plan(ruled(soaked_world("stops", 256), tool_contact=0.2, contact_depth=0.05, stop_tolerance=0.1))
    open_ = [one.reason for one in refused.value.explanation.failures if one.verdict == "undecided"]
    assert open_
    assert all(
        "No way was found to reach" in one and "outer areas leave room for one" in one for one in open_
    )


def test_tools_that_are_turned_are_verified_all_over_the_circles() -> None:
    """An arm of five joints turns its tool as asked only as its base stands, or within a wide cone."""
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    task = tuple(Target(np.array([1.0 + 0.05 * k, 0.0, 0.3]), cone=0.3, orientation=turn) for k in range(2))
    found = plan(replace(wave(0), obstacles=(), task=task, start=None))
    assert verify(found).ok
    narrow = tuple(replace(target, cone=1e-3) for target in task)
    report = verify(replace(found, world=replace(found.world, task=narrow)))
    assert any("no posture was found that reaches" in violation.text for violation in report.violations)


def test_an_arm_that_touches_something_at_the_start_is_named() -> None:
    world = replace(wave(0), obstacles=())
    assert world.start is not None
    tip = world.robot.tool(world.start.base[None], world.start.joints[None])[0, :3, 3]
    with pytest.raises(NoPlanFound, match=r"start is blocked: link 5 .* overlaps ball"):
        plan(replace(world, obstacles=(Sphere("ball", 0.05, tip),)))


@pytest.mark.slow
def test_an_arm_that_is_clear_in_no_posture_is_told() -> None:
    world = replace(wave(0), start=None)
    spot = world.task[5]
    balls = tuple(Sphere(name, 0.2, spot.position) for name in ("ball", "other ball"))  # one may be touched
    with pytest.raises(NoPlanFound, match=r"cannot be touched: the last link.*would sink .* into ball"):
        plan(replace(world, task=(spot,), obstacles=balls))
    rules = replace(world.rules, contact_depth=0.3)
    with pytest.raises(NoPlanFound, match="deep in other ball: no posture keeps the last link"):
        plan(replace(world, task=(spot,), obstacles=balls, rules=rules))


def test_what_cannot_be_done_standing_is_refused() -> None:
    with pytest.raises(InputError, match="expected at least one set-point"):
        stops(replace(wave(0), task=()))
    with pytest.raises(InputError, match="face_target turns the base at every set-point"):
        stops(ruled(wave(0), heading="face_target"))


def test_the_command_tells_writes_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, picture = tmp_path / "stops.geojson", tmp_path / "stops.svg"
    asked = ["stops", "pillar", "--criterion", "distance", "-o", str(table), "--picture", str(picture)]
    assert run([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [len(stop["setpoints"]) for stop in told["stops"]] == [10, 5]
    features = json.loads(table.read_text())["features"]
    assert [feature["properties"]["criterion"] for feature in features] == ["distance", "distance"]
    assert "circles to park in" in picture.read_text()
    assert run(["stops", "pillar"]) == 0
    assert "11 to 15" in capsys.readouterr().out
    assert run(["stops", "pillar", "--criterion", "luck"]) == 2
    assert "manipulability" in capsys.readouterr().err


def test_pictures_of_a_plan_show_its_circles() -> None:
    found = planned("pillar")
    assert len(floor_view(found).circles.geoms) == 2
    assert any(body.path == "areas/parking" for body in picture_of_plan(found).bodies)


def test_more_stops_than_the_rules_let_the_tool_be_lifted() -> None:
    with pytest.raises(NoPlanFound, match="needs one stop more"):
        plan(ruled(load_world("pillar"), mode="stops", max_lift_offs=0))


def test_a_circle_to_park_in_is_no_wider_than_others_find_it() -> None:
    """On its rim the tool may miss half of its tolerance: a posture at the edge of it one solver finds."""
    assert verify(plan(witness("tilted", 120028).world)).ok


def test_set_points_that_a_stop_serves_beyond_its_areas_show_their_own() -> None:
    """The arm goes on to a fifth set-point, of whose area the places of the stop are no part."""
    found = plan(witness("offsets", 170776).world)
    assert len(found.stops) == 1
    assert all(area.admissible.buffer(1e-9).covers(area.pruned) for area in found.areas)


@pytest.mark.slow
def test_a_circle_to_park_in_ends_where_the_limits_of_the_arm_do() -> None:
    """Areas of seven joints do not know what the base, kept at one heading, leaves to the pivot."""
    found = plan(witness("urdf arms", 19).world)
    assert verify(found).ok
    by_areas = stops(found.world)[0].tolerance
    assert found.world.rules.stop_tolerance <= found.stops[0].tolerance < 0.9 * by_areas


HOLES = """version: 1
robot: youbot
floor: {polygon: [[-1, 0.1], [2.2, 0.1], [2.2, 2], [-1, 2]]}
obstacles:
  - {name: wall, box: {size: [4, 0.1, 1], center: [0.5, -0.05, 0.5]}}
task:
  - csv: holes.csv
    columns: {x: "X (mm)", y: "Y (mm)", z: "Z (mm)"}
    delimiter: semicolon
    scale: 0.001
    direction: [0, -1, 0]
    cone: 0.09
rules: {clearance: 0.05, mode: stops, order: any, stop_tolerance: 0.03}
"""
LISTED = """id;X (mm);Y (mm);Z (mm)
H0;12.95;80.00;200.00
H1;6.03;80.00;300.00
H2;451.44;80.00;200.00
H3;460.30;80.00;300.00
H4;1201.50;80.00;200.00
H5;1217.35;80.00;300.00
"""


def test_holes_that_a_list_has_twice_are_done_from_the_stop_of_the_first(tmp_path: Path) -> None:
    path, table = tmp_path / "holes.world.yaml", tmp_path / "holes.csv"
    path.write_text(HOLES)
    table.write_text(LISTED)
    once = stops(load_world(path))
    rows = LISTED.splitlines()
    table.write_text(LISTED + f"H6;{rows[2][3:]}\nH7;{rows[5][3:]}\n")
    world = load_world(path)
    found = stops(world)
    assert sorted(i for stop in found for i in stop.setpoints) == list(range(8))
    assert all(stop.unconfirmed == () for stop in found)
    assert len(found) == len(once)
    assert all((1 in stop.setpoints) == (6 in stop.setpoints) for stop in found)
    assert all((4 in stop.setpoints) == (7 in stop.setpoints) for stop in found)
    made = plan(world)
    assert verify(made).ok
    assert len(made.stops) == len(found)
