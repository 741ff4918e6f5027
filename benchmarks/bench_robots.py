"""URDF files as they come: does each arm load, rest clear of itself, and draw a seam?

Prints a line for each URDF file below the folders: joints, solids (hulls among them), pairs not checked,
processor seconds to load, distance of the nearest two solids in the carry posture, share of random postures
that are clear, reach; with --seam also whether a straight seam on a free floor is planned and verified, its
lift-offs and processor seconds. Files of several arms are named with their refusal, which lists the tips.

Run: python benchmarks/bench_robots.py FOLDER... [--tip NAME] [--seam]
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np
import shapely

import regionik as rik
from regionik.planners.collision.proximity import nearest
from regionik.planners.collision.robot_bodies import bodies_from
from regionik.worlds.arms import reach_bound
from regionik.worlds.robot import LinkHull, Robot
from regionik.worlds.self_collision import postures_clear, seeded_postures

POSTURES = 500
SEAM = np.linspace(-0.2, 0.2, 9)  # along y [m]
LEAST_JOINTS = 4  # of an arm


def loaded(path: Path, tip: str | None) -> tuple[Robot, float, int]:
    """A robot, the processor seconds that loading took, and the number of warnings."""
    begun = time.process_time()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        robot = rik.load_robot(path, tip=tip)
    return robot, time.process_time() - begun, len(said)


def seam(robot: Robot) -> str:
    """What planning a seam at half the reach, tool position only, comes to."""
    bound = reach_bound(robot.chain)
    height = max(0.3, float(robot.mount[2]) + bound.height)
    task = tuple(rik.Target(np.array([0.0, y, height])) for y in SEAM)
    world = rik.World("seam", robot, rik.Floor(shapely.box(-4, -4, 4, 4)), task=task)
    begun = time.process_time()
    try:
        plan = rik.plan(world)
    except rik.NoPlanFound as error:
        return f"seam {error.explanation.verdict}, {time.process_time() - begun:.1f} s"
    took = time.process_time() - begun
    held = "holds" if rik.verify(plan).ok else "does not hold"
    return f"seam {held}, {plan.lift_offs} lift-offs, {took:.1f} s"


def line(path: Path, tip: str | None, with_seam: bool) -> str:
    try:
        robot, took, said = loaded(path, tip)
    except rik.InputError as error:
        return f"{path.name:32} {str(error).removeprefix(f'{path}: ')[:140]}"
    if robot.chain.dof < LEAST_JOINTS:
        return f"{path.name:32} {robot.chain.dof} joints: no arm"
    hulls = sum(isinstance(solid, LinkHull) for solid in robot.all_solids)
    room = nearest(bodies_from(robot, ()), np.zeros(3), robot.carry).distance
    clear = postures_clear(robot, seeded_postures(robot.chain, POSTURES), 0.0).mean()
    parts = [
        f"{robot.chain.dof:2} joints, {len(robot.all_solids):2} solids ({hulls:2} hulls)",
        f"{len(robot.unchecked):3} pairs unchecked, {said:2} warnings, {took:5.1f} s",
        f"at rest {1e3 * room:6.1f} mm, clear {clear:4.0%}, reach {_reach(robot)}",
    ]
    return f"{path.name:32} " + "; ".join(parts + ([seam(robot)] if with_seam else []))


def _reach(robot: Robot) -> str:
    try:
        return f"{reach_bound(robot.chain).length:.2f} m"
    except rik.InputError:
        return "unbounded"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--tip", help="of every file; by default the end of its longest arm")
    parser.add_argument("--seam", action="store_true")
    given = parser.parse_args()
    files = sorted({path for folder in given.folders for path in folder.rglob("*.urdf")})
    if not files:
        parser.error("expected folders with files that end in .urdf")
    for path in files:
        print(line(path, given.tip, given.seam), flush=True)


if __name__ == "__main__":
    main()
