"""What `verify` lets pass, for machines round differently and bounds are not exact.

Stages allow no more of any of them.
"""

from __future__ import annotations

EXACT = 1e-9  # of states [m], [rad]; of criteria [m3], [N m], [N], or as a share of a joint's range
BETWEEN = 1e-6  # of the tool between states [m], [rad]
TOUCH = 1e-6  # by which bodies may touch, and a footprint may pass the floor's edge or a clearance [m]
TURNING = 1e-6  # of the footprint between states, where it turns: what it sweeps is then bounded [m]
OVERLAP = 4e-6  # by which shapes overlap that do more than touch [m]
HEADING_TOLERANCE = 1e-6  # of a base whose heading is fixed, or that faces its targets [rad]
ROUNDING = 1e-6  # by which a field may differ [m], [s], [m2], or as a share of what is computed
OVER = 2e-3  # share of a limit by which bounds may be beyond it
BEYOND = 10.0  # times `Speeds.blend` to which bounds may come: they add up what all joints are off
# That wheels may slip from state to state: as a share of the way, and besides [m]
SLIP, SLIPPED = 1e-3, 1e-5
STEERED = 1e-5  # angle that a car's steering need not be turned for [rad]
