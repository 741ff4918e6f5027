"""Hundreds of holes in a wing on edge, by an arm on a differential base: stops, tour and processor seconds.

Run: python -m benchmarks.bench_holes robot.urdf tip_link [holes]
"""

from __future__ import annotations

import sys
import time

import numpy as np
import shapely

import regionik as rik
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from regionik.worlds.urdf.loader import load_robot

ROWS = 8
STEP = 1e-5  # of the differences that give normals


def surface(along: Array, chord: Array) -> Array:
    """Points (n, 3) of an upper surface that bulges towards -y, by span and share of the chord [m]."""
    bulge = -0.18 * np.sin(np.pi * chord) * (1 - 0.2 * (along / 1.8) ** 2)
    return np.column_stack([along, bulge, 0.55 + 0.75 * chord])


def wing(robot: Robot, count: int) -> World:
    """Holes along the normal, the tool free to roll, in eight rows of a wing 3.6 m long."""
    k = np.arange(count)
    along, chord = 3.6 * (k // ROWS) / (count // ROWS - 1) - 1.8, (k % ROWS) / (ROWS - 1)
    spanwise = surface(along + STEP, chord) - surface(along - STEP, chord)
    chordwise = surface(along, chord + STEP) - surface(along, chord - STEP)
    normals = np.cross(spanwise, chordwise)
    normals *= np.sign(normals[:, 1:2]) / np.linalg.norm(normals, axis=1)[:, None]
    pairs = zip(surface(along, chord), normals, strict=True)
    task = tuple(Target(spot, direction=normal, cone=0.05) for spot, normal in pairs)
    rules = Rules(clearance=0.05, mode="stops", order="any", stop_tolerance=0.01)
    return World(f"wing {count}", robot, Floor(shapely.box(-4, -4, 4, 0.2)), (), task, rules)


def main() -> None:
    robot = load_robot(sys.argv[1], tip=sys.argv[2], base="differential")
    rik.plan(wing(robot, 16))  # whatever is compiled is compiled now
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 336
    began = time.process_time()
    found = rik.plan(wing(robot, count))
    seconds = time.process_time() - began
    stops, tour = found.stats["stops"], found.stats["tour"]
    print(f"{count} holes: {len(found.stops)} stops of {[len(stop.setpoints) for stop in found.stops]}")
    print(f"  at least {stops['lower_bound']}, by {stops['bound']}")
    print(f"  tolerance {min(stop.tolerance for stop in found.stops):.4f} m at least")
    print(f"  {found.lift_offs} lift-offs, {len(found.motion)} states, {tour['drive']:.2f} m between stops")
    print(f"  arm {tour['arm']:.1f} s at full speed")
    print(f"  timed {found.motion.time[-1]:.1f} s with all drives")
    print(f"  planned and verified in {seconds:.1f} processor seconds")


if __name__ == "__main__":
    main()
