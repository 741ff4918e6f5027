"""Bundled worlds executed in the physics simulation: how far the tool is off, without noise and with it.

`python -m benchmarks.bench_simulate [world ...]`; `--seeds N` noisy runs a world (20). Plans are timed for a
base of 0.3 m/s and a tool of 0.1 m/s. It fails where a run without noise is 1 mm off its path, or 2 mm on
wheels, touches something, goes beyond a limit, or holds the tool's speed for less than 99 % of the time.
Beside the errors, how many noisy runs have 95 % of their errors below 5 mm, how many touch something, and how
much faster than the robot the simulation is, in CPU seconds.
"""

from __future__ import annotations

import argparse
import sys
import time

from regionik.pipeline import plan
from regionik.simulation.noise import Noise, typical_noise
from regionik.simulation.run import SimulatedRun
from regionik.simulation.simulate import simulate
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.worlds.bundled import world_names
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.speeds import Speeds

SPEEDS = Speeds(base_velocity=0.3, tool_velocity=0.1)
ON_WHEELS, EVERY_WAY = 2e-3, 1e-3  # largest tool error without noise [m]
NOISY = 5e-3  # largest 95th percentile of the tool error with noise [m]
HELD, USED = 0.99, 1.01


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


def row(name: str, seeds: int) -> tuple[str, list[str]]:
    """The line of a world, and its faults."""
    timed = retime(plan(load_world(name)), SPEEDS)
    clean, speed = timed_run(timed, Noise(), 0)
    noisy = [timed_run(timed, typical_noise(), seed)[0] for seed in range(seeds)]
    shares = [run.figures["tool_error"]["p95"] for run in noisy]
    within = sum(share <= NOISY for share in shares)
    touching = sum(bool(run.contacts) for run in noisy)
    error, held = clean.figures["tool_error"], clean.figures["speed_held"]
    text = (
        f"{name:8} {clean.time[-1]:7.1f} s {1000 * error['median']:7.3f} {1000 * error['worst']:7.3f} mm"
        f" {held:8.2%} {1000 * max(shares, default=0.0):7.2f} mm {within:4d}/{seeds:<3d}"
        f" {touching:4d}/{seeds:<3d} {speed:5.0f} x"
    )
    return text, faults(clean)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=list(world_names()))
    parser.add_argument("--seeds", type=int, default=20)
    asked = parser.parse_args()
    print("world    duration   median   worst       speed    p95 noisy    below     touch  faster")
    broken: dict[str, list[str]] = {}
    for name in asked.worlds:
        line, broken[name] = row(name, asked.seeds)
        print(line, flush=True)
    told = [f"{name}: {', '.join(found)}" for name, found in broken.items() if found]
    sys.exit("; ".join(told) or None)
