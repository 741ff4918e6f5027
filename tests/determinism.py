"""What is planned, as numbers to compare: ``python -m tests.determinism [-o FILE] [--against FILE]``.

It prints a digest of each result, and given the results of another interpreter, of other versions or another
machine, how far the numbers are apart at most. Exit code 1 where that is more than 1e-9.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import box, shape

import regionik as rik
from regionik.output.answers import csv_rows
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.plans import plan_to_document

NEAR = 1e-9
Document = dict[str, Any]


def planned(world: World) -> Document:
    """The plan of a world as its file has it, or why there is none."""
    try:
        document: Document = plan_to_document(rik.plan(world))
    except NoPlanFound as no:
        return {"reason": no.explanation.reason}
    return document


def bundled(name: str) -> World:
    return rik.load_world(name)


def parked() -> World:
    world = bundled("l_shape")
    return replace(world, rules=replace(world.rules, mode="stops"))


def timed() -> World:
    return replace(bundled("free"), speeds=rik.Speeds(base_velocity=0.5, joint_velocity=1.0))


def painter() -> World:
    """A robot from a URDF file, a wall, and a beam that its mast passes by."""
    file = Path(__file__).parents[1] / "examples" / "painter.urdf"
    robot = rik.load_robot(file, tip="nozzle", carry=[0, 1.6, -2.4, 0, 0])
    wall = Box("wall", np.array([3.0, 0.1, 2.0]), np.array([0.0, 1.05, 1.0]))
    beam = Box("beam", np.array([0.2, 0.5, 0.3]), np.array([-1.3, 0.2, 0.85]))
    task = tuple(Target(np.array([x, 0.9, 1.0])) for x in np.linspace(-0.9, 0.9, 7))
    rules, start = Rules(clearance=0.05, arm_clearance=0.01), Start(np.array([-1.0, -0.8, 0.0]), robot.carry)
    return World("painter", robot, Floor(box(-2.5, -1.5, 2.5, 1.5)), (wall, beam), task, rules, start)


def answers() -> Document:
    """Reach of targets all over a map, asked for in bulk."""
    world = bundled("depot")
    low, high = np.reshape(world.floor.polygon.bounds, (2, 2))
    spots = np.random.default_rng(0).uniform([*low, 0.0], [*high, 0.9], (300, 3))
    answer = rik.reach(world, spots, chunk=100)
    rows = [line.split(",") for line in csv_rows(answer, world.robot.chain.names).splitlines()]
    return {"rows": [[_number(cell) for cell in row] for row in rows]}


def why() -> Document:
    """Causes and repairs of a target that is out of reach."""
    found = rik.why(bundled("shelf"), [2.0, 0.0, 3.0])
    assert found is not None
    return {"reason": found.reason, "amounts": [[r.amount, *r.vector] for r in found.repairs]}


def _number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


MADE: dict[str, Callable[[], Document]] = {
    "omni": lambda: planned(bundled("l_shape")),
    "transits": lambda: planned(bundled("pillar")),
    "door": lambda: planned(bundled("door")),
    "wheels": lambda: planned(bundled("circle")),
    "avoidance": lambda: planned(bundled("shelf")),
    "map": lambda: planned(bundled("depot")),
    "stops": lambda: planned(parked()),
    "urdf": lambda: planned(painter()),
    "timed": lambda: planned(timed()),
    "reach": answers,
    "why": why,
}


def digest(document: Document) -> str:
    return hashlib.sha256(json.dumps(document).encode()).hexdigest()[:16]


def apart(one: Any, other: Any, place: str = "") -> Iterator[tuple[float, str]]:
    """How far numbers are apart, and where; infinitely where anything else differs."""
    if isinstance(one, dict) and "coordinates" in one and isinstance(other, dict) and one != other:
        yield _areas_apart(one, other), place  # as places: where a ring begins is no matter
    elif isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        for key in one:
            yield from apart(one[key], other[key], f"{place}.{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from apart(a, b, f"{place}[{k}]")
    elif isinstance(one, int | float) and isinstance(other, int | float):
        yield abs(one - other), place
    elif one != other:
        yield np.inf, place


def _areas_apart(one: Document, other: Document) -> float:
    """Area of what only one of two areas has [m2], or how far their outlines are apart [m]: the less."""
    a, b = shape(one), shape(other)
    if a.is_empty or b.is_empty:
        return 0.0 if a.is_empty and b.is_empty else float("inf")
    return min(float(shapely.hausdorff_distance(a, b)), float((a ^ b).area))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(MADE)}")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    other = json.loads(asked.against.read_text("utf-8")) if asked.against else {}
    made, worst = {}, 0.0
    for name in asked.names or MADE:  # in the order asked for: what was planned before must not matter
        made[name] = MADE[name]()
        line = f"{name:10} {digest(made[name])}"
        if name in other:
            far, place = max(apart(made[name], other[name]), default=(0.0, ""))
            worst = max(worst, far)
            line += f"  equal to {far:.1e}{f' at {place}' if far else ''}"
        print(line, flush=True)
    if asked.output:
        asked.output.write_text(json.dumps(made), "utf-8")
    return int(worst > NEAR)


if __name__ == "__main__":
    sys.exit(main())
