"""Joints that mimic others: loading, frames, derivatives, and the bounds that plans are proven by."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import shapely

from regionik.output.urdf import robot_to_urdf
from regionik.planners.collision.robot_motion import MobileArm, motion_between, speed_bounds
from regionik.planners.collision.upright_solids import uprights_from
from regionik.planners.reach.level_reach import inner_reach
from regionik.planners.search.motion_bounds import link_capsules
from regionik.planners.search.posture_boxes import NO_SELF_CLEARANCE, fixed_base_for, may_hold
from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.timing.limits import tool_velocity
from regionik.verification.motion import MotionSegments, chord_deviation
from regionik.worlds.arms import has_pivot, pivot_index, planar_arm
from regionik.worlds.documents.robots import robot_to_document
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Mimic
from regionik.worlds.links import capsules_along
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Target, World
from tests.bodies import motion_through
from tests.mimics import ARMS, PALLETIZER, TELESCOPE, arm, expanded, loaded, plain, postures, random_chain

STEP = 1e-6  # of differences [rad] or [m]

# --- loading


def test_the_coordinates_are_the_joints_that_move_by_themselves() -> None:
    chain = arm("telescope").chain
    assert chain.names == ("mast1", "turn", "stage1")
    assert chain.dof == 3
    assert [joint.name for joint in chain.joints] == ["mast1", "mast2", "turn", "stage1", "stage2", "stage3"]
    assert chain.upper == pytest.approx([0.4, 2.0, 0.1])  # as the second stage has an end
    assert chain.joints[-1].mimic == Mimic("stage1", 3.0, 0.015)
    assert (chain.joints[-1].lower, chain.joints[-1].upper) == pytest.approx((0.015, 0.315))
    assert [joint.velocity for joint in chain.active_joints] == pytest.approx([1.0, 1.0, 1 / 3])
    assert pivot_index(chain) == 1
    assert has_pivot(chain)
    assert arm("palletizer").chain.names == ("turn", "raise", "bend")
    assert {solid.link for solid in arm("telescope").solids} == set(range(6))


@pytest.mark.parametrize(
    ("mimic", "expected"),
    [
        ("stage3 1 0", "stage2: it copies joint stage2 .mimic., which does not move by itself"),
        ("end 1 0", "joint stage2: it copies joint end .mimic."),
        ("none 1 0", "unknown joint 'none'"),
        ("stage1 1 inf", "mimic offset: expected one finite number"),
    ],
)
def test_what_follows_no_joint_of_the_arm_is_refused(mimic: str, expected: str) -> None:
    leader, multiplier, offset = mimic.split()
    old = 'joint="stage1" multiplier="2.0" offset="0.01"'
    assert old in TELESCOPE
    new = f'joint="{leader}" multiplier="{multiplier}" offset="{offset}"'
    with pytest.raises(InputError, match=expected):
        loaded(TELESCOPE.replace(old, new))


def test_limits_that_leave_nothing_are_refused() -> None:
    with pytest.raises(InputError, match="joint stage1: expected lower limit <= upper limit"):
        loaded(TELESCOPE.replace('lower="0" upper="0.21"', 'lower="5" upper="6"'))


def test_arms_are_never_taken_for_planar_or_closed_ones() -> None:
    with pytest.raises(InputError, match="no joint may mimic another"):
        planar_arm(arm("palletizer").chain)


def test_a_joint_that_others_mimic_needs_limits() -> None:
    endless = loaded(PALLETIZER, limits="ignore")
    with pytest.raises(InputError, match="joint bend: a joint that others mimic needs limits"):
        inner_reach(endless.chain, 0.0)


@pytest.mark.parametrize("name", ARMS)
def test_world_files_keep_them(name: str) -> None:
    before = arm(name)
    world = World("kept", before, Floor(shapely.box(-1, -1, 1, 1)), (), (Target(np.array([0.5, 0, 0.5])),))
    after = world_from_document(world_to_document(world)).robot
    assert robot_to_document(after) == robot_to_document(before)
    q = postures(before.chain, 5)
    assert np.array_equal(after.chain.frames(q), before.chain.frames(q))


# --- kinematics


@pytest.mark.parametrize("name", ARMS)
def test_frames_are_those_of_the_joints_expanded_by_hand(name: str) -> None:
    chain = arm(name).chain
    for q in postures(chain, 20):
        assert chain.frames(q) == pytest.approx(plain(chain).frames(expanded(name, q)), abs=1e-12)


@pytest.mark.parametrize("name", ARMS)
def test_pinocchio_puts_the_tool_where_we_do(name: str) -> None:
    robot = arm(name)
    urdf = robot_to_urdf(robot, shapely.box(-3, -3, 3, 3))
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    tool = model.getFrameId("tool")
    bases = np.random.default_rng(1).uniform(-2, 2, (10, 3))
    for q, base in zip(postures(robot.chain, 10), bases, strict=True):
        values = [*base[:2], np.cos(base[2]), np.sin(base[2]), *expanded(name, q)]
        pin.framesForwardKinematics(model, data, np.array(values))
        assert data.oMf[tool].homogeneous == pytest.approx(robot.tool(base, q), abs=1e-9)


@pytest.mark.parametrize("name", ARMS)
def test_exported_urdf_keeps_the_mimic(name: str) -> None:
    robot = arm(name)
    again = loaded(robot_to_urdf(robot, shapely.box(-3, -3, 3, 3)), root="arm_base", tip="tool")
    assert again.chain.names == robot.chain.names
    assert [joint.mimic for joint in again.chain.joints] == [joint.mimic for joint in robot.chain.joints]
    assert again.chain.lower == pytest.approx(robot.chain.lower)
    assert again.chain.upper == pytest.approx(robot.chain.upper)
    q, origin = postures(robot.chain, 5), np.zeros((5, 3))
    assert again.tool(origin, q) == pytest.approx(np.linalg.inv(robot.T_base_arm) @ robot.tool(origin, q))


@pytest.mark.parametrize("seed", range(3))
def test_jacobians_are_derivatives(seed: int) -> None:
    chain = random_chain(seed)
    kernel = serial_arm(chain)
    for q in postures(chain, 5):
        frames, J = np.empty((len(chain.joints) + 1, 4, 4)), np.empty((6, chain.dof))
        chain_frames(kernel, q, frames)
        chain_jacobian(kernel, frames, J)
        assert frames == pytest.approx(chain.frames(q), abs=1e-12)
        for k, shift in enumerate(STEP * np.eye(chain.dof)):
            ahead, behind = chain.forward(q + shift), chain.forward(q - shift)
            slope = (ahead - behind) / (2 * STEP)
            spin = slope[:3, :3] @ frames[-1, :3, :3].T
            assert J[:3, k] == pytest.approx(slope[:3, 3], abs=1e-6)
            assert J[3:, k] == pytest.approx([spin[2, 1], spin[0, 2], spin[1, 0]], abs=1e-6)
        assert chain.point_jacobian(frames, frames[-1, :3, 3], len(chain.joints)) == pytest.approx(J[:3].T)
        assert chain.turn_jacobian(frames) == pytest.approx(J[3:].T)


@pytest.mark.parametrize("name", ARMS)
def test_the_tools_speed_is_that_of_all_joints(name: str) -> None:
    robot, rng = arm(name), np.random.default_rng(3)
    states = np.column_stack([rng.uniform(-1, 1, (8, 3)), postures(robot.chain, 8)])
    speeds = rng.normal(size=states.shape)
    behind, ahead = (
        robot.tool(s[:, :3], s[:, 3:])[:, :3, 3] for s in (states - STEP * speeds, states + STEP * speeds)
    )
    slope = (ahead - behind) / (2 * STEP)
    assert tool_velocity(robot, states, speeds) == pytest.approx(slope, abs=1e-6)


# --- bounds of motion, by which plans are proven


def _segments(seed: int) -> MotionSegments:
    chain, rng = random_chain(seed), np.random.default_rng([seed, 7])
    mount, solids = np.array([0.1, 0.0, 0.2, 0.3]), capsules_along(chain, 0.03)
    robot = Robot("random", "omni", np.zeros((1, 2)), mount, chain, solids)
    return MotionSegments(robot, motion_through(rng.uniform(-1, 1, (7, 3)), postures(chain, 7, seed)))


@pytest.mark.parametrize("seed", range(5))
def test_what_bounds_a_motion_counts_every_joint(seed: int) -> None:
    """Verifier and planner, each by its own code: no point is faster, nor farther off its chord."""
    segments = _segments(seed)
    robot, chain = segments.robot, segments.robot.chain
    mobile = MobileArm(serial_arm(chain), np.array(robot.T_base_arm), False)
    share, link = np.linspace(0, 1, 200), len(chain.joints) - 1
    points = np.random.default_rng(seed).uniform(-0.1, 0.1, (3, 3))
    for k in range(len(segments)):
        base, joints = (
            values(np.full(len(share), k), share) for values in (segments.base_at, segments.joints_at)
        )
        motion = motion_between(mobile, *(part[n] for n in (0, -1) for part in (base, joints)))
        T = robot.frames(base, joints)[:, link]
        speed, sharp = speed_bounds(mobile, motion, link, -2, points)
        for point in points:
            way = T[:, :3, :3] @ point + T[:, :3, 3]
            off = np.linalg.norm(way - way[0] - share[:, None] * (way[-1] - way[0]), axis=1).max()
            fast = np.linalg.norm(np.diff(way, axis=0), axis=1).max() / share[1]
            assert fast <= speed * (1 + 1e-9)
            assert off <= sharp / 8 + 1e-12
            bent = segments.acceleration_bound(link, point)[k]
            assert off <= chord_deviation(bent, np.ones(1)) + 1e-12
            relative = segments.relative_bounds(-1, link, point)
            still = chain.frames(joints)[:, link] @ np.append(point, 1.0)
            fast = np.linalg.norm(np.diff(still, axis=0), axis=1).max() / share[1]
            assert fast <= relative.speed[k] * (1 + 1e-9)
            assert np.linalg.norm(still[:, :3], axis=1).max() <= relative.distance[k] + 1e-12


def test_a_telescopes_speed_is_the_sum_of_its_stages() -> None:
    robot = arm("telescope")
    motion = motion_through(np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]]))
    bounds = MotionSegments(robot, motion).relative_bounds(-1, 5, robot.chain.T_last_tool[:3, 3])
    assert bounds.speed == pytest.approx([0.1 * (1 + 2 + 3)])


@pytest.mark.parametrize("seed", range(5))
def test_a_box_that_holds_a_posture_on_target_is_not_ruled_out(seed: int) -> None:
    """The posture is at a corner of its box, as far from the middle as any."""
    chain, rng = random_chain(seed), np.random.default_rng([seed, 9])
    capsules, none = link_capsules(chain, ()), uprights_from(())
    for q in postures(chain, 10, seed):
        wide = rng.choice([-1, 1], chain.dof) * 10.0 ** rng.uniform(-3, -0.5, chain.dof)
        target = chain.forward(q)[:3, 3]
        task = fixed_base_for(serial_arm(chain), capsules, none, target, 1e-6, 0.0, NO_SELF_CLEARANCE)
        assert may_hold(task, np.minimum(q, q + wide), np.maximum(q, q + wide))
