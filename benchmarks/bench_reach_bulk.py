"""Reach of many points at once: points a second, how much faster than asking one by one, peak memory.

A floor of 20 by 20 m holds boxes, posts and balls drawn at random; the points are drawn evenly over it, up to
0.9 m high. With ``--hall`` the floor is a map of 1674 x 1006 cells of 3 cm drawn from a seed, with walls,
racks, pallets and posts 1 m high, and points are up to 1.3 m high; with ``--urdf`` the arm is a file's, on an
omni base of 0.8 by 0.6 m. One core, or as many as there are ``--workers``.
Run: python -m benchmarks.bench_reach_bulk [--points N] [--alone N] [--hall] [--urdf FILE] [--workers N]
"""

from __future__ import annotations

import argparse
import resource
import time
from collections import Counter
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely
from PIL import Image

from regionik.executors import process_pool
from regionik.reachability.reach import reach
from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Box, Cylinder, Solid, Sphere
from regionik.worlds.readers.occupancy_map import load_map
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, World
from regionik.worlds.urdf.loader import load_robot

SIDE = 20.0  # of the floor [m]
COLUMNS, ROWS, CELL = 1006, 1674, 0.03  # of the hall; side of a cell [m]
EDGE = 20  # cells of wall round the hall
FURNITURE = ((24, 220, 30), (60, 45, 40), (40, 8, 8))  # racks, pallets and posts: number and cells each way
FOOTPRINT = np.array([[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]])


def cluttered(robot: Robot, obstacles: int) -> World:
    """A square floor with solids drawn at random."""
    rng = np.random.default_rng(0)
    solids = tuple(_solid(k, rng) for k in range(obstacles))
    floor = Floor(shapely.box(0, 0, SIDE, SIDE))
    return World("cluttered", robot, floor, solids, rules=Rules(clearance=0.1))


def hall(robot: Robot) -> World:
    """A map of a hall, with edges as a scanner sees them."""
    rng, grey = np.random.default_rng(0), np.full((ROWS, COLUMNS), 254, dtype=np.uint8)
    for edge in (grey[:EDGE], grey[-EDGE:], grey[:, :EDGE], grey[:, -EDGE:]):
        edge[:] = 0
    for count, long, wide in FURNITURE:
        for _ in range(count):
            tall, broad = (long, wide) if rng.random() < 0.5 else (wide, long)
            y, x = rng.integers(EDGE, (ROWS - tall - EDGE, COLUMNS - broad - EDGE))
            block = grey[y : y + tall, x : x + broad]
            block[:] = 0
            block[:, -1][rng.random(len(block)) < 0.3] = 254
            block[0][rng.random(broad) < 0.3] = 254
    with TemporaryDirectory() as folder:
        Image.fromarray(grey).save(Path(folder, "hall.png"))
        lines = ["image: hall.png", f"resolution: {CELL}", "origin: [0, 0, 0]", "negate: 0"]
        lines += ["occupied_thresh: 0.65", "free_thresh: 0.196", ""]
        Path(folder, "hall.yaml").write_text("\n".join(lines))
        return World("hall", robot, load_map(Path(folder, "hall.yaml"), 1.0))


def _solid(k: int, rng: np.random.Generator) -> Solid:
    x, y = rng.uniform(0, SIDE, 2)
    height = float(rng.uniform(0.1, 1.0))
    if k % 3 == 0:
        size = np.array([*rng.uniform(0.1, 1.0, 2), height])
        return Box(f"box {k}", size, np.array([x, y, height / 2]), float(rng.uniform(0, np.pi)))
    if k % 3 == 1:
        return Cylinder(f"post {k}", float(rng.uniform(0.05, 0.3)), height, np.array([x, y, height / 2]))
    return Sphere(f"ball {k}", float(rng.uniform(0.05, 0.3)), np.array([x, y, rng.uniform(0, 0.5)]))


def drawn(world: World, points: int) -> Array:
    """Points over the floor."""
    x0, y0, x1, y1 = world.floor.polygon.bounds
    low, high, seed = (0.1, 1.3, 5) if world.name == "hall" else (0.0, 0.9, 1)
    return np.random.default_rng(seed).uniform([x0, y0, low], [x1, y1, high], (points, 3))


def processor_seconds() -> float:
    """Of this process, and of its workers that have ended."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def main(points: int, alone: int, obstacles: int, robot: Robot, in_hall: bool, workers: int) -> None:
    world = hall(robot) if in_hall else cluttered(robot, obstacles)
    spots = drawn(world, points)
    reach(world, spots[: 20 if in_hall else 1000])  # compiles, and fills what is kept for a world
    began, spent = time.perf_counter(), processor_seconds()
    pool = partial(process_pool, workers) if workers > 1 else None
    verdicts = Counter(reach(world, spots, executor=pool).verdict.tolist())
    whole, used = time.perf_counter() - began, processor_seconds() - spent
    began = time.perf_counter()
    for spot in spots[:alone]:
        reach(world, spot)
    single = (time.perf_counter() - began) / max(1, alone)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{robot.name}, {len(world.solids)} obstacles, {points} points: {dict(verdicts)}")
    print(f"bulk {whole:.1f} s ({used:.1f} s of processor), {points / whole:.0f} points a second")
    print(f"one by one {1e6 * single:.0f} us a point, {single * points / whole:.1f} times as long")
    print(f"peak memory {peak:.2f} GB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--alone", type=int, default=2000)
    parser.add_argument("--obstacles", type=int, default=100)
    parser.add_argument("--robot", default="youbot")
    parser.add_argument("--urdf", type=Path)
    parser.add_argument("--hall", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    arm = robot_named(options.robot)
    if options.urdf is not None:
        arm = load_robot(options.urdf, base="omni", footprint=FOOTPRINT)
    main(options.points, options.alone, options.obstacles, arm, options.hall, options.workers)
