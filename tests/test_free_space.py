"""Where the base may stand by heading: laws of slabs, of the pieces they join, and of areas made of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity

from regionik import admissible_area as area
from regionik.areas.free_space import FreeSpace, away, into_span, stands_about
from regionik.areas.layers import ROUNDING_MARGIN
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.kinds import Heading, Solid
from tests.measures import pose_of

POST = Cylinder("post", 0.1, 0.6, np.array([0.9, 1.1, 0.3]))
CRATE = Box("crate", np.array([0.5, 0.3, 0.5]), np.array([2.2, 0.7, 0.25]), 0.4)


def world_of(*solids: Solid, heading: Heading = "free", robot: str = "youbot-real") -> World:
    shape = shapely.box(0, 0, 3, 2) | shapely.box(2.9, 0.8, 5, 1.25) | shapely.box(4.9, 0, 6.5, 2)
    start = Start(np.array([0.5, 0.5, 0.3]), robot_named(robot).carry)
    rules = Rules(clearance=0.03, heading=heading)
    return World("slabs", robot_named(robot), Floor(shape), solids, (), rules, start)


def room_left(world: World, axis: np.ndarray, yaw: float) -> float:
    """By how much the footprint keeps inside the floor and its clearance; negative where it does not."""
    outline = shapely.convex_hull(shapely.multipoints(world.robot.footprint - world.robot.mount[:2]))
    body = affinity.translate(affinity.rotate(outline, yaw, origin=(0, 0), use_radians=True), *axis)
    floor, ground = world.floor.polygon, scene_of(world).ground
    inside = floor.boundary.distance(body) if floor.covers(body) else -floor.boundary.distance(body) - 1e-9
    gaps = [shadow.distance(body) - ground.clearance for shadow in ground.shadows]
    return float(min([inside, *gaps]))


def points_in(shape: shapely.Geometry, count: int, rng: np.random.Generator) -> np.ndarray:
    x0, y0, x1, y1 = shape.bounds
    spots = rng.uniform((x0, y0), (x1, y1), (count, 2))
    inside: np.ndarray = spots[shapely.contains_xy(shape, spots)]
    return inside


@given(st.floats(-20, 20), st.floats(-10, 10), st.floats(0, 6))
def test_a_heading_brought_into_a_span(yaw: float, middle: float, width: float) -> None:
    span = (middle - width / 2, middle + width / 2)
    inside = into_span(yaw, span)
    assert abs(np.remainder(inside - middle + np.pi, 2 * np.pi) - np.pi) <= width / 2 + 1e-9
    assert away(yaw, span) == pytest.approx(abs(inside - yaw))
    assert abs(inside - yaw) <= np.pi - width / 2 + 1e-9  # the shorter way
    ends = [abs(np.remainder(end - yaw + np.pi, 2 * np.pi) - np.pi) for end in span]
    assert inside == yaw or abs(inside - yaw) == pytest.approx(min(ends), abs=1e-9)


def test_inner_slabs_hold_at_every_heading_and_outer_ones_at_no_other() -> None:
    world, rng = world_of(POST, CRATE), np.random.default_rng(0)
    for side in scene_of(world).free_floor.by_heading.sides:
        for axis in points_in(side.free, 40, rng):
            assert room_left(world, axis, rng.uniform(*side.span)) >= ROUNDING_MARGIN / 2
    for side in scene_of(world).free_floor.outer.sides:
        beyond = shapely.box(-0.5, -0.5, 7, 2.5) - side.floor
        for axis in points_in(beyond, 40, rng):
            assert room_left(world, axis, rng.uniform(*side.span)) < 1e-9


@pytest.mark.parametrize("pointed", [False, True])
def test_a_base_stands_about_a_pose_where_it_has_as_much_room(pointed: bool) -> None:
    world, rng, found = world_of(POST, CRATE), np.random.default_rng(0), set[bool]()
    if pointed:
        world = replace(world, robot=replace(world.robot, footprint=np.zeros((1, 2)), solids=()))
    for axis in points_in(world.floor.polygon, 150, rng):
        yaw, by = rng.uniform(-np.pi, np.pi), rng.choice([0.0, 0.01, 0.1])
        room = room_left(world, axis, yaw) - by
        stands = stands_about(scene_of(world).ground, world.robot, pose_of(world.robot, axis, yaw), by)
        assert stands == (room > 0) or abs(room) < ROUNDING_MARGIN + 0.01 * by
        found.add(stands)
    assert found == {True, False}


def test_slabs_go_round_the_full_turn_and_hold_all_that_holds_at_every_heading() -> None:
    world = world_of(POST, CRATE)
    spans = [side.span for side in scene_of(world).free_floor.by_heading.sides]
    assert sum(high - low for low, high in spans) == pytest.approx(2 * np.pi)
    for (_, high), (low, _) in zip(spans, spans[1:] + spans[:1], strict=True):
        assert np.remainder(low - high + np.pi, 2 * np.pi) - np.pi == pytest.approx(0, abs=1e-9)
    anywhere = scene_of(world).free_floor.anywhere.sides[0]
    everywhere = anywhere.free.buffer(-2e-3)  # arcs of the circle are chords
    assert all(side.free.covers(everywhere) for side in scene_of(world).free_floor.by_heading.sides)


def test_a_corridor_joins_rooms_by_heading_alone() -> None:
    world = world_of()
    left, right = np.array([1.0, 1.0]), np.array([5.7, 1.0])
    circle, slabs = scene_of(world).free_floor.anywhere, scene_of(world).free_floor.by_heading
    assert circle.piece_at(left, 0.0) != circle.piece_at(right, 0.0)
    assert slabs.piece_at(left, 2.0) == slabs.piece_at(right, -1.0)


def test_an_area_by_heading_is_larger_and_within_its_bound() -> None:
    world = world_of(POST, CRATE)
    for target in ([3.9, 1.0, 0.25], [1.4, 1.3, 0.3]):
        free, fixed = area(world, target), area(world_of(POST, CRATE, heading="fixed"), target)
        assert free.inner.difference(free.outer).area < 1e-9
        assert fixed.inner.difference(free.inner.buffer(2e-3)).area < 1e-4
        assert fixed.inner.area < free.inner.area
    assert area(world, [3.9, 1.0, 0.25]).inner.intersects(shapely.box(3.2, 0.8, 4.6, 1.25))


def test_where_slabs_bring_nothing_there_are_none() -> None:
    assert scene_of(world_of()).free_floor.turns_matter
    assert not scene_of(world_of(heading="fixed")).free_floor.turns_matter
    assert not scene_of(world_of(robot="youbot")).free_floor.turns_matter
    bounded = replace(world_of(), robot=robot_named("youbot"))
    assert scene_of(bounded).free_floor.by_heading is scene_of(bounded).free_floor.anywhere
    fixed = scene_of(world_of(heading="fixed")).free_floor.anywhere.sides
    assert [side.span for side in fixed] == [(0.3, 0.3)]


@pytest.mark.parametrize("floor", ["by_heading", "outer"])
def test_worlds_share_slabs_where_nothing_differs_that_they_depend_on(floor: str) -> None:
    def free_space(world: World) -> FreeSpace:
        found: FreeSpace = getattr(scene_of(world).free_floor, floor)
        return found

    world = world_of(POST)
    task = (Target(np.array([1.0, 1.0, 0.3])),)
    lifted = replace(world.robot, mount=world.robot.mount + [0.0, 0.0, 0.2, 0.0])
    aside = replace(world.robot, mount=world.robot.mount + [0.1, 0.0, 0.0, 0.0])
    assert free_space(replace(world, task=task)) is free_space(world)
    assert free_space(replace(world, robot=lifted)) is free_space(world)
    others = (
        world_of(CRATE),
        replace(world, robot=aside),
        replace(world, rules=replace(world.rules, clearance=0.05)),
        replace(world, floor=Floor(shapely.box(0, 0, 3, 2))),
    )
    areas = [[side.free.area for side in free_space(one).sides] for one in (world, *others)]
    assert all(one != areas[0] for one in areas[1:])
