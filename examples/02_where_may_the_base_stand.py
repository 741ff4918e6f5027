"""Ask where the base may stand for a target, and why not elsewhere."""

import numpy as np

import regionik as rik

world = rik.load_world("pillar")

# One target beside the pillar. The area holds every place of the arm's axis from which the tool gets there.
target = np.array([0.9, 0.25, 0.25])
area = rik.admissible_area(world, target)
print(f"the base may stand on {area.polygon.area:.3f} m2, in {len(area.components)} piece(s)")

# Polygons cannot be round, so there are two: every point of the inner one works, no point outside the
# outer one does. Their difference is what is not decided.
print(f"undecided: {area.outer.area - area.inner.area:.4f} m2")

# What took the rest of the reach away, and how much clearance this target could bear at most.
for cause in area.causes:
    print(f"taken by {cause.name}: {cause.polygon.area:.3f} m2")
print(f"the area stays open up to a clearance of {area.clearance:.3f} m")

# Many targets at once: straight up from near the floor, too high at the end.
heights = np.linspace(0.1, 0.9, 9)
targets = np.column_stack([np.full_like(heights, 0.9), np.full_like(heights, 0.25), heights])
answer = rik.reach(world, targets)
for height, verdict, reason in zip(heights, answer.verdict, answer.reason, strict=True):
    print(f"z = {height:.1f} m: {verdict}", f"- {reason}" if reason else "")
