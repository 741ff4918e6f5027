import itertools

import numpy as np
import pytest
import shapely

from regionik.areas.free_space import FreeSpace
from regionik.areas.ground import Side
from regionik.ladder import Ladder, build_ladder
from regionik.motion import connect_setpoints
from regionik.postures.families import FRONT, Family
from regionik.postures.poses import lift_offs
from regionik.pruning import Pruned, choose_chain, prune, start_place, whole_path
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.worlds.documents.world_file import load_world


def random_ladder(rng: np.random.Generator, *, turning: bool = False) -> Ladder:
    """Up to six rungs of one to three components, joined at random; with turning, some in one group."""
    sizes = rng.integers(1, 4, rng.integers(2, 7))
    target = np.repeat(np.arange(len(sizes)), sizes)
    pairs = [
        (a, b)
        for a, b in itertools.product(range(len(target)), repeat=2)
        if target[b] == target[a] + 1 and rng.random() < 0.5
    ]
    squares = np.array([shapely.box(k, 0, k + 1, 1) for k in range(len(target))], dtype=object)
    kind = 2 * target + rng.integers(0, 2, len(target)) if turning else np.arange(len(target))
    turns = [(a, b) for a, b in itertools.combinations(range(len(target)), 2) if kind[a] == kind[b]]
    return Ladder(
        len(sizes),
        squares,
        target.astype(np.intp),
        tuple(Family(FRONT) for _ in target),
        np.zeros(len(target), dtype=np.intp),
        np.zeros(len(target), dtype=np.intp),
        lambda apart: np.array(pairs if apart else turns, dtype=np.intp).reshape(-1, 2),
    )


NO_FLOOR = FreeSpace((Side(shapely.Polygon(), np.empty(0, dtype=object)),))


def traversals(ladder: Ladder) -> list[tuple[int, ...]]:
    """Every choice of one component a rung."""
    rungs = ladder.rungs
    return list(itertools.product(*(range(a, b) for a, b in itertools.pairwise(rungs))))


def lifts(ladder: Ladder, chain: tuple[int, ...] | list[int]) -> int:
    return len(lifted_before(ladder, chain))


def lifted_before(ladder: Ladder, chain: tuple[int, ...] | list[int]) -> list[int]:
    edges = {(int(ladder.group[a]), int(ladder.group[b])) for a, b in ladder.edges.tolist()}
    steps = enumerate(itertools.pairwise(ladder.group[list(chain)].tolist()), start=1)
    return [i for i, pair in steps if pair not in edges]


@pytest.mark.parametrize("turning", [False, True])
def test_lift_offs_are_fewest_and_cuts_keep_every_full_traversal(turning: bool) -> None:
    rng = np.random.default_rng(0)
    whole = 0
    for _ in range(300):
        ladder = random_ladder(rng, turning=turning)
        pruned = prune(ladder, np.ones(len(ladder.component), dtype=bool), np.zeros(ladder.count, dtype=bool))
        every = traversals(ladder)
        assert len(pruned.breaks) == min(lifts(ladder, chain) for chain in every)
        if not pruned.breaks:
            whole += 1
            used = {k for chain in every if lifts(ladder, chain) == 0 for k in chain}
            assert used == set(np.flatnonzero(pruned.keep).tolist())
        chosen = choose_chain(pruned, NO_FLOOR, None)
        assert lifts(ladder, chosen) == len(pruned.breaks)
        assert all(pruned.keep[k] for k in chosen)
    assert whole > 50


def test_unusable_components_are_never_kept() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        ladder = random_ladder(rng)
        usable = rng.random(len(ladder.component)) < 0.6
        assert not prune(ladder, usable, np.zeros(ladder.count, dtype=bool)).keep[~usable].any()


def test_the_tool_is_lifted_between_strokes_where_that_does() -> None:
    rng = np.random.default_rng(2)
    moved, split = 0, 0
    for _ in range(900):
        ladder = random_ladder(rng)
        within = rng.random(ladder.count) < 0.5
        within[0] = False
        usable = np.ones(len(ladder.component), dtype=bool)
        pruned = prune(ladder, usable, within)
        every = [lifted_before(ladder, chain) for chain in traversals(ladder)]
        fewest = min(int(within[breaks].sum()) for breaks in every)
        assert len(pruned.split(within)) == fewest
        assert within[list(pruned.breaks)].sum() == fewest
        if not fewest and pruned.breaks:
            assert len(pruned.breaks) == min(len(some) for some in every if not within[some].any())
            moved += pruned.breaks != prune(ladder, usable, ~usable[: ladder.count]).breaks
        split += fewest
    assert (moved, split) > (5, 5)


def test_pocket_of_l_shape_is_cut_out() -> None:
    """M-FABRIK, experiment 4: the components inside the L at set-points 14 to 22 lead nowhere."""
    world = load_world("l_shape")
    _, _, pruned = whole_path(scene_of(world))
    rungs = pruned.ladder.rungs
    cut = [i + 1 for i in range(40) if not pruned.keep[rungs[i] : rungs[i + 1]].all()]
    assert pruned.breaks == ()
    assert cut == list(range(14, 23))
    assert all(pruned.keep[a:b].sum() == 1 for a, b in itertools.pairwise(rungs))
    pocket = shapely.Point(1.5, 0.4)
    assert pruned.ladder.component[rungs[17] : rungs[18]][0] is not None
    assert not any(pruned.area(i).covers(pocket) for i in range(13, 22))


def test_l_shape_without_pruning_lifts_off() -> None:
    """The nearest place of every area, one after the other, ends in the pocket."""
    world = load_world("l_shape")
    free_space = scene_of(world).free_floor.anywhere
    areas = path_areas(scene_of(world), facings=(FRONT,))
    ladder = build_ladder(areas, len(world.task), free_space)
    rungs = ladder.rungs
    start = start_place(scene_of(world))
    assert start is not None
    assert world.start is not None
    spot = shapely.Point(start[:2])
    chain: list[int] = []
    for a, b in itertools.pairwise(rungs):
        gaps = shapely.distance(ladder.component[a:b], spot)
        chain.append(int(a + np.argmin(gaps)))
        spot = shapely.Point(shapely.shortest_line(ladder.component[chain[-1]], spot).coords[0])
    edges = set(map(tuple, ladder.edges.tolist()))
    breaks = tuple(i + 1 for i, pair in enumerate(itertools.pairwise(chain)) if pair not in edges)
    keep = np.zeros(len(ladder.component), dtype=bool)
    keep[chain] = True
    joined = connect_setpoints(scene_of(world), Pruned(ladder, keep, breaks), free_space, 0)
    assert lift_offs(joined.motion) >= 1


def test_overlaps_agree_with_every_pair() -> None:
    world = load_world("l_shape")
    ladder = build_ladder(path_areas(scene_of(world)), len(world.task), scene_of(world).free_floor.anywhere)
    expected = {
        (a, b)
        for a in range(len(ladder.target))
        for b in np.flatnonzero(ladder.target == ladder.target[a] + 1).tolist()
        if ladder.family[a].facing == ladder.family[b].facing
        and ladder.component[a].intersection(ladder.component[b]).area > 1e-8
    }
    assert set(map(tuple, ladder.edges.tolist())) == expected
