"""Kinds of base: what each can do, and its way between two poses, as every reader of a plan fills it in.

`verify` asks a drive for its kind of motion alone (`BaseDrive.rolls` and `BaseDrive.turning_radius`), and has
kinematics of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array

BaseKind = Literal["omni", "differential", "car"]
# Of base moves that go round things, by OMPL's names; those from RRTstar on better their ways
BasePlanner = Literal["RRTConnect", "BKPIECE1", "RRTstar", "InformedRRTstar", "BITstar", "AORRTC"]

MAX_CHORD_ERROR = 5e-4  # that a line through points of a drawn way may cut off an arc [m]


@dataclass(frozen=True)
class BaseDrive(ABC):
    """Motion of a base."""

    kind: ClassVar[BaseKind]  # its name in files
    rolls: ClassVar[bool]  # it goes along its own heading and nowhere else
    turns_on_the_spot: ClassVar[bool] = True
    headings: ClassVar[tuple[str, ...]] = ("free",)  # rules of heading that it can keep
    turning_radius: float = 0.0  # least radius of its arcs [m]

    @property
    @abstractmethod
    def words(self) -> str:
        """The kind as people call it: "a differential drive"."""

    @abstractmethod
    def parts(self, here: Array, there: Array) -> tuple[Array, Array]:
        """Split motions between poses into what is slid and turned evenly (..., 3) and what is rolled (...).

        The base turns the shorter way; rolling in reverse is below 0 [m], [rad].
        """

    def between(self, here: Array, there: Array, share: ArrayLike) -> Array:
        """Base poses (..., 3) on the way from some poses to others, headings running on from the first.

        Poses (..., 3) are x, y [m], yaw [rad]; the base turns the shorter way. ``share`` (...,) is 0 at
        ``here`` and 1 at ``there``.
        """
        share = np.asarray(share, dtype=np.float64)
        slide, length = self.parts(here, there)
        pose: Array = here + share[..., None] * slide
        if self.rolls:
            half = share * slide[..., 2] / 2
            chord, middle = share * length * np.sinc(half / np.pi), here[..., 2] + half
            pose[..., 0] += chord * np.cos(middle)
            pose[..., 1] += chord * np.sin(middle)
        return pose

    def slip(self, base: Array) -> tuple[Array, Array]:
        """Return the part of each hop through base poses (n, 3) that wheels cannot roll, and its derivatives.

        That is the way across the heading halfway [m]: (k,) and (k, 2, 3) of k = n - 1 hops, or of none
        where a base goes every way.
        """
        return np.empty(0), np.empty((0, 2, 3))

    def travel(self, base: Array) -> float:
        """Length of the way through base poses (n, 3) [m]."""
        slide, length = self.parts(base[:-1], base[1:])
        return float((np.hypot(slide[:, 0], slide[:, 1]) + np.abs(length)).sum())

    def rolled(self, base: Array) -> Array:
        """Way rolled over each hop through base poses (n, 3), below 0 in reverse, (n - 1,) [m]."""
        return self.parts(base[:-1], base[1:])[1]

    def cuts(self, base: Array) -> Array:
        """Places on the way through base poses (n, 3) between which lines are near it, (m,).

        In poses: 2.5 is halfway from the third to the fourth. All poses are among them.
        """
        slide, length = self.parts(base[:-1], base[1:])
        pieces = np.ceil(np.sqrt(np.abs(length * slide[:, 2]) / (8 * MAX_CHORD_ERROR))).astype(int)
        shares = [k + np.arange(max(n, 1)) / max(n, 1) for k, n in enumerate(pieces.tolist())]
        return np.concatenate([*shares, [len(base) - 1.0]])

    def sampled(self, base: Array, index: Array) -> Array:
        """Base poses (m, 3) where `cuts` says."""
        hop = np.minimum(index.astype(int), max(len(base) - 2, 0))
        return self.between(base[hop], base[np.minimum(hop + 1, len(base) - 1)], index - hop)

    def trace(self, base: Array) -> Array:
        """Line on the floor along the way through base poses (n, 3), (m, 2) [m]."""
        return self.sampled(base, self.cuts(base))[:, :2]


@dataclass(frozen=True)
class OmnidirectionalDrive(BaseDrive):
    """A holonomic base: it moves straight in any direction and turns evenly."""

    kind = "omni"
    rolls = False
    headings = ("free", "face_target", "fixed")
    words = "an omnidirectional base"

    def parts(self, here: Array, there: Array) -> tuple[Array, Array]:
        """Split motions, of which nothing is rolled."""
        step = displacement(here, there)
        return step, np.zeros(step.shape[:-1])


@dataclass(frozen=True)
class _RollingDrive(BaseDrive):
    """A base on wheels: it rolls along the arc whose chord has the heading in the middle of the turn."""

    rolls = True

    def parts(self, here: Array, there: Array) -> tuple[Array, Array]:
        """Split motions: the part of the chord across that heading, which no wheel can roll, is slid."""
        step = displacement(here, there)
        half = step[..., 2] / 2
        tangent = np.stack([np.cos(here[..., 2] + half), np.sin(here[..., 2] + half)], -1)
        along = (step[..., :2] * tangent).sum(-1)
        step[..., :2] -= along[..., None] * tangent
        return step, along / np.sinc(half / np.pi)  # chord = length sin(half) / half

    def slip(self, base: Array) -> tuple[Array, Array]:
        """See `BaseDrive`."""
        step = displacement(base[:-1], base[1:])
        middle = base[:-1, 2] + step[:, 2] / 2
        left = np.column_stack([-np.sin(middle), np.cos(middle)])
        turned = -(step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)) / 2
        by_pose = np.stack([np.column_stack([-left, turned]), np.column_stack([left, turned])], axis=1)
        return (step[:, :2] * left).sum(axis=1), by_pose


@dataclass(frozen=True)
class DifferentialDrive(_RollingDrive):
    """Two wheels side by side, driven each by itself.

    >>> quarter = np.array([1.0, 1.0, np.pi / 2])
    >>> DifferentialDrive().between(np.zeros(3), quarter, 0.5).round(3).tolist()
    [0.707, 0.293, 0.785]
    """

    kind = "differential"
    words = "a differential drive"


@dataclass(frozen=True)
class CarDrive(_RollingDrive):
    """Wheels that steer: no arc is tighter than its turning radius."""

    kind = "car"
    turns_on_the_spot = False

    @property
    def words(self) -> str:
        """See `BaseDrive`."""
        return f"a car with a turning radius of {self.turning_radius:g} m"


def drive_of(kind: BaseKind, turning_radius: float = 0.0) -> BaseDrive:
    """Return the drive of a kind; only a car asks for a turning radius [m].

    >>> drive_of("car", 0.5).words
    'a car with a turning radius of 0.5 m'
    """
    drives: dict[BaseKind, BaseDrive] = {
        "omni": OmnidirectionalDrive(),
        "differential": DifferentialDrive(),
        "car": CarDrive(turning_radius),
    }
    return drives[kind]


def wheel_travel(base: Array, gauge: float) -> Array:
    """Way of a differential drive's left and right wheel over each hop through base poses, (n - 1, 2) [m].

    Poses (n, 3) are x, y [m], yaw [rad]; ``gauge`` is the distance between the wheels [m].
    """
    slide, length = DifferentialDrive().parts(base[:-1], base[1:])
    turn = slide[:, 2] * gauge / 2
    return np.column_stack([length - turn, length + turn])


def displacement(here: Array, there: Array) -> Array:
    """Difference of poses (..., 3), turned the shorter way, half a turn to the left."""
    step = np.array(there - here)
    step[..., 2] -= 2 * np.pi * np.ceil((step[..., 2] - np.pi) / (2 * np.pi))
    return step


def unwrapped(base: Array) -> Array:
    """Poses (n, 3) whose headings run on from one to the next, the shorter way."""
    turns = (displacement(base[:-1], base[1:])[:, 2] - np.diff(base[:, 2])) / (2 * np.pi)
    whole = np.concatenate([[0.0], np.cumsum(np.round(turns))])
    return np.column_stack([base[:, :2], base[:, 2] + 2 * np.pi * whole])
