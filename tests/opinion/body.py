"""Whether a base may stand with what is on it, whatever its arm does."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.opinion.course import Course
from tests.opinion.machine import Array, Machine
from tests.opinion.moment import Moment

TURNS = 180  # headings looked at
LIFTS = 9  # heights of each lift


class Body:
    """The base of a machine in a world, and what turns with it: all that no joint but lifts moves."""

    def __init__(self, document: dict[str, Any], machine: Machine) -> None:
        self.machine = machine
        self.lifts = _lifts(machine)
        still = [part for part in machine.parts if part.link < self.lifts]
        course = Course({"world": document, "states": []}, _only(machine, still))
        self.moment, self.world = Moment(course), document

    def objections(self, base: Array) -> list[str]:
        """What is in the way of a base pose (3,) at every height of the lifts; empty where one is free."""
        found = list(self.moment._base(base))
        if found:
            return found
        for joints in self._postures():
            self.machine.place(base, joints)
            touched = list(self.moment._arm(self.moment.machine.frames(), np.full(3, np.inf)))
            if not touched:
                return []
            found = touched
        return found

    def stands_over(self, axis: Array) -> bool:
        """True where the arm's mount may be over a spot of the floor (2,) at some heading."""
        return any(not self.objections(pose) for pose in self._poses(axis))

    def _poses(self, axis: Array) -> Iterator[Array]:
        x, y = self.machine.mount[:2, 3]
        fixed = self.world["rules"]["heading"] == "fixed"
        start = self.world.get("start") or {"base": [0.0, 0.0, 0.0]}
        for yaw in [float(start["base"][2])] if fixed else self._headings():
            c, s = np.cos(yaw), np.sin(yaw)
            yield np.array([axis[0] - (c * x - s * y), axis[1] - (s * x + c * y), yaw])

    def _headings(self) -> list[float]:
        """Headings all round, and those at which a side of the footprint is along one of a box."""
        corners = np.reshape(self.machine.facts.footprint, (-1, 2))
        sides = np.arctan2(*(np.roll(corners, -1, axis=0) - corners).T[::-1]) if len(corners) > 2 else []
        walls = {float(one["box"].get("yaw", 0.0)) for one in self.world["obstacles"] if "box" in one}
        along = [wall - side + k * np.pi / 2 for wall in sorted(walls) for side in sides for k in range(4)]
        exact = np.unique(np.round(np.mod(along, 2 * np.pi), 9))
        return [*(2 * np.pi * np.arange(TURNS) / TURNS).tolist(), *exact.tolist()]

    def _postures(self) -> Iterator[Array]:
        """Postures with the lifts at several heights, the other joints wherever they are."""
        rest = np.clip(0.0, self.machine.lower, self.machine.upper)
        if not self.lifts:
            yield rest
            return
        for share in np.linspace(0, 1, LIFTS):
            joints = rest.copy()
            lifts = slice(0, self.lifts)
            joints[lifts] = self.machine.lower[lifts] + share * np.ptp(
                [self.machine.lower[lifts], self.machine.upper[lifts]], axis=0
            )
            yield joints


def _lifts(machine: Machine) -> int:
    """Number of sliding joints before the first that turns."""
    slides = machine.slides.tolist()
    return slides.index(False) if False in slides else len(slides)


def _only(machine: Machine, parts: list[Any]) -> Machine:
    """The machine with some of its parts alone, on the same joints."""
    other = object.__new__(Machine)
    other.__dict__.update(machine.__dict__)
    other.parts = parts
    other.last = -2
    return other
