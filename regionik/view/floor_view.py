"""The floor as pictures show it: where the base has room, areas that a plan uses, all seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.postures.poses import axis_of
from regionik.regions import Area
from regionik.scene import scene_of
from regionik.values import Plan, Stop, Stops
from regionik.verification.base_clearance import footprint_hulls
from regionik.view.options import VIEW
from regionik.view.picture import tool_axes
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

OPTIONS = VIEW.floor


ZONE_WORDS = "floor of zones: no base on it"


class ShownFloor(NamedTuple):
    """Disjoint parts of the floor, by places of the arm's axis; zones as they are."""

    free: BaseGeometry  # base and body have room at every heading
    turning: BaseGeometry  # they may have room at some
    rejected: BaseGeometry  # they have none at any heading, for solids or the floor's edge
    zones: BaseGeometry  # where zones do not let the base be


def shown_floor(world: World, detail: float = OPTIONS.detail) -> ShownFloor:
    """The floor in the parts that pictures show, as fine as ``detail`` [m].

    Of what lifts carry that counts which is in the way at each of their heights. No place in the part that is
    rejected is one where a plan that holds has its arm's axis: the part is drawn a little too small, and so
    is the free one, where there is a part between them.
    """
    ground, floor = scene_of(world).ground, world.open_floor
    room, sure, zones = ground.outer.free, ground.inner.free, zoned_floor(world)
    rejected = _simplified(_shrunk(floor - room, detail), detail)
    if world.zones:
        rejected &= floor
    if _shrunk(room - sure, detail).is_empty:
        return ShownFloor(floor - rejected, Polygon(), rejected, zones)
    free = _simplified(_shrunk(sure, detail), detail) - rejected
    return ShownFloor(free, floor - rejected - free, rejected, zones)


def zoned_floor(world: World) -> BaseGeometry:
    """The floor on which zones do not let the base stand."""
    return world.floor.polygon - world.open_floor if world.zones else Polygon()


def _shrunk(shape: BaseGeometry, by: float) -> BaseGeometry:
    """Places deeper inside, part by part: all at once take twenty times as long for a noisy map."""
    parts = shapely.get_parts(shapely.buffer(shapely.get_parts(shape), -by))
    shrunk: BaseGeometry = shapely.multipolygons(parts[~shapely.is_empty(parts)])
    return shrunk


def _simplified(shape: BaseGeometry, detail: float) -> BaseGeometry:
    """Polygons simplified part by part: all at once take minutes where a map has thousands of blobs."""
    parts = shapely.get_parts(shape)
    simple: BaseGeometry = shapely.multipolygons(shapely.simplify(parts, detail))
    return simple if len(parts) != 1 else shapely.get_parts(simple)[0]


def rejected_words(world: World) -> str:
    """Words for places where the base has no room at any heading."""
    if scene_of(world).ground.near <= 0:
        return "rejected: too close to a solid"
    return "rejected: too close to a solid" + (
        ", an edge or a zone" if world.zones else " or the floor's edge"
    )


def used_areas(plan: Plan) -> list[BaseGeometry]:
    """Areas of the set-points as far as the plan can use them.

    What is left of an area for the whole path, and of a plan that is not parked the whole components in
    which it has its arm's axis: ladders are those of a base that goes every way, and one on wheels, or a
    tracker, may work elsewhere.
    """
    if plan.stops:
        return [area.pruned for area in plan.areas]
    places = shapely.points(axis_of(plan.world.robot, np.array([one.base for one in plan.setpoints])))
    rolls, found = plan.world.robot.drive.rolls, []
    for area, place in zip(plan.areas, places, strict=False):
        parts = shapely.get_parts(area.admissible)
        held = parts[shapely.dwithin(parts, place, OPTIONS.detail)]
        holds = shapely.dwithin(area.pruned, place, OPTIONS.detail) and not rolls
        found.append(area.pruned if holds else shapely.union_all([area.pruned, *held]))
    return found


def area_words(plan: Plan) -> tuple[str, str]:
    """Words for areas that a plan can use, and for the rest of what is admissible."""
    rest = "admissible for some set-point"
    if plan.stops:
        return "places to park for the next set-points", rest
    if plan.world.robot.drive.rolls:
        return "areas that the plan works in", rest
    return "areas for the whole path", "admissible, but a dead end"


def axis_path(plan: Plan) -> Array:
    """Path of the arm's axis on the floor, (n, 2) [m]."""
    motion, drive = plan.motion, plan.world.robot.drive
    return axis_of(plan.world.robot, drive.sampled(motion.base, drive.cuts(motion.base)))


def parking_circles(world: World, stops: Sequence[Stop]) -> BaseGeometry:
    """Circles in which the arm's axis may park, one for each stop."""
    places = [Point(axis_of(world.robot, stop.base)) for stop in stops]
    return MultiPolygon([at.buffer(stop.tolerance) for at, stop in zip(places, stops, strict=True)])


def drawn_union(areas: Sequence[BaseGeometry], detail: float = OPTIONS.detail) -> BaseGeometry:
    """The union of many areas, as fine as it is drawn."""
    union = shapely.union_all([area.simplify(detail) for area in areas])
    # Overlapping rings leave thousands of holes: simplify and repair is far faster than to stay valid.
    return shapely.make_valid(union.simplify(detail, preserve_topology=False))


@dataclass(frozen=True, eq=False)
class FloorView:
    """A floor seen from above; shapes and lengths in metres of the world."""

    all: BaseGeometry
    free: BaseGeometry
    turning: BaseGeometry  # the base may have room at some headings
    rejected: BaseGeometry  # it has none at any
    zones: BaseGeometry  # where zones do not let the base be
    pale: BaseGeometry  # admissible for a set-point, but not for the whole path
    strong: BaseGeometry  # admissible for the whole path
    words: tuple[str, str, str]  # for what is strong, what is pale, and what is rejected
    solids: BaseGeometry
    axis_path: Array  # (n, 2) of the arm's axis
    tool_path: Array  # (n, 2)
    setpoints: Array  # (n, 2)
    tool_axes: Array  # (k, 2, 2) arrows to some of them along the axis of the tool
    footprints: BaseGeometry  # (p,) outlines of the base at some set-points, first and last among them
    headings: Array  # (p, 2, 2) a stroke inside each of them along its heading
    low: Array  # (2,) corners of the window
    high: Array
    circles: BaseGeometry  # circles in which the base may park at its stops
    driven: bool = True  # ``axis_path`` is driven; else it connects stops in their order


def floor_view(what: Plan | World | Area | Stops) -> FloorView:
    """Return the floor of a plan, stops, a world with its start, or an area with its target, from above."""
    if isinstance(what, Plan):
        return _plan_floor(what)
    if isinstance(what, Stops):
        return stops_floor(what.world, what)
    if isinstance(what, World):
        return _world_floor(what)
    return _world_floor(replace(what.world, task=(what.target,)), what.inner)


def _plan_floor(plan: Plan) -> FloorView:
    world, motion = plan.world, plan.motion
    at = np.flatnonzero(motion.kind == "setpoint")
    shown = motion.base[at[np.unique(np.linspace(0, len(at) - 1, OPTIONS.shown_poses).round().astype(int))]]
    return _floor_view(
        world,
        np.array([stop.base for stop in plan.stops]) if plan.stops else shown,
        areas=[area.admissible for area in plan.areas],
        used=(used_areas(plan), area_words(plan)),
        axis_path=axis_path(plan),
        tool_path=plan.tools()[:, :2],
        stops=plan.stops,
    )


def stops_floor(world: World, stops: Sequence[Stop]) -> FloorView:
    """Return the floor with stops as seen from above, straight lines between them."""
    base = np.array([stop.base for stop in stops])
    setpoints = np.array([world.task[i].position[:2] for stop in stops for i in stop.setpoints])
    view = _floor_view(world, base, axis_path=axis_of(world.robot, base), tool_path=setpoints, stops=stops)
    return replace(view, setpoints=setpoints, driven=False)


def _world_floor(world: World, area: BaseGeometry | None = None) -> FloorView:
    base = np.empty((0, 3)) if world.start is None else world.start.base[None]
    areas = () if area is None else (area,)
    return _floor_view(world, base, areas=areas, used=(areas, ("admissible area", "")))


def _floor_view(
    world: World,
    base: Array,
    *,
    areas: Sequence[BaseGeometry] = (),
    used: tuple[Sequence[BaseGeometry], tuple[str, str]] = ((), ("", "")),
    axis_path: Array | None = None,
    tool_path: Array | None = None,
    stops: Sequence[Stop] = (),
) -> FloorView:
    """The floor with base poses (n, 3); without a path of the tool its set-points are joined."""
    setpoints = np.array([target.position[:2] for target in world.task]).reshape(-1, 2)
    tool_path = setpoints if tool_path is None else tool_path
    axis_path = np.empty((0, 2)) if axis_path is None else axis_path
    floor, outlines, circles = world.floor.polygon, _outlines(world, base), parking_circles(world, stops)
    corners = shapely.bounds([area for area in areas if not area.is_empty])
    shapes = map(shapely.get_coordinates, (outlines, circles))
    low, high = window(floor, [corners.reshape(-1, 2), axis_path, tool_path, setpoints, *shapes])
    detail = max(OPTIONS.detail, float((high - low).max()) / OPTIONS.max_details)
    parts = shown_floor(world, detail)
    admissible, strong = drawn_union(areas, detail), drawn_union(used[0], detail)
    return FloorView(
        all=floor,
        free=_visible(parts.free - admissible, detail),
        turning=_visible(parts.turning - admissible, detail),
        rejected=_visible(parts.rejected - admissible, detail),
        zones=_visible(parts.zones - admissible, detail),
        pale=_visible(admissible - strong, detail),
        strong=_visible(strong, detail),
        words=(*used[1], rejected_words(world)),
        solids=seen_from_above(world),
        axis_path=axis_path,
        tool_path=tool_path,
        setpoints=setpoints,
        tool_axes=tool_axes(world)[..., :2],
        footprints=outlines,
        headings=_heading_strokes(base, outlines),
        low=low,
        high=high,
        circles=circles,
    )


def _outlines(world: World, base: Array) -> BaseGeometry:
    if len(world.robot.footprint) > 2:
        return footprint_hulls(world.robot, base)
    return shapely.buffer(shapely.points(base[:, :2]), 0.06)


def _visible(area: BaseGeometry, detail: float) -> BaseGeometry:
    """The parts of an area that are wider than the detail on average."""
    parts = shapely.get_parts(area)
    parts = parts[(shapely.area(parts) > 0) & (2 * shapely.area(parts) > detail * shapely.length(parts))]
    return shapely.multipolygons(parts)


def _heading_strokes(base: Array, outlines: BaseGeometry) -> Array:
    half = np.sqrt(shapely.area(outlines))[:, None] / 2
    along = half * np.column_stack([np.cos(base[:, 2]), np.sin(base[:, 2])])
    return np.stack([base[:, :2] + 0.4 * along, base[:, :2] + along], 1)


def seen_from_above(world: World) -> BaseGeometry:
    """Solids as seen from above."""
    shadows = [solid.shadow(OPTIONS.above_all) for solid in world.solids]
    areas = [shadow.shape() for shadow in shadows if shadow is not None]
    return shapely.union_all(areas) if areas else Polygon()


def window(floor: Polygon, lines: list[Array]) -> tuple[Array, Array]:
    """Corners of the window: around all points, but not far beyond the floor."""
    points = np.vstack(lines)
    points = points if len(points) else np.reshape(floor.bounds, (2, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = OPTIONS.margin + OPTIONS.margin_share * (high - low).max()
    bounds = np.array(floor.bounds)
    return (
        np.maximum(low - margin, np.minimum(low, bounds[:2]) - OPTIONS.floor_edge),
        np.minimum(high + margin, np.maximum(high, bounds[2:]) + OPTIONS.floor_edge),
    )
