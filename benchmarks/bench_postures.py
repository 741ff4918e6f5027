"""Arms in clutter: what is found is checked by other means, and what is said to be impossible is swept.

Prints, for each arm, how many of the seeded scenes (1 to 50 boxes, cylinders, balls, prisms and meshes) hold
a posture, are proven to hold none, or stay undecided, and which stage told. Every posture found is checked by
closed-form distances; of the proofs for arms that a dense sweep can cover, a sample is swept for a posture
that meets no obstacle. Exits 1 where an answer is refuted.
Run: python -m benchmarks.bench_postures [--scenes N] [--sample N] [--first N]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter, defaultdict

from benchmarks.clutter import ARMS, faults, free_posture, scene
from benchmarks.sweeps import SWEEPS
from regionik.planners.avoidance.clear_posture import ClearPosture, clear_posture
from regionik.planners.collision.robot_bodies import bodies_from
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import VERDICT_NAMES, PostureTask

TOLERANCE = 1e-3
EVERY = 100  # scenes between two lines of progress


def solved(number: int) -> ClearPosture:
    one = scene(number)
    bodies = bodies_from(one.robot, one.solids)
    task = PostureTask(bodies, one.base, one.target, tolerance=TOLERANCE)
    return clear_posture(task, one.joints, seed=number)


def main(scenes: int, sample: int, first: int) -> int:
    kinds: Counter[tuple[str, str]] = Counter()
    stages: Counter[tuple[str, str]] = Counter()
    spent: defaultdict[str, float] = defaultdict(float)
    none, wrong = [], 0
    start = time.perf_counter()
    for done, number in enumerate(range(first, first + scenes), 1):
        one, began = scene(number), time.perf_counter()
        answer = solved(number)
        spent[f"{VERDICT_NAMES[answer.verdict]} by {answer.steps[-1]}"] += time.perf_counter() - began
        kinds[one.arm, VERDICT_NAMES[answer.verdict]] += 1
        stages[VERDICT_NAMES[answer.verdict], answer.steps[-1]] += 1
        if answer.joints is not None:
            refuted = faults(one, answer.joints, TOLERANCE)
            wrong += bool(refuted)
            if refuted:
                print(f"  scene {number} ({one.arm}): refuted: {', '.join(refuted)}")
        elif answer.verdict == Verdict.RULED_OUT and one.arm in SWEEPS:
            none.append(number)
        if done % EVERY == 0:
            print(
                f"  {done} of {scenes} scenes, {time.perf_counter() - start:.0f} s",
                file=sys.stderr,
                flush=True,
            )
    for arm in ARMS:
        counts = [kinds[arm, kind] for kind in ("found", "none", "undecided")]
        print(f"{arm}: found {counts[0]}, none {counts[1]}, undecided {counts[2]}")
    for (kind, stage), count in sorted(stages.items()):
        each = 1e3 * spent[f"{kind} by {stage}"] / count
        print(f"{kind} by {stage}: {count} ({count / scenes:.1%}), {each:.1f} ms each")
    swept = {
        number: free_posture(scene(number), TOLERANCE, SWEEPS[scene(number).arm]) for number in none[:sample]
    }
    refuted_proofs = [number for number, found in swept.items() if found is not None]
    print(f"proofs swept: {len(swept)}, refuted: {refuted_proofs or 'none'}")
    print(f"answers refuted: {wrong} of {sum(kinds[arm, 'found'] for arm in ARMS)}")
    return 1 if wrong or refuted_proofs else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--sample", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    told = parser.parse_args()
    sys.exit(main(told.scenes, told.sample, told.first))
