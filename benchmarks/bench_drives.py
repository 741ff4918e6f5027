"""Drives with the tool lifted over random worlds, as parts of the shortest way of the base.

That is the way of the largest disc inside the footprint, and of a car at least the shortest curve between
its two poses, which no base can beat. It ignores the arm and the heading: so 1 may be out of reach.

Run: python -m benchmarks.bench_drives 150
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from regionik.pipeline import search
from regionik.worlds.errors import InputError, NoPlanFound
from tests.opinion.judge import detours
from tests.soak import DRAWN, told
from tests.soaked import soaked_world

KNOWN = (
    ("ground", 817), ("overhead", 404), ("ground", 506), ("ground", 492), ("overhead", 755), ("made", 132),
    ("made", 46),
)  # fmt: skip
LONGEST, WORST = 1.1, 10  # what a drive should keep, and how many are named


def ratios(kind: str, seed: int) -> list[float]:
    """Lengths of the drives of one world, the shortest ones being 1; none where there is no plan."""
    try:
        return detours(*told(search(soaked_world(kind, seed))))
    except (InputError, NoPlanFound):
        return []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=int, nargs="?", default=150, help="those that were long, then others")
    parser.add_argument("--first", type=int, default=500, help="seed of the first of the others")
    asked = parser.parse_args()
    others = [(DRAWN[n % len(DRAWN)], n) for n in range(asked.first, asked.first + asked.worlds)]
    found, begin = list[tuple[float, str]](), time.process_time()
    for kind, seed in [*KNOWN, *others][: asked.worlds]:
        found += [(ratio, f"{kind} {seed}") for ratio in ratios(kind, seed)]
    all_ = np.array([ratio for ratio, _ in found])
    figures = ", ".join(f"{q} % {np.percentile(all_, q):.3f}" for q in (50, 90, 99, 100))
    print(f"{len(all_)} drives of {asked.worlds} worlds, {time.process_time() - begin:.0f} s: {figures}")
    print(f"{(all_ > LONGEST).sum()} above {LONGEST}:")
    for ratio, name in sorted(found, reverse=True)[:WORST]:
        print(f"  {name} {ratio:.3f}")


if __name__ == "__main__":
    main()
