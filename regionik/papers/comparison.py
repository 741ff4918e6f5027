"""M-FABRIK compared with other methods of inverse kinematics on the set-points of a world.

Every method takes a target, a base pose and joints, and returns a configuration. M-FABRIK moves the base with
the root of the arm. To its rivals the base is two more joints before the arm, prismatic along x and y without
limits; none of them turns the base. The neural network solves the arm alone: the base drives straight until
the target is at the nearest learnt position.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from regionik.mfabrik import Method, Solver, configurations
from regionik.papers.options import PAPERS
from regionik.papers.rivals.evolution import Evolution
from regionik.papers.rivals.genetic import Genetic
from regionik.papers.rivals.iterative import CyclicDescent, DampedLeastSquares, PseudoInverse, Transpose
from regionik.papers.rivals.method import ArmMethod, Fabrik, FabrikPolished, SearchResult
from regionik.papers.rivals.network import Network
from regionik.planners.driving.footprint import fits
from regionik.planners.progress import Progress, listening, track
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.postures.arm import aim_of, goal_error
from regionik.postures.poses import axis_of, configuration_pose, pose_of
from regionik.pruning import choose_chain, solvers_along, start_place, whole_path
from regionik.scene import scene_of
from regionik.values import Configuration
from regionik.worlds.arms import sliding_chain
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target, World

OPTIONS = PAPERS.comparison

REFERENCE = "mfabrik"
BASE_JOINTS = 2  # before those of the arm
ROUNDING = 1e-9  # allowed at tolerances, cones and limits


def by_sliding_base(
    robot: Robot, method: ArmMethod, target: Target, base: Array, joints: Array
) -> Configuration:
    """Solve by a method for a chain whose first two joints are x and y of the base."""
    found = method.search(_aim(robot, base, target), np.concatenate([np.zeros(BASE_JOINTS), joints]))
    return _shifted(robot, base, found.joints[:BASE_JOINTS], found.joints[BASE_JOINTS:], found, method)


def _by_driven_base(
    robot: Robot, method: Network, target: Target, base: Array, joints: Array
) -> Configuration:
    """Solve by a network, the base driven straight until the target is at the nearest learnt position."""
    aim = _aim(robot, base, target)
    shift = (aim.position - method.nearest_learnt(aim.position))[:BASE_JOINTS]
    aim.position[:BASE_JOINTS] -= shift
    found = method.search(aim, joints)
    return _shifted(robot, base, shift, found.joints, found, method)


def _aim(robot: Robot, base: Array, target: Target) -> Aim:
    """A target in the frame of the arm."""
    return in_arm_frame(axis_of(robot, base), _yaw(robot, base), float(robot.mount[2]), aim_of(target))


def _shifted(
    robot: Robot, base: Array, shift: Array, joints: Array, result: SearchResult, method: ArmMethod
) -> Configuration:
    """A configuration with the base shifted in the frame of the arm, its heading kept."""
    yaw = _yaw(robot, base)
    c, s = np.cos(yaw), np.sin(yaw)
    axis = axis_of(robot, base) + np.array([c * shift[0] - s * shift[1], s * shift[0] + c * shift[1]])
    converged = result.error <= method.tolerance and result.angle <= method.angle_tolerance
    pose = pose_of(robot, axis, float(base[2]))
    return Configuration(pose, np.array(joints), result.error, result.iterations, bool(converged))


def _yaw(robot: Robot, base: Array) -> float:
    return float(base[2] + robot.mount[3])


Methods = Sequence[Method]  # one for each set-point of a world


def _mfabrik(world: World) -> Methods:
    """M-FABRIK on a floor without limits, as for its rivals."""
    solver = Solver(world.robot, None, world.rules.tolerance, world.rules.heading)
    return [solver] * len(world.task)


def _mfabrik_in_areas(world: World) -> Methods:
    """M-FABRIK within the areas of the whole path, as plans use it."""
    scene = scene_of(world)
    free_space, _, pruned = whole_path(scene)
    chain = choose_chain(pruned, free_space, start_place(scene))
    return list(solvers_along(scene, pruned.ladder, free_space, chain))


def _with_sliding_base(kind: type[ArmMethod]) -> Callable[[World], Methods]:
    def make(world: World) -> Methods:
        method = kind(sliding_chain(world.robot.chain), world.rules.tolerance)  # type: ignore[call-arg]
        return [partial(by_sliding_base, world.robot, method)] * len(world.task)

    return make


def _network(world: World) -> Methods:
    if any(target.direction is not None for target in world.task):
        raise InputError(
            f"network: takes positions alone, and {world.name} has set-points that ask for a direction, "
            f"valid choices: {', '.join(name for name in METHODS if name != Network.name)}"
        )
    method = Network(world.robot.chain, world.rules.tolerance)
    return [partial(_by_driven_base, world.robot, method)] * len(world.task)


_ARM_METHODS = (Fabrik, FabrikPolished, PseudoInverse, DampedLeastSquares, Transpose, CyclicDescent)

METHODS: dict[str, Callable[[World], Methods]] = {
    REFERENCE: _mfabrik,
    "mfabrik-areas": _mfabrik_in_areas,
    **{kind.name: _with_sliding_base(kind) for kind in _ARM_METHODS},
    Genetic.name: _with_sliding_base(Genetic),
    Evolution.name: _with_sliding_base(Evolution),
    Network.name: _network,
}
DEFAULT = (REFERENCE, *(kind.name for kind in _ARM_METHODS))


def prepare_methods(world: World, names: Sequence[str]) -> dict[str, Methods]:
    """Prepare methods for a world, one for each set-point.

    Raises InputError for an unknown name, a package that is not installed, and joints that mimic others, and
    NoPlanFound where areas are asked for and the world has none.
    """
    unknown = [repr(name) for name in names if name not in METHODS]
    if unknown or not names:
        got = unknown[0] if unknown else "none"
        raise InputError(f"methods: expected some of {', '.join(METHODS)}, got {got}")
    if world.robot.chain.has_mimics:
        raise InputError(
            f"methods: {world.robot.name} has joints that mimic others, which no rival solves for"
        )
    return {name: METHODS[name](world) for name in dict.fromkeys(names)}


@dataclass(frozen=True, eq=False)
class Score:
    """Score of one method on the set-points of a world.

    Attributes
    ----------
    method : str
    setpoints, success : int
        Set-points, and those met by forward kinematics: position, direction, joint limits.
    iterations : float
        Mean over the set-points.
    microseconds : float
        Mean time of a call [us].
    ratio : float
        Of the mean time to that of M-FABRIK in the same comparison; NaN without it.
    median_error, worst_error : float
        [m]
    over_limits : int
        Set-points with a joint beyond its limits.
    collisions : int
        Set-points where the arm is too close to something.
    off_floor : int
        Set-points where the base has no room.
    """

    method: str
    setpoints: int
    success: int
    iterations: float
    microseconds: float
    ratio: float
    median_error: float
    worst_error: float
    over_limits: int
    collisions: int
    off_floor: int


@dataclass(frozen=True, eq=False)
class Comparison:
    """Scores on one world, in the order of the methods asked for.

    Attributes
    ----------
    world : str
    scores : tuple of Score
    answers : dict of tuple of Configuration
        Of each method, by its name.
    """

    world: str
    scores: tuple[Score, ...]
    answers: dict[str, tuple[Configuration, ...]]

    def __repr__(self) -> str:
        scores = ", ".join(f"{score.method} {score.success}/{score.setpoints}" for score in self.scores)
        return f"Comparison({self.world}: {scores})"

    @property
    def beaten(self) -> tuple[str, ...]:
        """One line for each method that beats M-FABRIK in something, and in what."""
        ours = next((score for score in self.scores if score.method == REFERENCE), None)
        if ours is None:
            return ()
        found = {score.method: _advantages(score, ours) for score in self.scores if score is not ours}
        return tuple(f"{name} beats {REFERENCE} in {', '.join(what)}" for name, what in found.items() if what)


def compare(
    world: World, methods: Sequence[str] = DEFAULT, *, progress: Progress | None = None
) -> Comparison:
    """Solve a world's set-points by several methods, each from its own last answer.

    All begin at the world's start, or without one half the arm's reach before the first set-point. Answers
    are deterministic; times are not.

    Parameters
    ----------
    world : World
    methods : sequence of str
        Of `regionik.papers.comparison.METHODS`.
    progress : callable, optional
        Called with stage, done, total.

    Raises
    ------
    InputError
        For a world without a task, an unknown method, or one whose package is not installed.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> scores = compare(load_world("pillar"), ["mfabrik", "dls"]).scores
    >>> [(score.method, score.success) for score in scores]
    [('mfabrik', 15), ('dls', 15)]
    """
    if not world.task:
        raise InputError(f"{world.name}: task: expected at least one set-point")
    prepared = prepare_methods(world, methods)
    answers, seconds = {}, {}
    with listening(progress):
        for name in track("compare", list(prepared)):
            answers[name], seconds[name] = _solve_and_time(world, prepared[name])
    ours = seconds.get(REFERENCE, np.nan)
    scores = tuple(_score(world, name, answers[name], seconds[name], ours) for name in prepared)
    return Comparison(world.name, scores, answers)


def _solve_and_time(world: World, solvers: Sequence[Method]) -> tuple[tuple[Configuration, ...], float]:
    """Answers, and the mean time of a call in the fastest of a few runs [s]."""
    start = _start(world)
    solvers[0](world.task[0], *start)  # loads compiled code
    least, spent = np.inf, 0.0
    for _ in range(OPTIONS.max_runs):
        began = time.perf_counter()
        found = configurations(world.task, solvers, start)
        taken = time.perf_counter() - began
        least, spent = min(least, taken), spent + taken
        if spent > OPTIONS.time_budget:
            break
    return found, least / len(world.task)


def _start(world: World) -> tuple[Array, Array]:
    """The world's start; without one, the arm carried, its axis half its reach before the first target."""
    if world.start is not None:
        return world.start.base, world.start.joints
    robot, first = world.robot, world.task[0].position
    points = robot.chain.frames(robot.carry)[:, :3, 3]
    reach = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return pose_of(robot, first[:2] - [reach / 2, 0.0], 0.0), robot.carry


def _score(world: World, name: str, answers: Sequence[Configuration], seconds: float, ours: float) -> Score:
    scene = scene_of(world)
    robot, room, collision = scene.robot, scene.footprint, scene.collision
    base, joints = np.array([one.base for one in answers]), np.array([one.joints for one in answers])
    tools = robot.tool(base, joints)
    missed = np.array([goal_error(target, tool) for target, tool in zip(world.task, tools, strict=True)])
    cones = np.array([target.cone for target in world.task])
    lower, upper = robot.chain.lower - ROUNDING, robot.chain.upper + ROUNDING
    over = ((joints < lower) | (joints > upper)).any(axis=1)
    met = (missed[:, 0] <= world.rules.tolerance + ROUNDING) & (missed[:, 1] <= cones + ROUNDING) & ~over
    return Score(
        method=name,
        setpoints=len(answers),
        success=int(met.sum()),
        iterations=float(np.mean([one.iterations for one in answers])),
        microseconds=seconds * 1e6,
        ratio=seconds / ours,
        median_error=float(np.median(missed[:, 0])),
        worst_error=float(missed[:, 0].max()),
        over_limits=int(over.sum()),
        collisions=sum(collision.nearest(configuration_pose(one)).kind != "none" for one in answers),
        off_floor=sum(not fits(room, *one.base.tolist()) for one in answers),
    )


def _advantages(one: Score, ours: Score) -> list[str]:
    """Criteria in which a method is better, with both figures; none if it meets fewer set-points."""
    found: list[str] = []
    if one.success < ours.success:
        return found
    if one.success > ours.success:
        found.append(f"success ({one.success} against {ours.success} of {one.setpoints})")
    if one.iterations * OPTIONS.tie_ratio < ours.iterations:
        found.append(f"iterations ({one.iterations:.2f} against {ours.iterations:.2f})")
    if one.ratio * OPTIONS.tie_ratio < 1.0:
        found.append(f"time ({one.ratio:.2f} of it)")
    if one.worst_error * OPTIONS.tie_ratio + OPTIONS.tie_error < ours.worst_error:
        found.append(f"worst error ({one.worst_error * 1e3:.3g} against {ours.worst_error * 1e3:.3g} mm)")
    for what, field in (("limits", "over_limits"), ("collisions", "collisions"), ("floor", "off_floor")):
        if getattr(one, field) < getattr(ours, field):
            found.append(f"{what} ({getattr(one, field)} against {getattr(ours, field)} set-points)")
    return found
