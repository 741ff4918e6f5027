"""Is a posture free, or is there none? Every scene of the experiment with four links among five circles.

Prints, for each of the three targets, how many of the seeded scenes hold a free posture and how many
are proven to hold none, the boxes of joint values that took, and seconds. Other code confirms every
answer: a posture found by the distances of its links from the circles, a proof by a dense sweep of postures
that must not find one. Exits 1 where an answer is missing or refuted.
Run: python benchmarks/bench_avoidance.py [scenes a target]
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

from regionik.planners.collision import Obstacles, obstacles_from
from regionik.planners.exhaustive import search
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint, translation
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.robot import LinkCapsule

LINKS = 4  # of length 1
TESTS = ((2.8, 2.5), (2.4, 2.1), (2.0, 1.7))  # target on the diagonal, far corner of the circles' middles
TOLERANCE = 1e-3
THIN = 1e-6  # radius of the links' solids
STEP = np.radians(0.2)
RING = 8  # targets of a sweep round the edge of the tolerance


def planar_arm() -> tuple[Chain, list[LinkCapsule]]:
    """Links in the plane, joints without limits, solids as thin as can be."""
    joints = tuple(
        Joint(f"j{k}", "revolute", -np.inf, np.inf, translation(1.0 if k else 0.0, 0, 0))
        for k in range(LINKS)
    )
    ends = np.zeros(3), np.array([1.0, 0, 0])
    return Chain(joints, translation(1, 0, 0)), [LinkCapsule(k, f"l{k}", *ends, THIN) for k in range(LINKS)]


def circles(corner: float, seed: int) -> tuple[Array, Array]:
    """Middles (5, 2) and radii (5,)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.3, corner, (5, 2)), rng.uniform(0.1, 0.3, 5)


def posts(middles: Array, radii: Array) -> Obstacles:
    """The circles as cylinders through the plane, tall enough that height plays no part."""
    return obstacles_from(
        [
            Cylinder(f"c{k}", r, 4.0, np.array([*c, 0.0]))
            for k, (c, r) in enumerate(zip(middles, radii, strict=True))
        ]
    )


def clearance(knots: Array, middles: Array, radii: Array) -> Array:
    """Least distance of links between knots (..., 5, 2) from the circles, (...)."""
    least = np.full(knots.shape[:-2], np.inf)
    for k in range(LINKS):
        a, along = knots[..., k, :], knots[..., k + 1, :] - knots[..., k, :]
        for c, r in zip(middles, radii, strict=True):
            t = np.clip(((c - a) * along).sum(-1) / (along * along).sum(-1), 0.0, 1.0)
            least = np.minimum(least, np.linalg.norm(a + t[..., None] * along - c, axis=-1) - r)
    return least


def knots_of(joints: Array) -> Array:
    """Ends of the links, (5, 2)."""
    turned = np.cumsum(joints)
    return np.vstack([np.zeros(2), np.cumsum(np.column_stack([np.cos(turned), np.sin(turned)]), 0)])


def swept(target: float, middles: Array, radii: Array) -> float:
    """Largest clearance on a grid of two link angles, the other two links bent either way.

    The tool is put on the target, and on points round the edge of the tolerance.
    """
    turns = np.linspace(0, 2 * np.pi, RING, endpoint=False)
    edge = 0.999 * TOLERANCE * np.column_stack([np.cos(turns), np.sin(turns)])
    angles = np.arange(-np.pi, np.pi, STEP)
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    best = -np.inf
    for goal in np.vstack([[target, target], target + edge]):
        elbows = ways[np.linalg.norm(goal - ways, axis=1) <= 3.0]  # three more links must reach
        second = elbows[:, None] + ways
        keep = np.linalg.norm(goal - second, axis=2) < 2.0
        one = np.broadcast_to(elbows[:, None], second.shape)[keep]
        two = second[keep]
        gap = goal - two
        half = np.linalg.norm(gap, axis=1) / 2
        aside = np.sqrt(1.0 - half**2) / np.maximum(2 * half, 1e-12)
        for side in (-1.0, 1.0):
            bend = two + gap / 2 + side * aside[:, None] * np.column_stack([-gap[:, 1], gap[:, 0]])
            root, end = np.zeros_like(one), np.broadcast_to(goal, one.shape)
            best = max(best, float(clearance(np.stack([root, one, two, bend, end], 1), middles, radii).max()))
    return best


def main(scenes: int) -> int:
    chain, solids = planar_arm()
    wrong = 0
    search(chain, solids, posts(*circles(TESTS[0][1], 0)), [2.8, 2.8, 0.0], TOLERANCE)  # compiles
    for number, (target, corner) in enumerate(TESTS, 1):
        kinds, boxes, seconds, nearest = [], [], [], -np.inf
        for seed in range(scenes):
            middles, radii = circles(corner, seed)
            obstacles = posts(middles, radii)
            start = time.perf_counter()
            verdict = search(chain, solids, obstacles, [target, target, 0.0], TOLERANCE)
            seconds.append(time.perf_counter() - start)
            kinds.append(verdict.kind)
            boxes.append(verdict.boxes)
            if verdict.joints is not None:
                knots = knots_of(verdict.joints)
                off = float(np.linalg.norm(knots[-1] - target))
                right = off <= TOLERANCE and float(clearance(knots, middles, radii)) >= THIN
            else:
                room = swept(target, middles, radii)
                nearest = max(nearest, room)
                right = verdict.kind == "none" and room < THIN
            if not right:
                wrong += 1
                print(f"  scene {seed}: {verdict.note}: not confirmed")
        counts = ", ".join(f"{kind} {kinds.count(kind)}" for kind in ("found", "none", "undecided"))
        print(
            f"test {number}: {counts}; boxes median {statistics.median(boxes):.0f}, most {max(boxes)}; "
            f"seconds {sum(seconds):.1f}, longest {max(seconds):.2f}"
        )
        if "none" in kinds:
            print(f"  largest clearance that the sweeps of the scenes without a posture met: {nearest:.6f}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
