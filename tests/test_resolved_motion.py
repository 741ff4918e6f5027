"""Base and joints together: the tool on its path, hops as the base drives, nothing past its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regionik.moving.path_following import ResolvedMotion
from regionik.postures.poses import Pose, arrays
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Sphere
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.kinds import BaseKind
from tests.maths import Array
from tests.measures import deviation

RADIUS = 0.8  # of the car's arcs [m]
POSTURE = np.array([0.2, 0.6, 0.7, 0.5, 0.0])  # of the youbot
FLOOR = Floor(shapely.box(-5, -5, 5, 5))


def world_of(base: BaseKind, way: Array, *solids: Sphere, posture: Array = POSTURE) -> tuple[World, Pose]:
    """The youbot's arm on a base, at the first of two targets a way apart."""
    robot = replace(robot_named("youbot"), base=base, turning_radius=RADIUS * (base == "car"))
    here = Pose(np.array([0.3, -0.2, 0.4]), posture)
    tool = robot.tool(here.base, here.joints)[:3, 3]
    return World("rolling", robot, FLOOR, solids, (Target(tool), Target(tool + way)), Rules()), here


@pytest.mark.parametrize("base", ["differential", "car", "omni"])
@given(bearing=st.floats(-np.pi, np.pi), far=st.floats(0.01, 0.15))
def test_the_tool_is_led_as_the_base_drives(base: BaseKind, bearing: float, far: float) -> None:
    way = far * np.array([np.cos(bearing), np.sin(bearing), 0.1])
    world, here = world_of(base, way)
    states = ResolvedMotion(scene_of(world), scene_of(world).collision).onward(0, here)
    assert states is not None
    robot, (bases, joints) = world.robot, arrays([here, *states])
    tools = robot.tool(bases, joints)[:, :3, 3]
    share = (tools - tools[0]) @ way / (way @ way)
    assert np.abs(tools - tools[0] - share[:, None] * way).max() < 1e-6
    assert share[-1] == pytest.approx(1, abs=1e-6 / far)
    assert (np.diff(share) > 0).all()
    slid, length = robot.drive.parts(bases[:-1], bases[1:])
    assert base == "omni" or np.abs(slid[:, :2]).max() < 1e-12
    assert (np.abs(slid[:, 2]) * robot.drive.turning_radius <= np.abs(length) + 1e-9).all()
    assert (joints >= robot.chain.lower).all()
    assert (joints <= robot.chain.upper).all()


@given(bearing=st.floats(-np.pi, np.pi), tilt=st.floats(-0.2, 0.2), cone=st.floats(0.005, 0.2))
def test_the_tool_turns_within_its_cone(bearing: float, tilt: float, cone: float) -> None:
    """Wherever in it the tool begins; half of it is left for the way between states."""
    world, here = world_of("omni", 0.05 * np.array([np.cos(bearing), np.sin(bearing), 0.5]))
    axis = world.robot.tool(here.base, here.joints)[:3, 2]
    wished = Rotation.from_rotvec(tilt * np.array([np.cos(bearing), np.sin(bearing), 0.0])).apply(axis)
    task = tuple(replace(target, direction=wished, cone=2 * (abs(tilt) + cone)) for target in world.task)
    states = ResolvedMotion(scene_of(replace(world, task=task)), scene_of(world).collision).onward(0, here)
    assert states is not None
    for pose in states:
        turned = deviation(task[1], world.robot.tool(pose.base, pose.joints)[:3, :3])
        assert turned <= task[1].cone / 2 + 1e-5


@given(
    joint=st.integers(0, 3), upper=st.booleans(), bearing=st.floats(-np.pi, np.pi), up=st.floats(-0.3, 0.3)
)
def test_a_joint_next_to_its_limit_stays_within(joint: int, upper: bool, bearing: float, up: float) -> None:
    chain = robot_named("youbot").chain
    near = chain.upper - 1e-3 if upper else chain.lower + 1e-3
    posture = np.where(np.arange(5) == joint, near, POSTURE)
    world, here = world_of("omni", np.array([np.cos(bearing), np.sin(bearing), up]) * 0.05, posture=posture)
    collision = scene_of(replace(world, rules=Rules(avoidance=False))).collision
    for pose in ResolvedMotion(scene_of(world), collision).onward(0, here) or ():
        assert (pose.joints >= chain.lower).all()
        assert (pose.joints <= chain.upper).all()


def test_a_fixed_heading_is_kept() -> None:
    world, here = world_of("omni", np.array([0.05, 0.1, 0.0]))
    fixed = replace(world, rules=Rules(heading="fixed"), start=Start(here.base, here.joints))
    turned, kept = (
        ResolvedMotion(scene_of(one), scene_of(one).collision).onward(0, here) for one in (world, fixed)
    )
    assert turned is not None
    assert kept is not None
    assert turned[-1].base[2] != here.base[2]
    assert all(pose.base[2] == here.base[2] for pose in kept)


def test_what_is_in_the_way_is_not_touched() -> None:
    way = np.array([0.12, 0.0, 0.0])
    world, here = world_of("differential", way)
    tool = world.task[0].position
    assert ResolvedMotion(scene_of(world), scene_of(world).collision).onward(0, here) is not None
    ball = Sphere("ball", 0.03, tool + 0.5 * way + [0.0, 0.0, 0.02])
    world = world_of("differential", way, ball)[0]
    assert ResolvedMotion(scene_of(world), scene_of(world).collision).onward(0, here) is None


@pytest.mark.parametrize("base", ["differential", "omni"])
def test_links_go_round_what_is_in_their_way(base: BaseKind) -> None:
    """A ball where the least motion would lead a link."""
    way = np.array([0.0, 0.0, -0.1])
    world, here = world_of(base, way)
    plain = ResolvedMotion(scene_of(world), scene_of(world).collision).onward(0, here)
    assert plain is not None
    elbow, tool = world.robot.frames(plain[-1].base, plain[-1].joints)[[3, -1], :3, 3]
    world = world_of(base, way, Sphere("ball", 0.02, 0.6 * elbow + 0.4 * tool - [0.0, 0.0, 0.03]))[0]
    collision = scene_of(world).collision
    assert collision.clear(here)
    assert not collision.passes([here, *plain])
    round_it = ResolvedMotion(scene_of(world), collision).onward(0, here)
    assert round_it is not None
    assert collision.passes([here, *round_it])


def test_what_only_the_next_target_asks_for_is_met_there() -> None:
    world, here = world_of("omni", np.array([0.05, 0.0, 0.0]))
    frame = world.robot.tool(here.base, here.joints)[:3, :3]
    tilted = Rotation.from_rotvec([0.0, 0.06, 0.0]).as_matrix() @ frame[:, 2]
    first, then = world.task[0], Target(world.task[1].position, direction=tilted, cone=0.01)
    world = replace(world, task=(first, then))
    states = ResolvedMotion(scene_of(world), scene_of(world).collision).onward(0, here)
    assert states is not None
    tool = world.robot.tool(states[-1].base, states[-1].joints)
    assert deviation(then, tool[:3, :3]) <= then.cone + 1e-6
