"""Plans made by hand: a good one holds, and every fault planted in one is found and named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from shapely.affinity import rotate, translate
from shapely.geometry import Point, Polygon, box

from regionik.values import Motion, Report
from regionik.verification.motion import MotionSegments, chord_deviation
from regionik.verification.options import VERIFICATION
from regionik.verification.verifier import verify
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkCapsule, capsules_along
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Start, Target, World
from tests.kinds import Solid
from tests.maths import Array, rot_x, rot_y, translation
from tests.plans import (
    FOOTPRINT,
    RULES,
    Q,
    configuration,
    drive,
    motion_of,
    moved,
    of_kind,
    only,
    plan_of,
    straight,
    world_of,
    youbot,
)


def test_a_good_plan_holds() -> None:
    motion = straight()
    shelf = Box("shelf", np.array([2.0, 0.1, 0.5]), np.array([0.5, 0.4, 0.25]))
    roof = Box("roof", np.array([2.0, 2.0, 0.1]), np.array([0.5, 0.0, 0.5]))
    report = verify(plan_of(world_of(motion, shelf, roof, axes=True), motion))
    assert report.violations == ()
    assert report.ok
    assert report.margins["clearance"] == pytest.approx(0.15)
    assert report.margins["floor"] == pytest.approx(1.0)
    assert report.margins["step"] == pytest.approx(0.05)
    assert report.margins["setpoint"] == pytest.approx(0.001)
    assert report.margins["path"] == pytest.approx(0.01)
    assert report.margins["direction"] == pytest.approx(0.05)


def test_margin_of_the_arm_is_the_distance_of_the_link() -> None:
    motion = straight()
    ceiling = Box("ceiling", np.array([4.0, 4.0, 0.1]), np.array([0.0, 0.0, 0.42]))
    elbow = float(youbot().frames(np.zeros(3), Q)[3, 2, 3])
    rules = replace(RULES, arm_clearance=0.01)
    report = verify(plan_of(world_of(motion, ceiling, rules=rules), motion))
    assert report.ok
    assert report.margins["arm"] == pytest.approx(0.37 - elbow - 0.035 - 0.01, abs=1e-9)


# Structure


def test_no_states() -> None:
    motion = straight()
    empty = Motion(
        np.zeros((0, 3)), np.zeros((0, 5)), np.array([], dtype=str), np.array([], dtype=int), np.zeros(0)
    )
    assert "no states" in only(verify(plan_of(world_of(motion), empty)), "structure").text


def test_one_state_is_checked() -> None:
    motion = straight(1)
    assert verify(plan_of(world_of(motion), motion)).ok
    post = Cylinder("post", 0.1, 0.1, np.array([0.0, 0.2, 0.05]))
    assert "post" in only(verify(plan_of(world_of(motion, post), motion)), "clearance").text


@pytest.mark.parametrize(
    ("field", "states", "values", "words", "setpoint"),
    [
        ("kind", [4], ["step"], "set-point 3 of 5 is missing", 2),
        ("kind", [5], ["setpoint"], "set-point 3 of 5 appears 2 times", 2),
        ("setpoint", [2, 4], [2, 1], "set-point 2 of 5 comes after set-point 3 of 5: out of order", 1),
    ],
)
def test_setpoints_missing_twice_or_out_of_order(
    field: str, states: list[int], values: list[Any], words: str, setpoint: int
) -> None:
    motion = straight()
    changed = getattr(motion, field).copy()
    changed[states] = values
    found = of_kind(verify(plan_of(world_of(motion), replace(motion, **{field: changed}))), "structure")
    assert any(words in one.text and one.setpoint == setpoint for one in found)


def test_step_of_a_setpoint_far_away() -> None:
    motion = straight()
    owner = motion.setpoint.copy()
    owner[1] = 3
    found = only(verify(plan_of(world_of(motion), replace(motion, setpoint=owner))), "structure")
    assert (found.state, found.setpoint) == (1, 3)


@pytest.mark.parametrize("where", ["base", "joints", "configuration", "time"])
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_not_finite(where: str, number: float) -> None:
    motion = straight()
    plan = plan_of(world_of(motion), motion)
    if where == "configuration":
        wrong = replace(plan.setpoints[1], joints=np.full(5, number))
        plan = replace(plan, setpoints=(plan.setpoints[0], wrong, *plan.setpoints[2:]))
    elif where == "time":
        time = motion.time.copy()
        time[3] = np.inf
        plan = replace(plan, motion=replace(motion, time=time))
    else:
        values = getattr(motion, where).copy()
        values[3, 1] = number
        object.__setattr__(motion, where, values)  # what Motion itself would refuse
    assert "not finite" in only(verify(plan), "structure").text


def test_unknown_kind_of_state() -> None:
    motion = straight()
    kind = motion.kind.astype("U12")
    kind[1] = "teleport"
    text = only(verify(plan_of(world_of(motion), replace(motion, kind=kind))), "structure").text
    assert "teleport" in text
    assert "setpoint, step, transit" in text


@pytest.mark.parametrize("owner", [-2, 5])
def test_state_of_a_setpoint_that_is_not_there(owner: int) -> None:
    motion = straight()
    owners = motion.setpoint.copy()
    owners[1] = owner
    world = world_of(motion)
    assert only(verify(plan_of(world, replace(motion, setpoint=owners))), "structure").state == 1


def test_configurations_that_differ_from_the_states() -> None:
    motion = straight()
    plan = plan_of(world_of(motion), motion)
    wrong = configuration(plan.world, 2, plan.setpoints[2].base + [0.01, 0, 0], plan.setpoints[2].joints)
    plan = replace(plan, setpoints=(*plan.setpoints[:2], wrong, *plan.setpoints[3:]))
    assert of_kind(verify(plan), "structure")[0].setpoint == 2
    short = verify(replace(plan, setpoints=plan.setpoints[:2]))
    assert "lists 2 set-points" in only(short, "structure").text


def test_start_of_the_world() -> None:
    motion = straight()
    world = world_of(motion)
    same = replace(world, start=Start(np.array([0.0, 0.0, 2 * np.pi]), Q))
    assert verify(plan_of(same, motion)).ok
    other = replace(world, start=Start(np.array([0.0, 0.1, 0.0]), Q))
    assert "start" in only(verify(plan_of(other, motion)), "structure").text


def test_lift_offs_are_counted() -> None:
    motion = straight(between=3)
    world = world_of(motion)
    kind = motion.kind.copy()
    kind[[1, 2, 9]] = "transit"
    lifted = replace(motion, kind=kind)
    assert verify(plan_of(world, lifted, lift_offs=2)).ok
    assert "has 2" in only(verify(plan_of(world, lifted, lift_offs=1)), "structure").text.replace(
        "have", "has"
    )
    strict = replace(world, rules=replace(RULES, max_lift_offs=1))
    assert "allow 1" in only(verify(plan_of(strict, lifted, lift_offs=2)), "structure").text


def test_transits_before_the_first_setpoint_are_no_lift_off() -> None:
    motion = straight()
    rows = [(np.array([-0.1, 0.0, 0.0]), Q, "transit", -1), (np.array([-0.05, 0.0, 0.0]), Q, "transit", -1)]
    rows += [(s.base, s.joints, s.kind, int(motion.setpoint[k])) for k, s in enumerate(motion)]
    assert verify(plan_of(world_of(motion), motion_of(rows), lift_offs=0)).ok


# Joints and base steps


@pytest.mark.parametrize(("joint", "change"), [(1, -1.3), (3, 2.4), (4, -3.0)])
def test_joint_beyond_its_limit(joint: int, change: float) -> None:
    motion = straight()
    bent = moved(motion, 3, joints=np.eye(5)[joint] * change)
    found = of_kind(verify(plan_of(world_of(motion), bent)), "joints")
    assert len(found) == 1
    assert (found[0].state, found[0].setpoint) == (3, 1)
    assert f"joint_{joint + 1}" in found[0].text
    beyond = max(
        youbot().chain.lower[joint] - bent.joints[3, joint],
        bent.joints[3, joint] - youbot().chain.upper[joint],
    )
    assert found[0].amount == pytest.approx(beyond)


def test_base_step_too_long() -> None:
    motion = straight(pitch=0.25)
    report = verify(plan_of(world_of(motion), motion))
    assert {v.state for v in of_kind(report, "step")} == set(range(8))
    assert only(report, "step").amount == pytest.approx(0.025)
    assert report.margins["step"] == pytest.approx(-0.025)


# The tool


def test_tool_off_its_setpoint() -> None:
    motion = straight()
    world = world_of(motion)
    task = list(world.task)
    task[2] = Target(task[2].position + [0, 0, 0.002])
    found, *_ = of_kind(verify(plan_of(replace(world, task=tuple(task)), motion)), "setpoint")
    assert (found.state, found.setpoint) == (4, 2)
    assert found.amount == pytest.approx(0.001)
    assert "set-point 3 of 5" in found.text


def test_tool_axis_and_orientation() -> None:
    motion = straight(3)
    world = world_of(motion)
    R = world.robot.tool(motion.base[0], motion.joints[0])[:3, :3]
    for turned, word in ((rot_y(0.06), "axis"), (rot_x(0.06), "axis")):
        targets = tuple(Target(t.position, (turned[:3, :3] @ R)[:, 2], cone=0.05) for t in world.task)
        angle = float(np.arccos(targets[0].direction @ R[:, 2])) if targets[0].direction is not None else 0.0
        report = verify(plan_of(replace(world, task=targets), motion))
        assert report.ok == (angle <= 0.05)
        if not report.ok:
            assert word in of_kind(report, "setpoint")[0].text
    twisted = tuple(
        Target(t.position, cone=0.05, orientation=R @ rot_x(0)[:3, :3] @ _rz(0.06)) for t in world.task
    )
    report = verify(plan_of(replace(world, task=twisted), motion))
    assert {violation.kind for violation in report.violations} == {"setpoint", "orientation"}
    found = of_kind(report, "setpoint")[0]
    assert "orientation" in found.text
    assert found.amount == pytest.approx(0.01, abs=1e-9)
    assert report.margins["orientation"] == pytest.approx(-0.01, abs=1e-9)


def _rz(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def test_a_transit_that_is_not_called_one() -> None:
    motion = straight()
    lifted = moved(motion, 3, joints=[0, 0.2, 0, 0, 0])
    found = only(verify(plan_of(world_of(motion), lifted)), "path")
    assert (found.state, found.setpoint) == (3, 1)
    kind = lifted.kind.copy()
    kind[3] = "transit"
    assert verify(plan_of(world_of(motion), replace(lifted, kind=kind), lift_offs=1)).ok


def circling(angle: float) -> Motion:
    """The base goes round the tool on the chord of an arc, and looks at it from both ends."""
    r = float(youbot().tool(np.zeros(3), Q)[0, 3])
    ends = [(np.array([r - r * np.cos(a), -r * np.sin(a), a]), Q) for a in (0.0, angle)]
    return motion_of([(*ends[0], "setpoint", 0), (*ends[1], "setpoint", 1)])


def test_tool_off_the_path_between_states_that_are_on_it() -> None:
    r = float(youbot().tool(np.zeros(3), Q)[0, 3])
    rules = replace(RULES, step=1.0)
    for angle, holds in ((0.42, True), (0.46, False)):
        assert (r * (1 - np.cos(angle / 2)) <= 0.01) == holds
        motion = circling(angle)
        report = verify(plan_of(world_of(motion, rules=rules), motion))
        assert report.ok == holds
        if not holds:
            found = only(report, "path")
            assert "between states 1 and 2" in found.text
            assert "set-point 1 of 2" in found.text


def test_tool_axis_off_between_states() -> None:
    rules = replace(RULES, step=1.0, path_tolerance=0.2)
    motion = circling(0.6)
    world = world_of(motion, rules=rules, axes=True)
    assert verify(plan_of(world, motion)).ok  # the axis turns along the arc from one direction to the other
    tilted = motion_of(
        [
            (motion.base[0], Q, "setpoint", 0),
            (motion.base[0], Q + [0, 0, 0, 0.06, 0], "step", 0),
            (motion.base[1], Q, "setpoint", 1),
        ]
    )
    found = of_kind(verify(plan_of(world, tilted)), "direction")
    assert found[0].amount == pytest.approx(0.01, abs=2e-3)
    assert {v.kind for v in found} == {"direction"}


def test_tool_axis_that_wobbles_twice_between_states() -> None:
    """Both ends and the middle look the same."""
    joint = Joint("spin", "revolute", -7, 7, np.eye(4))
    chain = Chain((joint,), translation(0, 0, 0.3) @ rot_x(0.06))
    robot = Robot("top", "omni", np.zeros((1, 2)), np.zeros(4), chain, (), 0.1, np.zeros(1))
    turns = [np.array([k * 2 * np.pi]) for k in (-1, 1)]
    motion = motion_of([(np.zeros(3), q, "setpoint", i) for i, q in enumerate(turns)])
    found = only(verify(plan_of(world_of(motion, robot=robot, axes=True), motion)), "direction")
    assert found.amount > 0.001
    assert "between states 1 and 2" in found.text


# The base


def test_base_cuts_a_corner_between_states_that_are_clear() -> None:
    post = Cylinder("post", 0.1, 0.1, np.array([0.5, 0.25, 0.05]))
    rules = replace(RULES, step=2.0)
    motion = drive([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    found = only(verify(plan_of(world_of(motion, post, rules=rules), motion, 1)), "clearance")
    assert (found.state, found.setpoint) == (0, 0)
    assert found.amount == pytest.approx(0.05)
    assert "post" in found.text
    assert "0.1500 m" in found.text
    assert "between states 1 and 2" in found.text
    exactly = drive([0.0, -0.05, 0.0], [1.0, -0.05, 0.0])
    assert verify(plan_of(world_of(exactly, post, rules=rules), exactly, 1)).ok


def test_base_at_a_state_too_close() -> None:
    motion = straight()
    wall = Prism("wall", Polygon([(0.2, 0.19), (0.3, 0.19), (0.3, 0.5)]), 0.0, 0.1)
    report = verify(plan_of(world_of(motion, wall), motion))
    assert only(report, "clearance").text.count("wall") == 1
    assert report.margins["clearance"] == pytest.approx(-0.01)


def test_what_stands_above_the_body_concerns_the_arm_alone() -> None:
    motion = straight()
    beam = Box("beam", np.array([0.02, 3.0, 0.02]), np.array([0.2, 0.0, 0.9]))
    assert verify(plan_of(world_of(motion, beam), motion)).ok


def test_base_off_the_floor() -> None:
    rules = replace(RULES, step=5.0)
    motion = drive([2.9, 0.0, 0.0], [3.1, 0.0, 0.0])
    found = only(verify(plan_of(world_of(motion, rules=rules), motion, 1)), "floor")
    assert found.state == 1
    assert found.amount == pytest.approx(0.1)
    along_the_edge = drive([3.0, -1.5, 0.0], [3.0, 1.5, 0.0])
    assert verify(plan_of(world_of(along_the_edge, rules=rules), along_the_edge, 1)).ok


def test_base_leaves_a_floor_that_turns_in() -> None:
    rules = replace(RULES, step=5.0)
    ell = Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
    for corner, holds in ((0.5, True), (0.6, False)):
        motion = drive([corner, 1.5, 0.0], [1.5, corner, 0.0])
        world = replace(world_of(motion, rules=rules), floor=Floor(ell))
        report = verify(plan_of(world, motion, 1))
        assert report.ok == holds
        if not holds:
            assert "between states" in only(report, "floor").text


@pytest.mark.parametrize(("gap", "holds"), [(0.347, True), (0.346, False), (0.34, False)])
def test_a_footprint_turns_into_a_wall(gap: float, holds: bool) -> None:
    robot = youbot(FOOTPRINT)  # a corner reaches 0.3467 m, a side 0.19 m
    motion = drive([0.0, 0.0, 0.0], [0.0, 0.0, 0.9], [0.0, 0.0, 1.9], [0.0, 0.0, np.pi])
    rules = replace(RULES, clearance=0.0)
    wall = Box("wall", np.array([2.0, 0.1, 0.1]), np.array([0.0, gap + 0.05, 0.05]))
    report = verify(plan_of(world_of(motion, wall, robot=robot, rules=rules), motion, 1))
    assert report.ok == holds
    if not holds:
        assert "wall" in only(report, "clearance").text


@pytest.mark.parametrize(("spare", "holds"), [(4e-6, True), (-4e-6, False)])
def test_the_side_of_a_footprint_turns_past_a_post(spare: float, holds: bool) -> None:
    motion = drive([-0.04, 0.0, -0.04], [0.04, 0.0, 0.04])
    post = Cylinder("post", 0.1, 0.1, np.array([0.0, 0.4, 0.05]))
    world = world_of(motion, post, robot=youbot(FOOTPRINT), rules=replace(RULES, clearance=0.0))
    s = np.linspace(0, 1, 1001)[:, None]
    gaps = []
    for x, y, yaw in motion.base[0] + s * (motion.base[1] - motion.base[0]):
        shape = translate(rotate(Polygon(FOOTPRINT), yaw, origin=(0, 0), use_radians=True), x, y)
        gaps.append(shape.distance(Point(0.0, 0.4)) - 0.1)
    nearest = min(gaps[1:-1])
    assert nearest < min(gaps[0], gaps[-1]) - 1e-4  # it is between the states that it comes near
    rules = replace(world.rules, clearance=nearest - spare)
    assert verify(plan_of(replace(world, rules=rules), motion, 1)).ok == holds


@pytest.mark.parametrize(("gap", "holds"), [(0.3468, True), (0.345, False)])
def test_a_footprint_turns_out_of_the_floor(gap: float, holds: bool) -> None:
    motion = drive([0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, np.pi])
    world = replace(world_of(motion, robot=youbot(FOOTPRINT)), floor=Floor(box(-1, -1, 1, gap)))
    report = verify(plan_of(world, motion, 1))
    assert report.ok == holds
    if not holds:
        assert "between states" in only(report, "floor").text


def test_the_base_turns_the_shorter_way() -> None:
    motion = drive([0.0, 0.0, 3.0], [0.0, 0.0, -3.0])
    ahead = Sphere("ball", 0.05, np.array([0.42, 0.0, 0.24]))
    behind = Sphere("ball", 0.05, np.array([-0.42, 0.0, 0.24]))
    rules = replace(RULES, tool_contact=0.001)
    assert verify(plan_of(world_of(motion, ahead, rules=rules), motion, 1)).ok
    assert "ball" in only(verify(plan_of(world_of(motion, behind, rules=rules), motion, 1)), "arm").text


# The arm


def test_a_base_that_turns_though_its_heading_is_fixed() -> None:
    motion = drive([0.0, 0.0, 0.3], [0.0, 0.0, 0.3], [0.05, 0.0, 0.2])
    rules = replace(RULES, heading="fixed")
    found = only(verify(plan_of(world_of(motion, rules=rules), motion, 1)), "heading")
    assert found.state == 2
    assert found.amount == pytest.approx(0.1)
    straight_on = drive([0.0, 0.0, 0.3], [0.05, 0.0, 0.3])
    assert verify(plan_of(world_of(straight_on, rules=rules), straight_on, 1)).ok


@pytest.mark.parametrize("aside", [0.0, 0.01])
def test_a_base_that_does_not_face_its_target(aside: float) -> None:
    motion = drive([0.0, 0.0, 0.3], [0.05, 0.0, 0.3], joints=Q + [aside, 0.0, 0.0, 0.0, 0.0])
    report = verify(plan_of(world_of(motion, rules=replace(RULES, heading="face_target")), motion, 1))
    assert report.ok == (aside == 0.0)
    assert [violation.kind for violation in report.violations] == ["heading"] * (aside > 0)


def test_the_arm_passes_through_a_thin_plate_between_clear_states() -> None:
    rules = replace(RULES, step=1.0)
    motion = drive([0.0, -0.1, 0.0], [0.0, 0.1, 0.0])
    plate = Box("plate", np.array([0.3, 0.002, 0.6]), np.array([0.5, 0.0, 0.5]))
    found = of_kind(verify(plan_of(world_of(motion, plate, rules=rules), motion, 1)), "arm")
    assert all(v.state == 0 and "plate" in v.text and "between states 1 and 2" in v.text for v in found)
    assert any("link 5 (joint_5)" in v.text for v in found)
    gone = Box("plate", np.array([0.3, 0.002, 0.6]), np.array([0.63, 0.0, 0.5]))
    assert verify(plan_of(world_of(motion, gone, rules=rules), motion, 1)).ok


@pytest.mark.parametrize(("above", "holds"), [(0.0, True), (1e-7, True), (-1e-5, False)])
def test_a_link_may_come_as_near_as_the_clearance(above: float, holds: bool) -> None:
    motion = straight(between=3)
    rules = replace(RULES, arm_clearance=0.02)
    elbow = float(youbot().frames(np.zeros(3), Q)[3, 2, 3])
    beam = Box("beam", np.array([3.0, 3.0, 0.1]), np.array([0.0, 0.0, elbow + 0.035 + 0.02 + 0.05 + above]))
    report = verify(plan_of(world_of(motion, beam, rules=rules), motion))
    assert report.ok == holds
    if not holds:
        found = of_kind(report, "arm")
        assert found[0].amount == pytest.approx(1e-5, abs=1e-8)
        assert "link 3 (joint_3)" in found[0].text or "link 2 (joint_2)" in found[0].text


def test_a_link_that_overlaps_at_a_state() -> None:
    motion = straight()
    ball = Sphere("ball", 0.05, np.array([0.25, 0.0, 0.33]))
    found = of_kind(verify(plan_of(world_of(motion, ball), motion)), "arm")
    assert any("overlaps ball" in v.text for v in found)
    assert all("ball" in v.text for v in found)


def test_a_mesh_that_swallows_the_arm() -> None:
    motion = straight()
    corners = np.array([[x, y, z] for x in (-3.0, 5.0) for y in (-3.0, 3.0) for z in (-3.0, 3.0)])
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
        + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )
    whale = Mesh("whale", corners, faces)
    found = of_kind(verify(plan_of(world_of(motion, whale), motion)), "arm")
    assert "whale" in found[0].text


def test_a_mesh_beside_the_arm_is_clear() -> None:
    motion = straight()
    corners = np.array([[0.0, 0.1, 0.0], [1.0, 0.1, 0.0], [0.5, 0.5, 0.0], [0.5, 0.11, 0.9], [0.5, 0.8, 0.5]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [2, 3, 4]])
    rules = replace(RULES, clearance=0.05)
    assert verify(plan_of(world_of(motion, Mesh("fin", corners, faces), rules=rules), motion)).ok


# Contact


def touching(*solids: Solid, out: float = 0.0, contact: float = 0.05) -> Report:
    """The tool touches a block at its only set-point, and goes up along it by ``out``."""
    robot = youbot()
    rows = [(np.zeros(3), Q, "setpoint", 0)]
    if out:
        rows.append((np.array([0.0, out, 0.0]), Q, "transit", -1))
    motion = motion_of(rows)
    rules = replace(RULES, tool_contact=contact, contact_depth=0.035, clearance=0.0)
    return verify(plan_of(world_of(motion, *solids, robot=robot, rules=rules), motion, int(out > 0)))


def block(name: str, gap: float = 0.0) -> Box:
    """A block whose side is ahead of the tool, out of reach of the other links."""
    tip = youbot().tool(np.zeros(3), Q)[:3, 3]
    return Box(name, np.array([0.2, 0.6, 0.1]), np.array([tip[0] + 0.1 + gap, 0.0, tip[2]]))


def test_the_last_link_may_touch_its_work() -> None:
    assert touching(block("work")).ok
    assert touching(block("work", gap=0.02)).ok
    assert touching(block("work"), out=0.04).ok


def test_the_last_link_may_touch_nothing_else() -> None:
    found = only(touching(block("work"), block("other", gap=0.001)), "arm")
    assert "other" in found.text
    assert "link 5 (joint_5)" in found.text


def test_the_last_link_may_touch_only_near_the_setpoint() -> None:
    found = only(touching(block("work"), out=0.09), "arm")
    assert found.state == 1
    assert "work" in found.text


def test_contact_ends_between_states() -> None:
    """The tool leaves the set-point's surroundings along the block, and is back before the next state."""
    motion = motion_of([(np.zeros(3), Q, "setpoint", 0), (np.array([0.0, 0.2, 0.0]), Q, "transit", -1)])
    rules = replace(RULES, step=1.0, clearance=0.0, contact_depth=0.035)
    short = replace(block("work"), size=np.array([0.2, 0.2, 0.1]))
    found = only(verify(plan_of(world_of(motion, short, rules=rules), motion, 1)), "arm")
    assert "between states 1 and 2" in found.text


def test_the_tool_leaves_its_work_and_its_surroundings_in_one_hop() -> None:
    rules = replace(RULES, clearance=0.0, contact_depth=0.035)
    motion = drive([0.0, 0.0, 0.0], [-0.06, 0.0, 0.0])
    assert verify(plan_of(world_of(motion, block("work"), rules=rules), motion, 1)).ok


def test_too_far_for_contact() -> None:
    assert "work" in only(touching(block("work", gap=0.02), contact=0.01), "arm").text


def test_the_other_links_may_not_touch_the_work() -> None:
    work = Box("work", np.array([0.4, 0.6, 0.12]), np.array([0.4, 0.0, 0.239]))
    found = of_kind(touching(work, contact=1.0), "arm")
    assert not any("link 5" in v.text for v in found)


# Many, and all


def test_many_violations_are_counted() -> None:
    motion = straight(count=40, pitch=0.05)
    lid = Box("lid", np.array([9.0, 9.0, 0.1]), np.array([0.0, 0.0, 0.39]))
    report = verify(plan_of(world_of(motion, lid), motion))
    found = of_kind(report, "arm")
    assert len(found) == VERIFICATION.proofs.max_violations + 1
    assert "more violations" in found[-1].text


def test_violations_count_setpoints_from_one_in_words_and_from_zero_in_data() -> None:
    motion = moved(straight(), 4, joints=[0, 0.2, 0, 0, 0])
    found = of_kind(verify(plan_of(world_of(straight()), motion)), "setpoint")[0]
    assert (found.state, found.setpoint) == (4, 2)
    assert "set-point 3 of 5" in found.text


def test_a_robot_without_solids_and_a_world_without_obstacles() -> None:
    motion = straight()
    bare = replace(youbot(), solids=())
    ball = Sphere("ball", 0.05, np.array([0.25, 0.0, 0.33]))
    report = verify(plan_of(world_of(motion, ball, robot=bare), motion))
    assert report.ok
    assert "arm" not in report.margins
    assert "clearance" not in verify(plan_of(world_of(motion), motion)).margins


# Bounds against dense sampling


def odd_robot() -> Robot:
    """Joints of both kinds about slanted axes, and an arm mounted off the centre."""
    rng = np.random.default_rng(8)
    joints = []
    for k, kind in enumerate(("revolute", "prismatic", "revolute", "revolute")):
        frame = (
            translation(*rng.uniform(-0.2, 0.2, 3)) @ rot_x(rng.uniform(-3, 3)) @ rot_y(rng.uniform(-3, 3))
        )
        joints.append(
            Joint(
                f"j{k}", "prismatic" if kind == "prismatic" else "revolute", -3, 3, frame, rng.normal(size=3)
            )
        )
    chain = Chain(tuple(joints), translation(0.1, 0.2, 0.3))
    capsules = (
        *capsules_along(chain, 0.02),
        LinkCapsule(3, "off the axis", np.array([0.1, 0, 0]), np.ones(3) / 5, 0.02),
    )
    return Robot(
        "odd", "omni", np.zeros((1, 2)), np.array([0.1, -0.2, 0.3, 0.5]), chain, capsules, 0.1, np.zeros(4)
    )


@pytest.mark.parametrize("robot", [youbot(), odd_robot()], ids=lambda robot: str(robot.name))
def test_points_stay_as_near_their_chords_as_their_acceleration_says(robot: Robot) -> None:
    rng = np.random.default_rng(3)
    n = 40
    base = np.cumsum(rng.normal(scale=0.3, size=(n, 3)), axis=0)
    joints = np.cumsum(rng.normal(scale=0.4, size=(n, robot.chain.dof)), axis=0)
    motion = motion_of([(b, q, "transit", -1) for b, q in zip(base, joints, strict=True)])
    segments = MotionSegments(robot, motion)
    s = np.linspace(0, 1, 60)
    tightest = 0.0
    for capsule in robot.solids:
        bound = chord_deviation(segments.acceleration_bound(capsule.link, capsule.corners[1]), np.ones(1))
        for hop in range(n - 1):
            frames = segments.frames_at(np.full(60, hop), s)[:, capsule.link]
            points = frames[:, :3, :3] @ capsule.corners[1] + frames[:, :3, 3]
            chord = points[0] + s[:, None] * (points[-1] - points[0])
            off = float(np.linalg.norm(points - chord, axis=1).max())
            assert off <= bound[hop] + 1e-12
            tightest = max(tightest, off / bound[hop])
    assert tightest > 0.2


def sampled_gap(world: World, motion: Motion, hop: int) -> float:
    """Least distance of any link from any solid on a hop, by points on axes at many moments."""
    s = np.linspace(0, 1, 41)
    turn = np.remainder(motion.base[hop + 1, 2] - motion.base[hop, 2] + np.pi, 2 * np.pi) - np.pi
    way = np.array([*(motion.base[hop + 1] - motion.base[hop])[:2], turn])
    bases = motion.base[hop] + s[:, None] * way
    arms = motion.joints[hop] + s[:, None] * (motion.joints[hop + 1] - motion.joints[hop])
    frames = world.robot.frames(bases, arms)
    least = np.inf
    for capsule in world.robot.solids:
        around = world.arm_solids if capsule.link else world.solids  # the first turns on the pivot alone
        for t in np.linspace(0, 1, 7):
            spot = (1 - t) * capsule.corners[0] + t * capsule.corners[1]
            points = frames[:, capsule.link, :3, :3] @ spot + frames[:, capsule.link, :3, 3]
            for solid in around:
                least = min(least, *(solid.distance(p) - capsule.radius for p in points))
    return least


def random_solid(rng: np.random.Generator, k: int) -> Solid:
    center = np.array([rng.uniform(-0.2, 0.7), rng.uniform(-0.5, 0.5), rng.uniform(0.2, 0.6)])
    match k % 4:
        case 0:
            return Box("solid", rng.uniform(0.01, 0.3, 3), center, rng.uniform(-3, 3))
        case 1:
            return Cylinder("solid", rng.uniform(0.01, 0.15), rng.uniform(0.01, 0.3), center)
        case 2:
            return Sphere("solid", rng.uniform(0.01, 0.15), center)
        case _:
            corners = center[:2] + [(-0.1, -0.1), (0.15, -0.1), (0.0, 0.0), (-0.1, 0.2)]
            return Prism("solid", Polygon(corners), center[2] - 0.05, center[2] + 0.05)


def test_ok_is_never_contradicted_by_samples() -> None:
    """Nor is a violation told where samples find room."""
    rng = np.random.default_rng(5)
    told = {True: 0, False: 0}
    for k in range(100):
        rows = [
            (rng.normal(scale=0.1, size=3), Q + rng.normal(scale=0.3, size=5), kind, i)
            for kind, i in (("setpoint", 0), ("transit", -1))
        ]
        motion = motion_of(rows)
        rules = replace(RULES, step=9.0, tool_contact=0.0, arm_clearance=0.01)
        world = world_of(motion, random_solid(rng, k), rules=rules)
        if world.obstacles[0].distance(world.task[0].position) <= 0:
            continue
        report = verify(plan_of(world, motion, 1))
        gap = sampled_gap(world, motion, 0)
        free = not any(v.kind == "arm" for v in report.violations)
        told[free] += 1
        if free:
            assert gap >= 0.01 - 2e-6
        else:
            assert gap < 0.01 + 0.01  # samples are a centimetre apart
            assert not any("not proven" in v.text for v in report.violations)
    assert min(told.values()) >= 10


def test_a_path_that_holds_is_never_contradicted_by_samples() -> None:
    rng = np.random.default_rng(6)
    told = {True: 0, False: 0}
    robot = youbot()
    for _ in range(60):
        scale = rng.choice([0.05, 0.2, 0.4])
        rows = [
            (rng.normal(scale=scale, size=3), Q + rng.normal(scale=scale, size=5), "setpoint", i)
            for i in range(2)
        ]
        motion = motion_of(rows)
        rules = replace(RULES, step=9.0)
        world = world_of(motion, rules=rules)
        free = not any(v.kind == "path" for v in verify(plan_of(world, motion)).violations)
        told[free] += 1
        a, b = (target.position for target in world.task)
        s = np.linspace(0, 1, 400)[:, None]
        tools = robot.tool(
            motion.base[0] + s * (motion.base[1] - motion.base[0]), rows[0][1] + s * (rows[1][1] - rows[0][1])
        )
        t = np.clip((tools[:, :3, 3] - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        off = float(np.linalg.norm(tools[:, :3, 3] - a - t[:, None] * (b - a), axis=1).max())
        assert free == (off <= 0.01)
    assert min(told.values()) >= 5
