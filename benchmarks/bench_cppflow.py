"""Dense paths of full poses within CppFlow's tolerances, from a base that stands and one that drives.

CppFlow (RA-L 2024) and TORM lead one arm along paths of 25 to 321 poses among boxes. A path counts where
`plan` finds a way without lifting the tool, each pose is met within 0.1 mm and 0.1 degrees, no joint moves by
more than 7 degrees or 2 cm from pose to pose, and `verify` accepts it. In mode fixed the base stands where
the problem has it, within a millimetre; in mode free it goes about a floor of 8 x 8 m. Problems and paths:
DATA, from CppFlow's repository; robots: folder ROBOTS, as the package jrl has them. Times are seconds of the
processor.

Run: python -m benchmarks.bench_cppflow DATA ROBOTS [--modes fixed free] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from scipy.spatial.transform import Rotation

import regionik as rik
from regionik.worlds.arrays import Array
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.robot import Robot

TOLERANCE, CONE = 1e-4, np.radians(0.1)
LARGEST_TURN, LARGEST_SLIDE = np.radians(7.0), 0.02  # of a joint from pose to pose [rad], [m]
# URDF file and tip
ROBOTS = {
    "panda": ("panda/panda_arm_hand_formatted.urdf", "panda_hand"),
    "fetch": ("fetch/fetch_formatted.urdf", "gripper_link"),
    "fetch_arm": ("fetch/fetch_formatted.urdf", "gripper_link"),
}
TORSO, DOWN = "torso_lift_joint", np.array([-0.086875, 0.0, 0.37743])  # of its link in Fetch's base [m]


def robot_of(folder: Path, name: str) -> Robot:
    """Return a problem's robot; the torso of fetch_arm stands still."""
    file, tip = ROBOTS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = rik.load_robot(folder / file, tip=tip)
    if name != "fetch_arm":
        return robot
    joints = (replace(one, lower=0.0, upper=0.0) if one.name == TORSO else one for one in robot.chain.joints)
    return replace(robot, chain=replace(robot.chain, joints=tuple(joints)))


def world_of(data: Path, robot: Robot, problem: dict[str, Any], mode: str) -> rik.World:
    rows = np.loadtxt(data / f"{problem['path_name']}.csv", delimiter=",", skiprows=1)
    R = np.array(problem["path_R_offset"], dtype=float)
    offset = np.array(problem["path_xyz_offset"], dtype=float)
    offset += DOWN if problem["path_offset_frame"] == "torso_lift_link" else 0.0
    turns = R @ Rotation.from_quat(rows[:, [5, 6, 7, 4]]).as_matrix()
    task = [
        rik.Target(p, orientation=T, cone=CONE)
        for p, T in zip(rows[:, 1:4] @ R.T + offset, turns, strict=True)
    ]
    boxes = [
        _box(k, one, problem["obstacle_xyz_offset"]) for k, one in enumerate(problem.get("obstacles", []))
    ]
    floor = shapely.box(-4, -4, 4, 4)
    if mode == "fixed":
        floor = shapely.MultiPoint(robot.footprint).convex_hull.buffer(1e-3, join_style="mitre")
    rules = rik.Rules(clearance=0.0, tolerance=TOLERANCE, solid_floor=False)
    if mode == "fixed":
        rules = replace(rules, heading="fixed", reach_margin=0.0)
    name = f"{problem['robot']} {problem['path_name']} {mode}"
    return rik.World(name, robot, rik.Floor(floor), tuple(boxes), tuple(task), rules)


def _box(k: int, parts: list[dict[str, float]] | dict[str, float], offset: list[float]) -> rik.Box:
    one = parts if isinstance(parts, dict) else {key: value for part in parts for key, value in part.items()}
    if abs(one["roll"]) + abs(one["pitch"]) > 0:
        raise SystemExit("expected upright boxes")
    center = [one[axis] + shift for axis, shift in zip("xyz", offset, strict=True)]
    return rik.Box(f"box {k}", [one[f"size_{axis}"] for axis in "xyz"], center, one["yaw"])


def outcome(world: rik.World) -> str:
    begun = time.process_time()
    try:
        found = rik.plan(world)
    except NoPlanFound as no:
        return f"{no.explanation.verdict}, {time.process_time() - begun:.1f} s: {no}"
    took = time.process_time() - begun
    held = "holds" if rik.verify(found).ok else "does not hold"
    turn, slide = largest_steps(found)
    small = turn <= LARGEST_TURN and slide <= LARGEST_SLIDE
    counts = "counts" if small and held == "holds" and not found.lift_offs else "does not count"
    steps = f"at most {np.degrees(turn):.1f} deg and {100 * slide:.1f} cm a step"
    return f"{held}, {counts}: {found.lift_offs} lift-offs, {steps}, {took:.1f} s"


def largest_steps(found: rik.Plan) -> tuple[float, float]:
    """Largest motion of a turning and of a sliding joint from set-point to set-point [rad], [m]."""
    steps: Array = np.abs(np.diff([one.joints for one in found.setpoints], axis=0)).max(0)
    slides = np.array([joint.kind == "prismatic" for joint in found.world.robot.chain.joints])
    return float(steps[~slides].max(initial=0.0)), float(steps[slides].max(initial=0.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("robots", type=Path)
    parser.add_argument("--modes", nargs="+", default=["fixed", "free"], choices=["fixed", "free"])
    parser.add_argument("--only", nargs="+", default=[], help="problems by name, such as panda__1cube")
    asked = parser.parse_args()
    files = [
        file for file in sorted(asked.data.glob("*__*.yaml")) if not asked.only or file.stem in asked.only
    ]
    for file in files:
        problem = yaml.safe_load(file.read_text())
        robot = robot_of(asked.robots, problem["robot"])
        for mode in asked.modes:
            world = world_of(asked.data, robot, problem, mode)
            print(f"{world.name:28} {len(world.task):4} poses: {outcome(world)}", flush=True)


if __name__ == "__main__":
    main()
