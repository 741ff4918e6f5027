"""What if: areas and verdict of a changed world, whose parts that have not changed stay the same objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.pruning import whole_path
from regionik.scene import scene_of
from regionik.view.live import LiveAreas, is_equal, live_areas, live_meshes, verdict
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples


def crowded(seed: int = 0) -> World:
    """A wave over a hall with boxes."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, 30)
    path = np.column_stack([1 + 4 * share, 3 + np.sin(6 * share), np.full(30, 0.6)])
    boxes = [box(f"box {k}", *rng.uniform([0.5, 1], [5.5, 5])) for k in range(15)]
    rules = Rules(clearance=0.1)
    floor = Floor(shapely.box(0, 0, 6, 6))
    return World("hall", robot_named("youbot"), floor, tuple(boxes), tuple(map(Target, path)), rules)


def box(name: str, x: float, y: float) -> Box:
    return Box(name, np.array([0.3, 0.2, 0.4]), np.array([x, y, 0.2]), 0.3)


def changed(world: World, seed: int) -> World:
    """One thing changed, or a few."""
    rng = np.random.default_rng(seed)
    what = rng.integers(6)
    solids, task = list(world.obstacles), list(world.task)
    if what == 0:
        k = rng.integers(len(solids))
        solids[k] = box(f"{solids[k].name} anew", *rng.uniform([0.5, 1], [5.5, 5]))
    elif what == 1:
        k = rng.integers(len(solids))
        solids[k] = box(solids[k].name, *rng.uniform([0.5, 1], [5.5, 5]))
    elif what == 2:
        del solids[rng.integers(len(solids))]
    elif what == 3:
        k = rng.integers(len(task))
        task[k] = Target(task[k].position + rng.uniform(-0.2, 0.2, 3))
    elif what == 4:
        task = task[rng.integers(5) :]
    else:
        return replace(world, rules=replace(world.rules, clearance=float(rng.uniform(0, 0.2))))
    return replace(world, obstacles=tuple(solids), task=tuple(task))


def assert_same(one: LiveAreas, other: LiveAreas) -> None:
    assert (one.areas.target == other.areas.target).all()
    assert one.areas.family == other.areas.family
    assert shapely.equals_exact(one.areas.inner, other.areas.inner, 1e-12).all()
    assert (one.explanation is None) == (other.explanation is None)
    if one.explanation is not None and other.explanation is not None:
        assert one.explanation.reason == other.explanation.reason
    if one.pruned is not None and other.pruned is not None:
        assert one.pruned.breaks == other.pruned.breaks


@settings(max_examples=examples(25))
@given(st.integers(0, 3), st.lists(st.integers(0, 10_000), min_size=1, max_size=4))
def test_a_chain_of_changes_comes_to_what_is_made_from_nothing(seed: int, changes: list[int]) -> None:
    world = crowded(seed)
    seen = live_areas(world)
    for change in changes:
        world = changed(world, change)
        seen = live_areas(world, seen)
    assert_same(seen, live_areas(world))


@pytest.mark.parametrize("name", ["pillar", "shelf"])
def test_the_verdict_is_that_of_a_plan(name: str) -> None:
    world = load_world(name)
    pruned = whole_path(scene_of(world))[2]
    seen = live_areas(world)
    assert seen.pruned is not None
    assert len(seen.pruned.breaks) == len(pruned.breaks)
    assert verdict(seen).startswith(f"All {len(world.task)} set-points")


def test_what_cannot_be_done_is_told_as_a_plan_tells_it() -> None:
    world = crowded()
    away = replace(world, task=(*world.task, Target(np.array([3.0, 3.0, 2.5]))))
    seen = live_areas(away)
    with pytest.raises(NoPlanFound) as failure:
        whole_path(scene_of(away))
    assert seen.explanation is not None
    assert verdict(seen) == failure.value.explanation.reason
    missing = [body for body in live_meshes(seen) if body.path == "task/missing"]
    assert len(missing) == 1


def test_bodies_of_what_stays_are_the_same() -> None:
    world = crowded()
    first = live_areas(world)
    before = {body.path: body for body in live_meshes(first)}
    moved = replace(world, obstacles=(*world.obstacles[:-1], box("box 14", 5.0, 0.5)))
    after = {body.path: body for body in live_meshes(live_areas(moved, first))}
    other = [
        path
        for path in before
        if path.startswith(("obstacles", "floor")) and not is_equal(before[path].mesh, after[path].mesh)
    ]
    assert sorted(other) == ["floor/rejected/14", "obstacles/14"]


def test_is_equal() -> None:
    assert is_equal(crowded().obstacles, crowded().obstacles)
    assert not is_equal(box("a", 0, 0), box("a", 0, 1e-12))
    assert not is_equal((1, 2), (1, 2, 3))
    assert not is_equal(1, 1.0)
