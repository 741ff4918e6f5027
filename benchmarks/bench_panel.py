"""Holes in a panel by an arm on a base that stands, and in four such panels along a wall by one that drives.

Rows of x, y, z and direction are those of RoboTSP (Suarez-Ruiz, Lembono and Pham 2018), a CSV file: 245
holes, which took it 22 s to plan and a Denso VS060 78.6 s to do, by the speeds and accelerations below.
Run: python -m benchmarks.bench_panel robot.urdf tip_link holes.csv
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import shapely

import regionik as rik
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.urdf.loader import load_robot

VELOCITY = (1.0, 0.7, 0.7, 1.0, 0.7, 1.57)  # of the published run [rad/s]
ACCELERATION = (5.0, 4.25, 4.25, 5.25, 6.0, 8.0)  # of the published run [rad/s2]
PLACE = 1e-3  # half of the floor of a base that stands [m]
APART = 0.6  # panels along a wall, each half a metre wide [m]
HEIGHT = 0.4  # of the arm on the base that drives [m]


def holes(rows: Array, off: Array) -> tuple[Target, ...]:
    """Targets of rows of holes, the tool free to roll, moved by an offset (3,) [m]."""
    return tuple(Target(row[:3] + off, direction=row[3:], cone=0.02) for row in rows)


def panel(robot: Robot, rows: Array) -> World:
    """All holes by an arm on a base that has no room to drive."""
    solid = Box("panel", np.array([0.02, 0.8, 0.6]), np.array([rows[0, 0] + 0.02, 0.0, rows[:, 2].mean()]))
    floor = Floor(shapely.box(-0.2 - PLACE, -0.2 - PLACE, 0.2 + PLACE, 0.2 + PLACE))
    rules = Rules(mode="stops", order="any", stop_tolerance=0.0, clearance=0.0, heading="fixed")
    start, speeds = Start(np.zeros(3), robot.carry), Speeds(VELOCITY, ACCELERATION)
    return World("panel", robot, floor, (solid,), holes(rows, np.zeros(3)), rules, start, speeds=speeds)


def wall(robot: Robot, rows: Array) -> World:
    """Four panels along a wall, by an arm on a base that drives."""
    offs = [np.array([0.0, (k - 1.5) * APART, HEIGHT]) for k in range(4)]
    task = tuple(target for off in offs for target in holes(rows, off))
    x = float(rows[0, 0])
    solid = Box("wall", np.array([0.02, 4 * APART, 1.4]), np.array([x + 0.02, 0.0, 0.7]))
    rules = Rules(mode="stops", order="any", stop_tolerance=0.01, clearance=0.03)
    floor, speeds = Floor(shapely.box(-1.5, -3.5, x, 3.5)), Speeds(VELOCITY, ACCELERATION)
    return World("wall", robot, floor, (solid,), task, rules, speeds=speeds)


def told(world: World) -> Plan:
    """The world's plan, whose figures are printed."""
    began, clock = time.process_time(), time.perf_counter()
    found = rik.plan(world)
    cpu, wall_clock = time.process_time() - began, time.perf_counter() - clock
    stops, tour = found.stats["stops"], found.stats["tour"]
    print(f"{world.name}: {len(world.task)} holes, {[len(stop.setpoints) for stop in found.stops]} by stop")
    print(f"  {stops['count']} stops, proven fewest: {stops['proven_fewest']}")
    print(f"  arm {tour['arm']:.1f} s at full speed")
    print(f"  timed {found.motion.time[-1]:.1f} s, {found.lift_offs} lift-offs")
    print(
        f"  planned and verified in {cpu:.1f} processor seconds, {wall_clock:.1f} s of the clock", flush=True
    )
    return found


def main() -> None:
    urdf, tip, table = sys.argv[1:4]
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    square = [(0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)]
    standing = load_robot(urdf, "omni", tip, footprint=square, mount=[0.0] * 4, body_height=0.001)
    rik.plan(replace(panel(standing, rows[:20]), name="few"))  # whatever is compiled is compiled now
    told(panel(standing, rows))
    driven = load_robot(urdf, "omni", tip, footprint=square, mount=[0, 0, HEIGHT, 0], body_height=HEIGHT)
    told(wall(driven, rows))


if __name__ == "__main__":
    main()
