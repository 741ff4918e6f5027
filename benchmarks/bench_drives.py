"""Drives with the tool lifted over random worlds, as parts of the shortest way of the base.

That is the way of the largest disc inside the footprint, and of a car at least the shortest curve between
its two poses, which no base can beat. It ignores the arm and the heading: so 1 may be out of reach. Long
drives of a base that goes every way are therefore compared with the shortest of its footprint on a grid, too.

Run: python -m benchmarks.bench_drives 150
"""

from __future__ import annotations

import argparse
import math
import time
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from regionik.pipeline import search
from regionik.planners.driving.footprint import fits
from regionik.scene import scene_of
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.scene import World
from tests.opinion.judge import detours
from tests.soak import DRAWN, told
from tests.soaked import soaked_world

KNOWN = (
    ("ground", 817), ("overhead", 404), ("ground", 506), ("ground", 492), ("overhead", 755), ("made", 132),
    ("made", 46),
)  # fmt: skip
LONGEST = 1.1  # what a drive should keep
CELL, HEADINGS = 0.03, 72  # of the grid [m], and how many
STEPS = np.array(
    [(1, 0, 0), (0, 1, 0), (1, 1, 0), (1, -1, 0), (2, 1, 0), (1, 2, 0), (2, -1, 0), (1, -2, 0)]
    + [(0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 0, -1), (0, 1, -1)]
)
NEAR_END = 2  # cells and headings about an end that are looked at for a free pose
TURN = 1e-4  # cost of a turn to the next heading [m]


class Drive(NamedTuple):
    """A drive of a plan against the shortest: of the disc, and of the footprint where that was looked for."""

    ratio: float
    name: str
    on_grid: float = np.nan


def drives_of(kind: str, seed: int) -> list[Drive]:
    """The drives of one world; none where there is no plan."""
    try:
        plan = search(scene_of(soaked_world(kind, seed)))
    except (InputError, NoPlanFound):
        return []
    found, every_way = list[Drive](), not plan.world.robot.drive.rolls
    for (first, last), ratio in detours(*told(plan)).items():
        on_grid = np.nan
        if ratio > LONGEST and every_way:
            bases = plan.motion.base[first : last + 1]
            on_grid = plan.world.robot.drive.travel(bases) / shortest_on_grid(plan.world, bases)
        found.append(Drive(ratio, f"{kind} {seed}", on_grid))
    return found


def shortest_on_grid(world: World, bases: Array) -> float:
    """Length of the shortest way of the footprint between the ends of a drive; NaN for none [m]."""
    room, half = scene_of(world).footprint, max(0.5, world.robot.drive.travel(bases) / 2)
    fixed, middle = world.rules.heading == "fixed", (bases[0] + bases[-1]) / 2
    axes = [np.arange(at - half, at + half, CELL) for at in middle[:2]]
    axes.append(bases[:1, 2] if fixed else np.arange(HEADINGS) * 2 * np.pi / HEADINGS)
    free = np.array([[[fits(room, x, y, yaw) for yaw in axes[2]] for y in axes[1]] for x in axes[0]])
    rim = [0, 1, -2, -1]  # steps go round the headings and not round the floor
    free[rim] = free[:, rim] = False
    node, edges = np.arange(free.size).reshape(free.shape), []
    for step in STEPS[STEPS[:, 2] == 0] if fixed else STEPS:
        free_both = free & np.roll(free, -step, (0, 1, 2))
        cost = np.full(free_both.sum(), CELL * math.hypot(*step[:2]) + TURN * abs(step[2]))
        edges.append((cost, node[free_both], np.roll(node, -step, (0, 1, 2))[free_both]))
    cost, *pairs = map(np.concatenate, zip(*edges, strict=True))
    graph = coo_array((cost, pairs), shape=(free.size, free.size)).tocsr()
    here, there = (_free_near(axes, free, node, base) for base in (bases[0], bases[-1]))
    if here is None or there is None:
        return np.nan
    way = float(dijkstra(graph, directed=False, indices=here)[there])
    return way if np.isfinite(way) else np.nan


def _free_near(axes: list[Array], free: Mask, node: Index, base: Array) -> int | None:
    """The free node nearest to a base pose, None where none about it is."""
    off = [np.abs(axes[k] - base[k]) for k in (0, 1)] + [np.abs(np.angle(np.exp(1j * (axes[2] - base[2]))))]
    some = np.ix_(*(np.argsort(one)[: 2 * NEAR_END] for one in off))
    far = off[0][some[0]] + off[1][some[1]] + 0.1 * off[2][some[2]]
    far = np.where(free[some], far, np.inf)
    return int(node[some].flat[int(np.argmin(far))]) if np.isfinite(far).any() else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=int, nargs="?", default=150, help="those that were long, then others")
    parser.add_argument("--first", type=int, default=500, help="seed of the first of the others")
    asked = parser.parse_args()
    others = [(DRAWN[n % len(DRAWN)], n) for n in range(asked.first, asked.first + asked.worlds)]
    begin = time.process_time()
    found = [one for kind, seed in [*KNOWN, *others][: asked.worlds] for one in drives_of(kind, seed)]
    all_ = np.array([one.ratio for one in found])
    figures = ", ".join(f"{q} % {np.percentile(all_, q):.3f}" for q in (50, 90, 99, 100))
    print(f"{len(all_)} drives of {asked.worlds} worlds, {time.process_time() - begin:.0f} s: {figures}")
    print(f"{(all_ > LONGEST).sum()} above {LONGEST}; against the footprint's own way, where it was found:")
    for one in sorted(found, reverse=True):
        if one.ratio > LONGEST:
            print(f"  {one.name} {one.ratio:.3f} {one.on_grid:.3f}")
    left = sum(one.ratio > LONGEST and not one.on_grid <= LONGEST for one in found)
    print(f"{left} above {LONGEST} of either")


if __name__ == "__main__":
    main()
