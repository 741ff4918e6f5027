"""Random worlds with things as high as the arm, for every robot: a plan that holds, or the reason."""

from collections import Counter

import numpy as np
import pytest
import shapely

from regionik.pipeline import plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.kinds import Solid
from tests.maths import Array
from tests.random_arms import span_of

ROBOTS = ("youbot", "youbot-real", "hinge5", "dof10", "pioneer7")
PLANAR = ROBOTS[:2]  # whose arms move in one plane
FLOOR = Floor(shapely.box(-1.2, -1.5, 2.5, 1.5))
CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
FACES = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def overhead_world(seed: int, most: int = 12) -> World:
    """A short path among boards, posts, balls and a mesh, many of which hang over the floor."""
    rng = np.random.default_rng(seed)
    robot = robot_named(ROBOTS[seed % len(ROBOTS)])
    path = random_path(robot, int(rng.integers(1, most)), rng)
    arm_clearance = float(rng.choice([0.0, 0.005, 0.02, 0.05]))
    solids = tuple(random_solid(k, path, rng) for k in range(rng.integers(1, 12)))
    if rng.random() < 0.9:  # a set-point too near to a solid is a no at once
        berth = arm_clearance + robot.solids[-1].radius + 0.005
        solids = tuple(one for one in solids if min(one.distance(spot) for spot in path) > berth)
    planar = robot.name in PLANAR
    direction = np.array([0.0, 0.0, -1.0]) if planar and rng.random() < 0.15 else None
    free = np.isinf(robot.chain.upper[0]) or planar
    rules = Rules(
        clearance=float(rng.uniform(0, 0.15)),
        arm_clearance=arm_clearance,
        step=float(rng.uniform(0.05, 0.2)),
        heading=rng.choice(["free", "face_target", "fixed"] if free else ["free", "face_target"]),
        tool_contact=float(rng.choice([0.0, 0.05])),
    )
    start = Start(np.array([-0.7, 0, rng.uniform(-3, 3)]), robot.carry) if rng.random() < 0.8 else None
    task = tuple(Target(spot, direction, 0.4) for spot in path)
    return World(f"overhead {seed}", robot, FLOOR, solids, task, rules, start)


def random_path(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    middle, length = span_of(robot.chain)
    low, high = middle + np.array([-0.4, 0.6]) * length
    share = np.linspace(0, 1, count)
    along = rng.uniform(0, 0.3) + share * rng.uniform(0.1, 1.2)
    aside = rng.uniform(0.0, 0.3) * np.sin(share * rng.uniform(1, 8))
    height = rng.uniform(max(low, 0.1), min(high, 0.75)) + 0.05 * np.sin(5 * share)
    return np.column_stack([along, aside, height])


def random_solid(k: int, path: Array, rng: np.random.Generator) -> Solid:
    """Near the path, from 0.2 to 0.8 m above the floor, a few of them standing on it."""
    x, y, _ = path[rng.integers(len(path))] + rng.normal(0.0, [0.2, 0.2, 0.0])
    z = float(rng.uniform(0.2, 0.8))
    kind = rng.integers(6)
    if kind == 0:
        size = np.array([*rng.uniform(0.1, 0.8, 2), rng.uniform(0.01, 0.05)])
        return Box(f"board {k}", size, np.array([x, y, z]), float(rng.uniform(0, np.pi)))
    if kind == 1:
        return Cylinder(f"post {k}", float(rng.uniform(0.02, 0.08)), 0.8, np.array([x, y, 0.4]))
    if kind == 2:
        height = float(rng.uniform(0.1, 0.6))
        return Cylinder(
            f"hanging {k}", float(rng.uniform(0.02, 0.1)), height, np.array([x, y, z + height / 2])
        )
    if kind == 3:
        return Sphere(f"ball {k}", float(rng.uniform(0.03, 0.15)), np.array([x, y, z]))
    if kind == 4:
        corner = shapely.Polygon([(x, y), (x + 0.4, y), (x + 0.4, y + 0.1), (x + 0.1, y + 0.1), (x, y + 0.4)])
        return Prism(f"corner {k}", corner, z, z + float(rng.uniform(0.02, 0.2)))
    return Mesh(f"mesh {k}", CORNERS * rng.uniform(0.05, 0.25) + np.array([x, y, z]), FACES)


def outcome(world: World) -> str:
    """The verdict, after what every answer must hold has been looked at."""
    try:
        found = plan(world)
    except NoPlanFound as failure:
        why = failure.explanation
        assert why.reason
        assert "\n" not in why.reason
        assert why.verdict != "plan-invalid", why.reason
        assert why.verdict != "no-posture" or why.causes, why.reason
        return why.verdict
    assert verify(found).ok
    return "planned"


@pytest.mark.slow
def test_every_world_is_planned_or_explained() -> None:
    outcomes = Counter(outcome(overhead_world(seed, most=6)) for seed in range(18))
    assert outcomes["planned"] > 8
