"""Proof that the base stays on its floor and clear of what it could hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.values import Violation
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import Indices, Journey, Mask, Parts, Verdicts, prove, sag
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

EXACT = 1e-9  # where the floor swept by a hop is known exactly [m]
TURNING = 1e-6  # where the footprint turns on the way [m]
OVERLAP = 4e-6  # that shapes must have in common to be told from shapes that touch [m]
SHORTEST = 1e-6  # motion of the footprint over half a part below which its halves are not looked at [m]

Shapes = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class _Sweep:
    """The footprint on its way."""

    journey: Journey

    def footprints(self, base: Array) -> Shapes:
        return _hulls(self._corners(base))

    def swept(self, hop: Indices, low: Array, high: Array) -> tuple[Shapes, Array]:
        """Hulls of the footprints at both ends of parts, and how far the footprint strays out of them [m]."""
        ends = [self._corners(self.journey.base(hop, s)) for s in (low, high)]
        return _hulls(np.concatenate(ends, axis=1)), sag(self._acceleration[hop], high - low)

    @property
    def exact(self) -> Mask:
        """Hops on which the hull is what the footprint sweeps: no turn, or a point that goes straight."""
        straight: Mask = np.abs(self.journey.turn) * (self._far + np.abs(self.journey.arc)) < 1e-12
        return straight

    def moved(self, hop: Indices, part: Array) -> Array:
        """Most that a corner moves over half a part [m]."""
        way = self.journey.length[hop] + np.abs(self.journey.turn[hop]) * self._far
        length: Array = way * part / 2
        return length

    @property
    def _far(self) -> float:
        """Distance of the farthest corner from the base's middle [m]."""
        return float(np.linalg.norm(self.journey.robot.footprint, axis=1).max())

    @property
    def _acceleration(self) -> Array:
        """Bound for any point of the footprint, (hops,) [m per hop^2]."""
        rate = np.abs(self.journey.turn)
        bound: Array = rate * (rate * self._far + np.abs(self.journey.arc))
        return bound

    def _corners(self, base: Array) -> Array:
        c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
        turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1)
        corners: Array = self.journey.robot.footprint @ turn + base[:, None, :2]
        return corners


def _hulls(corners: Array) -> Shapes:
    n, k, _ = corners.shape
    owner = np.repeat(np.arange(n), k)
    points = shapely.multipoints(shapely.points(corners.reshape(-1, 2)), indices=owner)
    hulls: Shapes = shapely.convex_hull(points)
    return hulls


def floor(world: World, journey: Journey, words: Words) -> Finding:
    """Footprint inside the floor, on all the way."""
    sweep = _Sweep(journey)
    ground = world.floor.polygon
    edge = ground.boundary
    roomy = {tol: shapely.buffer(ground, tol, join_style="mitre") for tol in (EXACT, TURNING)}
    for shape in (ground, edge, *roomy.values()):
        shapely.prepare(shape)
    standing = sweep.footprints(journey.motion.base)
    inside = shapely.covers(roomy[EXACT], standing)
    off = np.flatnonzero(~inside).tolist()
    violations = [_off_floor(words, k, words.state(k), standing[k], ground) for k in off]
    hops = np.flatnonzero(inside[:-1] & inside[1:])
    exact = sweep.exact

    def look(parts: Parts) -> Verdicts:
        hop = hops[parts.item]
        hull, bulge = sweep.swept(hop, parts.low, parts.high)
        within = np.where(
            exact[hop], shapely.covers(roomy[EXACT], hull), shapely.covers(roomy[TURNING], hull)
        )
        proven = within & (exact[hop] | (bulge <= TURNING) | (shapely.distance(hull, edge) >= bulge))
        middle = sweep.footprints(journey.base(hop, parts.middle))
        failed = np.where(exact[hop], ~within, ~shapely.covers(roomy[TURNING], middle))
        return Verdicts(proven, failed, sweep.moved(hop, parts.high - parts.low) + 100 * bulge < SHORTEST)

    outcome = prove(len(hops), look)
    for item, s in {**outcome.failed, **outcome.stuck}.items():
        k = int(hops[item])
        one = np.array([k])
        if exact[k]:
            shape = sweep.swept(one, np.zeros(1), np.ones(1))[0][0]
        else:
            shape = sweep.footprints(journey.base(one, np.array([s])))[0]
        violations.append(_off_floor(words, k, words.hop(k), shape, ground))
    inner = shapely.distance(standing[inside], edge)
    return finding("floor", float(inner.min(initial=np.inf)), violations)


def _off_floor(
    words: Words, state: int, where: str, shape: shapely.Geometry, ground: shapely.Geometry
) -> Violation:
    outside = shapely.get_coordinates(shapely.difference(shape, ground))
    out = float(shapely.distance(shapely.points(outside), ground).max(initial=0.0))
    text = f"the base is off the floor {where}, by {out:.4f} m"
    return Violation("floor", state, words.owner(state), out, text)


def clearance(world: World, journey: Journey, words: Words) -> Finding:
    """Footprint at least ``clearance`` away from every solid it could hit, on all the way."""
    shadows = [(solid.name, solid.shadow(below=world.robot.body_height)) for solid in world.solids]
    known = [(name, shadow) for name, shadow in shadows if shadow is not None and not shadow.core.is_empty]
    if not known:
        return finding("clearance", np.inf, [])
    cores: Shapes = np.array([shadow.core for _, shadow in known], dtype=object)
    shapely.prepare(cores)
    names = tuple(name for name, _ in known)
    radii = np.array([shadow.radius for _, shadow in known])
    return _Clearance(_Sweep(journey), words, world.rules.clearance, names, cores, radii).check()


@dataclass(frozen=True, eq=False)
class _Clearance:
    sweep: _Sweep
    words: Words
    limit: float
    names: tuple[str, ...]
    cores: Shapes
    radii: Array

    def check(self) -> Finding:
        journey, exact = self.sweep.journey, self.sweep.exact
        standing = self.sweep.footprints(journey.motion.base)
        state, which = self._near(standing, 0.0)
        gap = self._gaps(standing[state], which)
        bad = gap < self.limit - EXACT
        rows = list(zip(state[bad].tolist(), which[bad].tolist(), gap[bad].tolist(), strict=True))
        told = [self._tell(k, self.words.state(k), w, g) for k, w, g in rows]
        hit = {(k + d, w) for k, w, _ in rows for d in (0, -1)}
        every = np.arange(journey.hops)
        hull, bulge = self.sweep.swept(every, np.zeros(journey.hops), np.ones(journey.hops))
        hop, which = self._near(hull, bulge)
        pairs = zip(hop.tolist(), which.tolist(), strict=True)
        fresh = np.array([pair not in hit for pair in pairs], dtype=bool)
        hop, which = hop[fresh], which[fresh]
        outcome = prove(len(hop), lambda parts: self._look(hop, which, parts))
        for item, s in {**outcome.failed, **outcome.stuck}.items():
            k, w = hop[item : item + 1], which[item : item + 1]
            shape = hull[k] if exact[k[0]] else self.sweep.footprints(journey.base(k, np.array([s])))
            told.append(
                self._tell(int(k[0]), self.words.hop(int(k[0])), int(w[0]), float(self._gaps(shape, w)[0]))
            )
        return finding("clearance", self._least(np.concatenate([standing, hull[exact]])) - self.limit, told)

    def _look(self, hop: Indices, which: Indices, parts: Parts) -> Verdicts:
        h, w = hop[parts.item], which[parts.item]
        hull, bulge = self.sweep.swept(h, parts.low, parts.high)
        exact = self.sweep.exact[h]
        proven = self._gaps(hull, w) - np.where(exact, -EXACT, bulge - TURNING) >= self.limit
        middle = self._gaps(self.sweep.footprints(self.sweep.journey.base(h, parts.middle)), w)
        failed = np.where(exact, ~proven, middle < self.limit - TURNING)
        return Verdicts(proven, failed, self.sweep.moved(h, parts.high - parts.low) + 100 * bulge < SHORTEST)

    def _gaps(self, shapes: Shapes, which: Indices) -> Array:
        gap: Array = _distances(shapes, self.cores[which]) - self.radii[which]
        return gap

    def _near(self, shapes: Shapes, bulge: Array | float) -> tuple[Indices, Indices]:
        """Pairs of shapes and shadows that may be closer than the clearance."""
        within = self.limit + self.radii.max() + bulge
        shape, core = shapely.STRtree(self.cores).query(shapes, predicate="dwithin", distance=within)
        order = np.lexsort((core, shape))
        return shape[order], core[order]

    def _least(self, shapes: Shapes) -> float:
        """Least distance of any shape from any shadow."""
        found = []
        for radius in np.unique(self.radii):
            tree = shapely.STRtree(self.cores[self.radii == radius])
            _, distance = tree.query_nearest(shapes, return_distance=True, all_matches=False)
            found.append(float(distance.min()) - float(radius))
        return min(found)

    def _tell(self, state: int, where: str, which: int, gap: float) -> Violation:
        how = "comes within" if gap < self.limit else "is not proven to stay outside"
        near = f"the base {how} {max(gap, 0.0):.4f} m of {self.names[which]} {where}"
        text = f"{near}; the clearance is {self.limit:g} m"
        return Violation("clearance", state, self.words.owner(state), max(0.0, self.limit - gap), text)


def _distances(shapes: Shapes, cores: Shapes) -> Array:
    """Distances, below 0 where shapes overlap by more than a touch, though not by how much."""
    distance: Array = shapely.distance(shapes, cores)
    met = distance <= 0
    inner = shapely.distance(shapes[met], shapely.buffer(cores[met], -OVERLAP, join_style="mitre")) - OVERLAP
    distance[met] = np.minimum(np.where(np.isnan(inner), -OVERLAP, inner), 0.0)
    return distance
