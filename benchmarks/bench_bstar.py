"""One stop for a whole path of full poses: success and time on the paths of B*, beside what it prints.

B* (base placement for a path of full poses, RA-L 2025) gives four arms on a free floor and hundreds of paths
for each. A path counts where `plan` finds one stop, every pose is met within 1e-5 m, and `verify`
accepts the plan: joint limits, links off each other all the way, a circle to park in. B* tells no circle, and
proves nothing between two poses. Links that its files let touch may touch here. Robots and
paths: DATA/robots and DATA/ARM.npz, converted from its repository. Times are seconds of the processor, the
first path of an arm left out, linear algebra on one thread: another's waiting would count.

Run: python -m benchmarks.bench_bstar DATA [--paths N] [--levels 4 16 64] [--arms ARM ...]
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import shapely
import yaml
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

import regionik as rik
from regionik.worlds.arrays import Array
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from regionik.worlds.urdf.loader import load_robot

TIPS = {"franka": "panda_hand", "iiwa": "iiwa7_link_ee", "kinova_gen3": "tool_frame", "ur10e": "tool0"}
TOLERANCE, CONE = 1e-5, 1e-3  # [m], [rad]
FLOOR = Floor(shapely.box(-3.0, -3.0, 3.0, 3.0))


def robot_of(data: Path, arm: str) -> Robot:
    """The arm on a base that drives every way, its links that may touch as B* has them."""
    robots = data / "robots"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = load_robot(robots / f"{arm}_description" / f"{arm}.urdf", tip=TIPS[arm], base="omni")
    given = yaml.safe_load((robots / f"{arm}.yml").read_text())["robot_cfg"]["kinematics"]
    ignored = given["self_collision_ignore"]
    link = {solid.name: solid.name.split(" part ")[0] for solid in robot.all_solids}
    link[f"base of {robot.name}"] = next(iter(ignored))
    free = [
        (a, b)
        for a, b in combinations(link, 2)
        if link[b] in ignored.get(link[a], ()) or link[a] in ignored.get(link[b], ())
    ]
    return replace(robot, unchecked=tuple(dict.fromkeys([*robot.unchecked, *free])))


def world_of(robot: Robot, name: str, poses: Array) -> World:
    turns = Rotation.from_quat(poses[:, [4, 5, 6, 3]]).as_matrix()
    task = tuple(Target(p, orientation=R, cone=CONE) for p, R in zip(poses[:, :3], turns, strict=True))
    rules = Rules(mode="stops", tolerance=TOLERANCE, solid_floor=False)  # B* knows no floor
    return World(name, robot, FLOOR, (), task, rules)


def solved(world: World) -> tuple[str, float]:
    """Empty if one stop serves the path, else why not; and seconds of the processor."""
    begin = time.process_time()
    try:
        found = rik.plan(world)
    except NoPlanFound as no:
        return str(no), time.process_time() - begin
    seconds = time.process_time() - begin
    if not rik.verify(found).ok:
        raise SystemExit(f"{world.name}: the plan does not hold")
    if found.stats["largest_error"] > TOLERANCE:
        raise SystemExit(f"{world.name}: a pose is missed by {found.stats['largest_error']:.2g} m")
    return ("" if len(found.stops) == 1 else f"{len(found.stops)} stops"), seconds


def published(count: int) -> float:
    """Seconds that B* prints for paths of so many poses."""
    return float(10 ** (0.376 * np.log2(count) - 0.907))


def main() -> None:
    parser = argparse.ArgumentParser(description="One stop for each path of B*.")
    parser.add_argument("data", type=Path)
    parser.add_argument("--paths", type=int, default=50, help="of each arm and level")
    parser.add_argument("--levels", type=int, nargs="+", default=[4, 16, 64], help="poses of a path")
    parser.add_argument("--arms", nargs="+", default=list(TIPS), choices=list(TIPS))
    asked = parser.parse_args()
    threadpool_limits(1)
    print(f"{'arm':<12} {'poses':>5} {'one stop':>9} {'median s':>9} {'worst s':>8} {'B* prints':>9}")
    for arm in asked.arms:
        robot, paths = robot_of(asked.data, arm), np.load(asked.data / f"{arm}.npz")
        solved(world_of(robot, "warm", paths[f"{asked.levels[0]}_0"]))
        for count in asked.levels:
            names = [f"{count}_{k}" for k in range(asked.paths)]
            rows = [solved(world_of(robot, f"{arm} {name}", paths[name])) for name in names]
            times, good = np.array([row[1] for row in rows]), sum(not row[0] for row in rows)
            seconds = f"{np.median(times):>9.2f} {times.max():>8.2f} {published(count):>9.2f}"
            print(f"{arm:<12} {count:>5} {good:>4}/{len(rows):<4} {seconds}", flush=True)
            for name, (why, _) in zip(names, rows, strict=True):
                if why:
                    print(f"  {name}: {why}", flush=True)


if __name__ == "__main__":
    main()
