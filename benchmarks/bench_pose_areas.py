"""Inner and outer areas of tool poses, both proven: gap, time, and brute force against both sides.

The arms of URDF files stand on a free floor, on a base that drives every way; directions and orientations are
those of random postures. From points drawn from the inner area damped least squares, from random postures,
should always come to the pose; from points outside the outer one, half of them within centimetres, never. The
gap is told as a share of the outer area, and as the width of a rim of that size along the outer one's
edge. Exits 1 where a point refutes an area.
Run: python -m benchmarks.bench_pose_areas FILE... [--poses N] [--points N] [--starts N]
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from benchmarks.bench_reach import NEAR
from benchmarks.pivoted import ANGLE, EXACT, STEPS, points_in
from regionik.planners.solvers.damped_least_squares import Aim, polish
from regionik.planners.solvers.rigid_bodies import span
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.postures.arm import aim_of
from regionik.reach_table import reach_table
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.worlds.arms import with_pivot, with_pivot_limits
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from regionik.worlds.urdf.loader import load_robot

FOOTPRINT = np.array([[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]])
FLOOR = Floor(shapely.box(-9.0, -9.0, 9.0, 9.0))
CONE = 0.02  # [rad]


def posed(robot: Robot, direction: bool, rng: np.random.Generator) -> Target:
    """What a random posture within limits does over the floor."""
    chain = robot.chain
    while True:
        low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
        tool = chain.forward(rng.uniform(low, high))
        up = float(tool[2, 3] + robot.mount[2])
        if up > 0.05:
            spot = np.array([0.0, 0.0, up])
            way = {"direction": tool[:3, 2]} if direction else {"orientation": tool[:3, :3]}
            return Target(spot, cone=CONE, **way)


def reached(world: World, target: Target, spots: Array, starts: int, rng: np.random.Generator) -> int:
    """How many of the places of the pivot axis have a posture by damped least squares, the base turning."""
    chain, aim = with_pivot(world.robot.chain), aim_of(target)
    arm = serial_arm(with_pivot_limits(chain, -np.inf, np.inf))
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    count = 0
    for spot in spots:
        seen = aim.position - [*spot, world.robot.mount[2]]
        for q in rng.uniform(low, high, (starts, chain.dof)):
            goal = Aim(seen, aim.kind, aim.turn, target.cone)
            error, angle, _ = polish(arm, goal, q, span(arm), EXACT, ANGLE, STEPS)
            if error <= EXACT and angle <= ANGLE:
                count += 1
                break
    return count


def main(files: list[str], poses: int, points: int, starts: int) -> int:
    print(f"{'arm':>14} goal          inner  outer m2    gap  rim cm  plans use     s   inside      outside")
    wrong = 0
    for file in files:
        path, _, tip = file.partition(":")
        robot = load_robot(Path(path), base="omni", tip=tip or None, footprint=FOOTPRINT)
        robot = replace(robot, mount=np.array([0.0, 0.0, 0.4, 0.0]))
        for direction in (True, False):
            rng = np.random.default_rng(1)
            rows, inside, beyond = [], np.zeros(2, dtype=int), np.zeros(2, dtype=int)
            for _ in range(poses):
                target = posed(robot, direction, rng)
                world = World("poses", robot, FLOOR, (), (target,), Rules(clearance=0.0))
                began = time.process_time()
                area = admissible_area(world, target)
                took = time.process_time() - began
                sampled = shapely.union_all(reach_table(scene_of(world), [target], (1,), inner=True)[2])
                rim = area.gap / area.outer.length if area.outer.length else 0.0
                rows.append((area.inner.area, area.outer.area, 100 * rim, sampled.area, took))
                inner = points_in(area.inner, rng, points)
                inside += reached(world, target, inner, starts, rng), len(inner)
                ring = area.outer.buffer(NEAR) - area.outer.buffer(1e-6)
                wide = area.outer.buffer(1.0) - area.outer.buffer(1e-6)
                out = np.concatenate([points_in(part, rng, points // 2) for part in (ring, wide)])
                beyond += reached(world, target, out, starts, rng), len(out)
            inner_area, outer_area, rim, used, took = np.array(rows).sum(axis=0)
            gap, rim, took = 1 - inner_area / outer_area, rim / poses, took / poses
            wrong += int(inside[0] < inside[1]) + int(beyond[0] > 0)
            print(
                f"{robot.name[:14]:>14} {'direction  ' if direction else 'orientation'} {inner_area:7.2f} "
                f"{outer_area:7.2f}  {gap:6.1%} {rim:6.1f}  {used:9.2f} {took:6.2f} "
                f"{inside[0]:4d} of {inside[1]:4d} {beyond[0]:3d} of {beyond[1]:4d}",
                flush=True,
            )
    return 1 if wrong else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("files", nargs="+", metavar="FILE[:TIP]")
    parser.add_argument("--poses", type=int, default=6)
    parser.add_argument("--points", type=int, default=20)
    parser.add_argument("--starts", type=int, default=2000)
    options = parser.parse_args()
    sys.exit(main(options.files, options.poses, options.points, options.starts))
