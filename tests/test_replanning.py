"""A stop planned again from where the base truly stands."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from regionik.parking.replanning import replan_stop
from regionik.pipeline import plan
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError, NoPlanFound
from tests.test_stops import ruled


@lru_cache(maxsize=2)
def planned(order: str) -> Plan:
    return plan(ruled(load_world("pillar"), mode="stops", order=order))


@pytest.mark.parametrize("order", ["given", "any"])
def test_the_arm_makes_up_for_where_the_base_stands(order: str) -> None:
    """Anywhere in the circle to park in, and turned a little: what is returned holds, with the base there."""
    found, rng = planned(order), np.random.default_rng(0)
    done = 0
    for n, stop in enumerate(found.stops):
        for _ in range(4):
            angle, share = rng.uniform(-np.pi, np.pi), rng.uniform(0, 0.9)
            off = share * stop.tolerance * np.array([np.cos(angle), np.sin(angle)])
            pose = stop.base + [*off, rng.uniform(-0.02, 0.02)]
            try:
                again = replan_stop(found, n, pose)
            except NoPlanFound:
                continue
            done += 1
            assert verify(again).ok
            assert np.array_equal(again.motion.base, np.tile(pose, (len(again.motion), 1)))
            assert [goal.position.tolist() for goal in again.world.task] == [
                found.world.task[i].position.tolist() for i in stop.setpoints
            ]
    assert done >= 7  # of 8


def test_from_where_it_was_planned_the_motion_hardly_changes() -> None:
    found = planned("given")
    again = replan_stop(found, 1, found.stops[1].base)
    at = np.flatnonzero(found.motion.kind == "setpoint")[list(found.stops[1].setpoints)]
    other = again.motion.joints[again.motion.kind == "setpoint"]
    assert found.motion.joints[at] == pytest.approx(other, abs=0.02)


def test_too_far_off_is_told() -> None:
    found = planned("given")
    with pytest.raises(NoPlanFound, match=r"Set-point 1 of 15 .*no posture near the planned one"):
        replan_stop(found, 0, found.stops[0].base + [0.0, -3.0, 0.0])
    with pytest.raises(InputError, match="stop: expected one of the plan's stops, 0 to 1, got 2"):
        replan_stop(found, 2, found.stops[0].base)
    with pytest.raises(InputError, match="measured_pose"):
        replan_stop(found, 0, [0.0, np.nan, 0.0])
