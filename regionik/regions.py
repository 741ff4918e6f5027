"""Admissible areas: where the arm axis may stand for a target. Reach minus rejection.

Source: M-FABRIK (Santos et al., IEEE Access 2020), CreateAdmissibleArea in Algorithm 1; the reach here is
exact for joint limits and tool direction, gaps included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.ground import GUARD, Geometries, Ground, Side, ground_of, grow
from regionik.planners.rings import reach_intervals
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import CauseKind
from regionik.worlds.planar import PlanarArm, planar_arm
from regionik.worlds.scene import Target, World

ARC_POINTS = 64  # vertices of a full circle
FRONT, BACK = 1, -1


@dataclass(frozen=True)
class Family:
    """Postures of one kind for one target: how the arm's plane and last link lie.

    Attributes
    ----------
    facing : int
        `FRONT` where the target lies ahead in the arm's plane (r > 0), `BACK` where behind (r < 0).
    pitch : float
        Fixed angle of the last link in the plane [rad]; NaN where it is free.
    azimuth, half : float
        The plane may point within ``half`` of ``azimuth``, seen from above [rad].
    """

    facing: int
    pitch: float = np.nan
    azimuth: float = 0.0
    half: float = np.pi


@dataclass(frozen=True, eq=False)
class PathAreas:
    """Admissible inner areas of many targets, one row for each target, family and reach interval.

    Attributes
    ----------
    target : (m,) array of int
        Ascending.
    family : tuple of Family
        One for each row.
    reach, inner : (m,) array of geometry
        Before and after rejection.
    """

    target: NDArray[np.intp]
    family: tuple[Family, ...]
    reach: Geometries
    inner: Geometries


@dataclass(frozen=True, eq=False)
class TakenAway:
    """A part of the reach that is not admissible, and what took it."""

    kind: CauseKind
    name: str
    polygon: BaseGeometry


@dataclass(frozen=True, eq=False)
class Area:
    """Where the arm axis may stand for one target.

    Attributes
    ----------
    target : Target
    inner : geometry
        Every point of it truly works.
    outer : geometry
        No point outside it works; where it is empty the target is unreachable in the model.
    """

    target: Target
    inner: BaseGeometry
    outer: BaseGeometry
    world: World

    @property
    def polygon(self) -> BaseGeometry:
        """The inner area."""
        return self.inner

    @property
    def components(self) -> list[Polygon]:
        """Connected parts of the inner area, largest first."""
        parts = [part for part in shapely.get_parts(self.inner) if part.area > 0]
        return sorted(parts, key=lambda part: (-part.area, part.bounds))

    @property
    def gap(self) -> float:
        """Area between outer and inner [m2]: what is not decided."""
        return float(self.outer.area - self.inner.area)

    @cached_property
    def causes(self) -> tuple[TakenAway, ...]:
        """What took the rest of the stretched-arm disc away, each with name and polygon."""
        return what_took_away(self.world, self.target)

    @cached_property
    def clearance(self) -> float | None:
        """Largest clearance at which the area would not be empty [m]; None where not even 0 helps."""
        return largest_clearance(self.world, self.target)


def admissible_area(world: World, target: Target | ArrayLike) -> Area:
    """Where the arm axis may stand so that the tool reaches a target.

    Parameters
    ----------
    world : World
    target : Target or (3,) array_like
        A bare point leaves the tool direction free [m].

    Returns
    -------
    Area
        In floor coordinates [m].

    Raises
    ------
    InputError
        For a target that is not three finite numbers, or an arm that is not planar.
    """
    if not isinstance(target, Target):
        target = Target(frozen(target, (3,), "target"))
    ground = ground_of(world)
    sides = []
    for side, inner in ((ground.inner, True), (ground.outer, False)):
        _, _, rings = reach_rows(world, [target], (FRONT, BACK), inner=inner)
        sides.append(shapely.union_all(side.subtract(rings)) if len(rings) else Polygon())
    return Area(target, sides[0], sides[1], world)


def path_areas(
    world: World, targets: Sequence[Target] | None = None, facings: Sequence[int] = (FRONT, BACK)
) -> PathAreas:
    """Inner areas of a whole path at once.

    Parameters
    ----------
    world : World
    targets : sequence of Target, optional
        The world's task by default.
    facings : sequence of int
        Which of `FRONT` and `BACK` to take.
    """
    rows, families, reach = reach_rows(
        world, world.task if targets is None else targets, facings, inner=True
    )
    return PathAreas(rows, families, reach, ground_of(world).inner.subtract(reach))


def outer_areas(world: World, targets: Sequence[Target]) -> list[BaseGeometry]:
    """Outer area of each target: where it is empty, the target is provably unreachable."""
    rows, _, rings = reach_rows(world, targets, (FRONT, BACK), inner=False)
    left = ground_of(world).outer.subtract(rings)
    return [shapely.union_all(left[rows == i]) for i in range(len(targets))]


def families(world: World, target: Target, facings: Sequence[int], *, inner: bool) -> list[Family]:
    """Posture families that may reach a target.

    A given tool direction fixes the last link's pitch: with the plane along the direction seen from above,
    or against it. Inner areas hold the pitch itself and let the plane swing within the cone; outer areas
    let every pitch through and only bound the swing.
    """
    if target.direction is None:
        return [Family(facing) for facing in facings]
    x, y, z = target.direction
    flat = float(np.hypot(x, y))
    elevation = float(np.arctan2(z, flat))
    if inner:
        # cos(cone) = cos^2(elevation) cos(swing) + sin^2(elevation)
        swing = (np.cos(target.cone) - z * z) / max(flat * flat, 1e-300)
    else:
        # The cone's widest swing seen from above.
        swing = np.sqrt(max(0.0, 1.0 - (np.sin(min(target.cone, np.pi / 2)) / max(flat, 1e-300)) ** 2))
        swing = swing if target.cone < np.pi / 2 and np.sin(target.cone) < flat else -1.0
    half = float(np.arccos(np.clip(swing, -1.0, 1.0)))
    azimuth = float(np.arctan2(y, x)) if flat > 0 else 0.0
    along = Family(FRONT, elevation if inner else np.nan, azimuth, half)
    against = Family(FRONT, np.pi - elevation if inner else np.nan, azimuth + np.pi, half)
    kinds = [along] if inner and half >= np.pi else [along, against]
    return [Family(f, kind.pitch, kind.azimuth, kind.half) for f in facings for kind in kinds]


def reach_rows(
    world: World, targets: Sequence[Target], facings: Sequence[int], *, inner: bool
) -> tuple[NDArray[np.intp], tuple[Family, ...], Geometries]:
    """Reach of every target as rings and ring sectors, before rejection."""
    arm = planar_arm(world.robot.chain)
    margin = world.rules.reach_margin if inner else 0.0
    shoulder_z = float(arm.shoulder[1] + world.robot.mount[2])
    heights = np.array([target.position[2] for target in targets])
    kinds = [families(world, target, facings, inner=inner) for target in targets]
    intervals: dict[tuple[int, float], Array] = {}
    for pitch in {_key(family.pitch) for kind in kinds for family in kind}:
        rows = [i for i, kind in enumerate(kinds) if any(_key(f.pitch) == pitch for f in kind)]
        value = np.nan if pitch is None else pitch
        found = reach_intervals(arm, shoulder_z, heights[rows], value)
        intervals |= {(i, _token(pitch)): f for i, f in zip(rows, found, strict=True)}
    table: list[tuple[int, Family, float, float]] = []
    for i, kind in enumerate(kinds):
        for family in kind:
            for low, high in intervals[i, _token(_key(family.pitch))]:
                if (low + high) * family.facing > 0:
                    a, b = sorted((abs(low), abs(high)))
                    if b - a > 2 * margin:
                        table.append((i, family, a, b))
    spans = _headings(world, arm, [row[1] for row in table])
    flat = [(row, center, half) for row, span in zip(table, spans, strict=True) for center, half in span]
    positions = np.array([targets[row[0]].position[:2] for row, _, _ in flat]).reshape(-1, 2)
    rings = _ring_sectors(
        positions,
        np.array([row[2] for row, _, _ in flat]),
        np.array([row[3] for row, _, _ in flat]),
        np.array([center + (np.pi if row[1].facing == FRONT else 0.0) for row, center, _ in flat]),
        np.array([half for _, _, half in flat]),
        margin if inner else None,
    )
    rows = np.array([row[0] for row, _, _ in flat], dtype=np.intp)
    return rows, tuple(row[1] for row, _, _ in flat), rings


def _key(pitch: float) -> float | None:
    return None if np.isnan(pitch) else pitch


def _token(pitch: float | None) -> float:
    return np.inf if pitch is None else pitch


def _headings(
    world: World, arm: PlanarArm, rows: list[Family]
) -> list[list[tuple[float, float]]]:
    """Directions the plane may take: the family's own, cut to what a fixed heading leaves the pivot."""
    spans = [[(family.azimuth, family.half)] for family in rows]
    if world.rules.heading != "fixed" or arm.pivot_upper - arm.pivot_lower >= 2 * np.pi:
        return spans
    yaw = 0.0 if world.start is None else float(world.start.base[2])
    middle = yaw + float(world.robot.mount[3]) + arm.pivot_zero + (arm.pivot_lower + arm.pivot_upper) / 2
    reach = (arm.pivot_upper - arm.pivot_lower) / 2
    return [_common_span(span[0], (middle, reach)) for span in spans]


def _common_span(a: tuple[float, float], b: tuple[float, float]) -> list[tuple[float, float]]:
    """Intersection of two arcs given by center and half width: none, one or two arcs."""
    if a[1] >= np.pi:
        return [b]
    if b[1] >= np.pi:
        return [a]
    shift = (b[0] - a[0] + np.pi) % (2 * np.pi) - np.pi
    arcs = []
    for turn in (-2 * np.pi, 0.0, 2 * np.pi):
        low = max(-a[1], shift + turn - b[1])
        high = min(a[1], shift + turn + b[1])
        if high > low:
            arcs.append((a[0] + (low + high) / 2, (high - low) / 2))
    return arcs


def _ring_sectors(
    centers: Array, low: Array, high: Array, azimuth: Array, half: Array, margin: float | None
) -> Geometries:
    """Rings and ring sectors as polygons: within the true shape where a margin is given, else around it."""
    out = np.empty(len(centers), dtype=object)
    full = half >= np.pi
    inner = margin is not None
    keep = margin or 0.0
    for rows, points in ((full, ARC_POINTS), (~full, ARC_POINTS // 2)):
        if not rows.any():
            continue
        spread = np.where(full, np.pi, half)[rows]
        step = 2 * spread / points
        outwards = 1.0 / np.cos(step / 2)
        far = (high[rows] - keep) * (1.0 if inner else outwards)
        near = (low[rows] + keep) * (outwards if inner else 1.0)
        angles = (azimuth[rows] - spread)[:, None] + step[:, None] * np.arange(points + 1)
        unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        unit[rows[rows] & full[rows], -1] = unit[rows[rows] & full[rows], 0]
        outer = centers[rows, None] + far[:, None, None] * unit
        hole = centers[rows, None] + near[:, None, None] * unit
        if points == ARC_POINTS:
            shells, holes = shapely.linearrings(outer), shapely.linearrings(hole)
            solid = near <= GUARD
            shapes = shapely.polygons(shells, holes=holes[:, None])
            shapes[solid] = shapely.polygons(shells[solid])
        else:
            shapes = shapely.polygons(np.concatenate([outer, hole[:, ::-1]], axis=1))
        out[rows] = shapes
    return out


def what_took_away(world: World, target: Target) -> tuple[TakenAway, ...]:
    """Obstacles, floor edge and arm limits that make the area smaller than a stretched arm's disc."""
    ground = ground_of(world)
    arm = planar_arm(world.robot.chain)
    rise = target.position[2] - arm.shoulder[1] - world.robot.mount[2]
    stretched = float(arm.lengths.sum()) ** 2 - rise**2
    if stretched <= 0:
        return (TakenAway("reach", "height of the target", Polygon()),)
    disc = shapely.Point(target.position[:2]).buffer(abs(arm.shoulder[0]) + np.sqrt(stretched))
    _, _, rings = reach_rows(world, [target], (FRONT, BACK), inner=False)
    reach = shapely.union_all(rings) if len(rings) else Polygon()
    kind: CauseKind = "limits" if target.direction is None else "direction"
    taken = [TakenAway(kind, "joint limits" if kind == "limits" else "tool direction", disc - reach)]
    taken.append(TakenAway("floor", "edge of the floor", reach - ground.inner.floor))
    near = np.sort(ground.cores.query(reach, predicate="dwithin", distance=_grip(ground)))
    for k in near:
        part = reach & grow(ground.shadows[k], ground.clearance + ground.far + GUARD, inner=True)
        taken.append(TakenAway("obstacle", ground.names[k], part))
    return tuple(part for part in taken if part.polygon.area > 1e-12)


def largest_clearance(world: World, target: Target) -> float | None:
    """Largest clearance at which a target's inner area is not empty, by bisection to 1 micrometre [m]."""
    ground = ground_of(world)
    _, _, rings = reach_rows(world, [target], (FRONT, BACK), inner=True)
    rings = Side(ground.inner.floor, np.empty(0, dtype=object)).subtract(rings)
    reach = shapely.union_all(rings) if len(rings) else Polygon()
    if reach.area <= 0:
        return None

    def open_at(clearance: float) -> bool:
        by = clearance + ground.far + GUARD
        widest = max((shadow.radius for shadow in ground.shadows), default=0.0)
        near = ground.cores.query(reach, predicate="dwithin", distance=(by + widest) * 1.01)
        grown = [grow(ground.shadows[k], by, inner=True) for k in near]
        return float((reach - shapely.union_all(grown)).area) > 1e-12

    low, high = 0.0, 1.0
    if not open_at(low):
        return None
    x0, y0, x1, y1 = reach.union(ground.floor).bounds
    most = float(np.hypot(x1 - x0, y1 - y0))
    while high < most and open_at(high):
        low, high = high, 2 * high
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (middle, high) if open_at(middle) else (low, middle)
    return low if ground.shadows else np.inf


def _grip(ground: Ground) -> float:
    """Distance from a core within which its grown shadow may lie."""
    widest = max((shadow.radius for shadow in ground.shadows), default=0.0)
    return (ground.clearance + ground.far + widest) * 1.01
