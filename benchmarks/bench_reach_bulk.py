"""Reach of many points at once: points a second, how much faster than asking one by one, peak memory.

A floor of 20 by 20 m holds boxes, posts and balls drawn at random; the points are drawn evenly over it, up to
0.9 m high. One core. Run: python benchmarks/bench_reach_bulk.py [--points N]
"""

from __future__ import annotations

import argparse
import resource
import time
from collections import Counter

import numpy as np
import shapely

from regionik.reachability.reach import reach
from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box, Cylinder, Solid, Sphere
from regionik.worlds.scene import Floor, Rules, World

SIDE = 20.0  # of the floor [m]


def cluttered(robot: str, obstacles: int) -> World:
    """A square floor with solids drawn at random."""
    rng = np.random.default_rng(0)
    solids = tuple(_solid(k, rng) for k in range(obstacles))
    floor = Floor(shapely.box(0, 0, SIDE, SIDE))
    return World("cluttered", robot_named(robot), floor, solids, rules=Rules(clearance=0.1))


def _solid(k: int, rng: np.random.Generator) -> Solid:
    x, y = rng.uniform(0, SIDE, 2)
    height = float(rng.uniform(0.1, 1.0))
    if k % 3 == 0:
        size = np.array([*rng.uniform(0.1, 1.0, 2), height])
        return Box(f"box {k}", size, np.array([x, y, height / 2]), float(rng.uniform(0, np.pi)))
    if k % 3 == 1:
        return Cylinder(f"post {k}", float(rng.uniform(0.05, 0.3)), height, np.array([x, y, height / 2]))
    return Sphere(f"ball {k}", float(rng.uniform(0.05, 0.3)), np.array([x, y, rng.uniform(0, 0.5)]))


def drawn(points: int) -> Array:
    """Points over the floor."""
    return np.random.default_rng(1).uniform([0, 0, 0], [SIDE, SIDE, 0.9], (points, 3))


def main(points: int, alone: int, obstacles: int, robot: str) -> None:
    world, spots = cluttered(robot, obstacles), drawn(points)
    reach(world, spots[:1000])  # compiles, and fills what is kept for a world
    began, spent = time.perf_counter(), time.process_time()
    verdicts = Counter(reach(world, spots).verdict.tolist())
    whole, used = time.perf_counter() - began, time.process_time() - spent
    began = time.perf_counter()
    for spot in spots[:alone]:
        reach(world, spot)
    single = (time.perf_counter() - began) / alone
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{robot}, {obstacles} obstacles, {points} points: {dict(verdicts)}")
    print(f"bulk {whole:.1f} s ({used:.1f} s of processor), {points / whole:.0f} points a second")
    print(f"one by one {1e6 * single:.0f} us a point, {single * points / whole:.1f} times as long")
    print(f"peak memory {peak:.2f} GB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--alone", type=int, default=2000)
    parser.add_argument("--obstacles", type=int, default=100)
    parser.add_argument("--robot", default="youbot")
    options = parser.parse_args()
    main(options.points, options.alone, options.obstacles, options.robot)
