"""All bundled worlds and some random ones, planned and judged by the second opinion.

Run: python -m tests.soak 500 -o docs/soak.md. Exits 1 where a plan or a claim was contradicted.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import date
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely
from rich.progress import track

from regionik.pipeline import search
from regionik.plan import Plan
from regionik.plandocument import plan_to_document
from regionik.urdf_text import robot_to_urdf
from regionik.worlds.chain import chain_from_dh
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.format import world_to_document
from regionik.worlds.library import load_world, world_names
from regionik.worlds.robot import BaseKind, Robot, capsules_along
from regionik.worlds.scene import Start, World
from regionik.worlds.urdf import load_robot
from tests.opinion.course import Course
from tests.opinion.judge import objections
from tests.opinion.machine import Facts, Machine
from tests.opinion.moment import Moment
from tests.opinion.search import find
from tests.test_overhead_worlds import overhead_world
from tests.test_random_worlds import random_world

KINDS = ("floor", "overhead", "made", "wheels", "urdf")  # of random worlds


@dataclass(frozen=True)
class Judged:
    """What came of a world; ``wrong`` is what the second opinion has against it."""

    kind: str
    seed: int
    verdict: str  # "planned" or that of the explanation
    wrong: tuple[str, ...]
    claimed: bool = False  # said: a set-point is proven out of reach, or the start is blocked


def soaked_world(kind: str, seed: int) -> World:
    """A random world of one of `KINDS`, or of the bundled ones the seed-th."""
    match kind:
        case "bundled":
            return load_world(world_names()[seed])
        case "floor":
            return random_world(seed)
        case "overhead":
            return overhead_world(seed, most=6)
        case "made":
            world = random_world(seed)
            return _with(world, made_robot(np.random.default_rng(seed)))
        case "wheels":
            return on_wheels(random_world(seed), seed)
        case _:
            return _with(random_world(seed), through_urdf(random_world(seed).robot))


def _with(world: World, robot: Robot) -> World:
    start = world.start
    return replace(world, robot=robot, start=None if start is None else Start(start.base, robot.carry))


def made_robot(rng: np.random.Generator) -> Robot:
    """An arm of three hinges on a pivot, of random lengths and limits, on a base of random shape."""
    up, out, one, two, tip = rng.uniform([0.08, 0.0, 0.12, 0.1, 0.1], [0.2, 0.05, 0.3, 0.3, 0.3])
    low, high = -rng.uniform(0.8, 2.8, 5), rng.uniform(0.8, 2.8, 5)
    quarter = np.pi / 2
    rows = [
        (0.0, up, out, quarter, low[0], high[0]),
        (0.0, 0.0, one, 0.0, low[1] + quarter, high[1] + quarter),
        (0.0, 0.0, two, 0.0, low[2], high[2]),
        (0.0, 0.0, 0.0, quarter, low[3] + quarter, high[3] + quarter),
        (0.0, tip, 0.0, 0.0, low[4], high[4]),
    ]
    chain = chain_from_dh(rows)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 7))
    round_ = rng.uniform(0.08, 0.3) * np.column_stack([np.cos(angles), rng.uniform(0.5, 1) * np.sin(angles)])
    outline = np.asarray(shapely.MultiPoint(round_).convex_hull.exterior.coords)[:-1]
    carry = np.array([0.0, quarter, 0.0, quarter, 0.0])
    mount = np.array([rng.uniform(-0.1, 0.15), rng.uniform(-0.05, 0.05), 0.1, rng.uniform(-1, 1)])
    solids = capsules_along(chain, float(rng.uniform(0.02, 0.04)))
    return Robot("made", "omni", outline, mount, chain, solids, 0.1, carry)


def on_wheels(world: World, seed: int) -> World:
    """The same with a base that rolls: differential, or a car."""
    kind: BaseKind = "differential" if seed % 2 else "car"
    robot = replace(world.robot, base=kind, turning_radius=0.0 if seed % 2 else 0.4)
    return replace(world, robot=robot, rules=replace(world.rules, heading="free"))


def through_urdf(robot: Robot) -> Robot:
    """A robot written as URDF and read back; its base is the box that URDF has of it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(robot_to_urdf(robot, shapely.box(-2, -2, 6, 2)))
        read = load_robot(path, base=robot.base, tip="tool", root="base")
    return replace(read, carry=robot.carry)


def facts_of(robot: Robot) -> Facts:
    """What the second opinion is told besides the URDF."""
    unchecked = frozenset(frozenset(pair) for pair in robot.unchecked)
    return Facts(robot.base, robot.footprint, robot.body_height, robot.turning_radius, unchecked)


def against(made: Plan) -> tuple[str, ...]:
    """What the second opinion has against a plan."""
    robot = made.world.robot
    document = json.loads(json.dumps(plan_to_document(made)))
    return tuple(objections(document, robot_to_urdf(robot, made.world.floor.polygon), facts_of(robot)))


def counterexample(world: World, setpoint: int) -> np.ndarray | None:
    """A base pose and joint values for a set-point, found by brute force."""
    document = world_to_document(world)
    task = [{"point": point, **piece} for piece in document["task"] for point in piece["points"]]
    machine = Machine(robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
    return find(document, machine, task[setpoint])


def blocked_at_start(world: World) -> bool:
    """Whether anything is in the way of the start, as the second opinion sees it."""
    document = world_to_document(world)
    machine = Machine(robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
    course = Course({"world": document, "states": [{**document["start"], "kind": "transit"}]}, machine)
    return any(Moment(course).look(0, 0.0))


def judged(kind: str, seed: int) -> Judged:
    """Plan a world and ask for the second opinion."""
    world = soaked_world(kind, seed)
    try:
        made = search(world)
    except NoPlanFound as failure:
        why = failure.explanation
        wrong: tuple[str, ...] = () if why.reason else ("no reason is given",)
        blocked = why.verdict == "start-blocked"
        if blocked and not blocked_at_start(world):
            wrong += (f"said to be blocked at its start: {why.reason}",)
        claimed = why.verdict == "unreachable" and why.setpoint is not None and "not proven" not in why.reason
        if claimed and why.setpoint is not None:
            found = counterexample(world, why.setpoint)
            if found is not None:
                there = np.round(found, 6).tolist()
                wrong += (f"said to be out of reach: {why.reason} But {there} is there.",)
        return Judged(kind, seed, why.verdict, wrong, claimed or blocked)
    except InputError as refused:
        return Judged(kind, seed, f"refused: {refused}", ())
    return Judged(kind, seed, "planned", against(made))


def report(found: list[Judged]) -> str:
    """The results as Markdown."""
    drawn = sum(one.kind != "bundled" for one in found)
    lines = [
        "# Random worlds and the second opinion",
        "",
        f"On {date.today()} `make soak` planned all bundled worlds and {drawn} random ones "
        f"(seeds 0 to {drawn - 1}).",
        "Pinocchio and coal judged every plan and every blocked start, brute force every proven",
        "`unreachable` of a set-point: those are the claims tested.",
        "What dense samples do not show is not proven.",
        "See `tests/soak.py` and `tests/opinion`.",
        "",
        "| worlds | planned | no plan, by verdict | claims tested | contradicted |",
        "|---|---|---|---|---|",
    ]
    for kind in ("bundled", *KINDS):
        mine = [one for one in found if one.kind == kind]
        verdicts = Counter(one.verdict for one in mine)
        planned = verdicts.pop("planned", 0)
        words = ", ".join(f"{verdict} {n}" for verdict, n in sorted(verdicts.items())) or "none"
        claims, wrong = sum(one.claimed for one in mine), sum(bool(one.wrong) for one in mine)
        lines.append(f"| {kind}, {len(mine)} | {planned} | {words} | {claims} | {wrong} |")
    wrong_ones = [one for one in found if one.wrong]
    lines += ["", "Contradicted:" if wrong_ones else "None was contradicted.", ""]
    lines += [f"- {_who(one)}: {text}" for one in wrong_ones for text in one.wrong]
    return "\n".join(lines).rstrip() + "\n"


def _who(one: Judged) -> str:
    return world_names()[one.seed] if one.kind == "bundled" else f"{one.kind} {one.seed}"


def main() -> int:
    """Exit code 1 where a plan or a claim was contradicted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=int, nargs="?", default=500)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    bundled, drawn = range(len(world_names())), range(asked.worlds)
    kinds = ["bundled"] * len(bundled) + [KINDS[n % len(KINDS)] for n in drawn]
    seeds = [*bundled, *drawn]
    with ProcessPoolExecutor(asked.workers, get_context("spawn")) as pool:
        found = list(track(pool.map(judged, kinds, seeds), "worlds", len(kinds)))
    text = report(found)
    if asked.output is not None:
        asked.output.write_text(text)
    print(text)
    return int(any(one.wrong for one in found))


if __name__ == "__main__":
    sys.exit(main())
