"""Why not, on random targets out of reach: irreducible, mended, and as small as brute force?

Random worlds as in tests/test_random_worlds.py, of each the first set-point with no inner area. Of every
explanation: its causes alone, all else taken away, must rule the target out, and without any one of them must
not; every repair is made and the target asked for again; and none of a hundred smaller repairs along the same
direction, to within 5 % and 0.2 mm, may leave an inner area in which a configuration is found. Prints what
failed, the counts, and the processor's seconds that an explanation took. Exits 1 where anything failed.
Run: python -m benchmarks.bench_why [--cases N] [--first SEED] [--seeds SEED ...]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterable
from itertools import count

import numpy as np

from regionik.explain.changes import repaired
from regionik.pipeline import why
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from tests.why_cases import as_small_as_brute_force, cases, proven_irreducible


def main(wanted: int, seeds: Iterable[int]) -> int:
    seconds: list[float] = []
    causes, repairs, failed = Counter[str](), Counter[str](), Counter[str]()
    proofs = mended = 0
    for seed in seeds:
        if len(seconds) == wanted:
            break
        for case in cases([seed]):
            began = time.process_time()
            found = why(case, case.task[0])
            seconds.append(time.process_time() - began)
            wrong = []
            if len(seconds) % 20 == 0:
                print(f"{len(seconds)} cases, {sum(failed.values())} failures", flush=True)
            if found is None or not found.causes:
                wrong.append("no causes")
            else:
                causes.update(cause.kind for cause in found.causes)
                repairs.update(repair.kind for repair in found.repairs)
                proofs += "This is a proof" in found.reason
                mended += bool(found.repairs)
                if not proven_irreducible(case, found):
                    wrong.append("not irreducible")
                for repair in found.repairs:
                    changed = repaired(scene_of(case), repair)
                    if not reach(changed.world, changed.task).reachable.all():
                        wrong.append(f"does not help: {repair.text}")
                    if not as_small_as_brute_force(case, repair):
                        wrong.append(f"not smallest: {repair.text}")
            for what in wrong:
                print(f"{case.name}, {case.robot.name}: {what}", flush=True)
            failed.update(what.partition(":")[0] for what in wrong)
    took = np.array(seconds)
    print(f"{len(took)} cases, {proofs} of them proven out of reach, {mended} with repairs")
    print(f"causes: {dict(causes.most_common())}")
    print(f"repairs: {dict(repairs.most_common())}")
    print(
        f"processor's seconds an explanation: median {np.median(took):.2f}, mean {took.mean():.2f}, "
        f"most {took.max():.2f}"
    )
    print(f"failed: {dict(failed) or 'none'}")
    return 1 if failed else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, nargs="+", help="of these worlds alone")
    options = parser.parse_args()
    sys.exit(main(options.cases, options.seeds or count(options.first)))
