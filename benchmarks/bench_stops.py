"""Fewest stops: against all ways to cut 100 random paths, a grid, covers from sampled places, and on depot.

Tours of twelve holes and fewer are compared with every order. Every number is counted in this run.
Run: python -m benchmarks.bench_stops [picture.png]
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from itertools import permutations, product

import numpy as np
import shapely

from regionik.parking.fewest_stops import park
from regionik.parking.stops import find
from regionik.planners.coverage.set_cover import least_cover, undominated
from regionik.planners.coverage.tours import shortest_tour_of_sets
from regionik.postures.families import BACK, FRONT
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.view.figures import plot_stops
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.scene import Floor, Rules, Target, World

RULES = Rules(clearance=0.05, mode="stops")
GRID = 0.01  # [m]
SPACING = 0.02  # [m]
SETS = 100


def posts(rng: np.random.Generator, count: int, low: list[float], high: list[float]) -> tuple[Cylinder, ...]:
    spots = rng.uniform(low, high, (count, 2))
    return tuple(Cylinder(f"post {k}", 0.05, 0.1, np.array([*spot, 0.05])) for k, spot in enumerate(spots))


def path(seed: int) -> World:
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, int(rng.integers(6, 20)))
    points = np.column_stack(
        [
            rng.uniform(0.8, 3.0) * share,
            rng.uniform(0.1, 0.6) * np.sin(share * rng.uniform(1, 8)),
            rng.uniform(0.2, 0.4) + 0.05 * np.sin(5 * share),
        ]
    )
    solids = posts(rng, int(rng.integers(0, 8)), [-0.3, -0.8], [3.3, 0.8])
    floor = Floor(shapely.box(-1.5, -2, 4.5, 2))
    return World(f"path {seed}", robot_named("youbot"), floor, solids, tuple(map(Target, points)), RULES)


def holes(seed: int) -> World:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform([0, 0], [6, 4], (200, 2)), rng.uniform(0.2, 0.4, 200)])
    floor, rules = Floor(shapely.box(-1, -1, 7, 5)), replace(RULES, order="any")
    solids = posts(rng, 10, [0, 0], [6, 4])
    return World(f"holes {seed}", robot_named("youbot"), floor, solids, tuple(map(Target, points)), rules)


def fewest(world: World, grid: bool) -> int:
    """By dynamic programming over all ways to cut the path."""
    count, by = len(world.task), world.rules.stop_tolerance
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-1.5, 4.5, GRID), np.arange(-2, 2, GRID)))
    rows = []
    for facing in (FRONT, BACK):
        found = path_areas(scene_of(world), facings=(facing,))
        areas = [shapely.union_all(found.inner[found.target == i]).buffer(-by, 64) for i in range(count)]
        rows.append([shapely.contains_xy(area, x, y) if grid else area for area in areas])
    best = [0] + [count + 1] * count
    for last in range(count):
        for row in rows:
            shared = row[last]
            for first in range(last, -1, -1):
                shared = shared & row[first]
                if not (shared.any() if grid else shared.area > 1e-10):
                    break
                best[last + 1] = min(best[last + 1], best[first] + 1)
    return best[count]


def covers() -> None:
    """Sets of 30 holes: as few stops as a least cover by places of a grid."""
    few = equal = proven = 0
    for seed in range(SETS):
        world = scattered(seed)
        stops, parking = find(scene_of(world))
        least = sampled_cover(world)
        few += len(stops) <= least
        equal += len(stops) == least
        proven += bool(parking.stats(len(stops))["proven_fewest"])
    print(f"{SETS} sets of 30 holes: no more stops than a cover from places each {SPACING:g} m {few}/{SETS},")
    print(f"as many {equal}/{SETS}, as few as any base needs {proven}/{SETS}")


def scattered(seed: int) -> World:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform([0, 0], [2, 1.2], (30, 2)), rng.uniform(0.2, 0.4, 30)])
    floor, rules = Floor(shapely.box(-1, -1, 3, 2.2)), replace(RULES, order="any")
    return World(f"set {seed}", robot_named("youbot"), floor, (), tuple(map(Target, points)), rules)


def sampled_cover(world: World) -> int:
    """Fewest stops from the places of a grid, whatever the heading."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-1, 3, SPACING), np.arange(-1, 2.2, SPACING)))
    found, by = path_areas(scene_of(world)), world.rules.stop_tolerance
    rows = [
        shapely.contains_xy(shapely.union_all(found.inner[found.target == i]).buffer(-by, 64), x, y)
        for i in range(len(world.task))
    ]
    inside = np.unique(np.column_stack(rows), axis=0)
    return len(least_cover(inside[undominated(inside)]).chosen)


def tours() -> None:
    """Tours of sets of points, as of postures: against every order and choice."""
    worst = 0.0
    for seed in range(SETS):
        rng = np.random.default_rng(seed)
        owner = np.sort(np.concatenate([np.arange(7), rng.integers(0, 7, 4)]))
        joints = rng.uniform(-1, 1, (len(owner), 6))
        far = np.abs(joints[:, None] - joints[None]).max(axis=2)
        found = shortest_tour_of_sets(far, owner)
        members = [np.flatnonzero(owner == k).tolist() for k in range(7)]
        ways = np.array([way for order in permutations(members) for way in product(*order)])
        best = float(far[ways[:, :-1], ways[:, 1:]].sum(axis=1).min())
        worst = max(worst, found.length / best - 1)
    print(f"{SETS} tours of 7 sets: at most {worst:.2%} longer than the best of all orders and choices")
    assert worst < 0.01, "a tour of few is not the best"


def main() -> None:
    covers()
    tours()
    same = near = bound = total = 0
    for seed in range(100):
        world = path(seed)
        found = park(scene_of(world))
        ours = len(found.groups)
        total += ours
        same += ours == fewest(world, grid=False)
        near += ours <= fewest(world, grid=True)
        bound += ours == found.lower
    print(f"100 random paths, {total} stops: as few as the best of all cuts {same}/100, never more than on a")
    print(f"grid of {GRID:g} m {near}/100, as few as any base needs (outer areas) {bound}/100")

    met = proven = 0
    for seed in range(20):
        began = time.perf_counter()
        world = holes(seed)
        stops, parking = find(scene_of(world))
        stats = parking.stats(len(stops))
        met += stats["count"] == stats["fewest_of_inner_areas"]
        proven += stats["proven_fewest"]
        served = sorted(i for stop in stops for i in stop.setpoints)
        assert served == list(range(200))
        print(f"  {world.name}: {len(stops)} stops, {stats}, {time.perf_counter() - began:.1f} s")
    print(
        f"200 holes in any order: as few as inner areas allow {met}/20, as few as any base needs {proven}/20"
    )

    world = load_world("depot")
    began = time.perf_counter()
    stops, parking = find(scene_of(world))
    seconds = time.perf_counter() - began
    tolerance = np.array([stop.tolerance for stop in stops])
    print(f"depot: {len(stops)} stops for {len(world.task)} set-points, no base does with fewer than")
    print(
        f"{parking.lower}; to park within {tolerance.min():.4f} to {tolerance.max():.4f} m, {seconds:.1f} s"
    )
    for n, stop in enumerate(stops, 1):
        x, y, yaw = stop.base
        span = f"{stop.first + 1}-{stop.last + 1}"
        print(f"  {n:2d} {span:>9s} {x:8.3f} {y:8.3f} {yaw:7.3f} {stop.tolerance:.4f}")
    if len(sys.argv) > 1:
        plot_stops(world, stops, sys.argv[1])
        print(f"wrote {sys.argv[1]}")


if __name__ == "__main__":
    main()
