"""Runs of base and joints together that begin where others are stuck."""

from __future__ import annotations

from regionik.pipeline import plan
from regionik.verification.verifier import verify
from tests.harness.rasters import bent_panel, carried


def test_a_run_that_is_stuck_is_grown_from_there_towards_both_ends() -> None:
    """From every posture at the first pose that was tried, the arm gets to a limit halfway."""
    found = plan(bent_panel(carried("Panda"), 6, 2))
    assert found.lift_offs == 0
    assert verify(found).ok
