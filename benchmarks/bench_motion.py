"""Motion worth driving: bundled worlds timed with the tool at an asked speed, as found and smoothed.

Printed for each: the time against that of the path at this speed, the share of time at which the tool has it,
how much the base's path turns and where by more than 20 degrees, and how much the joints move.

Run: python benchmarks/bench_motion.py [WORLD ...]
"""

from __future__ import annotations

import argparse
import math
import time
from unittest.mock import patch

import numpy as np

from regionik import pipeline
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.speeds import Speeds

TOOL = 0.2  # [m/s]
ROBOT = Speeds(
    joint_velocity=1.5,
    joint_acceleration=3.0,
    base_velocity=0.5,
    base_acceleration=1.0,
    turn_velocity=1.5,
    turn_acceleration=3.0,
)
ASKED = Speeds(**{**vars(ROBOT), "tool_velocity": TOOL})
WORLDS = ("free", "pillar", "slab", "wall", "l_shape", "shelf", "pipe", "depot")
CORNER, MOVED = math.radians(20), 1e-4


def turns(base: Array) -> Array:
    """Angles between the directions of a base's hops [rad]."""
    hops = np.diff(base[:, :2], axis=0)
    hops = hops[np.linalg.norm(hops, axis=1) > MOVED]
    angle = np.diff(np.arctan2(hops[:, 1], hops[:, 0]))
    return np.abs((angle + np.pi) % (2 * np.pi) - np.pi)


def planned(name: str, smooth: bool) -> tuple[Plan, float]:
    """The plan of a world and the processor time of planning it once more."""
    world, keep = load_world(name), pipeline.smooth_motion
    with patch.object(pipeline, "smooth_motion", keep if smooth else lambda plan, standing: plan):
        pipeline.search(world)
        start = time.process_time()
        return pipeline.search(world), time.process_time() - start


def line(name: str, smooth: bool) -> str:
    plan, spent = planned(name, smooth)
    points = np.array([target.position for target in plan.world.task])
    ideal = np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / TOOL
    timed, free = retime(plan, ASKED), retime(plan, ROBOT)
    turned = turns(plan.motion.base)
    held = timed.stats["timing"]["tool"]["held"]
    return (
        f"{name:8} {'smooth' if smooth else 'found':7} {plan.lift_offs:5} {timed.motion.time[-1]:7.1f} "
        f"{timed.motion.time[-1] / ideal:6.2f} {held:6.0%} {free.motion.time[-1]:7.1f} {turned.sum():7.1f} "
        f"{(turned > CORNER).sum():7} {np.abs(np.diff(plan.motion.joints, axis=0)).sum():7.1f} "
        f"{plan.stats['margins'].get('clearance', np.inf):8.4f} {spent:6.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    print("world    motion  lifts time[s]  ratio  held  no speed turned corners  joints  margin  plan[s]")
    for name in parser.parse_args().worlds:
        for smooth in (False, True):
            print(line(name, smooth), flush=True)


if __name__ == "__main__":
    main()
