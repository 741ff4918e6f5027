"""Random arms, most on a vertical pivot, targets for them, and a search that knows nothing of reach."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import PathAreas
from regionik.mfabrik import solver_for
from regionik.planners.solvers.damped_least_squares import DIRECTION, POSITION, Aim, polish
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.postures.poses import pose_of
from regionik.regions import Area, admissible_area, path_areas
from regionik.scene import scene_of
from regionik.worlds.arms import pivot_index, reach_bound, with_pivot
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, rot_x, rot_y, rot_z, translation, within_half_turns
from regionik.worlds.joints import Joint
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World

KINDS = ("general", "lifted", "planar", "directed", "planar, lifted", "tilted")
TOLERANCE = 1e-3  # of solvers [m]
EXACT, ANGLE = 1e-6, 1e-4  # of the search [m], [rad]
STEPS = 60  # of damped least squares from one start


@dataclass(frozen=True, eq=False)
class Case:
    """A robot and a target above the origin, with nothing in the way."""

    kind: str
    world: World

    @property
    def target(self) -> Target:
        return self.world.task[0]

    def inner(self) -> PathAreas:
        return path_areas(scene_of(self.world))

    def area(self) -> Area:
        return admissible_area(self.world, self.target)


def case(number: int) -> Case:
    """The same case for the same number: kinds take turns, joints go from 3 to 7."""
    rng = np.random.default_rng(number)
    kind = KINDS[number % len(KINDS)]
    chain = _chain(kind, int(rng.integers(3, 8)), rng)
    robot = Robot(
        kind, "omni", np.zeros((1, 2)), np.array([0.0, 0.0, rng.uniform(0, 0.4), 0.0]), chain, (), 0.1,
        np.clip(np.zeros(chain.dof), chain.lower, chain.upper),
    )  # fmt: skip
    tool = robot.tool(np.zeros(3), _postures(chain, rng, 1)[0])
    direction, cone = None, 0.05
    if kind == "directed":
        direction, cone = tool[:3, 2], float(rng.uniform(0.05, 0.5))
    target = Target(np.array([0.0, 0.0, tool[2, 3]]), direction, cone)
    floor = Floor(shapely.box(-9, -9, 9, 9))
    return Case(kind, World(kind, robot, floor, (), (target,), Rules(clearance=0.0)))


def _chain(kind: str, dof: int, rng: np.random.Generator) -> Chain:
    T = translation(0, 0, rng.uniform(0, 0.3))
    if kind == "tilted":
        T = T @ rot_x(rng.uniform(0.1, np.pi)) @ translation(rng.uniform(0, 0.1), 0, 0)
    joints = [Joint("pivot", "revolute", *_limits(rng), T)]
    if "lifted" in kind:
        joints.insert(0, Joint("lift", "prismatic", 0.0, rng.uniform(0.1, 0.5), np.eye(4)))
    if kind in ("general", "lifted", "tilted"):
        for k in range(len(joints), dof):
            slides = rng.random() < 0.1
            limits = (0.0, rng.uniform(0.05, 0.3)) if slides else _limits(rng)
            T = translation(*rng.uniform(-0.3, 0.3, 3)) @ rot_z(rng.uniform(-3, 3))
            T = T @ rot_x(rng.choice([-np.pi / 2, np.pi / 2, 0.0, rng.uniform(-3, 3)]))
            joints.append(Joint(f"joint {k}", "prismatic" if slides else "revolute", *limits, T))
        return Chain(tuple(joints), translation(*rng.uniform(-0.2, 0.2, 3)))
    T = translation(rng.uniform(0, 0.1), 0, rng.uniform(0, 0.1)) @ rot_x(np.pi / 2)
    hinges = 3 if kind != "planar, lifted" else max(2, dof - 2)
    for k in range(hinges):
        joints.append(Joint(f"hinge {k}", "revolute", *_limits(rng), T))
        T = translation(rng.uniform(0.1, 0.4), 0, 0)
    if dof % 2:  # a roll about the last link
        joints.append(Joint("roll", "revolute", *_limits(rng), T @ rot_y(np.pi / 2)))
        return Chain(tuple(joints), translation(0, 0, rng.uniform(0, 0.1)))
    return Chain(tuple(joints), T @ rot_y(np.pi / 2))


def _limits(rng: np.random.Generator) -> tuple[float, float]:
    if rng.random() < 0.15:
        return -np.inf, np.inf
    middle, half = rng.uniform(-1, 1), rng.uniform(0.6, 2.8)
    return middle - half, middle + half


def _postures(chain: Chain, rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(*within_half_turns(chain.lower, chain.upper), (count, chain.dof))


def points_in(area: BaseGeometry, rng: np.random.Generator, count: int) -> Array:
    """Points (count, 2) drawn evenly from an area; none where it is empty."""
    found: list[Array] = []
    while not area.is_empty and sum(map(len, found)) < count:
        x0, y0, x1, y1 = area.bounds
        some = rng.uniform([x0, y0], [x1, y1], (50, 2))
        found.append(some[shapely.contains_xy(area, some)])
    return np.concatenate(found)[:count] if found else np.empty((0, 2))


def solved(one: Case, areas: PathAreas, row: int, spot: Array) -> bool:
    """Whether M-FABRIK's solver, its base held with the arm's axis on a spot, gets the tool to the target."""
    robot = one.world.robot
    solver = solver_for(scene_of(one.world), areas.family[row])
    base = pose_of(robot, spot, 0.0)
    return solver.hold(one.target, base, robot.carry).converged


def searched(one: Case, spot: Array, starts: int, rng: np.random.Generator) -> float:
    """Least distance that damped least squares from random postures leaves between tool and target [m]."""
    chain, mount = with_pivot(one.world.robot.chain), one.world.robot.mount
    pivot = pivot_index(chain)
    joints = [
        replace(j, lower=-np.inf, upper=np.inf) if k == pivot else j for k, j in enumerate(chain.joints)
    ]
    arm = serial_arm(Chain(tuple(joints), chain.T_last_tool))
    goal = np.array([*(one.target.position[:2] - spot), one.target.position[2] - mount[2]])
    turns = np.broadcast_to(np.eye(3), (starts, 3, 3)).copy()
    if one.target.direction is not None:
        turns[:, :, 2] = _within_cone(one.target.direction, one.target.cone, rng, starts)
    kind = POSITION if one.target.direction is None else DIRECTION
    least, reach = np.inf, reach_bound(chain).length
    for turn, q in zip(turns, _postures(chain, rng, starts), strict=True):
        error, angle, _ = polish(arm, Aim(goal, kind, turn), q, reach, EXACT, ANGLE, STEPS)
        if angle <= ANGLE:
            least = min(least, error)
        if least <= EXACT:
            break
    return least


def _within_cone(direction: Array, cone: float, rng: np.random.Generator, count: int) -> Array:
    """Unit vectors (count, 3) within an angle of a direction."""
    square = np.cross(rng.normal(size=(count, 3)), direction)
    square /= np.linalg.norm(square, axis=1)[:, None]
    angle = cone * np.sqrt(rng.random(count))[:, None]
    vectors: Array = np.cos(angle) * direction + np.sin(angle) * square
    return vectors
