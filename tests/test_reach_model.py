"""Models of reach: which arm gets which, and what they promise of each other."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.areas.free_space import spread
from regionik.mfabrik import solver_for
from regionik.pipeline import plan
from regionik.postures.families import BACK, FRONT, Family
from regionik.reach_table import reach_table
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.kinds import Goal
from tests.maths import rot_x
from tests.measures import axis_of, pose_of

FLOOR = Floor(shapely.box(-2, -2, 2, 2))


def across(robot: Robot) -> Robot:
    """The robot with its tool square to the last link."""
    return replace(robot, chain=Chain(robot.chain.joints, robot.chain.T_last_tool @ rot_x(np.pi / 2)))


def bounded(robot: Robot, half: float) -> Robot:
    """The robot with a pivot that turns by ``half`` either way."""
    pivot, *others = robot.chain.joints
    joints = replace(pivot, lower=-half, upper=half), *others
    return replace(robot, chain=Chain(joints, robot.chain.T_last_tool))


def targets(position: tuple[float, float, float]) -> dict[Goal, Target]:
    spot = np.array(position)
    return {
        "point": Target(spot),
        "direction": Target(spot, np.array([0.0, 0.0, -1.0]), 0.3),
        "orientation": Target(spot, cone=0.3, orientation=rot_x(np.pi)[:3, :3]),
    }


@pytest.mark.parametrize("name", ["youbot", "pioneer7"])
def test_inner_reach_lies_within_outer_reach(name: str) -> None:
    robot = robot_named(name)
    world = World("test", robot, FLOOR, task=tuple(targets((0.1, 0.2, 0.1)).values()))
    shapes = {}
    for inner in (True, False):
        which, families, rows = reach_table(scene_of(world), world.task, (FRONT, BACK), inner=inner)
        assert len(which) == len(families) == len(rows)
        assert (np.diff(which) >= 0).all()
        shapes[inner] = [shapely.union_all(rows[which == i]) for i in range(len(world.task))]
    for inside, around in zip(shapes[True], shapes[False], strict=True):
        assert inside.area > 0
        assert inside.difference(around).area < 1e-9


@pytest.mark.parametrize("name", ["youbot", "pioneer7"])
def test_rings_lie_at_the_distances_in_reach(name: str) -> None:
    world, z = World("test", robot_named(name), FLOOR), 0.3
    (spans,) = (
        scene_of(world).model(Target(np.array([0.0, 0.0, z]))).distances(None, np.array([z]), inner=True)
    )
    _, _, rows = reach_table(scene_of(world), [Target(np.array([0.0, 0.0, z]))], (FRONT, BACK), inner=True)
    corners = np.hypot(*shapely.get_coordinates(rows).T)
    assert all(((low <= corners) & (corners <= high)).any() for low, high in spans.tolist())
    assert ((spans[:, :1] <= corners) & (corners <= spans[:, 1:])).any(axis=0).all()


def test_rows_of_mixed_goals_are_those_of_each() -> None:
    world = World("test", across(robot_named("youbot")), FLOOR)
    asked = [target for spot in ((0.1, 0, 0.3), (0.5, 0.2, 0.2)) for target in targets(spot).values()]
    which, families, rows = reach_table(scene_of(world), asked, (FRONT,), inner=True)
    for i, target in enumerate(asked):
        _, some, alone = reach_table(scene_of(world), [target], (FRONT,), inner=True)
        assert shapely.equals_exact(rows[which == i], alone).all()
        assert tuple(families[k] for k in np.flatnonzero(which == i)) == some


def still(robot: Robot) -> Robot:
    """The robot with its arm on a first axis that leans."""
    first, *others = robot.chain.joints
    leaning = replace(first, T_parent_joint=rot_x(0.3) @ first.T_parent_joint)
    return replace(robot, chain=Chain((leaning, *others), robot.chain.T_last_tool))


@pytest.mark.parametrize("yaw", [0.0, 2.0])
@pytest.mark.parametrize("kind", ["point", "direction"])
@pytest.mark.parametrize("arm", [lambda robot: bounded(robot, 0.6), still])
def test_areas_at_a_fixed_heading_hold_postures_within_the_limits(
    arm: Callable[[Robot], Robot], kind: str, yaw: float
) -> None:
    """Such headings were refused. From places all over the area the arm reaches, the base as it stands."""
    robot = arm(robot_named("pioneer7"))
    base = np.array([0.3, -0.2, yaw])
    q = np.clip(robot.carry + 0.2, robot.chain.lower, robot.chain.upper)
    tool = robot.tool(base, q)
    target = Target(tool[:3, 3], direction=tool[:3, 2] if kind == "direction" else None, cone=0.2)
    world = World("test", robot, FLOOR, task=(target,), rules=Rules(heading="fixed"), start=Start(base, q))
    area = admissible_area(world, target).inner
    assert area.distance(shapely.Point(axis_of(robot, base))) < 0.03
    solver = replace(solver_for(scene_of(world), Family(FRONT)), span=(yaw, yaw))
    places = spread(area, 12, 0)
    met = [solver.self_motion(target, pose_of(robot, place, yaw), q, 24) for place in places]
    assert sum(map(bool, met)) >= 0.9 * len(places)
    for found in (one for some in met for one in some):
        assert found.base[2] == pytest.approx(yaw)
        assert (robot.chain.lower - 1e-9 <= found.joints).all()
        assert (found.joints <= robot.chain.upper + 1e-9).all()


def test_a_pivot_that_turns_once_round_plans_with_a_fixed_heading() -> None:
    task = tuple(Target(np.array([x, 0.1, 0.3])) for x in (0.2, 0.5, 0.8))
    world = World(
        "test", bounded(robot_named("pioneer7"), np.pi), FLOOR, task=task, rules=Rules(heading="fixed")
    )
    assert verify(plan(world)).ok
