"""Motion of bundled worlds as it was shown: the tool's speed held, the base's way smooth, lift-offs few."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest

from benchmarks.bench_motion import SMOOTH, TOOL, length_of_path
from regionik.timing.limits import segments_on_path
from regionik.timing.options import TIMING
from regionik.timing.retime import retime
from regionik.values import Plan
from tests.planned import planned

# set-points, most lift-offs
WORLDS = {
    "circle": (360, 0), "door": (91, 0), "free": (21, 0), "l_shape": (40, 0),
    "pillar": (15, 1), "pipe": (21, 0), "shelf": (25, 0), "slab": (15, 1), "wall": (20, 0),
}  # fmt: skip
HELD = ("pillar", "slab", "wall", "l_shape", "shelf", "pipe", "circle")


@cache
def timed(name: str) -> Plan:
    """The plan with the tool at 0.2 m/s, limits of jerk kept; a speed is held within 2 in 100."""
    near = replace(TIMING.figures, min_speed_share=0.98)
    with patch("regionik.timing.timing_figures.OPTIONS", near):
        return retime(planned(name), SMOOTH)


def held(plan: Plan) -> float:
    """Share of the time on the path, away from its ends and corners, in which the tool has its speed."""
    share: float = plan.stats["timing"]["tool"]["held_elsewhere"]
    return share


def longer(plan: Plan) -> float:
    """Time on the path against that of its length at the tool's speed."""
    spent = np.diff(plan.motion.time)[segments_on_path(plan.motion)].sum()
    return float(spent * TOOL / length_of_path(plan))


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_every_set_point_is_met_with_few_lift_offs(name: str) -> None:
    found = planned(name)
    setpoints, lift_offs = WORLDS[name]
    rows = found.motion.kind == "setpoint"
    tools = found.world.robot.tool(found.motion.base[rows], found.motion.joints[rows])[:, :3, 3]
    targets = np.array([target.position for target in found.world.task])
    assert len(targets) == setpoints
    assert np.linalg.norm(tools - targets, axis=1).max() <= found.world.rules.tolerance * (1 + 1e-6)
    assert found.lift_offs <= lift_offs  # that the plan holds says `tests.test_every_world`


@pytest.mark.slow
@pytest.mark.parametrize("name", HELD)
def test_the_tools_speed_is_held(name: str) -> None:
    assert held(timed(name)) >= 0.95
    assert longer(timed(name)) <= 1.1
