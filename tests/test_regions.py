from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from regionik.areas.layers import BodyLayer, grow
from regionik.postures.families import BACK, FRONT
from regionik.reach_table import reach_table
from regionik.regions import admissible_area, outer_areas, path_areas
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.shadows import Shadow
from tests import examples
from tests.kinds import Solid

FLOOR = Floor(shapely.box(-3, -3, 3, 3))


def world(*solids: Solid, **rules: object) -> World:
    return World("test", robot_named("youbot"), FLOOR, solids, (), Rules(**rules))  # type: ignore[arg-type]


def box(x: float, y: float, size: float = 0.4, name: str = "box") -> Box:
    return Box(name, np.array([size, size, 0.1]), np.array([x, y, 0.05]))


@pytest.mark.parametrize("z", [0.05, 0.2, 0.25, 0.3, 0.6])
def test_inner_points_work_and_points_outside_outer_do_not(z: float) -> None:
    scene = world(box(0.5, 0.1), Cylinder("post", 0.1, 0.5, np.array([-0.2, 0.4, 0.25])))
    area = admissible_area(scene, [0, 0, z])
    _, _, rings = reach_table(scene_of(scene), [Target(np.array([0, 0, z]))], (FRONT, BACK), inner=False)
    rng = np.random.default_rng(0)
    shadows = scene_of(scene).ground.shadows
    for spot in rng.uniform(-0.8, 0.8, (2000, 2)):
        point = shapely.Point(spot)
        gap = min(shadow.distance(point) for shadow in shadows)
        if area.inner.contains(point):
            assert gap >= 0.2
            assert any(ring.contains(point) for ring in rings)
        if not area.outer.contains(point):
            outside_reach = not any(ring.contains(point) for ring in rings)
            assert gap <= 0.2 or outside_reach
    assert area.outer.covers(area.inner.buffer(-1e-9))
    assert area.gap < 0.08


@settings(max_examples=examples(25))
@given(
    spots=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), max_size=6),
    less=st.floats(0.0, 0.3),
    more=st.floats(0.0, 0.3),
)
def test_more_clearance_never_adds_area(spots: list[tuple[float, float]], less: float, more: float) -> None:
    solids = [box(x, y, name=f"box {k}") for k, (x, y) in enumerate(spots)]
    wide = admissible_area(world(*solids, clearance=less), [0, 0, 0.25])
    tight = admissible_area(world(*solids, clearance=less + more), [0, 0, 0.25])
    assert tight.inner.difference(wide.inner).area < 1e-4
    assert tight.inner.area <= wide.inner.area + 1e-9


def test_order_of_obstacles_does_not_matter() -> None:
    solids = [box(0.5, 0.1, name="a"), box(-0.3, 0.4, name="b"), box(0.1, -0.5, name="c")]
    one = admissible_area(world(*solids), [0, 0, 0.25]).inner
    two = admissible_area(world(*solids[::-1]), [0, 0, 0.25]).inner
    assert one.symmetric_difference(two).area < 1e-12


def test_all_at_once_equals_one_by_one() -> None:
    scene = load_world("l_shape")
    areas = path_areas(scene_of(scene))
    for i, target in enumerate(scene.task):
        whole = shapely.union_all(areas.inner[areas.target == i])
        assert whole.symmetric_difference(admissible_area(scene, target).inner).area < 1e-12


def test_thin_rings_leave_valid_areas() -> None:
    heights = np.linspace(-0.4, 0.7, 2000)
    targets = [Target(np.array([0, 0, z])) for z in heights]
    areas = path_areas(scene_of(world()), targets)
    assert shapely.is_valid(areas.inner).all()


def test_causes_are_named() -> None:
    area = admissible_area(world(box(0.5, 0.1, name="crate")), [0, 0, 0.25])
    assert {"crate", "joint limits"} <= {cause.name for cause in area.causes}
    crate = next(cause for cause in area.causes if cause.name == "crate")
    assert crate.polygon.intersection(area.inner).area < 1e-12


def test_clearance_is_the_largest_that_leaves_an_area() -> None:
    scene = world(box(0.0, 0.0, 1.2, name="plate"), clearance=0.2)
    area = admissible_area(scene, [0.3, 0, 0.25])
    best = area.clearance
    assert best is not None
    assert area.inner.is_empty == (best < 0.2)
    for clearance, empty in ((best - 1e-4, False), (best + 1e-3, True)):
        again = admissible_area(world(box(0.0, 0.0, 1.2), clearance=clearance), [0.3, 0, 0.25])
        assert again.inner.is_empty == empty


def test_high_obstacles_concern_the_arm_alone() -> None:
    shelf = Box("shelf", np.array([2.0, 2.0, 0.1]), np.array([0, 0, 1.0]))
    assert not admissible_area(world(shelf), [0, 0, 0.25]).inner.is_empty


def test_fixed_heading_cuts_the_ring_behind_the_base() -> None:
    robot = robot_named("youbot")
    start = Start(np.zeros(3), robot.carry)
    free = World("w", robot, FLOOR, (), (), Rules(), start)
    fixed = World("w", robot, FLOOR, (), (), Rules(heading="fixed"), start)
    whole = admissible_area(free, [0, 0, 0.25]).inner.area
    front = path_areas(scene_of(fixed), [Target(np.array([0, 0, 0.25]))], (FRONT,)).inner
    ring = path_areas(scene_of(free), [Target(np.array([0, 0, 0.25]))], (FRONT,)).inner
    assert shapely.area(front).sum() == pytest.approx(shapely.area(ring).sum() * 338 / 360, rel=2e-3)
    # +-169 deg of pivot leave 22 deg behind the base; the target lies there for places ahead of it
    assert not front[0].intersects(shapely.Point(0.4, 0.0))
    assert whole > 0


def test_tool_direction_gives_ring_sectors() -> None:
    scene = world()
    target = Target(np.array([0, 0, 0.25]), np.array([0, -1, 0]), np.deg2rad(15))
    areas = path_areas(scene_of(scene), [target], (FRONT,))
    x0, y0, x1, y1 = shapely.total_bounds(areas.inner)
    # At the direction itself from 0.236 to 0.517 m ahead; a pitch that leans within the cone reaches farther.
    assert (x0, y0, x1, y1) == pytest.approx((-0.134, 0.213, 0.134, 0.525), abs=2e-3)
    outer = outer_areas(scene_of(scene), [target])[0]
    assert outer.covers(shapely.union_all(areas.inner).buffer(-1e-9))


@settings(max_examples=examples(60))
@given(
    mount=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3)),
    half=st.tuples(st.sampled_from([0.0, 0.05, 0.2]), st.sampled_from([0.0, 0.1])),
    pose=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3.2, 3.2)),
)
@example(mount=(0.25, 0.0), half=(0.0, 0.0), pose=(0.0, 0.0, 0.0))  # free but for the arm's foot
@example(mount=(0.25, 0.0), half=(0.0, 0.0), pose=(0.0, -0.2, 0.0))
def test_outer_floor_holds_the_axis_of_every_base_that_stands_free(
    mount: tuple[float, float], half: tuple[float, float], pose: tuple[float, float, float]
) -> None:
    """The axis may be beside the footprint, over the floor's edge or over an obstacle."""
    known = robot_named("youbot")
    corners = (
        np.array(half) * np.array([(1, -1), (1, 1), (-1, 1), (-1, -1)]) if min(half) > 0 else np.zeros((1, 2))
    )
    robot = replace(known, footprint=corners, mount=np.array([*mount, *known.mount[2:]]))
    scene = World(
        "test", robot, Floor(shapely.box(-1, -1, 1, 1)), (box(0.3, 0.2),), (), Rules(clearance=0.02)
    )
    x, y, yaw = pose
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    axis = turn @ np.array(mount) + (x, y)
    ground = scene_of(scene).ground

    def stood(layer: BodyLayer) -> BaseGeometry:
        return shapely.MultiPoint(np.array(layer.outline.corners) @ turn.T + axis).convex_hull

    clear = [s.distance(stood(layer)) > layer.clearance for layer in ground.within for s in layer.shadows]
    if ground.floor.contains(stood(ground.base)) and all(clear):
        assert ground.outer.free.distance(shapely.Point(axis)) < 1e-8


def test_out_of_reach_is_an_empty_outer_area() -> None:
    area = admissible_area(world(), [0, 0, 0.9])
    assert area.outer.is_empty
    assert area.inner.is_empty
    assert area.components == []
    assert area.clearance is None


@pytest.mark.parametrize("target", [[0, 0], [0, 0, np.nan], "here"])
def test_bad_targets_are_refused(target: object) -> None:
    with pytest.raises(InputError, match="target"):
        admissible_area(world(), target)  # type: ignore[arg-type]


@pytest.mark.parametrize("corners", range(3, 60))
def test_inner_growth_holds_the_true_one_for_every_corner(corners: int) -> None:
    """The number of segments in which a corner is rounded is itself rounded: worst at 8 to 11 degrees."""
    around = 2 * np.pi * np.arange(corners) / corners
    core = shapely.Polygon(0.3 * np.column_stack([np.cos(around), np.sin(around)]))
    edge = grow(Shadow(core, 0.0), 0.4, inner=True).exterior
    assert shapely.distance(edge, core) >= 0.4 - 1e-9
    within = shapely.get_coordinates(grow(Shadow(core, 0.0), 0.4, inner=False))
    assert shapely.distance(shapely.points(within), core).max() <= 0.4 + 1e-9
