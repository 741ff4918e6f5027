"""Jobs that are not bundled: picking, drilling, recorded poses, other arms, criteria and errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.spatial.transform import Rotation, Slerp

from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.joints import Joint
from regionik.worlds.limits import Criteria, Execution, ParkingAccuracy
from regionik.worlds.links import LinkMass, capsules_along
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.furnished import disc
from tests.harness.rasters import carried
from tests.kinds import BaseKind, Solid
from tests.known_arms import known_robot
from tests.maths import translation
from tests.mimics import arm

POSES = Path(__file__).parents[1] / "data" / "panda_24_poses.csv"
PLACE = 1e-3  # half of the floor of a base that cannot drive [m]
WEIGHTS = 1.39, 1.32, 0.82, 0.77, 0.69  # of the links of a youBot [kg]
BENCH, TABLE, BOARD = (1.5, 2.0, 0.73), (4.5, 2.2, 0.73), (3.0, -1.6, 0.735)  # their middles [m]


def picks(count: int, base: BaseKind = "differential", **rules: Any) -> World:
    """Return objects on a bench, a large table and a shelf, picked in any order by a TIAGo's arm and lift."""
    robot = replace(known_robot("TIAGo"), base=base, footprint=disc(0.27), body_height=0.3)
    rng = np.random.default_rng(39)
    sizes = {BENCH: (1.6, 0.8), TABLE: (1.8, 1.8), BOARD: (2.0, 0.35)}
    solids = tuple(
        Box(f"board {k}", np.array([*size, 0.04]), np.array(middle))
        for k, (middle, size) in enumerate(sizes.items())
    )
    task = []
    for k in range(count):
        middle = list(sizes)[k % 3]
        half = np.array(sizes[middle]) / 2 - 0.05
        task.append(Target(np.array(middle) + [*rng.uniform(-half, half), 0.07]))
    asked = Rules(clearance=0.05, arm_clearance=0.01, mode="stops", order="any", stop_tolerance=0.03, **rules)
    return World("picks", robot, Floor(shapely.box(0, -2, 6, 4)), solids, tuple(task), asked)


def holes(rows: int = 4, columns: int = 5) -> World:
    """Return holes in an upright panel, drilled in any order by a UR5 on a base that cannot drive."""
    robot = replace(known_robot("UR5"), mount=np.array([0, 0, 0.3, 0]), body_height=0.3)
    grid = [(y, z) for z in np.linspace(0.35, 0.65, rows) for y in np.linspace(-0.2, 0.2, columns)]
    ahead = np.array([1.0, 0.0, 0.0])
    task = tuple(Target(np.array([0.5, y, z]), direction=ahead, cone=0.02) for y, z in grid)
    panel = Box("panel", np.array([0.02, 0.8, 0.6]), np.array([0.57, 0.0, 0.5]))
    rules = Rules(clearance=0.0, mode="stops", order="any", stop_tolerance=0.0, heading="fixed")
    floor = Floor(shapely.box(-PLACE, -PLACE, PLACE, PLACE))
    return World("holes", robot, floor, (panel,), task, rules, Start(np.zeros(3), robot.carry))


def poses_of_others(fixed: bool) -> World:
    """Return poses that were recorded for a Panda, from where it stood or from anywhere."""
    robot = replace(known_robot("Panda"), body_height=0.01)
    rows = np.loadtxt(POSES, delimiter=",", skiprows=1)
    turns = Rotation.from_quat(rows[:, 3:]).as_matrix()
    task = tuple(Target(p, orientation=R, cone=0.01) for p, R in zip(rows[:, :3], turns, strict=True))
    half = PLACE if fixed else 3.0
    rules = Rules(clearance=0.0, heading="fixed" if fixed else "free")
    start = Start(np.zeros(3), robot.carry) if fixed else None
    return World("poses", robot, Floor(shapely.box(-half, -half, half, half)), (), task, rules, start)


def smooth_poses(seed: int, arm: str, count: int = 12) -> World:
    """Return full poses along a random smooth curve, done from as few stops as can be."""
    rng = np.random.default_rng([seed, 5])
    at, s = np.linspace(0, 1, 4), np.linspace(0, 1, count)
    corners = np.cumsum([[0.3, 0.0, 1.0], *rng.uniform(-0.2, 0.2, (3, 3))], axis=0)
    down = Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(rng.uniform(-0.4, 0.4, (4, 3)))
    turns = Slerp(at, down)(s).as_matrix()
    spots = np.column_stack([np.interp(s, at, corners[:, k]) for k in range(3)])
    task = tuple(Target(p, orientation=R, cone=1e-3) for p, R in zip(spots, turns, strict=True))
    rules = Rules(clearance=0.0, tolerance=1e-5, mode="stops")
    return World(f"smooth {seed}", carried(arm), Floor(shapely.box(-3, -3, 3, 3)), (), task, rules)


def seam(robot: Robot, height: float, **rules: Any) -> World:
    """Return a wave beside a post, for an arm of any kind."""
    s = np.linspace(0, 1, 16)
    path = np.column_stack([1.2 * s, 0.15 * np.sin(5 * s), np.full(16, height)])
    post = Cylinder("post", 0.08, 1.2, np.array([0.6, -0.55, 0.6]))
    floor, asked = Floor(shapely.box(-1.5, -2, 3, 2)), Rules(clearance=0.03, step=0.2, **rules)
    return World(f"seam {robot.name}", robot, floor, (post,), tuple(map(Target, path)), asked)


def level_robot() -> Robot:
    """Return an arm of three hinges in one level plane."""
    chain = Chain(
        (
            Joint("j1", "revolute", -3.0, 3.0, np.eye(4)),
            Joint("j2", "revolute", -2.5, 2.5, translation(0.4, 0, 0)),
            Joint("j3", "revolute", -2.5, 2.5, translation(0.3, 0, 0)),
        ),
        translation(0.2, 0, 0),
    )
    solids = capsules_along(chain, 0.03)
    return Robot("level", "omni", disc(0.25), np.array([0, 0, 0.5, 0]), chain, solids, 0.4)


def mimicking(name: str) -> World:
    """Return a seam done by an arm with joints that mimic others."""
    return seam(arm(name), 0.95 if name == "telescope" else 0.4)


def mindful(criteria: Criteria) -> World:
    """Return a bundled world done by postures that meet criteria, masses on the arm."""
    world = load_world("l_shape")
    steps = [joint.T_parent_joint[:3, 3] for joint in world.robot.chain.joints[1:]]
    steps.append(world.robot.chain.T_last_tool[:3, 3])
    masses = tuple(LinkMass(k, WEIGHTS[k], step / 2) for k, step in enumerate(steps))
    robot = replace(world.robot, masses=masses, payload=0.5)
    return replace(world, robot=robot, rules=replace(world.rules, criteria=criteria))


def inexact(errors: Execution) -> World:
    """Return a path past a block, for a robot that is not where its plan has it."""
    robot = robot_named("youbot-real")
    block = Box("block", np.array([0.3, 0.3, 0.4]), np.array([0.6, -0.4, 0.2]))
    task = tuple(Target(np.array([x, 0.2, 0.3])) for x in np.linspace(0, 1.2, 9))
    rules = Rules(clearance=0.05, arm_clearance=0.01, execution=errors)
    return World("inexact", robot, Floor(shapely.box(-2, -2, 3, 2)), (block,), task, rules)


def parked(deviations: tuple[float, float, float], probability: float, **rules: Any) -> World:
    """Return holes in a row beside a post, for a base that parks with errors."""
    task = tuple(Target(np.array([x, 0.0, 0.3])) for x in np.linspace(0, 0.5, 6))
    post: tuple[Solid, ...] = (Cylinder("post", 0.1, 1.0, np.array([0.15, 0.8, 0.5])),)
    parking = ParkingAccuracy(np.diag(np.square(deviations)), probability)
    asked = Rules(clearance=0.05, mode="stops", parking=parking, **rules)
    return World("parked", robot_named("youbot-real"), Floor(shapely.box(-3, -2, 3, 2)), post, task, asked)
