"""Links against each other and against the base: planted overlaps are found, free hops are proven."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from regionik.values import Motion
from regionik.verification.verifier import verify
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.robot import Robot
from tests.bodies import motion_through, random_robot, signed_distance
from tests.kinds import LinkSolid
from tests.maths import Array, rot_x, translation
from tests.plans import FOOTPRINT, Proof, far_off, motion_of, of_kind, plan_of, proofs_of, world_of, youbot
from tests.test_proximity import base_of

BEFORE = np.array([0.0, 0.521, -1.472, 0.083, 0.0])  # the hand on one side of the first links,
FOLDED = np.array([0.0, 0.484, -1.477, -0.393, 0.0])  # in them,
AFTER = np.array([0.0, 0.334, -1.5, -2.297, 0.0])  # and on the other
MEASURED = 0.05  # up to where margins go [m]
OPEN = np.array([0.0, 1.2, -1.0, 1.0, 0.0])


def check(robot: Robot, motion: Motion) -> Proof:
    return proofs_of(far_off(robot), motion, "self")[0]


def still(*joints: Array) -> Motion:
    return motion_through(np.zeros((len(joints), 3)), np.array(joints))


@contextmanager
def pairs_of(*pairs: tuple[int, int]) -> Iterator[None]:
    """Choose the pairs that count, whatever the robot's own would be."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("regionik.verification.self_collision.self_collision_pairs", lambda robot: pairs)
        yield


def clock(hand: LinkSolid, bar: LinkSolid | None = None) -> Robot:
    """A bar along x, and a hand that turns 0.3 m beside its middle in the level plane."""
    joints = (
        Joint("bar", "revolute", -3, 3, np.eye(4)),
        Joint("between", "prismatic", -3, 3, translation(0.5, 0.3, 0.0), np.array([1.0, 0, 0])),
        Joint("hand", "revolute", -9, 9, np.eye(4)),
    )
    bar = bar or LinkCapsule(0, "the bar", np.zeros(3), np.array([1.0, 0, 0]), 0.03)
    chain = Chain(joints, translation(0.1, 0, 0))
    return Robot("clock", "omni", np.zeros((1, 2)), np.zeros(4), chain, (bar, hand), 0.1, np.zeros(3))


def hand_of(gap: float, radius: float = 0.02) -> LinkCapsule:
    """A hand that comes within a gap of the bar when it points there."""
    return LinkCapsule(2, "the hand", np.zeros(3), np.array([0.3 - 0.03 - radius - gap, 0, 0]), radius)


def paddle(gap: float, size: float = 0.2) -> LinkBox:
    """A square whose corner comes within a gap of the bar 45 degrees before and after it points there."""
    reach = (0.3 - 0.03 - gap) / np.sqrt(2)
    T = translation(reach / 2, reach / 2, 0.0)
    return LinkBox(2, "the hand", T, np.array([reach, reach, size]))


def swing(start: float, end: float, shift: float = 0.0) -> Motion:
    return still(np.array([0.0, 0.0, start]), np.array([0.0, shift, end]))


@pytest.mark.parametrize("hand_at", [hand_of, paddle])
@pytest.mark.parametrize("gap", [-0.05, -1e-3, -1e-5, 0.0, 1e-5, 1e-3, 0.05])
def test_a_hand_that_sweeps_past_a_bar_between_two_states(hand_at: object, gap: float) -> None:
    robot = clock(hand_at(gap))  # type: ignore[operator]
    low = -np.pi / 2 if hand_at is hand_of else -3 * np.pi / 4
    found = check(robot, swing(low - 1.1, low + 0.7))
    assert bool(found.violations) == (gap < 0)
    for violation in found.violations:
        assert violation.kind == "self"
        assert violation.state == 0
        assert "the hand overlaps the bar by" in violation.text
        assert "between states 1 and 2 of 2" in violation.text
        assert 0 < violation.amount <= -gap + 1e-9


def test_a_sliding_joint_between_counts() -> None:
    """The hand points at the bar and is pushed through it, sideways past the bar's end."""
    hand = LinkCapsule(2, "the hand", np.zeros(3), np.array([0.35, 0, 0]), 0.02)
    down = -np.pi / 2
    assert check(clock(hand), still(np.array([0, 0.6, down]), np.array([0, 0.8, down]))).violations == ()
    found = check(clock(hand), still(np.array([0, 0.6, down]), np.array([0, -0.7, down])))
    assert [v.state for v in found.violations] == [0]
    assert "between" in found.violations[0].text


def test_driving_and_turning_of_the_base_changes_nothing() -> None:
    joints = np.array([[0.0, 0.0, -2.6], [0.4, 0.0, -1.0]])
    for gap in (1e-5, -1e-4):
        robot = clock(hand_of(gap))
        calm, wild = (
            check(robot, motion_through(base, joints))
            for base in (np.zeros((2, 3)), np.array([[0, 0, 0], [2, -1, 3.0]]))
        )
        assert calm == wild


def test_margin_is_the_least_distance_at_states() -> None:
    robot = clock(hand_of(0.012))
    assert check(robot, swing(-np.pi / 2, 1.0)).margin == pytest.approx(0.012, abs=1e-12)
    assert check(robot, swing(1.0, 2.0)).margin == MEASURED
    robot = clock(paddle(0.02))
    assert check(robot, swing(-3 * np.pi / 4, 1.0)).margin == pytest.approx(0.02, abs=1e-12)


@pytest.mark.parametrize(("gap", "holds"), [(1e-5, True), (0.0, True), (-2e-5, False), (-0.02, False)])
def test_two_boxes_edge_to_face(gap: float, holds: bool) -> None:
    bar = LinkBox(0, "the bar", translation(0.5, 0, 0), np.array([1.0, 0.06, 0.06]))
    length = 0.3 - 0.03 - gap
    hand = LinkBox(2, "the hand", translation(length / 2, 0, 0) @ rot_x(0.3), np.array([length, 0.001, 0.1]))
    found = check(clock(hand, bar), swing(-np.pi / 2, -np.pi / 2))
    assert (not found.violations) == holds
    assert found.margin == pytest.approx(gap, abs=1e-12)


def test_no_pairs_leave_nothing_to_measure() -> None:
    alone = replace(youbot(), solids=youbot().solids[:1])
    assert check(alone, still(FOLDED, OPEN)) == Proof(np.inf, ())


# Pairs as the robot has them


def test_a_folded_arm_is_found_at_its_state() -> None:
    found = check(youbot(), still(BEFORE, FOLDED, AFTER))
    assert [v.state for v in found.violations if "at state 2 of 3" in v.text] == [1]
    first = found.violations[0].text
    assert first == "link 5 (joint_5) overlaps link 1 (joint_1) by 0.0551 m at state 2 of 3"
    assert found.margin == -max(v.amount for v in found.violations)
    for free in (OPEN, BEFORE, AFTER):
        assert check(youbot(), still(free)).violations == ()


def test_an_arm_that_folds_through_itself_between_two_states() -> None:
    found = check(youbot(), still(BEFORE, AFTER))
    assert {(v.kind, v.state) for v in found.violations} == {("self", 0)}
    assert all("between states 1 and 2 of 2" in v.text for v in found.violations)
    assert check(youbot(), still(BEFORE, OPEN)).violations == ()


def test_the_hand_in_the_robots_own_base() -> None:
    """Down ahead of a point base is free; down over a footprint is not."""
    down = np.array([0.0, 0.9, -1.6, 0.1, 0.0])
    mount = (0.143, 0.0, 0.11, 0.0)
    robot = youbot(FOOTPRINT, mount)
    tool = robot.tool(np.zeros(3), down)[:3, 3]
    assert tool[2] < robot.body_height
    assert tool[0] < robot.footprint[:, 0].max()
    motion = motion_through(np.array([[0, 0, 0], [1, 2, 0.5]]), np.array([OPEN, down]))
    texts = [v.text for v in check(robot, motion).violations]
    depth = robot.body_height - tool[2] + 0.035
    said = f"link 5 (joint_5) overlaps the robot's own base by {depth:.4f} m"
    assert any(said in text for text in texts), texts
    assert not any("base" in v.text for v in check(youbot(mount=mount), motion).violations)
    assert check(robot, still(OPEN, OPEN)).violations == ()


def test_a_broken_plan_says_so() -> None:
    rows = [(np.zeros(3), q, "setpoint", i) for i, q in enumerate((BEFORE, FOLDED))]
    motion = motion_of(rows)
    report = verify(plan_of(world_of(motion), motion))
    found = of_kind(report, "self")
    assert (found[0].state, found[0].setpoint) == (1, 1)
    assert "(set-point 2 of 2)" in found[0].text
    assert report.margins["self"] == -found[0].amount


# Against samples


def solids_at(robot: Robot, joints: Array) -> list[Array]:
    """Corners of all solids, and of the base's body last, in the base's frame."""
    frames = robot.frames(np.zeros(3), joints)
    placed = [s.corners @ frames[s.link, :3, :3].T + frames[s.link, :3, 3] for s in robot.solids]
    body = base_of(robot)
    if body is None:
        return placed
    outline = np.asarray(body.polygon.exterior.coords)[:-1]
    ends = [np.column_stack([outline, np.full(len(outline), z)]) for z in body.z_range]
    return [*placed, np.vstack(ends)]


def sampled_gap(robot: Robot, joints: Array, pair: tuple[int, int], samples: int) -> float:
    radii = [*(solid.radius for solid in robot.solids), 0.0]
    least = np.inf
    for s in np.linspace(0, 1, samples):
        placed = solids_at(robot, joints[0] + s * (joints[1] - joints[0]))
        one, other = (placed[k] for k in pair)
        least = min(least, signed_distance(one, other) - radii[pair[0]] - radii[pair[1]])
    return least


def test_free_is_never_contradicted_by_samples() -> None:
    """Nor is an overlap told where samples find room."""
    rng = np.random.default_rng(7)
    told = {True: 0, False: 0}
    for trial in range(75):
        robot = random_robot(rng, 3, 0.15)
        pair = ((0, 2), (0, 1), (-1, 2))[trial % 3]
        scale = rng.choice([0.05, 0.4, 1.5])
        joints = np.cumsum(rng.normal(scale=[[0.3], [scale]], size=(2, 3)), axis=0)
        with pairs_of(pair):
            found = check(robot, still(*joints))
        gap = sampled_gap(robot, joints, pair, 25)
        told[not found.violations] += 1
        if not found.violations:
            assert gap >= -2e-6
        else:
            worst = max(v.amount for v in found.violations)
            assert worst > 0, found.violations
            assert not any("not proven" in v.text for v in found.violations)
            if any("at state" in v.text for v in found.violations):
                assert gap <= -worst + 1e-6
    assert min(told.values()) >= 8


def test_overlaps_are_as_deep_as_told() -> None:
    rng = np.random.default_rng(11)
    deep = 0
    for _ in range(30):
        robot = random_robot(rng, 2)
        joints = rng.normal(size=(1, 2))
        with pairs_of((0, 1)):
            found = check(robot, still(*joints))
        gap = sampled_gap(robot, np.repeat(joints, 2, 0), (0, 1), 1)
        told = -found.violations[0].amount if found.violations else found.margin
        assert told == pytest.approx(min(gap, MEASURED), abs=1e-6)
        deep += gap < -1e-6
    assert deep >= 2
