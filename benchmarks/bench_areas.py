"""Areas of many set-points among many obstacles, against a loop over targets, in one run.

Prints seconds, the ratio and the peak memory. Run: python -m benchmarks.bench_areas [set-points] [obstacles]
"""

from __future__ import annotations

import resource
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
import shapely
from shapely import STRtree

from regionik.areas.layers import Geometries
from regionik.postures.families import FRONT
from regionik.reach_table import reach_table
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World


def crowded(setpoints: int, obstacles: int) -> World:
    """A long path over a floor strewn with boxes."""
    rng = np.random.default_rng(0)
    side = 40.0
    boxes = tuple(
        Box(
            f"box {k}",
            np.array([*rng.uniform(0.1, 0.5, 2), 0.1]),
            np.array([*rng.uniform(0, side, 2), 0.05]),
            rng.uniform(0, np.pi),
        )
        for k in range(obstacles)
    )
    share = np.linspace(0, 1, setpoints)
    path = np.column_stack(
        [side * share, side / 2 + side / 3 * np.sin(20 * share), 0.25 + 0.1 * np.sin(300 * share)]
    )
    floor = Floor(shapely.box(-1, -1, side + 1, side + 1))
    return World("crowded", robot_named("youbot"), floor, boxes, tuple(map(Target, path)), Rules())


def loop(world: World) -> Geometries:
    """The same areas, one target after the other: difference with the grown shadows that the tree names."""
    ground = scene_of(world).ground
    grown = ground.inner.parts
    tree = STRtree(grown)
    _, _, rings = reach_table(scene_of(world), world.task, (FRONT,), inner=True)
    areas = []
    for ring in rings:
        near = tree.query(ring, predicate="intersects")
        areas.append((ring & ground.inner.floor) - shapely.union_all(grown[near]))
    return np.array(areas, dtype=object)


def timed(work: Callable[[], object], repeats: int) -> list[float]:
    """Seconds of every repeat."""
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return seconds


def main() -> None:
    setpoints, obstacles = (int(word) for word in (*sys.argv[1:], "10000", "1000")[:2])
    world = crowded(setpoints, obstacles)
    scene_of.cache_clear()
    first = timed(lambda: path_areas(scene_of(world), facings=(FRONT,)), 1)[0]
    bulk, plain = [], []
    for _ in range(3):
        bulk += timed(lambda: path_areas(scene_of(world), facings=(FRONT,)), 1)
        plain += timed(lambda: loop(world), 1)
    ours = path_areas(scene_of(world), facings=(FRONT,)).inner
    gap = float(np.abs(shapely.area(ours) - shapely.area(loop(world))).max())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    ratio = statistics.median(p / b for p, b in zip(plain, bulk, strict=True))
    print(f"{setpoints} set-points, {obstacles} obstacles")
    print(
        f"bulk: first call {first:.2f} s, then {statistics.median(bulk):.2f} s "
        f"({min(bulk):.2f}-{max(bulk):.2f})"
    )
    print(f"loop over targets: {statistics.median(plain):.2f} s; ratio {ratio:.1f}")
    print(f"largest difference in area {gap:.1e} m2; peak memory {memory:.0f} MB")


if __name__ == "__main__":
    main()
