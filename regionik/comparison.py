"""Ways to solve a world's set-points, all asked alike: a target, base and joints in, a configuration out.

M-FABRIK moves the base after the arm's root. To its rivals the base is two more joints before the arm, which
slide along x and y without limits; none of them turns the base. The neural network knows the arm alone: the
base drives straight until the target lies where the nearest place of the arm's cloud is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from regionik.areas.demand import aim_of, misses
from regionik.areas.standing import room_for
from regionik.mfabrik import Solver, axis_of, pose_of, solver_for
from regionik.pipeline import start_place, whole_path
from regionik.planners.driving.footprint_scene import fits
from regionik.planners.rivals.genetic import Genetic
from regionik.planners.rivals.iterative import CyclicDescent, DampedLeastSquares, PseudoInverse, Transpose
from regionik.planners.rivals.method import ArmMethod, Fabrik, FabrikPolished, Found
from regionik.planners.rivals.network import Network
from regionik.planners.solvers.mobile import seen
from regionik.postures.guard import guard_of
from regionik.postures.poses import pose
from regionik.pruning import choose_chain
from regionik.values import Configuration
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint, planar_pose
from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Target, World

OURS = "mfabrik"  # what the others are measured against
SLIDES = 2  # joints of the base before those of the arm


class Method(Protocol):
    """One way to solve a target."""

    def __call__(self, target: Target, base: Array, joints: Array, /) -> Configuration:
        """From a base pose (3,) and joints (dof,) to base and arm on the target, as near as it comes."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """A base whose x and y are two more joints of the chain that a method solves."""

    robot: Robot
    method: ArmMethod

    def __call__(self, target: Target, base: Array, joints: Array) -> Configuration:
        aim = seen(axis_of(self.robot, base), _yaw(self.robot, base), _height(self.robot), aim_of(target))
        found = self.method.search(aim, np.concatenate([np.zeros(SLIDES), joints]))
        return _moved(self.robot, base, found.joints[:SLIDES], found.joints[SLIDES:], found, self.method)


@dataclass(frozen=True, eq=False)
class Driven:
    """A base that first drives straight until its target lies at the nearest place of the network's cloud."""

    robot: Robot
    method: Network

    def __call__(self, target: Target, base: Array, joints: Array) -> Configuration:
        axis, yaw = axis_of(self.robot, base), _yaw(self.robot, base)
        aim = seen(axis, yaw, _height(self.robot), aim_of(target))
        shift = (aim.position - self.method.nearest_place(aim.position))[:SLIDES]
        aim.position[:SLIDES] -= shift
        found = self.method.search(aim, joints)
        return _moved(self.robot, base, shift, found.joints, found, self.method)


def _moved(
    robot: Robot, base: Array, shift: Array, joints: Array, found: Found, method: ArmMethod
) -> Configuration:
    """The base shifted in the frame of the arm, its heading kept."""
    yaw = _yaw(robot, base)
    c, s = np.cos(yaw), np.sin(yaw)
    axis = axis_of(robot, base) + np.array([c * shift[0] - s * shift[1], s * shift[0] + c * shift[1]])
    good = found.error <= method.tolerance and found.angle <= method.angle_tolerance
    pose = pose_of(robot, axis, float(base[2]))
    return Configuration(pose, np.array(joints), found.error, found.iterations, bool(good))


def _yaw(robot: Robot, base: Array) -> float:
    return float(base[2] + robot.mount[3])


def _height(robot: Robot) -> float:
    return float(robot.mount[2])


def sliding_chain(chain: Chain) -> Chain:
    """The chain behind two joints that slide along x and y of its base frame, without limits."""
    slides = [
        Joint(f"(base {name})", "prismatic", -np.inf, np.inf, np.eye(4), axis)
        for name, axis in zip("xy", np.eye(3)[:SLIDES], strict=True)
    ]
    return Chain((*slides, *chain.joints), chain.T_last_tool)


Methods = Sequence[Method]  # one for each set-point of a world


def _free(world: World) -> Methods:
    """M-FABRIK on a floor without limits, as its rivals have it."""
    solver = Solver(world.robot, None, world.rules.tolerance, world.rules.heading)
    return [solver] * len(world.task)


def _inside(world: World) -> Methods:
    """M-FABRIK in the areas of the whole path, as plans use it."""
    standing, _, pruned = whole_path(world)
    ladder = pruned.ladder
    return [
        solver_for(world, ladder.family[k], ladder.component[k], standing.sides[ladder.side[k]].span)
        for k in choose_chain(pruned, standing, start_place(world))
    ]


def _sliding(kind: type[ArmMethod]) -> Callable[[World], Methods]:
    def make(world: World) -> Methods:
        method = kind(sliding_chain(world.robot.chain), world.rules.tolerance)  # type: ignore[call-arg]
        return [Sliding(world.robot, method)] * len(world.task)

    return make


def _network(world: World) -> Methods:
    if any(target.direction is not None for target in world.task):
        raise InputError(
            f"network: takes positions alone, and {world.name} has set-points that ask for a direction, "
            f"valid choices: {', '.join(name for name in METHODS if name != Network.name)}"
        )
    return [Driven(world.robot, Network(world.robot.chain, world.rules.tolerance))] * len(world.task)


_SLIDING = (Fabrik, FabrikPolished, PseudoInverse, DampedLeastSquares, Transpose, CyclicDescent)

METHODS: dict[str, Callable[[World], Methods]] = {
    OURS: _free,
    "mfabrik-areas": _inside,
    **{kind.name: _sliding(kind) for kind in _SLIDING},
    Genetic.name: _sliding(Genetic),
    Network.name: _network,
}
DEFAULT = (OURS, *(kind.name for kind in _SLIDING))


def methods_named(world: World, names: Sequence[str]) -> dict[str, Methods]:
    """Prepare methods for a world, one for each set-point.

    Raises
    ------
    InputError
        For a name that there is not, named with the valid choices, and for a package that is not installed.
    NoPlanFound
        Where areas are asked for and the world has none.
    """
    for name in names:
        if name not in METHODS:
            raise InputError(f"methods: expected some of {', '.join(METHODS)}, got {name!r}")
    if not names:
        raise InputError(f"methods: expected some of {', '.join(METHODS)}, got none")
    return {name: METHODS[name](world) for name in dict.fromkeys(names)}


ROUNDS = 40  # walks of a method along the path, of which the fastest counts
ENOUGH = 0.5  # time after which a method is not walked again [s]
SLACK = 1e-9  # rounding allowed at tolerances, cones and limits
ALIKE = 1.05  # ratio of iterations, times or errors below which neither method is called the better
LEAST = 1e-6  # difference of errors that is worth a word [m]

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Score:
    """How one method did on the set-points of a world.

    Attributes
    ----------
    method : str
    setpoints, success : int
        Set-points, and those met by our own forward kinematics: position, direction, joint limits.
    iterations : float
        Mean over the set-points.
    microseconds : float
        Mean time of a call [us].
    ratio : float
        Of the mean time to that of M-FABRIK in the same run; NaN where that was not run.
    median_error, worst_error : float
        [m]
    over_limits : int
        Set-points with a joint beyond its limits.
    collisions : int
        Set-points where the arm is too near to something.
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
    """Scores on one world, in the order in which the methods were asked for.

    Attributes
    ----------
    world : str
    scores : tuple of Score
    answers : dict of tuple of Configuration
        What each method came to, by its name.
    """

    world: str
    scores: tuple[Score, ...]
    answers: dict[str, tuple[Configuration, ...]]

    @property
    def beaten(self) -> tuple[str, ...]:
        """One line for each method that does better than M-FABRIK in something, and in what."""
        ours = [score for score in self.scores if score.method == OURS]
        if not ours:
            return ()
        found = ((score.method, _better(score, ours[0])) for score in self.scores if score.method != OURS)
        return tuple(f"{name} beats {OURS} in {', '.join(what)}" for name, what in found if what)


def compare(
    world: World, methods: Sequence[str] = DEFAULT, *, progress: Progress | None = None
) -> Comparison:
    """Solve a world's set-points by several methods, each from its own last answer.

    All begin at the world's start, or without one an arm's length before the first set-point. Answers are
    the same each time; times are not.

    Parameters
    ----------
    world : World
    methods : sequence of str
        Of `regionik.comparison.METHODS`.
    progress : callable, optional
        Called with stage, done, total.

    Raises
    ------
    InputError
        For a world without a task, an unknown method, or one whose package is not installed.

    Examples
    --------
    >>> from regionik.worlds.library import load_world
    >>> scores = compare(load_world("pillar"), ["mfabrik", "dls"]).scores
    >>> [(score.method, score.success) for score in scores]
    [('mfabrik', 15), ('dls', 15)]
    """
    if not world.task:
        raise InputError(f"{world.name}: task: expected at least one set-point")
    tell = progress or (lambda stage, done, total: None)
    prepared = methods_named(world, methods)
    answers, seconds = {}, {}
    for done, (name, solvers) in enumerate(prepared.items()):
        tell("compare", done, len(prepared))
        answers[name], seconds[name] = _timed(world, solvers)
    ours = seconds.get(OURS, np.nan)
    scores = tuple(_judged(world, name, answers[name], seconds[name], ours) for name in prepared)
    return Comparison(world.name, scores, answers)


def _timed(world: World, solvers: Sequence[Method]) -> tuple[tuple[Configuration, ...], float]:
    """Answers, and the mean time of a call on the fastest of a few walks [s]."""
    start = _start(world)
    solvers[0](world.task[0], *start)  # compiled code is loaded here
    least, spent = np.inf, 0.0
    for _ in range(ROUNDS):
        began = time.perf_counter()
        found = _walk(world, solvers, start)
        taken = time.perf_counter() - began
        least, spent = min(least, taken), spent + taken
        if spent > ENOUGH:
            break
    return found, least / len(world.task)


def _walk(world: World, solvers: Sequence[Method], start: tuple[Array, Array]) -> tuple[Configuration, ...]:
    found: list[Configuration] = []
    base, joints = start
    for target, solver in zip(world.task, solvers, strict=True):
        found.append(solver(target, base, joints))
        base, joints = found[-1].base, found[-1].joints
    return tuple(found)


def _start(world: World) -> tuple[Array, Array]:
    """The world's start; without one, the arm carried and its axis half its reach before the first target."""
    if world.start is not None:
        return world.start.base, world.start.joints
    robot, first = world.robot, world.task[0].position
    points = robot.chain.frames(robot.carry)[:, :3, 3]
    reach = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return pose_of(robot, first[:2] - [reach / 2, 0.0], 0.0), robot.carry


def _judged(world: World, name: str, answers: Sequence[Configuration], seconds: float, ours: float) -> Score:
    """Judge answers by the chain's own kinematics and by what plans are held to."""
    chain, room, guard = world.robot.chain, room_for(world), guard_of(world)
    tools = [tool_of(world, one) for one in answers]
    missed = np.array([misses(target, tool) for target, tool in zip(world.task, tools, strict=True)])
    cones = np.array([target.cone for target in world.task])
    over = np.array(
        [
            bool(((q < chain.lower - SLACK) | (q > chain.upper + SLACK)).any())
            for q in (one.joints for one in answers)
        ]
    )
    met = (missed[:, 0] <= world.rules.tolerance + SLACK) & (missed[:, 1] <= cones + SLACK) & ~over
    return Score(
        name,
        len(answers),
        int(met.sum()),
        float(np.mean([one.iterations for one in answers])),
        seconds * 1e6,
        seconds / ours,
        float(np.median(missed[:, 0])),
        float(missed[:, 0].max()),
        int(over.sum()),
        sum(guard.touch(pose(one)).kind != "none" for one in answers),
        sum(not fits(room, *one.base.tolist()) for one in answers),
    )


def tool_of(world: World, answer: Configuration) -> Array:
    """Tool frame of a configuration in the world, (4, 4), by the plain kinematics of the chain."""
    x, y, z, yaw = world.robot.mount.tolist()
    T_world_base = planar_pose(*answer.base.tolist())
    tool: Array = T_world_base @ planar_pose(x, y, yaw, z) @ world.robot.chain.forward(answer.joints)
    return tool


def _better(one: Score, ours: Score) -> list[str]:
    """In what a method does better, with both figures; nothing for one that meets fewer set-points."""
    found: list[str] = []
    if one.success < ours.success:
        return found
    if one.success > ours.success:
        found.append(f"success ({one.success} against {ours.success} of {one.setpoints})")
    if one.iterations * ALIKE < ours.iterations:
        found.append(f"iterations ({one.iterations:.2f} against {ours.iterations:.2f})")
    if one.ratio * ALIKE < 1.0:
        found.append(f"time ({one.ratio:.2f} of it)")
    if one.worst_error * ALIKE + LEAST < ours.worst_error:
        found.append(f"worst error ({one.worst_error * 1e3:.3g} against {ours.worst_error * 1e3:.3g} mm)")
    for what, field in (("limits", "over_limits"), ("collisions", "collisions"), ("floor", "off_floor")):
        if getattr(one, field) < getattr(ours, field):
            found.append(f"{what} ({getattr(one, field)} against {getattr(ours, field)} set-points)")
    return found
