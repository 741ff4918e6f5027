"""Is a posture free, or is there none? Every scene of the experiment with four links among five circles.

Prints, for each of the three targets, how many of the seeded scenes hold a free posture and how many
are proven to hold none, the boxes of joint values that took, and seconds; then how many the two steps of
avoidance solve alone, with one run of random turns a scene and with more, and with less than both steps;
then what the search behind the two steps makes of the scenes. Other code confirms every
answer: a posture found by the distances of its links from the circles, a proof by a dense sweep of postures
that must not find one. Exits 1 where an answer is missing or refuted.
Run: python -m benchmarks.bench_avoidance [scenes a target]
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

from regionik.planners.avoidance.avoiding_fabrik import avoid_obstacles, links_clear
from regionik.planners.avoidance.clear_posture import clear_posture
from regionik.planners.collision.distances import Obstacles, obstacles_from
from regionik.planners.collision.robot_bodies import Bodies, bodies_from
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import VERDICT_NAMES, PostureTask, search_fixed_base
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, translation
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkCapsule
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.robot import Robot

LINKS = 4  # of length 1
TESTS = ((2.8, 2.5), (2.4, 2.1), (2.0, 1.7))  # target on the diagonal, far corner of the circles' middles
TOLERANCE = 1e-3
THIN = 1e-6  # radius of the links' solids
STEP = np.radians(0.2)
RING = 8  # targets of a sweep round the edge of the tolerance
ATTEMPTS = (1, 2, 3, 5)  # runs of random turns for one scene
MOST_BOXES = 2_000_000
UPRIGHT = np.array([np.pi / 2, 0.0, 0.0, 0.0])  # where the arm starts


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


def bodies_of(obstacles: Obstacles) -> Bodies:
    chain, solids = planar_arm()
    point, mount = np.zeros((1, 2)), np.zeros(4)
    robot = Robot("planar", "omni", point, mount, chain, tuple(solids), 0.1, UPRIGHT)
    return bodies_from(robot, obstacles.solids)


def free(joints: Array, target: float, middles: Array, radii: Array) -> bool:
    """Whether a posture is on the target and clear, by exact distances in the plane."""
    knots = knots_of(joints)
    off = float(np.linalg.norm(knots[-1] - target))
    return off <= TOLERANCE and float(clearance(knots, middles, radii)) >= THIN


def two_steps(number: int, scenes: int) -> int:
    """Prints what the two steps solve, whole and in part; returns how many answers are refuted."""
    target, corner = TESTS[number]
    chain, goal, wrong = planar_arm()[0], np.array([target, target, 0.0]), 0
    first, bare, plain = [], 0, 0
    for seed in range(scenes):
        middles, radii = circles(corner, seed)
        clear = links_clear(bodies_of(posts(middles, radii)), np.zeros(3), goal, 0.0)
        for attempt in range(max(ATTEMPTS)):
            found = avoid_obstacles(
                chain, goal, UPRIGHT, clear, tolerance=TOLERANCE, seed=seed + 10**6 * attempt
            )
            if found.converged:
                first.append(attempt)
                wrong += not free(found.joints, target, middles, radii)
                break
        bare += avoid_obstacles(
            chain, goal, UPRIGHT, clear, tolerance=TOLERANCE, seed=seed, rotations=0
        ).converged
        blind = avoid_obstacles(chain, goal, UPRIGHT, lambda link, T: True, tolerance=TOLERANCE, seed=seed)
        plain += blind.converged and free(blind.joints, target, middles, radii)
    runs = ", ".join(f"{sum(k < most for k in first)} with {most}" for most in ATTEMPTS)
    print(f"  two steps alone: {runs} runs; no random turns {bare}; neither step {plain}")
    return wrong


def with_search(number: int, scenes: int, feasible: list[bool]) -> int:
    """Prints what all stages together make of the scenes; returns how many answers are wrong or missing."""
    target, corner = TESTS[number]
    kinds, stages, wrong = [], [], 0
    for seed in range(scenes):
        middles, radii = circles(corner, seed)
        bodies = bodies_of(posts(middles, radii))
        place = np.array([target, target, 0.0])
        task = PostureTask(bodies, np.zeros(3), place, tolerance=TOLERANCE)
        answer = clear_posture(task, UPRIGHT, seed=seed, most_boxes=MOST_BOXES)
        kinds.append(VERDICT_NAMES[answer.verdict])
        stages.append(answer.steps[-1])
        right = VERDICT_NAMES[answer.verdict] == ("found" if feasible[seed] else "none")
        if answer.joints is not None:
            right &= free(answer.joints, target, middles, radii)
        if not right:
            wrong += 1
            print(f"  scene {seed}: {VERDICT_NAMES[answer.verdict]} by {answer.steps[-1]}: not confirmed")
    found = [stage for kind, stage in zip(kinds, stages, strict=True) if kind == "found"]
    told = ", ".join(f"{found.count(stage)} by {stage}" for stage in ("passes", "avoidance", "search"))
    print(f"  with the search behind them: found {len(found)} ({told}), none {kinds.count('none')}")
    return wrong


def main(scenes: int) -> int:
    chain, solids = planar_arm()
    wrong = 0
    search_fixed_base(chain, solids, posts(*circles(TESTS[0][1], 0)), [2.8, 2.8, 0.0], TOLERANCE)  # compiles
    for number, (target, corner) in enumerate(TESTS, 1):
        kinds, boxes, seconds, nearest = [], [], [], -np.inf
        for seed in range(scenes):
            middles, radii = circles(corner, seed)
            obstacles = posts(middles, radii)
            start = time.perf_counter()
            searched = search_fixed_base(chain, solids, obstacles, [target, target, 0.0], TOLERANCE)
            seconds.append(time.perf_counter() - start)
            kinds.append(VERDICT_NAMES[searched.verdict])
            boxes.append(searched.boxes)
            if searched.joints is not None:
                right = free(searched.joints, target, middles, radii)
            else:
                room = swept(target, middles, radii)
                nearest = max(nearest, room)
                right = searched.verdict == Verdict.RULED_OUT and room < THIN
            if not right:
                wrong += 1
                print(f"  scene {seed}: {VERDICT_NAMES[searched.verdict]}: not confirmed")
        counts = ", ".join(f"{kind} {kinds.count(kind)}" for kind in ("found", "none", "undecided"))
        print(
            f"test {number}: {counts}; boxes median {statistics.median(boxes):.0f}, most {max(boxes)}; "
            f"seconds {sum(seconds):.1f}, longest {max(seconds):.2f}"
        )
        if "none" in kinds:
            print(f"  largest clearance that the sweeps of the scenes without a posture met: {nearest:.6f}")
        wrong += two_steps(number - 1, scenes)
        wrong += with_search(number - 1, scenes, [kind == "found" for kind in kinds])
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
