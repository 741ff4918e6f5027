"""What the robot's solids touch, against points sampled all over them and computations that share no code."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon

from regionik.planners.collision.proximity import Touch, nearest, path_clear, state_clear
from regionik.planners.collision.robot_bodies import (
    Bodies,
    ContactTargets,
    bodies_from,
    near_bodies,
    span_about_tool,
)
from regionik.planners.collision.robot_motion import count_on_line
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import base_body, self_collision_pairs
from tests.bodies import motion_clear
from tests.kinds import LinkSolid, Solid
from tests.maths import Array, planar_pose, rot_x, rot_y, translation

MARGIN = 0.01
GRAIN = 0.055  # nothing of a solid is farther from its sampled points [m]
CLUTTER: tuple[Solid, ...] = (
    Box("box", np.array([0.3, 0.2, 0.5]), np.array([0.5, 0.3, 0.4]), 0.4),
    Box("shelf", np.array([0.6, 1.2, 0.03]), np.array([-0.7, 0.0, 0.3]), 0.0),
    Cylinder("post", 0.06, 1.0, np.array([0.1, -0.5, 0.5])),
    Sphere("ball", 0.15, np.array([-0.3, 0.6, 0.45])),
    Prism("wedge", Polygon([(0.6, -0.7), (1.1, -0.6), (0.8, -0.2)]), 0.1, 0.5),
    Prism("ell", Polygon([(1, 0.5), (2, 0.5), (2, 0.7), (1.2, 0.7), (1.2, 1.2), (1, 1.2)]), 0.0, 0.7),
)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


def box_mesh(low: list[float], high: list[float]) -> Mesh:
    ends = np.array([low, high])
    corners = [[ends[x, 0], ends[y, 1], ends[z, 2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    return Mesh("mesh", np.array(corners), FACES)


def lifted() -> Robot:
    """A torso lift, a pivot, hinges about odd axes, capsules and boxes, a base with a body."""
    frames = [
        translation(0.1, 0, 0.25),
        rot_x(0.2),
        translation(0, 0.1, 0.1) @ rot_y(-0.4),
        translation(0.3, 0, 0),
    ]
    axes = [[0, 0, 1.0], [0, 0, 1.0], [1.0, 2.0, -1.0], [0, 1.0, 0]]
    joints = tuple(
        Joint(
            f"j{k}",
            "prismatic" if k == 0 else "revolute",
            *((0.0, 0.3) if k == 0 else (-2.2, 2.2)),
            T,
            np.array(a),
        )
        for k, (T, a) in enumerate(zip(frames, axes, strict=True))
    )
    chain = Chain(joints, translation(0.3, 0.05, 0.0))
    solids = (
        LinkBox(0, "torso", translation(0, 0, 0.05) @ rot_y(0.3), np.array([0.1, 0.15, 0.2])),
        LinkCapsule(1, "shoulder", np.zeros(3), np.array([0, 0.1, 0.1]), 0.04),
        LinkBox(2, "upper arm", translation(0.15, 0, 0) @ rot_x(0.7), np.array([0.3, 0.08, 0.06])),
        LinkCapsule(3, "fore arm", np.zeros(3), np.array([0.25, 0.05, 0]), 0.03),
        LinkBox(3, "hand", translation(0.27, 0.05, 0) @ rot_y(1.0), np.array([0.06, 0.1, 0.04])),
    )
    footprint = np.array([[0.25, 0.2], [-0.25, 0.2], [-0.25, -0.2], [0.25, -0.2]])
    mount = np.array([0.05, 0.02, 0.0, 0.3])
    return Robot("lifted", "omni", footprint, mount, chain, solids, 0.2, np.zeros(4))


@lru_cache
def prepared(name: str) -> Bodies:
    known = {"lifted": lifted(), "on wheels": replace(lifted(), base="differential")}
    return bodies_from(known[name] if name in known else robot_named(name), CLUTTER)


def states(robot: Robot, count: int, seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    base = np.column_stack([rng.uniform(-1.2, 1.2, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    return base, rng.uniform(robot.chain.lower, robot.chain.upper, (count, robot.chain.dof))


def core(solid: LinkSolid) -> Array:
    """Points all over the hull of a solid's corners, in its link's frame."""
    if isinstance(solid, LinkCapsule):
        return solid.start + np.linspace(0, 1, 9)[:, None] * (solid.end - solid.start)
    assert isinstance(solid, LinkBox)
    t = np.linspace(0, 1, 4)
    shares = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3) - 0.5
    points: Array = (shares * solid.size) @ solid.T_link_box[:3, :3].T + solid.T_link_box[:3, 3]
    return points


def place(frames: Array, solid: LinkSolid) -> Array:
    """Points of a solid in each of many frames (n, links, 4, 4), as (n, points, 3)."""
    T = frames[:, solid.link]
    placed: Array = core(solid) @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
    return placed


def outside(solid: Solid, points: Array) -> Array:
    """Distances of points (..., 3) from a solid, 0 inside."""
    x, y, z = np.moveaxis(points, -1, 0)
    match solid:
        case Sphere():
            return beyond(np.linalg.norm(points - solid.center, axis=-1)[..., None] - solid.radius)
        case Box():
            c, s = np.cos(solid.yaw), np.sin(solid.yaw)
            gap = (
                np.abs((points - solid.center) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
                - solid.size / 2
            )
            return beyond(gap)
        case Cylinder():
            level = np.hypot(x - solid.center[0], y - solid.center[1]) - solid.radius
        case Mesh():
            gap = np.maximum(solid.vertices.min(0) - points, points - solid.vertices.max(0))
            return beyond(gap)
        case _:
            shadow = solid.shadow(np.inf)
            assert shadow is not None
            level = shapely.distance(shadow.core, shapely.points(np.stack([x, y], axis=-1)))
    low, high = solid.z_range
    return beyond(np.stack([level, low - z, z - high], axis=-1))


def beyond(excess: Array) -> Array:
    """Distances from how far points lie beyond faces that stand square to each other or back to back."""
    distance: Array = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
    return distance


def sampled(bodies: Bodies, base: Array, joints: Array) -> Array:
    """Distances to everything in many states, from points of the solids, (n,): too large by GRAIN at most."""
    robot = bodies.robot
    frames = robot.frames(base, joints)
    points = [place(frames, solid) for solid in robot.solids]
    radii = [solid.radius for solid in robot.solids]
    found = np.full(len(base), np.inf)
    for cloud, radius in zip(points, radii, strict=True):
        for obstacle in bodies.obstacles:
            found = np.minimum(found, outside(obstacle, cloud).min(1) - radius)
    body = base_body(robot)
    for i, k in self_collision_pairs(robot):
        if i < 0:
            assert body is not None
            T = np.linalg.inv(np.array([planar_pose(*b) for b in base]))
            seen = points[k] @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
            found = np.minimum(found, outside(body, seen).min(1) - radii[k])
        else:
            apart = np.linalg.norm(points[i][:, :, None] - points[k][:, None], axis=-1)
            found = np.minimum(found, apart.min((1, 2)) - radii[i] - radii[k])
    return found


ROBOTS = ("youbot", "youbot-real", "lifted")
SLOW = tuple(pytest.param(name, marks=pytest.mark.slow) for name in ("lifted", "on wheels"))


@pytest.mark.parametrize("name", ROBOTS)
def test_nearest_agrees_with_points_of_the_solids(name: str) -> None:
    bodies = prepared(name)
    base, joints = states(bodies.robot, 150, 1)
    kinds = set()
    for b, q, expected in zip(base, joints, sampled(bodies, base, joints), strict=True):
        touch = nearest(bodies, b, q)
        kinds.add(touch.kind)
        if expected < -1e-6:
            assert touch.distance < 0
        else:
            assert touch.distance <= expected + 1e-6
            assert touch.distance >= expected - 2 * GRAIN or touch.distance <= 0
    assert kinds >= ({"obstacle", "self"} if name == "youbot" else {"obstacle", "self", "base"})


@pytest.mark.parametrize("name", ROBOTS)
def test_witnesses_lie_on_what_they_name(name: str) -> None:
    bodies = prepared(name)
    base, joints = states(bodies.robot, 100, 2)
    body = base_body(bodies.robot)
    for b, q in zip(base, joints, strict=True):
        touch = nearest(bodies, b, q)
        if touch.distance <= 1e-6:
            continue
        frames = bodies.robot.frames(b, q)
        assert np.linalg.norm(touch.on_solid - touch.on_other) == pytest.approx(touch.distance, abs=1e-6)
        assert distance_of(bodies.robot, frames, touch.solid, touch.on_solid) == pytest.approx(0.0, abs=1e-6)
        if touch.kind == "obstacle":
            other = bodies.obstacles[touch.other].distance(touch.on_other)
        elif touch.kind == "base":
            assert body is not None
            other = body.distance((np.linalg.inv(planar_pose(*b)) @ [*touch.on_other, 1.0])[:3])
        else:
            assert touch.kind == "self"
            other = distance_of(bodies.robot, frames, touch.other, touch.on_other)
        assert other == pytest.approx(0.0, abs=1e-6)


def distance_of(robot: Robot, frames: Array, k: int, point: Array) -> float:
    """Distance of a point of the world from a solid of the robot."""
    solid = robot.solids[k]
    local = (np.linalg.inv(frames[solid.link]) @ [*point, 1.0])[:3]
    if isinstance(solid, LinkCapsule):
        way = solid.end - solid.start
        t = np.clip((local - solid.start) @ way / (way @ way), 0, 1)
        return float(np.linalg.norm(local - solid.start - t * way)) - solid.radius
    assert isinstance(solid, LinkBox)
    inner = (np.linalg.inv(solid.T_link_box) @ [*local, 1.0])[:3]
    return float(np.linalg.norm(np.maximum(np.abs(inner) - solid.size / 2, 0.0)))


@pytest.mark.parametrize("name", ROBOTS)
def test_nearest_within_is_nearest_or_nothing(name: str) -> None:
    bodies = prepared(name)
    for b, q in zip(*states(bodies.robot, 60, 3), strict=True):
        whole, some = nearest(bodies, b, q), nearest(bodies, b, q, within=0.05)
        if whole.distance < 0.05:
            assert (some.distance, some.kind) == (whole.distance, whole.kind)
        else:
            assert (some.distance, some.kind, some.solid, some.other) == (np.inf, "none", -1, -1)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_state_is_clear_where_nothing_is_near(name: str) -> None:
    bodies = prepared(name)
    for b, q in zip(*states(bodies.robot, 60, 4), strict=True):
        assert state_clear(bodies, b, q, 0.02, None) == (nearest(bodies, b, q).distance >= 0.02)


@pytest.mark.parametrize("name", ROBOTS)
def test_moving_everything_changes_nothing(name: str) -> None:
    here = prepared(name)
    x, y, yaw = 3.0, -2.0, 2.1
    T = planar_pose(x, y, yaw)
    there = bodies_from(here.robot, [moved(solid, T, yaw) for solid in CLUTTER])
    for b, q in zip(*states(here.robot, 40, 6), strict=True):
        one = nearest(here, b, q)
        spot = T @ [b[0], b[1], 0, 1]
        other = nearest(there, [spot[0], spot[1], b[2] + yaw], q)
        assert other.distance == pytest.approx(one.distance, abs=2e-3 if one.distance < 0 else 1e-6)
        if one.distance > 1e-3 and one.kind == other.kind:
            assert np.linalg.norm(other.on_solid - other.on_other) == pytest.approx(one.distance, abs=1e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_beyond_the_span_about_the_tool_touches_nothing(name: str) -> None:
    bodies = prepared(name)
    far = span_about_tool(bodies.robot) + 0.01
    for base, joints in zip(*states(bodies.robot, 20, 7), strict=True):
        tool = bodies.robot.tool(base, joints)[:3, 3]
        near = near_bodies(bodies, tool, far)
        assert len(near.pieces) <= len(bodies.pieces)
        one, other = (nearest(some, base, joints, within=0.005) for some in (bodies, near))
        assert (one.kind, one.other, one.solid) == (other.kind, other.other, other.solid)
        assert one.distance == other.distance


def moved(solid: Solid, T: Array, yaw: float) -> Solid:
    match solid:
        case Box():
            return replace(solid, center=(T @ [*solid.center, 1])[:3], yaw=solid.yaw + yaw)
        case Cylinder() | Sphere():
            return replace(solid, center=(T @ [*solid.center, 1])[:3])
        case Prism():
            outline = np.asarray(solid.polygon.exterior.coords) @ T[:2, :2].T + T[:2, 3]
            return replace(solid, polygon=Polygon(outline))
        case Mesh():
            return replace(solid, vertices=solid.vertices @ T[:3, :3].T + T[:3, 3])


@pytest.mark.parametrize("name", ROBOTS)
def test_a_small_step_of_the_base_changes_the_distance_no_more(name: str) -> None:
    bodies = prepared(name)
    rng = np.random.default_rng(7)
    for b, q in zip(*states(bodies.robot, 60, 7), strict=True):
        step = np.array([*rng.normal(size=2) * 0.01, 0.0])
        one, other = nearest(bodies, b, q).distance, nearest(bodies, b + step, q).distance
        if min(one, other) > 0:
            assert abs(one - other) <= np.linalg.norm(step) + 1e-6


def between(robot: Robot, a: Array, b: Array, qa: Array, qb: Array, count: int) -> tuple[Array, Array]:
    """States of a motion."""
    s = np.linspace(0, 1, count)
    return robot.drive.between(a, b, s), qa + s[:, None] * (qb - qa)


def motions(bodies: Bodies, count: int, seed: int) -> list[tuple[Array, Array, Array, Array]]:
    """Short ones and long ones, all from a state that is clear."""
    rng = np.random.default_rng(seed)
    found = []
    lower, upper = bodies.robot.chain.lower, bodies.robot.chain.upper
    for b, q in zip(*states(bodies.robot, 10 * count, seed), strict=True):
        if nearest(bodies, b, q, within=0.03).distance < 0.03:
            continue
        size = 10.0 ** rng.uniform(-2, 0)
        end = b + size * rng.normal(size=3) * [0.7, 0.7, 2.0]
        found.append((b, q, end, np.clip(q + size * rng.normal(size=len(q)), lower, upper)))
        if len(found) == count:
            break
    return found


@pytest.mark.parametrize("name", ["youbot", "youbot-real", *SLOW])
def test_what_is_proven_clear_is_clear_in_every_sample(name: str) -> None:
    bodies = prepared(name)
    clear, count = 0, 40
    for a, qa, b, qb in motions(bodies, count, 8):
        if motion_clear(bodies, a, qa, b, qb, MARGIN) is not None:
            continue
        clear += 1
        base, joints = between(bodies.robot, a, b, qa, qb, 500)
        assert sampled(bodies, base, joints).min() >= MARGIN - 1e-6
        for k in range(0, 500, 25):
            assert nearest(bodies, base[k], joints[k]).distance >= MARGIN - 1e-6
    assert 0.1 < clear / count < 0.95


@pytest.mark.parametrize("name", [*ROBOTS, "on wheels"])
def test_no_false_alarms(name: str) -> None:
    bodies = prepared(name)
    for a, qa, b, qb in motions(bodies, 100, 9):
        touch = motion_clear(bodies, a, qa, b, qb, MARGIN)
        base, joints = between(bodies.robot, a, b, qa, qb, 150)
        least = min(
            nearest(bodies, *state, within=MARGIN + 0.002).distance
            for state in zip(base, joints, strict=True)
        )
        if least >= MARGIN + 0.002:
            assert touch is None
        elif least < MARGIN - 1e-6:
            assert touch is not None
            assert touch.distance < MARGIN + 1e-3


@pytest.mark.parametrize("name", ["youbot", "lifted", "on wheels"])
def test_a_way_is_clear_as_far_as_its_hops_are(name: str) -> None:
    bodies, stopped, ways = prepared(name), 0, motions(prepared(name), 40, 6)
    for a, qa, b, qb in ways:
        base, joints = between(bodies.robot, a, b, qa, qb, 5)
        rows = list(zip(base, joints, strict=True))
        hops = [motion_clear(bodies, *rows[k], *rows[k + 1], MARGIN) for k in range(4)]
        count, touch = path_clear(bodies, base, joints, MARGIN, None)
        stop = next((hop for hop in hops if hop is not None), None)
        assert count == (4 if stop is None else hops.index(stop))
        assert (touch is None) == (stop is None)
        if touch is not None and stop is not None:
            stopped += count > 0
            assert touch[:4] == stop[:4]
    assert 0 < stopped < len(ways)


def wall(x: float, thick: float = 0.1) -> Box:
    return Box("wall", np.array([thick, 4.0, 4.0]), np.array([x + thick / 2, 0.0, 0.0]))


UP = np.radians([0.0, 90.0, 0.0, 90.0, 0.0])  # the youbot's arm straight up
AHEAD = np.radians([0.0, 0.0, 0.0, 90.0, 0.0])  # and straight ahead


def ahead(base_x: float = 0.0) -> float:
    """How far the solids reach when the arm points ahead [m]."""
    return float(robot_named("youbot").tool([base_x, 0, 0], AHEAD)[0, 3]) + 0.035


def test_driving_along_a_wall_a_little_beyond_the_margin() -> None:
    """A long way beside a wall at nearly constant distance costs few steps and raises no alarm."""
    bodies = bodies_from(robot_named("youbot"), [wall(ahead() + MARGIN + 1e-4)])
    assert motion_clear(bodies, [0, -1, 0], AHEAD, [0, 1, 0], AHEAD, MARGIN) is None
    touch = motion_clear(bodies, [0, -1, 0], AHEAD, [2e-4, 1, 0], AHEAD, MARGIN)
    assert touch is not None
    assert (touch.kind, touch.other, touch.solid) == ("obstacle", 0, 3)
    assert touch.distance == pytest.approx(MARGIN, abs=1e-5)


def test_a_thin_plate_in_the_way_is_not_jumped() -> None:
    bodies = bodies_from(robot_named("youbot"), [wall(1.0, thick=1e-4)])
    assert motion_clear(bodies, [0, 0, 0], AHEAD, [3, 0, 0], AHEAD, 0.0) is not None
    assert motion_clear(bodies, [0, 0, 0], UP, [0, 2, 0], UP, 0.0) is None


def test_the_base_turns_the_shorter_way() -> None:
    post = Cylinder("post", 0.05, 1.0, np.array([0.45, 0.0, 0.5]))
    bodies = bodies_from(robot_named("youbot"), [post])
    assert motion_clear(bodies, [0, 0, 3.0], AHEAD, [0, 0, -3.0], AHEAD, MARGIN) is None
    assert motion_clear(bodies, [0, 0, 1.0], AHEAD, [0, 0, -1.0], AHEAD, MARGIN) is not None


def test_a_base_on_wheels_swings_out_on_its_arc() -> None:
    """Half a circle of 0.5 m towards a wall, whose chord runs along that wall, half a metre off."""
    robot = replace(robot_named("youbot"), base="differential")
    for x, clear in ((-0.52, False), (-0.54, True)):
        bodies = bodies_from(robot, [wall(x - 0.1)])
        touch = motion_clear(bodies, [0, 1, -3.1], UP, [0, 0, -0.04], UP, MARGIN)
        assert (touch is None) == clear, x


def test_the_arm_folds_onto_its_base_and_onto_itself() -> None:
    bodies = bodies_from(robot_named("youbot-real"), [])
    down = np.radians([180.0, 0.0, -60.0, 90.0, 0.0])
    touch = motion_clear(bodies, [0, 0, 0], UP, [5, 5, 2], down, 0.0)
    assert touch is not None
    assert touch.kind == "base"
    folded = np.radians([0.0, 90.0, 145.0, 180.0, 0.0])
    bodies = bodies_from(robot_named("youbot"), [])
    touch = motion_clear(bodies, [0, 0, 0], UP, [5, 5, 2], folded, 0.0)
    assert touch is not None
    assert touch.kind == "self"
    assert abs(touch.distance) < 1e-3


def test_how_the_base_moves_does_not_matter_to_the_robot_itself() -> None:
    bodies = bodies_from(robot_named("youbot-real"), [])
    for b, q in zip(*states(bodies.robot, 40, 11), strict=True):
        still = motion_clear(bodies, b, q, b, q + 0.3, MARGIN)
        drive = motion_clear(bodies, b, q, b + [5, -3, 2], q + 0.3, MARGIN)
        assert (still is None) == (drive is None)


def push(depth: float, mesh: bool = False) -> tuple[Bodies, ContactTargets, float]:
    """A wall before the arm, what may touch it, and the base x from which the tool is that deep in it."""
    solid = box_mesh([1.0, -2, -2], [2.0, 2, 2]) if mesh else wall(1.0, 1.0)
    bodies = bodies_from(robot_named("youbot"), [Sphere("far", 0.1, np.array([0.0, 5, 0])), solid], 0.0, 0.04)
    z = float(bodies.robot.tool([0, 0, 0], AHEAD)[2, 3])
    contact = ContactTargets(np.array([[1.0, 0.0, z]]), np.array([1]), 0.05)
    return bodies, contact, 1.0 + depth - (ahead() - 0.035)


@pytest.mark.parametrize("mesh", [False, True])
def test_the_last_link_may_touch_what_it_works_on(mesh: bool) -> None:
    bodies, contact, x = push(0.0, mesh)
    start = [x - 0.3, 0, 0]
    assert motion_clear(bodies, start, AHEAD, [x, 0, 0], AHEAD, MARGIN, contact=contact) is None
    assert motion_clear(bodies, [x, 0, 0], AHEAD, start, AHEAD, MARGIN, contact=contact) is None
    touch = motion_clear(bodies, start, AHEAD, [x, 0, 0], AHEAD, MARGIN)
    assert touch is not None
    assert (touch.kind, touch.other, touch.solid) == ("obstacle", 1, 3)
    free = nearest(bodies, [x, 0, 0], AHEAD, contact=contact)
    assert free.kind == "self"
    assert free.distance == pytest.approx(0.135 - 0.07)
    assert nearest(bodies, [x, 0, 0], AHEAD).distance < 0
    assert state_clear(bodies, np.array([x, 0, 0]), AHEAD, MARGIN, contact)
    assert not state_clear(bodies, np.array([x, 0, 0]), AHEAD, MARGIN, None)


@pytest.mark.parametrize("mesh", [False, True])
def test_not_beyond_the_reach_of_the_spot(mesh: bool) -> None:
    bodies, contact, x = push(0.0, mesh)
    aside = motion_clear(bodies, [x, 0, 0], AHEAD, [x, 0.2, 0], AHEAD, MARGIN, contact=contact)
    assert aside is not None
    assert aside.on_solid[1] >= -0.05
    deeper = motion_clear(bodies, [x, 0, 0], AHEAD, [x + 0.1, 0, 0], AHEAD, MARGIN, contact=contact)
    assert deeper is not None
    other = replace(contact, owner=np.array([0]))
    assert motion_clear(bodies, [x - 0.3, 0, 0], AHEAD, [x, 0, 0], AHEAD, MARGIN, contact=other) is not None


@pytest.mark.parametrize("mesh", [False, True])
@pytest.mark.parametrize(("depth", "free"), [(0.0, True), (0.004, True), (0.006, False), (0.094, False)])
def test_the_tool_sinks_in_no_deeper_than_it_may(depth: float, free: bool, mesh: bool) -> None:
    """Its link ends round in it, 0.035 m deep where it lies on the wall."""
    bodies, contact, x = push(depth, mesh)
    found = motion_clear(bodies, [x - 0.3, 0, 0], AHEAD, [x, 0, 0], AHEAD, MARGIN, contact=contact)
    assert (found is None) == free
    assert (nearest(bodies, [x, 0, 0], AHEAD, contact=contact).kind == "self") == free


def test_a_link_that_lies_along_the_wall_does_not_touch_with_its_tip_alone() -> None:
    bodies, contact, _ = push(0.0)
    along = np.array([np.pi / 2, *AHEAD[1:]])  # a link 0.218 m long, 0.03 m from the wall
    beside = [1.0 - 0.03, 0, 0]
    spot = bodies.robot.tool(beside, along)[:3, 3] + [0.03, 0, 0]
    touch = nearest(bodies, beside, along, contact=replace(contact, spots=spot[None]))
    assert touch.kind == "obstacle"


def test_spots_along_a_path_join_up() -> None:
    bodies, contact, x = push(0.0)
    spots = contact.spots + np.linspace(0, 1, 16)[:, None] * [0, 1.0, 0]
    along = ContactTargets(spots, np.full(16, 1), 0.05)
    assert motion_clear(bodies, [x, 0, 0], AHEAD, [x, 1, 0], AHEAD, MARGIN, contact=along) is None
    gappy = ContactTargets(spots[[0, 1, 2, 6, 7, 8]], np.full(6, 1), 0.05)
    assert motion_clear(bodies, [x, 0, 0], AHEAD, [x, 0.5, 0], AHEAD, MARGIN, contact=gappy) is not None


def test_only_the_last_link_may_touch() -> None:
    """The elbow meets the wall while the tool, bent back, is near its spot on it."""
    robot = robot_named("youbot")
    bent = np.radians([0.0, 0.0, 0.0, 180.0, 0.0])
    tool = robot.tool([0, 0, 0], bent)[:3, 3]
    bodies = bodies_from(robot, [wall(float(robot.frames([0, 0, 0], bent)[3, 0, 3]))])
    contact = ContactTargets(tool[None], np.array([0]), 0.05)
    touch = nearest(bodies, [0, 0, 0], bent, contact=contact)
    assert touch.distance < 0
    assert touch.solid < 3
    assert motion_clear(bodies, [0, 0, 0], bent, [0, 0, 0], bent, 0.0, contact=contact) is not None


def test_inside_a_mesh_without_touching_it() -> None:
    robot = robot_named("youbot")
    bodies = bodies_from(robot, [box_mesh([-5, -5, -5], [5, 5, 5])])
    touch = motion_clear(bodies, [0, 0, 0], UP, [0.1, 0, 0], UP, MARGIN)
    assert touch is not None
    assert touch.distance < -4
    spot = ContactTargets(robot.tool([0, 0, 0], UP)[None, :3, 3], np.array([0]), 0.05)
    last = replace(robot, solids=robot.solids[-1:])
    swallowed = bodies_from(last, bodies.obstacles, 0.0, 0.1)
    assert motion_clear(swallowed, [0, 0, 0], UP, [0.04, 0, 0], UP, MARGIN, contact=spot) is not None
    assert motion_clear(swallowed, [0, 0, 0], UP, [0.08, 0, 0], UP, MARGIN, contact=spot) is not None
    assert motion_clear(swallowed, [-0.1, 0, 0], UP, [0, 0, 0], UP, MARGIN, contact=spot) is not None


@pytest.mark.parametrize("name", ["youbot", "lifted"])
def test_a_mesh_is_as_clear_as_the_box_it_draws(name: str) -> None:
    robot = prepared(name).robot
    low, high = np.array([0.35, -0.3, 0.2]), np.array([0.7, 0.3, 0.6])
    mesh = bodies_from(robot, [box_mesh(low.tolist(), high.tolist())])
    box = bodies_from(robot, [Box("box", high - low, (low + high) / 2)])
    verdicts = []
    for a, qa, b, qb in motions(box, 60, 12):
        one, other = (motion_clear(bodies, a, qa, b, qb, MARGIN) for bodies in (mesh, box))
        assert (one is None) == (other is None)
        verdicts.append(one is None)
        near = nearest(mesh, a, qa)
        assert near.distance == pytest.approx(nearest(box, a, qa).distance, abs=1e-6)
    assert 5 < sum(verdicts) < 55


def test_touching_at_no_margin_ends_and_is_not_clear() -> None:
    bodies = bodies_from(robot_named("youbot"), [wall(ahead())])
    assert motion_clear(bodies, [0, -1, 0], AHEAD, [0, 1, 0], AHEAD, 0.0) is not None


def test_a_robot_without_solids_and_a_world_without_obstacles() -> None:
    bare = bodies_from(replace(robot_named("youbot"), solids=()), CLUTTER)
    assert nearest(bare, [0, 0, 0], UP)[:4] == (np.inf, -1, "none", -1)
    assert motion_clear(bare, [0, 0, 0], UP, [1, 1, 1], AHEAD, MARGIN) is None
    one = replace(robot_named("youbot"), solids=robot_named("youbot").solids[:1])
    alone = bodies_from(one, [])
    assert nearest(alone, [0, 0, 0], UP).kind == "none"
    assert motion_clear(alone, [0, 0, 0], UP, [1, 1, 1], AHEAD, MARGIN) is None


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused_at_the_door(number: float) -> None:
    bodies = prepared("youbot")
    bad = UP.copy()
    bad[2] = number
    with pytest.raises(InputError, match="base: every number must be finite"):
        nearest(bodies, [number, 0, 0], UP)
    with pytest.raises(InputError, match="joints: every number must be finite"):
        nearest(bodies, [0, 0, 0], bad)
    with pytest.raises(InputError, match="finite"):
        ContactTargets(np.array([[0, 0, number]]), np.array([0]), 0.05)


def test_wrong_shapes_are_refused() -> None:
    bodies = prepared("youbot")
    with pytest.raises(InputError, match="joints: expected 5 numbers"):
        nearest(bodies, [0, 0, 0], [0, 0])
    with pytest.raises(InputError, match="one owner a spot"):
        ContactTargets(np.zeros((2, 3)), np.array([0]), 0.05)


def test_a_touch_is_a_tuple_with_names() -> None:
    touch = nearest(prepared("youbot"), [0, 0, 0], UP)
    assert isinstance(touch, Touch)
    assert touch._fields == ("distance", "solid", "kind", "other", "on_solid", "on_other")


def test_hops_that_jump_or_lead_the_tool_astray_are_told() -> None:
    bodies = prepared("youbot")
    robot, q = bodies.robot, np.array(bodies.robot.carry)
    bases = np.array([[0.05 * k, 0.0, 0.0] for k in range(5)])
    joints = np.tile(q, (5, 1))
    shares, most = np.array([0.25, 0.5, 0.75]), (1e-3, 0.5, 0.2)
    line = np.array([robot.tool(*state)[:3, 3] for state in zip(bases, joints, strict=True)])

    def led(bases: Array, joints: Array, line: Array) -> int:
        return int(count_on_line(bodies.mobile, bases, joints, line, shares, most))

    assert led(bases, joints, line) == 4
    aside, bent, far, turned = line.copy(), joints.copy(), bases.copy(), bases.copy()
    aside[3, 1] += 0.01
    bent[2:, 4] += 0.6  # of the roll, which the tool's place does not see
    far[4, 0] += 0.2
    turned[1:, 2] += 0.6
    assert led(bases, joints, aside) == 2
    assert led(bases, bent, line) == 1
    assert led(far, joints, line) == 3
    assert led(turned, joints, line) == 0
