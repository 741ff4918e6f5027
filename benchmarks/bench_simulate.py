"""Worlds executed in the physics simulation: how far the tool is off, without noise and with it.

`python -m benchmarks.bench_simulate [WORLD ...] [--robots FOLDER ...]`; worlds are bundled names, files, or
names of `real_robots` whose URDF files are below the folders: all of both where none is named.
`--seeds N` noisy runs a world (20). With `--execution` there are as many of a plan that is made again with
`rules.execution`: the errors of the first half of these runs, and half as much again, and joints kept off
their limits. A floor narrower than what the base is off, as of a base that is pinned, is widened by that.
Plans are timed for a base of 0.3 m/s and 1 m/s2, joints of 3 rad/s2 and a tool of 0.1 m/s.

Beside the errors without noise: the tool error that is kept for 95 % of the time of all noisy runs, the share
of the time for which the place of the base is known well enough for 5 mm, how many runs keep 5 mm for 95 % of
theirs, how many touch something, and how much faster than the robot the simulation is, in CPU seconds. It
fails where a run without noise is 1 mm off its path, or 2 mm on wheels, touches something, goes beyond a
limit, or holds the tool's speed for less than 99 % of the time; where the noisy runs of a world do not keep
5 mm for 95 % of their time though the base is known well enough; and where one made with `rules.execution`
touches.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import erfc

from benchmarks.real_robots import real_robots
from regionik.pipeline import plan
from regionik.simulation.noise import typical_noise
from regionik.simulation.run import SimulatedRun
from regionik.simulation.simulate import simulate
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.bundled import world_names
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.limits import Criteria, Execution, Speeds
from regionik.worlds.scene import World

SPEEDS = Speeds(base_velocity=0.3, base_acceleration=1.0, joint_acceleration=3.0, tool_velocity=0.1)
ON_WHEELS, EVERY_WAY = 2e-3, 1e-3  # largest tool error without noise [m]
NOISY = 5e-3  # largest tool error with noise, 95 % of the time [m]
HELD, USED = 0.99, 1.01
RAMPS = 0.05  # time from rest and back to it, on however short a path [s]
KNOWN = 0.95  # share of the time for which what is known of the base must allow for `NOISY`
SPARE = 1.5  # times the errors of some runs that others may have
JOINT_MARGIN = 0.02  # share of their ranges that joints keep from their limits, to take up errors


@dataclass(frozen=True)
class Outcome:
    """What a noisy run came to: whether anything touched, errors needed, and row by row on the path (n,) the
    tool's error and its spread [m].
    """

    tool_error: Array
    tool_spread: Array
    touches: bool
    errors: Execution


def noisy_runs(timed: Plan, count: int) -> list[Outcome]:
    found = []
    for seed in range(count):
        run = simulate(timed, typical_noise(), seed=seed)
        on_path = run.reference.on_path
        errors, spreads = run.tool_error[on_path], run.tool_spread[on_path]
        found.append(Outcome(errors, spreads, bool(run.contacts), run.execution))
    return found


def known(runs: list[Outcome]) -> float:
    """Share of the time for which the tool can be expected within `NOISY` by what is known of the base.

    It is an upper bound: along the direction known least alone, and of an arm that takes up all it is told.
    """
    spread = np.concatenate([[0.0], *(run.tool_spread for run in runs)])
    return float(1.0 - erfc(NOISY / np.maximum(np.sqrt(2) * spread, 1e-12)).mean())


def faults(run: SimulatedRun) -> list[str]:
    """What a run without noise must not do."""
    figures = run.figures
    most = ON_WHEELS if run.plan.world.robot.drive.rolls else EVERY_WAY
    found = {
        f"tool error over {1000 * most:g} mm": figures["tool_error"]["worst"] > most,
        "contacts": bool(run.contacts),
        "limits": max(figures["used"].values()) > USED,
        "tool speed": (HELD - figures["speed_held"]) * figures["duration"] > RAMPS,
    }
    return [fault for fault, is_so in found.items() if is_so]


def needed(runs: list[Outcome]) -> Execution:
    """The largest errors of some runs."""
    return Execution(*np.max([astuple(run.errors) for run in runs], axis=0).tolist())


def allowing(world: World, errors: Execution) -> World:
    """The world with errors among its rules, and room for them in its joints, on its path and floor."""
    tolerance = max(world.rules.path_tolerance, 2 * errors.tool_error)
    criteria = world.rules.criteria or Criteria(joint_margin=JOINT_MARGIN)
    rules = replace(world.rules, execution=errors, path_tolerance=tolerance, criteria=criteria)
    found = replace(world, rules=rules)
    if not found.drivable_floor.is_empty:
        return found
    wide = world.floor.polygon.buffer(found.base_allowance, join_style="mitre")
    return replace(found, floor=replace(found.floor, polygon=wide))


def again(world: World, noisy: list[Outcome]) -> tuple[str, list[Outcome]]:
    """A line about runs of a plan made with the errors of others, and these runs; none without a plan."""
    errors = Execution(*(SPARE * value for value in astuple(needed(noisy[: (len(noisy) + 1) // 2]))))
    told = ", ".join(f"{key} {value:.4f}" for key, value in vars(errors).items())
    try:
        timed = retime(plan(allowing(world, errors)), SPEEDS)
    except NoPlanFound as failure:
        return f"         no plan with {told}: {failure}", []
    runs = noisy_runs(timed, len(noisy))
    most = 1000 * (needed(runs).arm_error or 0.0)
    return f"         {touching(runs)} touch with {told}; arm off by {most:.1f} mm at most", runs


def touching(runs: list[Outcome]) -> str:
    return f"{sum(run.touches for run in runs)}/{len(runs)}"


@dataclass(frozen=True)
class Row:
    """What a world came to: its lines and faults, and noisy runs without `rules.execution` and with it."""

    text: str
    faults: list[str]
    noisy: list[Outcome]
    allowed: list[Outcome]


def row(world: World, seeds: int, *, execution: bool) -> Row:
    """Plan a world, and execute the plan."""
    timed = retime(plan(world), SPEEDS)
    began = time.process_time()
    clean = simulate(timed)
    speed = float(clean.time[-1]) / (time.process_time() - began)
    noisy = noisy_runs(timed, seeds)
    p95 = float(np.percentile(np.concatenate([[0.0], *(run.tool_error for run in noisy)]), 95))
    within = sum(np.percentile(run.tool_error, 95) <= NOISY for run in noisy)
    error, held, share = clean.figures["tool_error"], clean.figures["speed_held"], known(noisy)
    text = (
        f"{world.name:8} {clean.time[-1]:7.1f} s"
        f" {1000 * error['median']:7.3f} {1000 * error['worst']:7.3f} mm"
        f" {held:8.2%} {1000 * p95:7.2f} mm {share:6.1%} {within:4d}/{seeds:<3d}"
        f" {touching(noisy):>7} {speed:5.0f} x"
    )
    found = faults(clean) + ["tool error with noise"] * (p95 > NOISY and share >= KNOWN)
    if not execution:
        return Row(text, found, noisy, [])
    more, allowed = again(world, noisy)
    safe = bool(allowed) and not any(run.touches for run in allowed)
    return Row(f"{text}\n{more}", found + ["not safe with rules.execution"] * (not safe), noisy, allowed)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("worlds", nargs="*")
    parser.add_argument("--robots", nargs="*", type=Path, default=[], metavar="FOLDER")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--execution", action="store_true")
    asked = parser.parse_args()
    robots = real_robots(asked.robots, asked.worlds)
    print("world    duration   median   worst       speed    p95 noisy   known   below   touch  faster")
    rows: dict[str, Row] = {}
    for name in asked.worlds or [*world_names(), *robots]:
        world = robots[name] if name in robots else load_world(name)
        rows[name] = row(world, asked.seeds, execution=asked.execution)
        print(rows[name].text, flush=True)
    noisy, allowed = (
        [run for one in rows.values() for run in getattr(one, key)] for key in ("noisy", "allowed")
    )
    print(f"{len(rows)} worlds: {touching(noisy)} noisy runs touch, with rules.execution {touching(allowed)}")
    told = [f"{name}: {', '.join(one.faults)}" for name, one in rows.items() if one.faults]
    sys.exit("; ".join(told) or None)
