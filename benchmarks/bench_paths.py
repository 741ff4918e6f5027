"""Long and real paths: a raster along a curved wall, a print in layers, tasks of real robots among obstacles.

wall     120 full poses in four rows of 12 m along a curved wall, the tool square to it, by a UR5 on an
         omni base of 0.96 x 0.79 m
print    250 m in layers of 12 m, a set-point each centimetre, by the tool point of the bundled youbot
ROBOT    60 set-points each: a seam, a circle on a wall square to it, a raster there, among four obstacles

Printed for each: what planning, on cold and warm code, and checking take [CPU s], the most memory of the
process so far [GiB], lift-offs, and those within a row; with the tool asked for 0.1 m/s the share of time on
the path at which it has that speed (to 2 in 100), and the same away from the path's ends and sharp corners.
URDF files are found below FOLDER, as those of bench_robots.

Run: python -m benchmarks.bench_paths [FOLDER ...] [--only NAME ...] [--untimed]
"""

from __future__ import annotations

import argparse
import resource
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import shapely

import regionik as rik
from regionik import pipeline
from regionik.scene import scene_of
from regionik.timing import timing_figures
from regionik.timing.retime import retime
from regionik.worlds.arrays import Array
from regionik.worlds.drives import BaseKind
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.robot import Robot, Tool, with_tool

SPEEDS = rik.Speeds(
    joint_velocity=1.5,
    joint_acceleration=3.0,
    base_velocity=0.5,
    base_acceleration=1.0,
    turn_velocity=1.5,
    turn_acceleration=3.0,
    tool_velocity=0.1,
)
ROWS, COLUMNS, ROW, RADIUS = 4, 30, 12.0, 8.0  # of the curved wall [m]
OFF = 0.1  # of the tool from a wall [m]
AHEAD = np.array([1.0, 0.0, 0.0])
ALONG_X = np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=float)  # a frame's z


@dataclass(frozen=True)
class Mobile:
    """A URDF file by the end of its path, its tip, its base, and what carries an arm without one."""

    urdf: str
    tip: str | None
    base: BaseKind
    height: float  # of what it works on [m]
    cart: tuple[float, float, float, float] | None = None  # half length and width, mount's x and z [m]
    turning_radius: float | None = None  # [m]
    points_along_x: bool = False  # the tip's frame, not along z

    def robot(self, path: Path) -> Robot:
        on_cart: dict[str, Any] = {}
        if self.cart:
            x, y, mount, z = self.cart
            outline = [(x, y), (-x, y), (-x, -y), (x, -y)]
            on_cart = {"footprint": outline, "mount": [mount, 0.0, z, 0.0], "body_height": z}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            robot = rik.load_robot(path, self.base, self.tip, turning_radius=self.turning_radius, **on_cart)
        return with_tool(robot, Tool(ALONG_X)) if self.points_along_x else robot


STRETCH = "stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf"
PANDA, UR = "panda_description/urdf/panda.urdf", "ur_description/urdf/{}_robot.urdf"
OMRON, RIDGEBACK = (0.35, 0.25, 0.15, 0.38), (0.48, 0.395, 0.2, 0.3)
MOBILES = {
    "frankie": Mobile(PANDA, "panda_link8", "differential", 0.7, OMRON),
    "frankie-omni": Mobile(PANDA, "panda_link8", "omni", 0.7, OMRON),
    "ridgeback": Mobile(UR.format("ur10"), "tool0", "omni", 0.9, RIDGEBACK),
    "panda-car": Mobile(PANDA, "panda_link8", "car", 0.7, OMRON, 0.6),
    "stretch": Mobile(STRETCH, "link_grasp_center", "differential", 0.7, points_along_x=True),
    "fetch": Mobile("fetch/fetch.urdf", "gripper_link", "differential", 0.8, points_along_x=True),
    "tiago": Mobile("tiago_description/robots/tiago.urdf", "arm_tool_link", "differential", 0.8),
}
WALL = Mobile(UR.format("ur5"), "tool0", "omni", 0.9, RIDGEBACK)


def frame(axis: Array) -> Array:
    """Tool frame of a level axis, its x down, (3, 3)."""
    down = np.array([0.0, 0.0, -1.0])
    return np.column_stack([down, np.cross(axis, down), axis])


def curved_wall(robot: Robot) -> rik.World:
    """Rows along the inside of a wall that is part of a circle."""
    ends, task = np.linspace(-0.5, 0.5, COLUMNS) * ROW / RADIUS, list[rik.Target]()
    for k, z in enumerate(np.linspace(0.6, 1.2, ROWS)):
        for angle in ends if k % 2 == 0 else ends[::-1]:
            axis = np.array([np.cos(angle), np.sin(angle), 0.0])
            spot = np.array([*((RADIUS - OFF) * axis[:2]), z])
            task.append(rik.Target(spot, orientation=frame(axis)))
    parts = np.linspace(-0.55, 0.55, 34) * ROW / RADIUS
    size = np.array([0.1, RADIUS * (parts[1] - parts[0]) + 0.02, 1.6])
    middles = np.column_stack([(RADIUS + 0.07) * np.cos(parts), (RADIUS + 0.07) * np.sin(parts)])
    wall = tuple(
        rik.Box(f"wall {k}", size, np.array([*middle, 0.8]), yaw=a)
        for k, (a, middle) in enumerate(zip(parts, middles, strict=True))
    )
    floor = rik.Floor(shapely.box(0.0, -8.0, 9.0, 8.0))
    return rik.World("wall", robot, floor, wall, tuple(task), rik.Rules(clearance=0.05))


def layers(metres: float) -> rik.World:
    """The outline of 4 x 2 m, layer on layer of 1 cm, a set-point each centimetre."""
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])
    sides = [np.linspace(a, b, round(100 * np.linalg.norm(b - a)), endpoint=False)
             for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]  # fmt: skip
    outline = np.concatenate(sides)
    count = round(100 * metres)
    points = np.column_stack(
        [outline[np.arange(count) % len(outline)], 0.2 + 0.01 * (np.arange(count) // 1200)]
    )
    floor = rik.Floor(shapely.box(-2.0, -2.0, 6.0, 4.0))
    task = tuple(rik.Target(point) for point in points)
    return rik.World("print", rik.load_robot("youbot"), floor, task=task)


def tasks(robot: Robot, z: float) -> Iterator[rik.World]:
    """A seam of 3 m along a bench, a circle and a raster on a wall, four obstacles on the floor."""
    floor, rules = rik.Floor(shapely.box(-4, -4, 4, 4)), rik.Rules(clearance=0.05, arm_clearance=0.005)
    posts = tuple(
        rik.Cylinder(f"post {k}", 0.1, 1.0, np.array([x, y, 0.5]))
        for k, (x, y) in enumerate([(-0.9, -1.2), (-1.3, 0.0), (-0.9, 1.2)])
    )
    bench = rik.Box("bench", np.array([0.6, 4.0, z - 0.1]), np.array([0.3, 0.0, (z - 0.1) / 2]))
    wall = rik.Box("wall", np.array([0.1, 4.0, 1.8]), np.array([0.25, 0.0, 0.9]))
    seam = [rik.Target(np.array([0.1, y, z])) for y in np.linspace(-1.5, 1.5, 60)]
    yield rik.World("seam", robot, floor, (*posts, bench), tuple(seam), rules)
    turns = np.linspace(0, 2 * np.pi, 60)
    circle = 0.25 * np.column_stack([np.sin(turns), np.cos(turns)])
    across, rows = np.linspace(-0.7, 0.7, 15), np.linspace(-0.15, 0.15, 4)
    raster = np.array([(y, row) for k, row in enumerate(rows) for y in across[:: 1 - 2 * (k % 2)]])
    for name, spots in (("circle", circle), ("raster", raster)):
        square = [rik.Target(np.array([0.0, y, z + up]), direction=AHEAD) for y, up in spots]
        yield rik.World(name, robot, floor, (*posts, wall), tuple(square), rules)


def worlds(name: str, paths: list[Path]) -> Iterator[rik.World]:
    if name == "print":
        yield layers(250.0)
        return
    mobile = WALL if name == "wall" else MOBILES[name]
    path = next((path for path in paths if path.as_posix().endswith(mobile.urdf)), None)
    if path is None:
        print(f"{name:13} no {mobile.urdf}")
        return
    robot = mobile.robot(path)
    if name == "wall":
        yield curved_wall(robot)
    else:
        yield from tasks(robot, mobile.height)


def spent(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a piece of work gives, and its processor time [s]."""
    begun = time.process_time()
    return work(), time.process_time() - begun


def lifts_in_rows(plan: rik.Plan) -> int:
    """Lift-offs between set-points of the curved wall that are in one row."""
    kind, owner = plan.motion.kind, plan.motion.setpoint
    lifted = {int(i) for i in owner[kind == "transit"] if i >= 0}
    return sum((i + 1) % COLUMNS > 0 for i in lifted)


def line(name: str, world: rik.World, timed: bool) -> str:
    said = f"{name:13} {world.name:7} {len(world.task):6}"
    try:
        plan, cold = spent(partial(pipeline.search, scene_of(world)))
    except NoPlanFound as no:
        return f"{said} none: {' '.join(no.explanation.reason.split())[:120]}"
    plan, warm = (plan, cold) if name == "print" else spent(partial(pipeline.search, scene_of(world)))
    report, checked = spent(partial(rik.verify, plan))
    if not report.ok:
        raise SystemExit(f"{said} does not hold: {report.violations[0]}")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    said += f" {cold:7.1f} {warm:7.1f} {checked:7.1f} {memory:5.2f} {plan.lift_offs:5}"
    said += f" {lifts_in_rows(plan) if name == 'wall' else '-':>6}"
    if timed:
        done, took = spent(partial(retime, plan, SPEEDS))
        tool = done.stats["timing"]["tool"]
        said += f" {took:7.1f} {done.motion.time[-1]:8.1f} {tool['held']:5.0%} {tool['held_elsewhere']:5.0%}"
    return said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    names = ["print", "wall", *MOBILES]
    parser.add_argument("--only", nargs="*", default=names, choices=names)
    parser.add_argument("--untimed", action="store_true")
    given = parser.parse_args()
    paths = [path for folder in given.folders for path in sorted(folder.rglob("*.urdf"))]
    print(
        "robot         task   points    cold    warm  verify   GiB lifts in row  retime  time[s]  held  away"
    )
    near = replace(timing_figures.OPTIONS, min_speed_share=0.98)
    with patch.object(timing_figures, "OPTIONS", near):
        for name in given.only:
            for world in worlds(name, paths):
                print(line(name, world, not given.untimed), flush=True)


if __name__ == "__main__":
    main()
