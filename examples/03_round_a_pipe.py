"""Plan round a pipe that stands in front of the work, and see what goes wrong without looking."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import regionik as rik

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path()
world = rik.load_world("pipe")

# Without avoidance the plan is refused: link, obstacle and place are named.
blind = replace(world, rules=replace(world.rules, avoidance=False))
try:
    rik.plan(blind)
except rik.NoPlanFound as failure:
    print(f"blind: {failure.explanation.reason}")

# With it, arm and base go round together, and the tool never leaves its path.
plan = rik.plan(world)
print(f"looking: {plan.lift_offs} lift-offs, {plan.stats['states']} states")

# Verification proves the motion between states clear too, by other code.
report = rik.verify(plan)
least = world.rules.arm_clearance + report.margins["arm"]
print(f"the plan holds: {report.ok}; no link comes nearer than {1000 * least:.1f} mm to a solid at any state")

# One joint from the first set-point to the last: no jumps, no elbow flips.
elbow = np.degrees([found.joints[2] for found in plan.setpoints])
largest = np.abs(np.diff(elbow)).max()
print(f"the elbow goes from {elbow[0]:.0f} to {elbow[-1]:.0f} deg, by {largest:.0f} at most")

rik.to_html(plan, folder / "pipe.html")
