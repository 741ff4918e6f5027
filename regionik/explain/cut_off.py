"""Floor that is cut off: which obstacles together keep a base from places, and how wide ways to them are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeSpace, Index, into_span
from regionik.areas.layers import Geometries, grow
from regionik.explain.causes import deletion_filter
from regionik.explain.constraints import CELLS, EDGE, join, no_way_to, setpoint_at, spot, zone_words
from regionik.explain.options import EXPLAIN
from regionik.planners.driving.footprint_planner import passage_width
from regionik.planners.driving.footprint_scene import footprint_width
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, SetpointFailure


class Barrier(NamedTuple):
    """What keeps a base from places."""

    # Obstacles, zones and `CELLS` that together do, none of which can be left out; none where the floor does
    names: tuple[str, ...]
    proven: bool  # by outer areas: there is no way at all
    zones: frozenset[str] = frozenset()  # names that are zones

    @property
    def floor_words(self) -> str:
        """What there is to say of the floor beyond."""
        return "that the base cannot get to" if self.proven else "to which no way was found for the base"

    @property
    def words(self) -> str:
        """The names in a sentence, and what they do."""
        named = join([self._said(name) for name in self.names] or ["the floor"])
        many = len(self.names) > 1 or self.names == (CELLS,)
        if self.proven:
            return f"{named} {'cut' if many else 'cuts'} it off"
        return f"{named} {'are' if many else 'is'} in the way"

    def _said(self, name: str) -> str:
        if name in self.zones:
            return zone_words(name)
        return f"the {name}" if name == CELLS else name

    def causes(self, margin: float | None = None) -> tuple[Cause, ...]:
        """The names as causes, or the floor, with what is missing [m]."""
        found = tuple(
            Cause("zone" if name in self.zones else "obstacle", name, margin) for name in self.names
        )
        return found or (Cause("floor", EDGE, margin),)


def barrier(scene: Scene, here: Array, there: Array) -> Barrier | None:
    """What keeps the base from places: obstacles that together do, found by a deletion filter over names.

    Parameters
    ----------
    here : (3,) array
        Place of the arm axis and heading of the base [m], [rad].
    there : (n, 3) array
        Places and headings, none of which it gets to.

    Returns
    -------
    Barrier or None
        None where it may get to one of them by the areas that are known.
    """
    for proven in (True, False):

        def parts(changed: Scene, proven: bool = proven) -> bool:
            free = changed.free_floor
            return parted(free.outer if proven else free.turning, here, there)

        if parts(scene):
            names = _together(scene, parts, LineString([here[:2], there[0, :2]]))
            return Barrier(names, proven, frozenset(zone.name for zone in scene.world.zones))
    return None


def poses_in(free_space: FreeSpace, components: Geometries, side: Index) -> Array:
    """A place inside each of some components, the largest first, and a heading of its side (n, 3)."""
    order = np.argsort(-shapely.area(components), kind="stable")[: EXPLAIN.max_places_asked].tolist()
    spots = [shapely.point_on_surface(components[k]) for k in order]
    yaws = [into_span(sum(span) / 2 if np.isfinite(span).all() else 0.0, span)
            for span in (free_space.sides[side[k]].span for k in order)]  # fmt: skip
    return np.array([[p.x, p.y, yaw] for p, yaw in zip(spots, yaws, strict=True)])


def parted(free_space: FreeSpace, here: Array, there: Array) -> bool:
    """True if the base gets from a pose to none of some."""
    own = free_space.piece_at(here[:2], float(here[2]))
    return all(free_space.piece_at(pose[:2], float(pose[2])) != own for pose in there)


def _together(scene: Scene, parts: Callable[[Scene], bool], way: LineString) -> tuple[str, ...]:
    """Names of obstacles that together part a world, none of which can be left out.

    Those far from the straight way are left out first.
    """
    off = {solid.name: np.inf for solid in scene.world.obstacles}
    ground = scene.ground
    for name, shadow in zip(ground.names, ground.shadows, strict=True):
        if name in off:
            off[name] = min(off[name], float(shadow.core.distance(way)))
    zones = [zone.name for zone in scene.world.zones]
    every = sorted(off, key=lambda name: -off[name]) + ([CELLS] if scene.floor.cells else []) + zones
    remaining = deletion_filter(every, lambda names: parts(_keeping(scene, names)))
    given = [*(solid.name for solid in scene.world.obstacles), *zones]
    return tuple(sorted(remaining, key=lambda name: given.index(name) if name in given else len(given)))


def _keeping(scene: Scene, names: Sequence[str]) -> Scene:
    """A world without the obstacles, zones and cells of a map that are not named."""
    zones = tuple(zone for zone in scene.world.zones if zone.name in names)
    solids = tuple(solid for solid in scene.world.obstacles if solid.name in names)
    floor = scene.floor if CELLS in names else replace(scene.floor, cells=())
    return scene.changed(obstacles=solids, floor=floor, zones=zones)


def cut_off(
    scene: Scene, i: int, here: Array, there: Array, floor: BaseGeometry, areas: BaseGeometry
) -> Explanation:
    """Explain why the base cannot get from where it stands to any known place of set-point i.

    ``here`` (3,) and ``there`` (n, 3) are places of the arm axis and headings, on the ``floor`` that it gets
    to and in the set-point's ``areas``.
    """
    found = barrier(scene, here, there) or Barrier((), False)
    gap, count, who = float(shapely.distance(floor, areas)), len(scene.task), setpoint_at(scene.task, i)
    lead = f"to {who[0].lower()}{who[1:]}: it"
    if i > 0:
        where = spot(scene.task[i].position)
        lead = f"between set-points {i} and {i + 1} of {count}: the latter at {where}"
    reason = (
        f"No way was found {lead} has known places only on floor {found.floor_words}: {found.words}. "
        f"The nearest such place is {gap:.3f} m beyond the floor the base can drive on, at a clearance of "
        f"{scene.world.base_clearance:.3f} m{'' if scene.world.asks_alike else ' or what obstacles ask for'}."
    )
    reason += narrow_passage(scene, floor, areas)
    failures = (SetpointFailure(i, "ladder-broken", reason),)
    return Explanation("ladder-broken", i, reason, found.causes(gap), failures=failures)


def beyond(scene: Scene, i: int, here: BaseGeometry, areas: BaseGeometry) -> SetpointFailure:
    """The failure of a set-point i whose ``areas`` are all on other floor than the base is on, ``here``."""
    way = shapely.shortest_line(here, areas) if not here.is_empty else LineString()
    names = [*crossed(scene, way), *map(zone_words, crossed_zones(scene, way))]
    reason = f"{setpoint_at(scene.task, i)} has known places only on floor that the base cannot get to"
    return SetpointFailure(
        i, "ladder-broken", f"{reason}: {join(names or ['the edge of the floor'])} cuts it off."
    )


def walled_off(scene: Scene, i: int, wall: Barrier, closest: str) -> Explanation:
    """Explain that the arm is clear at set-point i at most from floor that the base does not get to.

    ``closest`` tells of the contact of the posture nearest to being clear, if it was none that is.
    """
    at_best = f" (at best {closest})" if closest else ""
    reason = (
        f"{no_way_to(setpoint_at(scene.task, i))}: from where the base gets to, the arm was clear in none of "
        f"the postures that were looked at{at_best}, and its other known places are on floor "
        f"{wall.floor_words}: {wall.words}."
    )
    return Explanation("ladder-broken", i, reason, wall.causes())


def narrow_passage(scene: Scene, here: BaseGeometry, there: BaseGeometry) -> str:
    """A sentence on the narrowest passage between parts of the floor, where the base is too wide for it."""
    across = footprint_width(scene.robot.footprint)
    if across == 0:
        return ""
    passage = passage_width(_clear_floor(scene), here, there)
    if passage >= across or passage < EXPLAIN.min_gap:
        return ""  # where there is no way at all, something else has been said
    return (
        f" The widest way there is {passage:.3f} m wide at its narrowest, clearance taken off, and the base "
        f"nowhere less than {across:.3f} m."
    )


def narrow_floor(scene: Scene) -> str:
    """A sentence on the widest place of the floor, where the base is wider than that all over."""
    across, floor = footprint_width(scene.robot.footprint), _clear_floor(scene)
    if across == 0 or floor.is_empty:
        return ""
    wide = 2 * float(shapely.maximum_inscribed_circle(floor, tolerance=EXPLAIN.width_tolerance).length)
    if wide >= across - EXPLAIN.width_tolerance:
        return ""
    return (
        f" The floor has no place wider than {wide:.3f} m, clearance taken off, and the base is nowhere less "
        f"than {across:.3f} m across."
    )


def _clear_floor(scene: Scene) -> BaseGeometry:
    """Floor less what obstacles and their clearance take of it."""
    ground = scene.ground
    taken = [grow(shadow, ground.clearance, inner=False) for shadow in ground.shadows]
    return shapely.difference(ground.floor, shapely.union_all(taken))


def crossed_zones(scene: Scene, bridge: BaseGeometry) -> list[str]:
    """Zones that do not let the base be all along a line on the floor."""
    return [zone.name for zone in scene.world.zones if not (bridge.is_empty or zone.allows(bridge))]


def crossed(scene: Scene, bridge: BaseGeometry) -> list[str]:
    """Obstacles whose grown shadows a line on the floor runs through."""
    if bridge.is_empty:
        return []
    ground = scene.ground
    names = (
        name for name, _, taken in ground.rejections(bridge, ground.clearance) if taken.intersects(bridge)
    )
    return list(dict.fromkeys(names))[:6]
