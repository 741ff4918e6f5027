"""Cost of a pose as paths get longer: processor milliseconds a set-point of areas, of `reach` and of `plan`.

Poses of the whole tool lie along a rising wave of 2 m, each of another height and turn, so that no two share
what is known of a pose; the arm of a URDF file stands on a free floor, on a base of 0.8 by 0.6 m that drives
every way. What costs the same for each set-point shows the same figure in every row.
Run: python -m benchmarks.bench_poses FILE [--counts N ...] [--plans N ...]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import shapely
from scipy.spatial.transform import Rotation

from regionik.pipeline import plan
from regionik.reachability.reach import reach
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Target, World
from regionik.worlds.urdf.loader import load_robot

FLOOR = Floor(shapely.box(-3.0, -3.0, 5.0, 3.0))
FOOTPRINT = np.array([[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]])
CONE = 0.05  # [rad]


def wave(robot: Robot, count: int) -> World:
    """A path of so many poses, the tool level and swinging to both sides."""
    share = np.linspace(0.0, 1.0, count)
    spots = np.column_stack([2.0 * share, 0.1 * np.sin(9.0 * share), 0.3 + 0.2 * share])
    swings = np.column_stack([0.3 * np.sin(5.0 * share), 0.5 * np.pi + 0.2 * np.cos(7.0 * share)])
    turns = Rotation.from_euler("ZY", swings).as_matrix()
    task = tuple(Target(p, orientation=R, cone=CONE) for p, R in zip(spots, turns, strict=True))
    return World(f"{count} poses", robot, FLOOR, (), task)


def spent(work: Callable[[World], object], world: World) -> float:
    """Processor milliseconds a set-point."""
    began = time.process_time()
    work(world)
    return 1e3 * (time.process_time() - began) / len(world.task)


def main(urdf: Path, counts: list[int], plans: list[int]) -> None:
    robot = load_robot(urdf, base="omni", footprint=FOOTPRINT)
    reach(wave(robot, 3), wave(robot, 3).task)  # compiles
    print(f"{robot.name}: ms a set-point")
    for count in counts:
        world = wave(robot, count)
        areas, answered = (
            spent(lambda world: path_areas(scene_of(world)), world),
            spent(lambda world: reach(world, world.task), world),
        )
        print(f"{count:6} poses: areas {areas:6.1f}, reach {answered:6.1f}", flush=True)
    for count in plans:
        print(f"{count:6} poses: plan {spent(plan, wave(robot, count)):6.1f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("urdf", type=Path, metavar="FILE")
    parser.add_argument("--counts", type=int, nargs="*", default=[10, 100, 500, 2000])
    parser.add_argument("--plans", type=int, nargs="*", default=[10, 100])
    options = parser.parse_args()
    main(options.urdf, options.counts, options.plans)
