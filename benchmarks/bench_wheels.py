"""Bases on wheels along a straight seam: lift-offs, base travel and planning time.

Each robot draws a seam of 60 set-points, 2 m long, on an open floor and in front of a wall: on a base of its
size that drives every way, on a differential drive and as a car. Robots are the bundled youbot-real and
pioneer-parm, and those of URDF files that are named.

Run: python -m benchmarks.bench_wheels [URDF ...] [--tip NAME] [--height METRES]
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

import regionik as rik
from regionik.pipeline import search
from regionik.scene import scene_of
from regionik.worlds.arms import reach_bound
from regionik.worlds.drives import BaseKind
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot

COUNT, LENGTH = 60, 2.0  # of the seam [m]
BUNDLED = ("youbot-real", "pioneer-parm")
KINDS: tuple[BaseKind, ...] = ("omni", "differential", "car")
RADIUS = 0.5  # of a car's turns [m]
WALL = 0.1  # of the wall's face behind the seam [m]


def seam(robot: Robot, height: float | None, *, wall: bool) -> rik.World:
    """A robot before a seam, by default at a height that it reaches well, started apart from it."""
    bound = reach_bound(robot.chain)
    height = height or max(0.3, float(robot.mount[2]) + bound.height)
    away = 0.6 * bound.length + float(np.abs(robot.footprint).max())
    task = tuple(rik.Target(np.array([x, 0.0, height])) for x in np.linspace(0, LENGTH, COUNT))
    brick = Box("wall", np.array([LENGTH + 4, 0.1, 2.0]), np.array([LENGTH / 2, WALL + 0.05, 1.0]))
    start = rik.Start(np.array([-0.3, -away - 0.3, 0.3]), robot.carry)
    floor = rik.Floor(shapely.box(-2.5, -3.5, LENGTH + 2.5, 2.5))
    name = f"{robot.name} {robot.base} {'wall' if wall else 'open'}"
    return rik.World(name, robot, floor, (brick,) if wall else (), task, rik.Rules(), start)


def line(world: rik.World) -> str:
    """What planning a world comes to, warm where it was planned before."""
    begun = time.process_time()
    try:
        plan = search(scene_of(world))
    except rik.NoPlanFound as error:
        took = time.process_time() - begun
        return f"{world.name:42} {error.explanation.verdict}: {error.explanation.reason[:70]} {took:.1f} s"
    took = time.process_time() - begun
    holds = "holds" if rik.verify(plan).ok else "does not hold"
    turned = np.abs(np.diff(np.unwrap(plan.motion.base[:, 2]))).sum()
    return (
        f"{world.name:42} {plan.lift_offs:5} {plan.stats['base_travel']:8.2f} {turned:8.2f} "
        f"{len(plan.motion):7} {took:8.1f}  {holds}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--tip", help="of every file; by default the end of its longest arm")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--height", type=float, help="of the seam over the floor [m]")
    parser.add_argument("--only-files", action="store_true", help="leave out the bundled robots")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    robots = [] if given.only_files else [rik.load_robot(name) for name in BUNDLED]
    robots += [rik.load_robot(path, tip=given.tip) for path in given.files]
    print("robot, base, place                         lifts  base[m] turn[rad]  states  plan[s]")
    for robot in robots:
        for kind in given.kinds:
            based = replace(robot, base=kind, turning_radius=RADIUS if kind == "car" else 0.0)
            for wall in (False, True):
                print(line(seam(based, given.height, wall=wall)), flush=True)


if __name__ == "__main__":
    main()
