"""How deep a tool may sink into what it touches, and with how much of its link."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.explain.arm_failures import target_in_solid
from regionik.planners.collision.contacts import farthest_below as compiled_farthest
from regionik.planners.collision.distances import obstacles_from
from regionik.planners.collision.robot_bodies import core_of
from regionik.postures.poses import Pose
from regionik.scene import scene_of
from regionik.values import Report
from regionik.verification.contact import (
    SweptSolids,
    ToolContact,
    farthest_below_planes,
    is_allowed,
    shrunk_weights,
)
from regionik.verification.verifier import verify
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Sphere
from regionik.worlds.robot import Robot
from tests import examples
from tests.kinds import LinkSolid, Solid
from tests.maths import Array, translation
from tests.plans import RULES, Q, motion_of, of_kind, only, plan_of, world_of, youbot
from tests.test_proximity import box_mesh

TIP = youbot().tool(np.zeros(3), Q)
STANDING = np.zeros(3)


def gripper(beyond: float, wide: float = 0.04) -> Robot:
    """The arm with a box on its last link, which ends so far beyond the tool point."""
    long, robot = 0.1 + beyond, youbot()
    tool = float(robot.chain.T_last_tool[2, 3])
    box = LinkBox(4, "gripper", translation(0, 0, tool + beyond - long / 2), np.array([wide, wide, long]))
    return replace(robot, solids=(*robot.solids[:-1], box))


def facing(mesh: bool = False, gap: float = 0.0) -> Solid:
    """A plate square to the tool's axis, so far before it; a box stands for it where the axis is level."""
    at = TIP[:3, 3] + gap * TIP[:3, 2]
    along, side = TIP[:3, 2], np.eye(3)
    side = np.linalg.qr(np.column_stack([along, side[:, :2]]))[0]
    if side[:, 0] @ along < 0:
        side[:, 0] *= -1
    if np.linalg.det(side) < 0:
        side[:, 2] *= -1
    cube = box_mesh([0.0, -0.3, -0.3], [0.2, 0.3, 0.3])
    return Mesh("wall", cube.vertices @ side.T + at, cube.faces)


def held(robot: Robot, *solids: Solid, back: float = 0.0, **rules: float) -> Report:
    """The tool is at its only set-point, and goes back along its axis."""
    rows = [(STANDING, Q, "setpoint", 0)]
    if back:
        rows.append((np.array([*(-back * TIP[:2, 2]), 0.0]), Q, "transit", -1))
    motion = motion_of(rows)
    world = world_of(motion, *solids, robot=robot, rules=replace(RULES, clearance=0.0, **rules))  # type: ignore[arg-type]
    return verify(plan_of(world, motion, int(back > 0)))


def test_a_gripper_far_inside_a_wall_is_refused() -> None:
    found = only(held(gripper(0.094), facing()), "contact")
    assert (found.state, found.setpoint) == (0, 0)
    assert found.text.startswith("gripper touches wall at state 1 of 1 (set-point 1 of 1), 0.09")
    assert found.amount == pytest.approx(0.093, abs=1e-4)
    assert held(gripper(0.094), facing(), contact_depth=0.094, tool_contact=0.13).ok


def test_a_gripper_that_merely_touches_says_how_deep_it_may_go() -> None:
    report = held(gripper(0.0), facing())
    assert report.ok
    assert report.margins["contact"] == pytest.approx(0.001, abs=1e-5)
    assert held(gripper(0.0), facing(), contact_depth=0.02).margins["contact"] == pytest.approx(
        0.021, abs=1e-5
    )


@pytest.mark.parametrize(("deep", "holds"), [(0.0, True), (0.0009, True), (0.0011, False), (0.02, False)])
def test_contact_is_as_deep_as_the_tolerance_at_the_most(deep: float, holds: bool) -> None:
    report = held(gripper(deep), facing())
    assert report.ok == holds
    assert held(gripper(deep), facing(), contact_depth=0.0201).ok


@pytest.mark.parametrize(("wide", "clearance", "holds"), [
    (0.04, 0.0, True), (0.04, 0.03, True), (0.08, 0.001, False), (0.08, 0.03, False),
])  # fmt: skip
def test_what_is_far_from_the_tool_point_keeps_its_clearance(
    wide: float, clearance: float, holds: bool
) -> None:
    report = held(gripper(0.0, wide), facing(), arm_clearance=clearance, tool_contact=0.05)
    assert report.ok == holds
    if not holds:
        assert "within 0.05 m of the tool point" in only(report, "contact").text
    wider = held(gripper(0.0, wide), facing(), arm_clearance=clearance, tool_contact=0.08)
    assert wider.ok


def test_a_link_that_sinks_in_between_states() -> None:
    """The tool turns about the arm's foot: in the middle of the hop it is farther out than at both ends."""
    tip, turn = TIP[:3, 3], 0.3
    block = Box("work", np.array([0.2, 0.6, 0.1]), np.array([tip[0] + 0.1, 0.0, tip[2]]))
    motion = motion_of([(np.array([tip[0] * (1 - np.cos(a)), 0.0, a]), Q, kind, owner) for a, kind, owner in (
        (-turn, "transit", -1), (0.0, "setpoint", 0), (turn, "transit", -1)
    )])  # fmt: skip
    rules = replace(RULES, clearance=0.0, tool_contact=0.3, contact_depth=0.035)
    found = of_kind(verify(plan_of(world_of(motion, block, rules=rules), motion, 1)), "contact")
    assert [one.state for one in found] == [0, 1]
    assert all("between states" in one.text for one in found)
    deeper = replace(rules, contact_depth=0.045)
    assert verify(plan_of(world_of(motion, block, rules=deeper), motion, 1)).ok


def shapes(rng: np.random.Generator) -> LinkSolid:
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, 3] = rng.normal(size=3) * 0.05
    if rng.random() < 0.5:
        return LinkBox(0, "box", T, rng.uniform(0.02, 0.2, 3))
    ends = rng.normal(size=(2, 3)) * 0.1
    return LinkCapsule(0, "capsule", ends[0], ends[1], float(rng.uniform(0.01, 0.06)))


def points_of(solid: LinkSolid, rng: np.random.Generator, count: int = 4000) -> Array:
    if isinstance(solid, LinkBox):
        inside = rng.uniform(-0.5, 0.5, (count, 3)) * solid.size
        points: Array = inside @ solid.T_link_box[:3, :3].T + solid.T_link_box[:3, 3]
        return points
    assert isinstance(solid, LinkCapsule)
    ball = rng.normal(size=(count, 3))
    ball *= solid.radius / np.linalg.norm(ball, axis=1, keepdims=True)
    along: Array = solid.start + rng.random((count, 1)) * (solid.end - solid.start) + ball
    return along


@settings(max_examples=examples(60))
@given(st.integers(0, 100_000))
def test_nothing_below_a_plane_is_farther_from_the_tool_than_told(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid, tool, normal = shapes(rng), rng.normal(size=3) * 0.05, rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    height = float(rng.normal() * 0.05)
    points = points_of(solid, rng)
    seen = np.linalg.norm(points - tool, axis=1)[points @ normal <= height].max(initial=0.0)
    plane = normal[None], np.array([height])
    assert farthest_below_planes(solid.corners[None], solid.radius, *plane, tool[None])[0] >= seen - 1e-12
    assert compiled_farthest(solid.corners, solid.radius, normal, height, tool) >= seen - 1e-12


@settings(max_examples=examples(60))
@given(st.integers(0, 100_000), st.floats(0, 0.2))
def test_what_is_left_of_a_solid_is_within_the_depth_of_all_of_it(seed: int, depth: float) -> None:
    rng = np.random.default_rng(seed)
    solid = shapes(rng)
    tool = solid.corners[0] + rng.normal(size=3) * 0.05
    corners, radius = core_of(solid, depth, tool)
    weights = shrunk_weights(solid.corners[None], max(0.0, depth - solid.radius), tool[None])[0]
    assert weights @ solid.corners == pytest.approx(corners)
    if isinstance(solid, LinkCapsule):
        left = LinkCapsule(0, "left", corners[0], corners[1], max(radius, 1e-9))
        assert min(left.depth(p) for p in points_of(solid, rng, 200)) >= -depth - 2e-9
    else:
        assert isinstance(solid, LinkBox)
        axes = solid.T_link_box[:3, :3]
        low, high = (corners @ axes).min(0), (corners @ axes).max(0)
        off = points_of(solid, rng) @ axes
        assert (np.maximum(low - off, off - high).max(1) <= depth + 1e-12).all()


THINGS: dict[str, Solid] = {
    "box": Box("thing", np.array([0.2, 0.2, 0.2]), np.array([0.0, 0.0, -0.1])),
    "cylinder": Cylinder("thing", 0.1, 0.2, np.array([0.0, 0.0, -0.1])),
    "sphere": Sphere("thing", 0.1, np.array([0.0, 0.0, -0.1])),
    "mesh": box_mesh([-0.1, -0.1, -0.2], [0.1, 0.1, 0.0]),
}


@pytest.mark.parametrize("kind", THINGS)
def test_a_contact_that_is_accepted_is_seen_to_keep_the_rules(kind: str) -> None:
    thing, told = THINGS[kind], []
    distance = THINGS["box" if kind == "mesh" else kind].distance  # the mesh is the same box, and slow to ask
    piece = obstacles_from([thing]).pieces[0]
    for seed in range(300):
        rng = np.random.default_rng(seed)
        solid = shapes(rng)
        depth, clearance, reach = rng.uniform(0, 0.03), rng.uniform(0, 0.02), rng.uniform(0.02, 0.1)
        tool = solid.corners[0]
        lift = np.array([0.0, 0.0, -points_of(solid, rng)[:, 2].min() - rng.uniform(0, 0.03)])
        aside = np.array([*(rng.uniform(-0.08, 0.08, 2) - tool[:2]), 0.0])
        hulls, at = solid.corners + lift + aside, tool + lift + aside
        moved = SweptSolids(hulls[None, None], solid.radius, at[None, None], *np.zeros((2, 1)))
        told.append(is_allowed(ToolContact({}, float(reach), float(clearance), float(depth)), moved, piece))
        if not told[-1]:
            continue
        points = points_of(solid, rng) + lift + aside
        gaps = np.array([distance(p) for p in points])
        assert gaps.min() >= -depth * np.sqrt(3) - 1e-6
        far = np.linalg.norm(points - at, axis=1) > reach + 1e-6
        assert gaps[far].min(initial=np.inf) >= clearance - 1e-6
    assert 20 < sum(told) < 280


def test_the_planner_keeps_to_what_the_proof_asks() -> None:
    """Drives at a wall and along it, each with a gripper somewhat too long or not."""
    agreed = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        robot = gripper(float(rng.uniform(0, 0.02)))
        rules = replace(RULES, clearance=0.0, contact_depth=float(rng.uniform(0, 0.02)), tool_contact=0.08)
        motion = motion_of([
            (STANDING, Q, "setpoint", 0),
            (np.array([*rng.uniform(-0.03, 0.004, 2), rng.normal() * 0.02]), Q, "transit", -1),
        ])  # fmt: skip
        world = world_of(motion, facing(), robot=robot, rules=rules)
        collision = scene_of(world).collision
        free = (
            collision.first_obstruction(
                [Pose(*state) for state in zip(motion.base, motion.joints, strict=True)]
            )
            is None
        )
        holds = not of_kinds(verify(plan_of(world, motion, 1)), "arm", "contact")
        assert holds or not free
        agreed.append(free == holds)
    assert sum(agreed) > 30


def of_kinds(report: Report, *kinds: str) -> list[str]:
    return [one.text for one in report.violations if one.kind in kinds]


def test_a_set_point_that_the_tip_cannot_touch_is_explained() -> None:
    motion = motion_of([(STANDING, Q, "setpoint", 0)])
    world = world_of(motion, facing())
    found = target_in_solid(scene_of(world))
    assert found is not None
    assert "contact_depth" in found.reason
    assert found.causes[0].margin == pytest.approx(0.034, abs=1e-6)
    assert target_in_solid(scene_of(replace(world, rules=replace(RULES, contact_depth=0.034)))) is None
