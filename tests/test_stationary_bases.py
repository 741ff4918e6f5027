"""Runs of poses from one place: the tool is not lifted where going on from the last posture gets stuck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.moving.stationary_bases import component_around, stationary_bases
from regionik.pipeline import plan, search
from regionik.planners.tries import at_most
from regionik.pruning import whole_path
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.harness.worlds import WORLDS
from tests.kinds import Heading
from tests.measures import axis_of
from tests.test_closed_form import ARMS

DOWN = np.diag([1.0, -1.0, -1.0])


def world(*, wide: float, post: float) -> World:
    """A Panda that stands still and draws a line across, with a post beside its elbow."""
    chain = ARMS["panda"]
    robot = Robot(
        name="panda",
        base="omni",
        footprint=np.zeros((1, 2)),
        mount=np.zeros(4),
        chain=chain,
        solids=capsules_along(chain, 0.05),
        body_height=0.1,
        turning_radius=0.0,
    )
    task = tuple(
        Target(np.array([0.45, y, 0.35]), orientation=DOWN, cone=0.01) for y in np.linspace(-wide, wide, 25)
    )
    solids = (Box("post", np.array([0.06, 0.06, 0.6]), np.array([0.15, post, 0.7])),)
    rules = Rules(clearance=0.0, heading="fixed", reach_margin=0.0, solid_floor=False)
    return World("line", robot, Floor(shapely.box(-1e-3, -1e-3, 1e-3, 1e-3)), solids, task, rules)


@pytest.mark.parametrize("post", [0.15, -0.15])
def test_a_run_from_one_place_needs_no_lift_off(post: float) -> None:
    found = plan(world(wide=0.5, post=post))
    assert found.lift_offs == 0
    assert verify(found).ok
    joints = np.array([one.joints for one in found.setpoints])
    assert np.abs(np.diff(joints, axis=0)).max() < 0.5


@pytest.mark.parametrize("heading", ["free", "face_target"])
def test_a_base_that_faces_its_targets_does_not_stand(heading: Heading) -> None:
    scene = world(wide=0.2, post=0.5)
    scene = replace(
        scene,
        floor=Floor(shapely.box(-0.5, -0.5, 0.5, 0.5)),
        task=scene.task[::6],
        rules=replace(scene.rules, heading=heading),
    )
    free_space, _, pruned = whole_path(scene_of(scene))
    found = list(stationary_bases(scene_of(scene), pruned.ladder, pruned.keep, free_space, 0, 5))
    assert bool(found) == (heading == "free")
    for base in found:
        for i in range(5):
            k = component_around(scene_of(scene), pruned.ladder, pruned.keep, i, base)
            around = pruned.ladder.component[k]
            assert around.distance(shapely.Point(axis_of(scene.robot, base.pose))) < 1e-9


def test_headings_a_whole_turn_apart_are_one() -> None:
    """At a fixed heading all that are wished for are the same."""
    scene = scene_of(world(wide=0.2, post=0.5))
    free_space, _, pruned = whole_path(scene)
    found = list(stationary_bases(scene, pruned.ladder, pruned.keep, free_space, 0, len(scene.task)))
    poses = [(*base.pose[:2], *np.round([np.cos(base.pose[2]), np.sin(base.pose[2])], 6)) for base in found]
    assert found
    assert len(set(poses)) == len(poses)


@pytest.mark.slow
def test_places_to_stand_at_are_given_up_before_long() -> None:
    """None does for a Panda's way past a bollard: 400 tries were made, half of them from such places."""
    with at_most(300):
        assert search(scene_of(WORLDS["raster-panda-bollard"]())).lift_offs == 2


@pytest.mark.slow
def test_a_run_keeps_off_limits_that_it_begins_beside() -> None:
    """A circle on a wall that M-FABRIK begins beside the limits of two joints needs no lift-off."""
    outline = np.array([[0.35, 0.25], [-0.35, 0.25], [-0.35, -0.25], [0.35, -0.25]])
    cart = replace(
        world(wide=0.5, post=0.15).robot,
        footprint=outline,
        mount=np.array([0.15, 0, 0.38, 0]),
        body_height=0.38,
    )
    turns = np.linspace(0, 2 * np.pi, 24)
    task = tuple(
        Target(np.array([0.0, 0.3 * np.sin(turn), 0.7 + 0.3 * np.cos(turn)]), direction=np.array([1.0, 0, 0]))
        for turn in turns
    )
    posts = tuple(
        Cylinder(f"post at {x}, {y}", 0.1, 1.0, np.array([x, y, 0.5]))
        for x, y in ((-0.9, -1.2), (-1.3, 0.0), (-0.9, 1.2))
    )
    wall = Box("wall", np.array([0.1, 4.0, 1.8]), np.array([0.25, 0.0, 0.9]))
    rules = Rules(clearance=0.05, arm_clearance=0.005)
    found = plan(World("circle", cart, Floor(shapely.box(-4, -4, 4, 4)), (*posts, wall), task, rules))
    assert found.lift_offs == 0
