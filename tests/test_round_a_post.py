"""Whole paths where the base has to go round something that the tool passes over."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely

import regionik as rik
from regionik.areas.layers import Geometries
from regionik.moving.base_guide import base_guide
from regionik.moving.options import MOVING
from regionik.pipeline import search
from regionik.pruning import whole_path
from regionik.scene import scene_of
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import World
from tests.harness.rasters import carried, raster
from tests.kinds import BaseKind

REACH = 1.3  # of a UR10e, about [m]


def before_a_wall(base: BaseKind, x: float, off: float, *, depth: float = 0.3, columns: int = 20) -> World:
    """Return a raster by a UR10e on a wall, and a low post so far along it and off it [m]."""
    bare = raster(carried("UR10e", base), "open", columns, rows=3)
    post = Box("post", np.array([0.3, depth, 0.5]), np.array([x, -off, 0.25]))
    return replace(bare, obstacles=(*bare.obstacles, post))


def areas_of(world: World) -> tuple[list[Geometries], tuple[int, ...]]:
    """Return the parts of each set-point's area that pruning leaves, and where the tool has to be lifted."""
    *_, pruned = whole_path(scene_of(world))
    kept = [pruned.ladder.component[pruned.components_at(i)] for i in range(pruned.ladder.count)]
    return kept, pruned.breaks


def test_a_base_path_leads_through_the_areas_round_a_post() -> None:
    areas, breaks = areas_of(before_a_wall("omni", 1.1, 0.8))
    assert not breaks
    guide = base_guide(0, areas, REACH)
    assert guide is not None
    for kept, place in zip(areas, guide.places, strict=True):
        assert shapely.distance(kept, shapely.Point(place)).min() == 0.0
    longest = MOVING.guide.max_cells * MOVING.guide.spacing * REACH
    assert all(np.linalg.norm(b - a) <= longest + 1e-12 for a, b in pairwise(guide.places))
    beside = guide.places[np.abs(guide.places[:, 0] - 1.1) < 0.15]
    assert len(beside)
    assert (beside[:, 1] < -0.8 - 0.15).all()
    assert min(guide.depth) == guide.depth[guide.narrow[0]]


def test_no_base_path_leads_round_what_the_arm_does_not_reach_over() -> None:
    """A low block, farther from the wall than the arm reaches."""
    areas, breaks = areas_of(before_a_wall("omni", 1.1, 1.2, depth=2.2))
    assert base_guide(0, areas, REACH) is None
    assert base_guide(0, areas[: breaks[0]], REACH) is not None


@pytest.mark.slow
def test_the_base_goes_round_a_post_while_the_tool_passes_over_it() -> None:
    """The least motion alone comes up against it, and lifts the tool twice."""
    found = rik.plan(before_a_wall("omni", 1.1, 0.8))
    assert found.lift_offs == 0
    assert rik.verify(found).ok


@pytest.mark.slow
@pytest.mark.parametrize("base", ["omni", "differential"])
@pytest.mark.parametrize("x", [0.5, 0.9])
@pytest.mark.parametrize("off", [0.75, 0.85])
def test_wherever_the_post_stands_the_tool_is_not_lifted(base: BaseKind, x: float, off: float) -> None:
    assert search(scene_of(before_a_wall(base, x, off, columns=14))).lift_offs == 0
