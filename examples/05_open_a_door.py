"""Open a cabinet's door with a robot on two wheels: every pose of the knob is met, and no wheel slips."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import regionik as rik
from regionik.worlds.drives import wheel_travel

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path()
world = rik.load_world("door")

# The knob at the height that the paper prints: a tool that points up cannot get down there.
low = [replace(target, position=target.position - [0, 0, 0.155]) for target in world.task]
try:
    rik.plan(replace(world, task=tuple(low)))
except rik.NoPlanFound as failure:
    print(failure.explanation.reason)

# At the height it must have meant, the arm takes height and tilt, and the base rolls for the rest.
plan = rik.plan(world)
turn = np.degrees(np.ptp(np.unwrap(plan.motion.base[:, 2])))
print(f"the door is open: the base rolled {plan.stats['base_travel']:.2f} m and turned {turn:.0f} deg")

# The wheels stand 0.32 m apart. At 0.5 m/s at most, the faster one sets the time.
ways = wheel_travel(plan.motion.base, world.robot.gauge)
print(f"that takes {np.abs(ways).max(axis=1).sum() / 0.5:.1f} s")

# Verification finds no slip across the wheels, by its own reading of the states.
report = rik.verify(plan)
print(f"the plan holds: {report.ok}; the wheels slip by {1e-9 - report.margins['wheels']:.0e} m at most")

rik.to_html(plan, folder / "door.html")
