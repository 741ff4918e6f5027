"""Pruning of the ladder: components that no full traversal of their run uses are cut, forward and backward.

The paths that are left have the fewest lift-offs, and every chain of components among them can be completed.
Source: M-FABRIK, experiment 4 (areas made for the whole path in advance).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeSpace, PathAreas, into_span, into_spans
from regionik.areas.ground import united
from regionik.explain.cut_off import beyond, cut_off, parted, poses_in
from regionik.explain.failures import no_place, split_stroke, too_many_lifts
from regionik.explain.several import together
from regionik.ladder import Ladder, Mask, build_ladder
from regionik.mfabrik import Solver, solver_for
from regionik.planners.driving.footprint_planner import is_joined
from regionik.planners.geometry.polygons import FlatPolygon, clamp_each
from regionik.planners.progress import track
from regionik.postures.poses import axis_of, pose_of
from regionik.regions import distinct_free_spaces, path_areas
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.strokes import stroke_span

TURN_WEIGHT = 0.1  # cost of a turn of the base against driving [m/rad]

Refusal = Callable[[], Explanation]


@dataclass(frozen=True, eq=False)
class Pruned:
    """A ladder after both cuts."""

    ladder: Ladder
    keep: Mask  # (m,) components that some traversal of their run uses
    breaks: tuple[int, ...]  # set-points before which the tool must be lifted

    def split(self, within: Mask) -> list[int]:
        """Set-points within strokes before which the tool must be lifted."""
        return [i for i in self.breaks if within[i]]

    def components_at(self, i: int) -> list[int]:
        """Components of a set-point that are left."""
        return self.ladder.components_at(self.keep, i)

    def area(self, i: int) -> BaseGeometry:
        """Return what is left of the area of set-point i."""
        rungs = self.ladder.rungs
        span = slice(rungs[i], rungs[i + 1])
        return united(self.ladder.component[span][self.keep[span]])

    def left(self, i: int) -> BaseGeometry | None:
        """Return what is left of the area of set-point i; None where that is all of it."""
        rungs = self.ladder.rungs
        return None if self.keep[rungs[i] : rungs[i + 1]].all() else self.area(i)

    @property
    def gap(self) -> int | None:
        """First set-point without any component left."""
        rungs = self.ladder.rungs
        left = [bool(self.keep[a:b].any()) for a, b in zip(rungs[:-1], rungs[1:], strict=True)]
        return None if all(left) else left.index(False)


def whole_path(scene: Scene) -> tuple[FreeSpace, PathAreas, Pruned]:
    """Return the free floor of the base, the areas of the whole path, and their pruned ladder.

    The arm faces its targets and the base turns freely where that suffices. Postures over the arm's back, and
    places for some headings only, are used where they save a lift-off or a target; drives that slabs of
    heading do not show, where else there is no path. Raises NoPlanFound where none of them spans it.
    """
    found: list[tuple[FreeSpace, PathAreas, Pruned]] = []
    refused: list[tuple[FreeSpace, PathAreas, Refusal]] = []
    for free_space, facings in distinct_free_spaces(scene):
        areas, pruned = prune_path(scene, free_space, facings)
        if not isinstance(pruned, Pruned):
            refused.append((free_space, areas, pruned))
            continue
        found.append((free_space, areas, pruned))
        if not pruned.breaks:
            break
    if not found:
        driven = (_driven_through(scene, free_space, areas) for free_space, areas, _ in refused)
        found = [one for one in driven if one is not None]
    if not found:
        raise NoPlanFound(refused[-1][2]())
    within = scene.within_strokes
    return min(found, key=lambda one: (len(one[2].split(within)), len(one[2].breaks)))


def spans(scene: Scene) -> bool:
    """Return True where areas alone span the path, without an explanation where they do not."""
    every = (prune_path(scene, free_space, facings)[1] for free_space, facings in distinct_free_spaces(scene))
    return any(isinstance(pruned, Pruned) for pruned in every)


def prune_path(
    scene: Scene, free_space: FreeSpace, facings: tuple[int, ...]
) -> tuple[PathAreas, Pruned | Refusal]:
    """Areas of all set-points for some facings, and their ladder pruned from the floor the base stands on.

    Where a set-point has no area, or none that the base can get to, or there are too many lift-offs, what
    explains it, which may take longer than all else.
    """
    areas = path_areas(scene, facings=facings, free_space=free_space)
    return areas, _cut(scene, free_space, build_ladder(areas, len(scene.task), free_space))


def _cut(scene: Scene, free_space: FreeSpace, ladder: Ladder) -> Pruned | Refusal:
    if ladder.empty:
        return partial(_unserved, scene, free_space, ladder)
    pieces, within = _start_pieces(scene, free_space, ladder), scene.within_strokes
    every = (prune(ladder, ladder.floor == piece, within) for piece in pieces)
    pruned = min(
        every, key=lambda found: (found.gap is not None, len(found.split(within)), len(found.breaks))
    )
    if pruned.gap is not None:
        return partial(_unserved, scene, free_space, ladder)
    split, allowed = pruned.split(within), scene.rules.max_lift_offs
    if split and not scene.rules.lift_within:
        return partial(_refused_lift, scene, pruned, split[0], split_stroke)
    if allowed is not None and len(pruned.breaks) > allowed:
        told = partial(too_many_lifts, number=allowed + 1, count=len(pruned.breaks))
        return partial(_refused_lift, scene, pruned, pruned.breaks[allowed], told)
    return pruned


def _driven_through(
    scene: Scene, free_space: FreeSpace, areas: PathAreas
) -> tuple[FreeSpace, PathAreas, Pruned] | None:
    """The free space with pieces joined by drives until areas span the path; None where they do not."""
    ladder = build_ladder(areas, len(scene.task), free_space)
    while (wider := _driven_on(scene, free_space, ladder)) is not None:
        free_space, ladder = wider, build_ladder(areas, len(scene.task), wider)
        pruned = _cut(scene, free_space, ladder)
        if isinstance(pruned, Pruned):
            return free_space, areas, pruned
    return None


def _driven_on(scene: Scene, free_space: FreeSpace, ladder: Ladder) -> FreeSpace | None:
    """The free space with one more piece joined to that which the base is on; None where no drive is found.

    Where a base passes only as it turns and drives at once, slabs of heading leave a gap: OMPL is asked, but
    where outer areas prove that there is no way.
    """
    piece = None if ladder.empty else _widest_piece(scene, free_space, ladder)
    if piece is None or len(free_space.sides) == 1 or scene.robot.drive.rolls:
        return None
    start, robot, off = start_place(scene), scene.robot, ladder.off(piece)
    here = _places(free_space, ladder, ladder.floor == piece)[0] if start is None else start
    for other in sorted(set(ladder.floor[_rung(ladder, off[0])].tolist()) - {-1}) if off else ():
        there = _places(free_space, ladder, ladder.floor == other)
        if parted(scene.free_floor.outer, here, there):
            continue
        ends = (pose_of(robot, row[:2], float(row[2])) for row in (here, there[0]))
        if is_joined(scene.footprint, *ends, planner=scene.rules.base_planner):
            return free_space.with_drive(piece, other)
    return None


def _places(free_space: FreeSpace, ladder: Ladder, some: Mask) -> Array:
    """Places and headings (n, 3) in some of the components, the largest first."""
    return poses_in(free_space, ladder.component[some], ladder.side[some])


def _refused_lift(scene: Scene, pruned: Pruned, i: int, told: Callable[..., Explanation]) -> Explanation:
    return told(scene, i, shapely.shortest_line(pruned.area(i - 1), pruned.area(i)))


def _unserved(scene: Scene, free_space: FreeSpace, ladder: Ladder) -> Explanation:
    """Explain all set-points without a place for the base, or with none that it gets to."""
    found = [no_place(scene, i) for i in track("reasons", ladder.empty)]
    piece = _widest_piece(scene, free_space, ladder)
    for i in ladder.off(piece):
        if piece is None or found:
            here = Polygon() if piece is None else shapely.union_all(free_space.whole(piece))
            failure = beyond(scene, i, here, shapely.union_all(ladder.component[_rung(ladder, i)]))
            cause = Cause("base", scene.robot.name)
            found.append(Explanation("ladder-broken", i, failure.reason, (cause,), failures=(failure,)))
        else:
            found.append(cut_off_from(scene, i, piece, ladder, free_space))
    return together(found)


def _widest_piece(scene: Scene, free_space: FreeSpace, ladder: Ladder) -> int | None:
    """The piece of free floor that the base starts on, else the one from which most set-points are done."""
    if scene.start is not None:
        return next(iter(_start_pieces(scene, free_space, ladder)), None)
    pieces = sorted(set(ladder.floor.tolist()) - {-1})
    return min(pieces, key=lambda piece: len(ladder.off(piece)), default=None)


def cut_off_from(scene: Scene, i: int, piece: int, ladder: Ladder, free_space: FreeSpace) -> Explanation:
    """Explain why the base does not get from the floor it works on to any component of set-point i."""
    span, own = _rung(ladder, i), ladder.floor == piece
    start, areas = start_place(scene), ladder.component[span]
    here = _places(free_space, ladder, own)[0] if start is None else start
    there, floor = poses_in(free_space, areas, ladder.side[span]), shapely.union_all(free_space.whole(piece))
    return cut_off(scene, i, here, there, floor, shapely.union_all(areas))


def _rung(ladder: Ladder, i: int) -> slice:
    """Components of a set-point."""
    return slice(*ladder.rungs[i : i + 2].tolist())


def _start_pieces(scene: Scene, free_space: FreeSpace, ladder: Ladder) -> list[int]:
    """Pieces of free floor for the base: the one it starts on, or any of the first set-point."""
    start = start_place(scene)
    if start is None:
        return sorted(set(ladder.floor[: ladder.rungs[1]].tolist()))
    piece = free_space.piece_at(start[:2], float(start[2]))
    return [] if piece is None else [piece]


def prune(ladder: Ladder, usable: Mask, within: Mask) -> Pruned:
    """Cut, run by run, every component that no full traversal of the run uses.

    Runs are made as long as they go, so that lift-offs are fewest: a run that could go on loses nothing by
    going on. One that ends ``within`` (n,) a stroke goes back to where that begins; what then goes on within
    one cannot be worked without a lift-off. ``usable`` (m,) masks the components that the base can get to at
    all.
    """
    rungs = ladder.rungs
    keep = np.zeros(len(ladder.component), dtype=bool)
    keep[: rungs[1]] = usable[: rungs[1]]
    starts, i = [0], 1
    while i < ladder.count:
        rung = slice(rungs[i], rungs[i + 1])
        keep[rung] = usable[rung] & _followed(keep, ladder.back[rung])  # forward cut
        if not keep[rung].any():
            begin = stroke_span(within, i)[0]
            i = begin if begin > starts[-1] else i
            keep[rungs[i] : rungs[i + 1]] = usable[rungs[i] : rungs[i + 1]]
            starts.append(i)
        i += 1
    for start, stop in zip(starts, [*starts[1:], ladder.count], strict=True):
        for i in range(stop - 2, start - 1, -1):
            rung = slice(rungs[i], rungs[i + 1])
            keep[rung] &= _followed(keep, ladder.ahead[rung])  # backward cut
    return Pruned(ladder, keep, tuple(starts[1:]))


def _followed(keep: Mask, neighbours: list[list[int]]) -> Mask:
    """Mask of the components of which a neighbour is kept; those of one group have one row of neighbours."""
    rows = {id(row): row for row in neighbours}
    followed = {key: any(keep[j] for j in row) for key, row in rows.items()}
    return np.array([followed[id(row)] for row in neighbours], dtype=bool)


def start_place(scene: Scene) -> Array | None:
    """First place of the arm axis and heading of the base, (3,); None where the world leaves it open."""
    if scene.start is None:
        return None
    return np.array([*axis_of(scene.robot, scene.start.base), scene.start.base[2]])


def solvers_along(
    scene: Scene, ladder: Ladder, free_space: FreeSpace, chain: Sequence[int]
) -> Iterator[Solver]:
    """Solver of each set-point, for its component of the chain and that component's headings."""
    for k in chain:
        yield solver_for(scene, ladder.family[k], ladder.flat(k), free_space.sides[ladder.side[k]].span)


def start_pose(scene: Scene, pruned: Pruned, component: int) -> tuple[Array, Array]:
    """Base and joints that M-FABRIK starts from: the world's start, or the middle of a component."""
    if scene.start is not None:
        return scene.start.base, scene.start.joints
    spot = pruned.ladder.component[component].representative_point()
    return np.array([spot.x, spot.y, 0.0]), scene.robot.carry


def choose_chain(pruned: Pruned, free_space: FreeSpace, start: Array | None) -> list[int]:
    """One kept component for each set-point, connected within every run, with the least base travel.

    Travel is that of a base that moves to the nearest point of the next component, as in M-FABRIK, and turns
    into its slab: a shortest path by dynamic programming. ``start`` (3,) is the first place of the arm axis
    and heading of the base.
    """
    ladder, size = pruned.ladder, len(pruned.keep)
    # Of the cheapest way to each component: the one before, cost, place and heading there.
    before, cost, spot, yaw = [-1] * size, np.zeros(size), np.zeros((size, 2)), np.zeros(size)
    for i in range(ladder.count):
        for k in pruned.components_at(i):
            component, span = ladder.flat(k), free_space.sides[ladder.side[k]].span
            if i > 0:
                every = pruned.components_at(i - 1)
                last = every if i in pruned.breaks else [j for j in ladder.back[k] if pruned.keep[j]]
                n, cost[k], spot[k], yaw[k] = _cheapest(component, span, cost[last], spot[last], yaw[last])
                before[k] = last[n]
            elif start is not None:
                here = np.zeros(1), start[None, :2], start[2:]
                _, cost[k], spot[k], yaw[k] = _cheapest(component, span, *here)
            else:
                middle = ladder.component[k].representative_point()
                spot[k], yaw[k] = (middle.x, middle.y), into_span(0.0, span)
    chain = [min(pruned.components_at(ladder.count - 1), key=cost.__getitem__)]
    while before[chain[-1]] >= 0:
        chain.append(before[chain[-1]])
    return chain[::-1]


def _cheapest(
    component: FlatPolygon, span: tuple[float, float], cost: Array, spot: Array, yaw: Array
) -> tuple[int, float, Array, float]:
    """The first way that goes on to the nearest point of a component, into its slab, at the least cost.

    Ways to spots (n, 2) with headings (n,) have cost so much (n,). Returned is which it is, and what it costs
    then, its spot and heading.
    """
    turned = into_spans(yaw, *span)
    spots = clamp_each(component.vertices, component.starts, spot)
    ways = np.linalg.norm(spots - spot, axis=1)
    total = cost + TURN_WEIGHT * np.abs(turned - yaw) + ways
    n = int(np.argmin(total))
    return n, float(total[n]), spots[n], float(turned[n])
