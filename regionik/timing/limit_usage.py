"""How much of its limits a timed motion uses, piece by piece, however long it takes.

Between two knots all rates are smooth: the path is a cubic and its acceleration constant, or coordinates are
cubics of time. So the largest share of a limit on a piece is found from a few, and the tops of the parabolas
through the largest of these and those beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from regionik.timing.limits import ROOTS, MotionLimits, tool_velocity
from regionik.timing.options import TIMING
from regionik.timing.trajectory import Trajectory, TrajectorySample, trajectory_within
from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.errors import InputError

OPTIONS = TIMING.figures

# Of each piece, that are looked at: at its very end the next one begins.
SHARES = np.append((1 - np.cos(np.pi * np.arange(12) / 12)) / 2, 1 - 1e-6)
AT_REST = 1e-6  # tool speed below which the tool stays at a set-point [m/s]


@dataclass(frozen=True, eq=False)
class MotionPieces:
    """Pieces of a timed motion on which all rates are smooth."""

    limits: MotionLimits
    trajectory: Trajectory
    start: Array  # (p,) [s]
    span: Array  # (p,) [s]
    segment: Index  # (p,) between states, that each is on
    tool_speed: Array  # (p,) greatest of the tool, infinite for none [m/s]

    def take(self, some: Index | Mask) -> MotionPieces:
        """Some of the pieces."""
        columns = {key: getattr(self, key)[some] for key in ("start", "span", "segment", "tool_speed")}
        return replace(self, **columns)

    def sample(self, share: Array) -> TrajectorySample:
        """The motion at shares (k, p) of the pieces, row by row, at k p instants."""
        times = self.start + share * self.span
        return self.trajectory.sample(np.clip(times.ravel(), 0.0, self.trajectory.duration))

    def usage(self, share: Array) -> dict[str, Array]:
        """Share of each limit that is used at shares (k, p) of the pieces, (k, p) each."""
        sample = self.sample(share)
        used = self.limits.usage(*sample.columns, np.tile(self.tool_speed, len(share)), sample.jerk)
        return {name: value.reshape(share.shape) for name, value in used.items()}

    def largest_usage(self) -> dict[str, Array]:
        """Largest share of each limit that is used on each piece, (p,) each."""
        looks = np.repeat(SHARES[:, None], len(self.start), axis=1)
        used = self.usage(looks)
        y = np.stack(list(used.values()), axis=1)  # (k, limits, p)
        x = np.broadcast_to(looks[:, None], y.shape)
        x, y = _about_largest(x, y)
        for _ in range(OPTIONS.max_parabolas):
            top = _top(x, y)
            again = self.usage(top).values()
            value = np.stack([one[k] for k, one in enumerate(again)])
            x, y = np.concatenate([x, top[None]]), np.concatenate([y, value[None]])
            order = np.argsort(x, axis=0, kind="stable")
            x, y = (np.take_along_axis(one, order, axis=0) for one in (x, y))
            x, y = _about_largest(x, y)
        return dict(zip(used, y.max(axis=0), strict=True))


def motion_pieces(limits: MotionLimits, motion: Motion) -> Iterator[MotionPieces]:
    """Pieces of a timed motion that take time, some at a time; of a single state, its instant."""
    trajectory = trajectory_within(limits.robot, motion, limits.speeds)
    if len(motion) == 1:
        alone = np.zeros(1, dtype=np.intp)
        yield MotionPieces(limits, trajectory, np.zeros(1), np.zeros(1), alone, np.full(1, np.inf))
        return
    time, segment = trajectory.knots
    span = np.diff(time)
    lasting = np.flatnonzero(span > 0)
    every = MotionPieces(limits, trajectory, time[:-1], span, segment, limits.tool_speeds(motion)[segment])
    for some in np.array_split(lasting, 1 + len(lasting) // OPTIONS.pieces_at_once):
        yield every.take(some)


def largest_usage(limits: MotionLimits, motion: Motion) -> dict[str, Array]:
    """Largest share of each limit that a timed motion uses on each of its segments, (n - 1,) each."""
    found = dict[str, Array]()
    for pieces in motion_pieces(limits, motion):
        for name, value in pieces.largest_usage().items():
            most = found.setdefault(name, np.zeros(max(len(motion) - 1, 1)))
            np.maximum.at(most, pieces.segment, value)
    return found


def slowdowns(limits: MotionLimits, motion: Motion) -> Array:
    """Factors by which each segment of a motion must be slower to keep all limits, (n - 1,)."""
    used = largest_usage(limits, motion)
    return np.max([share ** ROOTS[name.rpartition("_")[2]] for name, share in used.items()], axis=0)


def check_tool_speed(limits: MotionLimits, motion: Motion) -> None:
    """Refuse a tool speed that joints or base cannot give the tool somewhere on the path.

    Raises
    ------
    InputError
        With the joint, its speed and the time in the motion at hand.
    """
    if not np.isfinite(limits.tool_speeds(motion)).any() and limits.speeds.tool_velocity is None:
        raise InputError("hold: expected a tool speed to hold; give tool_velocity, or speeds in the task")
    for every in motion_pieces(limits, motion):
        pieces = every.take(np.isfinite(every.tool_speed))
        asked = np.tile(pieces.tool_speed, len(SHARES))
        sample = pieces.sample(np.repeat(SHARES[:, None], len(pieces.start), axis=1))
        q, velocity, _ = sample.columns
        speed = np.linalg.norm(tool_velocity(limits.robot, q, velocity), axis=1)
        moves = speed > AT_REST
        if not moves.any():
            continue
        wanted = velocity[moves] * (asked[moves] / speed[moves])[:, None]
        name, value, limit, k = limits.fastest_coordinate(wanted)
        if value > limit * (1 + 1e-9):
            raise InputError(
                f"tool_velocity: {asked[moves][k]:g} m/s cannot be held at t = "
                f"{sample.time[moves][k]:.3f} s: {name} would go at {value:.3g}, its limit is {limit:.3g}"
            )


def _about_largest(x: Array, y: Array) -> tuple[Array, Array]:
    """Largest of values y (k, ...) at ascending x, but for both ends, between those beside it; (3, ...)."""
    middle = np.clip(np.argmax(y, axis=0), 1, len(y) - 2)
    rows = np.stack([middle - 1, middle, middle + 1])
    return np.take_along_axis(x, rows, axis=0), np.take_along_axis(y, rows, axis=0)


def _top(x: Array, y: Array) -> Array:
    """Where the parabolas through three points (3, ...) are highest, the middle one where they are not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.diff(y, axis=0) / np.diff(x, axis=0)
        bend = (rise[1] - rise[0]) / (x[2] - x[0])
        top = (x[0] + x[1] - rise[0] / bend) / 2
    found: Array = np.where(np.isfinite(top) & (bend < 0), np.clip(top, x[0], x[2]), x[1])
    return found
