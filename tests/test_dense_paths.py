"""Dense paths of full poses from a base that stands, within the tolerances of CppFlow (RA-L 2024)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

import regionik as rik
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.known_arms import known_robot
from tests.maths import rot_z, translation

TOLERANCE, CONE = 1e-4, np.radians(0.1)  # as there [m], [rad]
LARGEST_TURN, LARGEST_SLIDE = np.radians(7.0), 0.02  # of a joint from pose to pose there [rad], [m]
PLACE = 1e-3  # half of the floor of a base that cannot drive [m]
PATHS = np.loadtxt(Path(__file__).parent / "data" / "cppflow_paths.csv", delimiter=",", skiprows=1)
TORSO = (-0.086875, 0.0, 0.37743)  # of Fetch, at its lowest, on its base [m]
# of Fetch from its lift on: place on the link before [m], axis, limits [m], [rad]
FETCH = (
    (TORSO, (0.0, 0.0, 1.0), 0.0, 0.38615),
    ((0.119525, 0.0, 0.34858), (0.0, 0.0, 1.0), -1.6056, 1.6056),
    ((0.117, 0.0, 0.06), (0.0, 1.0, 0.0), -1.221, 1.518),
    ((0.219, 0.0, 0.0), (1.0, 0.0, 0.0), -np.pi, np.pi),
    ((0.133, 0.0, 0.0), (0.0, 1.0, 0.0), -2.251, 2.251),
    ((0.197, 0.0, 0.0), (1.0, 0.0, 0.0), -np.pi, np.pi),
    ((0.1245, 0.0, 0.0), (0.0, 1.0, 0.0), -2.16, 2.16),
    ((0.1385, 0.0, 0.0), (1.0, 0.0, 0.0), -np.pi, np.pi),
)


def fetch(lift: bool) -> Robot:
    """Return a Fetch of capsules, whose torso goes up or stands at its lowest."""
    joints = tuple(
        Joint(
            f"joint_{k}", "revolute" if k else "prismatic", low, high if k or lift else low, translation(*at),
            np.array(axis),
        )
        for k, (at, axis, low, high) in enumerate(FETCH)
    )  # fmt: skip
    chain = Chain(joints, translation(0.16645, 0.0, 0.0))
    return Robot("Fetch", "omni", np.zeros((1, 2)), np.zeros(4), chain, capsules_along(chain, 0.03))


def panda() -> Robot:
    """Return a Panda of capsules, its tool the frame of the hand."""
    robot = known_robot("Panda")
    turned = robot.chain.T_last_tool @ rot_z(-np.pi / 4)
    return replace(robot, chain=replace(robot.chain, T_last_tool=turned))


def frame() -> tuple[Box, ...]:
    """Return four boards about the window through which Fetch draws a circle."""
    upright, level = (0.3, 0.05, 0.8), (0.3, 0.85, 0.05)
    places = ((0.4, 0.825, upright), (-0.4, 0.825, upright), (0.0, 1.225, level), (0.0, 0.425, level))
    return tuple(
        Box(f"board {k}", np.array(size), np.array([0.4, y, z])) for k, (y, z, size) in enumerate(places)
    )


@dataclass(frozen=True)
class Problem:
    """A path of CppFlow's, moved by an offset, of which every ``each``-th pose is planned."""

    robot: Robot
    offset: tuple[float, float, float]
    obstacles: tuple[Box, ...]
    each: int


CUBE = Box("cube", np.full(3, 0.25), np.array([0.0, 0.2, 0.7]))
PROBLEMS = {  # as they are numbered in the table of paths
    "hello_mini": Problem(fetch(lift=False), (0.713125, 0.45, 0.62743), (), 1),
    "circle": Problem(fetch(lift=True), (0.813125, 0.25, 0.83743), frame(), 5),
    "1cube": Problem(panda(), (0.0, 0.5421984559194368, 0.7885155964931997), (CUBE,), 5),
}


def world_of(name: str) -> World:
    problem, rows = PROBLEMS[name], PATHS[PATHS[:, 0] == list(PROBLEMS).index(name)]
    turns = Rotation.from_quat(rows[:, [5, 6, 7, 4]]).as_matrix()
    spots = rows[:, 1:4] + problem.offset
    task = tuple(Target(p, orientation=R, cone=CONE) for p, R in zip(spots, turns, strict=True))
    floor = Floor(shapely.box(-PLACE, -PLACE, PLACE, PLACE))
    rules = Rules(clearance=0.0, tolerance=TOLERANCE, solid_floor=False, heading="fixed", reach_margin=0.0)
    return World(name, problem.robot, floor, problem.obstacles, task, rules)


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_dense_path_is_done_in_one_stroke(name: str) -> None:
    """No lift, no pose missed, and no joint leaps from a pose to the next."""
    found = rik.plan(world_of(name))
    assert found.lift_offs == 0
    assert found.stats["largest_error"] <= TOLERANCE
    assert rik.verify(found).ok
    slides = np.array([joint.kind == "prismatic" for joint in found.world.robot.chain.joints])
    steps = np.abs(np.diff([one.joints for one in found.setpoints], axis=0)).max(axis=0)
    most = np.where(slides, LARGEST_SLIDE, LARGEST_TURN) * PROBLEMS[name].each
    assert (steps <= most).all()
