"""Motions of constant speed and turn, exactly: where they lead, and whether they stay inside a polygon.

A motion goes ``length`` [m] along its own heading (below 0 in reverse) while it turns by ``turn`` [rad]: an
arc of radius ``length / turn`` with its centre on the left, a straight line where ``turn`` is 0, a turn on
the spot where ``length`` is 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.geometry.flat import (
    DEPTH,
    Index,
    compiled,
    contains,
    insert,
    near_boundary,
    segment_inside,
)
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

STRAIGHT = 1e-10  # an arc that bulges less than this is its chord [m]


@compiled
def moved(x: float, y: float, yaw: float, length: float, turn: float) -> tuple[float, float, float]:
    """Pose at the end of a motion; the heading is not wrapped.

    Examples
    --------
    >>> [round(value, 6) for value in moved(0.0, 0.0, 0.0, 3.141592653589793, 3.141592653589793)]
    [0.0, 2.0, 3.141593]
    """
    half = 0.5 * turn
    # sin(h) / h, by its series where the quotient would be 0 / 0.
    chord = length * (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    return x + chord * math.cos(yaw + half), y + chord * math.sin(yaw + half), yaw + turn


@compiled
def rolling(
    x: float, y: float, yaw: float, to_x: float, to_y: float, turn: float
) -> tuple[float, float, float]:
    """Length of the motion of a given turn that leads to a place, and what it misses it by, x and y [m].

    The chord lies along the heading in the middle of the turn; what lies across it cannot be rolled.

    Examples
    --------
    >>> length, *missed = rolling(0.0, 0.0, 0.0, 0.0, 2.0, 3.141592653589793)
    >>> round(length, 6), [abs(round(value, 6)) for value in missed]
    (3.141593, [0.0, 0.0])
    """
    half = 0.5 * turn
    c, s = math.cos(yaw + half), math.sin(yaw + half)
    chord, aside = c * (to_x - x) + s * (to_y - y), c * (to_y - y) - s * (to_x - x)
    length = chord / (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    return length, -s * aside, c * aside


@compiled
def wrapped(angle: float) -> float:
    """The same angle from -pi up to pi."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@compiled
def _roots(a: float, b: float, c: float, out: Array) -> int:
    """Real roots of a t^2 + 2 b t + c, without loss where a is small; returns how many."""
    left = b * b - a * c
    if left < 0.0 or (a == 0.0 and b == 0.0):
        return 0
    q = -(b + math.copysign(math.sqrt(left), b))
    n = 0
    if q != 0.0:
        out[n] = c / q
        n += 1
    if a != 0.0:
        out[n] = q / a
        n += 1
    return n


@compiled
def _arc_cuts(
    vertices: Array, starts: Index, x: float, y: float, yaw: float, bend: float, left: float, turn: float
) -> Array:
    """Angles along an arc, sorted, at which edges meet it, and its two ends.

    Seen from the start, heading along X and curving to +Y, the circle is bend (X^2 + Y^2) = 2 Y: no centre
    that runs off to infinity where the arc is nearly straight.
    """
    cuts = np.empty(2 * len(vertices) + 2)
    count = insert(cuts, insert(cuts, 0, 0.0), turn)
    c, s = math.cos(yaw), math.sin(yaw)
    roots = np.empty(2)
    for r in range(len(starts) - 1):
        dx, dy = vertices[starts[r + 1] - 1, 0] - x, vertices[starts[r + 1] - 1, 1] - y
        px, py = c * dx + s * dy, left * (c * dy - s * dx)
        for k in range(starts[r], starts[r + 1]):
            dx, dy = vertices[k, 0] - x, vertices[k, 1] - y
            qx, qy = c * dx + s * dy, left * (c * dy - s * dx)
            ex, ey = qx - px, qy - py
            square = ex * ex + ey * ey
            beyond = DEPTH / math.sqrt(square) if square > 0.0 else 0.0
            for i in range(
                _roots(
                    bend * square,
                    bend * (px * ex + py * ey) - ey,
                    bend * (px * px + py * py) - 2.0 * py,
                    roots,
                )
            ):
                t = roots[i]
                if -beyond <= t <= 1.0 + beyond:
                    angle = math.atan2(bend * (px + t * ex), 1.0 - bend * (py + t * ey)) % (2.0 * math.pi)
                    if angle < turn:
                        count = insert(cuts, count, angle)
            px, py = qx, qy
    return cuts[:count]


@compiled
def arc_inside(
    vertices: Array, starts: Index, x: float, y: float, yaw: float, length: float, turn: float
) -> bool:
    """Whether a whole motion stays in the closed polygon; turns of at most a full circle.

    Exact: the arc is cut where edges meet it, and each piece lies on one side. Touching is allowed; arcs that
    leave the polygon by more than 1e-9 m are refused, those within 0.5e-9 m of it are taken. Gaps between
    two edges that are less than 1e-9 m long along an arc are not seen.
    """
    if length < 0.0:  # the same arc, driven nose first by something that looks the other way
        length, yaw = -length, yaw + math.pi
    if 0.125 * length * abs(turn) < STRAIGHT:
        bx, by, _ = moved(x, y, yaw, length, turn)
        return segment_inside(vertices, starts, x, y, bx, by)
    left = 1.0 if turn > 0.0 else -1.0
    cuts = _arc_cuts(vertices, starts, x, y, yaw, abs(turn) / length, left, abs(turn))
    for k in range(len(cuts) - 1):
        if (cuts[k + 1] - cuts[k]) * length > DEPTH * abs(turn):
            share = 0.5 * (cuts[k] + cuts[k + 1]) / abs(turn)
            mx, my, _ = moved(x, y, yaw, share * length, share * turn)
            if not (contains(vertices, starts, mx, my) or near_boundary(vertices, starts, mx, my, DEPTH / 2)):
                return False
    return True


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
