"""Which solids of a robot may run into each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.robot import Robot, without_limits
from regionik.worlds.self_collision import BODY, base_body, self_collision_pairs
from tests.kinds import LinkSolid
from tests.maths import Array, translation
from tests.plans import motion_of, only, plan_of, world_of

SQUARE = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
POINT = np.zeros((1, 2))


def arm(
    solids: tuple[LinkSolid, ...], limit: float = 2.0, footprint: Array = POINT, height: float = 0.5
) -> Robot:
    """Four level hinges 0.3 m apart, mounted on a mast."""
    joints = tuple(
        Joint(f"j{k}", "revolute", -limit, limit, translation(x, 0, 0), np.array([0, 1.0, 0]))
        for k, x in enumerate((0.0, 0.3, 0.3, 0.3))
    )
    chain = Chain(joints, translation(0.3, 0, 0))
    mount = np.array([0.0, 0.0, height, 0.0])
    return Robot("arm", "omni", footprint, mount, chain, solids, 0.2, np.zeros(4))


def rod(link: int, start: float = 0.0, end: float = 0.3, radius: float = 0.03) -> LinkCapsule:
    return LinkCapsule(link, f"rod {link}", np.array([start, 0, 0]), np.array([end, 0, 0]), radius)


def block(link: int, size: tuple[float, float, float], x: float = 0.15) -> LinkBox:
    return LinkBox(link, f"block {link}", translation(x, 0, 0), np.array(size))


def test_the_bundled_robots() -> None:
    """The fourth link has no length, so no solid; the second begins in the base's body and stays there."""
    assert self_collision_pairs(robot_named("youbot")) == ((0, 2), (0, 3), (1, 3))
    assert self_collision_pairs(robot_named("youbot-real")) == ((BODY, 2), (BODY, 3), (0, 2), (0, 3), (1, 3))


def test_pairs_are_kept() -> None:
    robot = robot_named("youbot")
    assert self_collision_pairs(robot) is self_collision_pairs(robot)


def test_solids_of_one_link_and_of_neighbours_belong_together() -> None:
    robot = arm((rod(0), rod(1), block(1, (0.1, 0.1, 0.1)), rod(2), rod(3)))
    assert self_collision_pairs(robot) == ((0, 3), (0, 4), (1, 4), (2, 4))


def test_links_on_either_side_of_one_without_solids_are_no_neighbours() -> None:
    """Two joints fold one rod onto the other."""
    assert self_collision_pairs(arm((rod(0), rod(3)))) == ((0, 1),)
    assert self_collision_pairs(arm((rod(0), rod(2), rod(3)))) == ((0, 1), (0, 2))


def test_a_plan_in_which_such_links_overlap_is_refused() -> None:
    folded = np.array([0.0, 2.0, 2.0, 0.0])
    robot = arm((rod(0), rod(2)), height=1.0)
    motion = motion_of([(np.zeros(3), folded, "setpoint", 0), (np.zeros(3), folded, "step", 0)])
    assert only(verify(plan_of(world_of(motion, robot=robot), motion)), "self").text
    assert verify(plan_of(world_of(motion, robot=replace(robot, solids=(rod(0),))), motion)).ok


def test_order_of_the_solids_does_not_matter() -> None:
    assert self_collision_pairs(arm((rod(2), rod(0), rod(1)))) == ((0, 1),)


@pytest.mark.parametrize("shape", ["capsule", "box"])
def test_what_touches_in_every_posture_is_built_that_way(shape: str) -> None:
    def far(back: float) -> LinkSolid:
        if shape == "capsule":
            return rod(2, -back, 0.3)
        return block(2, (0.3 + back, 0.06, 0.06), 0.15 - back / 2)

    assert self_collision_pairs(arm((rod(0), rod(1), far(0.0)), limit=0.1)) == ((0, 2),)
    assert self_collision_pairs(arm((rod(0), rod(1), far(0.3)), limit=0.1)) == ()  # reaches back to joint 1


def test_joints_that_cannot_move_and_joints_without_end() -> None:
    assert self_collision_pairs(arm((rod(0), rod(1), rod(2, -0.3)), limit=0.0)) == ()
    free = without_limits(arm((rod(0), rod(1), rod(2))))
    assert self_collision_pairs(free) == ((0, 2),)
    half = [replace(joint, upper=np.inf) for joint in free.chain.joints]
    half[0] = replace(half[0], lower=4.0)
    assert self_collision_pairs(replace(free, chain=Chain(tuple(half), free.chain.T_last_tool))) == ((0, 2),)


def test_the_base_body_is_the_footprint_raised() -> None:
    body = base_body(arm((), footprint=SQUARE))
    assert body is not None
    assert (body.bottom, body.top, body.polygon.area) == (0.0, 0.2, pytest.approx(0.16))
    assert base_body(arm(())) is None


def test_the_base_against_all_links_but_the_first_with_a_solid() -> None:
    solids = (rod(1), rod(2), block(3, (0.3, 0.1, 0.1)))
    assert self_collision_pairs(arm(solids, footprint=SQUARE)) == ((BODY, 1), (BODY, 2), (0, 2))
    assert self_collision_pairs(arm(solids)) == ((0, 2),)


def test_what_always_stands_in_the_base_is_left_out() -> None:
    low = arm((rod(0), rod(1), rod(2)), limit=0.05, footprint=SQUARE * 10, height=0.1)
    assert self_collision_pairs(low) == ((0, 2),)


def test_pairs_that_are_named_need_not_keep_apart() -> None:
    robot = arm((rod(0), rod(1), rod(2), rod(3)))
    assert self_collision_pairs(robot) == ((0, 2), (0, 3), (1, 3))
    assert self_collision_pairs(replace(robot, unchecked=(("rod 3", "rod 0"),))) == ((0, 2), (1, 3))
