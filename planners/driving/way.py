"""The way of a base on wheels: lines, arcs and turns on the spot, exactly."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.driving.arcs import moved, wrapped
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

JOINED = 1e-9  # a part begins where the one before it ends, to rounding [m], [rad]
TURN_STEP = 0.1  # largest change of heading between two samples [rad]


@dataclass(frozen=True, eq=False)
class Line:
    """Straight along the heading.

    Attributes
    ----------
    start : (3,) array
        x, y [m], yaw [rad].
    length : float
        Below 0 in reverse [m].
    """

    start: Array
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "line: start"))

    @property
    def turn(self) -> float:
        return 0.0


@dataclass(frozen=True, eq=False)
class Arc:
    """Part of a circle, along the heading.

    Attributes
    ----------
    start : (3,) array
        x, y [m], yaw [rad].
    length : float
        Below 0 in reverse [m].
    turn : float
        Change of heading, above 0 to the left [rad].
    """

    start: Array
    length: float
    turn: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "arc: start"))
        if self.turn == 0 or self.length == 0:
            raise InputError(f"arc: expected a length and a turn, got {self.length} m and {self.turn} rad")

    @property
    def radius(self) -> float:
        """[m]"""
        return abs(self.length / self.turn)


@dataclass(frozen=True, eq=False)
class Turn:
    """On the spot.

    Attributes
    ----------
    start : (3,) array
        x, y [m], yaw [rad].
    turn : float
        Above 0 to the left [rad].
    """

    start: Array
    turn: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "turn: start"))

    @property
    def length(self) -> float:
        return 0.0


Segment = Line | Arc | Turn


def pose_on(segment: Segment, share: float) -> Array:
    """Pose at a share of a segment, (3,); the heading is not wrapped."""
    x, y, yaw = segment.start
    return np.array(moved(x, y, yaw, share * segment.length, share * segment.turn))


@dataclass(frozen=True, eq=False)
class Way:
    """How a base on wheels gets from one pose to another.

    Attributes
    ----------
    start : (3,) array
        x, y [m], yaw [rad].
    segments : tuple of Line, Arc or Turn
        Each begins where the one before it ends, to 1e-9; none at all where the base stays.
    method : str
        What found it: "still", "straight" (one direct motion), "steps", "triangles" or "ompl".
    """

    start: Array
    segments: tuple[Segment, ...]
    method: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "way: start"))
        here = self.start
        for k, segment in enumerate(self.segments):
            gap = segment.start - here
            if max(*np.abs(gap[:2]), abs(wrapped(gap[2]))) > JOINED:
                raise InputError(f"way: segment {k} begins at {segment.start}, {k - 1} ends at {here}")
            here = pose_on(segment, 1.0)

    @property
    def end(self) -> Array:
        """Last pose (3,), its heading not wrapped."""
        return pose_on(self.segments[-1], 1.0) if self.segments else self.start

    @property
    def length(self) -> float:
        """Distance driven, forwards and backwards [m]."""
        return float(sum(abs(segment.length) for segment in self.segments))

    @property
    def turning(self) -> float:
        """All changes of heading together [rad]."""
        return float(sum(abs(segment.turn) for segment in self.segments))

    @property
    def reversals(self) -> int:
        """How often the base changes between driving forwards and backwards."""
        signs = [segment.length > 0 for segment in self.segments if segment.length != 0]
        return sum(a != b for a, b in zip(signs[:-1], signs[1:], strict=True))

    def sample(self, step: float) -> Array:
        """Poses along the way, (n, 3): x, y [m], yaw [rad], headings running on without jumps.

        Neighbours are at most ``step`` [m] and 0.1 rad apart; both ends of every segment are among them.

        Examples
        --------
        >>> way = Way(np.zeros(3), (Line(np.zeros(3), 0.5), Turn(np.array([0.5, 0, 0]), 0.1)), "straight")
        >>> way.sample(0.25).tolist()
        [[0.0, 0.0, 0.0], [0.25, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.0, 0.1]]
        """
        if not 0 < step < np.inf:
            raise InputError(f"step: expected a length above 0, got {step}")
        poses = [self.start]
        for segment in self.segments:
            most = max(abs(segment.length) / step, abs(segment.turn) / TURN_STEP)
            parts = max(1, int(np.ceil(most - 1e-9)))
            poses += [pose_on(segment, k / parts) for k in range(1, parts + 1)]
        return frozen(poses, (None, 3), "way")


def way_of(start: ArrayLike, parts: Iterable[ArrayLike], method: str) -> Way:
    """A way from signed lengths and turns, driven one after another; those of nothing are left out."""
    here = first = frozen(start, (3,), "start")
    segments: list[Segment] = []
    for length, turn in np.asarray(list(parts), dtype=np.float64).reshape(-1, 2).tolist():
        if length == 0 and turn == 0:
            continue
        if turn == 0:
            segments.append(Line(here, length))
        elif length == 0:
            segments.append(Turn(here, turn))
        else:
            segments.append(Arc(here, length, turn))
        here = pose_on(segments[-1], 1.0)
    return Way(first, tuple(segments), method)
