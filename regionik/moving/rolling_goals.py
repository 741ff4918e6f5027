"""Next poses of a base on wheels: it stays while the arm reaches, else rolls to where it can stay long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from regionik.areas.standing import Mask, Standing, away, room_for
from regionik.ladder import Ladder
from regionik.planners.driving.arcs import arc_end
from regionik.planners.driving.footprint import fits
from regionik.planners.geometry.angles import wrap
from regionik.postures.poses import axis_of
from regionik.values import Configuration
from regionik.worlds.arrays import Array
from regionik.worlds.drives import BaseDrive
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

LENGTHS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)  # of one motion, forwards and backwards [m]
CURVES = (0.0, -0.5, 0.5, -1.0, 1.0)  # of a car, in shares of its tightest
SPINS = np.radians([0, -15, 15, -30, 30, -60, 60, -90, 90])  # of a differential drive before it goes straight
HORIZON = 40  # set-points looked ahead
LEAST_EFFORT = 0.2  # so that a small motion that brings little is not preferred for being small [m]
TURN_WEIGHT = 0.3  # what a turn counts against driving [m/rad]
TRAVEL = 0.3  # way of the base from which it has a direction [m]


@dataclass(frozen=True, eq=False)
class RollingGoals:
    """Poses a base on wheels comes to by staying or by one motion, with the component each stands in.

    Attributes
    ----------
    world : World
    ladder : Ladder
    standing : Standing
    travel : (n,) array
        Where the base goes on to from each set-point, NaN where it stays [rad].
    """

    world: World
    ladder: Ladder
    standing: Standing
    travel: Array

    def ahead(self, i: int) -> list[float]:
        """Headings along the way on from set-point i: forwards, backwards and across."""
        if np.isnan(self.travel[i]):
            return []
        return [float(self.travel[i]) + turn for turn in (0.0, np.pi, np.pi / 2, -np.pi / 2)]

    def poses(self, i: int, components: Sequence[int], here: Array) -> Iterator[tuple[Array, int]]:
        """For set-point i, the likeliest first.

        Parameters
        ----------
        i : int
        components : sequence of int
            Where the base may stand.
        here : (3,) array
            Base pose at first.
        """
        bases, efforts = _motions(self.world.robot.drive, here, next(iter(self.ahead(i)), None))
        holds = {k: self._holds(k, bases) for k in components}
        owner = np.full(len(bases), -1)
        for k in reversed(components):
            owner[holds[k]] = k
        if owner[0] >= 0:
            yield bases[0], int(owner[0])
        room = room_for(self.world)
        usable = [m for m in np.flatnonzero(owner >= 0).tolist() if m > 0 and fits(room, *bases[m])]
        gains = self.gains(i, bases)
        for m in sorted(usable, key=lambda m: (-gains[m] / (efforts[m] + LEAST_EFFORT), m)):
            yield bases[m], int(owner[m])

    def gains(self, i: int, bases: Array) -> Array:
        """Length of the tool path from set-point i on that each base pose (n, 3) serves, (n,) [m]."""
        rungs, spots = self.ladder.rungs, [target.position for target in self.world.task]
        serving, gain = np.ones(len(bases), dtype=bool), np.zeros(len(bases))
        for j in range(i, min(i + HORIZON, self.ladder.count - 1)):
            held = [self._holds(k, bases) for k in range(rungs[j + 1], rungs[j + 2])]
            serving &= np.any(held, axis=0)
            gain += serving * float(np.linalg.norm(spots[j + 1] - spots[j]))
        return gain

    def _holds(self, k: int, bases: Array) -> Mask:
        """Mask of the poses that a component holds."""
        axes, span = axis_of(self.world.robot, bases), self.standing.sides[int(self.ladder.side[k])].span
        turned = np.array([away(yaw, span) < 1e-9 for yaw in bases[:, 2].tolist()], dtype=bool)
        held: Mask = shapely.contains_xy(self.ladder.component[k], axes) & turned
        return held


def rolling_goals_for(
    world: World, ladder: Ladder, standing: Standing, found: Sequence[Configuration]
) -> RollingGoals | None:
    """Goals of a base on wheels along M-FABRIK's configurations; a base that slides goes anywhere."""
    rolls = world.robot.drive.rolls
    return RollingGoals(world, ladder, standing, _travel_headings(world.robot, found)) if rolls else None


def _travel_headings(robot: Robot, goals: Sequence[Configuration]) -> Array:
    """Direction in which the arm axis goes on from each configuration, (n,); NaN where it stays [rad]."""
    axes = np.array([axis_of(robot, goal.base) for goal in goals])
    headings = np.full(len(axes), np.nan)
    for i, axis in enumerate(axes):
        way = axes[i + 1 :] - axis
        far = np.flatnonzero(np.hypot(*way.T) >= TRAVEL)
        if len(far):
            headings[i] = np.arctan2(*way[far[0]][::-1])
        elif i:
            headings[i] = headings[i - 1]
    return headings


def _motions(drive: BaseDrive, here: Array, ahead: float | None) -> tuple[Array, Array]:
    """Poses after one motion and what each costs, the pose itself first.

    A base that turns on the spot may take the heading ``ahead`` when it has come.
    """
    bases, efforts = [here], [0.0]
    for length in (sign * length for length in LENGTHS for sign in (1, -1)):
        if drive.turns_on_the_spot:
            turns = [(float(spin), 0.0) for spin in SPINS]
        else:
            turns = [(0.0, share * length / drive.turning_radius) for share in CURVES]
        for spin, turn in turns:
            x, y, yaw = here + (0.0, 0.0, spin)
            bases.append(np.array(arc_end(x, y, yaw, length, turn)))
            efforts.append(abs(length) + TURN_WEIGHT * (abs(spin) + abs(turn)))
            if drive.turns_on_the_spot and ahead is not None:
                bases.append(np.array([*bases[-1][:2], ahead]))
                efforts.append(efforts[-1] + TURN_WEIGHT * abs(wrap(ahead - yaw)))
    return np.array(bases), np.array(efforts)
