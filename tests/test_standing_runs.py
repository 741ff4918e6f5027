"""Runs of poses from one place: the tool is not lifted where going on from the last posture gets stuck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.parking.standing_runs import standing_runs
from regionik.pipeline import plan
from regionik.postures.poses import axis_of
from regionik.pruning import choose_chain, whole_path
from regionik.verification.verifier import verify
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Heading, Rules, Target, World
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
    standing, _, pruned = whole_path(scene)
    chain = choose_chain(pruned, standing, None)
    chosen, found = standing_runs(scene, pruned, chain, standing)
    assert len(found) == (5 if heading == "free" else 0)
    assert len({tuple(one.base) for one in found.values()}) <= 1
    for i, one in found.items():
        around = pruned.ladder.component[chosen[i]]
        assert around.distance(shapely.Point(axis_of(scene.robot, one.base))) < 1e-9
        assert one.converged
