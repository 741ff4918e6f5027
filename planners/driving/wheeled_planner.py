"""Base motion on wheels between two poses: differential drives, and cars with a turning radius."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon

from regionik.planners.driving.arcs import Arc, Line, Segment, Turn, Way, way_of, wrapped
from regionik.planners.driving.footprint_scene import Room, bare_room, fits
from regionik.planners.driving.point_planner import NoPathError, drive
from regionik.planners.driving.pose_planner import ITERATIONS, direct, find
from regionik.planners.driving.steering import DUBINS, NOTHING, REEDS_SHEPP, SPIN, SPIN_AHEAD, Base
from regionik.planners.geometry.flat import clamp
from regionik.planners.geometry.pulling import tighten
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

__all__ = ["Arc", "Line", "Turn", "Way", "drive_car", "drive_differential"]

FAR = 1e3  # longer than any leg of a drive [m]
TURN_WEIGHT = 0.2  # what a turn on the spot costs against driving [m/rad]

Free: TypeAlias = Polygon | MultiPolygon | Room


def drive_differential(
    free: Free, start: ArrayLike, goal: ArrayLike, *, seed: int, reverse: bool = True
) -> Way:
    """Drive a base that turns on the spot: turns and straight lines.

    Parameters
    ----------
    free : Polygon, MultiPolygon or Room
        Where the base's reference point may be at every heading [m], or a footprint and what surrounds it.
    start, goal : (3,) array_like
        x, y [m], yaw [rad].
    seed : int
        Of the sampling planner, 0 or above. Same input, same way.
    reverse : bool
        Whether legs may be driven backwards where that turns less.

    Returns
    -------
    Way
        Segments `Line` and `Turn`. In a polygon every line lies inside to 1e-9 m; with a footprint every line
        and turn is proven free.

    Raises
    ------
    NoPathError
        In a polygon: there is none. With a footprint: none was found, or it does not fit at start or goal.
    InputError
        When the seed is negative or a pose is not three numbers.

    Examples
    --------
    >>> from shapely import box
    >>> way = drive_differential(box(0, 0, 2, 1), [0.5, 0.5, 0], [1.5, 0.5, 1], seed=0)
    >>> [type(part).__name__ for part in way.segments], way.length, way.turning
    (['Line', 'Turn'], 1.0, 1.0)
    """
    a, b = _ends(start, goal, seed)
    if isinstance(free, Room):
        return _planned(free, Base(SPIN if reverse else SPIN_AHEAD, 0.0, TURN_WEIGHT), a, b, seed)
    found = drive(free, a[:2], b[:2], step=FAR, seed=seed)
    points = np.array(tighten(free, found.points))
    points[0], points[-1] = a[:2], b[:2]
    parts, turned = _turns_and_lines(points, a[2], b[2], reverse)
    return way_of(a, parts, found.method if turned else "still")


def drive_car(
    free: Free,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    turning_radius: float,
    seed: int,
    reverse: bool = True,
) -> Way:
    """Drive a car: lines and arcs of its turning radius.

    Parameters
    ----------
    free : Polygon, MultiPolygon or Room
        Where the car's reference point may be at every heading [m], or a footprint and what surrounds it; its
        origin is the middle of the axle that does not steer.
    start, goal : (3,) array_like
        x, y [m], yaw [rad].
    turning_radius : float
        [m]
    seed : int
        Of the sampling planner, 0 or above. Same input, same way.
    reverse : bool
        With reversing the curves are those of Reeds and Shepp, without it those of Dubins.

    Returns
    -------
    Way
        Segments `Line` and `Arc`, the shortest curve where that is free. In a polygon every one lies inside
        to 1e-9 m, exactly; with a footprint every one is proven free.

    Raises
    ------
    NoPathError
        When none was found: start and goal do not join or do not fit, or the search gave up.
    InputError
        When the turning radius is not above 0, the seed is negative or a pose is not three numbers.

    Examples
    --------
    >>> from shapely import box
    >>> way = drive_car(box(0, 0, 4, 4), [1, 1, 0], [1, 1.5, 0], turning_radius=0.5, seed=0)
    >>> round(way.length, 3), way.reversals
    (1.318, 2)
    """
    if not 0 < turning_radius < np.inf:
        raise InputError(f"turning_radius: expected a length above 0, got {turning_radius}")
    a, b = _ends(start, goal, seed)
    base = Base(REEDS_SHEPP if reverse else DUBINS, float(turning_radius), 0.0)
    if isinstance(free, Room):
        return _planned(free, base, a, b, seed)
    room = bare_room(free)
    for pose in (a, b):
        pose[:2] = clamp(room.vertices, room.starts, *pose[:2]) if _near(room, pose) else pose[:2]
    parts = direct(room, base, a, b) if fits(room, *a) and fits(room, *b) else None
    if parts is None:
        # A point that may turn on the spot goes wherever a car does: where it cannot, it says why.
        drive(free, a[:2], b[:2], step=FAR, seed=seed)
    return _planned(room, base, a, b, seed)


def _near(room: Room, pose: Array) -> bool:
    """Whether a pose is on the floor to 1e-9 m."""
    gap = np.subtract(clamp(room.vertices, room.starts, *pose[:2]), pose[:2])
    return bool(np.hypot(*gap) <= 1e-9)


def _planned(room: Room, base: Base, a: Array, b: Array, seed: int) -> Way:
    """The direct motion, else what RRTConnect finds."""
    for what, pose in (("start", a), ("goal", b)):
        if not fits(room, *pose):
            raise NoPathError(f"{what} {_at(pose)}: the footprint does not fit there", a[:2], b[:2])
    if np.hypot(*(b - a)[:2]) <= NOTHING and abs(wrapped(b[2] - a[2])) <= NOTHING:
        return Way(a, (), "still")
    if direct(room, base, a, b) is not None:
        return _joined(room, base, np.stack([a, b]), "straight")
    poses, _ = find(room, base, a, b, seed)
    if poses is None:
        kind = f"a turning radius of {base.radius:g} m" if base.radius else "turns on the spot"
        tried = f"in {ITERATIONS} iterations"
        raise NoPathError(f"no way with {kind} from {_at(a)} to {_at(b)} was found {tried}", a[:2], b[:2])
    return _joined(room, base, poses, "ompl")


def _joined(room: Room, base: Base, poses: Array, method: str) -> Way:
    """The way along direct motions; each begins at its pose, so that rounding does not add up."""
    segments: list[Segment] = []
    for p, q in zip(poses[:-1], poses[1:], strict=True):
        parts = direct(room, base, p, q)
        segments += way_of(p, [] if parts is None else parts, method).segments
    return Way(poses[0], tuple(segments), method)


def _turns_and_lines(points: Array, first: float, last: float, reverse: bool) -> tuple[Array, bool]:
    """Parts (k, 2) along a polyline, legs driven so that all turning together is the least."""
    legs = np.diff(points, axis=0)
    lengths = np.hypot(*legs.T)
    legs, lengths = legs[lengths > NOTHING], lengths[lengths > NOTHING]
    ways = np.arctan2(legs[:, 1], legs[:, 0])[:, None] + ([0.0, np.pi] if reverse else [0.0])
    costs, heads, choices = np.zeros(1), np.array([first]), []
    for options in [*ways, np.array([last])]:
        turns = np.abs([[wrapped(to - here) for here in heads] for to in options])
        choices.append(np.argmin(turns + costs - 1e-12 * (np.arange(len(heads)) == 0), axis=1))
        costs, heads = (turns + costs).min(axis=1), options
    k, chosen = 0, []
    for choice in choices[::-1]:
        k = int(choice[k])
        chosen.append(k)
    sides = chosen[::-1][1:]
    parts, here = [], first
    for options, side, length in zip(ways, sides, lengths, strict=True):
        turn = wrapped(options[side] - here)
        parts += [[0.0, turn if abs(turn) > NOTHING else 0.0], [-length if side else length, 0.0]]
        here += parts[-2][1]
    turn = wrapped(last - here)
    parts.append([0.0, turn if abs(turn) > NOTHING else 0.0])
    return np.array(parts), bool(len(legs)) or parts[-1][1] != 0


def _ends(start: ArrayLike, goal: ArrayLike, seed: int) -> tuple[Array, Array]:
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    return np.array(frozen(start, (3,), "start")), np.array(frozen(goal, (3,), "goal"))


def _at(pose: Array) -> str:
    return f"({pose[0]:z.3f}, {pose[1]:z.3f}, {pose[2]:z.3f} rad)"
