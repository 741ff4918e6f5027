"""Xu's tracker on the paper's two simulations: how exactly, how far, how fast, and what slips.

Prints for the worlds `circle` and `door`: residuals at set-points, the range of joint 1, the longest way of a
wheel over a step and its time at 0.5 m/s, the time of the whole path, the sideways slip that `verify` finds
between states, the slip a step of the paper's own heading rule on the same poses, and the seconds to plan.
Ends with an error where a figure is not what it must be.

Run: python -m benchmarks.bench_tracker
"""

from __future__ import annotations

import sys
import time

import numpy as np

import regionik as rik
from benchmarks.tables.xu import chord_heading_slip
from regionik.papers.tracker import tracking_robot
from regionik.worlds.arrays import Array
from regionik.worlds.drives import wheel_travel

SPEED = 0.5  # of a wheel [m/s]


def residuals(found: rik.Plan) -> tuple[float, float]:
    """Largest errors over the set-points [m], [rad]."""
    task, robot, at = found.world.task, found.world.robot, found.motion.kind == "setpoint"
    tools = robot.tool(found.motion.base[at], found.motion.joints[at])
    place = max(float(np.linalg.norm(T[:3, 3] - t.position)) for T, t in zip(tools, task, strict=True))
    return place, max(_angle(t.orientation, T[:3, :3]) for T, t in zip(tools, task, strict=True))


def _angle(wanted: Array | None, got: Array) -> float:
    assert wanted is not None
    return float(np.linalg.norm(got - wanted) / np.sqrt(2))  # of a small turn


def paper_slip(world: rik.World) -> Array:
    """Slip of every step where the heading follows the chords of the tool's path [m]."""
    robot = tracking_robot(world.robot)
    assert robot is not None
    poses = []
    for target in world.task:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = target.orientation, target.position
        poses.append(pose)
    return np.abs(chord_heading_slip(robot, poses))


def measure(name: str) -> bool:
    world = rik.load_world(name)
    begun = time.perf_counter()
    found = rik.plan(world)
    took = time.perf_counter() - begun
    place, turn = residuals(found)
    pivot = np.degrees(np.abs(found.motion.joints[:, 0]).max())
    longest = np.abs(wheel_travel(found.motion.base, world.robot.gauge)).max(axis=1)
    slip = 1e-9 - rik.verify(found).margins["wheels"]
    theirs = 1000 * paper_slip(world)
    print(
        f"{name}: {len(world.task)} poses, {found.lift_offs} lift-offs, planned and verified in {took:.1f} s"
    )
    print(f"  position residual {1000 * place:.1e} mm, orientation {turn:.1e} rad")
    print(f"  joint 1 within {pivot:.2f} deg of zero")
    step = f"{1000 * longest.max():.2f} mm a step at most, {longest.max() / SPEED:.4f} s at {SPEED:g} m/s"
    print(f"  a wheel rolls {step}; the whole path takes {longest.sum() / SPEED:.2f} s")
    rule = f"{theirs.min():.3f} to {theirs.max():.3f} mm a step"
    print(f"  sideways slip {slip:.1e} m; by the paper's heading rule {rule}")
    return place < 1e-9 and turn < 1e-9 and pivot <= 90.0 + 1e-9 and slip < 1e-9


if __name__ == "__main__":
    fine = [measure(name) for name in ("circle", "door")]
    sys.exit(not all(fine))
