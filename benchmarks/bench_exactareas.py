"""Areas bounded by arcs against polygons of shapely's, over many random rings on random floors.

Each area must be at least as large as the polygon within it and at most as large as the one around it, both
cut by shapely. Exits 1 where one is not. Run: python benchmarks/bench_exactareas.py [rings]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.sectors import ring_sectors
from regionik.planners.geometry.cells import cells_of
from regionik.planners.geometry.ringarcs import Sectors, measures, outlines

A_FLOOR, SIDE, POINTS, ROUNDING = 10_000, 12.0, 96, 1e-9


def floors() -> Iterator[tuple[BaseGeometry, np.random.Generator]]:
    """Floors with rounded boxes and discs, one after the other."""
    seed = 0
    while True:
        rng = np.random.default_rng(seed)
        count = int(rng.integers(5, 120))
        centres, sizes = rng.uniform(0, SIDE, (count, 2)), rng.uniform(0.02, 0.5, (count, 2))
        boxes = shapely.buffer(shapely.box(*(centres - sizes).T, *(centres + sizes).T), rng.uniform(0, 0.3))
        discs = shapely.buffer(shapely.points(centres), sizes[:, 0])
        taken = shapely.union_all(np.where(rng.random(count) < 0.6, boxes, discs))
        yield shapely.box(0, 0, SIDE, SIDE) - taken, rng
        seed += 1


def sectors(rng: np.random.Generator, count: int) -> Sectors:
    low = rng.uniform(0, 0.6, count) * (rng.random(count) < 0.8)
    high = low / np.cos(np.pi / POINTS) + rng.uniform(1e-3, 0.8, count)
    half = np.where(rng.random(count) < 0.5, np.pi, rng.uniform(0.02, np.pi, count))
    return Sectors(rng.uniform(0, SIDE, (count, 2)), low, high, rng.uniform(-7, 7, count), half)


def main(count: int) -> int:
    wrong, done, furthest, empty = 0, 0, 0.0, 0
    for floor, rng in floors():
        rings = sectors(rng, min(A_FLOOR, count - done))
        exact = measures(outlines(cells_of(floor, 0.2), rings), rings.center)
        shapely.prepare(floor)
        near, far = (
            shapely.area(shapely.intersection(ring_sectors(*rings, margin, POINTS), floor))
            for margin in (0.0, None)
        )
        off = np.maximum(near - exact, exact - far)
        wrong += int(np.count_nonzero(off > ROUNDING))
        furthest, empty = max(furthest, float(off.max())), empty + int(np.count_nonzero(exact == 0.0))
        done += len(exact)
        if done >= count:
            break
    print(f"{done} rings, {empty} empty: {wrong} outside their polygons, at most by {furthest:.1e} m2")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000))
