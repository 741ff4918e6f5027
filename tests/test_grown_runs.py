"""Runs of base and joints together that begin where others are stuck."""

from __future__ import annotations

from dataclasses import replace

from regionik.pipeline import plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world
from tests.harness.rasters import bent_panel, carried


def test_a_run_that_is_stuck_is_grown_from_there_towards_both_ends() -> None:
    """From every posture at the first pose that was tried, the arm gets to a limit halfway."""
    found = plan(bent_panel(carried("Panda"), 6, 2))
    assert found.lift_offs == 0
    assert verify(found).ok


def test_a_run_that_gets_through_from_neither_end_is_grown_from_midway() -> None:
    """On two wheels a base that begins at the first set-point of the pillar is stuck at the tenth, or back."""
    world = load_world("pillar")
    found = plan(replace(world, robot=replace(world.robot, base="differential")))
    assert found.lift_offs == 1
    assert verify(found).ok
