"""Where the base may stand so that the arm's posture is good for its work, not just on target."""

import sys
from pathlib import Path

import numpy as np

import regionik as rik

# A world as a file: the youBot's arm with what its links weigh, and a tool of half a kilogram.
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
file = folder / "good_postures.world.yaml"
file.write_text("""\
version: 1
robot:
  name: youbot
  payload: 0.5
  masses:
    - {link: 1, mass: 1.32, center: [0.08, 0, 0]}
    - {link: 2, mass: 0.82, center: [0.07, 0, 0]}
    - {link: 3, mass: 0.77}
    - {link: 4, mass: 0.69, center: [0, 0, 0.11]}
floor: {polygon: [[-1.5, -1], [1.5, -1], [1.5, 2], [-1.5, 2]]}
obstacles:
  - {name: bench, box: {size: [1.6, 0.2, 0.2], center: [0, 0.9, 0.1]}}
task:
  - {line: {from: [-0.5, 0.8, 0.25], to: [0.5, 0.8, 0.25], count: 11}}
rules:
  clearance: 0.05
  criteria: {manipulability: 0.005, joint_margin: 0.05, effort: 8.0}
""")
world = rik.load_world(file)

# One target, more and more asked: manipulability in cubic metres, the share of each joint's range that is
# kept from both limits, the torque in newton metres by which a joint bears links and tool.
target = np.array([0.0, 0.8, 0.25])
for criteria in (
    rik.Criteria(),
    rik.Criteria(manipulability=0.01),
    rik.Criteria(joint_margin=0.1),
    rik.Criteria(effort=6.0),
    rik.Criteria(manipulability=0.01, joint_margin=0.1, effort=6.0),
):
    area = rik.admissible_area(world, target, criteria)
    print(f"{criteria}: {area.inner.area:.3f} m2, {area.gap:.3f} m2 undecided")

# What the criteria take is an area like any other: polygons that can be cut, joined and drawn.
plain = rik.admissible_area(world, target, rik.Criteria())
lost = plain.inner - rik.admissible_area(world, target).outer
print(f"the world's own criteria rule out {lost.area:.3f} m2 of what is in reach")

# A plan keeps them at every set-point, and verify measures them by kinematics of its own.
plan = rik.plan(world)
report = rik.verify(plan)
for kind in ("manipulability", "joint_margin", "effort"):
    print(f"least margin of {kind}: {report.margins[kind]:.4f}")
rik.to_html(plan, folder / "good_postures.html")
print(f"look at {folder / 'good_postures.html'}: the areas are those of good postures")
