"""Random worlds, planned and judged by the second opinion: ``python -m tests.soak 500 -o docs/soak.md``."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
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
from regionik.worlds.robot import BaseKind, Robot, capsules_along
from regionik.worlds.scene import Start, World
from regionik.worlds.urdf import load_robot
from tests.opinion.judge import objections
from tests.opinion.machine import Facts, Machine
from tests.opinion.search import find
from tests.test_overhead_worlds import overhead_world
from tests.test_random_worlds import random_world

KINDS = ("floor", "overhead", "made", "wheels", "urdf")


@dataclass(frozen=True)
class Judged:
    """What came of a world; ``wrong`` is what the second opinion has against it."""

    kind: str
    seed: int
    verdict: str  # "planned" or that of the explanation
    wrong: tuple[str, ...]
    claimed: bool = False  # whether it is said to be proven that no base reaches a set-point


def soaked_world(kind: str, seed: int) -> World:
    """A world of one of `KINDS`."""
    match kind:
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


def judged(kind: str, seed: int) -> Judged:
    """Plan a world and ask for the second opinion."""
    world = soaked_world(kind, seed)
    try:
        made = search(world)
    except NoPlanFound as failure:
        why = failure.explanation
        wrong: tuple[str, ...] = () if why.reason else ("no reason is given",)
        claimed = why.verdict == "unreachable" and why.setpoint is not None and "not proven" not in why.reason
        if claimed and why.setpoint is not None:
            found = counterexample(world, why.setpoint)
            if found is not None:
                there = np.round(found, 6).tolist()
                wrong += (f"said to be out of reach: {why.reason} But {there} is there.",)
        return Judged(kind, seed, why.verdict, wrong, claimed)
    except InputError as refused:
        return Judged(kind, seed, f"refused: {refused}", ())
    return Judged(kind, seed, "planned", against(made))


def report(found: list[Judged]) -> str:
    """The results as Markdown."""
    lines = [
        "# Random worlds and the second opinion",
        "",
        f"`make soak` planned {len(found)} random worlds (seeds 0 to {len(found) - 1}).",
        "Pinocchio and coal judged every plan, and brute force every proven `unreachable`.",
        "See `tests/soak.py` and `tests/opinion`.",
        "",
        "| worlds | planned | no plan, by verdict | proven out of reach | contradicted |",
        "|---|---|---|---|---|",
    ]
    for kind in KINDS:
        mine = [one for one in found if one.kind == kind]
        verdicts = Counter(one.verdict for one in mine)
        planned = verdicts.pop("planned", 0)
        words = ", ".join(f"{verdict} {n}" for verdict, n in sorted(verdicts.items())) or "none"
        claims, wrong = sum(one.claimed for one in mine), sum(bool(one.wrong) for one in mine)
        lines.append(f"| {kind}, {len(mine)} | {planned} | {words} | {claims} | {wrong} |")
    wrong_ones = [one for one in found if one.wrong]
    lines += ["", "Contradicted:" if wrong_ones else "None was contradicted.", ""]
    lines += [f"- {one.kind} {one.seed}: {text}" for one in wrong_ones for text in one.wrong]
    return "\n".join(lines).rstrip() + "\n"


def _nth(n: int) -> Judged:
    return judged(KINDS[n % len(KINDS)], n)


def main() -> int:
    """Exit code 1 where a plan or a claim was contradicted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=int, nargs="?", default=500)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    with ProcessPoolExecutor(asked.workers, get_context("spawn")) as pool:
        found = list(track(pool.map(_nth, range(asked.worlds)), "worlds", asked.worlds))
    text = report(found)
    if asked.output is not None:
        asked.output.write_text(text)
    print(text)
    return int(any(one.wrong for one in found))


if __name__ == "__main__":
    sys.exit(main())
