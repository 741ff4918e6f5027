"""Rasters on a wall, beside a loop of differential inverse kinematics; `verify` judges both."""

from __future__ import annotations

import time
from functools import partial
from typing import NamedTuple

import numpy as np

import regionik as rik
from benchmarks.page.outcomes import NOTHING, STATES, Job, Outcome, Topic, planned, travelled
from regionik.values import Configuration, Motion, Plan
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World
from tests.harness.rasters import Clutter, carried, raster

LOOP = "differential IK in a loop (mink, daqp)"


class Case(NamedTuple):
    """A raster: what is about the wall, its poses a row, its rows, and the height of the first [m]."""

    clutter: Clutter
    columns: int
    rows: int
    height: float = 0.9


JOBS = (
    ("60 poses, nothing about", Case("open", 20, 3)),
    ("60 poses, pilaster, crate, column and duct about", Case("clutter", 20, 3)),
    ("60 poses, a low post to go round", Case("bollard", 20, 3)),
    ("200 poses, pilaster, crate, column and duct about", Case("clutter", 20, 10, 0.75)),
    ("60 poses, 3 m up, above all reach", Case("open", 20, 3, 3.0)),
)


def topic() -> Topic:
    """Return the rasters of a UR10e."""
    jobs = [Job(what, {"regionik": partial(_ours, case), LOOP: partial(_loop, case)}) for what, case in JOBS]
    about = (
        "A UR10e on an omnidirectional platform leads a tool along rows on a gently bent wall: full poses\n"
        "12 cm apart, path within 1 mm, 5 cm clear of the base and 1 cm of the arm. The loop tries up to 40\n"
        "starts in a fixed order and checks states; `verify`, outside its time, says whether what it did\n"
        "holds between them too. Without the package mink its rows say so."
    )
    return Topic("Rasters on a wall", about, jobs)


def _ours(case: Case) -> Outcome:
    return planned(raster(carried("UR10e"), *case))


def _loop(case: Case) -> Outcome:
    from benchmarks.page.differential_loop import followed

    world = raster(carried("UR10e"), *case)
    states, met, tried = followed(world)
    seconds = time.process_time()
    starts = "" if tried == 1 else f", {tried} starts tried"
    missed = len(world.task) - len(met)
    if missed:
        return Outcome(seconds, f"{missed} of {len(world.task)} poses missed{starts}", NOTHING)
    plan = as_plan(world, states, met)
    report = rik.verify(plan)
    kinds = ", ".join(sorted({one.kind for one in report.violations} - {"derived"}))  # a loop notes nothing
    held = "`verify` accepts its motion" if not kinds else f"`verify` refuses it: {kinds}"
    return Outcome(seconds, f"follows, {travelled(plan)}{starts}; {held}", STATES)


def as_plan(world: World, states: Array, met: list[int]) -> Plan:
    """Return states (n, 3 + dof) as a plan for `verify`; ``met`` are the rows of the poses."""
    rows = np.arange(len(states))
    kinds = np.where(np.isin(rows, met), "setpoint", "step")
    behind = np.searchsorted(met, rows, side="right") - 1
    motion = Motion(states[:, :3], states[:, 3:], kinds, behind, np.full(len(states), np.nan))
    found = tuple(Configuration(states[k, :3], states[k, 3:], 0.0, 0, True) for k in met)
    return Plan(world, 0, found, motion, (), 0, ())
