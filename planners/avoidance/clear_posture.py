"""A posture of an arm on a fixed base that reaches a target and touches nothing, or why there is none.

First FABRIK-R from where the arm is; then FABRIK that goes round things; then a search: postures drawn at
random, and all postures at once where that can come to an end. Every answer is confirmed by the chain's own
forward kinematics and by `touching.nearest`.

>>> import numpy as np
>>> from regionik.planners.collision.proximity import bodies_from
>>> from regionik.worlds.bundled import robot_named
>>> from regionik.worlds.obstacles import Sphere
>>> robot = robot_named("youbot")
>>> bodies = bodies_from(robot, [Sphere("ball", 0.1, np.array([0.3, 0.0, 0.45]))])
>>> clear_posture(bodies, [0, 0, 0], [0.45, 0.0, 0.3], robot.carry).verdict.name
'PROVEN'
>>> clear_posture(bodies, [0, 0, 0], [0.3, 0.0, 0.45], robot.carry).verdict.name
'RULED_OUT'
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.avoidance.avoiding_fabrik import avoid
from regionik.planners.avoidance.posture_proof import (
    MOST_SPARE,
    has_stops,
    search_postures,
    solid_at_target,
    spare_joints,
)
from regionik.planners.collision.link_clearance import links_clear
from regionik.planners.collision.proximity import Touch, describe, nearest
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import WORDS, FixedBaseResult
from regionik.planners.solvers.damped_least_squares import POSITION, Aim, polish
from regionik.planners.solvers.inverse_kinematics import ArmSolver, Goal, spread_postures
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.planners.solvers.multistart_ik import Effort, solve
from regionik.planners.solvers.rigid_bodies import posing_bodies
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

LOOKS = 300  # postures drawn at random
GLANCE = 500  # boxes of joint values after which a proof is no longer to be had cheaply
MOST_BOXES = 200_000
STEPS = 60  # of damped least squares that take a posture back to the target
FARTHEST = 1.0  # change of a joint when the best posture so far is varied [rad] or [m]


@dataclass(frozen=True, eq=False)
class ClearPosture:
    """Outcome of the question.

    Attributes
    ----------
    verdict : Verdict
        PROVEN by a posture; RULED_OUT by a proof that there is none; or OPEN, within the effort made.
    joints : (dof,) array or None
        The posture, within limits [rad] or [m].
    error : float
        What the tool misses; infinite where no posture on the target was met [m].
    iterations : int
        Passes, each forward and backward, of all stages together.
    steps : tuple of str
        What was used, in order: "passes", "avoidance", "search".
    distance : float
        Least distance of the posture from anything, or of the one met that came nearest to being clear; from
        obstacles, what is left beyond the bodies' clearance. Infinite where nothing is near, -inf where no
        posture on the target was met [m].
    touch : Touch or None
        Where that distance is; None where no posture on the target was met.
    note : str
        The evidence in one line.
    """

    verdict: Verdict
    joints: Array | None
    error: float
    iterations: int
    steps: tuple[str, ...]
    distance: float
    touch: Touch | None
    note: str


def clear_posture(
    bodies: Bodies,
    base: ArrayLike,
    target: ArrayLike,
    joints: ArrayLike,
    *,
    contact: ContactTargets | None = None,
    tolerance: float = 1e-3,
    margin: float = 0.0,
    seed: int = 0,
    attempts: int = 3,
    most_boxes: int = MOST_BOXES,
) -> ClearPosture:
    """Find a posture that brings the tool to a target with every solid clear, or prove that there is none.

    Parameters
    ----------
    bodies : Bodies
        Robot and obstacles.
    base : (3,) array_like
        x, y [m], yaw [rad]; it stands still.
    target : (3,) array_like
        In the world [m].
    joints : (dof,) array_like
        Posture to start from, clear or not.
    contact : ContactTargets, optional
        What may be touched.
    tolerance : float
        How far from the target the tool may be [m].
    margin : float
        Of the robot's solids from each other, from its own base, and from obstacles beyond the bodies'
        clearance [m].
    seed : int
        Same question and seed, same answer to the last bit.
    attempts : int
        Of going round things, each with other random turns.
    most_boxes : int
        Budget of the exhaustive search.

    Returns
    -------
    ClearPosture

    Raises
    ------
    InputError
        When a number is out of its range.
    """
    quest = _Quest(bodies, base, target, joints, contact, tolerance, margin, seed)
    _at_least_one("attempts", attempts)
    _at_least_one("most_boxes", most_boxes)
    return (
        quest.by_passes()
        or quest.by_proof(min(GLANCE, most_boxes))
        or quest.by_avoidance(attempts)
        or quest.by_looks()
        or quest.by_search(most_boxes)
    )


def go_round(
    bodies: Bodies,
    base: ArrayLike,
    target: ArrayLike,
    joints: ArrayLike,
    *,
    contact: ContactTargets | None = None,
    tolerance: float = 1e-3,
    margin: float = 0.0,
    seed: int = 0,
    attempts: int = 1,
) -> ClearPosture:
    """The passes of `clear_posture` alone, without the search: found or undecided, and soon."""
    quest = _Quest(bodies, base, target, joints, contact, tolerance, margin, seed)
    _at_least_one("attempts", attempts)
    return (
        quest.by_passes() or quest.by_avoidance(attempts) or quest.answer(Verdict.OPEN, "no search was made")
    )


class _Quest:
    """One question on its way through the stages, and the best posture met so far."""

    def __init__(
        self,
        bodies: Bodies,
        base: ArrayLike,
        target: ArrayLike,
        joints: ArrayLike,
        contact: ContactTargets | None,
        tolerance: float,
        margin: float,
        seed: int,
    ) -> None:
        self.bodies, self.contact, self.seed = bodies, contact, seed
        self.chain = bodies.robot.chain
        self.base, self.target = frozen(base, (3,), "base"), frozen(target, (3,), "target")
        self.tolerance, self.margin = float(tolerance), float(margin)
        if not 0 <= self.margin < np.inf:
            raise InputError(f"margin: expected a finite length of 0 or more, got {margin}")
        if not 0 < self.tolerance < np.inf:
            raise InputError(f"tolerance: expected a length above 0, got {tolerance}")
        if seed < 0:
            raise InputError(f"seed: expected 0 or more, got {seed}")
        start = frozen(joints, (self.chain.dof,), "joints")
        self.start = np.clip(start, self.chain.lower, self.chain.upper)
        T = bodies.robot.T_world_arm(self.base)
        self.goal: Array = T[:3, :3].T @ (self.target - T[:3, 3])
        self.steps: list[str] = []
        self.passes, self.met = 0, 0
        self.best: tuple[Array, float, Touch] | None = None

    def by_passes(self) -> ClearPosture | None:
        """FABRIK-R from the start, obstacles left aside."""
        self.steps.append("passes")
        found = self._solver(Goal(self.goal), self.start)
        self.passes += found.iterations
        return self._found() if self._offer(found.joints) else None

    def by_proof(self, most: int) -> ClearPosture | None:
        """A proof that lies at hand, or a short search for one; what it finds on the way is left."""
        name = solid_at_target(self.bodies, self.target, self.tolerance, self.margin, self.contact)
        if name:
            return self.answer(
                Verdict.RULED_OUT, f"at the target the end of the last link is in {name}, or too near to it"
            )
        if not has_stops(self.chain):
            return None
        searched = self._searched(lambda q: False, most)
        if searched.verdict != Verdict.RULED_OUT:
            return None
        self.steps.append("search")
        return self.answer(Verdict.RULED_OUT, searched.note)

    def by_avoidance(self, attempts: int) -> ClearPosture | None:
        """Tao's two steps, with other random turns each time."""
        self.steps.append("avoidance")
        clear = links_clear(self.bodies, self.base, self.target, self.margin, self.contact)
        for attempt in range(attempts):
            seed = int(np.random.SeedSequence([self.seed, attempt]).generate_state(1)[0])
            found = avoid(self.chain, self.goal, self.start, clear, tolerance=self.tolerance, seed=seed)
            self.passes += found.iterations
            if found.converged and self._offer(found.joints):
                return self._found()
        return None

    def by_looks(self) -> ClearPosture | None:
        """Postures on the target from random starts, every other one near the best so far."""
        self.steps.append("search")
        solver, rng = self._solver, np.random.default_rng([self.seed, 1])
        n, effort = len(solver.pointing.slide), solver.effort
        aim, none = Aim(self.goal, POSITION, np.eye(3)), np.empty((0, n))
        fresh = spread_postures(self.chain, effort.reach, LOOKS, self.seed)
        for k in range(LOOKS):
            q = fresh[k]
            if self.best is None or k % 2 == 0:
                self.passes += solve(solver.pointing, aim, none, effort, q)[2]
            else:
                change = FARTHEST * 10.0 ** rng.uniform(-3, 0) * rng.normal(size=len(q))
                q = np.clip(self.best[0] + change, self.chain.lower, self.chain.upper)
                near = q[:n].copy()
                polish(solver.pointing.arm, aim, near, effort.reach, self.tolerance, 1.0, STEPS)
                q[:n] = near
            if self._offer(q):
                return self._found()
        return None

    def by_search(self, most: int) -> ClearPosture:
        """All postures at once, where the arm is not too mobile for that."""
        if not has_stops(self.chain):
            return self.answer(Verdict.OPEN, "a sliding joint without limits cannot be searched through")
        spare = spare_joints(self.chain, self.bodies.robot.solids)
        if spare > MOST_SPARE:
            return self.answer(Verdict.OPEN, f"{spare} spare joints are too many to search through")
        searched = self._searched(self._offer, most)
        if searched.verdict == Verdict.PROVEN:
            return self._found()
        return self.answer(searched.verdict, searched.note)

    def answer(self, verdict: Verdict, why: str) -> ClearPosture:
        """Return no posture, and why."""
        _, error, touch = self.best or (None, np.inf, None)
        seen = "no posture on the target was met"
        if touch is not None:
            seen = f"in the best of {self.met} postures on the target, {describe(self.bodies, touch)}"
        word = WORDS[verdict]
        note = f"{word}: {why.removeprefix(f'{word}: ')}; {seen}"
        distance = -np.inf if touch is None else self._room(touch)
        return ClearPosture(verdict, None, error, self.passes, tuple(self.steps), distance, touch, note)

    @property
    def _solver(self) -> ArmSolver:
        return _solver(self.chain, self.tolerance)

    def _found(self) -> ClearPosture:
        assert self.best is not None
        joints, error, touch = self.best
        joints.flags.writeable = False
        note = f"found by {self.steps[-1]}: {describe(self.bodies, touch)}"
        room, steps = self._room(touch), tuple(self.steps)
        return ClearPosture(Verdict.PROVEN, joints, error, self.passes, steps, room, touch, note)

    def _offer(self, joints: Array) -> bool:
        """Tell whether a posture is an answer: within limits, on the target, and clear."""
        within = (joints >= self.chain.lower).all() and (joints <= self.chain.upper).all()
        error = float(np.linalg.norm(self.chain.forward(joints)[:3, 3] - self.goal))
        if not within or error > self.tolerance:
            return False
        touch = nearest(self.bodies, self.base, joints, contact=self.contact)
        self.met += 1
        if self.best is None or self._room(touch) > self._room(self.best[2]):
            self.best = np.array(joints), error, touch
        return self._room(touch) >= self.margin

    def _room(self, touch: Touch) -> float:
        """Distance at a touch; from obstacles, beyond the bodies' clearance [m]."""
        return touch.distance - (self.bodies.clearance if touch.kind == "obstacle" else 0.0)

    def _searched(self, accept: Callable[[Array], bool], most: int) -> FixedBaseResult:
        return search_postures(
            self.bodies, self.base, self.target, self.tolerance, self.margin, self.contact, accept, most
        )


@lru_cache(maxsize=32)
def _solver(chain: Chain, tolerance: float) -> ArmSolver:
    """Kept for the last few arms, as one arm is asked about many targets."""
    return ArmSolver(chain, tolerance)


def _at_least_one(name: str, value: int) -> None:
    if value < 1:
        raise InputError(f"{name}: expected 1 or more, got {value}")


LOOKS_posture_search = 60  # postures, every other one drawn at random


def look_round(
    bodies: Bodies,
    base: Array,
    aim: Aim,
    joints: Array,
    effort: Effort,
    *,
    contact: ContactTargets | None = None,
    margin: float = 0.0,
    seed: int = 0,
) -> tuple[Array, float] | None:
    """Postures on a pose come to from random ones, and from the one that is nearest to being clear.

    Parameters
    ----------
    bodies : Bodies
        Robot and obstacles.
    base : (3,) array
        x, y [m], yaw [rad]; it stands still.
    aim : Aim
        In the world.
    joints : (dof,) array
        Posture to start from, clear or not.
    effort : Effort
        Tolerances and the arm's length.
    contact : ContactTargets, optional
        What may be touched.
    margin : float
        Kept beyond the bodies' clearance [m].
    seed : int

    Returns
    -------
    Joints and what the tool misses [m]; None where no posture that was met is clear.
    """
    chain, T = bodies.robot.chain, bodies.robot.T_world_arm(base)
    arm, rng = posing_bodies(chain).arm, np.random.default_rng([seed, 2])
    here = in_arm_frame(T[:2, 3], float(np.arctan2(T[1, 0], T[0, 0])), float(T[2, 3]), aim)
    best, most = np.clip(joints, chain.lower, chain.upper), -np.inf
    for k, fresh in enumerate(spread_postures(chain, effort.reach, LOOKS_posture_search, seed)):
        q = fresh
        if k % 2 == 0:
            change = FARTHEST * 10.0 ** rng.uniform(-3, 0) * rng.normal(size=chain.dof)
            q = np.clip(best + change, chain.lower, chain.upper)
        error, angle, _ = polish(arm, here, q, effort.reach, effort.tolerance, effort.angle_tolerance, STEPS)
        if error > effort.tolerance or angle > effort.angle_tolerance:
            continue
        room = _room(bodies, nearest(bodies, base, q, contact=contact))
        if room >= margin:
            return q, float(error)
        if room > most:
            best, most = q, room
    return None


def _room(bodies: Bodies, touch: Touch) -> float:
    """Distance at a touch; from obstacles, beyond the bodies' clearance [m]."""
    return touch.distance - (bodies.clearance if touch.kind == "obstacle" else 0.0)
