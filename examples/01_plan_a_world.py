"""Plan a whole tool path, check the plan, and make a page to look at.

Run it from anywhere: ``python 01_plan_a_world.py [folder for the results]``.
"""

import sys
from pathlib import Path

import regionik as rik

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# A world is a robot, a floor, obstacles, and a task: the set-points its tool must visit, in order.
# In "pillar" a sine of set-points runs over a low box that the base has to go around.
world = rik.load_world("pillar")
print(f"{world.name}: {len(world.task)} set-points, obstacles: {', '.join(s.name for s in world.obstacles)}")

# Planning finds one configuration (base and arm) for each set-point, and the motion that joins them.
# The seed only matters where a sampling planner is asked; the same seed gives the same bytes.
try:
    plan = rik.plan(world, seed=0)
except rik.NoPlanFound as no:
    sys.exit(f"no plan: {no.explanation.reason}")

for k, (target, found) in enumerate(zip(world.task, plan.setpoints, strict=True)):
    tool = ", ".join(f"{value:6.3f}" for value in target.position)
    x, y, yaw = found.base
    print(f"set-point {k + 1:2}: tool ({tool}), base ({x:6.3f}, {y:6.3f}) heading {yaw:+.2f} rad")
print(f"{len(plan.motion)} states, lift-offs: {plan.lift_offs}")

# The planner's word is not taken for it: verify knows the world and the states, not how they were found.
report = rik.verify(plan)
print("the plan holds" if report.ok else "the plan does not hold")
for name, margin in report.margins.items():
    print(f"  {name}: {margin:.4g}")

# A plan embeds its world, so that the file alone can be verified, shown and exported anywhere.
plan.save(folder / "plan.json")
rik.to_html(plan, folder / "plan.html")
print(f"wrote {folder / 'plan.json'} and {folder / 'plan.html'}")
