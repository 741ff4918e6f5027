"""What the robot's solids touch, against points sampled all over them and computations that share no code."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon

from regionik.planners.collision.proximity import nearest
from regionik.postures.poses import Pose
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target
from regionik.worlds.self_collision import self_collision_pairs
from tests.bodies import Guarded
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
def prepared(name: str) -> Guarded:
    known = {"lifted": lifted(), "on wheels": replace(lifted(), base="differential")}
    return Guarded(known[name] if name in known else robot_named(name), *CLUTTER)


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


def base_of(robot: Robot) -> Prism | None:
    """The base as a solid in its own frame; a point has none."""
    return (
        Prism("base", Polygon(robot.footprint), 0.0, robot.body_height) if len(robot.footprint) > 2 else None
    )


def sampled(among: Guarded, base: Array, joints: Array) -> Array:
    """Distances to everything in many states, from points of the solids, (n,): too large by GRAIN at most."""
    robot = among.robot
    frames = robot.frames(base, joints)
    points = [place(frames, solid) for solid in robot.solids]
    radii = [solid.radius for solid in robot.solids]
    found = np.full(len(base), np.inf)
    for cloud, radius in zip(points, radii, strict=True):
        for obstacle in among.solids:
            found = np.minimum(found, outside(obstacle, cloud).min(1) - radius)
    body = base_of(robot)
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
    """And what is not as near as asked is nothing, and clear."""
    among = prepared(name)
    base, joints = states(among.robot, 100, 1)
    kinds = set()
    for b, q, expected in zip(base, joints, sampled(among, base, joints), strict=True):
        proximity, some = among.nearest(b, q), among.nearest(b, q, 0.05)
        kinds.add(proximity.kind)
        if expected < -1e-6:
            assert proximity.distance < 0
        else:
            assert proximity.distance <= expected + 1e-6
            assert proximity.distance >= expected - 2 * GRAIN or proximity.distance <= 0
        near = proximity.distance < 0.05
        assert some[:4] == (proximity[:4] if near else (np.inf, -1, "none", -1))
        assert (among.stop(b, q, b, q, 0.05) is not None) == near
    assert kinds >= ({"obstacle", "self"} if name == "youbot" else {"obstacle", "self", "base"})


@pytest.mark.parametrize("name", ROBOTS)
def test_witnesses_lie_on_what_they_name(name: str) -> None:
    among = prepared(name)
    robot, body = among.robot, base_of(among.robot)
    for b, q in zip(*states(robot, 80, 2), strict=True):
        proximity = among.nearest(b, q)
        if proximity.distance <= 1e-6:
            continue
        frames = robot.frames(b, q)
        assert np.linalg.norm(proximity.on_solid - proximity.on_other) == pytest.approx(
            proximity.distance, abs=1e-6
        )
        assert distance_of(robot, frames, proximity.solid, proximity.on_solid) == pytest.approx(0.0, abs=1e-6)
        if proximity.kind == "obstacle":
            other = among.solids[proximity.other].distance(proximity.on_other)
        elif proximity.kind == "base":
            assert body is not None
            other = body.distance((np.linalg.inv(planar_pose(*b)) @ [*proximity.on_other, 1.0])[:3])
        else:
            assert proximity.kind == "self"
            other = distance_of(robot, frames, proximity.other, proximity.on_other)
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
def test_moving_everything_changes_nothing(name: str) -> None:
    """And a small step of the base changes the distance by no more than its length."""
    here = prepared(name)
    x, y, yaw = 3.0, -2.0, 2.1
    T, rng = planar_pose(x, y, yaw), np.random.default_rng(7)
    there = Guarded(here.robot, *(moved(solid, T, yaw) for solid in CLUTTER))
    for b, q in zip(*states(here.robot, 40, 6), strict=True):
        one = here.nearest(b, q)
        spot = T @ [b[0], b[1], 0, 1]
        other = there.nearest([spot[0], spot[1], b[2] + yaw], q)
        assert other.distance == pytest.approx(one.distance, abs=2e-3 if one.distance < 0 else 1e-6)
        if one.distance > 1e-3 and one.kind == other.kind:
            assert np.linalg.norm(other.on_solid - other.on_other) == pytest.approx(one.distance, abs=1e-6)
        step = np.array([*rng.normal(size=2) * 0.01, 0.0])
        stepped = here.nearest(b + step, q).distance
        if min(one.distance, stepped) > 0:
            assert abs(one.distance - stepped) <= np.linalg.norm(step) + 1e-6


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_beyond_the_reach_about_the_tool_touches_nothing(name: str) -> None:
    among = prepared(name)
    for base, joints in zip(*states(among.robot, 20, 7), strict=True):
        near = among.scene.collision_at(Target(among.robot.tool(base, joints)[:3, 3]))
        one, other = (collision.nearest(Pose(base, joints)) for collision in (among.scene.collision, near))
        assert (one.kind, one.solid, one.distance) == (other.kind, other.solid, other.distance)
        assert len(near.bodies.pieces) <= len(among.scene.collision.bodies.pieces)


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


def between(robot: Robot, a: Array, b: Array, qa: Array, qb: Array, count: int) -> tuple[Array, Array]:
    """States of a motion."""
    s = np.linspace(0, 1, count)
    return robot.drive.between(a, b, s), qa + s[:, None] * (qb - qa)


def motions(among: Guarded, count: int, seed: int) -> list[tuple[Array, Array, Array, Array]]:
    """Short ones and long ones, all from a state that is clear."""
    rng = np.random.default_rng(seed)
    found = []
    lower, upper = among.robot.chain.lower, among.robot.chain.upper
    for b, q in zip(*states(among.robot, 10 * count, seed), strict=True):
        if among.nearest(b, q, 0.03).kind != "none":
            continue
        size = 10.0 ** rng.uniform(-2, 0)
        end = b + size * rng.normal(size=3) * [0.7, 0.7, 2.0]
        found.append((b, q, end, np.clip(q + size * rng.normal(size=len(q)), lower, upper)))
        if len(found) == count:
            break
    return found


@pytest.mark.parametrize("name", ["youbot", "youbot-real", *SLOW])
def test_what_is_proven_clear_is_clear_in_every_sample(name: str) -> None:
    """And hardly anything that is clear everywhere is not proven."""
    among = prepared(name)
    clear, count = 0, 40
    for a, qa, b, qb in motions(among, count, 8):
        proximity = among.stop(a, qa, b, qb, MARGIN)
        base, joints = between(among.robot, a, b, qa, qb, 500)
        rows = zip(base[::5], joints[::5], strict=True)
        least = min(among.nearest(*row, MARGIN + 0.002).distance for row in rows)
        if proximity is None:
            clear += 1
            assert sampled(among, base, joints).min() >= MARGIN - 1e-6
            assert least >= MARGIN - 1e-6
        else:
            assert least < MARGIN + 0.002
            assert proximity.distance < MARGIN + 1e-3 or least >= MARGIN - 1e-6
    assert 0.1 < clear / count < 0.95


@pytest.mark.parametrize("name", ["youbot", "lifted", "on wheels"])
def test_a_way_is_clear_as_far_as_its_hops_are(name: str) -> None:
    among = prepared(name)
    stopped, ways, collision = 0, motions(among, 40, 6), replace(among.scene.collision, spare=MARGIN)
    for a, qa, b, qb in ways:
        base, joints = between(among.robot, a, b, qa, qb, 5)
        rows = list(zip(base, joints, strict=True))
        hops = [among.stop(*rows[k], *rows[k + 1], MARGIN) for k in range(4)]
        count, proximity = collision.proven(base, joints)
        stop = next((hop for hop in hops if hop is not None), None)
        assert count == (4 if stop is None else hops.index(stop))
        assert (proximity is None) == (stop is None)
        if proximity is not None and stop is not None:
            stopped += count > 0
            assert proximity[:4] == stop[:4]
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
    among = Guarded(robot_named("youbot"), wall(ahead() + MARGIN + 1e-4))
    assert among.stop([0, -1, 0], AHEAD, [0, 1, 0], AHEAD, MARGIN) is None
    proximity = among.stop([0, -1, 0], AHEAD, [2e-4, 1, 0], AHEAD, MARGIN)
    assert proximity is not None
    assert (proximity.kind, proximity.other, proximity.solid) == ("obstacle", 0, 3)
    assert proximity.distance == pytest.approx(MARGIN, abs=1e-5)
    touching = Guarded(robot_named("youbot"), wall(ahead()))
    assert touching.stop([0, -1, 0], AHEAD, [0, 1, 0], AHEAD) is not None


def test_a_thin_plate_in_the_way_is_not_jumped() -> None:
    among = Guarded(robot_named("youbot"), wall(1.0, thick=1e-4))
    assert among.stop([0, 0, 0], AHEAD, [3, 0, 0], AHEAD) is not None
    assert among.stop([0, 0, 0], UP, [0, 2, 0], UP) is None


def test_the_base_turns_the_shorter_way() -> None:
    among = Guarded(robot_named("youbot"), Cylinder("post", 0.05, 1.0, np.array([0.45, 0.0, 0.5])))
    assert among.stop([0, 0, 3.0], AHEAD, [0, 0, -3.0], AHEAD, MARGIN) is None
    assert among.stop([0, 0, 1.0], AHEAD, [0, 0, -1.0], AHEAD, MARGIN) is not None


def test_a_base_on_wheels_swings_out_on_its_arc() -> None:
    """Half a circle of 0.5 m towards a wall, whose chord runs along that wall, half a metre off."""
    robot = replace(robot_named("youbot"), base="differential")
    for x, clear in ((-0.52, False), (-0.54, True)):
        proximity = Guarded(robot, wall(x - 0.1)).stop([0, 1, -3.1], UP, [0, 0, -0.04], UP, MARGIN)
        assert (proximity is None) == clear, x


def test_the_arm_folds_onto_its_base_and_onto_itself() -> None:
    down = np.radians([180.0, 0.0, -60.0, 90.0, 0.0])
    proximity = Guarded(robot_named("youbot-real")).stop([0, 0, 0], UP, [5, 5, 2], down)
    assert proximity is not None
    assert proximity.kind == "base"
    folded = np.radians([0.0, 90.0, 145.0, 180.0, 0.0])
    proximity = Guarded(robot_named("youbot")).stop([0, 0, 0], UP, [5, 5, 2], folded)
    assert proximity is not None
    assert proximity.kind == "self"
    assert abs(proximity.distance) < 1e-3


def test_how_the_base_moves_does_not_matter_to_the_robot_itself() -> None:
    alone = Guarded(robot_named("youbot-real"))
    for b, q in zip(*states(alone.robot, 40, 11), strict=True):
        still = alone.stop(b, q, b, q + 0.3, MARGIN)
        drive = alone.stop(b, q, b + [5, -3, 2], q + 0.3, MARGIN)
        assert (still is None) == (drive is None)


SHALLOW = {"tool_contact": 0.05, "contact_depth": 0.039, "tolerance": 0.001}


def push(depth: float, mesh: bool = False, **rules: float) -> tuple[Guarded, float]:
    """A wall before the arm with a set-point on it, and the base x from which the tool is that deep in it."""
    solid = box_mesh([1.0, -2, -2], [2.0, 2, 2]) if mesh else wall(1.0, 1.0)
    robot = robot_named("youbot")
    spot = [1.0, 0.0, float(robot.tool([0, 0, 0], AHEAD)[2, 3])]
    among = Guarded(robot, Sphere("far", 0.1, np.array([0.0, 5, 0])), solid, spots=[spot], **SHALLOW | rules)
    return among, 1.0 + depth - (ahead() - 0.035)


@pytest.mark.parametrize("mesh", [False, True])
def test_the_last_link_may_touch_what_it_works_on(mesh: bool) -> None:
    (among, x), (shy, _) = push(0.0, mesh), push(0.0, mesh, tool_contact=0.0)
    start = [x - 0.3, 0, 0]
    assert among.stop(start, AHEAD, [x, 0, 0], AHEAD, MARGIN) is None
    assert among.stop([x, 0, 0], AHEAD, start, AHEAD, MARGIN) is None
    proximity = shy.stop(start, AHEAD, [x, 0, 0], AHEAD, MARGIN)
    assert proximity is not None
    assert (proximity.kind, proximity.other, proximity.solid) == ("obstacle", 1, 3)
    free = among.nearest([x, 0, 0], AHEAD)
    assert free.kind == "self"
    assert free.distance == pytest.approx(0.135 - 0.07)
    assert shy.nearest([x, 0, 0], AHEAD).distance < 0


@pytest.mark.parametrize("mesh", [False, True])
def test_not_beyond_the_reach_of_the_spot(mesh: bool) -> None:
    among, x = push(0.0, mesh)
    aside = among.stop([x, 0, 0], AHEAD, [x, 0.2, 0], AHEAD, MARGIN)
    assert aside is not None
    assert aside.on_solid[1] >= -0.05
    assert among.stop([x, 0, 0], AHEAD, [x + 0.1, 0, 0], AHEAD, MARGIN) is not None


@pytest.mark.parametrize("mesh", [False, True])
@pytest.mark.parametrize(("depth", "free"), [(0.0, True), (0.004, True), (0.006, False), (0.094, False)])
def test_the_tool_sinks_in_no_deeper_than_it_may(depth: float, free: bool, mesh: bool) -> None:
    """Its link ends round in it, 0.035 m deep where it lies on the wall."""
    among, x = push(depth, mesh)
    found = among.stop([x - 0.3, 0, 0], AHEAD, [x, 0, 0], AHEAD, MARGIN)
    assert (found is None) == free
    assert (among.nearest([x, 0, 0], AHEAD).kind == "self") == free


def test_a_link_that_lies_along_the_wall_does_not_touch_with_its_tip_alone() -> None:
    robot = robot_named("youbot")
    along = np.array([np.pi / 2, *AHEAD[1:]])  # a link 0.218 m long, 0.03 m from the wall
    beside = [1.0 - 0.03, 0, 0]
    spot = robot.tool(beside, along)[:3, 3] + [0.03, 0, 0]
    among = Guarded(robot, wall(1.0, 1.0), spots=[spot], **SHALLOW)
    assert among.nearest(beside, along).kind == "obstacle"


def test_spots_along_a_path_join_up() -> None:
    robot, (_, x) = robot_named("youbot"), push(0.0)
    z = float(robot.tool([0, 0, 0], AHEAD)[2, 3])
    spots = np.column_stack([np.ones(16), np.linspace(0, 1, 16), np.full(16, z)])
    for some, end, clear in ((slice(None), 1, True), ([0, 1, 2, 6, 7, 8], 0.5, False)):
        among = Guarded(robot, wall(1.0, 1.0), spots=spots[some], **SHALLOW)
        assert (among.stop([x, 0, 0], AHEAD, [x, end, 0], AHEAD, MARGIN) is None) == clear


def test_only_the_last_link_may_touch() -> None:
    """The elbow meets the wall while the tool, bent back, is near its spot on it."""
    robot = robot_named("youbot")
    bent = np.radians([0.0, 0.0, 0.0, 180.0, 0.0])
    face = wall(float(robot.frames([0, 0, 0], bent)[3, 0, 3]))
    among = Guarded(
        robot, face, spots=[robot.tool([0, 0, 0], bent)[:3, 3]], **SHALLOW | {"tool_contact": 0.2}
    )
    proximity = among.nearest([0, 0, 0], bent)
    assert proximity.distance < 0
    assert proximity.solid < 3
    assert among.stop([0, 0, 0], bent, [0, 0, 0], bent) is not None


def test_inside_a_mesh_without_touching_it() -> None:
    robot, cave = robot_named("youbot"), box_mesh([-5, -5, -5], [5, 5, 5])
    proximity = Guarded(robot, cave).stop([0, 0, 0], UP, [0.1, 0, 0], UP, MARGIN)
    assert proximity is not None
    assert proximity.distance < -4
    last = replace(robot, solids=robot.solids[-1:])
    swallowed = Guarded(
        last, cave, spots=[robot.tool([0, 0, 0], UP)[:3, 3]], **SHALLOW | {"contact_depth": 0.1}
    )
    for start, end in ((0.0, 0.04), (0.0, 0.08), (-0.1, 0.0)):
        assert swallowed.stop([start, 0, 0], UP, [end, 0, 0], UP, MARGIN) is not None


def test_a_path_is_judged_as_each_of_its_motions() -> None:
    """Past a block that the tool may touch, mesh or box: in, out, and along it where it may not."""
    (mesh, x), (block, _) = push(0.0, mesh=True), push(0.0)
    rng, ends = np.random.default_rng(3), set[int]()
    for _ in range(40):
        ways = np.cumsum(rng.uniform(-0.05, 0.05, (12, 3)) * (1.0, 1.0, 0.2), axis=0) + (x - 0.02, 0.0, 0.0)
        alone = [mesh.stop(here, AHEAD, there, AHEAD) is None for here, there in pairwise(ways)]
        expected = [*alone, False].index(False)
        for among in (mesh, block):
            collision = replace(among.scene.collision, spare=0.0)
            assert collision.proven(ways, np.tile(AHEAD, (12, 1)))[0] == expected
        ends.add(expected)
    assert len(ends) > 4


@pytest.mark.parametrize("name", ["youbot", "lifted"])
def test_a_mesh_is_as_clear_as_the_box_it_draws(name: str) -> None:
    robot = prepared(name).robot
    low, high = np.array([0.35, -0.3, 0.2]), np.array([0.7, 0.3, 0.6])
    mesh = Guarded(robot, box_mesh(low.tolist(), high.tolist()))
    box = Guarded(robot, Box("box", high - low, (low + high) / 2))
    verdicts = []
    for a, qa, b, qb in motions(box, 60, 12):
        one, other = (among.stop(a, qa, b, qb, MARGIN) for among in (mesh, box))
        assert (one is None) == (other is None)
        verdicts.append(one is None)
        assert mesh.nearest(a, qa).distance == pytest.approx(box.nearest(a, qa).distance, abs=1e-6)
    assert 5 < sum(verdicts) < 55


def test_a_robot_without_solids_and_a_world_without_obstacles() -> None:
    bare = Guarded(replace(robot_named("youbot"), solids=()), *CLUTTER)
    assert bare.nearest([0, 0, 0], UP)[:4] == (np.inf, -1, "none", -1)
    assert bare.stop([0, 0, 0], UP, [1, 1, 1], AHEAD, MARGIN) is None
    alone = Guarded(replace(robot_named("youbot"), solids=robot_named("youbot").solids[:1]))
    assert alone.nearest([0, 0, 0], UP).kind == "none"
    assert alone.stop([0, 0, 0], UP, [1, 1, 1], AHEAD, MARGIN) is None


def test_hops_that_jump_or_lead_the_tool_astray_are_told() -> None:
    among = Guarded(robot_named("youbot"), step=0.2)
    robot, q = among.robot, np.array(among.robot.carry)
    bases = np.array([[0.05 * k, 0.0, 0.0] for k in range(5)])
    joints = np.tile(q, (5, 1))
    shares = np.array([0.25, 0.5, 0.75])
    line = np.array([robot.tool(*state)[:3, 3] for state in zip(bases, joints, strict=True)])

    def led(bases: Array, joints: Array, line: Array) -> int:
        return among.scene.collision.count_on_line(bases, joints, line, shares, 1e-3)

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


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused_at_the_door(number: float) -> None:
    bodies = Guarded(robot_named("youbot"), *CLUTTER).scene.bodies
    with pytest.raises(InputError, match="base: every number must be finite"):
        nearest(bodies, [number, 0, 0], np.zeros(5))
    with pytest.raises(InputError, match="joints: every number must be finite"):
        nearest(bodies, [0, 0, 0], [0, 0, number, 0, 0])
    with pytest.raises(InputError, match="joints: expected 5 numbers"):
        nearest(bodies, [0, 0, 0], [0, 0])
