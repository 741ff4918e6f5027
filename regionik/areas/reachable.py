"""Reach alone: where the arm axis may stand if nothing is in the way, as rings and ring sectors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from regionik.areas.demand import aim_of, in_plane
from regionik.areas.ground import EVERY, GUARD, Geometries
from regionik.areas.meeting import distances, narrowed, refuse
from regionik.areas.sectors import Sectors, ring_sectors
from regionik.planners.reach.levelreach import inner_reach, outer_reach
from regionik.planners.reach.posereach import pose_reach
from regionik.planners.reach.rings import FREE, reach_intervals, reach_spans
from regionik.planners.reach.rolls import out_of_roll, swings
from regionik.worlds.arrays import Array
from regionik.worlds.pivot import pivoted
from regionik.worlds.planar import PlanarArm, planar_arm
from regionik.worlds.scene import Target, World

Index = NDArray[np.intp]

ARC_POINTS = 48  # vertices of a full circle
FRONT, BACK = 1, -1


@dataclass(frozen=True)
class Family:
    """Postures of one kind for one target: how the arm's plane and last link lie.

    Attributes
    ----------
    facing : int
        `FRONT` where the target lies ahead in the arm's plane (r > 0), `BACK` where behind (r < 0).
    pitch : float
        Angle at which the solver holds the last link in the plane [rad]; NaN where it is free.
    azimuth, half : float
        The plane may point within ``half`` of ``azimuth``, seen from above [rad].
    pitches : (low, high)
        Pitches that the reach allows [rad].
    """

    facing: int
    pitch: float = np.nan
    azimuth: float = 0.0
    half: float = np.pi
    pitches: tuple[float, float] = FREE


@lru_cache(maxsize=4096)
def families(
    direction: tuple[float, float, float] | None, cone: float, facings: tuple[int, ...], inner: bool
) -> tuple[Family, ...]:
    """Posture families that may reach a target.

    A given tool direction sets the last link's pitch: with the plane along the direction seen from above,
    or against it. Inner areas hold the pitch itself and let the plane swing within the cone; outer areas
    take every pitch and every swing that the cone lets through, each by itself.
    """
    if direction is None:
        return tuple(Family(facing) for facing in facings)
    x, y, z = direction
    flat = float(np.hypot(x, y))
    pitch = float(np.arctan2(z, flat))
    azimuth = float(np.arctan2(y, x)) if flat > 0 else 0.0
    if inner:
        # cos(cone) = cos^2(pitch) cos(swing) + sin^2(pitch)
        swing = np.cos(cone) - z * z
        half = np.pi if swing <= -flat * flat else max(0.0, float(np.arccos(swing / flat**2)) - GUARD)
        spread = 0.0
    else:
        # The widest swing of the cone's edge, unless the cone holds the vertical.
        half = float(np.arcsin(np.sin(cone) / flat)) if cone < np.pi / 2 and np.sin(cone) < flat else np.pi
        spread = cone
    low, high = max(pitch - spread, -np.pi / 2), min(pitch + spread, np.pi / 2)
    along = Family(FRONT, pitch, azimuth, half, (low, high))
    against = Family(FRONT, np.pi - pitch, azimuth + np.pi, half, (np.pi - high, np.pi - low))
    kinds = [along] if inner and half >= np.pi else [along, against]
    return tuple(replace(kind, facing=facing) for facing in facings for kind in kinds)


def families_of(
    arm: PlanarArm, target: Target, facings: tuple[int, ...], *, inner: bool
) -> tuple[Family, ...]:
    """Posture families that may reach a target, its full orientation included."""
    direction = None if target.direction is None else tuple(target.direction.tolist())
    kinds = families(direction, target.cone, facings, inner)
    if target.orientation is None:
        return kinds
    if inner:
        narrow = families(direction, target.cone / np.sqrt(2), facings, inner)
        rows = [_kept_up(arm, kind, target, 0.0) for kind in kinds]
        # A turn keeps to its cone where tilt and part about the axis keep to one narrower by a root of 2.
        if rows != [[kind] for kind in kinds]:
            rows += [_kept_up(arm, kind, target, target.cone / np.sqrt(2)) for kind in narrow]
        return tuple(kind for row in rows for kind in row)
    turn, cone = target.orientation, target.cone
    return tuple(
        kind for kind in kinds if not out_of_roll(arm, kind.azimuth, kind.pitch, kind.half, turn, cone)
    )


def _kept_up(arm: PlanarArm, kind: Family, target: Target, slack: float) -> list[Family]:
    """A family cut to where the roll joint keeps up with its swing."""
    assert target.orientation is not None
    spans = swings(arm, kind.azimuth, kind.pitch, kind.half, target.orientation, slack)
    return [replace(kind, azimuth=kind.azimuth + middle, half=half) for middle, half in spans]


def reach_rows(
    world: World,
    targets: Sequence[Target],
    facings: Sequence[int],
    *,
    inner: bool,
    span: tuple[float, float] = EVERY,
) -> tuple[NDArray[np.intp], tuple[Family, ...], Geometries]:
    """Reach of every target as rings and ring sectors, before rejection, the base's heading within a span."""
    world = narrowed(world)
    ways: dict[str, list[int]] = {}
    for i, target in enumerate(targets):
        refuse(world, target)
        planar = in_plane(world.robot.chain, target)
        free = target.direction is None or not inner  # a bound of the tool's point bounds its poses
        ways.setdefault("plane" if planar else "whole" if free else "posed", []).append(i)
    which, shapes = np.empty(0, dtype=np.intp), np.empty(0, dtype=object)
    kinds: tuple[Family, ...] = ()
    for way, members in ways.items():
        some = [targets[i] for i in members]
        if way == "plane":
            rows = _plane_rows(world, some, facings, span, inner=inner)
        else:
            rows = _whole_rings(world, some, inner=inner) if way == "whole" else _posed_rows(world, some)
        which = np.concatenate([which, np.array(members, dtype=np.intp)[rows[0]]])
        kinds, shapes = kinds + rows[1], np.concatenate([shapes, rows[2]])
    order = np.argsort(which, kind="stable")
    return which[order], tuple(kinds[k] for k in order), shapes[order]


def _plane_rows(
    world: World,
    targets: Sequence[Target],
    facings: Sequence[int],
    span: tuple[float, float],
    *,
    inner: bool,
) -> tuple[Index, tuple[Family, ...], Geometries]:
    """Reach of an arm in one plane, exact but for the chords of its circles."""
    which, families, rings = plane_rings(world, targets, facings, span, inner=inner)
    margin = world.rules.reach_margin if inner else None
    return which, families, ring_sectors(*rings, margin, ARC_POINTS)


def plane_rings(
    world: World,
    targets: Sequence[Target],
    facings: Sequence[int],
    span: tuple[float, float],
    *,
    inner: bool,
) -> tuple[Index, tuple[Family, ...], Sectors]:
    """Reach of an arm in one plane, exact: target and family of each ring or ring sector, and their numbers.

    Inner ones are wide enough for the rules' margin on both sides, which is not taken off yet; the world is
    `narrowed`.
    """
    arm = planar_arm(world.robot.chain)
    margin = world.rules.reach_margin if inner else 0.0
    shoulder_z = float(arm.shoulder[1] + world.robot.mount[2])
    positions = np.array([target.position for target in targets]).reshape(-1, 3)
    heights = positions[:, 2]
    alike: dict[tuple[Family, ...], list[int]] = {}
    for i, target in enumerate(targets):
        alike.setdefault(families_of(arm, target, tuple(facings), inner=inner), []).append(i)
    found: list[Family] = []
    parts = [np.empty((0, 4))]  # target, family, low, high
    for kinds, members in alike.items():
        for pitches in sorted({family.pitches for family in kinds}):
            reach = reach_spans(
                arm, shoulder_z, heights[members], pitches, front=FRONT in facings, back=BACK in facings
            )
            owner, spans = distances(world, pitches, heights[members], *reach, inner=inner)
            for family in kinds:
                if family.pitches == pitches:
                    ahead, low, high = _ahead(family, spans, margin if inner else None)
                    which = np.array(members)[owner[ahead]]
                    parts.append(np.column_stack([which, np.full(len(which), len(found)), low, high]))
                    found.append(family)
    table = np.concatenate(parts)
    table = table[np.argsort(table[:, 0], kind="stable")]
    which, kind = table[:, :2].astype(np.intp).T
    arcs = _headings(world, arm, found, span, GUARD if inner else 0.0)
    row, arc = _each([len(several) for several in arcs], kind)
    which, kind, low, high = which[row], kind[row], table[row, 2], table[row, 3]
    of = np.cumsum([0] + [len(several) for several in arcs])[kind] + arc
    center, half = np.array([one for several in arcs for one in several]).reshape(-1, 2)[of].T
    behind = np.array([np.pi if family.facing == FRONT else 0.0 for family in found])
    rings = Sectors(positions[which, :2], low, high, center + behind[kind], half)
    return which, tuple(found[k] for k in kind.tolist()), rings


def _ahead(family: Family, spans: Array, margin: float | None) -> tuple[Index, Array, Array]:
    """Which of the spans (m, 2) of signed distance a family reaches, and the distances, low and high."""
    low, high = spans.T
    front = low >= 0
    a, b = np.where(front, low, -high), np.where(front, high, -low)
    reached = (low + high) * family.facing > 0
    if margin is not None:  # a ring thinner than its chords has no inner polygon
        reached &= (a + margin) / np.cos(np.pi / ARC_POINTS) + GUARD < b - margin
    return np.flatnonzero(reached), a[reached], b[reached]


def _each(counts: Sequence[int], kind: Index) -> tuple[Index, Index]:
    """Rows, each as often as its kind has parts, and which of these, (k,) each."""
    times = np.array(counts, dtype=np.intp)[kind]
    row = np.repeat(np.arange(len(kind)), times)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(times) - times, times)


def fine_reach(
    world: World,
    target: Target,
    kinds: Sequence[Family],
    span: tuple[float, float],
    arcs: int,
    *,
    inner: bool,
) -> tuple[tuple[Family, ...], Geometries]:
    """Reach of one target without the rules' margin, its circles as fine as asked: families and shapes.

    Parameters
    ----------
    world : World
    target : Target
    kinds : sequence of Family
        Of an arm in one plane; any other arm has one kind.
    span : (low, high)
        Headings of the base [rad].
    arcs : int
        Vertices of a full circle.
    inner : bool
        Within the true reach, or around it.
    """
    chain, height = world.robot.chain, float(world.robot.mount[2])
    planar = in_plane(chain, target)
    if inner and not planar and target.direction is not None:
        return _posed_rows(world, [target])[1:]
    if planar:
        arm, at = planar_arm(chain), target.position[2:]
        shoulder = float(arm.shoulder[1]) + height
        intervals = [reach_intervals(arm, shoulder, at, kind.pitches)[0] for kind in kinds]
    else:
        kinds, rise = (Family(FRONT),), float(target.position[2]) - height
        whole = inner_reach(pivoted(chain), rise) if inner else outer_reach(pivoted(chain), rise)
        intervals = [np.array(whole).reshape(-1, 2)]
    margin, guard = (GUARD, GUARD) if inner else (None, 0.0)
    pairs = zip(kinds, intervals, strict=True)
    table = [row for kind, rows in pairs for row in _spans_of(kind, [0], [rows], margin, arcs)]
    families = [kind for _, kind, _, _ in table]
    spans = _headings(world, arm, families, span, guard) if planar else [[(0.0, np.pi)] for _ in table]
    flat = [(row, one) for row, several in zip(table, spans, strict=True) for one in several if one[1] > 0]
    rings = ring_sectors(
        np.tile(target.position[:2], (len(flat), 1)),
        np.array([row[2] for row, _ in flat]),
        np.array([row[3] for row, _ in flat]),
        np.array([center + (np.pi if row[1].facing == FRONT else 0.0) for row, (center, _) in flat]),
        np.array([half for _, (_, half) in flat]),
        margin,
        arcs,
    )
    return tuple(row[1] for row, _ in flat), rings


def _posed_rows(
    world: World, targets: Sequence[Target]
) -> tuple[NDArray[np.intp], tuple[Family, ...], Geometries]:
    """Reach of an arm that does not work in one plane, its tool turned as asked: looked for pose by pose."""
    chain, height = pivoted(world.robot.chain), float(world.robot.mount[2])
    shapes = [pose_reach(chain, height, aim_of(target)).area for target in targets]
    shapes = [shape.buffer(-world.rules.reach_margin, join_style="mitre") for shape in shapes]
    real = [i for i, shape in enumerate(shapes) if not shape.is_empty]
    rows = np.empty(len(real), dtype=object)
    rows[:] = [shapes[i] for i in real]
    return np.array(real, dtype=np.intp), (Family(FRONT),) * len(real), rows


def _whole_rings(
    world: World, targets: Sequence[Target], *, inner: bool
) -> tuple[NDArray[np.intp], tuple[Family, ...], Geometries]:
    """Reach of an arm that does not work in one plane: rings proven to be in reach, or all that may be."""
    chain, height, family = pivoted(world.robot.chain), float(world.robot.mount[2]), Family(FRONT)
    table: list[tuple[int, Family, float, float]] = []
    for i, target in enumerate(targets):
        rise = float(target.position[2]) - height
        found = inner_reach(chain, rise) if inner else outer_reach(chain, rise)
        margin = world.rules.reach_margin if inner else None
        table += _spans_of(family, [i], [np.array(found).reshape(-1, 2)], margin, ARC_POINTS)
    which = np.array([row[0] for row in table], dtype=np.intp)
    positions = np.array([target.position for target in targets]).reshape(-1, 3)
    spans = np.array([row[2:] for row in table]).reshape(-1, 2)
    rings = ring_sectors(
        positions[which, :2],
        spans[:, 0],
        spans[:, 1],
        np.zeros(len(table)),
        np.full(len(table), np.pi),
        world.rules.reach_margin if inner else None,
        ARC_POINTS,
    )
    return which, tuple(row[1] for row in table), rings


def _spans_of(
    family: Family, members: Sequence[int], intervals: Sequence[Array], margin: float | None, arcs: int
) -> Iterator[tuple[int, Family, float, float]]:
    """Distances between axis and target that a family reaches, as rows of target, family, low, high."""
    for i, interval in zip(members, intervals, strict=True):
        for low, high in interval.tolist():
            if (low + high) * family.facing > 0:
                a, b = (low, high) if low >= 0 else (-high, -low)
                # A ring thinner than its chords has no inner polygon.
                if margin is None or (a + margin) / np.cos(np.pi / arcs) + GUARD < b - margin:
                    yield i, family, a, b


def _headings(
    world: World, arm: PlanarArm, rows: list[Family], span: tuple[float, float], guard: float
) -> list[list[tuple[float, float]]]:
    """Directions the plane may take: the family's own, cut to what the base's headings leave the pivot."""
    spans = [[(family.azimuth, family.half)] for family in rows]
    low, high = arm.pivot_lower, arm.pivot_upper
    if world.rules.heading == "face_target":  # the base looks where the plane does
        low = high = min(max(0.0, low), high)
    half = (span[1] - span[0] + high - low) / 2
    if not half < np.pi:
        return spans
    yaw = float(world.robot.mount[3]) + arm.pivot_zero
    middle = yaw + (span[0] + span[1] + low + high) / 2
    return [_common_span(one[0], (middle, half - guard)) for one in spans]


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
