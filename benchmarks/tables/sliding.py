"""Rivals on a base that slides along x and y, asked as `regionik.mfabrik.Solver` is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.tables.batch import solve_batch
from regionik.papers.comparison import BASE_JOINTS, by_sliding_base
from regionik.papers.rivals.iterative import IterativeMethod
from regionik.values import Batch, Configuration
from regionik.worlds.arms import sliding_chain
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target


def without_limits(chain: Chain) -> Chain:
    """The chain with joints that turn and slide as far as they like."""
    return Chain(
        tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in chain.joints), chain.T_last_tool
    )


@dataclass(frozen=True, eq=False)
class SlidingRival:
    """A rival that takes targets in the world, positions only; the base keeps its heading."""

    robot: Robot
    method: IterativeMethod

    @classmethod
    def make(cls, kind: type[IterativeMethod], robot: Robot, accuracy: float) -> SlidingRival:
        """Without joint limits."""
        return cls(robot, kind(sliding_chain(without_limits(robot.chain)), accuracy))

    def __call__(self, target: ArrayLike, base: ArrayLike, joints: ArrayLike) -> Configuration:
        asked = Target(np.asarray(target, dtype=np.float64))
        return by_sliding_base(self.robot, self.method, asked, np.asarray(base), np.asarray(joints))

    def batch(self, targets: ArrayLike, bases: ArrayLike, joints: ArrayLike) -> Batch:
        """All in one compiled call; bases stand at the origin, as those of the tables do."""
        begun = np.asarray(bases, dtype=np.float64)
        if begun.any() or self.robot.mount[[0, 1, 3]].any():
            raise ValueError("bases: expected all at the origin, and the arm over it")
        positions = np.asarray(targets, dtype=np.float64) - [0.0, 0.0, self.robot.mount[2]]
        q: Array = np.hstack([np.zeros((len(begun), BASE_JOINTS)), np.asarray(joints, dtype=np.float64)])
        found = solve_batch(self.method, positions, q)
        base = np.column_stack([found.joints[:, :BASE_JOINTS], np.zeros(len(begun))])
        return Batch(base, found.joints[:, BASE_JOINTS:], found.error, found.iterations, found.converged)
