"""What was shown once stays shown: figures of motion, and small forms of benchmarks that judge answers."""

from __future__ import annotations

from itertools import count

import pytest

from benchmarks import bench_avoidance, bench_decided, bench_postures, bench_reach, bench_tracker, bench_why
from benchmarks.bench_motion import SMOOTH, passed, turns
from benchmarks.bench_simulate import SPEEDS, faults
from regionik.simulation.simulate import simulate
from regionik.timing.retime import retime
from regionik.worlds.bundled import world_names
from tests.planned import planned

pytestmark = pytest.mark.slow


def test_the_base_turns_little_in_the_depot_and_the_tool_keeps_its_speed() -> None:
    """52 rad, one corner passed, 89 % of the path at its speed and 98 % away from corners, and a tenth."""
    found = planned("depot")
    timed = retime(found, SMOOTH)
    tool = timed.stats["timing"]["tool"]
    assert found.lift_offs == 0
    assert turns(found.motion.base).sum() < 57
    assert passed(timed) <= 1
    assert tool["held"] > 0.80
    assert tool["held_elsewhere"] > 0.88


PROGRAMS = {
    "four links among circles": lambda: bench_avoidance.main(scenes=2),
    "few targets are undecided": lambda: bench_decided.main(worlds=4, targets=60, drawn=20, starts=2000),
    "postures in clutter": lambda: bench_postures.main(scenes=20, sample=1, first=0),
    "points in areas and outside": lambda: bench_reach.main(pairs=6, points=10, starts=200),
    "causes and smallest repairs": lambda: bench_why.main(3, count(55)),
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_benchmark_that_judges_answers_refutes_none(name: str) -> None:
    assert PROGRAMS[name]() == 0


@pytest.mark.parametrize("name", [pytest.param("circle", marks=pytest.mark.long), "door"])
def test_poses_are_met_to_rounding_without_slip(name: str) -> None:
    assert bench_tracker.measure(name)


@pytest.mark.parametrize("name", [name for name in world_names() if name != "depot"])
def test_a_bundled_world_is_executed_within_what_is_said(name: str) -> None:
    """Without noise: off its path by a millimetre at most, no contact, within limits, the speed held."""
    assert faults(simulate(retime(planned(name), SPEEDS))) == []
