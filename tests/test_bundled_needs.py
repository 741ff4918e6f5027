"""Bundled worlds that need a method of the papers: without it there is no plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.planners.avoidance.avoiding_fabrik import AvoidanceResult
from tests.maths import Array
from tests.planned import planned

OMPL = "regionik.planners.driving.sampling._connected"
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


@pytest.mark.parametrize("name", ["tao1", "tao2"])
def test_two_worlds_of_tao_need_ompl_for_base_and_arm(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert planned(name).stats["base_moves"]["whole body"] == 1
    monkeypatch.setattr(OMPL, lambda *_: None)
    with pytest.raises(rik.NoPlanFound):
        rik.plan(rik.load_world(name))


@pytest.mark.slow
def test_a_car_backs_out_of_an_aisle_by_ompl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it the car has to drive once more with the tool lifted, and farther."""
    found = planned("facade")
    assert found.lift_offs == 0
    assert found.stats["base_moves"]["ompl"] >= 1
    assert rik.verify(found).ok
    monkeypatch.setattr(OMPL, lambda *_: None)
    without = rik.plan(rik.load_world("facade"))
    assert without.lift_offs > 0
    assert without.stats["base_travel"] > found.stats["base_travel"]


def test_a_whole_base_goes_through_a_corridor_in_which_it_cannot_turn_round() -> None:
    found = planned("corridor")
    robot, base = found.world.robot, found.motion.base
    assert rik.verify(found).ok
    inside = (base[:, 0] > 2.8) & (base[:, 1] < 2.2)
    assert inside.any()
    across = 2 * np.linalg.norm(robot.footprint, axis=1).max()
    assert across > 0.6  # it does not fit at every heading
    assert np.ptp(base[inside, 2]) < np.pi / 4


def test_a_scan_is_gone_over_with_the_base_beside_it() -> None:
    """An open mesh with holes, without which base and arm would go through it."""
    found = planned("heap")
    (heap,) = found.world.obstacles
    assert isinstance(heap, rik.Mesh)
    edges = np.sort(heap.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 1).any()
    assert found.lift_offs == 0
    assert rik.verify(found).ok
    without = rik.plan(replace(found.world, obstacles=()))
    kinds = {one.kind for one in rik.verify(replace(without, world=found.world)).violations}
    assert {"arm", "clearance"} <= kinds


def bend(width: float) -> rik.World:
    """The corridor of another width [m]."""
    world = rik.load_world("corridor")
    wide = [
        (3.4 - width if x == 2.8 else x, 0.7 + width if y == 1.3 else y)
        for x, y in world.floor.polygon.exterior.coords
    ]
    return replace(world, floor=replace(world.floor, polygon=shapely.Polygon(wide)))


@pytest.mark.slow
def test_a_bend_that_slabs_of_heading_leave_a_gap_in_is_passed_by_ompl() -> None:
    found = rik.plan(bend(0.55))
    assert rik.verify(found).ok
    assert found.lift_offs == 1
    assert found.stats["base_moves"]["ompl"] >= 1
    with pytest.raises(rik.NoPlanFound, match="No way was found between set-points 5 and 6") as no:
        rik.plan(bend(0.46))
    assert no.value.explanation.verdict == "ladder-broken"
