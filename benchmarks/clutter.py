"""Random arms among random solids, and checks of their postures by other means than the library's.

Distances of points come from closed forms (meshes: from each triangle), and bodies are cut into cells: a
signed distance changes by no more than its point moves, so its value at the middle of a cell bounds it all
over the cell. Cells are halved until they tell, so there is no error of sampling but `CERTAIN`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import trimesh
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import planar_pose, pose, translation
from regionik.worlds.links import LinkBox, LinkSolid
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import base_body, self_collision_pairs

ARMS = ("youbot", "youbot-real", "hinge5", "dof10", "pioneer7", "boxes")
CERTAIN = 1e-6  # bodies that overlap by more than this are told [m]
MOST_CELLS = 200_000
FAR = 0.1  # from the ball round a mesh, from where on that does; more than any link's radius [m]
CORE = 0.2  # part of the reach round the shoulder that stays empty
_RAY = np.array([0.5381, 0.2137, 0.8153])

Distance = Callable[[Array], Array]  # of points (m, 3), signed [m]


class Scene(NamedTuple):
    """An arm on a base, what stands about, where the tool shall go, and where the arm is."""

    arm: str
    robot: Robot
    solids: list[Solid]
    base: Array
    target: Array
    joints: Array


def robot_of(arm: str) -> Robot:
    """A bundled robot, or the youbot with boxes for links."""
    if arm != "boxes":
        return robot_named(arm)
    robot = robot_named("youbot")
    solids = []
    for k, solid in enumerate(robot.solids):
        along = solid.corners[1] - solid.corners[0]
        x = along / np.linalg.norm(along)
        y = np.cross(x, [0.3, 0.5, 0.8])
        T = np.eye(4)
        T[:3, :3] = np.column_stack([x, y / np.linalg.norm(y), np.cross(x, y / np.linalg.norm(y))])
        T[:3, 3] = solid.corners.mean(0)
        size = np.array([np.linalg.norm(along), 0.06, 0.05])
        solids.append(LinkBox(solid.link, f"case {k + 1}", T, size))
    return Robot(
        arm,
        robot.base,
        robot.footprint,
        robot.mount,
        robot.chain,
        tuple(solids),
        robot.body_height,
        robot.carry,
    )


ROBOTS = {arm: robot_of(arm) for arm in ARMS}


def scene(number: int) -> Scene:
    """The scene of a number; arms take turns."""
    rng = np.random.default_rng([2021, number])
    arm = ARMS[number % len(ARMS)]
    robot = ROBOTS[arm]
    base = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)])
    lower, upper = np.maximum(robot.chain.lower, -np.pi), np.minimum(robot.chain.upper, np.pi)
    there, joints = rng.uniform(lower, upper, (2, robot.chain.dof))
    reach = sum(float(np.linalg.norm(solid.corners[-1] - solid.corners[0])) for solid in robot.solids)
    T = robot.T_world_arm(base)
    shoulder = T[:3, 3] + [0, 0, 0.2 * reach]
    target = robot.tool(base, there)[:3, 3]
    if rng.random() < 0.15:
        target = shoulder + _ball(rng) * 1.1 * reach
    count = int(np.exp(rng.uniform(0, np.log(51))))
    solids = _solids(rng, count, shoulder, reach)
    return Scene(arm, robot, solids, base, np.array(target), joints)


def _solids(rng: np.random.Generator, count: int, shoulder: Array, reach: float) -> list[Solid]:
    """Solids that leave the shoulder alone, smaller where there are more of them."""
    solids: list[Solid] = []
    while len(solids) < count:
        size = reach * rng.uniform(0.15, 0.5) / count ** (1 / 3)
        solid = random_solid(rng, f"solid {len(solids)}", shoulder + _ball(rng) * 1.1 * reach, size)
        if float(distance_to(solid)(shoulder[None])[0]) > CORE * reach:
            solids.append(solid)
    return solids


def random_solid(rng: np.random.Generator, name: str, at: Array, size: float) -> Solid:
    """A solid of a random kind with sides of about a size [m]."""
    a, b, c = size * rng.uniform(0.4, 1.6, 3)
    match int(rng.integers(5)):
        case 0:
            return Box(name, np.array([a, b, c]), at, rng.uniform(-3, 3))
        case 1:
            return Cylinder(name, a / 2, b, at)
        case 2:
            return Sphere(name, a / 2, at)
        case 3:
            turns = np.linspace(0, 2 * np.pi, 7, endpoint=False)
            rays = size * rng.uniform(0.25, 0.9, 7)  # not convex as a rule
            outline = at[:2] + rays[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
            return Prism(name, Polygon(outline), at[2] - a / 2, at[2] + a / 2)
        case _:
            return _mesh(rng, name, at, np.array([a, b, c]))


def _mesh(rng: np.random.Generator, name: str, at: Array, size: Array) -> Mesh:
    """A tilted hull of random points, or a tilted angle iron."""
    if rng.random() < 0.5:
        body = trimesh.convex.convex_hull(rng.uniform(-0.6, 0.6, (10, 3)))
        points, faces = body.vertices, body.faces
    else:
        steel = Polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, -0.2), (-0.2, -0.2), (-0.2, 0.5), (-0.5, 0.5)])
        points, faces = _extruded(np.array(steel.exterior.coords)[:-1])
    T = pose(at.tolist(), rng.uniform(-3, 3, 3).tolist())
    return Mesh(name, (np.asarray(points) * size) @ T[:3, :3].T + at, np.asarray(faces))


def _extruded(outline: Array) -> tuple[Array, Array]:
    """The angle iron's outline of six corners, raised by one."""
    low = np.column_stack([outline, np.full(6, -0.5)])
    lid = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    sides = [[[k, (k + 1) % 6, 6 + k], [(k + 1) % 6, 6 + (k + 1) % 6, 6 + k]] for k in range(6)]
    floor = [[a, c, b] for a, b, c in lid]
    faces = [*floor, *([a + 6, b + 6, c + 6] for a, b, c in lid), *(t for pair in sides for t in pair)]
    return np.vstack([low, low + [0, 0, 1]]), np.array(faces)


def _ball(rng: np.random.Generator) -> Array:
    """A point drawn evenly from the unit ball."""
    way = rng.normal(size=3)
    point: Array = way / np.linalg.norm(way) * rng.random() ** (1 / 3)
    return point


def distance_to(solid: Solid) -> Distance:
    """Signed distances of points from a solid."""
    match solid:
        case Sphere():
            return lambda p: np.linalg.norm(p - solid.center, axis=1) - solid.radius
        case Cylinder():
            return lambda p: _raised(
                np.hypot(*(p - solid.center)[:, :2].T) - solid.radius, p[:, 2], *solid.z_range
            )
        case Box():
            T = translation(*solid.center)
            c, s = np.cos(solid.yaw), np.sin(solid.yaw)
            T[:2, :2] = [[c, -s], [s, c]]
            return _from_box(T, solid.size)
        case Prism():
            outline = np.array(solid.polygon.exterior.coords)[:-1]
            return lambda p: _raised(_from_outline(outline, p[:, :2]), p[:, 2], solid.bottom, solid.top)
        case Mesh():
            middle = solid.vertices.mean(0)
            radius = np.linalg.norm(solid.vertices - middle, axis=1).max()
            return lambda p: _from_mesh(solid.vertices[solid.faces], middle, float(radius), p)


def _from_box(T: Array, size: Array) -> Distance:
    def distance(p: Array) -> Array:
        beyond = np.abs((p - T[:3, 3]) @ T[:3, :3]) - size / 2
        out: Array = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(1), 0)
        return out

    return distance


def _raised(level: Array, z: Array, bottom: float, top: float) -> Array:
    """From signed distances in the plane."""
    tall = np.maximum(bottom - z, z - top)
    outside: Array = np.hypot(np.maximum(level, 0), np.maximum(tall, 0))
    inside: Array = np.minimum(np.maximum(level, tall), 0)
    return outside + inside


def _from_outline(outline: Array, p: Array) -> Array:
    a, b = outline, np.roll(outline, -1, axis=0)
    along, off = b - a, p[:, None] - a
    t = np.clip((off * along).sum(2) / (along * along).sum(1), 0, 1)
    gap = np.linalg.norm(off - t[..., None] * along, axis=2).min(1)
    between = (a[:, 1] > p[:, 1, None]) != (b[:, 1] > p[:, 1, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        right = p[:, 0, None] < a[:, 0] + (p[:, 1, None] - a[:, 1]) * along[:, 0] / along[:, 1]
    inside = (between & right).sum(1) % 2 == 1
    signed: Array = np.where(inside, -gap, gap)
    return signed


def _from_mesh(triangles: Array, middle: Array, radius: float, p: Array) -> Array:
    """Points that are far off get a lower bound, from the ball round the mesh."""
    bound = np.linalg.norm(p - middle, axis=1) - radius
    near = bound < FAR
    bound[near] = _from_triangles(triangles, p[near])
    signed: Array = bound
    return signed


def _from_triangles(triangles: Array, p: Array) -> Array:
    """The nearest triangle; inside where a ray leaves through an odd number of them."""
    n, m = len(p), len(triangles)
    spots, corners = np.repeat(p, m, axis=0), np.tile(triangles, (n, 1, 1))
    on = trimesh.triangles.closest_point(corners, spots)  # type: ignore[no-untyped-call]
    gap = np.linalg.norm(on - spots, axis=1).reshape(n, m).min(1)
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(_RAY, f)
    scale = (e * across).sum(1)
    off = p[:, None] - a
    u = (off * across).sum(2) / scale
    q = np.cross(off, e)
    v, t = (q * _RAY).sum(2) / scale, (q * f).sum(2) / scale
    hits = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).sum(1)
    signed: Array = np.where(hits % 2 == 1, -gap, gap)
    return signed


class Body(NamedTuple):
    """Points within a radius of a segment or a box: its middle and its half axes (k, 3)."""

    middle: Array
    halves: Array
    radius: float


def body_of(solid: LinkSolid, T: Array) -> Body:
    """A link's solid at the pose of its link."""
    if isinstance(solid, LinkBox):
        frame = T @ solid.T_link_box
        return Body(frame[:3, 3], (frame[:3, :3] * solid.size / 2).T, 0.0)
    a, b = solid.corners @ T[:3, :3].T + T[:3, 3]
    return Body((a + b) / 2, (b - a)[None] / 2, solid.radius)


def keeps_off(body: Body, distance: Distance) -> bool:
    """Whether a body is proven to stay out of a solid, but for `CERTAIN`."""
    floor = body.radius - CERTAIN
    cells, halves = body.middle[None], body.halves
    while len(cells):
        values = distance(cells)
        if values.min() < floor:
            return False
        size = np.linalg.norm(np.abs(halves).sum(0)) if len(halves) == 1 else np.sqrt((halves**2).sum())
        cells = cells[values - size < floor]
        longest = int(np.argmax(np.linalg.norm(halves, axis=1)))
        halves = halves.copy()
        halves[longest] /= 2
        cells = np.concatenate([cells - halves[longest], cells + halves[longest]])
        if len(cells) > MOST_CELLS:
            raise RuntimeError("a body so near to a solid that cells do not tell")
    return True


def _from_body(body: Body) -> Distance:
    if len(body.halves) == 3:
        T, size = np.eye(4), 2 * np.linalg.norm(body.halves, axis=1)
        T[:3, :3], T[:3, 3] = (body.halves / (size / 2)[:, None]).T, body.middle
        return _from_box(T, size)
    half = body.halves[0]

    def distance(p: Array) -> Array:
        t = np.clip((p - body.middle) @ half / (half @ half), -1, 1)
        off: Array = np.linalg.norm(p - body.middle - t[:, None] * half, axis=1)
        return off - body.radius

    return distance


def faults(one: Scene, joints: Array, tolerance: float) -> list[str]:
    """All that is wrong with an answer: limits, target, obstacles, the arm itself, the base."""
    robot, chain = one.robot, one.robot.chain
    wrong = []
    if not ((joints >= chain.lower) & (joints <= chain.upper)).all():
        wrong.append("out of limits")
    frames = robot.frames(one.base, joints)
    off = float(np.linalg.norm(frames[-1, :3, 3] - one.target))
    if not off <= tolerance * (1 + 1e-9):
        wrong.append(f"{off:g} m off the target")
    bodies = [body_of(solid, frames[solid.link]) for solid in robot.solids]
    for solid in one.solids:
        distance = distance_to(solid)
        wrong += [
            f"link {k} in {solid.name}" for k, body in enumerate(bodies) if not keeps_off(body, distance)
        ]
    for i, k in self_collision_pairs(robot):
        if i >= 0 and not keeps_off(bodies[k], _from_body(bodies[i])):
            wrong.append(f"link {k} in link {i}")
    return wrong + _in_base(one, joints)


def _in_base(one: Scene, joints: Array) -> list[str]:
    body, robot = base_body(one.robot), one.robot
    if body is None:
        return []
    frames, distance = robot.frames(np.zeros(3), joints), distance_to(body)
    own = [k for i, k in self_collision_pairs(robot) if i < 0]
    return [
        f"link {k} in the base"
        for k in own
        if not keeps_off(body_of(robot.solids[k], frames[robot.solids[k].link]), distance)
    ]


def free_posture(one: Scene, tolerance: float, sweep: Callable[[Array], Array]) -> Array | None:
    """A posture among a dense sweep of those on the target that nothing is wrong with; None where all fail.

    ``sweep`` takes a target in the arm's base frame and returns postures (m, dof) that put the tool on it.
    Links are first looked at on rows of points; then `faults` tells, so that a posture returned is one.
    """
    for goal in _round(one, tolerance):
        lower, q = one.robot.chain.lower, sweep(goal)
        if np.isfinite(lower).all():
            q = np.remainder(q - lower, 2 * np.pi) + lower
        q = q[((q >= one.robot.chain.lower) & (q <= one.robot.chain.upper)).all(1)]
        frames = one.robot.frames(np.broadcast_to(one.base, (len(q), 3)), q)
        keep = np.linalg.norm(frames[:, -1, :3, 3] - one.target, axis=1) <= tolerance
        q, frames = q[keep], frames[keep]
        for part, distance, T in _all_that_may_meet(one):
            seen = np.linalg.inv(T(frames)) @ frames[:, one.robot.solids[part].link]
            points, radius = _rows(one.robot.solids[part])
            spots = points @ seen[:, :3, :3].transpose(0, 2, 1) + seen[:, None, :3, 3]
            values = _many(distance, spots.reshape(-1, 3)).reshape(spots.shape[:2])
            free = values.min(1) >= radius
            q, frames = q[free], frames[free]
        for posture in q[:: max(1, len(q) // 20)]:
            if not faults(one, posture, tolerance):
                return np.array(posture)
    return None


def _all_that_may_meet(one: Scene) -> Iterator[tuple[int, Distance, Callable[[Array], Array]]]:
    """A solid of the arm, distances from what it must keep off, and their frame by those of the links."""
    robot, parts = one.robot, one.robot.solids
    for solid in one.solids:
        for k in range(len(parts)):
            yield k, distance_to(solid), _still(np.eye(4))
    body, T_base = base_body(robot), planar_pose(*one.base)
    for i, k in self_collision_pairs(robot):
        if i >= 0:
            yield k, _from_body(body_of(parts[i], np.eye(4))), _of_link(parts[i].link)
        elif body is not None:
            yield k, distance_to(body), _still(T_base)


def _still(T: Array) -> Callable[[Array], Array]:
    return lambda frames: T


def _of_link(link: int) -> Callable[[Array], Array]:
    return lambda frames: frames[:, link]


def _many(distance: Distance, points: Array) -> Array:
    parts = [distance(points[k : k + 20_000]) for k in range(0, len(points), 20_000)]
    return np.concatenate([np.zeros(0), *parts])


def _rows(part: LinkSolid) -> tuple[Array, float]:
    """Points of a solid in its link's frame, and what a solid must keep from them."""
    if isinstance(part, LinkBox):
        t = np.linspace(-0.5, 0.5, 4)
        grid = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3) * part.size
        return grid @ part.T_link_box[:3, :3].T + part.T_link_box[:3, 3], 0.0
    return part.corners[0] + np.linspace(0, 1, 9)[:, None] * np.diff(part.corners, axis=0), part.radius


def _round(one: Scene, tolerance: float) -> Array:
    """The target and points round the edge of what the tolerance allows, in the arm's base frame."""
    signs = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)]) * 0.999 * tolerance
    T = np.linalg.inv(one.robot.T_world_arm(one.base))
    goals: Array = (one.target + signs) @ T[:3, :3].T + T[:3, 3]
    return goals
