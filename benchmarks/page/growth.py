"""How cost grows with the set-points of a path, and what a command costs."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely

import regionik as rik
from benchmarks.page.outcomes import NOTHING, PROVEN, Job, Outcome, Topic
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Target, World

COUNTS = 1000, 10_000
OBSTACLES = 100


def topic() -> Topic:
    """Return long paths and commands."""
    long = [
        Job(
            f"{count:,} set-points among {OBSTACLES} boxes, youBot",
            {"regionik": partial(_long, count)},
        )
        for count in COUNTS
    ]
    commands = [
        Job("`regionik --help`", {"regionik": partial(_command, "--help")}),
        Job("`regionik plan pillar`", {"regionik": partial(_command, "plan", "pillar")}),
    ]
    about = (
        "What grows with a path are time and memory; a command also loads the program. The first command\n"
        "after installing compiles what it needs and keeps it; `regionik warm-up` compiles all at once."
    )
    return Topic("Long paths and commands", about, [*long, *commands])


def meander(count: int, obstacles: int, side: float = 30.0, spacing: float = 0.02) -> World:
    """Return rows of a long path a little apart, among boxes on both sides of a floor."""
    rng = np.random.default_rng(0)
    row, along = np.divmod(np.arange(count) * spacing, side)
    x = np.where(row % 2 == 0, along, side - along)
    path = np.column_stack([x, 0.05 * row, np.full(count, 0.25)])
    places = rng.uniform([0, -40], [side, -2], (obstacles, 2))
    boxes = tuple(
        Box(f"box {k}", np.array([0.1, 0.1, 0.1]), np.array([*place, 0.05]), 0.3)
        for k, place in enumerate(places)
    )
    floor = Floor(shapely.box(-2, -42, side + 2, 0.05 * row.max() + 3))
    return World("meander", load_world("free").robot, floor, boxes, tuple(map(Target, path)))


def _long(count: int) -> Outcome:
    plan = rik.plan(meander(count, OBSTACLES))
    seconds = time.process_time()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    said = (
        f"planned, {plan.lift_offs} lift-offs; {1e3 * seconds / count:.2g} ms a set-point, {memory:.1f} GiB"
    )
    return Outcome(seconds, said, PROVEN)


def _command(*words: str) -> Outcome:
    with TemporaryDirectory() as folder:
        out = ["-o", str(Path(folder) / "plan.json")] if "plan" in words else []
        command = [sys.executable, "-m", "regionik", *words, *out]
        subprocess.run(command, check=True, capture_output=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    proves = PROVEN if out else NOTHING
    return Outcome(used.ru_utime + used.ru_stime, "planned, written" if out else "printed", proves)
