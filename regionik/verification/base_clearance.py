"""Proof that the base stays on its floor and clear of what it could hit.

Where the footprint does not turn, the hull of the footprints at both ends of an interval is what it sweeps.
Where it turns, it stays within the chord deviation of that hull.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.offsets import deepest_inside, farthest_outside
from regionik.values import Violation
from regionik.verification.motion import Indices, Mask, MotionSegments, chord_deviation
from regionik.verification.options import VERIFICATION
from regionik.verification.proofs import Finding, Intervals, IntervalVerdicts, StateNames, bisect, finding
from regionik.verification.tolerances import EXACT, OVERLAP, TURNING
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Solid
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World
from regionik.worlds.shadows import Shadow

OPTIONS = VERIFICATION.proofs


Shapes = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class _SweptFootprint:
    segments: MotionSegments

    def swept(self, segment: Indices, low: Array, high: Array) -> tuple[Shapes, Array]:
        """Hulls of the footprints at both ends of intervals, and how far it may leave them between [m]."""
        ends = [_corners(self.segments.robot, self.segments.base_at(segment, s)) for s in (low, high)]
        return _hulls(np.concatenate(ends, axis=1)), chord_deviation(self._acceleration[segment], high - low)

    @property
    def moving(self) -> Mask:
        """Segments on which the base moves."""
        base = self.segments.motion.base
        found: Mask = (base[1:] != base[:-1]).any(axis=1)
        return found

    @property
    def exact(self) -> Mask:
        """Segments on which the hull is what the footprint sweeps: no turn, or a point that goes straight."""
        return np.abs(self.segments.turn) * (self._radius + np.abs(self.segments.rolled)) < 1e-12

    def moved(self, segment: Indices, part: Array) -> Array:
        """Upper bound for the motion of a corner over half an interval [m]."""
        length = self.segments.base_length[segment] + np.abs(self.segments.turn[segment]) * self._radius
        return length * part / 2

    @property
    def _radius(self) -> float:
        """Distance of the farthest corner from the base's origin [m]."""
        return float(np.linalg.norm(self.segments.robot.footprint, axis=1).max())

    @property
    def _acceleration(self) -> Array:
        """Upper bound for any point of the footprint: w^2 r + u w, (segments,) [m per segment^2]."""
        rate = np.abs(self.segments.turn)
        return rate * (rate * self._radius + np.abs(self.segments.rolled))


def footprint_hulls(robot: Robot, base: Array) -> Shapes:
    """Hulls of the footprint at base poses (n, 3), (n,)."""
    return _hulls(_corners(robot, base))


def base_shadows(world: World) -> list[tuple[Solid, Shadow]]:
    """The solids that the base could hit, and their shadows."""
    shadows = ((solid, solid.shadow(world.robot.body_height, above=0.0)) for solid in world.solids)
    return [(solid, shadow) for solid, shadow in shadows if shadow is not None and not shadow.core.is_empty]


def asked_of_base(world: World, solid: Solid) -> float:
    """Distance that the base has to keep from a solid, with what execution may take of it [m]."""
    return (world.rules.clearance if solid.clearance is None else solid.clearance) + world.base_allowance


def _corners(robot: Robot, base: Array) -> Array:
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    R = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1)
    return robot.footprint @ R + base[:, None, :2]


def _hulls(corners: Array) -> Shapes:
    hulls: Shapes = shapely.convex_hull(shapely.multipoints(corners))
    return hulls


def verify_floor(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """The footprint stays inside the floor."""
    ground: BaseGeometry = world.floor.polygon
    if world.base_allowance:
        ground = ground.buffer(-world.base_allowance, join_style="mitre")
    return verify_inside(Region("floor", "off the floor", "on the floor", ground), segments, names)


class Region(NamedTuple):
    """A part of the floor in which the footprint has to stay, and words on that."""

    kind: str  # of the check
    off: str
    inside: str
    ground: BaseGeometry


def verify_inside(region: Region, segments: MotionSegments, names: StateNames) -> Finding:
    """The footprint stays inside a region of the floor."""
    sweep = _SweptFootprint(segments)
    ground = region.ground
    edge = ground.boundary
    grown = {tol: shapely.buffer(ground, tol, join_style="mitre") for tol in (EXACT, TURNING)}
    for shape in (ground, edge, *grown.values()):
        shapely.prepare(shape)
    shapes = footprint_hulls(segments.robot, segments.motion.base)
    inside = shapely.covers(grown[EXACT], shapes)
    off = np.flatnonzero(~inside)
    out = _distances_outside(shapes[off], ground)
    where = [names.state(k) for k in off.tolist()]
    violations = [_left(region, names, *one) for one in zip(off.tolist(), where, out.tolist(), strict=True)]
    candidates = np.flatnonzero(inside[:-1] & inside[1:] & sweep.moving)
    exact = sweep.exact

    def examine(intervals: Intervals) -> IntervalVerdicts:
        k = candidates[intervals.item]
        hull, bulge = sweep.swept(k, intervals.low, intervals.high)
        within = np.where(exact[k], shapely.covers(grown[EXACT], hull), shapely.covers(grown[TURNING], hull))
        proven = within & (exact[k] | (bulge <= TURNING) | (shapely.distance(hull, edge) >= bulge))
        middle = footprint_hulls(segments.robot, segments.base_at(k, intervals.middle))
        refuted = np.where(exact[k], ~within, ~shapely.covers(grown[TURNING], middle))
        short = sweep.moved(k, intervals.length) + 100 * bulge < OPTIONS.min_base_motion
        return IntervalVerdicts(proven, refuted, short)

    failed = bisect(len(candidates), examine)
    segment, s = candidates[list(failed)], np.array(list(failed.values()))
    passed = footprint_hulls(segments.robot, segments.base_at(segment, s))
    whole = sweep.swept(segment, np.zeros(len(s)), np.ones(len(s)))[0]
    out = _distances_outside(np.where(exact[segment], whole, passed), ground)
    where = [names.segment(k) for k in segment.tolist()]
    violations += [
        _left(region, names, *one) for one in zip(segment.tolist(), where, out.tolist(), strict=True)
    ]
    inner = shapely.distance(shapes[inside], edge)
    return finding(region.kind, float(inner.min(initial=np.inf)), violations)


def _distances_outside(shapes: Shapes, ground: shapely.Geometry) -> Array:
    """Distances (n,) from the floor of the farthest point of each footprint; past the first, of a corner.

    Only one of the others is reported, the worst, and its distance is that of its farthest point too [m].
    """
    points, owner = shapely.get_coordinates(shapes, return_index=True)
    out = np.zeros(len(shapes))
    np.maximum.at(out, owner, shapely.distance(shapely.points(points), ground))
    most = OPTIONS.max_violations
    some = [*range(min(len(out), most))]
    if len(out) > most:
        some.append(most + int(np.argmax(out[most:])))
    out[some] = [farthest_outside(shapes[k], ground) for k in some]
    return out


def _left(region: Region, names: StateNames, state: int, where: str, out: float) -> Violation:
    text = f"the base is {region.off} {where}, by {out:.4f} m"
    if out <= TURNING:
        text = f"the base is not proven to stay {region.inside} {where}"
    return Violation(region.kind, state, names.owner(state), out, text)


def verify_base_clearance(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """The footprint keeps from the shadow of every solid it could hit what that or the rules ask for."""
    known = base_shadows(world)
    if not known:
        return finding("clearance", np.inf, [])
    cores: Shapes = np.array([shadow.core for _, shadow in known], dtype=object)
    shapely.prepare(cores)
    solids = tuple(solid.name for solid, _ in known)
    radii = np.array([shadow.radius for _, shadow in known])
    limits = np.array([asked_of_base(world, solid) for solid, _ in known])
    sweep = _SweptFootprint(segments)
    return _ClearanceProof(sweep, names, limits, solids, cores, radii).check()


@dataclass(frozen=True, eq=False)
class _ClearanceProof:
    sweep: _SweptFootprint
    names: StateNames
    limits: Array  # that are asked of each solid [m]
    solids: tuple[str, ...]
    cores: Shapes
    radii: Array

    def check(self) -> Finding:
        segments, exact = self.sweep.segments, self.sweep.exact
        shapes = footprint_hulls(segments.robot, segments.motion.base)
        state, solid = self._close_pairs(shapes, 0.0)
        distance = self._distances(shapes[state], solid)
        bad = distance < self.limits[solid] - EXACT
        depth = self._depths(shapes[state[bad]], solid[bad], distance[bad]).tolist()
        rows = list(zip(state[bad].tolist(), solid[bad].tolist(), depth, strict=True))
        violations = [self._violation(k, self.names.state(k), j, d) for k, j, d in rows]
        hit = {(k + step, j) for k, j, _ in rows for step in (0, -1)}
        count = len(segments)
        hull, bulge = self.sweep.swept(np.arange(count), np.zeros(count), np.ones(count))
        segment, solid = self._close_pairs(hull, bulge)
        pairs = zip(segment.tolist(), solid.tolist(), strict=True)
        fresh = np.array([pair not in hit for pair in pairs], dtype=bool)
        segment, solid = segment[fresh], solid[fresh]
        unproven = bisect(
            len(segment),
            lambda intervals: self._examine(segment[intervals.item], solid[intervals.item], intervals),
        )
        row, near = segment[list(unproven)], solid[list(unproven)]
        at = footprint_hulls(segments.robot, segments.base_at(row, np.array(list(unproven.values()))))
        met = np.where(exact[row], hull[row], at)
        found = self._depths(met, near, self._distances(met, near)).tolist()
        for k, j, distance in zip(row.tolist(), near.tolist(), found, strict=True):
            violations.append(self._violation(k, self.names.segment(k), j, distance))
        return finding("clearance", self._least_margin(np.concatenate([shapes, hull[exact]])), violations)

    def _depths(self, shapes: Shapes, solid: Indices, distance: Array) -> Array:
        """Distances, of the first footprints that overlap a shadow by how deep they are in it, below 0."""
        found, cores = distance.copy(), self.cores[solid]
        over = np.flatnonzero((shapely.area(cores) > 0) & shapely.intersects(shapes, cores))
        for k in over[: OPTIONS.max_violations].tolist():
            found[k] = -self.radii[solid[k]] - deepest_inside(shapes[k], cores[k])
        return found

    def _examine(self, segment: Indices, solid: Indices, intervals: Intervals) -> IntervalVerdicts:
        hull, bulge = self.sweep.swept(segment, intervals.low, intervals.high)
        exact = self.sweep.exact[segment]
        proven = self._distances(hull, solid) - np.where(exact, -EXACT, bulge - TURNING) >= self.limits[solid]
        segments = self.sweep.segments
        middle = footprint_hulls(segments.robot, segments.base_at(segment, intervals.middle))
        refuted = np.where(exact, ~proven, self._distances(middle, solid) < self.limits[solid] - TURNING)
        short = self.sweep.moved(segment, intervals.length) + 100 * bulge < OPTIONS.min_base_motion
        return IntervalVerdicts(proven, refuted, short)

    def _distances(self, shapes: Shapes, solid: Indices) -> Array:
        return _distances(shapes, self.cores[solid]) - self.radii[solid]

    def _close_pairs(self, shapes: Shapes, bulge: Array | float) -> tuple[Indices, Indices]:
        """Pairs of shapes and shadows that may be closer than the clearance."""
        within = (self.limits + self.radii).max() + bulge
        shape, core = shapely.STRtree(self.cores).query(shapes, predicate="dwithin", distance=within)
        order = np.lexsort((core, shape))
        return shape[order], core[order]

    def _least_margin(self, shapes: Shapes) -> float:
        """Least distance of any shape from any shadow beyond what is asked [m]."""
        found, kinds = [], np.column_stack([self.radii, self.limits])
        for radius, limit in np.unique(kinds, axis=0).tolist():
            tree = shapely.STRtree(self.cores[(kinds == (radius, limit)).all(axis=1)])
            _, distance = tree.query_nearest(shapes, return_distance=True, all_matches=False)
            found.append(float(distance.min()) - radius - limit)
        return min(found)

    def _violation(self, state: int, where: str, solid: int, distance: float) -> Violation:
        limit = float(self.limits[solid])
        how = "comes within" if distance < limit else "is not proven to stay outside"
        near = f"the base {how} {distance:z.4f} m of {self.solids[solid]} {where}"
        if distance < 0:
            near = f"the base is {-distance:.4f} m inside {self.solids[solid]} {where}"
        text = f"{near}; the clearance is {limit:g} m"
        return Violation("clearance", state, self.names.owner(state), max(0.0, limit - distance), text)


def _distances(shapes: Shapes, cores: Shapes) -> Array:
    """Distances [m], negative where shapes overlap by more than `OVERLAP`, though not by how much."""
    distance: Array = shapely.distance(shapes, cores)
    meet = distance <= 0
    shrunk = shapely.buffer(cores[meet], -OVERLAP, join_style="mitre")
    inner = shapely.distance(shapes[meet], shrunk) - OVERLAP
    distance[meet] = np.minimum(np.where(np.isnan(inner), -OVERLAP, inner), 0.0)
    return distance
