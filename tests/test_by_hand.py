"""The papers' methods by their public names."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import regionik as rik
from tests import examples


@settings(max_examples=examples(60))
@given(st.integers(0, 10_000), st.floats(0.05, 1.0))
def test_steps_stay_inside_and_are_no_longer_than_asked(seed: int, step: float) -> None:
    """Among random walls: no step leaves the area, none leads away, the last is the goal if it arrived."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform([0.5, 0, 0, 0], [3, 2, 0.6, 1.2], (3, 4))
    walls = [shapely.box(x, y, x + w, y + h) for x, y, w, h in corners]
    area = shapely.box(0, 0, 4, 2) - shapely.union_all(walls)
    area = max(shapely.get_parts(area), key=lambda part: float(part.area))
    ends = np.array([area.representative_point().coords[0], shapely.get_coordinates(area.buffer(-0.01))[0]])
    found = rik.base_steps(area, ends[0], ends[1], step)
    np.testing.assert_allclose(found.points[0], ends[0], atol=1e-9)
    way = np.linalg.norm(np.diff(found.points, axis=0), axis=1)
    assert way.max(initial=0.0) <= step + 1e-9
    lines = [shapely.LineString(pair) for pair in zip(found.points, found.points[1:], strict=False)]
    assert all(area.buffer(1e-6).covers(line) for line in lines)
    left = np.linalg.norm(found.points - ends[1], axis=1)
    assert (np.diff(left) <= 1e-9).all()
    assert found.arrived == (left[-1] <= 1e-9)


def test_steps_with_ends_outside_or_no_length_are_refused() -> None:
    floor = shapely.box(0, 0, 1, 1)
    with pytest.raises(rik.RegionikError, match=r"start \(2.000, 0.500\) is 1 m outside the free area"):
        rik.base_steps(floor, [2.0, 0.5], [0.5, 0.5], 0.1)
    with pytest.raises(rik.InputError, match="step: expected a length above 0"):
        rik.base_steps(floor, [0.2, 0.5], [0.5, 0.5], 0.0)


@pytest.mark.parametrize("name", ["tao1", "tao2", "tao3"])
def test_avoiding_fabrik_brings_the_tool_there_clear_of_the_circles(name: str) -> None:
    """The paper's own three scenes; distances are those of lines and circles."""
    world = rik.load_world(name)
    assert world.start is not None
    target = world.task[0]
    tries = (
        rik.avoiding_fabrik(world, target.position, world.start.base, world.start.joints, seed=seed)
        for seed in range(20)
    )
    found = next(one for one in tries if one.converged)
    tool = world.robot.tool(found.base, found.joints)[:3, 3]
    assert found.error == pytest.approx(float(np.linalg.norm(tool - target.position)), abs=1e-9)
    assert found.error <= world.rules.tolerance
    arm = shapely.LineString(world.robot.frames(found.base[None], found.joints[None])[0, :, :2, 3])
    circles = [one for one in world.obstacles if isinstance(one, rik.Cylinder)]
    assert len(circles) == 5
    for circle in circles:  # links are 2 cm thick about their lines
        assert arm.distance(shapely.Point(circle.center[:2])) >= circle.radius + 0.02 - 1e-6


def test_avoiding_fabrik_refuses_a_negative_seed() -> None:
    world = rik.load_world("tao1")
    assert world.start is not None
    with pytest.raises(rik.InputError, match="seed: expected a whole number from 0 up, got -1"):
        rik.avoiding_fabrik(world, [1, 0, 0], world.start.base, world.start.joints, seed=-1)
