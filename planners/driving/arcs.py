"""Motions of a base on wheels: lines, arcs, turns on the spot, and paths made of them.

A motion keeps its speed and its rate of turn: it goes ``length`` [m] along its own heading (below 0 in
reverse) while it turns by ``turn`` [rad]. That is an arc of radius ``length / turn`` with its centre on the
left, a straight line where ``turn`` is 0, a turn on the spot where ``length`` is 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

JOIN_TOLERANCE = 1e-9  # a segment begins where the one before it ends, to rounding [m], [rad]
MAX_TURN_STEP = 0.1  # largest change of heading between two samples [rad]


@compiled
def arc_end(x: float, y: float, yaw: float, length: float, turn: float) -> tuple[float, float, float]:
    """Pose at the end of a motion; the heading is not wrapped.

    The chord of an arc has length L sin(T / 2) / (T / 2) and the heading in the middle of the turn,
    yaw + T / 2 (exact integration of the unicycle model).

    Examples
    --------
    >>> [round(value, 6) for value in arc_end(0.0, 0.0, 0.0, 3.141592653589793, 3.141592653589793)]
    [0.0, 2.0, 3.141593]
    """
    half = 0.5 * turn
    # sin(h) / h, by its series where the quotient would be 0 / 0.
    chord = length * (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    return x + chord * math.cos(yaw + half), y + chord * math.sin(yaw + half), yaw + turn


@compiled
def arc_towards(
    x: float, y: float, yaw: float, to_x: float, to_y: float, turn: float
) -> tuple[float, float, float]:
    """Length of the motion of a given turn that gets nearest to a point, and its miss in x and y [m].

    The inverse of `arc_end`: no wheel rolls the part of the way that lies across the chord.

    Examples
    --------
    >>> length, *missed = arc_towards(0.0, 0.0, 0.0, 0.0, 2.0, 3.141592653589793)
    >>> round(length, 6), [abs(round(value, 6)) for value in missed]
    (3.141593, [0.0, 0.0])
    """
    half = 0.5 * turn
    c, s = math.cos(yaw + half), math.sin(yaw + half)
    chord, aside = c * (to_x - x) + s * (to_y - y), c * (to_y - y) - s * (to_x - x)
    length = chord / (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    return length, -s * aside, c * aside


@dataclass(frozen=True, eq=False)
class Segment:
    """Line, arc or turn on the spot."""

    start: Array  # (3,) x, y [m], yaw [rad]
    length: float  # along the heading, below 0 in reverse [m]
    turn: float  # change of heading, above 0 to the left [rad]

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "segment: start"))

    @property
    def kind(self) -> Literal["line", "arc", "turn"]:
        """Shape on the floor."""
        if self.turn == 0:
            return "line"
        return "arc" if self.length != 0 else "turn"

    def pose(self, share: float) -> Array:
        """Pose (3,) at a share of the segment, 0 to 1; the heading is not wrapped.

        Examples
        --------
        >>> Segment(np.zeros(3), np.pi, np.pi).pose(0.5).round(3).tolist()
        [1.0, 1.0, 1.571]
        """
        x, y, yaw = self.start
        return np.array(arc_end(x, y, yaw, share * self.length, share * self.turn))


@dataclass(frozen=True, eq=False)
class WheeledPath:
    """Path of a base on wheels."""

    start: Array  # (3,) x, y [m], yaw [rad]
    # each begins where the one before it ends, to 1e-9; empty where the base stays
    segments: tuple[Segment, ...]
    method: str  # {"still", "straight", "ompl"} what found it; "straight" is one direct motion

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "path: start"))
        here = self.start
        for k, segment in enumerate(self.segments):
            gap = segment.start - here
            if max(*np.abs(gap[:2]), abs(wrap(gap[2]))) > JOIN_TOLERANCE:
                raise InputError(f"path: segment {k} begins at {segment.start}, {k - 1} ends at {here}")
            here = segment.pose(1.0)

    @property
    def end(self) -> Array:
        """Last pose (3,), its heading not wrapped."""
        return self.segments[-1].pose(1.0) if self.segments else self.start

    @property
    def length(self) -> float:
        """Distance driven, forwards and backwards [m]."""
        return float(sum(abs(segment.length) for segment in self.segments))

    @property
    def turning(self) -> float:
        """Sum of all changes of heading, left and right [rad]."""
        return float(sum(abs(segment.turn) for segment in self.segments))

    def sample(self, step: float) -> Array:
        """Poses along the path, (n, 3): x, y [m], yaw [rad], headings continuous.

        Neighbours are at most ``step`` [m] and 0.1 rad apart; both ends of every segment are among them.

        Examples
        --------
        >>> path_of_motions([0, 0, 0], [(0.5, 0), (0, 0.1)], "straight").sample(0.25).tolist()
        [[0.0, 0.0, 0.0], [0.25, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.0, 0.1]]
        """
        poses = [self.start]
        for segment in self.segments:
            most = max(abs(segment.length) / step, abs(segment.turn) / MAX_TURN_STEP)
            count = max(1, int(np.ceil(most - 1e-9)))
            poses += [segment.pose(k / count) for k in range(1, count + 1)]
        return frozen(poses, (None, 3), "path")


def path_of_motions(start: ArrayLike, motions: Iterable[ArrayLike], method: str) -> WheeledPath:
    """Path of signed lengths [m] and turns [rad], driven one after another; pairs of zeros are left out."""
    here = first = frozen(start, (3,), "start")
    segments: list[Segment] = []
    for length, turn in np.asarray(list(motions), dtype=np.float64).reshape(-1, 2).tolist():
        if length != 0 or turn != 0:
            segments.append(Segment(here, length, turn))
            here = segments[-1].pose(1.0)
    return WheeledPath(first, tuple(segments), method)
