"""Paths between poses for every kind of base: steering, RRTConnect and shortcuts.

Steering leads directly from pose to pose. A differential drive turns, drives straight and turns again; a
car drives a Reeds-Shepp curve; an omnidirectional base slides and turns on the way. A steered path is at most
five motions, each a signed length and a turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.driving.arcs import Segment, WheeledPath, arc_end, path_of_motions
from regionik.planners.driving.footprint import arc_is_free, fits, slide_is_free
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.planners.driving.options import DRIVING
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.reeds_shepp import MAX_MOTIONS, words_between
from regionik.planners.driving.sampling import BETTERING, PlanningProblem, connect_poses
from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, frozen
from regionik.worlds.drives import BasePlanner
from regionik.worlds.errors import InputError

SLIDE, SPIN, REEDS_SHEPP = range(3)
MAX_WORDS = 8  # of a car that are tried between two poses
NEGLIGIBLE = 1e-12  # shorter motions and smaller turns are none [m], [rad]
OPTIONS = DRIVING


class Steering(NamedTuple):
    """Steering of a base, as values for kernels."""

    # ``SLIDE`` in any direction, ``SPIN`` on the spot and drive straight, or ``REEDS_SHEPP`` curves
    kind: int
    radius: float  # turning radius of a car, 0 of others [m]
    weight: float  # cost of turning on the spot or while sliding, as a length [m/rad]


@compiled
def slide_cost(base: Steering, a: Array, b: Array) -> float:
    """Cost of the straight slide from a to b, free or not."""
    return float(np.hypot(b[0] - a[0], b[1] - a[1]) + base.weight * abs(wrap(b[2] - a[2])))


@compiled
def _path_is_free(scene: FootprintScene, a: Array, motions: Array) -> bool:
    """True if every motion of a path is free."""
    here = a.copy()
    for k in range(len(motions)):
        length, turn = motions[k]
        if length != 0.0 or turn != 0.0:
            if not arc_is_free(scene, here, length, turn):
                return False
            here[0], here[1], here[2] = arc_end(here[0], here[1], here[2], length, turn)
    return True


@compiled
def _spin(scene: FootprintScene, base: Steering, a: Array, b: Array, limit: float, motions: Array) -> float:
    """Cost of turn, drive, turn: nose first or tail first, whichever turns less and is free."""
    far: float = np.hypot(b[0] - a[0], b[1] - a[1])
    if far <= NEGLIGIBLE:
        motions[:] = 0.0
        motions[0, 1] = wrap(b[2] - a[2])
        cost = base.weight * abs(motions[0, 1])
        return cost if cost < limit and _path_is_free(scene, a, motions) else np.inf
    ahead = math.atan2(b[1] - a[1], b[0] - a[0])
    nose = abs(wrap(ahead - a[2])) + abs(wrap(b[2] - ahead))
    tail = abs(wrap(ahead + math.pi - a[2])) + abs(wrap(b[2] - ahead - math.pi))
    for back in (True, False) if tail < nose - NEGLIGIBLE else (False, True):
        cost = far + base.weight * (tail if back else nose)
        if cost >= limit:
            break
        heading = ahead + math.pi if back else ahead
        motions[:] = 0.0
        motions[0, 1], motions[1, 0] = wrap(heading - a[2]), -far if back else far
        motions[2, 1] = wrap(b[2] - heading)
        if _path_is_free(scene, a, motions):
            return cost
    return np.inf


@compiled
def steer(scene: FootprintScene, base: Steering, a: Array, b: Array, limit: float, motions: Array) -> float:
    """Cost of the cheapest free steered path between two poses, infinite where none is below a limit.

    Parameters
    ----------
    a, b : (3,) array
        x, y [m], yaw [rad].
    limit : float [m]
    motions : (5, 2) array
        Overwritten with the signed length [m] and turn [rad] of each motion; left alone by bases that slide.
    """
    if base.kind == SLIDE:
        cost = slide_cost(base, a, b)
        return cost if cost < limit and slide_is_free(scene, a, b) else np.inf
    if base.kind == SPIN:
        return _spin(scene, base, a, b, limit, motions)
    if np.hypot(b[0] - a[0], b[1] - a[1]) >= limit:
        return np.inf
    words, lengths = words_between(a, b, base.radius)
    for m in range(min(MAX_WORDS, len(words))):
        if lengths[m] >= limit:
            break
        if _path_is_free(scene, a, words[m]):
            motions[:] = words[m]
            return float(lengths[m])
    return np.inf


def direct(scene: FootprintScene, base: Steering, a: Array, b: Array) -> Array | None:
    """Motions (5, 2) of the cheapest free steered path; None where there is none."""
    motions = np.zeros((MAX_MOTIONS, 2))
    return motions if steer(scene, base, a, b, np.inf, motions) < np.inf else None


def plan_poses(
    scene: FootprintScene, base: Steering, start: Array, goal: Array, seed: int, planner: BasePlanner
) -> tuple[Array | None, float]:
    """Poses (k, 3) of the cheapest path from start to goal, each steered freely to the next, and its cost.

    The best of a few attempts, up to one that is hardly longer than if nothing were in the way; None where
    the first finds nothing.
    """
    best, least, enough = None, np.inf, OPTIONS.short_cost_ratio * _unhindered(base, start, goal)
    for poses in _attempts(scene, base, start, goal, seed, planner):
        kept, cost = shortcut(scene, base, poses)
        if cost < least:
            best, least = kept, cost
        if least <= enough:
            break
    return best, least


def _unhindered(base: Steering, a: Array, b: Array) -> float:
    """Cost of the shortest path of a car if nothing is in the way; 0 of another base."""
    return float(words_between(a, b, base.radius)[1][0]) if base.kind == REEDS_SHEPP else 0.0


def _attempts(
    scene: FootprintScene, base: Steering, start: Array, goal: Array, seed: int, planner: BasePlanner
) -> Iterator[Array]:
    """Paths of a sampling planner, up to the first attempt that finds none: the next would hardly do better.

    One that betters its own path is asked once.
    """
    motions = np.empty((MAX_MOTIONS, 2))
    problem = PlanningProblem(
        scene.vertices.min(axis=0),
        scene.vertices.max(axis=0),
        start,
        goal,
        lambda p: fits(scene, p[0], p[1], p[2]),
        lambda p, q: steer(scene, base, p, q, np.inf, motions) < np.inf,
        planner,
    )
    for k in range(1 if planner in BETTERING else OPTIONS.max_attempts):
        poses = connect_poses(
            problem,
            turning_radius=base.radius,
            seed=seed * OPTIONS.max_attempts + k,
            iterations=OPTIONS.max_iterations,
        )
        if poses is None:
            return
        yield poses


def shortcut(scene: FootprintScene, base: Steering, poses: Array) -> tuple[Array, float]:
    """Path with steered shortcuts in place of detours, and its cost; never dearer than before.

    First between the poses given, then between poses spread over the path that is left.
    """
    kept, costs = _cheapest(scene, base, poses)
    best, least = poses[kept], float(costs[-1])
    for count in OPTIONS.shortcut_poses:
        spread = _spread(scene, base, best, count)
        kept, costs = _cheapest(scene, base, spread)
        if float(costs[-1]) < least:
            best, least = spread[kept], float(costs[-1])
    return best, least


@compiled
def _cheapest(scene: FootprintScene, base: Steering, poses: Array) -> tuple[Index, Array]:
    """Indices of the poses of a path to keep for the cheapest steered path, and the cost up to each.

    By dynamic programming over all pairs; the cost is infinite where the path is not free.
    """
    n = len(poses)
    cost, before = np.full(n, np.inf), np.full(n, -1)
    cost[0] = 0.0
    motions = np.empty((MAX_MOTIONS, 2))
    for j in range(1, n):
        for i in range(j - 1, -1, -1):
            if cost[i] < cost[j]:
                new = cost[i] + steer(scene, base, poses[i], poses[j], cost[j] - cost[i], motions)
                if new < cost[j]:
                    cost[j], before[j] = new, i
    kept = np.empty(n, dtype=np.int64)
    count, k = 0, n - 1
    while k >= 0:
        kept[count] = k
        count, k = count + 1, before[k]
    kept = kept[:count][::-1].copy()
    return kept, cost[kept]


def _spread(scene: FootprintScene, base: Steering, poses: Array, count: int) -> Array:
    """The poses of a path, and about ``count`` more spread between them."""
    motions = np.zeros((MAX_MOTIONS, 2))
    pairs = list(zip(poses[:-1], poses[1:], strict=True))
    costs = [steer(scene, base, a, b, np.inf, motions) for a, b in pairs]
    rows = [poses[:1]]
    for (a, b), cost in zip(pairs, costs, strict=True):
        between = round(count * cost / sum(costs))
        rows += [_along(scene, base, a, b, np.arange(1, between + 1) / (between + 1)), b[None]]
    return np.concatenate(rows)


def _along(scene: FootprintScene, base: Steering, a: Array, b: Array, shares: Array) -> Array:
    """Poses at shares of the cost of the steered path between two poses."""
    if base.kind == SLIDE:
        change = np.array([b[0] - a[0], b[1] - a[1], wrap(b[2] - a[2])])
        slid: Array = a + shares[:, None] * change
        return slid
    motions = np.zeros((MAX_MOTIONS, 2))
    steer(scene, base, a, b, np.inf, motions)
    weight = np.where(motions[:, 0] == 0, base.weight, 0.0)
    costs = np.abs(motions[:, 0]) + weight * np.abs(motions[:, 1])
    ends = np.cumsum(costs)
    poses = []
    for at in shares * ends[-1]:
        x, y, yaw = a
        for (length, turn), end, cost in zip(motions, ends, costs, strict=True):
            part = 1.0 if end <= at else max(0.0, 1.0 - (end - at) / max(cost, NEGLIGIBLE))
            x, y, yaw = arc_end(x, y, yaw, part * length, part * turn)
        poses.append((x, y, yaw))
    return np.array(poses).reshape(-1, 3)


def pose_text(pose: Array) -> str:
    """A pose as messages name it.

    Examples
    --------
    >>> pose_text(np.array([1.0, 0.5, 1.57]))
    '(1.000, 0.500, 1.570 rad)'
    """
    return f"({pose[0]:z.3f}, {pose[1]:z.3f}, {pose[2]:z.3f} rad)"


def checked_ends(scene: FootprintScene, start: ArrayLike, goal: ArrayLike, seed: int) -> tuple[Array, Array]:
    """Both ends of a path as writable arrays (3,).

    Raises
    ------
    NoPathError
        When the footprint does not fit at start or goal.
    InputError
        When the seed is negative or a pose is not three numbers.
    """
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    a, b = np.array(frozen(start, (3,), "start")), np.array(frozen(goal, (3,), "goal"))
    for what, pose in (("start", a), ("goal", b)):
        if not fits(scene, *pose):
            raise NoPathError(f"{what} {pose_text(pose)}: the footprint does not fit there")
    return a, b


def same_pose(a: Array, b: Array) -> bool:
    """True if two poses (3,) are the same but for rounding."""
    return bool(np.hypot(*(b - a)[:2]) <= NEGLIGIBLE and abs(wrap(b[2] - a[2])) <= NEGLIGIBLE)


def drive_wheeled(
    scene: FootprintScene,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    turning_radius: float = 0.0,
    seed: int,
    planner: BasePlanner = "RRTConnect",
) -> WheeledPath:
    """Drive a base on wheels: a car along lines and arcs, forwards and backwards, others turn on the spot.

    Parameters
    ----------
    scene : FootprintScene
        The footprint's origin is the middle of the axle that does not steer.
    start, goal : (3,) array_like
        x, y [m], yaw [rad].
    turning_radius : float
        Of a car [m]; 0 for a base that turns on the spot and drives straight, backwards if that turns less.
    seed : int
        Of the sampling planner, 0 or above. Same input, same path.
    planner : str
        OMPL's name of it.

    Returns
    -------
    WheeledPath
        Each motion proven free; the shortest Reeds-Shepp curve of a car where that is free.

    Raises
    ------
    NoPathError
        When none was found, or the footprint does not fit at start or goal.
    InputError
        When the seed is negative or a pose is not three numbers.

    Examples
    --------
    >>> from shapely import box
    >>> from regionik.planners.driving.footprint_scene import footprint_scene
    >>> scene = footprint_scene([[-0.1, -0.1], [0.1, -0.1], [0, 0.1]], box(0, 0, 4, 4))
    >>> path = drive_wheeled(scene, [1, 1, 0], [2, 1, 1], seed=0)
    >>> [segment.kind for segment in path.segments], path.length, path.turning
    (['line', 'turn'], 1.0, 1.0)
    >>> round(drive_wheeled(scene, [1, 1, 0], [1, 1.5, 0], turning_radius=0.5, seed=0).length, 3)
    1.318
    """
    base = _wheels(turning_radius)
    a, b = checked_ends(scene, start, goal, seed)
    if same_pose(a, b):
        return WheeledPath(a, (), "still")
    if direct(scene, base, a, b) is not None:
        return _steered(scene, base, np.stack([a, b]), "straight")
    poses, _ = plan_poses(scene, base, a, b, seed, planner)
    if poses is None:
        kind = f"a turning radius of {base.radius:g} m" if base.radius else "turns on the spot"
        ends = f"from {pose_text(a)} to {pose_text(b)}"
        raise NoPathError(f"no way with {kind} {ends} was found in {OPTIONS.max_iterations} iterations")
    return _steered(scene, base, poses, "ompl")


def steered_path(scene: FootprintScene, a: Array, b: Array, *, turning_radius: float) -> WheeledPath | None:
    """Path that steering leads on from pose to pose; None where that is not free."""
    base = _wheels(turning_radius)
    if not all(fits(scene, *pose) for pose in (a, b)) or direct(scene, base, a, b) is None:
        return None
    return _steered(scene, base, np.stack([a, b]), "straight")


def _wheels(turning_radius: float) -> Steering:
    """Steering of a car, or where the radius is 0 of a base that turns on the spot."""
    car = Steering(REEDS_SHEPP, float(turning_radius), 0.0)
    return car if turning_radius else Steering(SPIN, 0.0, OPTIONS.turn_weight)


def _steered(scene: FootprintScene, base: Steering, poses: Array, method: str) -> WheeledPath:
    """Path steered from pose to pose; each part begins at its pose, so that rounding does not add up."""
    segments: list[Segment] = []
    for p, q in zip(poses[:-1], poses[1:], strict=True):
        motions = direct(scene, base, p, q)
        segments += path_of_motions(p, [] if motions is None else motions, method).segments
    return WheeledPath(poses[0], tuple(segments), method)
