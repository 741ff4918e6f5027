"""Bring your own robot: read a URDF file, give it a wall to paint, plan, and check the plan."""

import sys
from pathlib import Path

import numpy as np

import regionik as rik

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path()

# The chain runs from the file's root to the tip; the trigger and the wheels are no part of it. The tip may be
# left out where a file has one longest arm. A wrong name is answered with the valid ones.
robot = rik.load_robot(Path(__file__).parent / "painter.urdf", tip="nozzle", carry=[0, 1.6, -2.4, 0, 0])
for joint in robot.chain.joints:
    limits = f"{joint.lower:6.2f} to {joint.upper:5.2f}"
    print(f"{joint.name:6} {joint.kind:9} {limits}, at most {joint.velocity:.1f} a second")

# Its collision elements became prisms and boxes. The base is its footprint up to where the mast begins, and
# the mast a solid of its own, so that the base may drive under things that the mast passes by.
print(f"{len(robot.solids)} solids on the arm, base {robot.body_height:.2f} m high with", end=" ")
print(", ".join(solid.name for solid in robot.base_solids), "on it")

# A wall to paint across, under a beam that hangs too low for the mast.
wall = rik.Box("wall", [3.0, 0.1, 2.0], [0.0, 1.05, 1.0])
beam = rik.Box("beam", [0.2, 0.5, 0.3], [-1.3, 0.2, 0.85])
stroke = [rik.Target([x, 0.9, 1.0]) for x in np.linspace(-0.9, 0.9, 7)]
world = rik.World(
    name="painter",
    robot=robot,
    floor=rik.Floor([[-2.5, -1.5], [2.5, -1.5], [2.5, 1.5], [-2.5, 1.5]]),
    obstacles=(wall, beam),
    task=tuple(stroke),
    rules=rik.Rules(clearance=0.05, arm_clearance=0.01),
    start=rik.Start([-1.0, -0.8, 0.0], robot.carry),
)
plan = rik.plan(world)
print(f"{plan.lift_offs} lift-offs, {len(plan.motion)} states")

# The plan's file holds the robot in full: whoever reads it needs no URDF.
report = rik.verify(plan)
print("the plan holds" if report.ok else "the plan does not hold")
plan.save(folder / "painter.json")
