"""Motion worth driving: bundled worlds timed with the tool at an asked speed, as found and smoothed.

Printed for each: the time with the tool at 0.2 m/s, what of it is on the path (drives to it and with the tool
lifted left out) against the path's length at this speed, the share of that at which the tool has it (to 2 in
100), and the same away from the path's ends and sharp corners;
all again with limits of jerk, and with jerk and corners cut by 1 mm; the time without a tool speed, and its
ratio to a time that nothing can beat; how much the base's path turns and where by more than 20 degrees, how
often it does so in the motion with limits of jerk without nearly resting there, how much the joints move, the
least spare clearance, and the time of planning. Below that, for the smooth motion with limits of jerk: where
the robot's limits keep the tool from its speed, and how many corners the path has.

The lower bound is the larger of two. The arm's axis has to come from where it starts into the outer area of
every set-point, in their order: on a way at least as long as the distances between the areas of any of
them, one after the other, that a base takes at full speed, from rest to rest. And the tool's point has to
go the length of its path, no faster than base, heading and all joints together can move it.

Run: python -m benchmarks.bench_motion [WORLD ...]
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import shapely

from regionik import pipeline
from regionik.planners.search.motion_bounds import longest_levers
from regionik.postures.poses import axis_of
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.smoothing.smooth_motion import smooth_motion
from regionik.timing import timing_figures
from regionik.timing.limits import segments_on_path
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.worlds.arrays import Array, Index
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.limits import Speeds

TOOL = 0.2  # [m/s]
ROBOT = Speeds(
    joint_velocity=1.5,
    joint_acceleration=3.0,
    base_velocity=0.5,
    base_acceleration=1.0,
    turn_velocity=1.5,
    turn_acceleration=3.0,
)
ASKED = replace(ROBOT, tool_velocity=TOOL)
SMOOTH = replace(ASKED, base_jerk=10.0, turn_jerk=30.0, joint_jerk=30.0)
CUT = 1e-3  # of the corners of the tool's path, where there is more room than by default [m]
WORLDS = ("free", "pillar", "slab", "wall", "l_shape", "shelf", "pipe", "circle", "depot")
CORNER, MOVED = math.radians(20), 1e-4
SLOW = 0.02  # of the base, where it nearly rests [m/s]
SHOWN = 5  # places where the tool is slower


def hops(base: Array) -> Index:
    """Hops of a base in which its place moves, (n,)."""
    return np.flatnonzero(np.linalg.norm(np.diff(base[:, :2], axis=0), axis=1) > MOVED)


def turns(base: Array) -> Array:
    """Angles between the directions of a base's hops [rad]."""
    x, y = np.diff(base[:, :2], axis=0)[hops(base)].T
    angle = np.diff(np.arctan2(y, x))
    return np.abs((angle + np.pi) % (2 * np.pi) - np.pi)


def passed(timed: Plan) -> int:
    """Corners of a base's way that it does not take at rest, or nearly so."""
    motion, hop = timed.motion, hops(timed.motion.base)
    speed = np.linalg.norm(np.diff(motion.base[:, :2], axis=0)[hop], axis=1) / np.diff(motion.time)[hop]
    return int(((turns(motion.base) > CORNER) & (np.minimum(speed[:-1], speed[1:]) > SLOW)).sum())


def planned(name: str, smooth: bool) -> tuple[Plan, float]:
    """The plan of a world and the processor time of planning it once more."""
    world, keep = load_world(name), smooth_motion
    with patch.object(pipeline, "smooth_motion", keep if smooth else lambda plan, standing: plan):
        pipeline.search(scene_of(world))
        start = time.process_time()
        return pipeline.search(scene_of(world)), time.process_time() - start


def length_of_path(plan: Plan) -> float:
    """Of the tool's path [m]."""
    points = np.array([target.position for target in plan.world.task])
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def base_way(plan: Plan) -> float:
    """Lower bound for the way of the arm's axis: the longest chain of distances between areas [m].

    Links of the chain are 1, 2, 4, 8, ... set-points long.
    """
    world = plan.world
    areas = [admissible_area(world, target).outer for target in world.task]
    if world.start is not None:
        areas.insert(0, shapely.Point(axis_of(world.robot, world.start.base)))
    longest = np.zeros(len(areas))
    for k in range(1, len(areas)):
        before = k - 2 ** np.arange(int(math.log2(k)) + 1)
        apart = shapely.distance([areas[i] for i in before], areas[k])
        longest[k] = (longest[before] + apart).max()
    return float(longest[-1])


def least_time(plan: Plan) -> float:
    """Lower bound for the time of any motion that does the task at the robot's speeds [s]."""
    chain, mount = plan.world.robot.chain, float(np.hypot(*plan.world.robot.mount[:2]))
    levers, reach = longest_levers(chain, len(chain.joints) - 1, chain.T_last_tool[:3, 3])
    fastest = ROBOT.base_velocity + ROBOT.turn_velocity * mount
    strongest = math.inf if mount else ROBOT.base_acceleration
    way = base_way(plan)
    ramps = fastest / strongest
    by_base = way / fastest + ramps if way > fastest * ramps else 2 * math.sqrt(way / strongest)
    by_joints = ROBOT.joint_limits(chain)[0] @ (np.abs(chain.coupling).T @ levers)
    swing = float(by_joints) + ROBOT.turn_velocity * (mount + reach)
    return max(by_base, length_of_path(plan) / (ROBOT.base_velocity + swing))


def held(timed: Plan, ideal: float) -> str:
    """Time on the path against the ideal one, and the shares of it at which the tool has its speed."""
    tool, on_path = timed.stats["timing"]["tool"], segments_on_path(timed.motion)
    spent = float(np.diff(timed.motion.time)[on_path].sum())
    return f"{spent / ideal:6.2f} {tool['held']:5.0%} {tool['held_elsewhere']:5.0%}"


def slow_places(timed: Plan) -> list[str]:
    """Lines on where the robot's own limits keep the tool from its speed, the longest first."""
    tool = timed.stats["timing"]["tool"]
    own = [place for place in tool["places"] if place["at"] == "path"]
    lines = [
        f"         {place['to'] - place['from']:5.2f} s about set-point {place['setpoint'] + 1:3}: "
        f"down to {place['least']:.3f} m/s, {place['by']}"
        for place in own[:SHOWN]
    ]
    return [*lines, f"         {len(tool['corners'])} corners of the path sharper than the blend"]


def lines(name: str, smooth: bool) -> list[str]:
    plan, spent = planned(name, smooth)
    ideal, turned = length_of_path(plan) / TOOL, turns(plan.motion.base)
    timed, free = retime(plan, ASKED), retime(plan, ROBOT)
    jerks = [retime(plan, SMOOTH), retime(plan, replace(SMOOTH, blend=CUT))]
    figures = (
        f"{name:8} {'smooth' if smooth else 'found':7} {plan.lift_offs:5} {timed.motion.time[-1]:7.1f} "
        f"{held(timed, ideal)} {' '.join(held(one, ideal) for one in jerks)} {free.motion.time[-1]:7.1f} "
        f"{free.motion.time[-1] / least_time(plan):6.2f} {turned.sum():7.1f} "
        f"{(turned > CORNER).sum():7} {passed(jerks[0]):6} "
        f"{np.abs(np.diff(plan.motion.joints, axis=0)).sum():7.1f} "
        f"{plan.stats['margins'].get('clearance', np.inf):8.4f} {spent:6.2f}"
    )
    return [figures, *(slow_places(jerks[0]) if smooth else [])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    print(
        "world    motion  lifts time[s]  ratio  held  away   jerk  held  away  + 1mm held  away  free[s] "
        "bound*  turned corners passed  joints   margin plan[s]"
    )
    for name in parser.parse_args().worlds:
        for smooth in (False, True):
            near = replace(timing_figures.OPTIONS, min_speed_share=0.98)
            with patch.object(timing_figures, "OPTIONS", near):
                print("\n".join(lines(name, smooth)), flush=True)


if __name__ == "__main__":
    main()
