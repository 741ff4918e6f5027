"""Runs of base and joints together that begin where others are stuck."""

from __future__ import annotations

from regionik.pipeline import plan
from regionik.verification.verifier import verify
from tests.harness.rasters import bent_panel, carried
from tests.harness.worlds import WORLDS


def test_a_run_that_is_stuck_is_grown_from_there_towards_both_ends() -> None:
    """From every posture at the first pose that was tried, the arm gets to a limit halfway."""
    found = plan(bent_panel(carried("Panda"), 6, 2))
    assert found.lift_offs == 0
    assert verify(found).ok


def test_a_run_that_gets_through_from_neither_end_is_grown_from_midway() -> None:
    """On two wheels a base is stuck on its way along the pillar, whichever end it begins from."""
    found = plan(WORLDS["pillar-differential"]())
    assert found.lift_offs == 1
    assert verify(found).ok
