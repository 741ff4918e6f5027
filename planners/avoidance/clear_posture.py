"""Postures of an arm on a fixed base that reach a target and touch nothing, or proofs that there is none.

First FABRIK-R from where the arm is; then FABRIK with obstacle avoidance; then a search: postures drawn at
random, and branch and bound over all postures where that can come to an end. Every answer is confirmed by the
chain's own forward kinematics and by `proximity.nearest`.

>>> import numpy as np
>>> from regionik.planners.collision.robot_bodies import bodies_from
>>> from regionik.worlds.bundled import robot_named
>>> from regionik.worlds.obstacles import Sphere
>>> robot = robot_named("youbot")
>>> bodies = bodies_from(robot, [Sphere("ball", 0.1, np.array([0.3, 0.0, 0.45]))])
>>> clear_posture(PostureTask(bodies, np.zeros(3), np.array([0.45, 0.0, 0.3])), robot.carry).verdict.name
'PROVEN'
>>> clear_posture(PostureTask(bodies, np.zeros(3), np.array([0.3, 0.0, 0.45])), robot.carry).verdict.name
'RULED_OUT'
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.avoidance.avoiding_fabrik import MAX_ITERATIONS, avoid_obstacles, links_clear
from regionik.planners.collision.collision_checking import is_clear
from regionik.planners.collision.proximity import nearest, room_of
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, RobotScene
from regionik.planners.kernels import compiled
from regionik.planners.reach.serial_criteria import SerialThresholds, moved_within_thresholds
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import (
    PostureTask,
    is_searchable,
    search_postures,
    solid_at_target,
)
from regionik.planners.solvers.damped_least_squares import POSITION, Aim, Aims, polish
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.planners.solvers.multistart_ik import ArmSolver, Effort, solve_ik
from regionik.planners.solvers.rigid_bodies import arm_model
from regionik.planners.solvers.serial_chain import SerialArm
from regionik.worlds.arrays import Array, Index, Mask, frozen
from regionik.worlds.chain import Chain, spread_postures
from regionik.worlds.errors import InputError

_NEIGHBOR_STEPS = 20  # of damped least squares from a start


class NeighboringTargets(NamedTuple):
    """Targets that an arm is to reach with the base where it is, for kernels."""

    scene: RobotScene
    margin: float  # kept from all solids beyond what the scene asks [m]
    base: Array  # (3,) x, y [m], yaw [rad]
    thresholds: SerialThresholds  # of the postures
    arm: SerialArm  # it may have more joints than the robot, the first of which do not move
    aims: Aims  # n targets as the arm's base frame has them
    tool_on: Index  # (n,) obstacle that the tool works on at each, -1 for none
    near: Index  # (n, m) targets near each, the nearest first
    # reach, tolerance: as of `polish`
    reach: float
    tolerance: float


@compiled
def neighboring_postures(targets: NeighboringTargets, starts: Array, postures: Array) -> Mask:
    """Find clear postures: from the starts at a target, and from each found on to the targets near it.

    Parameters
    ----------
    starts : (n, s, k) array
        Postures to begin from, the first that leads to a clear one is taken.
    postures : (n, k) array
        Overwritten where one is found.

    Returns
    -------
    (n,) array of bool
        True where one was found.
    """
    n = len(targets.aims.positions)
    found, queue = np.zeros(n, dtype=np.bool_), np.empty(n, dtype=np.int64)
    for i in range(n):
        for s in range(starts.shape[1]):
            if found[i] or not _meets(targets, i, starts[i, s], postures):
                continue
            found[i], queue[0] = True, i
            first, count = 0, 1
            while first < count:
                k = queue[first]
                first += 1
                for j in targets.near[k]:
                    if not found[j] and _meets(targets, j, postures[k], postures):
                        found[j], queue[count] = True, j
                        count += 1
    return found


@compiled
def _meets(targets: NeighboringTargets, i: int, start: Array, postures: Array) -> bool:
    """True if a start leads to a clear posture at target i that meets what is asked; it is kept."""
    aims, joints = targets.aims, start.copy()
    aim = Aim(aims.positions[i], aims.kinds[i], aims.turns[i], aims.cones[i])
    reach, most, widest = targets.reach, targets.tolerance, aims.angle_tolerances[i]
    error, angle, _ = polish(targets.arm, aim, joints, reach, most, widest, _NEIGHBOR_STEPS)
    if error > most or angle > widest:
        return False
    if not moved_within_thresholds(targets.arm, targets.thresholds, aim, joints, reach, most, widest):
        return False
    more = len(joints) - len(targets.scene.robot.arm.lower)
    if not is_clear(targets.scene, targets.margin, targets.base, joints[more:], targets.tool_on[i]):
        return False
    postures[i] = joints
    return True


SAMPLES = 300  # postures drawn at random for a target
_FEW_BOXES = 500  # boxes of joint values after which a proof is no longer to be had cheaply
MAX_BOXES = 200_000
ATTEMPTS = 3  # of FABRIK with obstacle avoidance, each with other random rotations
_QUICK_PASSES = 12  # of FABRIK with obstacle avoidance; where it succeeds it mostly takes fewer than ten
STEPS = 60  # of damped least squares that take a posture back to the target
_MAX_CHANGE = 1.0  # of a joint when the best posture so far is varied [rad] or [m]


@dataclass(frozen=True, eq=False)
class ClearPosture:
    """Outcome of the search for a clear posture."""

    # PROVEN by a posture; RULED_OUT by a proof that there is none; or OPEN, within the effort made
    verdict: Verdict
    joints: Array | None  # (dof,) the posture, within limits [rad] or [m]
    error: float  # what the tool misses, infinite without a posture [m]
    steps: tuple[str, ...]  # what was used, in order: "passes", "avoidance", "search"


def clear_posture(
    task: PostureTask, joints: ArrayLike, *, seed: int = 0, most_boxes: int = MAX_BOXES
) -> ClearPosture:
    """Find a posture that brings the tool to a target with every solid clear, or prove that there is none.

    Parameters
    ----------
    joints : (dof,) array_like
        Posture to start from, clear or not.
    seed : int
        Same question and seed, same answer to the last bit.
    most_boxes : int
        Budget of the exhaustive search.

    Raises
    ------
    InputError
        When a number is out of its range.
    """
    search = _Search(task, joints, seed)
    return (
        search.by_passes()
        or search.by_proof(min(_FEW_BOXES, most_boxes))
        or search.by_avoidance(ATTEMPTS)
        or search.by_sampling()
        or search.by_branch_and_bound(most_boxes)
    )


def quick_clear_posture(task: PostureTask, joints: ArrayLike, *, seed: int = 0) -> ClearPosture:
    """A few passes of `clear_posture` alone, without the search: found or undecided, and soon."""
    search = _Search(task, joints, seed)
    return search.by_passes() or search.by_avoidance(1, _QUICK_PASSES) or search.answer(Verdict.OPEN)


def sampled_clear_posture(task: PostureTask, joints: ArrayLike, *, samples: int) -> ClearPosture:
    """The samples of `clear_posture` alone, for one of many targets: found or undecided."""
    search = _Search(task, joints, 0)
    return search.by_passes() or search.by_sampling(samples) or search.answer(Verdict.OPEN)


def clear_posture_at_pose(
    bodies: Bodies,
    base: Array,
    aim: Aim,
    joints: Array,
    effort: Effort,
    *,
    samples: int,
    contact: ContactTargets | None = None,
    margin: float = 0.0,
    seed: int = 0,
) -> ClearPosture:
    """The samples of `clear_posture` for a pose: every other one near the best so far; nothing is proven.

    The base (3,) stands still, the aim is seen from the world, the joints (dof,) to start from may be clear
    or not.
    """
    chain, T = bodies.robot.chain, bodies.robot.T_world_arm(base)
    arm, rng = arm_model(chain).posing.arm, np.random.default_rng([seed, 2])
    here = in_arm_frame(T[:2, 3], float(np.arctan2(T[1, 0], T[0, 0])), float(T[2, 3]), aim)
    best, most = np.clip(joints, chain.lower, chain.upper), -np.inf
    for k, fresh in enumerate(spread_postures(chain, effort.reach, samples, seed)):
        q = _varied(chain, best, rng) if k % 2 == 0 else fresh
        error, angle, _ = polish(arm, here, q, effort.reach, effort.tolerance, effort.angle_tolerance, STEPS)
        if error > effort.tolerance or angle > effort.angle_tolerance:
            continue
        room = room_of(bodies, nearest(bodies, base, q, contact=contact))
        if room >= margin:
            return ClearPosture(Verdict.PROVEN, q, float(error), ("search",))
        if room > most:
            best, most = q, room
    return ClearPosture(Verdict.OPEN, None, np.inf, ("search",))


class _Search:
    """The search for one task, stage by stage, and the best posture met so far."""

    def __init__(self, task: PostureTask, joints: ArrayLike, seed: int) -> None:
        self.task, self.bodies, self.chain = task, task.bodies, task.bodies.robot.chain
        if seed < 0:
            raise InputError(f"seed: expected 0 or more, got {seed}")
        self.seed, start = seed, frozen(joints, (self.chain.dof,), "joints")
        self.start = np.clip(start, self.chain.lower, self.chain.upper)
        T = task.bodies.robot.T_world_arm(task.base)
        self.goal: Array = T[:3, :3].T @ (task.target - T[:3, 3])
        self.solver = ArmSolver(self.chain, task.tolerance)
        self.steps: list[str] = []
        self.best: tuple[Array, float, float] | None = None  # joints, error, room

    def by_passes(self) -> ClearPosture | None:
        """FABRIK-R from the start, obstacles left aside."""
        self.steps.append("passes")
        q = self.start.copy()
        self.solver.solve(Aim(self.goal, POSITION, np.eye(3)), q)
        return self._result() if self._offer(q) else None

    def by_proof(self, most: int) -> ClearPosture | None:
        """A proof that is at hand, or a short search for one; postures that it finds are left aside."""
        task = self.task
        if solid_at_target(self.bodies, task.target, task.tolerance, task.margin, task.contact):
            return self.answer(Verdict.RULED_OUT)
        if self.chain.unbounded or search_postures(task, lambda q: False, most).verdict != Verdict.RULED_OUT:
            return None
        self.steps.append("search")
        return self.answer(Verdict.RULED_OUT)

    def by_avoidance(self, attempts: int, most: int = MAX_ITERATIONS) -> ClearPosture | None:
        """FABRIK with obstacle avoidance, with other random rotations each time; not of mimicking joints."""
        if self.chain.has_mimics:
            return None
        self.steps.append("avoidance")
        task = self.task
        clear = links_clear(self.bodies, task.base, task.target, task.margin, task.contact)
        for attempt in range(attempts):
            seed = int(np.random.SeedSequence([self.seed, attempt]).generate_state(1)[0])
            found = avoid_obstacles(
                self.chain, self.goal, self.start, clear, tolerance=task.tolerance, seed=seed, most=most
            )
            if found.converged and self._offer(found.joints):
                return self._result()
        return None

    def by_sampling(self, samples: int = SAMPLES) -> ClearPosture | None:
        """Postures on the target from random starts, every other one near the best so far."""
        self.steps.append("search")
        solver, rng = self.solver, np.random.default_rng([self.seed, 1])
        n, effort = len(solver.pointing.arm.lower), solver.effort
        aim, none = Aim(self.goal, POSITION, np.eye(3)), np.empty((0, n))
        for k, fresh in enumerate(spread_postures(self.chain, effort.reach, samples, self.seed)):
            q = fresh
            if self.best is None or k % 2 == 0:
                solve_ik(solver.pointing, aim, none, effort, q)
            else:
                q = _varied(self.chain, self.best[0], rng)
                near = q[:n].copy()
                polish(solver.pointing.arm, aim, near, effort.reach, self.task.tolerance, 1.0, STEPS)
                q[:n] = near
            if self._offer(q):
                return self._result()
        return None

    def by_branch_and_bound(self, most: int) -> ClearPosture:
        """All postures, where the arm is not too mobile for that."""
        if not is_searchable(self.chain, self.bodies.robot.solids):
            return self.answer(Verdict.OPEN)
        verdict = search_postures(self.task, self._offer, most).verdict
        return self._result() if verdict == Verdict.PROVEN else self.answer(verdict)

    def answer(self, verdict: Verdict) -> ClearPosture:
        """Return no posture."""
        return ClearPosture(verdict, None, np.inf, tuple(self.steps))

    def _result(self) -> ClearPosture:
        assert self.best is not None
        joints, error, _ = self.best
        joints.flags.writeable = False
        return ClearPosture(Verdict.PROVEN, joints, error, tuple(self.steps))

    def _offer(self, joints: Array) -> bool:
        """Tell whether a posture is an answer: within limits, on the target, and clear."""
        within = (joints >= self.chain.lower).all() and (joints <= self.chain.upper).all()
        error = float(np.linalg.norm(self.chain.forward(joints)[:3, 3] - self.goal))
        if not within or error > self.task.tolerance:
            return False
        best = -np.inf if self.best is None else self.best[2]
        touch = nearest(
            self.bodies, self.task.base, joints, contact=self.task.contact, enough=min(best, self.task.margin)
        )
        room = room_of(self.bodies, touch)
        if room > best or self.best is None:
            self.best = np.array(joints), error, room
        return room >= self.task.margin


def _varied(chain: Chain, joints: Array, rng: np.random.Generator) -> Array:
    """A posture near another one: all joints changed by normal amounts of a random size."""
    change = _MAX_CHANGE * 10.0 ** rng.uniform(-3, 0) * rng.normal(size=chain.dof)
    varied: Array = np.clip(joints + change, chain.lower, chain.upper)
    return varied
