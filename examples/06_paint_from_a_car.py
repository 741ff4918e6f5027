"""Paint a wall from a base that steers like a car: the spray points at the wall, the base rolls along it."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import regionik as rik

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path()

# The base of youbot-real, 0.58 m by 0.38 m, with a car's wheels: it turns in 0.5 m and never on the spot.
robot = replace(rik.load_robot("youbot-real"), name="painter", base="car", turning_radius=0.5)

# Up and down along a wall, 0.1 m off it, the spray within 20 degrees of straight on. A column stands in the
# way of the base.
wall = rik.Box("wall", [6.0, 0.1, 1.2], [1.75, 1.1, 0.6])
column = rik.Cylinder("column", 0.1, 0.5, [1.9, -0.1, 0.25])
stroke = [
    (x, 0.95, z) for k, x in enumerate(np.arange(0.0, 3.6, 0.25)) for z in ((0.2, 0.4), (0.4, 0.2))[k % 2]
]
task = tuple(rik.Target(spot, [0.0, 1.0, 0.0], cone=np.radians(20)) for spot in stroke)
world = rik.World(
    name="facade",
    robot=robot,
    floor=rik.Floor([[-2, -1.5], [5.5, -1.5], [5.5, 1.6], [-2, 1.6]]),
    obstacles=(wall, column),
    task=task,
    rules=rik.Rules(clearance=0.05, arm_clearance=0.005),
    start=rik.Start([-1.2, -0.9, 0.6], robot.carry),
)
try:
    plan = rik.plan(world)
except rik.NoPlanFound as no:
    sys.exit(f"no plan: {no.explanation.reason}")
driven = plan.stats["base_travel"]
print(f"{len(plan.setpoints)} set-points, {plan.lift_offs} lift-offs, {driven:.1f} m of driving")

# Between two states the base rolls along one arc; verification measures slip and turning radius itself.
report = rik.verify(plan)
print(f"the plan holds: {report.ok}: no hop slips by a nanometre, none turns tighter than 0.5 m")
turns = np.abs(np.diff(np.unwrap(plan.motion.base[:, 2])))
print(f"it turned by {np.degrees(turns.sum()):.0f} degrees in all")

rik.to_html(plan, folder / "facade.html")
