"""Worlds executed in the physics simulation: how far the tool is off, without noise and with it.

`python -m benchmarks.bench_simulate [world ...]`; worlds are bundled names or files, `--seeds N` noisy runs a
world (20). With `--execution` there are as many of a plan that is made again with `rules.execution`: the
errors of the first half of these runs, and half as much again, and joints kept
off their limits. Plans are timed for a base of 0.3 m/s and a
tool of 0.1 m/s. It fails where a run without noise is 1 mm off its path, or 2 mm on wheels, touches
something, goes beyond a limit, or holds the tool's speed for less than 99 % of the time. Beside the errors,
how many noisy runs have 95 % of their errors below 5 mm, how many touch something, and how much faster than
the robot the simulation is, in CPU seconds. It fails too where a run of a plan made with `rules.execution`
touches something. A floor narrower than what the base is off, as of a base that is pinned, is widened by
that.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import astuple, replace

import numpy as np

from regionik.pipeline import plan
from regionik.simulation.noise import Noise, typical_noise
from regionik.simulation.run import SimulatedRun
from regionik.simulation.simulate import simulate
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.worlds.bundled import world_names
from regionik.worlds.criteria import Criteria
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.execution import Execution
from regionik.worlds.scene import World
from regionik.worlds.speeds import Speeds

SPEEDS = Speeds(base_velocity=0.3, tool_velocity=0.1)
ON_WHEELS, EVERY_WAY = 2e-3, 1e-3  # largest tool error without noise [m]
NOISY = 5e-3  # largest 95th percentile of the tool error with noise [m]
HELD, USED = 0.99, 1.01
SPARE = 1.5  # times the errors of some runs that others may have
JOINT_MARGIN = 0.02  # share of their ranges that joints keep from their limits, to take up errors


def timed_run(timed: Plan, noise: Noise, seed: int) -> tuple[SimulatedRun, float]:
    """A run, and how many times faster than the robot it was."""
    began = time.process_time()
    run = simulate(timed, noise, seed=seed)
    return run, float(run.time[-1]) / (time.process_time() - began)


def faults(run: SimulatedRun) -> list[str]:
    """What a run without noise must not do."""
    figures = run.figures
    most = ON_WHEELS if run.plan.world.robot.drive.rolls else EVERY_WAY
    found = {
        f"tool error over {1000 * most:g} mm": figures["tool_error"]["worst"] > most,
        "contacts": bool(run.contacts),
        "limits": max(figures["used"].values()) > USED,
        "tool speed": figures["speed_held"] < HELD,
    }
    return [fault for fault, is_so in found.items() if is_so]


def needed(runs: list[SimulatedRun]) -> Execution:
    """The largest errors of some runs."""
    return Execution(*np.max([astuple(run.execution) for run in runs], axis=0).tolist())


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


def again(world: World, noisy: list[SimulatedRun]) -> str:
    """How many noisy runs touch something, of a plan made with the errors of others."""
    errors = Execution(*(SPARE * value for value in astuple(needed(noisy[: (len(noisy) + 1) // 2]))))
    told = ", ".join(f"{key} {value:.4f}" for key, value in vars(errors).items())
    try:
        timed = retime(plan(allowing(world, errors)), SPEEDS)
    except NoPlanFound as failure:
        return f"         no plan with {told}: {failure}"
    runs = [timed_run(timed, typical_noise(), seed)[0] for seed in range(len(noisy))]
    most = 1000 * (needed(runs).arm_error or 0.0)
    touching = sum(bool(run.contacts) for run in runs)
    return f"         {touching}/{len(runs)} touch with {told}; arm off by {most:.1f} mm at most"


def row(world: World, seeds: int, *, execution: bool) -> tuple[str, list[str]]:
    """The lines of a world, and its faults."""
    timed = retime(plan(world), SPEEDS)
    clean, speed = timed_run(timed, Noise(), 0)
    noisy = [timed_run(timed, typical_noise(), seed)[0] for seed in range(seeds)]
    shares = [run.figures["tool_error"]["p95"] for run in noisy]
    within = sum(share <= NOISY for share in shares)
    touching = sum(bool(run.contacts) for run in noisy)
    error, held = clean.figures["tool_error"], clean.figures["speed_held"]
    text = (
        f"{world.name:8} {clean.time[-1]:7.1f} s"
        f" {1000 * error['median']:7.3f} {1000 * error['worst']:7.3f} mm"
        f" {held:8.2%} {1000 * max(shares, default=0.0):7.2f} mm {within:4d}/{seeds:<3d}"
        f" {touching:4d}/{seeds:<3d} {speed:5.0f} x"
    )
    found = faults(clean)
    if execution:
        more = again(world, noisy)
        found += [] if more.lstrip().startswith("0/") else ["not safe with rules.execution"]
        text = f"{text}\n{more}"
    return text, found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=list(world_names()))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--execution", action="store_true")
    asked = parser.parse_args()
    print("world    duration   median   worst       speed    p95 noisy    below     touch  faster")
    broken: dict[str, list[str]] = {}
    for name in asked.worlds:
        line, broken[name] = row(load_world(name), asked.seeds, execution=asked.execution)
        print(line, flush=True)
    told = [f"{name}: {', '.join(found)}" for name, found in broken.items() if found]
    sys.exit("; ".join(told) or None)
