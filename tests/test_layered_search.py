"""The layered graph of a base on wheels: least costs, against a search of the graph as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from regionik.moving import layered_search
from regionik.moving.layered_search import EDGE_COST, LIFT_COST, Layer, LayeredSearch
from regionik.planners.driving.pose_lattice import spin_moves
from regionik.pruning import whole_path
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.maths import Array
from tests.measures import axis_of

COUNT = 4


def search(seed: int) -> LayeredSearch:
    """A path of a few set-points among boxes, on a coarse lattice."""
    rng = np.random.default_rng(seed)
    robot = replace(robot_named("youbot"), base="differential")
    spots = np.cumsum(rng.uniform(-0.3, 0.3, (COUNT, 2)), axis=0)
    task = tuple(Target(np.array([*spot, 0.3])) for spot in spots)
    boxes = tuple(
        Box(f"box {k}", np.array([0.3, 0.3, 1.0]), np.array([*rng.uniform(-1, 1, 2), 0.5])) for k in range(3)
    )
    world = World("random", robot, Floor(shapely.box(-2, -2, 2, 2)), boxes, task, Rules(avoidance=False))
    free_space, _, pruned = whole_path(scene_of(world))
    return LayeredSearch(scene_of(world), pruned.ladder, pruned.keep, pruned.breaks, free_space)


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layered_search, "CELLS_ACROSS", 5)
    monkeypatch.setattr(layered_search, "CELL_SIZES", (0.01, 0.3))


def nodes(layer: Layer) -> list[tuple[int, int, int, int]]:
    """Facing, heading and cell of every node."""
    found = np.argwhere(layer.owner >= 0)
    found[:, 2:] += layer.corner
    return [(f, h, x, y) for f, h, x, y in found.tolist()]


def value_at(layer: Layer, node: tuple[int, ...]) -> float:
    f, h, x, y = node
    return float(layer.value[f, h, x - layer.corner[0], y - layer.corner[1]])


def costs_of_graph(graph: LayeredSearch) -> list[Array]:
    """Least cost of every node of every layer, by Dijkstra's algorithm from the end of the path."""
    layers = [graph.layer(i) for i in range(COUNT)]
    number = {(i, *node): 0 for i, layer in enumerate(layers) for node in nodes(layer)}
    number = {node: k for k, node in enumerate(number)}
    hub = len(number)  # one for each layer, by which a lifted tool gets to all nodes of it; then the sink
    sink, edges = hub + COUNT, dict[tuple[int, int], float]()

    def edge(a: int, b: int, cost: float) -> None:
        edges[(b, a)] = min(cost, edges.get((b, a), np.inf))

    held = [set(nodes(layer)) for layer in layers]
    for (i, f, h, x, y), k in number.items():
        edge(hub + i, k, 0.0)
        for move in spin_moves(graph.cell, layered_search.TURN_WEIGHT):
            there = (i, f, move.end, x + move.dx, y + move.dy)
            if move.start == h and there in number:
                edge(k, number[there], move.cost)
        rim = step_cost(graph, held[i], i, (f, h, x, y))
        if i == COUNT - 1:
            edge(k, sink, rim)
            continue
        if (i + 1, f, h, x, y) in number and i + 1 not in graph.breaks:
            edge(k, number[(i + 1, f, h, x, y)], rim)
        edge(k, hub + i + 1, LIFT_COST + rim)
    pairs = np.array(list(edges)).T
    weights = np.array(list(edges.values())) + 1e-12  # no edge may vanish
    table = csr_array((weights, (pairs[0], pairs[1])), shape=(sink + 1, sink + 1))
    least = dijkstra(table, indices=sink)
    return [np.array([least[number[(i, *node)]] for node in nodes(layers[i])]) for i in range(COUNT)]


def step_cost(
    graph: LayeredSearch, held: set[tuple[int, int, int, int]], i: int, node: tuple[int, ...]
) -> float:
    """What standing near the edge of a layer costs: cells of its own heading, one at a time."""
    f, h, x, y = node
    depth = max(1, round(layered_search.MAX_EDGE_DEPTH / graph.cell))
    inside = 0
    while inside < depth and all(
        (f, h, x + dx, y + dy) in held
        for dx in range(-inside - 1, inside + 2)
        for dy in range(-inside - 1 + abs(dx), inside + 2 - abs(dx))
    ):
        inside += 1
    spots = [target.position for target in graph.scene.task]
    stride = 0.0 if i == COUNT - 1 else float(np.linalg.norm(spots[i + 1] - spots[i]))
    return EDGE_COST * stride * (1 - inside / depth)


@pytest.mark.parametrize("seed", range(4))
def test_values_are_the_least_costs_of_the_whole_graph(seed: int) -> None:
    graph = search(seed)
    for i, wanted in enumerate(costs_of_graph(graph)):
        layer = graph.layer(i)
        found = [value_at(layer, node) for node in nodes(layer)]
        np.testing.assert_allclose(found, wanted, atol=1e-6)
        assert graph.lift_offs(i) == int(min(wanted) // LIFT_COST)


@pytest.mark.parametrize("seed", range(2))
def test_poses_lie_in_their_components_and_the_first_costs_least(seed: int) -> None:
    graph = search(seed)
    ladder, here = graph.ladder, np.array([0.1, -0.1, 0.4])
    for i in range(COUNT):
        components = [k for k in range(ladder.rungs[i], ladder.rungs[i + 1]) if graph.keep[k]]
        offered = list(graph.arrivals(i, components, here))
        assert offered
        for pose, k in offered:
            axis = axis_of(graph.scene.robot, pose)
            assert k in components
            assert shapely.contains_xy(ladder.component[k], *axis)
        steered = [pose.tolist() for pose, _ in graph.onward(i, components, here)]
        assert all(pose in [one.tolist() for one, _ in offered] for pose in steered)
    assert list(graph.arrivals(0, [], here)) == []
