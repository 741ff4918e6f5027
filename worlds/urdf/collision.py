"""Collision model of a URDF robot: the parts that move with the arm, and its base.

A base is a footprint up to some height, and solids for what stands above it: as one block, a base with a mast
would be as high as the mast and as wide as the base. It is cut at the height where the block below and boxes
around the parts above take least volume, among heights below which it covers nearly all of its floor area;
where that saves little, it stays one block. Parts that reach above the cut are kept whole as solids (meshes
from the cut upwards), and below it they are in the footprint too: nothing is left out at any height.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.chain import Chain
from regionik.worlds.disk_cache import cached
from regionik.worlds.links import (
    BASE,
    CUBE_CORNERS,
    LINK_RADIUS,
    LinkBox,
    LinkCapsule,
    LinkHull,
    LinkSolid,
    capsules_along,
)
from regionik.worlds.readers.text import join_names
from regionik.worlds.urdf.bounding import cylinder_hull, hull_triangles, prism_corners, sphere_capsule
from regionik.worlds.urdf.decomposition import CollisionPart, clip_triangles, decompose, mesh_part
from regionik.worlds.urdf.elements import CollisionShape, Inertial, UrdfModel
from regionik.worlds.urdf.kinematic_tree import PlacedLink
from regionik.worlds.urdf.meshes import MeshFiles
from regionik.worlds.urdf.options import URDF


@dataclass(frozen=True)
class _BaseOptions:
    """How a base is cut into a footprint and solids above it."""

    max_solids: int = 6  # above the footprint
    max_volume: float = 0.7  # share of the one block's volume, below which it is cut
    min_area: float = 0.9  # share of the whole base's floor area that the footprint keeps
    corners: int = 32  # of a footprint, and of a prism around a cylinder
    heights: int = 14  # evenly spread ones that are tried
    tops: int = 24  # of parts that are tried
    min_height: float = 0.02  # of a base, and of what stands on it [m]


_BASE = _BaseOptions()
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class CollisionModel:
    """Parts of a robot, each to be bounded by one solid."""

    parts: tuple[CollisionPart, ...]  # of the arm's links
    base: BaseShape
    notes: tuple[str, ...] = ()  # shapes that could not be read, and what replaces them
    oddities: tuple[str, ...] = ()  # shapes that are read as they are, and are hardly meant so


def collision_model(
    model: UrdfModel,
    links: Iterable[PlacedLink],
    chain: Chain,
    height: float | None,
    resting: frozenset[str] = frozenset(),
) -> CollisionModel:
    """Return the parts of links that move with the arm, and the base: cut at ``height``, where given [m].

    A box stays a box and a capsule a capsule, a cylinder becomes a prism of many sides, a sphere a capsule
    of next to no length, a mesh a few boxes and capsules; where there are many, those of a link share some
    (`regionik.worlds.urdf.decomposition`). A mesh that is missing or unreadable is noted, and something
    stands in for it (`regionik.worlds.urdf.collision`). Neither that nor ``resting`` links of the base decide
    where it is cut.
    """
    meshes = MeshFiles(model.path)
    parts: list[CollisionPart] = []
    fixed: list[CollisionPart] = []
    lacking: dict[int, set[str]] = {}
    missing: dict[tuple[str, bool], list[tuple[CollisionShape, PlacedLink]]] = {}
    sizes: dict[str, float] = {}
    for link in links:
        shapes = model.links[link.name]
        for k, shape in enumerate(shapes):
            surface = meshes.surface(shape) if shape.kind == "mesh" else np.empty((0, 3, 3))
            if isinstance(surface, str):
                missing.setdefault((surface, link.owner == BASE), []).append((shape, link))
                if link.owner == BASE and link.name not in lacking.setdefault(BASE, set()):
                    stand_in = solid_part(_base_stand_in(model, link))
                    fixed.append(replace(stand_in, sources=frozenset((link.name,))))
                lacking.setdefault(link.owner, set()).add(link.name)
                continue
            if len(surface):
                size = float(np.ptp(surface.reshape(-1, 3), axis=0).max())
                sizes[link.name] = max(size, sizes.get(link.name, 0.0))
            T = link.T_owner_link @ shape.T_link_shape
            name = link.name if len(shapes) == 1 else f"{link.name} {k + 1}"
            part = _part(link, name, shape, transform_points(T, surface), T)
            (fixed if link.owner == BASE else parts).append(part)
    stand_ins = [
        replace(solid_part(_arm_stand_in(chain, owner)), sources=frozenset(names))
        for owner, names in sorted(lacking.items())
        if owner != BASE
    ]
    notes = [_missing_note(why, some, chain) for (why, _), some in missing.items()]
    pieces = [*_bounded(parts), *stand_ins]
    if not pieces:
        notes.append(
            f"no arm link has a collision element: capsules of radius {LINK_RADIUS:g} m replace them"
        )
        pieces += [solid_part(capsule) for capsule in capsules_along(chain, LINK_RADIUS)]
    base = base_shape(fixed, height, resting | lacking.get(BASE, set()))
    ordered = sorted(pieces, key=lambda part: part.link)
    return CollisionModel(tuple(ordered), base, tuple(notes), _huge(sizes, chain))


def _bounded(
    parts: Sequence[CollisionPart], most: int = URDF.bounding.max_solids
) -> tuple[CollisionPart, ...]:
    """Return parts decomposed, each with its solid; to cut meshes takes long, so that is kept on disk."""

    def made() -> tuple[CollisionPart, ...]:
        none = np.empty((0, 3, 3))
        return tuple(replace(part, triangles=none, exact=part.solid) for part in decompose(parts, most))

    if not any(len(part.triangles) for part in parts):
        return made()
    return cached("bounded", (parts, most), made, (CollisionPart, LinkBox, LinkCapsule, LinkHull))


def _huge(sizes: dict[str, float], chain: Chain) -> tuple[str, ...]:
    """Return a note on links whose meshes are far larger than the arm is long."""
    arm = float(np.linalg.norm(chain.link_vectors, axis=1).sum())
    least = max(URDF.doubts.huge_mesh, URDF.doubts.huge_mesh_share * arm)
    huge = [(name, size) for name, size in sizes.items() if size > least]
    if not huge:
        return ()
    told = join_names((f"link {name} is {size:.3g} m in size" for name, size in huge), 8)
    return (f'{told}: perhaps in millimetres, for which its mesh wants scale="0.001 0.001 0.001"',)


def solid_part(solid: LinkSolid) -> CollisionPart:
    """Return a solid as a part."""
    around = np.concatenate([corner + solid.radius * CUBE_CORNERS for corner in solid.corners])
    return CollisionPart(solid.link, solid.name, around, np.empty((0, 3, 3)), solid)


def _part(link: PlacedLink, name: str, shape: CollisionShape, surface: Array, T: Array) -> CollisionPart:
    owner, sources = link.owner, frozenset((link.name,))
    if shape.kind == "mesh":
        return mesh_part(owner, name, surface, sources)
    points, solid = transform_points(T, _corners(shape, T)), _solid(owner, name, shape, T)
    return CollisionPart(owner, name, points, surface, solid, sources)


def _solid(owner: int, name: str, shape: CollisionShape, T: Array) -> LinkSolid:
    match shape.kind:
        case "box":
            return LinkBox(owner, name, T, np.array(shape.size))
        case "cylinder":
            return cylinder_hull(owner, name, T, *shape.size)
        case "capsule":
            radius, length = shape.size
            start, end = (T[:3, 3] + side * length / 2 * T[:3, 2] for side in (-1, 1))
            return LinkCapsule(owner, name, start, end, radius)
        case _:
            return sphere_capsule(owner, name, T[:3, 3], *shape.size)


def _corners(shape: CollisionShape, T: Array) -> Array:
    """Return points whose hull contains a shape, in its frame; those of round ones are of a prism."""
    if shape.kind == "box":
        box: Array = CUBE_CORNERS * np.array(shape.size) / 2
        return box
    radius = shape.size[0]
    half = shape.size[1] / 2 if shape.kind == "cylinder" else radius
    prism = prism_corners(radius, half, _BASE.corners)
    if shape.kind == "cylinder":
        return prism
    # The prism of a ball stands upright, so that its height is the ball's; a capsule is between two balls.
    upright: Array = prism @ T[:3, :3]
    if shape.kind == "sphere":
        return upright
    along = shape.size[1] / 2 * _UP
    return np.concatenate([upright - along, upright + along])


# --- the base


@dataclass(frozen=True, eq=False)
class BaseShape:
    """A footprint with the parts above it."""

    outline: Array  # (n, 2) convex footprint [m]; no rows where nothing is low
    height: float  # height up to which the footprint counts [m]; 0 for a base without parts
    parts: tuple[CollisionPart, ...] = ()  # parts that stand higher
    sources: frozenset[str] = frozenset()  # names of the links that it is of


def base_shape(
    parts: Sequence[CollisionPart], height: float | None, loose: frozenset[str] = frozenset()
) -> BaseShape:
    """Return the base that contains all parts; cut at ``height``, or where that saves most [m].

    ``loose`` links, such as a second arm's, do not decide where it is cut.
    """
    if not parts:
        return BaseShape(np.empty((0, 2)), 0.0)
    body = [part for part in parts if not part.sources <= loose]
    cut = _best_height(body or parts, _surface(body or parts)) if height is None else height
    tall = [_upper(part, cut) for part in parts if part.points[:, 2].max() > cut + _BASE.min_height / 2]
    solids = (
        solid
        for rests in (False, True)
        for solid in _bounded([part for part in tall if (part.sources <= loose) is rests], _BASE.max_solids)
    )
    sources = frozenset().union(*(part.sources for part in parts))
    return BaseShape(_convex_outline(_lower(_surface(parts), cut)), cut, tuple(solids), sources)


def _surface(parts: Sequence[CollisionPart]) -> Array:
    """Triangles (n, 3, 3) of parts."""
    return np.concatenate(
        [part.triangles if len(part.triangles) else hull_triangles(part.points) for part in parts]
    )


def _lower(surface: Array, cut: float) -> Array:
    """Return the points (n, 2) of a surface below a height, projected on the floor."""
    return clip_triangles(surface, -_UP, -cut).reshape(-1, 3)[:, :2]


def _upper(part: CollisionPart, cut: float) -> CollisionPart:
    """Return the part of a mesh above a height; other parts whole."""
    if not len(part.triangles) or part.points[:, 2].min() >= cut:
        return part
    return mesh_part(part.link, part.name, clip_triangles(part.triangles, _UP, cut), part.sources)


def _best_height(parts: Sequence[CollisionPart], surface: Array) -> float:
    """Return the height of the cut; the top where a cut saves little [m]."""
    tops = np.unique([part.points[:, 2].max() for part in parts])
    top = float(tops[-1])
    even = np.linspace(0.0, top, _BASE.heights)[1:-1]
    tried = {*tops[:: 1 + len(tops) // _BASE.tops].tolist(), *even.tolist()}
    block = {h: _ground(surface, h) for h in {*tried, top}}
    low = _BASE.min_height
    heights = sorted(h for h in tried if low <= h <= top - low and block[h] >= _BASE.min_area * block[top])
    room = {h: block[h] * h + _boxes(parts, h) for h in heights}
    best = min(heights, key=lambda h: room[h], default=top)
    return best if best in room and room[best] < _BASE.max_volume * block[top] * top else top


def _ground(surface: Array, cut: float) -> float:
    """Return the area of the footprint of all that is below a height [m^2]."""
    return float(shapely.convex_hull(shapely.multipoints(_lower(surface, cut))).area)


def _boxes(parts: Sequence[CollisionPart], cut: float) -> float:
    """Return the volume of boxes around the parts that reach above a height [m^3]."""
    high = (_upper(part, cut).points for part in parts if part.points[:, 2].max() > cut)
    return sum(float(np.prod(np.ptp(points, axis=0))) for points in high)


def _convex_outline(points: Array) -> Array:
    """Return a convex outline around points (n, 2), in order: their hull, or tangents to it."""
    hull = shapely.convex_hull(shapely.multipoints(points))
    if not len(points) or hull.geom_type != "Polygon" or hull.area < 1e-8:
        return np.empty((0, 2))
    corners = _ring(hull)
    if len(corners) <= _BASE.corners:
        return corners
    # Hundreds of corners would slow all that uses the outline; each tangent is at most a 200th of the radius
    # away from the hull.
    angles = np.arange(_BASE.corners) * 2 * pi / _BASE.corners
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    reach = (corners @ normals.T).max(0)
    step = 2 * pi / _BASE.corners
    sides = np.column_stack([-normals[:, 1], normals[:, 0]])
    along = (np.roll(reach, -1) - reach * np.cos(step)) / np.sin(step)
    outer = reach[:, None] * normals + along[:, None] * sides
    return _ring(shapely.convex_hull(shapely.multipoints(outer)))


def _ring(hull: Polygon) -> Array:
    """Return the corners of a hull, counter-clockwise."""
    corners: Array = np.asarray(orient(hull).exterior.coords)[:-1]
    return corners


def _arm_stand_in(chain: Chain, owner: int) -> LinkCapsule:
    """Return a capsule from a joint of the arm to the next one, or to the tool."""
    name, end = f"{chain.joints[owner].name} stand-in", chain.link_vectors[owner]
    if np.linalg.norm(end) < LINK_RADIUS:
        return sphere_capsule(owner, name, np.zeros(3), 2 * LINK_RADIUS)
    return LinkCapsule(owner, name, np.zeros(3), end, LINK_RADIUS)


def _base_stand_in(model: UrdfModel, link: PlacedLink) -> LinkBox:
    """Return a box round a link of the base: its frame, the joints on it, and how its mass is spread."""
    spots = [np.zeros(3), *(one.T_parent_joint[:3, 3] for one in model.joints if one.parent == link.name)]
    inertial = model.inertials.get(link.name)
    if inertial is not None and inertial.tensor.any():
        points = np.vstack([*spots, _inertia_box(inertial)])
    else:
        points = np.concatenate([spot + LINK_RADIUS * CUBE_CORNERS for spot in spots])
    low, high = points.min(axis=0), points.max(axis=0)
    T = np.eye(4)
    T[:3, 3] = (low + high) / 2
    return LinkBox(BASE, f"{link.name} stand-in", link.T_owner_link @ T, high - low)


def _inertia_box(inertial: Inertial) -> Array:
    """Corners (8, 3) in the link's frame of the solid box of a mass and its moments, made wider."""
    moments, axes = np.linalg.eigh(inertial.tensor)
    spread = np.clip(moments.sum() - 2 * moments, 0.0, None) / (2 * inertial.mass)  # variance along each axis
    half = np.sqrt(3 * spread)
    more = min(URDF.bounding.inertia_margin, float(half.max()))
    corners = (URDF.bounding.inertia_scale * half + more) * CUBE_CORNERS
    return transform_points(inertial.T_link_inertial, corners @ axes.T)


def _missing_note(why: str, meshes: Sequence[tuple[CollisionShape, PlacedLink]], chain: Chain) -> str:
    """Return the note of all meshes that are missing for one reason, of the base or of the arm."""
    (shape, link), *others = meshes
    if link.owner == BASE:
        instead = "a box of the size of its mass and joints stands in for it"
    else:
        name = chain.names[link.owner]
        instead = f"a capsule of radius {LINK_RADIUS:g} m from joint {name} to the next replaces it"
    more = f"; likewise of {', '.join(dict.fromkeys(one.name for _, one in others))}" if others else ""
    return f"{shape.place}: mesh {shape.file}: {why}; {instead}{more}"
