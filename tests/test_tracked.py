"""Plans by Xu's tracker: the paper's two simulations, saturation, starts, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Point

from regionik.papers.options import PAPERS
from regionik.papers.pitch_arm import arm_share
from regionik.papers.pose_tracking import track_runs
from regionik.papers.tracker import can_track, tracking_robot
from regionik.pipeline import check_world, plan
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.drives import wheel_travel
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.limits import Criteria
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Start, Target, World
from tests.maths import Array, planar_pose, rot_y, rot_z
from tests.measures import axis_of
from tests.planned import planned

ROBOT = robot_named("pioneer-parm")
SPEED = 0.5  # of a wheel [m/s]


def along(poses: list[Array], **changes: object) -> World:
    """The floor of `circle` and other set-points."""
    world = load_world("circle")
    task = tuple(Target(pose[:3, 3], orientation=pose[:3, :3]) for pose in poses)
    return replace(world, name="by hand", task=task, **changes)  # type: ignore[arg-type]


def leaning(angle: float, spots: Array, lean: float = 1.0, height: float = 0.2) -> list[Array]:
    """The tool leans forward along one direction of the world at all places on the floor."""
    poses = []
    for x, y in spots:
        pose = rot_z(angle) @ rot_y(np.pi / 2 + lean)
        pose[:3, 3] = x, y, height
        poses.append(pose)
    return poses


@pytest.mark.parametrize("name", ["circle", "door"])
def test_poses_are_met_without_lifting_slipping_or_leaving_limits(name: str) -> None:
    found = planned(name)
    assert found.lift_offs == 0
    robot, at = found.world.robot, found.motion.kind == "setpoint"
    tools = robot.tool(found.motion.base[at], found.motion.joints[at])
    place = max(np.abs(T[:3, 3] - t.position).max() for T, t in zip(tools, found.world.task, strict=True))
    turn = max(np.abs(T[:3, :3] - t.orientation).max() for T, t in zip(tools, found.world.task, strict=True))
    assert place < 1e-9
    assert turn < 1e-9
    assert np.abs(found.motion.joints[:, 0]).max() <= np.pi / 2 + 1e-12
    report = verify(found)
    assert report.ok
    assert 1e-9 - report.margins["wheels"] < 1e-12
    ways = wheel_travel(found.motion.base, robot.gauge)
    assert robot.drive.travel(found.motion.base) == pytest.approx(np.abs(ways.mean(1)).sum())
    times = np.abs(ways).max(1) / SPEED
    assert np.abs(ways / times[:, None]).max() <= SPEED + 1e-12
    assert times.sum() == pytest.approx({"circle": 28.3, "door": 0.988}[name], rel=0.01)


@pytest.mark.parametrize("name", ["circle", "door"])
def test_what_is_drawn_as_areas_holds_the_axis(name: str) -> None:
    found = planned(name)
    for area, target, state in zip(found.areas, found.world.task, found.setpoints, strict=True):
        axis = Point(axis_of(ROBOT, state.base))
        assert area.pruned.covers(axis)
        assert area.pruned.difference(area.admissible).area < 1e-9
        assert area.pruned.area < 4 * PAPERS.tracker.drawn_width**2
        away = Point(target.position[:2]).distance(axis)
        ring = Point(target.position[:2]).buffer(away + 2 * PAPERS.tracker.drawn_width) - Point(
            target.position[:2]
        ).buffer(away / 2)
        assert ring.covers(area.pruned)
        assert area.admissible.intersection(area.rejected).area < 1e-9


def test_the_printed_height_of_the_knob_is_refused_with_the_attainable_ones() -> None:
    world = load_world("door")
    low = tuple(replace(t, position=np.array([*t.position[:2], 0.34])) for t in world.task)
    with pytest.raises(NoPlanFound, match=r"365\.96 to 685\.96 mm.* 340\.00 mm is asked for") as no:
        plan(replace(world, task=low))
    told = no.value.explanation
    assert (told.verdict, told.setpoint) == ("undecided", 0)  # its last joint could bend
    assert told.causes[0].margin == pytest.approx(0.02596, abs=1e-6)
    mended = tuple(replace(t, position=t.position + [0, 0, 0.06]) for t in low)
    assert verify(plan(replace(world, task=mended[:5]))).ok


def test_a_solid_that_leaves_no_heading_is_named() -> None:
    world = load_world("door")
    crates = tuple(
        Box(
            f"crate {k}",
            np.array([0.15, 0.15, 0.1]),
            np.array([0.23 + 0.4 * np.sin(a), 0.4 * np.cos(a), 0.05]),
        )
        for k, a in enumerate(np.arange(8) * np.pi / 4)
    )
    with pytest.raises(NoPlanFound, match=r"25 ways .* all headings .* inside bench") as no:
        plan(replace(world, obstacles=(*world.obstacles, *crates), task=world.task[:5]))
    assert no.value.explanation.causes[0].kind == "obstacle"


def test_set_points_far_apart_are_joined_closely_enough() -> None:
    world = load_world("circle")
    sparse = replace(world, task=world.task[:100:10], rules=replace(world.rules, path_tolerance=0.002))
    found = plan(sparse)
    assert found.lift_offs == 0
    assert (found.motion.kind == "step").sum() > 20
    assert found.stats["margins"]["path"] > 0


def test_a_start_is_driven_away_from() -> None:
    base = np.array([1.0, 1.0, 0.3])
    world = replace(load_world("circle"), start=Start(base, ROBOT.carry))
    world = replace(world, task=world.task[:20])
    found = plan(world)
    assert found.motion.base[0].tolist() == base.tolist()
    assert found.lift_offs == 0
    assert found.motion.kind[0] == "transit"
    on = planned("circle").motion
    there = replace(world, start=Start(on.base[0], on.joints[0]), task=world.task[:5])
    assert plan(there).motion.kind[0] == "setpoint"


def test_joints_keep_the_margin_that_is_asked_for() -> None:
    world = load_world("circle")
    rules = replace(world.rules, criteria=Criteria(joint_margin=0.05))
    found = plan(replace(world, rules=rules, task=world.task[:30]))
    assert np.abs(found.motion.joints[:, 0]).max() <= 0.9 * np.pi / 2 + 1e-12


def round_trip(count: int = 60) -> list[Array]:
    """Once round a circle with a tool that leans one way all the time: the base must turn, joint 1 cannot."""
    angles = 2 * np.pi * np.arange(count) / count
    return leaning(0.0, 2.5 + 0.8 * np.column_stack([np.cos(angles), np.sin(angles)]))


def test_where_joint_one_saturates_under_a_leaning_tool_a_new_run_begins() -> None:
    robot = tracking_robot(ROBOT)
    assert robot is not None
    lower, upper = ROBOT.chain.lower, ROBOT.chain.upper
    runs = track_runs(robot, round_trip(), heading=0.0)
    assert len(runs) > 1
    before, last = runs[0].joints[-2:, 0]
    assert abs(2 * last - before) > robot.pivot_limit  # where it would go on to
    assert sum(len(run.base) for run in runs) == len(round_trip())
    assert all((run.joints >= lower - 1e-9).all() and (run.joints <= upper + 1e-9).all() for run in runs)


def test_a_base_that_must_turn_for_joint_one_lifts_the_tool_for_it() -> None:
    world = along(round_trip())
    found = plan(world)
    assert verify(found).ok
    assert 1 <= found.lift_offs <= 3
    assert found.stats["base_moves"]["drive"] == found.lift_offs
    strict = replace(world, rules=replace(world.rules, max_lift_offs=0))
    assert "the rules allow 0" in verify(replace(found, world=strict)).violations[0].text


def test_worlds_that_the_tracker_does_not_follow() -> None:
    circle = load_world("circle")
    assert can_track(scene_of(circle))
    assert not can_track(scene_of(replace(circle, robot=replace(ROBOT, base="omni"))))
    assert not can_track(scene_of(replace(circle, robot=robot_named("youbot"))))
    assert not can_track(
        scene_of(replace(circle, robot=replace(ROBOT, mount=np.array([0.1, 0.05, 0.1, 0.0]))))
    )
    bare = replace(circle, task=tuple(Target(t.position) for t in circle.task))
    assert not can_track(scene_of(bare))
    check_world(scene_of(bare))  # areas and M-FABRIK plan it
    with pytest.raises(InputError, match=r"rules\.heading: .* expected free, got fixed"):
        check_world(scene_of(replace(circle, rules=replace(circle.rules, heading="fixed"))))


def test_the_arm_is_read_from_its_chain() -> None:
    robot = tracking_robot(ROBOT)
    assert robot is not None
    arm = robot.arm
    assert (robot.ahead, robot.lift) == (0.155, 0.155)
    assert [arm.shoulder_out, arm.shoulder_up, arm.upper] == pytest.approx([0.06875, 0.12, 0.16])
    assert arm.fore == pytest.approx(0.13775 + 0.11321)
    joints = np.array([0.4, -0.5, 1.1, 0.6, 0.0])
    share = arm_share(arm, planar_pose(0, 0, 0, 0.155) @ ROBOT.chain.forward(joints), 0.155)
    np.testing.assert_allclose([*share.joints, share.turn], [-0.5, 1.1, 0.6, 0.4], atol=1e-12)
    assert tracking_robot(robot_named("hinge5")) is None


def test_files_say_the_gauge_and_keep_every_orientation() -> None:
    world = load_world("door")
    again = world_from_document(world_to_document(replace(world, robot=replace(ROBOT, gauge=0.4))))
    assert again.robot.gauge == 0.4
    assert again.robot.base == "differential"
    for a, b in zip(world.task, again.task, strict=True):
        np.testing.assert_array_equal(a.orientation, b.orientation)
