"""Reach of many targets on a large map, by any arm: processor seconds, and verdicts by number.

A map of 1674 x 1006 cells of 3 cm is drawn from a seed: outer walls, racks, pallets and posts. Targets are
drawn evenly over it, 0.1 to 1.3 m high, and answered by `reach` in this process; the first few fill what is
kept for a world and are timed apart. With ``--map`` another map is taken, with ``--urdf`` an arm from a file,
on an omni base of 0.8 by 0.6 m.
Run: python -m benchmarks.bench_bulk [--counts N ...] [--robot NAME] [--urdf FILE] [--map FILE]
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from regionik.reachability.reach import reach
from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named
from regionik.worlds.readers.occupancy_map import load_map
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, World
from regionik.worlds.urdf.loader import load_robot

COLUMNS, ROWS, CELL = 1006, 1674, 0.03  # of the map; side of a cell [m]
RACKS, PALLETS, POSTS = 24, 60, 40
HEIGHT = 1.0  # of occupied cells [m]
FOOTPRINT = np.array([[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]])
FIRST = 20  # targets that fill what is kept for a world


def drawn_map(folder: Path) -> Path:
    """Write a map of a hall drawn from a seed."""
    rng = np.random.default_rng(0)
    grey = np.full((ROWS, COLUMNS), 254, dtype=np.uint8)
    for edge in (grey[:20], grey[-20:], grey[:, :20], grey[:, -20:]):
        edge[:] = 0
    for count, (long, wide) in ((RACKS, (220, 30)), (PALLETS, (45, 40)), (POSTS, (8, 8))):
        for _ in range(count):
            tall, broad = (long, wide) if rng.random() < 0.5 else (wide, long)
            y, x = rng.integers(20, (ROWS - tall - 20, COLUMNS - broad - 20))
            block = grey[y : y + tall, x : x + broad]
            block[:] = 0
            block[:, -1][rng.random(len(block)) < 0.3] = 254  # edges as a scanner sees them
            block[0][rng.random(broad) < 0.3] = 254
    Image.fromarray(grey).save(folder / "hall.png")
    lines = ["image: hall.png", f"resolution: {CELL}", "origin: [0, 0, 0]", "negate: 0"]
    lines += ["occupied_thresh: 0.65", "free_thresh: 0.196"]
    (folder / "hall.yaml").write_text("\n".join(lines) + "\n")
    return folder / "hall.yaml"


def robot_of(name: str, urdf: Path | None) -> Robot:
    return robot_named(name) if urdf is None else load_robot(urdf, base="omni", footprint=FOOTPRINT)


def targets_over(floor: Floor, count: int) -> Array:
    x0, y0, x1, y1 = floor.polygon.bounds
    return np.random.default_rng(5).uniform([x0, y0, 0.1], [x1, y1, 1.3], (count, 3))


def main(counts: list[int], name: str, urdf: Path | None, map_file: Path | None) -> None:
    with TemporaryDirectory() as folder:
        floor = load_map(map_file or drawn_map(Path(folder)), HEIGHT)
    robot = robot_of(name, urdf)
    world = World("hall", robot, floor, rules=Rules())
    spots = targets_over(floor, max(counts))
    began = time.process_time()
    reach(world, spots[:FIRST])
    print(f"{robot.name}: the first {FIRST} targets {time.process_time() - began:.1f} s of processor")
    for count in counts:
        began = time.process_time()
        verdicts = Counter(reach(world, spots[:count]).verdict.tolist())
        spent = time.process_time() - began
        told = ", ".join(f"{verdicts[word]} {word}" for word in sorted(verdicts))
        print(f"{count} targets: {spent:.1f} s, {1e3 * spent / count:.1f} ms each: {told}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--counts", type=int, nargs="+", default=[300, 1000, 10_000])
    parser.add_argument("--robot", default="youbot")
    parser.add_argument("--urdf", type=Path)
    parser.add_argument("--map", type=Path, dest="map_file")
    options = parser.parse_args()
    main(options.counts, options.robot, options.urdf, options.map_file)
