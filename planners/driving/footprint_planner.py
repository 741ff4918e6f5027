"""Paths of a footprint that moves in any direction: it turns to pass where its circle would not.

RRTConnect is asked first. Where it gives up or wanders, a roadmap of free areas by heading is searched: the
base drives inside one slab of headings and turns where the areas of two overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from itertools import pairwise
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.planners.driving.footprint import fits, slide_is_free
from regionik.planners.driving.footprint_scene import (
    FootprintScene,
    Outline,
    footprint_scene,
    footprint_width,
)
from regionik.planners.driving.heading_slabs import Slab, slab_areas, slabs_along
from regionik.planners.driving.options import DRIVING
from regionik.planners.driving.point_planner import NoPathError, drive_point
from regionik.planners.driving.pose_planner import (
    SLIDE,
    Steering,
    checked_ends,
    direct,
    plan_poses,
    pose_text,
    same_pose,
    shortcut,
    slide_cost,
)
from regionik.planners.geometry.angles import wrap
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.drives import BasePlanner
from regionik.worlds.shadows import Shadow

OPTIONS = DRIVING
MIN_PASSAGE = 1e-3  # a narrower way is rounding of the floor [m]
SLAB_MARGIN = 1e-6  # from the edge of a slab's area, so that a path in it can be proven free [m]
MAX_LEG = 1e3  # longer than any leg of a path [m]

Method = Literal["straight", "ompl", "slabs"]
Node = tuple[int, int]  # slab, part of its area
Parts = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class FootprintPath:
    """Path of an omnidirectional base from one pose to another."""

    # (k, 3) x, y [m], yaw [rad]; between neighbours the base goes straight and turns evenly the shorter way,
    # and each such motion is proven free
    poses: Array
    # what found it. "slabs" is the roadmap of areas by heading, where RRTConnect gave up.
    method: Method

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", frozen(self.poses, (None, 3), "path"))


class NarrowPassageError(NoPathError):
    """The base does not pass.

    Attributes
    ----------
    passage : float
        Width of the narrowest place on the widest route, clearance taken off; 0 where there is none [m].
    across : float
        Smallest width of the footprint [m].
    """

    def __init__(self, reason: str, passage: float, across: float) -> None:
        super().__init__(reason)
        self.passage = passage
        self.across = across


@dataclass(frozen=True, eq=False)
class FootprintFloor:
    """A footprint and its surroundings, as for `footprint_scene`, prepared once for any number of drives."""

    footprint: ArrayLike
    floor: Polygon | MultiPolygon
    obstacles: Sequence[Shadow] = ()
    clearance: float = 0.0
    upper: Sequence[Outline] = ()

    @cached_property
    def scene(self) -> FootprintScene:
        return footprint_scene(self.footprint, self.floor, self.obstacles, self.clearance, self.upper)

    @cached_property
    def slabs(self) -> tuple[Slab, ...]:
        """Free areas by heading."""
        bounds = slabs_along(self.scene, OPTIONS.heading_slabs)
        return slab_areas(self.footprint, self.floor, self.obstacles, self.clearance, bounds, self.upper)

    def drive(
        self, start: ArrayLike, goal: ArrayLike, *, seed: int, planner: BasePlanner = "RRTConnect"
    ) -> FootprintPath:
        """Drive from pose to pose in any direction, turning on the way.

        Parameters
        ----------
        start, goal : (3,) array_like
            x, y [m], yaw [rad].
        seed : int
            Of the sampling planner, 0 or above. Same input, same path.
        planner : str
            OMPL's name of it.

        Raises
        ------
        NarrowPassageError
            When there is no path, or none was found; it has the width of the narrowest place.
        NoPathError, InputError
            As `footprint_scene` and `checked_ends`.

        Examples
        --------
        >>> from shapely import box
        >>> long = [[0.29, -0.19], [0.29, 0.19], [-0.29, 0.19], [-0.29, -0.19]]
        >>> corridor = box(0, 0, 2, 2) | box(1.9, 0.7, 4, 1.2)
        >>> FootprintFloor(long, corridor).drive([0.5, 1, 1.57], [3.5, 0.95, 0], seed=0).method
        'ompl'
        """
        scene = self.scene
        a, b = checked_ends(scene, start, goal, seed)
        if same_pose(a, b):
            return FootprintPath(a[None], "straight")
        base = sliding(scene)
        if direct(scene, base, a, b) is not None:
            return FootprintPath(np.stack([a, b]), "straight")
        found, cost = plan_poses(scene, base, a, b, seed, planner)
        if found is not None and cost <= OPTIONS.good_cost_ratio * slide_cost(base, a, b):
            return FootprintPath(found, "ompl")
        through = path_through_slabs(scene, self.slabs, a, b)
        if through is not None:
            through, least = shortcut(scene, base, through)
            if OPTIONS.good_cost_ratio * least < cost:  # it has more turns
                return FootprintPath(through, "slabs")
        if found is not None:
            return FootprintPath(found, "ompl")
        raise self._refusal(a, b)

    def _refusal(self, start: Array, goal: Array) -> NarrowPassageError:
        """Error that compares the narrowest place with the footprint and says if no way is a proof."""
        keep = [(shadow.core, self.clearance + shadow.kept) for shadow in self.obstacles]
        grown = [core.buffer(far) if far > 0 else core for core, far in keep]
        free = shapely.difference(self.floor, shapely.union_all(grown))
        passage = passage_width(free, Point(start[:2]), Point(goal[:2]))
        across = footprint_width(self.scene.corners)
        graph = [polygon_parts(slab.outer) for slab in self.slabs]
        proven = not connected(graph, *(nodes_at(self.slabs, graph, pose) for pose in (start, goal)))
        what = "no way" if proven else "no way was found"
        narrowest = f"its narrowest place is {passage:.3f} m wide"
        if passage <= MIN_PASSAGE:
            why = "the floor that is left there is in parts"
        elif passage < across:
            why = f"{narrowest}, the footprint nowhere less than {across:.3f} m"
        else:
            fits = f"the footprint only {across:.3f} m across, but too long for the bends on the way"
            why = f"{narrowest} and {fits}"
        reason = f"{what} from {pose_text(start)} to {pose_text(goal)}: {why}"
        return NarrowPassageError(reason, passage, across)


def sliding(scene: FootprintScene) -> Steering:
    """Steering of a base that drives every way; a turn costs what it moves the outermost corner by."""
    return Steering(SLIDE, 0.0, float(np.hypot(*scene.corners.T).max()))


def is_joined(
    scene: FootprintScene, start: Array, goal: Array, *, seed: int = 0, planner: BasePlanner = "RRTConnect"
) -> bool:
    """True if a sampling planner finds a way between poses (3,) where the footprint fits, turning on it."""
    base = sliding(scene)
    if not (fits(scene, *start) and fits(scene, *goal)):
        return False
    return direct(scene, base, start, goal) is not None or (
        plan_poses(scene, base, start, goal, seed, planner)[0] is not None
    )


def passage_width(free: BaseGeometry, start: BaseGeometry, goal: BaseGeometry) -> float:
    """Largest diameter of a disc that moves inside ``free`` from touching one shape to touching another [m].

    Examples
    --------
    >>> from shapely import box
    >>> hourglass = box(0, 0, 2, 2) | box(1.9, 0.7, 3, 1.2) | box(2.9, 0, 5, 2)
    >>> round(passage_width(hourglass, Point(1, 1), Point(4, 1)), 4)
    0.5
    """
    if free.is_empty:
        return 0.0
    low, high = 0.0, float(shapely.maximum_inscribed_circle(free).length)
    for _ in range(OPTIONS.passage_halvings):
        middle = (low + high) / 2
        parts = shapely.get_parts(free.buffer(-middle, quad_segs=32))
        # The disc may stand anywhere near a shape: the passage counts, not how narrow it is at its ends.
        met = [shapely.distance(parts, shape) <= middle for shape in (start, goal)]
        low, high = (middle, high) if bool((met[0] & met[1]).any()) else (low, middle)
    return 2 * low


def path_through_slabs(
    scene: FootprintScene, areas: Sequence[Slab], start: Array, goal: Array
) -> Array | None:
    """Poses (k, 3) from start to goal, driven inside slabs and turned where two overlap, or None."""
    graph = [polygon_parts(slab.inner.buffer(-SLAB_MARGIN)) for slab in areas]
    entry, leave = (_entry(scene, areas, graph, pose) for pose in (start, goal))
    if entry is None or leave is None:
        return None
    (first, a), (last, b) = entry, leave
    route = _shortest_route(graph, first, last, a[:2])
    if route is None:
        return None
    turns = [a[:2]]  # points at which the base turns from each node to the next
    for node, other in pairwise(route):
        turns.append(_nearest_shared(graph, node, other, turns[-1]))
    poses = [start, a]
    for (k, part), to in zip(route, [*turns[1:], b[:2]], strict=True):
        path = drive_point(graph[k][part], poses[-1][:2], to, step=MAX_LEG)
        poses += [np.array([*p, areas[k].middle]) for p in path.points]
    poses += [b, goal]
    kept = [p for k, p in enumerate(poses) if k == 0 or not np.array_equal(p, poses[k - 1])]
    return np.array(kept)


def polygon_parts(area: BaseGeometry) -> Parts:
    """Polygons of an area, without parts that have none."""
    found = shapely.get_parts(area)
    solid: Parts = found[shapely.area(found) > 0]
    return solid


def nodes_at(areas: Sequence[Slab], graph: Sequence[Parts], pose: Array) -> list[Node]:
    """Nodes whose slab and part hold a pose; at the border of slabs those of both."""
    return [
        (k, int(m))
        for k, slab in enumerate(areas)
        if abs(wrap(pose[2] - slab.middle)) <= (slab.high - slab.low) / 2 + 1e-9
        for m in np.flatnonzero(shapely.distance(graph[k], Point(pose[:2])) <= 1e-9)
    ]


def connected(graph: Sequence[Parts], first: list[Node], last: list[Node]) -> bool:
    """True if overlapping areas of neighbouring slabs lead from one set of nodes to another."""
    seen, open_ = set(first), list(first)
    while open_:
        node = open_.pop()
        new = [other for other in _neighbours(graph, node) if other not in seen]
        seen.update(new)
        open_ += new
    return not seen.isdisjoint(last)


def _neighbours(graph: Sequence[Parts], node: Node) -> list[Node]:
    """Overlapping parts of the slabs on both sides."""
    k, part = node
    near = ((k - 1) % len(graph), (k + 1) % len(graph))
    return [(j, int(m)) for j in near for m in np.flatnonzero(shapely.intersects(graph[j], graph[k][part]))]


def _entry(
    scene: FootprintScene, areas: Sequence[Slab], graph: Sequence[Parts], pose: Array
) -> tuple[Node, Array] | None:
    """Node and nearest pose in the middle of a slab that a straight motion from a pose leads to, or None."""
    trials = []
    for k, slab in enumerate(areas):
        turn = float(wrap(slab.middle - pose[2]))
        for part, area in enumerate(graph[k]):
            spot = shapely.shortest_line(area, Point(pose[:2])).coords[0]
            trials.append((np.hypot(*(spot - pose[:2])) + abs(turn), k, part, spot, pose[2] + turn))
    for _, k, part, spot, yaw in sorted(trials, key=lambda trial: trial[:3]):
        there = np.array([*spot, yaw])
        if slide_is_free(scene, pose, there):
            return (k, part), there
    return None


def _shortest_route(graph: Sequence[Parts], first: Node, last: Node, start: Array) -> list[Node] | None:
    """Nodes from first to last, greedily shortest between nearest points of overlaps (Dijkstra)."""
    heap: list[tuple[float, int, Node, tuple[float, float], Node | None]] = []
    heappush(heap, (0.0, 0, first, (float(start[0]), float(start[1])), None))
    came: dict[Node, Node | None] = {}
    count = 0
    while heap:
        cost, _, node, spot, before = heappop(heap)
        if node in came:
            continue
        came[node] = before
        if node == last:
            route = [node]
            while (back := came[route[-1]]) is not None:
                route.append(back)
            return route[::-1]
        for other in _neighbours(graph, node):
            if other not in came:
                to = _nearest_shared(graph, node, other, np.array(spot))
                count += 1
                # The turn counts a little, so that the base does not turn for nothing.
                far = cost + float(np.hypot(*(to - spot))) + 0.01
                heappush(heap, (far, count, other, (float(to[0]), float(to[1])), node))
    return None


def _nearest_shared(graph: Sequence[Parts], node: Node, other: Node, spot: Array) -> Array:
    """Point of the overlap of two nodes that is nearest to a spot."""
    shared = shapely.intersection(graph[node[0]][node[1]], graph[other[0]][other[1]])
    return np.array(shapely.shortest_line(shared, Point(spot)).coords[0])
