"""Admissible areas: places of the arm axis from which a target is reached. Reach minus rejection.

Source: M-FABRIK (Santos et al., IEEE Access 2020), CreateAdmissibleArea in Algorithm 1; the reach here is
exact for joint limits and tool direction, gaps included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import (
    MIN_AREA,
    FreeSpace,
    PathAreas,
)
from regionik.areas.ground import Side, united
from regionik.postures.families import BACK, FRONT
from regionik.reach_table import heeds_headings, inner_reach_tables, reach_table
from regionik.scene import Scene, WorldSource, scene_of, world_of
from regionik.values import PlannedArea
from regionik.worlds.arms import reach_bound
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import CauseKind
from regionik.worlds.limits import Criteria
from regionik.worlds.scene import Target, World


@dataclass(frozen=True, eq=False)
class RejectedPart:
    """A part of the reach that is not admissible, and its cause."""

    kind: CauseKind
    name: str
    polygon: BaseGeometry
    part: str = ""  # of the robot that would come too near to an obstacle


@dataclass(frozen=True, eq=False)
class Area:
    """Admissible area of one target: the places of the arm axis.

    Attributes
    ----------
    target : Target
    inner : geometry
        The target is reached from every point of it.
    outer : geometry
        The target is reached from no point outside it; where it is empty the target is unreachable.
    """

    target: Target
    inner: BaseGeometry
    outer: BaseGeometry
    world: World

    def __repr__(self) -> str:
        spot = ", ".join(f"{value:z.3f}" for value in self.target.position)
        parts = len(self.components)
        size = f"{self.inner.area:.3f} m2 in {parts} part{'' if parts == 1 else 's'}"
        return f"Area(of ({spot}): {size}, at most {self.outer.area:.3f} m2)"

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
        """Undecided area, between outer and inner [m2]."""
        return float(self.outer.area - self.inner.area)

    @cached_property
    def causes(self) -> tuple[RejectedPart, ...]:
        """Causes that took the rest of the stretched-arm disc away, each with name and polygon."""
        return rejected_parts(scene_of(self.world), self.target)

    @cached_property
    def clearance(self) -> float | None:
        """Largest clearance at which the area would not be empty [m]; None where not even 0 helps."""
        return largest_clearance(scene_of(self.world), self.target)


def admissible_area(world: WorldSource, target: Target | ArrayLike, criteria: Criteria | None = None) -> Area:
    """Area of the arm axis from which the tool reaches a target.

    Parameters
    ----------
    world : World, or the name or file of one
    target : Target or (3,) array_like
        A bare point leaves the tool direction free [m].
    criteria : Criteria, optional
        Thresholds that the arm's posture must meet; by default those of the world's rules.

    Returns
    -------
    Area
        In floor coordinates [m].

    Raises
    ------
    InputError
        For a target that is not three finite numbers, or criteria that the arm cannot be held to.
    """
    world = world_of(world)
    if not isinstance(target, Target):
        target = Target(frozen(target, (3,), "target"))
    if criteria is not None:
        world = replace(world, rules=replace(world.rules, criteria=criteria))
    scene = scene_of(world)
    inner = _whole_areas(scene, [target], inner=True, proven=True)[0]
    return Area(target, inner, _whole_areas(scene, [target], inner=False)[0], world)


def known_area(scene: Scene, target: Target) -> BaseGeometry:
    """Inner area of a target at any heading as plans use it, sampled where that is: see `ReachQuery`."""
    return _whole_areas(scene, [target], inner=True)[0]


def _whole_areas(
    scene: Scene, targets: Sequence[Target], *, inner: bool, proven: bool = False
) -> list[BaseGeometry]:
    """Area of each target at any heading, from within or from outside."""
    which, parts = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=object)]
    for side in (scene.free_floor.turning if inner else scene.free_floor.outer).sides:
        rows, _, rings = reach_table(
            scene, targets, (FRONT, BACK), inner=inner, span=side.span, proven=proven
        )
        which.append(rows)
        parts.append(side.subtract(rings))
    owner, areas = np.concatenate(which), np.concatenate(parts)
    return [united(np.append(areas[owner == i], Polygon())) for i in range(len(targets))]


def path_areas(
    scene: Scene,
    targets: Sequence[Target] | None = None,
    facings: Sequence[int] = (FRONT, BACK),
    free_space: FreeSpace | None = None,
    *,
    coarse: bool = False,
) -> PathAreas:
    """Inner areas of a whole path, or of other targets, at once.

    The free floor is by default that of every heading. With ``coarse`` areas are likely, not proven: see
    `ReachQuery`.
    """
    asked = scene.task if targets is None else targets
    sides = (free_space or scene.free_floor.anywhere).sides
    found = inner_reach_tables(scene, asked, facings, [side.span for side in sides], coarse=coarse)
    areas = [side.subtract(rings) for side, (_, _, rings) in zip(sides, found, strict=True)]
    by_side = PathAreas(
        np.concatenate([rows for rows, _, _ in found]),
        tuple(one for _, families, _ in found for one in families),
        np.repeat(np.arange(len(sides)), [len(rows) for rows, _, _ in found]),
        np.concatenate(areas),
    )
    return by_side.sorted_by(by_side.target)


def free_spaces_for(scene: Scene) -> Iterator[tuple[FreeSpace, tuple[int, ...]]]:
    """Free floors of the base and facings of the arm, the simplest first."""
    free = scene.free_floor
    yield from ((free.anywhere, (FRONT,)), (free.anywhere, (FRONT, BACK)))
    if free.turns_matter:
        yield from ((free.turning, (FRONT,)), (free.turning, (FRONT, BACK)))


def distinct_free_spaces(scene: Scene) -> Iterator[tuple[FreeSpace, tuple[int, ...]]]:
    """`free_spaces_for` without those that differ in facings alone, where no target is met over the back."""
    facings = (FRONT, BACK)
    families = (scene.model(target).families(target, facings, inner=True) for target in scene.task)
    over_back = any(family.facing == BACK for some in families for family in some)
    return (way for way in free_spaces_for(scene) if over_back or BACK not in way[1])


def outer_areas(scene: Scene, targets: Sequence[Target]) -> list[BaseGeometry]:
    """Outer area of each target: where it is empty, the target is provably unreachable.

    Those that are not empty for the circle inside the footprint are cut to what its headings leave. Of a map
    with many blobs what is out of the targets' reach is not looked at.
    """
    scene = scene.within_reach(np.array([target.position for target in targets]).reshape(-1, 3))
    found = round_outer_areas(scene, targets)
    left = [i for i, area in enumerate(found) if not area.is_empty]
    for i, area in zip(left, _whole_areas(scene, [targets[i] for i in left], inner=False), strict=True):
        found[i] &= area
    return found


def round_outer_areas(scene: Scene, targets: Sequence[Target], *, coarse: bool = False) -> list[BaseGeometry]:
    """Outer area of each target for the circle inside the footprint; see `ReachQuery` for ``coarse``."""
    span, side = scene.free_floor.headings, scene.ground.outer
    rows, _, rings = reach_table(scene, targets, (FRONT, BACK), inner=False, span=span, coarse=coarse)
    left, bounds = side.subtract(rings), np.searchsorted(rows, np.arange(len(targets) + 1))
    return [united(left[a:b]) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]


def reach_of(scene: Scene, target: Target, *, coarse: bool = False) -> BaseGeometry:
    """Outer reach of a target: places of the arm axis if nothing were in the way."""
    span = scene.free_floor.headings
    _, _, rings = reach_table(scene, [target], (FRONT, BACK), inner=False, span=span, coarse=coarse)
    return shapely.union_all(rings) if len(rings) else Polygon()


def rejected_parts(scene: Scene, target: Target) -> tuple[RejectedPart, ...]:
    """Obstacles, floor edge and limits that make the area smaller than a stretched arm's disc."""
    span = reach_bound(scene.robot.chain)
    rise = target.position[2] - span.height - scene.robot.mount[2]
    stretched = span.length**2 - rise**2
    if stretched <= 0:
        return (RejectedPart("reach", "height of the target", Polygon()),)
    disc = shapely.Point(target.position[:2]).buffer(span.radius + np.sqrt(stretched))
    reach = reach_of(scene, target)
    rules = replace(scene.rules, criteria=None)
    reach |= scene.lifted.rejection(float(target.position[2]), scene.free_floor.headings, inner=False) & disc
    wide = reach if scene.rules.criteria is None else reach_of(scene.changed(rules=rules), target)
    kind: CauseKind = "limits" if target.direction is None else "direction"
    name = "tool direction" if target.orientation is None else "tool orientation"
    taken = [RejectedPart(kind, "joint limits" if kind == "limits" else name, disc - wide)]
    taken.append(RejectedPart("criteria", "criteria", wide - reach))
    taken += rejected_by_floor(scene, reach)
    taken += rejected_by_obstacles(scene, reach, target)
    return tuple(part for part in taken if part.polygon.area > 1e-12)


def rejected_by_floor(scene: Scene, reach: BaseGeometry) -> Iterator[RejectedPart]:
    """Parts of a reach in which the base would be off the floor, or where zones do not let it be."""
    whole = (scene.changed(zones=()) if scene.world.zones else scene).ground.inner.floor
    yield RejectedPart("floor", "edge of the floor", reach - whole)
    for zone in scene.world.zones:
        yield RejectedPart(
            "zone", zone.name, (reach & whole) - scene.changed(zones=(zone,)).ground.inner.floor
        )


def rejected_by_obstacles(
    scene: Scene, reach: BaseGeometry, target: Target | None = None
) -> list[RejectedPart]:
    """Parts of a reach in which the base would come too near to obstacles, one for each of these.

    With a target, what lifts carry on their way to it counts too.
    """
    ground = scene.ground
    near = ground.rejections(reach, ground.clearance)
    if target is not None:
        near += scene.lifted.rejections(float(target.position[2]))
    return [RejectedPart("obstacle", name, reach & shadow, part) for name, part, shadow in near]


def largest_clearance(scene: Scene, target: Target) -> float | None:
    """Largest clearance at which a target's inner area is not empty, by bisection to 1 micrometre [m]."""
    ground = scene.ground
    _, _, rings = reach_table(scene, [target], (FRONT, BACK), inner=True, span=scene.free_floor.headings)
    rings = Side(ground.inner.floor, np.empty(0, dtype=object)).subtract(rings)
    reach = shapely.union_all(rings) if len(rings) else Polygon()
    if reach.area <= 0:
        return None

    def open_at(clearance: float) -> bool:
        grown = [shadow for _, _, shadow in ground.rejections(reach, clearance)]
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


def checked_targets(targets: ArrayLike | Sequence[Target]) -> Array | list[Target]:
    """Positions (n, 3) of bare targets, or the targets where any asks for more or has a name.

    Raises InputError for targets that are not n rows of three finite numbers.
    """
    if isinstance(targets, Sequence) and all(isinstance(target, Target) for target in targets):
        some = [target for target in targets if isinstance(target, Target)]
        if any(target.direction is not None or target.name for target in some):
            return some
        targets = np.array([target.position for target in some]).reshape(-1, 3)
    return frozen(np.atleast_2d(np.asarray(targets)), (None, 3), "targets")


def is_ruled_out(scene: Scene) -> bool:
    """Return True where the first set-point is proven out of reach: its outer area is empty."""
    return bool(outer_areas(scene, scene.task[:1])[0].is_empty)


def has_no_known_place(scene: Scene) -> bool:
    """Return True where the first set-point has no inner area, at any heading; this proves nothing."""
    standings = (
        [scene.free_floor.anywhere, scene.free_floor.by_heading]
        if scene.free_floor.turns_matter
        else [scene.free_floor.anywhere]
    )
    every = (path_areas(scene, scene.task[:1], (FRONT, BACK), free_space) for free_space in standings)
    return not any(area.area > 0 for areas in every for area in areas.inner)


def have_known_places(scene: Scene, targets: Sequence[Target]) -> NDArray[np.bool_]:
    """Mask of the targets that have an inner area at every heading, or at the one the rules fix, (n,)."""
    areas = path_areas(scene, targets)
    found = np.zeros(len(targets), dtype=bool)
    found[areas.target[shapely.area(areas.inner) > MIN_AREA]] = True
    return found


def planned_areas(
    scene: Scene, areas: PathAreas, free_space: FreeSpace, pruned: Callable[[int], BaseGeometry | None]
) -> tuple[PlannedArea, ...]:
    """Admissible, pruned and rejected parts of every set-point, as a plan carries them.

    ``pruned`` tells what is left of the area of a set-point, None where that is all of it.
    """
    facings = sorted({family.facing for family in areas.family})
    rows, _, rings = reach_table(scene, scene.task, facings, inner=True, span=scene.free_floor.headings)
    reach = _by_target(scene, rows, rings)
    spans = [side.span for side in free_space.sides]
    if len(spans) > 1 and not any(heeds_headings(scene, scene.task, facings, span) for span in spans):
        # What one reach has on the floor of each side, united, is what it has on all of them united.
        which, _, whole = reach_table(scene, scene.task, facings, inner=True)
        admissible = _by_target(scene, which, free_space.somewhere.subtract(whole))
    else:
        admissible = _by_target(scene, areas.target, areas.inner)
    rejected = shapely.difference(reach, admissible)
    left = [pruned(i) for i in range(len(scene.task))]
    return tuple(
        PlannedArea(one, one if some is None else some, other)
        for one, some, other in zip(admissible, left, rejected, strict=True)
    )


def _by_target(scene: Scene, which: NDArray[np.intp], shapes: NDArray[np.object_]) -> NDArray[np.object_]:
    """Union of the shapes of each target, by ascending numbers of targets."""
    ends = np.searchsorted(which, np.arange(len(scene.task) + 1))
    return np.array([united(shapes[a:b]) for a, b in pairwise(ends)], dtype=object)
