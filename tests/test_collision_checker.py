"""The collision checker, against distances of points sampled along the links."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik import load_robot
from regionik.pipeline import search
from regionik.planners.collision.proximity import Proximity
from regionik.postures.collision_checker import MAX_SPARE
from regionik.postures.poses import Pose
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.links import LinkBox
from regionik.worlds.obstacles import Box, Cylinder, Sphere
from regionik.worlds.robot import Tool
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.bodies import pose_between
from tests.maths import Array, translation
from tests.witnesses import witness

ROBOT = robot_named("youbot")
FLOOR = Floor(shapely.box(-2, -2, 2, 2))


def cluttered(arm_clearance: float, task: tuple[Target, ...] = ()) -> World:
    obstacles = (
        Box("board", np.array([0.6, 0.3, 0.02]), np.array([0.3, 0.0, 0.4]), 0.3),
        Cylinder("post", 0.04, 0.6, np.array([-0.3, 0.2, 0.5])),
        Sphere("ball", 0.1, np.array([0.0, -0.4, 0.3])),
    )
    return World(
        "clutter", ROBOT, FLOOR, obstacles, task, Rules(arm_clearance=arm_clearance, solid_floor=False)
    )


def random_pose(rng: np.random.Generator) -> Pose:
    base = np.array([*rng.uniform(-0.4, 0.4, 2), rng.uniform(-3, 3)])
    return Pose(base, rng.uniform(ROBOT.chain.lower, ROBOT.chain.upper))


def sampled(world: World, at: Pose, skip_last: bool = False) -> float:
    """Least distance of links from obstacles, from 40 points along each; at most 7 mm too far."""
    frames, share = world.robot.frames(at.base, at.joints), np.linspace(0, 1, 40)[:, None]
    least = np.inf
    for link in world.robot.solids[: -1 if skip_last else None]:
        axis = link.corners[0] + share * (link.corners[1] - link.corners[0])
        points = axis @ frames[link.link, :3, :3].T + frames[link.link, :3, 3]
        least = min([least] + [solid.distance(p) - link.radius for p in points for solid in world.solids])
    return least


def apart(at: Pose) -> bool:
    """Whether links are well away from each other, so that obstacles alone decide."""
    world = replace(cluttered(0.0), obstacles=())
    return scene_of(world).collision.clear(at)


@pytest.mark.parametrize("clearance", [0.0, 0.03])
def test_clear_where_sampled_distances_are(clearance: float) -> None:
    world, rng, seen = cluttered(clearance), np.random.default_rng(0), [0, 0]
    collision = scene_of(world).collision
    for _ in range(300):
        at = random_pose(rng)
        gap = sampled(world, at)
        if not apart(at) or abs(gap - clearance - MAX_SPARE) < 0.007:
            continue
        clear = gap > clearance + MAX_SPARE
        seen[clear] += 1
        assert collision.clear(at) == clear
        assert collision.clear(at) == (collision.first_obstruction([at, at]) is None)
    assert min(seen) > 30


def test_a_motion_that_is_not_stopped_is_clear_all_along() -> None:
    world, rng, passed = cluttered(0.01), np.random.default_rng(1), 0
    collision = scene_of(world).collision
    for _ in range(120):
        a = random_pose(rng)
        b = Pose(a.base + rng.uniform(-0.1, 0.1, 3), np.clip(
            a.joints + rng.uniform(-0.4, 0.4, 5), ROBOT.chain.lower, ROBOT.chain.upper
        ))  # fmt: skip
        way = [pose_between(a, b, share, ROBOT) for share in np.linspace(0, 1, 9)]
        proximity = collision.first_obstruction([a, b])
        if proximity is None:
            passed += 1
            assert all(collision.clear(at) for at in way)
            assert min(sampled(world, at) for at in way) >= 0.01
        else:
            assert not all(collision.clear(at) for at in way) or proximity.distance < 0.01 + 0.01
    assert passed > 20


def test_without_avoidance_everything_is_clear() -> None:
    world, rng = cluttered(0.05), np.random.default_rng(2)
    collision = scene_of(replace(world, rules=replace(world.rules, avoidance=False))).collision
    poses = [random_pose(rng) for _ in range(20)]
    assert not collision.enabled
    assert all(collision.clear(at) for at in poses)
    assert collision.first_obstruction(poses) is None


def on_target(world: World, spot: Array, rng: np.random.Generator) -> Pose:
    """A pose with its tool on a spot, the arm otherwise clear."""
    while True:
        at = random_pose(rng)
        tool = ROBOT.tool(at.base, at.joints)[:3, 3]
        moved = Pose(at.base + [*(spot - tool)[:2], 0.0], at.joints)
        near = abs(tool[2] - spot[2]) < 0.01
        if near and apart(moved) and sampled(world, moved, skip_last=True) > 0.02 > sampled(world, moved):
            return moved


def test_the_last_link_may_touch_what_the_tool_works_on() -> None:
    rng, spot = np.random.default_rng(3), np.array([0.3, 0.0, 0.41])
    world = cluttered(0.0, (Target(spot),))
    world = replace(world, rules=replace(world.rules, tool_contact=0.26, contact_depth=0.3))
    at = on_target(world, spot, rng)
    assert scene_of(world).collision.clear(at)
    shallow = scene_of(replace(world, rules=replace(world.rules, contact_depth=0.0))).collision
    assert not shallow.clear(at)
    assert "it may touch it 0.001 m deep, within 0.26 m of the tool" in shallow.words(shallow.nearest(at))
    assert not scene_of(replace(world, rules=replace(world.rules, tool_contact=0.0))).collision.clear(at)
    assert not scene_of(replace(world, task=())).collision.clear(at)
    lifted = Pose(at.base + [0.0, 0.3, 0.0], at.joints)  # farther off than tool_contact
    assert scene_of(world).collision.clear(lifted) == scene_of(replace(world, task=())).collision.clear(
        lifted
    )


@pytest.mark.parametrize("gap", [0.02, -0.01])
def test_what_touches_names_the_rules_that_would_let_it(gap: float) -> None:
    """A pad wider than ``tool_contact``, level above a table that a set-point is near to."""
    away = translation(0.0, 0.0, 0.05)
    pad = LinkBox(0, "pad", translation(0.0, 0.0, 0.04), np.array([0.15, 0.15, 0.02]))
    robot = load_robot("youbot", tool=Tool(away, (pad,)))
    at = Pose(np.zeros(3), np.array([0.0, 0.6, -2.0, 1.4, 0.0]))
    tool = robot.tool(at.base, at.joints)[:3, 3]
    low = tool[2] - gap
    table = Box("table", np.array([1.0, 1.0, 0.02]), np.array([*tool[:2], low - 0.01]))
    rules = Rules(arm_clearance=0.03, solid_floor=False)
    world = World("table", robot, FLOOR, (table,), (Target(tool),), rules)
    collision = scene_of(world).collision
    assert not collision.clear(at)
    told = collision.words(collision.nearest(at))
    named = dict(re.findall(r"rules\.(\w+): ([\d.]+)", told))
    assert "tool_contact" in named
    assert ("contact_depth" in named) == (gap < 0)
    rules = replace(
        rules, tool_contact=float(named["tool_contact"]), contact_depth=float(named.get("contact_depth", 0))
    )
    assert scene_of(replace(world, rules=rules)).collision.clear(at)


def test_words_and_causes_name_link_and_thing() -> None:
    collision = scene_of(cluttered(0.03)).collision
    off = np.zeros(3)
    near = Proximity(0.01, 2, "obstacle", 1, off, off)
    deep = Proximity(-0.02, 2, "self", 0, off, off)
    base = Proximity(-0.01, 3, "base", -1, off, off)
    link = ROBOT.solids[2].name
    assert collision.words(near) == f"{link} comes within 0.0100 m of post"
    assert collision.words(deep) == f"{link} overlaps {ROBOT.solids[0].name} by 0.0200 m"
    assert "base" in collision.words(base)
    cause = collision.cause(near)
    assert (cause.kind, cause.name) == ("obstacle", "post")
    assert cause.margin == pytest.approx(0.02)
    assert collision.cause(deep).kind == "self"
    assert collision.cause(deep).margin == pytest.approx(0.02)


def test_a_start_with_little_to_spare_is_not_blocked() -> None:
    """Two links of this arm, with a joint between them that turns both, are 0.4 mm apart in all postures."""
    world = witness("offsets", 806).world
    assert 0 < scene_of(world).collision.spare < MAX_SPARE
    search(scene_of(world))  # raises where no plan is found
