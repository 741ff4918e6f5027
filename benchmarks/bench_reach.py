"""Reach of random arms on a vertical pivot: all of the inner area solved, nothing outside the outer one?

For each pair of a random robot (3 to 7 joints; general or in one plane, with limits and without, on a lift or
not, with a tool direction or without) and a target height: points drawn evenly from the inner area are solved
by M-FABRIK's solver with its base held there; points outside the outer area are searched by damped least
squares from random postures, some of them within centimetres of the area. Prints the counts, the gap between
the two areas as part of the outer one, and the seconds that each took. Exits 1 where a point refutes them.
Run: python -m benchmarks.bench_reach [--pairs N] [--points N] [--starts N]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict

import numpy as np
import shapely

from benchmarks.pivoted import EXACT, KINDS, Case, case, points_in, searched, solved
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array

NEAR = 0.03  # half of the points outside lie this near to the outer area [m]


def outside(one: Case, outer: shapely.Geometry, rng: np.random.Generator, count: int) -> Array:
    """Points outside an area: some next to it, some anywhere near the arm's span."""
    span = reach_bound(one.world.robot.chain)
    everywhere = shapely.Point(0, 0).buffer(1.3 * (span.radius + span.length)) - outer
    if outer.is_empty:
        return points_in(everywhere, rng, count)
    ring = outer.buffer(NEAR) - outer.buffer(1e-6)
    return np.concatenate([points_in(ring, rng, count - count // 2), points_in(everywhere, rng, count // 2)])


def main(pairs: int, points: int, starts: int) -> int:
    kinds: defaultdict[str, list[tuple[float, ...]]] = defaultdict(list)
    wrong = 0
    for number in range(pairs):
        one, rng = case(number), np.random.default_rng(number)
        began = time.perf_counter()
        areas = one.inner()
        middle = time.perf_counter()
        area = one.area()
        end = time.perf_counter()
        got = asked = found = tried = 0
        for row, inner in enumerate(areas.inner):
            spots = points_in(inner, rng, points)
            good = sum(solved(one, areas, row, spot) for spot in spots)
            asked, got = asked + len(spots), got + good
        for spot in outside(one, area.outer, rng, points // 2):
            tried += 1
            found += searched(one, spot, starts, rng) <= EXACT
        if got < asked or found:
            wrong += 1
            inside, beyond = f"{got} of {asked} inside solved", f"{found} of {tried} outside reached"
            print(f"pair {number}, {one.kind}: {inside}, {beyond}")
        outer = area.outer.area
        gap = (outer - area.inner.area) / outer if outer > 0 else 0.0
        kinds[one.kind].append((asked, got, tried, found, gap, middle - began, end - middle))
    print(f"{'kind':>15}  pairs  inside solved    outside reached  gap: median, most  median s inner, outer")
    for kind in KINDS:
        rows = np.array(kinds[kind]).reshape(-1, 7)
        asked, got, tried, found = rows[:, :4].sum(0).astype(int)
        gaps, inner, outer = rows[:, 4], rows[:, 5], rows[:, 6]
        print(
            f"{kind:>15}  {len(rows):5d}  {got:6d} of {asked:6d}  {found:5d} of {tried:6d}  "
            f"{np.median(gaps):8.2%} {gaps.max():8.2%}  {np.median(inner):8.3f} {np.median(outer):8.3f}"
        )
    print(f"refuted: {wrong} of {pairs}")
    return 1 if wrong else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--points", type=int, default=20)
    parser.add_argument("--starts", type=int, default=2000)
    options = parser.parse_args()
    sys.exit(main(options.pairs, options.points, options.starts))
