"""Worlds built round a motion that is known to be free: the witness that a plan exists."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
import trimesh
from shapely.geometry.base import BaseGeometry

from regionik.values import Configuration, Motion, Plan, Stop
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.limits import Criteria, Speeds
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.grounds import mapped, outlined
from tests.kinds import Solid
from tests.maths import Array
from tests.opinion.quality import manipulability
from tests.random_arms import SIDES, random_robot
from tests.retold import machine_of

DRAWN = 400  # robots and motions, until one keeps off itself
BEND = 0.004  # of the tool's way between two set-points off the line that joins them [m]
MOST = 20  # set-points
STATES = 4  # from one set-point to the next
AWAY = 0.12  # from limits of joints [rad], or a share of a slide
ROOM = 0.3  # about base and arm that maps leave free [m]


@dataclass(frozen=True)
class TimedMotion:
    """Joint values and base poses over time: set-points from 0 to 1, the way to the first before 0."""

    robot: Robot
    base: Array  # (3,) at 0
    roll: Array  # (3,) ahead [m], aside [m] and turn [rad] until 1
    joints: Array  # (dof,) at 0
    bend: Array  # (dof,) until 1
    stands: bool  # the base stays where it is from 0 on

    def bases(self, time: Array) -> Array:
        """Return base poses (n, 3)."""
        share = np.minimum(time, 0.0) if self.stands else time
        ahead, aside, turn = self.roll
        # On wheels nothing goes aside, and what is rolled is an arc.
        half = share * turn / 2
        yaw = self.base[2] + half
        chord = share * ahead * np.sinc(half / np.pi)
        x = chord * np.cos(yaw) - share * aside * np.sin(self.base[2])
        y = chord * np.sin(yaw) + share * aside * np.cos(self.base[2])
        moved: Array = self.base + np.column_stack([x, y, 2 * half])
        return moved

    def arms(self, time: Array) -> Array:
        """Return joint values (n, dof)."""
        values: Array = self.joints + np.asarray(time)[:, None] * self.bend
        return values

    def tools(self, time: Array) -> Array:
        """Return tool frames (n, 4, 4)."""
        return self.robot.tool(self.bases(time), self.arms(time))


def witness(kind: str, seed: int) -> Plan:
    """Return a plan that `verify` accepts; its world is one for the planner to plan anew.

    Parameters
    ----------
    kind : str
        Of `tests.random_arms.KINDS`.
    seed : int
    """
    rng = np.random.default_rng([seed, *kind.encode()])
    for _ in range(DRAWN):
        motion = _random_motion(random_robot(kind, rng), rng)
        times = None if motion is None else _setpoint_times(motion)
        if motion is None or times is None:
            continue
        empty = _plan(motion, times, _world(f"{kind} {seed}", motion, times, rng))
        if verify(empty).ok:
            return _demanding(_among_obstacles(empty, rng), rng)
    raise RuntimeError(f"no witness of kind {kind} and seed {seed}")


def traits_of(world: World) -> tuple[str, ...]:
    """Return words for what a world has, by which the soak counts."""
    robot, task = world.robot, world.task[0]
    asked = "points" if task.direction is None else "directions" if task.orientation is None else "full poses"
    return (
        f"{robot.chain.dof} joints",
        f"base {robot.base}",
        "round footprint" if len(robot.footprint) == SIDES else "polygonal footprint",
        asked,
        *(["stops"] if world.rules.mode == "stops" else []),
        *(["a map"] if world.floor.cells else []),
        *(["meshes"] if any(isinstance(one, Mesh) for one in world.obstacles) else []),
        *(["speeds"] if world.speeds else []),
        *(["criteria"] if world.rules.criteria else []),
    )


def _random_motion(robot: Robot, rng: np.random.Generator) -> TimedMotion | None:
    """Return a motion within the limits that keeps the tool over the floor, None where that failed."""
    chain = robot.chain
    slide = np.array([joint.kind == "prismatic" for joint in chain.joints])
    low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
    high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
    away = np.where(slide, AWAY * (high - low), AWAY)
    low, high = low + away, high - away
    joints = rng.uniform(low, high)
    bend = rng.uniform(-0.8, 0.8, chain.dof) * np.where(slide, 0.2, 1.0)
    bend = np.clip(bend, (low - joints) / 1.0, (high - joints) / 1.0)  # until 1 ...
    bend = -np.clip(-bend, (low - joints) / 0.5, (high - joints) / 0.5)  # ... and from -0.5
    ahead, aside, turn = rng.uniform([-0.8, -0.5, -0.8], [0.8, 0.5, 0.8])
    if robot.drive.rolls:
        aside = 0.0
    if robot.turning_radius:
        turn = np.clip(
            turn, -abs(ahead) / robot.turning_radius / 1.01, abs(ahead) / robot.turning_radius / 1.01
        )
    if not robot.drive.rolls and rng.random() < 0.3:
        turn = 0.0
    base = np.array([*rng.uniform([0.2, -0.8], [2.2, 0.8]), rng.uniform(-np.pi, np.pi)])
    motion = TimedMotion(robot, base, np.array([ahead, aside, turn]), joints, bend, bool(rng.random() < 0.35))
    height = motion.tools(np.linspace(-0.5, 1, 13))[:, 2, 3]
    return motion if height.min() > 0.08 else None


def _setpoint_times(motion: TimedMotion) -> Array | None:
    """Return times of so many set-points that lines from one to the next are near the tool's way."""
    count = 3
    while count <= MOST:
        times = np.linspace(0, 1, count)
        ends = motion.tools(times)[:, :3, 3]
        middle = motion.tools((times[:-1] + times[1:]) / 2)[:, :3, 3]
        if np.linalg.norm(middle - (ends[:-1] + ends[1:]) / 2, axis=1).max() < BEND:
            return times if np.linalg.norm(np.diff(ends, axis=0), axis=1).min() > 0.005 else None
        count += 2
    return None


def _world(name: str, motion: TimedMotion, times: Array, rng: np.random.Generator) -> World:
    """Return a world without obstacles; rules, poses and floor are drawn."""
    begin = -0.5 if rng.random() < 0.6 else 0.0
    is_fixed = begin < 0 and motion.robot.base == "omni" and motion.roll[2] == 0 and rng.random() < 0.5
    rules = Rules(
        clearance=float(rng.choice([0.0, rng.uniform(0.0, 0.15)])),
        arm_clearance=float(rng.choice([0.0, rng.uniform(0.0, 0.02)])),
        step=float(rng.uniform(0.05, 0.25)),
        tolerance=float(rng.choice([1e-4, 1e-3])),
        heading="fixed" if is_fixed else "free",
        mode="stops" if motion.stands and rng.random() < 0.6 else "continuous",
        stop_tolerance=float(rng.uniform(0.0, 0.004)),
    )
    frames, asked, cone = motion.tools(times), rng.integers(3), float(rng.uniform(0.05, 0.4))
    task = tuple(
        Target(
            T[:3, 3],
            direction=T[:3, 2] if asked == 1 else None,
            orientation=T[:3, :3] if asked == 2 else None,
            cone=cone,
        )
        for T in frames
    )
    first = np.array([begin])
    start = Start(motion.bases(first)[0], motion.arms(first)[0]) if begin < 0 or rng.random() < 0.5 else None
    speeds = None
    if rng.random() < 0.25:
        speeds = Speeds(
            joint_velocity=float(rng.uniform(0.3, 2.0)), base_velocity=float(rng.uniform(0.1, 1.0))
        )
    return World(name, motion.robot, _floor(motion, rules, rng), (), task, rules, start, speeds=speeds)


def _floor(motion: TimedMotion, rules: Rules, rng: np.random.Generator) -> Floor:
    """Return a hall, an outline with bays and holes, or a map, in which there is room for the motion."""
    kept = _swept(motion, rules.clearance + ROOM)
    match rng.integers(3):
        case 0:
            return Floor(shapely.union_all([shapely.box(-1.5, -2.0, 4.0, 2.0), kept]).convex_hull)
        case 1:
            return outlined(rng, kept)
        case _:
            return mapped(rng, kept)


def _swept(motion: TimedMotion, room: float) -> BaseGeometry:
    """Return the floor under base and arm on their way, and ``room`` beyond [m]."""
    time = np.linspace(-0.5, 1, 31)
    bases, joints = motion.bases(time), motion.arms(time)
    frames = motion.robot.frames(bases, joints)[..., :2, 3]
    shapes = []
    for (x, y, yaw), links in zip(bases, frames, strict=True):
        c, s = np.cos(yaw), np.sin(yaw)
        corners = motion.robot.footprint @ np.array([[c, s], [-s, c]]) + [x, y]
        shapes.append(shapely.MultiPoint(np.vstack([corners, links])).convex_hull)
    return shapely.union_all(shapes).buffer(room)


def _plan(motion: TimedMotion, times: Array, world: World) -> Plan:
    """Return the motion as a plan of a world."""
    on_path = np.linspace(0, 1, (len(times) - 1) * _pieces(motion, times, world) + 1)
    kinds = ["setpoint" if np.isclose(times, t, atol=1e-9).any() else "step" for t in on_path]
    behind = np.searchsorted(times, on_path + 1e-9) - 1
    lead = np.empty(0)
    if world.start is not None and not np.array_equal(world.start.joints, motion.arms(np.zeros(1))[0]):
        lead = np.linspace(-0.5, 0, int(np.ceil(0.5 * _length(motion) / world.rules.step * 1.1)) + 3)[:-1]
    when = np.concatenate([lead, on_path])
    bases, joints = motion.bases(when), motion.arms(when)
    states = Motion(
        base=bases,
        joints=joints,
        kind=np.array(["transit"] * len(lead) + kinds),
        setpoint=np.concatenate([np.full(len(lead), -1), behind]),
        time=np.full(len(when), np.nan),
    )
    at = [len(lead) + k for k, kind in enumerate(kinds) if kind == "setpoint"]
    found = tuple(Configuration(bases[k], joints[k], 0.0, 0, True) for k in at)
    rules, stops = world.rules, tuple[Stop, ...]()
    if rules.mode == "stops":
        stops = (Stop(bases[-1], tuple(range(len(times))), rules.stop_tolerance, rules.stop_criterion),)
    return Plan(world, 0, found, states, (), 0, stops)


def _length(motion: TimedMotion) -> float:
    """Return what the base rolls and slides from 0 to 1 [m]."""
    return float(np.hypot(*motion.roll[:2]))


def _pieces(motion: TimedMotion, times: Array, world: World) -> int:
    """Return into how many hops the way to the next set-point is cut."""
    hops = _length(motion) / (len(times) - 1) / world.rules.step
    return max(STATES, int(np.ceil(1.1 * hops)))


def _among_obstacles(plan: Plan, rng: np.random.Generator) -> Plan:
    """Return the same with things about it, those that `verify` finds in its way left out."""
    world, places = plan.world, np.vstack([plan.motion.base[:, :2], plan.tools()[:, :2]])
    points = np.array([target.position for target in world.task])
    berth = world.rules.arm_clearance + 0.05
    kept: list[Solid] = []
    for k in range(rng.integers(0, 9)):
        solid = random_solid(f"thing {k}", places[rng.integers(len(places))] + rng.normal(0, 0.45, 2), rng)
        near = min(solid.distance(point) for point in points) < berth
        if not near and verify(replace(plan, world=replace(world, obstacles=(solid,)))).ok:
            kept.append(solid)
    document = world_to_document(replace(world, obstacles=tuple(kept)))
    found = replace(plan, world=world_from_document(document, where=world.name))
    return found if verify(found).ok else plan


def _demanding(plan: Plan, rng: np.random.Generator) -> Plan:
    """Return the same, now and then under criteria that its postures meet."""
    if rng.random() > 0.25:
        return plan
    robot = replace(plan.world.robot, payload=float(rng.uniform(0.2, 1.5)))
    joints = plan.motion.joints[plan.motion.kind == "setpoint"]
    machine, still = machine_of(replace(plan.world, robot=robot)), np.zeros(3)
    known = [machine.configuration(still, one) for one in joints]
    least = min(manipulability(machine, q) for q in known)
    most = max(float(np.abs(machine.efforts(q)).max()) for q in known)
    asked = rng.integers(3)
    criteria = Criteria(
        manipulability=rng.uniform(0.3, 0.9) * least if asked != 1 else None,
        effort=rng.uniform(1.1, 2.0) * most if asked != 0 else None,
    )
    world = replace(plan.world, robot=robot, rules=replace(plan.world.rules, criteria=criteria))
    found = replace(plan, world=world)
    return found if verify(found).ok else plan


def random_solid(name: str, place: Array, rng: np.random.Generator) -> Solid:
    """Return a solid of any kind near a place (2,), standing on the floor or hanging over it."""
    x, y = place
    tall = float(rng.uniform(0.05, 1.0))
    z = float(rng.choice([0.0, rng.uniform(0.0, 1.2)]))
    middle = np.array([x, y, z + tall / 2])
    match rng.integers(7):
        case 0:
            return Box(
                name, np.array([*rng.uniform(0.02, 0.8, 2), tall]), middle, float(rng.uniform(0, np.pi))
            )
        case 1:
            return Cylinder(name, float(rng.uniform(0.02, 0.25)), tall, middle)
        case 2:
            return Sphere(name, float(rng.uniform(0.03, 0.2)), np.array([x, y, z + 0.2]))
        case 3:
            board = np.array([*rng.uniform(0.2, 0.8, 2), rng.uniform(0.01, 0.05)])
            return Box(name, board, np.array([x, y, rng.uniform(0.3, 1.3)]), float(rng.uniform(0, np.pi)))
        case 4:
            angles = np.sort(rng.uniform(0, 2 * np.pi, 8))
            rim = rng.uniform(0.05, 0.35, (8, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
            parts = shapely.get_parts(shapely.Polygon(rim + [x, y]).buffer(0.01, 1))
            return Prism(name, parts[np.argmax(shapely.area(parts))], z, z + tall)
        case 5:
            rock = trimesh.convex.convex_hull(rng.uniform(-0.25, 0.25, (12, 3)) + middle)
            return Mesh(name, rock.vertices, rock.faces)
        case _:
            inner = float(rng.uniform(0.05, 0.3))
            ring = trimesh.creation.annulus(inner, inner + 0.08, tall, sections=12)
            turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
            return Mesh(name, trimesh.transform_points(ring.vertices, turn) + middle, ring.faces)
