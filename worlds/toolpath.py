"""Tool paths: set-points along lines, waves and arcs.

Generated points are rounded to a picometre, and turns alike, so that machines whose sine differs in the last
bit agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target

_DECIMALS = 12


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Points of the tool, with a direction or an orientation at each, or with neither.

    Attributes
    ----------
    points : (n, 3) array
        [m]
    directions : (n, 3) array or None
        Tool axes.
    orientations : (n, 3, 3) array or None
        Rotations of the tool frame.
    """

    points: Array
    directions: Array | None = None
    orientations: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.points)
        object.__setattr__(self, "points", frozen(self.points, (None, 3), "points"))
        if self.directions is not None:
            object.__setattr__(self, "directions", frozen(self.directions, (n, 3), "directions"))
        if self.orientations is not None:
            object.__setattr__(self, "orientations", frozen(self.orientations, (n, 3, 3), "orientations"))


def line(start: ArrayLike, end: ArrayLike, count: int) -> Array:
    """Points from ``start`` to ``end``, both included, evenly spaced, (count, 3) [m].

    >>> line([0, 0, 0.2], [1, 0, 0.2], 3)[:, 0].tolist()
    [0.0, 0.5, 1.0]
    """
    p, q = _ends(start, end, count)
    return _sampled(count, lambda s: [a + (b - a) * s for a, b in zip(p, q, strict=True)])


def sine(
    start: ArrayLike,
    end: ArrayLike,
    amplitude: float,
    periods: float,
    count: int,
    phase: float = 0.0,
    axis: ArrayLike | None = None,
) -> Array:
    """A line with a sine wave across it, (count, 3) [m].

    Parameters
    ----------
    start, end : (3,) array_like
        Ends of the line [m].
    amplitude : float
        [m]
    periods : float
        Waves between start and end.
    count : int
        Points, both ends included.
    phase : float
        Of the wave at the start [rad].
    axis : (3,) array_like, optional
        Direction of the wave; by default the horizontal one to the left of the line.
    """
    p, q = _ends(start, end, count)
    across = _left_of(p, q) if axis is None else _unit(axis, "axis")

    def point(s: float) -> list[float]:
        lift = amplitude * math.sin(2 * math.pi * periods * s + phase)
        return [a + (b - a) * s + lift * c for a, b, c in zip(p, q, across, strict=True)]

    return _sampled(count, point)


def arc(center: ArrayLike, radius: float, start: float, end: float, count: int, rise: float = 0.0) -> Array:
    """Points on a circle about z from angle ``start`` to ``end`` [rad], (count, 3) [m].

    It is level, or climbs evenly by ``rise`` [m] from its centre's height.
    """
    x, y, z = _numbers(center, "center")
    if count < 2:
        raise InputError(f"count: must be at least 2, got {count}")
    if not 0 < radius < math.inf:
        raise InputError(f"radius: must be above 0, got {radius:g}")
    if start == end:
        raise InputError("from and to must differ")

    def point(s: float) -> list[float]:
        angle = start + (end - start) * s
        return [x + radius * math.cos(angle), y + radius * math.sin(angle), z + rise * s]

    return _sampled(count, point)


def following(path: ToolPath, start: float, end: float) -> ToolPath:
    """A tool that turns with its arc: as it is at angle 0, turned about z by the angle of each point."""
    n = len(path.points)
    angles = [start + (end - start) * k / (n - 1) for k in range(n)]
    turns = np.array(
        [
            [
                [_even(math.cos(a)), _even(-math.sin(a)), 0.0],
                [_even(math.sin(a)), _even(math.cos(a)), 0.0],
                [0, 0, 1],
            ]
            for a in angles
        ]
    )
    directions = None if path.directions is None else (turns @ path.directions[:, :, None])[:, :, 0]
    orientations = None if path.orientations is None else turns @ path.orientations
    return ToolPath(path.points, directions, orientations)


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation matrix of a unit quaternion x, y, z, w, (3, 3)."""
    values = frozen(quaternion, (4,), "quaternion")
    norm = float(np.linalg.norm(values))
    if abs(norm - 1.0) > 1e-3:
        raise InputError(f"expected a unit quaternion x, y, z, w, got length {norm:g}")
    x, y, z, w = values / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def moved(path: ToolPath, T_world_path: Array, scale: float) -> ToolPath:
    """The path scaled, then placed in the world by a (4, 4) transform."""
    R, p = T_world_path[:3, :3], T_world_path[:3, 3]
    directions = None if path.directions is None else path.directions @ R.T
    orientations = None if path.orientations is None else R @ path.orientations
    return ToolPath(path.points * scale @ R.T + p, directions, orientations)


def targets_along(path: ToolPath, cone: float) -> tuple[Target, ...]:
    """One target a point."""
    n = len(path.points)
    directions: Sequence[Array | None] = [None] * n if path.directions is None else list(path.directions)
    turns: Sequence[Array | None] = [None] * n if path.orientations is None else list(path.orientations)
    if path.orientations is not None:
        directions = [None] * n  # the orientation carries it
    return tuple(
        Target(point, direction, cone, turn)
        for point, direction, turn in zip(path.points, directions, turns, strict=True)
    )


def _sampled(count: int, point: Callable[[float], list[float]]) -> Array:
    # Scalars through math, not arrays through numpy: its vector sine varies with the processor.
    rows = [[_even(value) for value in point(k / (count - 1))] for k in range(count)]
    return frozen(rows, (count, 3), "points")


def _even(value: float) -> float:
    return round(value, _DECIMALS) + 0.0


def _ends(start: ArrayLike, end: ArrayLike, count: int) -> tuple[list[float], list[float]]:
    if count < 2:
        raise InputError(f"count: must be at least 2, got {count}")
    p, q = _numbers(start, "from"), _numbers(end, "to")
    if p == q:
        raise InputError("from and to must differ")
    return p, q


def _left_of(p: list[float], q: list[float]) -> list[float]:
    dx, dy = q[0] - p[0], q[1] - p[1]
    length = math.hypot(dx, dy)
    if length < 1e-9:
        raise InputError("axis: expected a direction [x, y, z], as the line is vertical")
    return [-dy / length, dx / length, 0.0]


def _unit(vector: ArrayLike, what: str) -> list[float]:
    values = _numbers(vector, what)
    length = math.sqrt(sum(value * value for value in values))
    if length < 1e-9:
        raise InputError(f"{what}: must not be zero")
    return [value / length for value in values]


def _numbers(vector: ArrayLike, what: str) -> list[float]:
    return [float(value) for value in frozen(vector, (3,), what)]
