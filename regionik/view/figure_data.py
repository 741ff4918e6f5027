"""Curves of a plan, and its floor seen from above, as plain values that figures draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.postures.poses import axis_of
from regionik.regions import Area
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import is_timed, trajectory
from regionik.values import Plan, Stop
from regionik.verification.base_clearance import footprint_hulls
from regionik.view.clearance import Clearances, clearances
from regionik.view.floor_areas import (
    DETAIL,
    area_words,
    axis_path,
    drawn_union,
    parking_circles,
    rejected_words,
    shown_floor,
    used_areas,
)
from regionik.view.timeline import lifted_intervals
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

SAMPLES = 1000  # of a timed plan, at even times besides its states
POSES = 8  # at which the base is shown
MARGIN, SHARE = 0.3, 0.15  # shown around all there is: this [m] and this share of its size
EDGE = 0.1  # shown beyond the floor [m]
RESOLUTION = 2000  # details across a picture
TALL = 100.0  # above every solid [m]


@dataclass(frozen=True, eq=False)
class SpeedCurves:
    """Speeds of a timed plan at the samples of its curves."""

    joints: Array  # (n, dof) [rad/s], [m/s]
    tool: Array  # (n,) of the tool's origin [m/s]
    base: Array  # (n,) of the base's origin [m/s]


@dataclass(frozen=True, eq=False)
class PlanCurves:
    """Curves of a plan along its motion."""

    timed: bool  # abscissas are times [s]; else numbers of states, from 1
    states: Array  # (n,) abscissa of every state
    along: Array  # (m,) abscissas of ``joints`` and ``speeds``
    joints: Array  # (m, dof)
    speeds: SpeedCurves | None  # None where the plan is not timed
    clearances: Clearances
    setpoints: Array  # (k,) abscissas of set-points
    lifted: Array  # (l, 2) intervals in which the tool is lifted


def plan_curves(plan: Plan) -> PlanCurves:
    """Return the curves of a plan."""
    motion, timed = plan.motion, is_timed(plan.motion)
    states = motion.time if timed else np.arange(1.0, len(motion) + 1)
    along, joints, speeds = states, motion.joints, None
    if timed:
        along = np.union1d(states, np.linspace(0.0, states[-1], SAMPLES))
        sample = trajectory(plan).sample(along)
        joints = sample.joints
        speeds = SpeedCurves(
            joints=sample.joint_velocity,
            tool=np.linalg.norm(tool_velocity(plan.world.robot, *sample.columns[:2]), axis=1),
            base=np.hypot(*sample.base_velocity[:, :2].T),
        )
    return PlanCurves(
        timed=timed,
        states=states,
        along=along,
        joints=joints,
        speeds=speeds,
        clearances=clearances(plan.world, motion.base, motion.joints),
        setpoints=states[motion.kind == "setpoint"],
        lifted=lifted_intervals(motion, states),
    )


@dataclass(frozen=True, eq=False)
class FloorView:
    """A floor seen from above; shapes and lengths in metres of the world."""

    all: BaseGeometry
    free: BaseGeometry
    turning: BaseGeometry  # the base may have room at some headings
    rejected: BaseGeometry  # it has none at any
    pale: BaseGeometry  # admissible for a set-point, but not for the whole path
    strong: BaseGeometry  # admissible for the whole path
    words: tuple[str, str, str]  # for what is strong, what is pale, and what is rejected
    solids: BaseGeometry
    axis_path: Array  # (n, 2) of the arm's axis
    tool_path: Array  # (n, 2)
    setpoints: Array  # (n, 2)
    footprints: BaseGeometry  # (p,) outlines of the base at some set-points, first and last among them
    headings: Array  # (p, 2, 2) a stroke inside each of them along its heading
    low: Array  # (2,) corners of the window
    high: Array
    circles: BaseGeometry  # circles in which the base may park at its stops
    driven: bool = True  # ``axis_path`` is driven; else it connects stops in their order

    @property
    def width(self) -> float:
        return float(self.high[0] - self.low[0])

    @property
    def height(self) -> float:
        return float(self.high[1] - self.low[1])

    @property
    def moves(self) -> bool:
        """True of a plan, false of a world and of stops that nothing drives between yet."""
        return self.driven and len(self.axis_path) > 0


def floor_view(what: Plan | World | Area) -> FloorView:
    """Return the floor of a plan, of a world with its start, or of an area with its target, from above."""
    if isinstance(what, Plan):
        return _plan_floor(what)
    if isinstance(what, World):
        return _world_floor(what)
    return _world_floor(replace(what.world, task=(what.target,)), what.inner)


def _plan_floor(plan: Plan) -> FloorView:
    world, motion = plan.world, plan.motion
    at = np.flatnonzero(motion.kind == "setpoint")
    shown = motion.base[at[np.unique(np.linspace(0, len(at) - 1, POSES).round().astype(int))]]
    return _floor_view(
        world,
        base=np.array([stop.base for stop in plan.stops]) if plan.stops else shown,
        areas=[area.admissible for area in plan.areas],
        used=(used_areas(plan), area_words(plan)),
        axis_path=axis_path(plan),
        tool_path=plan.tools()[:, :2],
        setpoints=np.array([target.position[:2] for target in world.task]).reshape(-1, 2),
        stops=plan.stops,
    )


def stops_floor(world: World, stops: Sequence[Stop]) -> FloorView:
    """Return the floor with stops as seen from above, straight lines between them."""
    base = np.array([stop.base for stop in stops])
    setpoints = np.array([world.task[i].position[:2] for stop in stops for i in stop.setpoints])
    view = _floor_view(
        world,
        base=base,
        areas=(),
        used=((), ("", "")),
        axis_path=axis_of(world.robot, base),
        tool_path=setpoints,
        setpoints=setpoints,
        stops=stops,
    )
    return replace(view, driven=False)


def _world_floor(world: World, area: BaseGeometry | None = None) -> FloorView:
    setpoints = np.array([target.position[:2] for target in world.task]).reshape(-1, 2)
    base = np.empty((0, 3)) if world.start is None else world.start.base[None]
    areas = () if area is None else (area,)
    return _floor_view(
        world,
        base=base,
        areas=areas,
        used=(areas, ("admissible area", "")),
        axis_path=np.empty((0, 2)),
        tool_path=setpoints,
        setpoints=setpoints,
        stops=(),
    )


def _floor_view(
    world: World,
    *,
    base: Array,
    areas: Sequence[BaseGeometry],
    used: tuple[Sequence[BaseGeometry], tuple[str, str]],
    axis_path: Array,
    tool_path: Array,
    setpoints: Array,
    stops: Sequence[Stop],
) -> FloorView:
    floor, outlines, circles = world.floor.polygon, _outlines(world, base), parking_circles(world, stops)
    corners = shapely.bounds([area for area in areas if not area.is_empty])
    shapes = map(shapely.get_coordinates, (outlines, circles))
    low, high = window(floor, [corners.reshape(-1, 2), axis_path, tool_path, setpoints, *shapes])
    detail = max(DETAIL, float((high - low).max()) / RESOLUTION)
    parts = shown_floor(world, detail)
    admissible, strong = drawn_union(areas, detail), drawn_union(used[0], detail)
    return FloorView(
        all=floor,
        free=_visible(parts.free - admissible, detail),
        turning=_visible(parts.turning - admissible, detail),
        rejected=_visible(parts.rejected - admissible, detail),
        pale=_visible(admissible - strong, detail),
        strong=_visible(strong, detail),
        words=(*used[1], rejected_words(world)),
        solids=seen_from_above(world),
        axis_path=axis_path,
        tool_path=tool_path,
        setpoints=setpoints,
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
    shadows = [solid.shadow(TALL) for solid in world.solids]
    areas = [shadow.grown() for shadow in shadows if shadow is not None]
    return shapely.union_all(areas) if areas else Polygon()


def window(floor: Polygon, lines: list[Array]) -> tuple[Array, Array]:
    """Corners of the window: around all points, but not far beyond the floor."""
    points = np.vstack(lines)
    points = points if len(points) else np.reshape(floor.bounds, (2, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN + SHARE * (high - low).max()
    bounds = np.array(floor.bounds)
    return (
        np.maximum(low - margin, np.minimum(low, bounds[:2]) - EDGE),
        np.minimum(high + margin, np.maximum(high, bounds[2:]) + EDGE),
    )
