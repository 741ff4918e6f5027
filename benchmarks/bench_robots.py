"""URDF files as they come: does each arm load, rest clear of itself, and do small tasks?

Prints a line for each URDF file: joints, solids (hulls among them), pairs not checked, processor seconds to
load, distance of the nearest two solids in the carry posture, share of random postures that are clear, reach;
and for each task asked for whether it is planned and verified, its lift-offs and processor seconds. Tasks lie
at a height at which the arm can hold its tool level:

point   one position
seam    15 positions along a line of 0.6 m
circle  24 set-points round a circle of 0.2 m on a wall, the tool square to it
raster  32 set-points in four rows on a wall, the tool square to it

The wall stands as far behind the set-points as the last link sticks out beyond the tool point, and 2 cm more.
Files of several arms are named with their refusal, which lists the tips: name one behind a colon.

Run: python -m benchmarks.bench_robots FILE[:TIP]|FOLDER... [--tasks point seam circle raster]
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
from regionik.worlds.arrays import Array
from regionik.worlds.chain import spread_postures
from regionik.worlds.links import LinkHull
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import UNLIMITED_SLIDE, postures_clear

POSTURES = 500
SOUGHT = 5000  # postures, of which those with the tool level say at which height tasks lie
LEVEL = 0.3  # of the tool's axis [rad]
LEAST_JOINTS = 4  # of an arm
TASKS = ("point", "seam", "circle", "raster")
FLOOR = rik.Floor(shapely.box(-4, -4, 4, 4))
AHEAD = np.array([1.0, 0.0, 0.0])
BEHIND = 0.02  # of the wall, beyond what of the last link sticks out [m]


def loaded(path: Path, tip: str | None) -> tuple[Robot, float, int]:
    """A robot, the processor seconds that loading took, and the number of warnings."""
    begun = time.process_time()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        robot = rik.load_robot(path, tip=tip)
    return robot, time.process_time() - begun, len(said)


def working_height(robot: Robot) -> float:
    """Height at which half of the clear postures that hold the tool level are lower [m]; NaN without any."""
    joints = spread_postures(robot.chain, UNLIMITED_SLIDE, SOUGHT, 0)
    tools = robot.T_base_arm @ robot.chain.frames(joints)[:, -1]
    joints = joints[(np.abs(tools[:, 2, 2]) < np.sin(LEVEL)) & (tools[:, 2, 3] > 0.2)]
    clear = joints[postures_clear(robot, joints, 0.0)] if len(joints) else joints
    return float(np.median(robot.tool(np.zeros(3), clear)[:, 2, 3])) if len(clear) else np.nan


def stick_out(robot: Robot) -> float:
    """How far solids of the last link reach beyond the tool point along the tool's axis [m]."""
    T, last = robot.chain.T_last_tool, robot.chain.dof - 1
    beyond = [
        float(((solid.corners - T[:3, 3]) @ T[:3, 2]).max()) + solid.radius
        for solid in robot.solids
        if solid.link == last
    ]
    return max(0.0, *beyond) if beyond else 0.0


def world_of(robot: Robot, task: str, height: float) -> rik.World:
    if task in ("point", "seam"):
        along = np.linspace(-0.3, 0.3, 15) if task == "seam" else np.zeros(1)
        targets = [rik.Target(np.array([0.0, y, height])) for y in along]
        return rik.World(task, robot, FLOOR, task=tuple(targets))
    spots = _circle() if task == "circle" else _raster()
    targets = [rik.Target(np.array([0.0, y, height + z]), direction=AHEAD) for y, z in spots]
    near, top = stick_out(robot) + BEHIND, height + 0.4
    wall = rik.Box("wall", [0.1, 2.0, top], [near + 0.05, 0.0, top / 2])
    return rik.World(task, robot, FLOOR, (wall,), tuple(targets), rik.Rules(clearance=0.02))


def _circle() -> Array:
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return 0.1 * np.column_stack([np.cos(angles), np.sin(angles)])


def _raster() -> Array:
    along, rows = np.linspace(-0.175, 0.175, 8), np.linspace(-0.075, 0.075, 4)
    return np.array([(y, z) for k, z in enumerate(rows) for y in (along if k % 2 == 0 else along[::-1])])


def outcome(world: rik.World) -> str:
    """What planning a world comes to."""
    begun = time.process_time()
    try:
        plan = rik.plan(world)
    except rik.NoPlanFound as error:
        return f"{world.name} {error.explanation.verdict}, {time.process_time() - begun:.1f} s"
    took = time.process_time() - begun
    held = "holds" if rik.verify(plan).ok else "does not hold"
    return f"{world.name} {held}, {plan.lift_offs} lift-offs, {took:.1f} s"


def line(path: Path, tip: str | None) -> tuple[str, Robot | None]:
    """What a file comes to, and its robot if that is an arm."""
    try:
        robot, took, said = loaded(path, tip)
    except rik.InputError as error:
        return f"{path.name:32} {str(error).removeprefix(f'{path}: ')[:140]}", None
    if robot.chain.dof < LEAST_JOINTS:
        return f"{path.name:32} {robot.chain.dof} joints: no arm", None
    hulls = sum(isinstance(solid, LinkHull) for solid in robot.all_solids)
    room = nearest(bodies_from(robot, ()), np.zeros(3), robot.carry).distance
    clear = postures_clear(robot, spread_postures(robot.chain, UNLIMITED_SLIDE, POSTURES, 0), 0.0).mean()
    parts = [
        f"{robot.chain.dof:2} joints, {len(robot.all_solids):2} solids ({hulls:2} hulls)",
        f"{len(robot.unchecked):3} pairs unchecked, {said:2} warnings, {took:5.1f} s",
        f"at rest {1e3 * room:6.1f} mm, clear {clear:4.0%}, reach {_reach(robot)}",
    ]
    return f"{path.name:32} " + "; ".join(parts), robot


def _reach(robot: Robot) -> str:
    try:
        return f"{reach_bound(robot.chain).length:.2f} m"
    except rik.InputError:
        return "unbounded"


def _files(named: list[str]) -> list[tuple[Path, str | None]]:
    found: list[tuple[Path, str | None]] = []
    for name in named:
        file, _, tip = name.partition(":")
        paths = sorted(Path(file).rglob("*.urdf")) if Path(file).is_dir() else [Path(file)]
        found += [(path, tip or None) for path in paths]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="FILE[:TIP]|FOLDER")
    parser.add_argument("--tasks", nargs="*", default=[], choices=TASKS)
    given = parser.parse_args()
    for path, tip in _files(given.files):
        text, robot = line(path, tip)
        print(text, flush=True)
        if robot is not None and given.tasks:
            height = working_height(robot)
            for task in given.tasks if np.isfinite(height) else []:
                print(f"    at {height:.2f} m: {outcome(world_of(robot, task, height))}", flush=True)


if __name__ == "__main__":
    main()
