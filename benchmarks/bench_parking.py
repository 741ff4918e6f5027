"""Probability of stops after parking: bounds against counted parkings in random worlds, and their time.

Each parking is judged by the tests' second opinion, which has no code of the library.
Run: python -m benchmarks.bench_parking [worlds] [parkings]
"""

from __future__ import annotations

import sys
import time

import numpy as np
import shapely
from scipy.special import bdtr

from regionik.parking.parking_probability import parking_probability
from regionik.parking.stops import stops
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.limits import ParkingAccuracy
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.opinion.parkings import good_parkings
from tests.retold import machine_of

ROBOTS = ("youbot", "youbot-real", "hinge5")
NEAR = 0.02  # of the truth that a bound is to be


def holes(seed: int) -> World:
    """Some holes in a row, posts about them, and an error with any correlation."""
    rng = np.random.default_rng(seed)
    task = [
        Target(np.array([x, 0.0, rng.uniform(0.2, 0.3)])) for x in np.linspace(0, rng.uniform(0.1, 0.4), 3)
    ]
    posts = [
        Cylinder(f"post {k}", 0.05, 0.1, np.array([*rng.uniform([-1, 0.6], [1.5, 1.0]), 0.05]))
        for k in range(3)
    ]
    root = rng.normal(size=(3, 3)) * np.array([[0.04], [0.04], [0.08]]) * rng.uniform(0.3, 1.0)
    rules = Rules(clearance=0.05, mode="stops", parking=ParkingAccuracy(root @ root.T))
    robot = robot_named(ROBOTS[seed % len(ROBOTS)])
    return World(f"holes {seed}", robot, Floor(shapely.box(-3, -2, 3, 2)), tuple(posts), tuple(task), rules)


def counted(world: World, base: np.ndarray, some: tuple[int, ...], count: int) -> int:
    """Parkings about a pose of the base that are good for some set-points."""
    assert world.rules.parking is not None
    covariance = np.array(world.rules.parking.covariance)
    poses = np.random.default_rng(1).multivariate_normal(base, covariance, count)
    points = np.array([world.task[i].position for i in some])
    return int(good_parkings(world_to_document(world), machine_of(world), points, poses).sum())


def main(worlds: int = 20, count: int = 10_000) -> None:
    wrong, apart, seconds = 0, [], 0.0
    for seed in range(worlds):
        world = holes(seed)
        for stop in stops(world):
            base = stop.base + np.random.default_rng(seed).normal(size=3) * [0.08, 0.08, 0.1]
            begin = time.process_time()
            bound = parking_probability(scene_of(world), base, stop.setpoints)
            seconds += time.process_time() - begin
            good = counted(world, base, stop.setpoints, count)
            wrong += bool(bdtr(good, count, bound) < 3e-5)
            apart.append(good / count - bound)
            print(f"{world.name:10s} {world.robot.name:12s} bound {bound:.4f}, counted {good / count:.4f}")
    slack = 4 * np.sqrt(0.25 / count)
    near = sum(off < NEAR for off in apart)
    print(
        f"{len(apart)} stops, {count} parkings: {wrong} bounds contradicted, at most {max(apart):.4f} under"
    )
    print(f"the counted share (median {np.median(apart):.4f}); {seconds / len(apart):.2f} s a bound")
    print(f"{near} of {len(apart)} bounds within {NEAR:g} of it")
    assert not wrong, "a bound is above what was counted"
    assert max(apart) < NEAR + slack, "a bound is far below what was counted"


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
