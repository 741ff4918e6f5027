"""The floor of a plan from above, as plain values that are drawn flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.curves import footprints
from regionik.plan import Plan
from regionik.rolling import trace
from regionik.scene_view import DETAIL, rejection_shown
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
    base_path, tool_path = trace(world.robot.base, motion.base), plan.tools()[:, :2]
    setpoints = np.array([target.position[:2] for target in world.task]).reshape(-1, 2)
    at = np.flatnonzero(motion.kind == "setpoint")
    shown = motion.base[at[np.unique(np.linspace(0, len(at) - 1, POSES).round().astype(int))]]
    outlines = footprints(world.robot, shown) if len(world.robot.footprint) > 2 else _discs(shown)
    low, high = _window(plan, [base_path, tool_path, setpoints, shapely.get_coordinates(outlines)])
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
    )


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


def _window(plan: Plan, lines: list[Array]) -> tuple[Array, Array]:
    """What is shown: everything of interest, and of the floor what lies near it."""
    areas = [area.admissible for area in plan.areas if not area.admissible.is_empty]
    points = np.vstack([shapely.bounds(areas).reshape(-1, 2), *lines])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = AROUND + SHARE * (high - low).max()
    bounds = np.array(plan.world.floor.polygon.bounds)
    return (
        np.maximum(low - margin, np.minimum(low, bounds[:2]) - EDGE),
        np.minimum(high + margin, np.maximum(high, bounds[2:]) + EDGE),
    )
