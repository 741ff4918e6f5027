"""No inner area and no field holds a place where base and body cannot stand, by the second opinion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.scene import scene_of
from regionik.view.floor_view import shown_floor
from regionik.view.live import live_areas, live_picture
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.limits import Criteria
from regionik.worlds.links import BASE, LinkBox
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.doors import Doors
from tests.furnished import furnished_world, rising
from tests.kinds import Mode
from tests.maths import translation
from tests.opinion.body import Body
from tests.retold import machine_of
from tests.test_colors import drawn

DAILY = range(4)
ALL = 16  # `make soak` goes through more of them


def under_a_table() -> World:
    """A column of 0.29 to 0.84 m on a low base, under a table whose top is at 0.71 m."""
    column = LinkBox(BASE, "column", translation(0.0, 0.0, 0.565), np.array([0.23, 0.23, 0.55]))
    robot = robot_named("youbot-real")
    robot = replace(robot, body_height=0.29, mount=np.array([0.0, 0.0, 0.86, 0.0]), base_solids=(column,))
    top = Box("table top", np.array([1.6, 0.8, 0.04]), np.array([1.5, 0.0, 0.69]))
    task = tuple(Target(np.array([1.5, y, 0.95])) for y in (0.2, -0.2))
    return World("lab", robot, Floor(shapely.box(-1, -2, 4, 2)), (top,), task, Rules(clearance=0.02))


def test_no_place_is_under_the_table() -> None:
    world = under_a_table()
    body, top = Body(world_to_document(world), machine_of(world)), shapely.box(0.7, -0.4, 2.3, 0.4)
    assert not body.stands_over(np.array([1.5, 0.0]))
    assert body.stands_over(np.array([1.5, 0.9]))
    for target in world.task:
        assert rik.admissible_area(world, target).inner.intersection(top).area == 0.0
    field = rik.reach_field(world, world.task, cell=0.1)
    x, y = np.meshgrid(field.x, field.y)
    assert field.values[(np.abs(x - 1.5) < 0.8) & (np.abs(y) < 0.4)].max() == 0


def under_a_ceiling() -> World:
    """A torso may rise by 0.3 m for a target that is low, and a ceiling leaves it 0.2 m."""
    robot = rising(replace(under_a_table().robot, base_solids=()), 0.1)
    top = Box("ceiling", np.array([6.0, 5.0, 0.1]), np.array([1.5, 0.0, 1.12]))
    task = (Target(np.array([1.5, 0.0, 0.7])),)
    return World("low room", robot, Floor(shapely.box(-1, -2, 4, 2)), (top,), task, Rules(clearance=0.02))


@pytest.mark.parametrize("mode", ["stops", pytest.param("continuous", marks=pytest.mark.slow)])
def test_a_lift_that_would_touch_a_ceiling_at_its_highest_stays_low(mode: Mode) -> None:
    world = under_a_ceiling()
    world = replace(world, rules=replace(world.rules, mode=mode))
    assert rik.reach(world, world.task).reachable.all()
    assert not any(stop.unconfirmed for stop in rik.stops(world))
    found = rik.plan(world)
    assert rik.verify(found).ok
    assert found.motion.joints[:, 0].max() < 0.22


def test_where_no_height_of_a_lift_is_clear_no_area_is() -> None:
    """A slab over a part of the room stands where the torso is at its lowest."""
    world, part = under_a_ceiling(), shapely.box(-1, -2, 1.3, 2)
    slab = Box("slab", np.array([2.3, 4.0, 0.1]), np.array([0.15, 0.0, 0.75]))
    open_, narrow = (
        rik.admissible_area(replace(world, obstacles=solids), world.task[0]).inner
        for solids in (world.obstacles, (*world.obstacles, slab))
    )
    assert shapely.area(open_ & part) > 0.05
    assert narrow.area > 0.05
    assert shapely.area(narrow & part) == 0.0


@pytest.mark.parametrize("mode", ["stops", "continuous"])
def test_a_base_drives_round_what_its_torso_meets_at_each_height(mode: Mode) -> None:
    world = under_a_ceiling()
    start = Start(np.array([-0.5, 0.0, 0.0]), world.robot.carry)
    world = replace(world, start=start, rules=replace(world.rules, mode=mode))
    place = np.array([0.2, 0.0, 0.75])
    slab, across = (Box("slab", np.array([0.4, wide, 0.1]), place) for wide in (3.0, 4.0))
    found = rik.plan(replace(world, obstacles=(*world.obstacles, slab)))
    assert rik.verify(found).ok
    with pytest.raises(rik.NoPlanFound, match="slab cuts it off"):
        rik.plan(replace(world, obstacles=(*world.obstacles, across)))


def test_parts_of_a_lift_keep_the_margin_of_its_limits() -> None:
    world = under_a_ceiling()
    scene = scene_of(replace(world, rules=replace(world.rules, criteria=Criteria(joint_margin=0.2))))
    parts = scene.lifted.parts(0.7)
    limited = [scene.model_with_lift(world.task[0], part).chain.joints[0] for part in parts]
    assert np.allclose([(joint.lower, joint.upper) for joint in limited], parts)
    assert (limited[0].lower, limited[-1].upper) == pytest.approx((0.06, 0.24))


def test_a_base_that_stands_where_one_of_its_sides_is_along_a_wall_alone_is_seen_to() -> None:
    """The second opinion goes round by whole degrees; at 78.75 degrees alone the base has 0.2 mm to spare."""
    world = furnished_world(1028)
    body = Body(world_to_document(world), machine_of(world))
    assert body.stands_over(np.array([2.053681, 1.150501]))
    assert not body.stands_over(np.array([2.053681, 1.1495]))


def board(name: str, x: float, y: float, z: float, wide: float, deep: float) -> Box:
    return Box(name, np.array([wide, deep, 0.04]), np.array([x, y, z]))


COLUMN = LinkBox(BASE, "column", translation(0.0, 0.0, 0.55), np.array([0.2, 0.2, 0.7]))
BARE = replace(under_a_table().robot, base_solids=())
SHOWN = {
    "a torso on a lift alone": rising(BARE, 0.1),
    "a column on a base that is a point": replace(BARE, footprint=np.zeros((1, 2)), base_solids=(COLUMN,)),
}


@pytest.mark.parametrize("name", SHOWN)
def test_pictures_show_no_floor_as_free_where_the_body_cannot_stand(name: str) -> None:
    world = replace(under_a_table(), robot=SHOWN[name])
    body, floor = Body(world_to_document(world), machine_of(world)), shown_floor(world)
    assert floor.rejected.covers(shapely.box(0.8, -0.3, 2.2, 0.3))
    edge = shapely.box(0.7, -0.4, 2.3, 0.4).exterior
    beside = [edge.interpolate(at) for at in np.linspace(0, edge.length, 13)]
    beside = [near for spot in beside if not (near := floor.free & spot.buffer(0.2)).is_empty]
    assert len(beside) > 8
    for near in beside:
        spot = shapely.ops.nearest_points(near, shapely.Point(1.5, 0.0))[0]
        for yaw in np.linspace(0, np.pi, 5):
            assert not body.objections(np.array([spot.x, spot.y, yaw])), (spot, yaw)
    live = live_picture(live_areas(world))
    rejected = shapely.union_all([drawn(live, f"floor/rejected/{k}") for k in range(len(world.obstacles))])
    assert rejected.buffer(0.01).covers(shapely.box(0.8, -0.3, 2.2, 0.3))


def laboratory() -> World:
    """Objects on a bench, on a table too wide to be worked all over, and in a shelf; a base on two wheels."""
    robot = replace(under_a_table().robot, base="differential")
    legs = [(x, y, 0.355) for x in (0.76, 2.24) for y in (1.66, 2.34)]
    solids = (
        board("bench top", 1.5, 2.0, 0.73, 1.6, 0.8),
        board("big table top", 4.5, 2.2, 0.73, 1.8, 1.8),
        *(Box(f"leg {k}", np.array([0.05, 0.05, 0.71]), np.array(at)) for k, at in enumerate(legs)),
        *(board(f"board {z}", 3.0, -1.6, z, 2.0, 0.35) for z in (0.285, 0.735, 1.185)),
    )
    spots = [(1.2, 1.75, 0.85), (1.9, 2.25, 0.85), (3.8, 2.2, 0.85), (4.5, 2.2, 0.85), (2.8, -1.55, 0.85)]
    rules = Rules(clearance=0.05, mode="stops", order="any", stop_tolerance=0.03, skip_unreachable=True)
    task = tuple(Target(np.array(spot)) for spot in spots)
    return World("laboratory", robot, Floor(shapely.box(0, -2, 6, 4)), solids, task, rules)


@pytest.mark.slow
def test_nothing_is_picked_from_under_a_table() -> None:
    """Stops, single answers, the field and the plan; what lies in the middle of the wide table is left."""
    world = laboratory()
    under = shapely.box(0.7, 1.6, 2.3, 2.4) | shapely.box(3.6, 1.3, 5.4, 3.1)
    body = Body(world_to_document(world), machine_of(world))
    found, answer = rik.stops(world), rik.reach(world, world.task)
    assert sorted(i for stop in found for i in stop.setpoints) == [0, 1, 2, 4]
    assert answer.reachable.tolist() == [True, True, True, False, True]
    made = rik.plan(world)
    assert rik.verify(made).ok
    places = [*(stop.base for stop in found), *answer.base[answer.reachable], *made.motion.base]
    assert not any(under.contains(shapely.Point(place[:2])) for place in places)
    assert all(body.stands_over(place[:2]) for place in places[:8])
    field = rik.reach_field(world, world.task, cell=0.1)
    x, y = np.meshgrid(field.x, field.y)
    assert field.values.max() > 0
    assert field.values[shapely.contains_xy(under, x, y)].max() == 0


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=() if seed in DAILY else pytest.mark.slow) for seed in range(ALL)],
)
def test_areas_and_fields_hold_no_place_where_the_body_cannot_stand(seed: int) -> None:
    doors = Doors(furnished_world(seed))
    doors.areas()
    doors.field()
    assert not doors.wrong


@pytest.mark.slow
@pytest.mark.parametrize("seed", [580, pytest.param(688, marks=pytest.mark.long), 502034, 504658])
def test_where_every_stop_is_confirmed_there_is_a_plan(seed: int) -> None:
    """The base alone would pass under a table; from between two tables the arm is hardly led out.

    Then a torso that a column is in the way of at each of its heights, and an arm that no berth keeps clear.
    """
    doors = Doors(furnished_world(seed))
    doors.stops()
    assert doors.seen["plans"]
    assert not doors.wrong
