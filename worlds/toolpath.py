"""Tool paths: points along lines, sine waves and arcs, with directions or orientations of the tool.

Generated points and rotations are rounded to 12 decimals, so that machines whose sine differs in the last bit
agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, Index, Mask, freeze, frozen, transform_points, unit_vector
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target
from regionik.worlds.strokes import within_strokes

_DECIMALS = 12
_LEAST_ACROSS = 1e-3  # part of a step across the tool's axis that gives its x axis a direction


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Points of the tool, each with a direction, with an orientation or with neither."""

    points: Array  # (n, 3) [m]
    directions: Array | None = None  # (n, 3) tool axes
    orientations: Array | None = None  # (n, 3, 3) rotations of the tool frame
    strokes: Index | None = None  # (n,) see `regionik.worlds.strokes`; None where the path tells none
    names: tuple[str, ...] = ()  # of the points, n; or none, where no point has one
    # (n,) greatest speeds on the way to points, infinite where none is told; None where the path tells none
    speeds: Array | None = None
    flows: Array | None = None  # (n,) material fed per metre on the way to points, 0 for none
    leads: Mask | None = None  # (n,) of points on the lead-in or lead-out of their stroke; None for no such

    def __post_init__(self) -> None:
        n = len(self.points)
        freeze(self, "tool path", points=(None, 3))
        if self.directions is not None:
            freeze(self, "tool path", directions=(n, 3))
        if self.orientations is not None:
            freeze(self, "tool path", orientations=(n, 3, 3))
        if self.names and len(self.names) != n:
            raise InputError(f"names: expected one for each of {n} points, got {len(self.names)}")


def line(start: ArrayLike, end: ArrayLike, count: int) -> Array:
    """Return points from ``start`` to ``end``, both included, evenly spaced, (count, 3) [m].

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
    """Return points on a line with a sine wave across it, (count, 3) [m].

    The wave has an amplitude [m], a number of periods between start and end, and a phase at the start [rad];
    it lies along an ``axis`` (3,), by default the horizontal one to the left of the line.
    """
    p, q = _ends(start, end, count)
    across = _left_of(p, q) if axis is None else unit_vector(axis, "axis").tolist()

    def point(s: float) -> list[float]:
        lift = amplitude * math.sin(2 * math.pi * periods * s + phase)
        return [a + (b - a) * s + lift * c for a, b, c in zip(p, q, across, strict=True)]

    return _sampled(count, point)


def arc(center: ArrayLike, radius: float, start: float, end: float, count: int, rise: float = 0.0) -> Array:
    """Return points on a circle about z from angle ``start`` to ``end`` [rad], (count, 3) [m].

    They are level, or climb evenly by ``rise`` [m] from the centre's height.
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


def divided_strokes(path: ToolPath, spacing: float) -> ToolPath:
    """Return a path of points alone with more of them on strokes, none farther apart than ``spacing`` [m].

    >>> path = ToolPath(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), strokes=np.array([1, 1, 0]))
    >>> divided_strokes(path, 0.5).points[:, 0].tolist()
    [0.0, 0.5, 1.0, 2.0]
    """
    if path.strokes is None:
        return path
    ways = np.append(np.diff(path.points, axis=0), np.zeros((1, 3)), axis=0)
    works = np.append(within_strokes(path.strokes.tolist())[1:], False)
    wanted = np.ceil(np.linalg.norm(ways, axis=1) / spacing - 1e-9)
    count = np.where(works, np.maximum(wanted, 1), 1).astype(int)
    k = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(k)) - (np.cumsum(count) - count)[k]) / count[k]
    points = np.round(path.points[k] + share[:, None] * ways[k], _DECIMALS) + 0.0
    leads_to = k + (share > 0)
    speeds, flows = (None if told is None else told[leads_to] for told in (path.speeds, path.flows))
    return replace(path, points=points, strokes=path.strokes[k], speeds=speeds, flows=flows)


def with_leads(
    path: ToolPath, heights: tuple[float, float], speeds: tuple[float, float] = (math.inf, math.inf)
) -> ToolPath:
    """Return a path with a point before each stroke and one after it, at heights along the tool's axis [m].

    Heights of approach and departure are 0 for none, speeds are the greatest on these ways [m/s]. A path that
    tells no strokes is one.

    Raises
    ------
    InputError
        Where the tool's axis is not given.

    Examples
    --------
    >>> down = ToolPath(line([0, 0, 0], [1, 0, 0], 2), directions=[[0, 0, -1], [0, 0, -1]])
    >>> with_leads(down, (0.1, 0.2)).points[:, 2].tolist()
    [0.1, 0.0, 0.0, 0.2]
    """
    axes = path.directions if path.orientations is None else path.orientations[:, :, 2]
    if axes is None:
        raise InputError("approach, departure: need the tool's axis, by direction or orientation")
    n = len(path.points)
    strokes = np.ones(n, dtype=np.int64) if path.strokes is None else path.strokes
    within = within_strokes(strokes.tolist())
    ends = ~within, ~np.append(within[1:], False)
    first, last = (
        np.flatnonzero((strokes > 0) & end) if height else np.empty(0, dtype=np.int64)
        for end, height in zip(ends, heights, strict=True)
    )
    order = np.argsort(np.concatenate([first - 0.25, np.arange(n), last + 0.25]))
    own = np.concatenate([first, np.arange(n), last])[order]

    def beside(before: float, values: Array, after: float) -> Array:
        return np.concatenate([np.full(len(first), before), values, np.full(len(last), after)])[order]

    high = beside(heights[0], np.zeros(n), heights[1])
    told = np.full(n, math.inf) if path.speeds is None else path.speeds.copy()
    told[first] = speeds[0]
    told = beside(math.inf, told, speeds[1])
    back = high[:, None] * axes[own] / np.linalg.norm(axes[own], axis=1, keepdims=True)
    leads, names = high > 0, path.names
    return ToolPath(
        np.round(path.points[own] - back, _DECIMALS) + 0.0,
        None if path.directions is None else path.directions[own],
        None if path.orientations is None else path.orientations[own],
        strokes[own],
        tuple("" if lead else names[k] for k, lead in zip(own, leads, strict=True)) if names else (),
        told if np.isfinite(told).any() else None,
        None if path.flows is None else beside(0.0, path.flows, 0.0),
        leads if path.leads is None else leads | path.leads[own],
    )


def turn_with_arc(path: ToolPath, start: float, end: float) -> ToolPath:
    """Return a path whose tool, given at angle 0, turns about z by the angle of each point on its arc."""
    n = len(path.points)
    angles = [start + (end - start) * k / (n - 1) for k in range(n)]
    sines, cosines = (np.array([_rounded(f(a)) for a in angles]) for f in (math.sin, math.cos))
    turns = np.zeros((n, 3, 3))
    turns[:, 0, 0], turns[:, 0, 1], turns[:, 1, 0], turns[:, 1, 1] = cosines, 0.0 - sines, sines, cosines
    turns[:, 2, 2] = 1.0
    directions = None if path.directions is None else (turns @ path.directions[:, :, None])[:, :, 0]
    orientations = None if path.orientations is None else turns @ path.orientations
    return replace(path, directions=directions, orientations=orientations)


def turn_along_path(path: ToolPath) -> ToolPath:
    """Return a path whose tool, its axis given, has its x axis along the path, square to that axis.

    At a point in between that is along the line through its neighbours.

    Raises
    ------
    InputError
        Where the tool's axis is not given, or there is no such line or it lies along that axis.

    Examples
    --------
    >>> flat = ToolPath(line([0, 0, 0], [0, 1, 0], 2), directions=[[0, 0, -1], [0, 0, -1]])
    >>> (turn_along_path(flat).orientations[0] + 0.0).tolist()
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    """
    if path.directions is None:
        raise InputError("x_axis: along_path needs the tool's axis, by directions or normals, and no more")
    n = len(path.points)
    before, after = np.maximum(np.arange(n) - 1, 0), np.minimum(np.arange(n) + 1, n - 1)
    z = path.directions / np.linalg.norm(path.directions, axis=1, keepdims=True)
    ways = path.points[after] - path.points[before]
    x = ways - np.einsum("ij,ij->i", ways, z)[:, None] * z
    lengths = np.linalg.norm(x, axis=1)
    lost = np.flatnonzero(lengths <= _LEAST_ACROSS * np.maximum(np.linalg.norm(ways, axis=1), 1e-9))
    if len(lost):
        text = "the path stands still or goes along the tool's axis there, which leaves its x axis open"
        raise InputError(f"x_axis: along_path: point {lost[0] + 1} of {n}: {text}")
    x /= lengths[:, None]
    return replace(path, directions=None, orientations=np.stack([x, np.cross(z, x), z], axis=2))


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion x, y, z, w."""
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


def transform_path(path: ToolPath, T_world_path: Array) -> ToolPath:
    """Return the path moved into the world by a (4, 4) transform."""
    R = T_world_path[:3, :3]
    directions = None if path.directions is None else path.directions @ R.T
    orientations = None if path.orientations is None else R @ path.orientations
    points = transform_points(T_world_path, path.points)
    return replace(path, points=points, directions=directions, orientations=orientations)


def targets_along(path: ToolPath, cone: float) -> tuple[Target, ...]:
    """Return one target a point."""
    free = [None] * len(path.points)
    directions = free if path.directions is None else path.directions
    orientations = free if path.orientations is None else path.orientations
    names = path.names or [""] * len(path.points)
    strokes = free if path.strokes is None else path.strokes.tolist()
    speeds = (
        free if path.speeds is None else [one if one < math.inf else None for one in path.speeds.tolist()]
    )
    flows = free if path.flows is None else path.flows.tolist()
    leads = [False] * len(path.points) if path.leads is None else path.leads.tolist()
    columns = zip(path.points, directions, orientations, names, strokes, speeds, flows, leads, strict=True)
    return tuple(Target(point, aim, cone, *others) for point, aim, *others in columns)


def _sampled(count: int, point: Callable[[float], list[float]]) -> Array:
    # By math, number by number: numpy's vector sine varies with the processor.
    rows = [[_rounded(value) for value in point(k / (count - 1))] for k in range(count)]
    return frozen(rows, (count, 3), "points")


def _rounded(value: float) -> float:
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


def _numbers(vector: ArrayLike, what: str) -> list[float]:
    return [float(value) for value in frozen(vector, (3,), what)]
