"""FABRIK that takes an arm round things: two steps for every link that meets something.

A link that a pass lays into an obstacle is first aligned with the root (going in) or the target (going out).
Where it still meets something it is turned at random about its joint, and of the turns that free it the
smallest is kept. Source: Tao et al. (2021), section 4, in the exact form of its procedure; here on the rigid
bodies of FABRIK-R, so that the arm may have any joints, in the plane or in space.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.solvers.fabrikr import (
    Posture,
    backward_choice,
    backward_place,
    forward_choice,
    forward_place,
    forward_start,
    place_behind,
    posture_of,
)
from regionik.planners.solvers.joint_turns import held
from regionik.planners.solvers.rigid_bodies import RigidBodies, pointing_bodies
from regionik.planners.solvers.serial_chain import rotate_about
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

MOST = 100  # passes, as in the paper
TURNS = 10  # random turns tried for one link, as in the paper
ROUNDING = 1e-9  # [rad]

LinkClear = Callable[[int, Array], bool]


@dataclass(frozen=True, eq=False)
class Avoided:
    """What the passes came to.

    Attributes
    ----------
    joints : (dof,) array
    error : float
        Distance of the tool from the target [m].
    iterations : int
        Passes, each in and out.
    converged : bool
        The tool is on the target and no link met anything on the last way out.
    """

    joints: Array
    error: float
    iterations: int
    converged: bool


def avoid(
    chain: Chain,
    target: Array,
    joints: Array,
    clear: LinkClear,
    *,
    tolerance: float,
    seed: int,
    most: int = MOST,
    turns: int = TURNS,
) -> Avoided:
    """Bring the tool to a target with every link clear.

    Parameters
    ----------
    chain : Chain
    target : (3,) array
        In the arm's base frame [m].
    joints : (dof,) array
        Posture to start from, whether clear or not.
    clear : callable
        Whether link k may be at a pose (4, 4) in the arm's base frame.
    tolerance : float
        [m]
    seed : int
        Of the random turns: same input, same answer.
    most, turns : int
        Passes, and random turns for one link.
    """
    links = _Links(chain, target, joints, clear, np.random.default_rng(seed), turns)
    error, free = np.inf, False
    for iteration in range(1, most + 1):
        links.inwards()
        free = links.outwards()
        error = float(np.linalg.norm(links.posture.outer[-1] - target))
        if error < tolerance and free:
            return Avoided(links.joints, error, iteration, True)
    return Avoided(links.joints, error, most, False)


class _Links:
    """The bodies of one arm on their way, and the question whether they are clear."""

    def __init__(
        self,
        chain: Chain,
        target: Array,
        joints: Array,
        clear: LinkClear,
        rng: np.random.Generator,
        turns: int,
    ) -> None:
        self.bodies: RigidBodies = pointing_bodies(chain)
        self.posture: Posture = posture_of(self.bodies, np.asarray(joints, dtype=np.float64))
        self.target = np.asarray(target, dtype=np.float64)
        self.count = len(self.bodies.slide)
        self.rest = np.array(joints[self.count :], dtype=np.float64)
        self.is_clear, self.rng, self.turns = clear, rng, turns
        frames = chain.frames(self.joints)
        # Origin of each link seen from the far end of its body; links beyond the last body ride on it.
        ends = self.posture.inner[1:]
        self.origin = [self.posture.turns[k].T @ (frames[k, :3, 3] - ends[k]) for k in range(self.count)]
        last = np.linalg.inv(frames[self.count - 1])
        self.riders = [(k, last @ frames[k]) for k in range(self.count, chain.dof)]

    @property
    def joints(self) -> Array:
        return np.concatenate([self.posture.joints, self.rest])

    def inwards(self) -> None:
        """From the target to the root."""
        last = self.count - 1
        forward_start(self.bodies, self.target, self.posture)
        if not self._free(last):
            upright = self.posture.turns[last].copy()
            self._freed(last, self._swing(last, inwards=True), lambda angle: self._lean(upright, angle))
        for k in range(last, 0, -1):
            value = forward_choice(self.bodies, k, self.posture)
            forward_place(self.bodies, k, value, self.posture)
            if not self._free(k - 1):
                # The body behind a joint turns against it.
                swing = -self._swing(k - 1, inwards=True)
                self._freed(k - 1, swing, self._mover(k, value, forward_place))

    def outwards(self) -> bool:
        """From the root to the tool; whether every link ended up clear."""
        free = True
        for k in range(self.count):
            value = backward_choice(self.bodies, k, self.posture)
            backward_place(self.bodies, k, value, self.posture)
            if not self._free(k):
                swing = self._swing(k, inwards=False)
                free &= self._freed(k, swing, self._mover(k, value, backward_place))
        return free

    def _freed(self, body: int, swing: float, move: Callable[[float], bool]) -> bool:
        """The two steps: align; else the smallest of some random turns that frees; else leave it aligned."""
        aligned = move(swing)
        if aligned and self._free(body):
            return True
        start = swing if aligned else 0.0
        drawn = self.rng.uniform(-np.pi, np.pi, self.turns)
        for turn in drawn[np.argsort(np.abs(drawn), kind="stable")].tolist():
            if move(start + turn) and self._free(body):
                return True
        move(start)
        return False

    def _mover(self, k: int, value: float, place: Callable[..., None]) -> Callable[[float], bool]:
        """Puts joint k off a value by an angle, where its limits allow that."""
        arm, now = self.bodies.arm, float(value)

        def move(angle: float) -> bool:
            wanted = now + angle
            if not arm.revolute[k]:  # a slide goes over its travel, as far as it has ends
                travel = float(arm.upper[k] - arm.lower[k])
                wanted = now + angle / np.pi * (travel if np.isfinite(travel) else 0.0)
            value = held(wanted, now, arm.lower[k], arm.upper[k]) if arm.revolute[k] else wanted
            if abs(wrap(value - wanted)) > ROUNDING or not arm.lower[k] <= value <= arm.upper[k]:
                return False
            place(self.bodies, k, value, self.posture)
            return True

        return move

    def _lean(self, upright: Array, angle: float) -> bool:
        """Turn the last body about its own axis through the target."""
        last, spin = self.count - 1, np.empty((3, 3))
        rotate_about(upright @ self.bodies.arm.axis[self.bodies.last], angle, spin)
        self.posture.turns[last][:] = spin @ upright
        place_behind(self.bodies, last, self.posture)
        return True

    def _swing(self, body: int, *, inwards: bool) -> float:
        """Turn about its joint that aligns a body with the joint and the root, or the target."""
        posture, arm = self.posture, self.bodies.arm
        joint = min(body + 1, self.count - 1) if inwards else body
        if not arm.revolute[joint]:
            return 0.0
        axis = posture.turns[joint] @ arm.axis[joint]
        ends = posture.inner if inwards else posture.outer
        pivot, end = (ends[body + 1], ends[body]) if inwards else (ends[body], ends[body + 1])
        link, line = end - pivot, (self.bodies.root if inwards else self.target) - pivot
        link, line = link - (link @ axis) * axis, line - (line @ axis) * axis
        return float(np.arctan2(axis @ np.cross(link, line), link @ line))

    def _free(self, body: int) -> bool:
        """Whether a body, and what rides on it, is clear where it is."""
        T = np.eye(4)
        T[:3, :3] = self.posture.turns[body]
        T[:3, 3] = self.posture.inner[body + 1] + T[:3, :3] @ self.origin[body]
        if not self.is_clear(body, T):
            return False
        return body < self.count - 1 or all(self.is_clear(k, T @ ride) for k, ride in self.riders)
