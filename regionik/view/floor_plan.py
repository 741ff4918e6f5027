"""The floor of a plan from above, as plain values that are drawn flat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.values import Plan, Stop
from regionik.view.plan_curves import footprints
from regionik.view.world_picture import DETAIL, rejection_shown
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

POSES = 8  # at which the base is shown
AROUND, SHARE = 0.3, 0.15  # shown round everything of interest: this [m] and this share of its size
EDGE = 0.1  # shown beyond the floor [m]
FINE = 2000  # widths of a picture that a detail is
TALL = 100.0  # higher than any solid, so that all of it is seen from above [m]


@dataclass(frozen=True, eq=False)
class FloorView:
    """What is seen of a plan from above; shapes and lengths in metres of the world.

    Attributes
    ----------
    all, free, rejected, pale, strong, solids : geometry
        The whole floor; of it what is free, what is too close to solids, what is admissible for some
        set-point but no part of the whole path, what is part of it; the solids.
    base_path, tool_path, setpoints : (n, 2) arrays
    footprints : (p,) array of shapes
        Outlines of the base at some set-points, the first and the last among them.
    noses : (p, 2, 2) array
        A stroke inside each of them towards where it faces.
    low, high : (2,) arrays
        Corners of what is shown.
    circles : geometry
        In which the base may park at its stops.
    driven : bool
        Whether the base's path is one it takes, not only the order of its stops.
    """

    all: BaseGeometry
    free: BaseGeometry
    rejected: BaseGeometry
    pale: BaseGeometry
    strong: BaseGeometry
    solids: BaseGeometry
    base_path: Array
    tool_path: Array
    setpoints: Array
    footprints: BaseGeometry
    noses: Array
    low: Array
    high: Array
    circles: BaseGeometry = field(default_factory=MultiPolygon)
    driven: bool = True

    @property
    def width(self) -> float:
        return float(self.high[0] - self.low[0])

    @property
    def height(self) -> float:
        return float(self.high[1] - self.low[1])


def floor_of(plan: Plan) -> FloorView:
    """What is seen of a plan from above."""
    world, motion = plan.world, plan.motion
    floor = world.floor.polygon
    base_path, tool_path = world.robot.drive.trace(motion.base), plan.tools()[:, :2]
    setpoints = np.array([target.position[:2] for target in world.task]).reshape(-1, 2)
    at = np.flatnonzero(motion.kind == "setpoint")
    shown = motion.base[at[np.unique(np.linspace(0, len(at) - 1, POSES).round().astype(int))]]
    if plan.stops:
        shown = np.array([stop.base for stop in plan.stops])
    outlines = _outlines(world, shown)
    areas = [area.admissible for area in plan.areas if not area.admissible.is_empty]
    corners = shapely.bounds(areas).reshape(-1, 2)
    low, high = _window(floor, [corners, base_path, tool_path, setpoints, shapely.get_coordinates(outlines)])
    detail = max(DETAIL, float((high - low).max()) / FINE)
    rejected = rejection_shown(world).simplify(detail) & floor
    admissible = _together([area.admissible for area in plan.areas], detail)
    strong = _together([area.pruned for area in plan.areas], detail)
    return FloorView(
        all=floor,
        free=_broad(floor - rejected - admissible, detail),
        rejected=_broad(rejected - admissible, detail),
        pale=_broad(admissible - strong, detail),
        strong=_broad(strong, detail),
        solids=_from_above(world),
        base_path=base_path,
        tool_path=tool_path,
        setpoints=setpoints,
        footprints=outlines,
        noses=_noses(shown, outlines),
        low=low,
        high=high,
        circles=circles_of(plan.stops),
    )


def floor_of_stops(world: World, stops: Sequence[Stop]) -> FloorView:
    """What is seen of stops from above, straight ways between them."""
    base, floor = np.array([stop.base for stop in stops]), world.floor.polygon
    setpoints = np.array([world.task[i].position[:2] for stop in stops for i in stop.setpoints])
    outlines, circles = _outlines(world, base), circles_of(stops)
    low, high = _window(floor, [setpoints, *map(shapely.get_coordinates, (outlines, circles))])
    detail = max(DETAIL, float((high - low).max()) / FINE)
    rejected = rejection_shown(world).simplify(detail) & floor
    return FloorView(
        all=floor,
        free=_broad(floor - rejected, detail),
        rejected=_broad(rejected, detail),
        pale=MultiPolygon(),
        strong=MultiPolygon(),
        solids=_from_above(world),
        base_path=base[:, :2],
        tool_path=setpoints,
        setpoints=setpoints,
        footprints=outlines,
        noses=_noses(base, outlines),
        low=low,
        high=high,
        circles=circles,
        driven=False,
    )


def circles_of(stops: Sequence[Stop]) -> BaseGeometry:
    """In which the base may park, one for each stop."""
    return MultiPolygon([Point(stop.base[:2]).buffer(stop.tolerance) for stop in stops])


def _outlines(world: World, base: Array) -> BaseGeometry:
    return footprints(world.robot, base) if len(world.robot.footprint) > 2 else _discs(base)


def _together(areas: list[BaseGeometry], detail: float) -> BaseGeometry:
    """The union of hundreds of areas, as finely as it is drawn."""
    union = shapely.union_all([area.simplify(detail) for area in areas])
    # Rings that overlap leave thousands of holes: quick and mended is far quicker than valid throughout.
    return shapely.make_valid(union.simplify(detail, preserve_topology=False))


def _broad(area: BaseGeometry, detail: float) -> BaseGeometry:
    """The parts of an area that can be seen: on average wider than the detail."""
    parts = shapely.get_parts(area)
    parts = parts[(shapely.area(parts) > 0) & (2 * shapely.area(parts) > detail * shapely.length(parts))]
    return shapely.multipolygons(parts)


def _discs(base: Array) -> BaseGeometry:
    """A small disc for a base that is a point."""
    return shapely.buffer(shapely.points(base[:, :2]), 0.06)


def _noses(base: Array, outlines: BaseGeometry) -> Array:
    reach = (
        np.sqrt(shapely.area(outlines))[:, None]
        / 2
        * np.column_stack([np.cos(base[:, 2]), np.sin(base[:, 2])])
    )
    return np.stack([base[:, :2] + 0.4 * reach, base[:, :2] + reach], 1)


def _from_above(world: World) -> BaseGeometry:
    shadows = [solid.shadow(TALL) for solid in world.solids]
    areas = [s.core.buffer(s.radius) if s.radius > 0 else s.core for s in shadows if s is not None]
    return shapely.union_all(areas) if areas else Polygon()


def _window(floor: Polygon, lines: list[Array]) -> tuple[Array, Array]:
    """What is shown: everything of interest, and of the floor what lies near it."""
    points = np.vstack(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = AROUND + SHARE * (high - low).max()
    bounds = np.array(floor.bounds)
    return (
        np.maximum(low - margin, np.minimum(low, bounds[:2]) - EDGE),
        np.minimum(high + margin, np.maximum(high, bounds[2:]) + EDGE),
    )
