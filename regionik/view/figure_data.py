"""Curves of a plan, and its floor seen from above, as plain values that figures draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.collision.proximity import nearest
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, bodies_from
from regionik.postures.arm_guard import guard_of
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import is_timed, trajectory
from regionik.values import Motion, Plan, PlannedArea, Stop
from regionik.view.world_picture import DETAIL, rejected_area
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
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
class ClearanceCurves:
    """Distances at every state, (n,) each [m]; infinite where there is nothing to avoid."""

    base: Array  # footprint to the shadow of the nearest solid that the base could hit
    arm: Array  # the robot's solids to the nearest of the world, apart from allowed contact of the tool
    own: Array  # the robot's solids to each other and to its base, where these have to keep apart


@dataclass(frozen=True, eq=False)
class PlanCurves:
    """Curves of a plan along its motion."""

    timed: bool  # abscissas are times [s]; else numbers of states, from 1
    states: Array  # (n,) abscissa of every state
    along: Array  # (m,) abscissas of ``joints`` and ``speeds``
    joints: Array  # (m, dof)
    speeds: SpeedCurves | None  # None where the plan is not timed
    clearances: ClearanceCurves
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
        clearances=clearances(plan),
        setpoints=states[motion.kind == "setpoint"],
        lifted=_lifted(motion, states),
    )


def clearances(plan: Plan) -> ClearanceCurves:
    """Return the distances at every state of a plan."""
    world, motion = plan.world, plan.motion
    contact = guard_of(world).contact
    around = bodies_from(_without_self_collision(world.robot), world.solids, floor=world.floor_slab)
    return ClearanceCurves(
        base=_base_clearance(world, motion),
        arm=_distances(around, motion, contact) if world.arm_solids else np.full(len(motion), np.inf),
        own=_distances(bodies_from(world.robot, ()), motion, None),
    )


def _distances(bodies: Bodies, motion: Motion, contact: ContactTargets | None) -> Array:
    """Least distance at every state, negative where something overlaps, (n,) [m]."""
    pairs = zip(motion.base, motion.joints, strict=True)
    return np.array([nearest(bodies, base, joints, contact=contact).distance for base, joints in pairs])


def _without_self_collision(robot: Robot) -> Robot:
    """A robot whose solids may touch each other, so that only distances to the world count."""
    names = [solid.name for solid in robot.all_solids]
    pairs = tuple(combinations(names, 2))
    return replace(robot, footprint=np.zeros((1, 2)), unchecked=pairs)


def _base_clearance(world: World, motion: Motion) -> Array:
    """Footprint to the nearest shadow at every state, 0 where they meet, (n,) [m]."""
    shadows = [solid.shadow(world.robot.body_height) for solid in world.solids]
    shown = [shadow for shadow in shadows if shadow is not None and not shadow.core.is_empty]
    nearest_shadow = np.full(len(motion), np.inf)
    prints = footprints(world.robot, motion.base)
    for radius in sorted({shadow.radius for shadow in shown}):
        cores = shapely.STRtree([shadow.core for shadow in shown if shadow.radius == radius])
        which, distance = cores.query_nearest(prints, return_distance=True, all_matches=False)
        nearest_shadow[which[0]] = np.minimum(nearest_shadow[which[0]], distance - radius)
    clearance: Array = np.maximum(nearest_shadow, 0.0)
    return clearance


def footprints(robot: Robot, base: Array) -> shapely.Geometry:
    """Return the outlines of the base at poses (n, 3), an (n,) array of polygons."""
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1)
    corners = robot.footprint @ turn + base[:, None, :2]
    return shapely.convex_hull(shapely.multipoints(corners))


def _lifted(motion: Motion, states: Array) -> Array:
    """Intervals of transits, the motions to and from them included, (l, 2)."""
    transit = motion.kind == "transit"
    lifted = transit[:-1] | transit[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lifted, [False]])))
    spans: Array = states[edges].reshape(-1, 2)
    return spans


@dataclass(frozen=True, eq=False)
class FloorView:
    """A floor seen from above; shapes and lengths in metres of the world."""

    all: BaseGeometry
    free: BaseGeometry
    rejected: BaseGeometry  # too close to solids
    pale: BaseGeometry  # admissible for a set-point, but not for the whole path
    strong: BaseGeometry  # admissible for the whole path
    solids: BaseGeometry
    base_path: Array  # (n, 2)
    tool_path: Array  # (n, 2)
    setpoints: Array  # (n, 2)
    footprints: BaseGeometry  # (p,) outlines of the base at some set-points, first and last among them
    headings: Array  # (p, 2, 2) a stroke inside each of them along its heading
    low: Array  # (2,) corners of the window
    high: Array
    circles: BaseGeometry  # circles in which the base may park at its stops
    driven: bool = True  # ``base_path`` is driven; else it connects stops in their order

    @property
    def width(self) -> float:
        return float(self.high[0] - self.low[0])

    @property
    def height(self) -> float:
        return float(self.high[1] - self.low[1])


def plan_floor(plan: Plan) -> FloorView:
    """Return the floor of a plan as seen from above."""
    world, motion = plan.world, plan.motion
    at = np.flatnonzero(motion.kind == "setpoint")
    shown = motion.base[at[np.unique(np.linspace(0, len(at) - 1, POSES).round().astype(int))]]
    return _floor_view(
        world,
        base=np.array([stop.base for stop in plan.stops]) if plan.stops else shown,
        areas=plan.areas,
        base_path=world.robot.drive.trace(motion.base),
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
        base_path=base[:, :2],
        tool_path=setpoints,
        setpoints=setpoints,
        stops=stops,
    )
    return replace(view, driven=False)


def _floor_view(
    world: World,
    *,
    base: Array,
    areas: Sequence[PlannedArea],
    base_path: Array,
    tool_path: Array,
    setpoints: Array,
    stops: Sequence[Stop],
) -> FloorView:
    floor, outlines, circles = world.floor.polygon, _outlines(world, base), parking_circles(stops)
    corners = shapely.bounds([area.admissible for area in areas if not area.admissible.is_empty])
    shapes = map(shapely.get_coordinates, (outlines, circles))
    low, high = _window(floor, [corners.reshape(-1, 2), base_path, tool_path, setpoints, *shapes])
    detail = max(DETAIL, float((high - low).max()) / RESOLUTION)
    rejected = rejected_area(world).simplify(detail) & floor
    admissible = _union([area.admissible for area in areas], detail)
    strong = _union([area.pruned for area in areas], detail)
    return FloorView(
        all=floor,
        free=_visible(floor - rejected - admissible, detail),
        rejected=_visible(rejected - admissible, detail),
        pale=_visible(admissible - strong, detail),
        strong=_visible(strong, detail),
        solids=_from_above(world),
        base_path=base_path,
        tool_path=tool_path,
        setpoints=setpoints,
        footprints=outlines,
        headings=_heading_strokes(base, outlines),
        low=low,
        high=high,
        circles=circles,
    )


def parking_circles(stops: Sequence[Stop]) -> BaseGeometry:
    """Circles in which the base may park, one for each stop."""
    return MultiPolygon([Point(stop.base[:2]).buffer(stop.tolerance) for stop in stops])


def _outlines(world: World, base: Array) -> BaseGeometry:
    if len(world.robot.footprint) > 2:
        return footprints(world.robot, base)
    return shapely.buffer(shapely.points(base[:, :2]), 0.06)


def _union(areas: list[BaseGeometry], detail: float) -> BaseGeometry:
    """The union of many areas, as fine as it is drawn."""
    union = shapely.union_all([area.simplify(detail) for area in areas])
    # Overlapping rings leave thousands of holes: simplify and repair is far faster than to stay valid.
    return shapely.make_valid(union.simplify(detail, preserve_topology=False))


def _visible(area: BaseGeometry, detail: float) -> BaseGeometry:
    """The parts of an area that are wider than the detail on average."""
    parts = shapely.get_parts(area)
    parts = parts[(shapely.area(parts) > 0) & (2 * shapely.area(parts) > detail * shapely.length(parts))]
    return shapely.multipolygons(parts)


def _heading_strokes(base: Array, outlines: BaseGeometry) -> Array:
    half = np.sqrt(shapely.area(outlines))[:, None] / 2
    along = half * np.column_stack([np.cos(base[:, 2]), np.sin(base[:, 2])])
    return np.stack([base[:, :2] + 0.4 * along, base[:, :2] + along], 1)


def _from_above(world: World) -> BaseGeometry:
    shadows = [solid.shadow(TALL) for solid in world.solids]
    areas = [shadow.grown() for shadow in shadows if shadow is not None]
    return shapely.union_all(areas) if areas else Polygon()


def _window(floor: Polygon, lines: list[Array]) -> tuple[Array, Array]:
    """Corners of the window: around all points, but not far beyond the floor."""
    points = np.vstack(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN + SHARE * (high - low).max()
    bounds = np.array(floor.bounds)
    return (
        np.maximum(low - margin, np.minimum(low, bounds[:2]) - EDGE),
        np.minimum(high + margin, np.maximum(high, bounds[2:]) + EDGE),
    )
