"""Bundled worlds that need a method of the papers: without it there is no plan."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import regionik as rik
from regionik.planners.avoidance.avoiding_fabrik import AvoidanceResult
from tests.maths import Array
from tests.planned import planned

ROTATIONS = "regionik.planners.avoidance.clear_posture.avoid_obstacles"


def nothing_found(
    _chain: object, _target: Array, joints: Array, _clear: Callable[..., bool], **_: object
) -> AvoidanceResult:
    """FABRIK with obstacle-avoiding rotations that gets nowhere."""
    return AvoidanceResult(joints, np.inf, 0, False)


@pytest.mark.parametrize("name", ["posts1", pytest.param("posts2", marks=pytest.mark.slow)])
def test_worlds_of_posts_need_obstacle_avoiding_rotations(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = planned(name)
    assert len(found.setpoints) == 7
    assert found.lift_offs == 0
    assert rik.verify(found).ok
    monkeypatch.setattr(ROTATIONS, nothing_found)
    with pytest.raises(rik.NoPlanFound) as no:
        rik.plan(rik.load_world(name))
    assert no.value.explanation.verdict == "no-posture"
