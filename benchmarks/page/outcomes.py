"""What came of a job on one side, and the page that sets two sides beside each other."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

import regionik as rik
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.scene import World

PROVEN, REFUTED, STATES = "proven motion", "proven that it cannot be done", "collision-checked states"
POSES, NOTHING = "joints at each pose", "nothing"
PACKAGES = "regionik", "numpy", "numba", "ompl", "mink", "mujoco", "daqp"
HEAD = "| job | how | processor time | outcome | proves |\n|---|---|---|---|---|"


@dataclass(frozen=True)
class Outcome:
    """One side of a job: processor seconds, what came of it and what that proves.

    ``seconds`` is None where nothing was run here; ``said`` then tells whose figures they are.
    """

    seconds: float | None
    said: str
    proves: str


Side = Callable[[], Outcome] | Outcome  # one that is run, or one that is known


class Job(NamedTuple):
    """A job and its sides, ours first, by what they are; each is run in a process of its own."""

    what: str
    sides: Mapping[str, Side]


class Topic(NamedTuple):
    """Jobs under one heading."""

    title: str
    about: str
    jobs: Sequence[Job]


def planned(world: World, told: Callable[[rik.Plan], str] | None = None) -> Outcome:
    """Return what `plan` makes of a world."""
    try:
        plan = rik.plan(world)
    except NoPlanFound as no:
        proves = REFUTED if no.explanation.verdict == "unreachable" else NOTHING
        return Outcome(time.process_time(), f"no plan: {no.explanation.verdict}", proves)
    seconds = time.process_time()
    return Outcome(seconds, (told or driven)(plan), PROVEN)


def driven(plan: rik.Plan) -> str:
    """Return how far base and arm go in a plan."""
    lifts = {0: "no lift-off", 1: "1 lift-off"}.get(plan.lift_offs, f"{plan.lift_offs} lift-offs")
    return f"planned, {lifts}, {travelled(plan)}"


def travelled(plan: rik.Plan) -> str:
    """Return the way of the base and the travel of all joints together, from the first pose on."""
    first = int(np.argmax(np.array(plan.motion.kind) == "setpoint"))
    base, joints = plan.motion.base[first:], plan.motion.joints[first:]
    way = np.linalg.norm(np.diff(base[:, :2], axis=0), axis=1).sum()
    return f"base {way:.1f} m, arm {np.abs(np.diff(joints, axis=0)).sum():.1f} rad"


def as_markdown(topics: Sequence[tuple[str, str, Sequence[tuple[str, str, Outcome]]]], preface: str) -> str:
    """Return the page of topics: title, what is to be known, and rows of job, side and outcome."""
    parts = [preface, _machine()]
    for title, about, rows in topics:
        parts += [f"## {title}\n\n{about}\n", "\n".join([HEAD, *map(_line, rows)]) + "\n"]
    return "\n".join(parts)


def _line(row: tuple[str, str, Outcome]) -> str:
    job, side, found = row
    seconds = "not run here" if found.seconds is None else seconds_as_text(found.seconds)
    return f"| {' | '.join((job, side, seconds, found.said, found.proves))} |"


def seconds_as_text(seconds: float) -> str:
    """Return a time with two or three digits."""
    return f"{seconds:,.0f} s" if seconds >= 100 else f"{seconds:.3g} s"


def _machine() -> str:
    versions = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    place = f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    return f"Machine: {place}. Versions: {versions}.\n"


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "absent"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
