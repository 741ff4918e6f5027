"""Tables 1 to 3 of Tao et al. (2021): four links of length 1 among five circles.

The first run of each table has no obstacles and is met in every printed digit. The circles of the others are
drawn at random and not printed; ours are seeded scenes of the same kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.bench_avoidance import (
    LINKS,
    TESTS,
    TOLERANCE,
    UPRIGHT,
    bodies_of,
    circles,
    free,
    planar_arm,
    posts,
)
from benchmarks.tables.clock import seconds
from benchmarks.tables.table import Table
from regionik.planners.avoidance.avoiding_fabrik import (
    MAX_ITERATIONS,
    AvoidanceResult,
    avoid_obstacles,
    links_clear,
)
from regionik.planners.search.fixed_base import VERDICT_NAMES, search_fixed_base

SCENES = 200
NOTHING = np.zeros((0, 2)), np.zeros(0)  # no circles

# Iterations, distance from the target, time [s] of runs 1 to 9, as printed.
PRINTED = (
    (
        *((77, 9.8638e-04, 0.2659), (55, 9.8044e-04, 0.2206), (9, 8.5390e-04, 0.1097)),
        *((30, 8.7228e-04, 0.2102), (10, 9.2472e-04, 0.1272), (23, 8.5583e-04, 0.1408)),
        *((100, 0.1195, 0.8193), (100, 0.3136, 0.9215), (100, 0.2938, 1.1800)),
    ),
    (
        *((7, 8.6819e-04, 0.0880), (4, 6.1996e-04, 0.0898), (3, 4.2464e-04, 0.0853)),
        *((2, 5.1837e-04, 0.1160), (5, 3.0560e-04, 0.1012), (5, 2.5677e-06, 0.0984)),
        *((3, 4.9393e-06, 0.1119), (3, 6.0699e-04, 0.1326), (11, 4.6694e-04, 0.2120)),
    ),
    (
        *((3, 4.9565e-04, 0.0748), (2, 3.7932e-05, 0.0826), (2, 1.0127e-05, 0.0917)),
        *((1, 5.0544e-04, 0.0884), (2, 3.1292e-05, 0.0918), (2, 2.7737e-04, 0.0922)),
        *((4, 5.5242e-04, 0.1394), (6, 2.7428e-05, 0.1448), (3, 3.7580e-05, 0.1350)),
    ),
)


def run(test: int, seed: int | None) -> AvoidanceResult:
    """A run of test 1, 2 or 3 in the scene of a seed, or without obstacles."""
    target, corner = TESTS[test - 1]
    middles, radii = NOTHING if seed is None else circles(corner, seed)
    goal = np.array([target, target, 0.0])
    clear = links_clear(bodies_of(posts(middles, radii)), np.zeros(3), goal, 0.0)
    return avoid_obstacles(planar_arm()[0], goal, UPRIGHT, clear, tolerance=TOLERANCE, seed=seed or 0)


class Many(NamedTuple):
    """Runs in scenes 0, 1, ... of a test.

    Attributes
    ----------
    found : tuple of Avoided
    refuted : int
        Answers that exact distances in the plane do not confirm.
    """

    found: tuple[AvoidanceResult, ...]
    refuted: int

    @property
    def iterations(self) -> list[int]:
        """Of the runs that came to an answer."""
        return [one.iterations for one in self.found if one.converged]


def runs(test: int, scenes: int) -> Many:
    """A run in each of so many scenes."""
    target, corner = TESTS[test - 1]
    found = tuple(run(test, seed) for seed in range(scenes))
    wrong = sum(
        one.converged and not free(one.joints, target, *circles(corner, seed))
        for seed, one in enumerate(found)
    )
    return Many(found, int(wrong))


def blocked(test: int, scenes: int) -> int:
    """In how many scenes the posture of the run without obstacles meets a circle."""
    (target, corner), joints = TESTS[test - 1], run(test, None).joints
    return sum(not free(joints, target, *circles(corner, seed)) for seed in range(scenes))


def proven(test: int, seeds: Sequence[int]) -> list[str]:
    """What a branch and bound over all postures says of scenes: "found", "none" or "undecided"."""
    (chain, solids), (target, corner) = planar_arm(), TESTS[test - 1]
    goal = [target, target, 0.0]
    found = (
        search_fixed_base(chain, solids, posts(*circles(corner, seed)), goal, TOLERANCE) for seed in seeds
    )
    return [VERDICT_NAMES[one.verdict] for one in found]


def tables() -> list[Table]:
    """Tables 1 to 3."""
    return [_table(test) for test in (1, 2, 3)]


def _table(test: int) -> Table:
    printed, many = PRINTED[test - 1], runs(test, SCENES)
    seeds = (None, *range(len(printed) - 1))
    times = [seconds(partial(run, test, seed)) for seed in seeds]
    rows: list[tuple[str, ...]] = []
    for seed, (count, off, time), taken in zip(seeds, printed, times, strict=True):
        one = run(test, None) if seed is None else many.found[seed]
        theirs = "yes" if count < MAX_ITERATIONS else "no", str(count), f"{off:.4e}"
        mine = "yes" if one.converged else "no", str(one.iterations), f"{one.error:.4e}"
        ratios = f"{time} ({time / printed[0][2]:.2f})", f"{taken / times[0]:.2f}"
        rows.append((str(len(rows) + 1), *theirs, ratios[0], *mine, ratios[1]))
    return Table(
        f"Table {test}",
        f"target ({TESTS[test - 1][0]}, {TESTS[test - 1][0]}), {LINKS} links of length 1",
        (
            *("Run", "paper: met", "paper: iterations", "paper: distance", "paper: time [s]"),
            *("ours: met", "ours: iterations", "ours: distance", "ours: time"),
        ),
        tuple(rows),
        (
            "Run 1 has no obstacles. The circles of runs 2 to 9 are not printed; ours are of the same kind, "
            "drawn with seeds 0 to 7, so only the whole of these rows can be compared.",
            "In brackets, and for ours: as a multiple of the time of run 1.",
            *_whole(test, many),
        ),
    )


def _whole(test: int, many: Many) -> tuple[str, ...]:
    """What all scenes come to, beside the paper's runs."""
    theirs = [count for count, _, _ in PRINTED[test - 1] if count < MAX_ITERATIONS]
    failed = [seed for seed, one in enumerate(many.found) if not one.converged]
    told = (
        f"Ours in {SCENES} seeded scenes: {len(many.iterations)} met, median of their iterations "
        f"{np.median(many.iterations):g}; answers that exact distances refute: {many.refuted}. The paper: "
        f"{len(theirs)} of 9, median {np.median(theirs):g}."
    )
    if not failed:
        return (told,)
    kinds = proven(test, failed)
    return (
        told,
        f"Of the {len(failed)} scenes that are not met, {kinds.count('none')} are proven to hold no free "
        f"posture. {kinds.count('found')} hold one, which the passes do not come to in "
        f"{MAX_ITERATIONS} iterations; the search that `clear_posture` puts behind them does.",
    )
