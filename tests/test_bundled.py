"""Bundled robots and worlds: numbers as the M-FABRIK paper and its experiments give them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from shapely.geometry import MultiPoint, Point, Polygon, box
from shapely.geometry.base import BaseGeometry

from regionik.worlds.bundled import DATA, robot_named, robot_names, world_names, world_path
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.robot import without_limits
from regionik.worlds.scene import World
from tests.maths import Array

DEGREES = np.pi / 180


def wave(n: int, x0: float, dx: float, amplitude: float, period: float, middle: float) -> tuple[Array, Array]:
    k = np.arange(n, dtype=np.float64)
    across: Array = middle + amplitude * np.sin(2 * np.pi * k / period)
    return x0 + dx * k, across


def flat(n: int, x0: float, dx: float, amplitude: float, period: float, y: float, z: float) -> Array:
    x, across = wave(n, x0, dx, amplitude, period, y)
    return np.column_stack([x, across, np.full(n, z)])


def upright() -> Array:
    x, z = wave(20, 0.3, 0.15, 0.05, 10, 0.3)
    return np.column_stack([x, np.zeros(20), z])


# name: set-points, navigable rectangle, solids (floor outline, top), base x y, datasheet q2 q3 q4 [deg], step
EXPERIMENTS: dict[
    str,
    tuple[
        Callable[[], Array],
        BaseGeometry | None,
        dict[str, tuple[BaseGeometry, float]],
        tuple[float, float],
        tuple[float, float, float],
        float,
    ],
] = {
    "free": (lambda: flat(21, 0.3, 0.1, 0.1, 6, 0.0, 0.28), None, {}, (0, 0), (58, 84, 58), 0.1),
    "pillar": (
        lambda: flat(15, 0.4, 0.1, 0.3, 20, 0.0, 0.25),
        box(-0.5, -1.5, 3.0, 1.5),
        {"pillar": (box(1.0, -0.2, 1.6, 0.4), 0.1)},
        (0, 0),
        (0, 60, 60),
        0.25,
    ),
    "slab": (
        lambda: flat(15, 0.4, 0.1, 0.1, 20, 0.0, 0.25),
        box(-0.5, -1.5, 3.0, 1.5),
        {"slab": (box(1.175, -0.45, 1.425, 0.45), 0.1)},
        (0, 0),
        (0, 60, 60),
        0.15,
    ),
    "wall": (
        upright,
        box(-0.5, 0.0, 4.0, 1.6),
        {
            "wall": (box(-0.5, -0.1, 4.0, 0.0), 2.0),
            "cabinet": (box(-0.5, 1.2, 1.9, 1.6), 1.0),
            "counter": (box(1.9, 0.6, 4.0, 1.6), 1.0),
        },
        (0.3, 0.6),
        (0, 60, 30),
        0.15,
    ),
    "l_shape": (
        lambda: flat(40, 0.3, 0.08, 0.12, 20, 0.65, 0.25),
        box(-0.5, -1.0, 4.0, 2.0),
        {
            "l_shape": (box(1.0, 0.6, 1.9, 0.7).union(box(1.8, -0.3, 1.9, 0.7)), 0.1),
            "crate": (box(2.6, 0.7, 2.9, 1.0), 0.1),
        },
        (0, 0.2),
        (0, 60, 60),
        0.15,
    ),
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_experiments_are_the_paper_s(name: str) -> None:
    setpoints, navigable, solids, base, (q2, q3, q4), step = EXPERIMENTS[name]
    world = load_world(name)
    np.testing.assert_allclose([target.position for target in world.task], setpoints(), rtol=0, atol=1e-12)
    if navigable is not None:
        assert world.floor.polygon.equals(navigable)
    assert {solid.name for solid in world.obstacles} == set(solids)
    for solid in world.obstacles:
        outline, top = solids[solid.name]
        shadow = solid.shadow(world.robot.body_height)
        assert shadow is not None
        assert shadow.core.symmetric_difference(outline).area < 1e-12
        assert solid.z_range == pytest.approx((0.0, top))
    assert world.start is not None
    assert tuple(world.start.base[:2]) == base
    np.testing.assert_allclose(
        world.start.joints, np.array([0, 90 - q2, -q3, 90 - q4, 0]) * DEGREES, atol=1e-15
    )
    assert (world.rules.clearance, world.rules.tolerance, world.rules.step) == (0.2, 0.001, step)


def test_what_is_special_about_single_experiments() -> None:
    free, wall = load_world("free"), load_world("wall")
    assert free.rules.heading == "face_target"
    assert np.isinf(free.robot.chain.upper).all()
    assert free.robot.name == "youbot"
    assert wall.rules.tool_contact == 0.1
    assert wall.start is not None
    assert wall.start.base[2] == -np.pi / 2
    for target in wall.task:
        assert target.direction is not None
        assert target.direction.tolist() == [0, -1, 0]
        assert target.cone == 15 * DEGREES


def test_youbot_is_table_1_with_the_datasheet_s_limits() -> None:
    chain = robot_named("youbot").chain
    tool = chain.forward(np.array([0, 90, 0, 90, 0]) * DEGREES)
    np.testing.assert_allclose(tool[:3, 3], [0.033, 0, 0.147 + 0.155 + 0.135 + 0.2175], atol=1e-12)
    np.testing.assert_allclose(chain.lower / DEGREES, [-169, 0, -146, -12.5, -167.5])
    np.testing.assert_allclose(chain.upper / DEGREES, [169, 155, 151, 192.5, 167.5])
    # folded forward by 90 deg at the shoulder: the arm lies along x at the shoulder's height
    level = chain.forward(np.array([0, 0, 0, 90, 0]) * DEGREES)
    np.testing.assert_allclose(level[:3, 3], [0.033 + 0.155 + 0.135 + 0.2175, 0, 0.147], atol=1e-12)


def test_both_robots_carry_the_same_arm() -> None:
    paper, real = robot_named("youbot"), robot_named("youbot-real")
    assert paper.footprint.tolist() == [[0, 0]]
    assert MultiPoint(real.footprint).convex_hull.equals(box(-0.29, -0.19, 0.29, 0.19))
    assert real.mount.tolist() == [0.143, 0, 0, 0]
    for robot in (paper, real):
        assert robot.base == "omni"
        assert robot.body_height == 0.14
        assert robot.chain.names == tuple(f"joint_{k}" for k in range(1, 6))
        assert {solid.radius for solid in robot.solids} == {0.035}
        np.testing.assert_allclose(robot.carry, np.array([0, 90, 0, 90, 0]) * DEGREES)
        assert (robot.chain.lower <= robot.carry).all()
        assert (robot.carry <= robot.chain.upper).all()
        assert np.array_equal(without_limits(robot).chain.T_last_tool, robot.chain.T_last_tool)


def test_pioneer_parm_is_the_machine_of_the_paper() -> None:
    robot = robot_named("pioneer-parm")
    assert (robot.base, robot.gauge, robot.mount.tolist()) == ("differential", 0.32, [0.155, 0, 0.155, 0])
    assert robot.chain.upper[0] == -robot.chain.lower[0] == np.pi / 2
    level = robot.chain.forward(np.zeros(5))[:3, 3]
    np.testing.assert_allclose(level, [0.06875 + 0.16 + 0.13775 + 0.11321, 0, 0.12], atol=1e-12)
    assert (robot.chain.lower <= robot.carry).all()
    assert (robot.carry <= robot.chain.upper).all()


def test_circle_and_door_are_the_paper_s_simulations() -> None:
    circle, door = load_world("circle"), load_world("door")
    assert (len(circle.task), len(door.task)) == (360, 91)
    for t in (1, 100, 360):
        a, target = np.radians(t), circle.task[t - 1]
        wanted = [2.5 + 2 * np.cos(a), 2.5 + 2 * np.sin(a), (55 + t / 20) / 1000]
        np.testing.assert_allclose(target.position, wanted, atol=2e-12)
        assert target.orientation is not None
        assert target.orientation.tolist() == [[1, 0, 0], [0, -1, 0], [0, 0, -1]]
    for k, target in enumerate(door.task):
        a = np.radians(k)
        np.testing.assert_allclose(target.position, [0.23 * np.cos(a), -0.23 * np.sin(a), 0.495], atol=2e-12)
        assert target.orientation is not None
        np.testing.assert_allclose(target.orientation[:2, 1], [np.cos(a), -np.sin(a)], atol=2e-12)
        np.testing.assert_allclose(
            np.cross(*target.orientation.T[[1, 2]]), target.orientation[:, 0], atol=1e-12
        )


def test_names() -> None:
    ours = ("corridor", "depot", "facade", "free", "l_shape", "pillar", "pipe", "shelf", "slab", "wall")
    asked = "heap", "walkway", "workplace"
    assert world_names() == tuple(
        sorted((*ours, *asked, "tao1", "tao2", "tao3", "posts1", "posts2", "circle", "door"))
    )
    assert robot_names() == ("youbot", "youbot-real", "hinge5", "dof10", "pioneer7", "pioneer-parm")
    assert all(world_path(name).is_file() for name in world_names())
    with pytest.raises(
        InputError, match=r"unknown world 'moon'.*circle, corridor, depot, door, facade, free"
    ):
        world_path("moon")
    with pytest.raises(InputError, match="unknown robot 'r2d2', valid names: youbot, youbot-real"):
        robot_named("r2d2")


def test_the_depot_s_map_is_the_one_that_its_notice_names() -> None:
    notice = (DATA / "NOTICE.depot.txt").read_text()
    for name in ("depot.pgm", "depot.yaml"):
        assert f"{hashlib.sha256((DATA / name).read_bytes()).hexdigest()}  {name}\n" in notice
    assert "Apache-2.0" in notice


def standing(world: World, solid: BaseGeometry, tool: Array) -> list[Polygon]:
    """Places for the arm's axis: in easy reach, clear of cells, and on the tool's side of them."""
    spot = Point(tool[:2])
    near = spot.buffer(0.45, 32).difference(spot.buffer(0.15, 32)).intersection(world.floor.polygon)
    local = solid.intersection(spot.buffer(1.0))
    area = near.difference(local.buffer(0.305))
    hidden = []
    for part in shapely.get_parts(local.buffer(0.06, 8)):
        ring = np.array(part.exterior.coords)
        far = tool[:2] + (ring - tool[:2]) * 10
        quads = zip(ring[:-1], ring[1:], far[:-1], far[1:], strict=True)
        hidden += [MultiPoint(np.array(quad)).convex_hull for quad in quads]
    area = area.difference(shapely.union_all(hidden))
    return [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and part.area > 1e-4]


@pytest.mark.slow
def test_the_depot_s_path_can_be_followed_without_lifting_the_tool() -> None:
    world = load_world("depot")
    tools = np.array([target.position for target in world.task])
    assert 500 <= len(tools) <= 700
    gaps = np.linalg.norm(np.diff(tools, axis=0), axis=1)
    assert gaps.min() > 0.05
    assert gaps.max() < 0.09
    assert (world.rules.clearance, world.rules.step) == (0.3, 0.25)
    solid = shapely.union_all([cell.polygon for cell in world.floor.cells])
    shapely.prepare(solid)
    distances = shapely.distance(solid, shapely.points(tools[:, :2]))
    assert distances.min() > 0.0999
    assert np.mean(distances < 0.24) > 0.5  # most of it runs along faces, the rest from one to the next
    # The widest chain of places, each joined to the next by what they have in common.
    before = standing(world, solid, tools[0])
    width = [part.area for part in before]
    for tool in tools[1:]:
        now = standing(world, solid, tool)
        width = [
            max(min(w, part.intersection(old).area) for w, old in zip(width, before, strict=True))
            for part in now
        ]
        before = now
    assert max(width) > 0.1
    assert world.start is not None
    start = Point(world.start.base[:2])
    assert solid.distance(start) > 0.3
    assert start.distance(Point(tools[0, :2])) < 1.0
