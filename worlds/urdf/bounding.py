"""Hulls, boxes and capsules around points: every point is inside.

Of all capsules about one axis the one of least volume is found on a grid of radii: a thicker capsule may be
shorter, as its round ends reach further past the ends of its segment.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import shapely
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.chain import rot_x, rot_y, rot_z, translation
from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull, LinkSolid
from regionik.worlds.urdf.options import URDF

OPTIONS = URDF.bounding


@dataclass(frozen=True)
class _BoundingOptions:
    """Tolerances and counts of the search for bounds."""

    min_thickness: float = 1e-4  # [m], or share of the width where that is more than a metre
    min_hull_thickness: float = 1e-7  # of a much thinner cloud Qhull loses corners without an error
    max_planes: int = 400  # of an outer hull
    chunk: int = 10_000  # points projected at once
    max_boxed: int = 500  # points, above which trimesh's oriented box takes too long
    box_turns: tuple[float, ...] = (0.2, 0.1, 0.05, 0.02)  # of a box that is refined [rad]
    max_rounds: int = 4  # of each of these turns
    radii: int = 65  # of capsules that are tried
    min_radius: float = 1e-4  # and least side [m]
    min_sides: int = 8  # of a prism around a cylinder
    min_length: float = 1e-6  # of a segment, as engines want a direction [m]
    scale: float = 1 + 1e-9  # against rounding
    rounding: float = 1e-9  # of hulls [m]
    decimals: int = 10  # of corners of hulls [m]


_BOUNDS = _BoundingOptions()


def convex_hull(points: Array) -> Array:
    """Return the corners (m, 3) of the convex hull of points (n, 3); of a flat cloud, each point once."""
    distinct: Array = np.unique(points, axis=0)
    hull = _hull(distinct)
    return distinct if hull is None else np.asarray(distinct[hull.vertices], dtype=np.float64)


def hull_triangles(points: Array) -> Array:
    """Return the triangles (m, 3, 3) of the hull of points (n, 3); of a flat cloud, each point as one."""
    hull = _hull(points)
    faces: Array = np.repeat(points[:, None], 3, axis=1) if hull is None else points[hull.simplices]
    return faces


def outer_hull(points: Array) -> Array:
    """Return the corners (m, 3) of a polytope of many supporting planes around points (n, 3).

    A flat cloud has no such polytope: the corners of its hull are returned.
    """
    widths, axes = _principal_axes(points)
    if _is_flat(widths):
        return convex_hull(points)
    k = np.arange(_BOUNDS.max_planes) + 0.5  # directions evenly over the sphere, on a spiral
    z, turn = 1 - 2 * k / _BOUNDS.max_planes, np.pi * (1 + np.sqrt(5)) * k
    normals = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    middle, stretch = points.mean(0), axes * (widths / np.sqrt(len(points)))
    local = (points - middle) @ np.linalg.inv(stretch).T  # as wide one way as another
    chunks = np.array_split(local, 1 + len(points) // _BOUNDS.chunk)
    reach = np.max([(chunk @ normals.T).max(0) for chunk in chunks], axis=0)
    body = HalfspaceIntersection(np.column_stack([normals, -reach]), np.zeros(3))
    corners: Array = convex_hull(body.intersections) @ stretch.T + middle
    return corners


def oriented_box(points: Array) -> tuple[Array, Array]:
    """Return the frame (4, 4) and sizes (3,) of a small box around points (n, 3), at any angle [m].

    Sizes are 0 where points are flat. Of very many points it is one along the frame's or their principal
    axes.
    """
    widths, axes = _principal_axes(points)
    turns = [np.eye(3), axes]
    if 3 < len(points) <= _BOUNDS.max_boxed and not _is_flat(widths):  # trimesh fails on flat clouds
        turns.append(_engine_axes(points))
    return _smallest_box(points, turns)


def _engine_axes(points: Array) -> Array:
    """Axes (3, 3) of the least box that the engine knows; our own where it fails, as on doubled corners."""
    import trimesh  # takes long to load

    engine: Any = trimesh.bounds
    try:
        return np.asarray(engine.oriented_bounds(points)[0], dtype=np.float64)[:3, :3].T
    except ValueError:
        turned: Array = fast_oriented_box(points)[0][:3, :3]
        return turned


def fast_oriented_box(points: Array) -> tuple[Array, Array]:
    """Return a box as `oriented_box` does, faster: along the better axes, then turned while that helps."""
    T, size = _smallest_box(points, [np.eye(3), _principal_axes(points)[1]])
    for step in _BOUNDS.box_turns:
        for _ in range(_BOUNDS.max_rounds):
            before = float(np.prod(size + _BOUNDS.min_thickness))
            turns = (turn(angle) for turn in (rot_x, rot_y, rot_z) for angle in (step, -step))
            T, size = _smallest_box(points, [T[:3, :3], *(T[:3, :3] @ turn[:3, :3] for turn in turns)])
            if np.prod(size + _BOUNDS.min_thickness) >= before:
                break
    return T, size


def cylinder_hull(link: int, name: str, T_link: Array, radius: float, length: float) -> LinkHull:
    """Return a prism around a cylinder along z of ``T_link``, whose edges stand out by `max_excess` at most.

    Those of wide ones stand out by more, as their corners are ``max_corners``.
    """
    radius, half = max(radius, _BOUNDS.min_radius), max(length / 2, _BOUNDS.min_radius)
    sides = int(np.ceil(pi / np.arccos(radius / (radius + OPTIONS.max_excess))))
    corners = prism_corners(radius, half, min(max(sides, _BOUNDS.min_sides), OPTIONS.max_corners // 2))
    return LinkHull(link, name, transform_points(T_link, corners))


def cylinder_in(hull: LinkHull) -> tuple[Array, float, float] | None:
    """Return frame (4, 4), radius and length of the cylinder along z that a hull is a prism around.

    None where it is no prism of as many equal sides as `cylinder_hull` makes.
    """
    sides, odd = divmod(len(hull.corners), 2)
    if odd or sides < _BOUNDS.min_sides:
        return None
    low, high = hull.corners[:sides], hull.corners[sides:]
    spoke, along = low[0] - low.mean(0), high.mean(0) - low.mean(0)
    length, around = float(np.linalg.norm(along)), float(np.linalg.norm(spoke))
    if min(length, around) < _BOUNDS.min_radius:
        return None
    T = np.eye(4)
    T[:3, 0], T[:3, 2], T[:3, 3] = spoke / around, along / length, hull.corners.mean(0)
    T[:3, 1] = np.cross(T[:3, 2], T[:3, 0])
    radius = around * float(np.cos(pi / sides))
    again = transform_points(T, prism_corners(radius, length / 2, sides))
    return (T, radius, length) if np.abs(again - hull.corners).max() < _BOUNDS.rounding else None


def prism_corners(radius: float, half: float, sides: int) -> Array:
    """Return the corners (2 sides, 3) of a prism around a cylinder along z, from -half to half [m]."""
    angles = np.arange(sides) * 2 * pi / sides
    ring = radius / np.cos(pi / sides) * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (-half, half)])


def sphere_capsule(link: int, name: str, center: Array, radius: float) -> LinkCapsule:
    """Return a sphere as a capsule of next to no length."""
    return _capsule(link, name, translation(*center), radius, 0.0, 0.0)


def bounding_solid(link: int, name: str, points: Array) -> LinkSolid:
    """Return a solid around points (n, 3) in the link's frame: a hull of few corners where that is tighter.

    The least by volume of a few boxes and capsules is taken where it stands out by `max_excess` at most, or
    by no more than the hull.
    """
    found = [_least_solid(link, name, points, *box(points)) for box in (oriented_box, fast_oriented_box)]
    least = min(found, key=volume)
    hull = _hull(points)
    if hull is None or _excess(least, hull) <= OPTIONS.max_excess:
        return least
    tight = LinkHull(link, name, _few_corners(hull, oriented_box(points)[0][:3, :3]))
    return tight if _excess(tight, hull) < _excess(least, hull) else least


def _excess(solid: LinkSolid, hull: ConvexHull) -> float:
    """Return how far a solid stands out beyond the face of a hull that it stands out of most [m]."""
    reach = (hull.equations[:, :3] @ solid.corners.T).max(1) + solid.radius
    return float((reach + hull.equations[:, 3]).max())


def _few_corners(hull: ConvexHull, axes: Array) -> Array:
    """Return the corners of a polytope around a hull whose faces are some of the hull's, and of a box's.

    Of the hull's faces those are taken, one at a time, beyond which the polytope stands out most, until that
    is ``max_excess`` of the options, or the corners are ``max_corners``.
    """
    normals, offsets = hull.equations[:, :3], -hull.equations[:, 3]
    points, middle = hull.points[hull.vertices], hull.points[hull.vertices].mean(0)
    chosen = np.vstack([axes.T, -axes.T])
    corners = _bounded_by(chosen, points, middle)
    while True:
        beyond = corners @ normals.T - offsets
        worst = int(beyond.max(0).argmax())
        if beyond.max() <= OPTIONS.max_excess:
            return corners
        chosen = np.vstack([chosen, normals[worst]])
        finer = _bounded_by(chosen, points, middle)
        if len(finer) > OPTIONS.max_corners:
            return corners
        corners = finer


def _bounded_by(normals: Array, points: Array, middle: Array) -> Array:
    """Return the corners of the polytope of supporting planes of points (n, 3), ``middle`` being inside."""
    reach = ((points - middle) @ normals.T).max(0) * _BOUNDS.scale + _BOUNDS.rounding
    body = HalfspaceIntersection(np.column_stack([normals, -reach]), np.zeros(3))
    return convex_hull(np.round(body.intersections, _BOUNDS.decimals)) + middle


def rough_volume(points: Array) -> float:
    """Return the volume of the hull of points (n, 3), of flat ones that of a box around them [m^3]."""
    hull = _hull(points)
    return float(np.prod(fast_oriented_box(points)[1])) if hull is None else float(hull.volume)


def volume(solid: LinkSolid) -> float:
    """Return the volume of a link's solid [m^3]."""
    if isinstance(solid, LinkHull):
        return float(ConvexHull(solid.corners).volume)
    if isinstance(solid, LinkBox):
        return float(np.prod(solid.size))
    length = float(np.linalg.norm(solid.end - solid.start))
    return pi * solid.radius**2 * (length + 4 / 3 * solid.radius)


def _hull(points: Array) -> ConvexHull | None:
    """Return the hull; None of fewer than four points, and of points nearly in one plane."""
    if _is_flat(_principal_axes(points)[0], _BOUNDS.min_hull_thickness):
        return None
    try:
        return ConvexHull(points)
    except QhullError:
        return None


def _principal_axes(points: Array) -> tuple[Array, Array]:
    """Return widths (3,) of points along their principal axes, least first, and the axes as columns."""
    spread = points - points.mean(axis=0)
    squares, axes = np.linalg.eigh(spread.T @ spread)
    return np.sqrt(np.maximum(squares, 0.0)), axes * np.sign(np.linalg.det(axes))


def _is_flat(widths: Array, limit: float = _BOUNDS.min_thickness) -> bool:
    return bool(widths[0] <= limit * max(widths[2], 1.0))


def _smallest_box(points: Array, turns: list[Array]) -> tuple[Array, Array]:
    # Measured again, as rounding in an engine must not leave points outside.
    boxes = [(turn, (points @ turn).min(axis=0), (points @ turn).max(axis=0)) for turn in turns]
    turn, low, high = min(boxes, key=lambda box: float(np.prod(box[2] - box[1] + _BOUNDS.min_thickness)))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, turn @ ((low + high) / 2)
    return T, high - low


def _least_solid(link: int, name: str, points: Array, T_link_box: Array, size: Array) -> LinkSolid:
    """Return the box, or the capsule along one of its axes, whichever is smaller."""
    size = np.maximum(size * _BOUNDS.scale, _BOUNDS.min_radius)
    in_box = (points - T_link_box[:3, 3]) @ T_link_box[:3, :3]
    best: LinkSolid = LinkBox(link, name, T_link_box, size)
    least = float(np.prod(size))
    for along in range(3):
        across = [(along + 1) % 3, (along + 2) % 3]
        middle = _circle_center(in_box[:, across])
        radial = np.linalg.norm(in_box[:, across] - middle, axis=1)
        radius, start, end = _least_capsule(radial, in_box[:, along])
        size_of_capsule = float(_capsule_volume(*np.array([radius, start, end])))
        if size_of_capsule < least:
            least = size_of_capsule
            T = T_link_box.copy()
            T[:3, 3] += T_link_box[:3, across] @ middle
            T[:3, :3] = T_link_box[:3, [*across, along]]
            best = _capsule(link, name, T, radius, start, end)
    return best


def _circle_center(points: Array) -> Array:
    """Return the centre of the smallest circle around points (n, 2)."""
    with np.errstate(invalid="ignore"):  # points that are one but for rounding have a circle of NaN
        circle = shapely.minimum_bounding_circle(shapely.multipoints(points))
    found = shapely.get_coordinates(shapely.centroid(circle))
    center: Array = found[0] if np.isfinite(found).all() and len(found) else points[0]
    return center


def _least_capsule(radial: Array, axial: Array) -> tuple[float, float, float]:
    """Return radius, start and end of the least capsule about an axis.

    Points (n,) are given by their distances from the axis and along it.
    """
    thinnest = max(float(radial.max()), _BOUNDS.min_radius)
    half = float(np.ptp(axial)) / 2
    radii = np.linspace(thinnest, np.hypot(thinnest, half), _BOUNDS.radii)[:, None]
    bulge = np.sqrt(np.maximum(radii**2 - radial**2, 0.0))
    start, end = (axial + bulge).min(1), (axial - bulge).max(1)
    inside = start > end  # one ball holds all, wherever between the two its centre is
    start, end = np.where(inside, (start + end) / 2, start), np.where(inside, (start + end) / 2, end)
    best = int(np.argmin(_capsule_volume(radii[:, 0], start, end)))
    return float(radii[best, 0]), float(start[best]), float(end[best])


def _capsule_volume(radius: Array, start: Array, end: Array) -> Array:
    volume: Array = pi * radius**2 * (end - start) + 4 / 3 * pi * radius**3
    return volume


def _capsule(link: int, name: str, T_link: Array, radius: float, start: float, end: float) -> LinkCapsule:
    """Return a capsule about z of ``T_link``."""
    if end - start < _BOUNDS.min_length:
        start, end = (start + end - _BOUNDS.min_length) / 2, (start + end + _BOUNDS.min_length) / 2
    origin, along = T_link[:3, 3], T_link[:3, 2]
    ends = origin + start * along, origin + end * along
    return LinkCapsule(link, name, *ends, max(radius, _BOUNDS.min_radius) * _BOUNDS.scale)
