"""Ways to solve a world's set-points, all asked alike: a target, base and joints in, a configuration out.

M-FABRIK moves the base after the arm's root. To its rivals the base is two more joints before the arm, which
slide along x and y without limits; none of them turns the base. The neural network knows the arm alone: the
base drives straight until the target lies where the nearest place of the arm's cloud is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from regionik.areas.demand import aim_of
from regionik.mfabrik import Solver, axis_of, pose_of, solver_for
from regionik.pipeline import start_place, whole_path
from regionik.plan import Configuration
from regionik.planners.rivals.genetic import Genetic
from regionik.planners.rivals.iterative import CyclicDescent, DampedLeastSquares, PseudoInverse, Transpose
from regionik.planners.rivals.method import ArmMethod, Fabrik, FabrikPolished, Found
from regionik.planners.rivals.network import Network
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.pruning import choose_chain
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint
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
        aim = in_arm_frame(
            axis_of(self.robot, base), _yaw(self.robot, base), _height(self.robot), aim_of(target)
        )
        found = self.method.search(aim, np.concatenate([np.zeros(SLIDES), joints]))
        return _moved(self.robot, base, found.joints[:SLIDES], found.joints[SLIDES:], found, self.method)


@dataclass(frozen=True, eq=False)
class Driven:
    """A base that first drives straight until its target lies at the nearest place of the network's cloud."""

    robot: Robot
    method: Network

    def __call__(self, target: Target, base: Array, joints: Array) -> Configuration:
        axis, yaw = axis_of(self.robot, base), _yaw(self.robot, base)
        aim = in_arm_frame(axis, yaw, _height(self.robot), aim_of(target))
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
