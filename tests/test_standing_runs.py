"""Runs of poses from one place: the tool is not lifted where going on from the last posture gets stuck."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from regionik.pipeline import plan
from regionik.verification.verifier import verify
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot, capsules_along
from regionik.worlds.scene import Floor, Rules, Target, World
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
