"""Visual elements of a URDF file as surfaces of a robot, coarse enough for a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.errors import InputError
from regionik.worlds.links import CUBE_CORNERS
from regionik.worlds.readers.collada import Surface
from regionik.worlds.urdf.bounding import hull_triangles
from regionik.worlds.urdf.decomposition import CollisionPart
from regionik.worlds.urdf.elements import CollisionShape, UrdfModel
from regionik.worlds.urdf.kinematic_tree import PlacedLink
from regionik.worlds.urdf.meshes import MeshFiles
from regionik.worlds.visual_surfaces import VisualSurface, coarsened

TRIANGLES = 12_000  # of a robot
LARGEST_MESH = 500_000  # triangles of one that is read
GREY = 0x8A939C  # where a file gives no colour
_FACETS = 20  # round a circle


def visual_surfaces(
    model: UrdfModel, links: Iterable[PlacedLink], parts: Iterable[CollisionPart]
) -> tuple[VisualSurface, ...]:
    """Return what is seen of links, one surface for each colour of what moves together.

    Elements that cannot be read are passed over: pictures do without. The first surface on a link stands for
    those parts of it that are of links with surfaces.
    """
    meshes = MeshFiles(model.path)
    pieces: dict[tuple[int, int], list[Array]] = {}
    seen: set[str] = set()
    for link in links:
        for shape, color in model.visuals[link.name]:
            for one in _surfaces(shape, meshes):
                paint = color if color is not None else GREY if one.color is None else one.color
                placed = transform_points(link.T_owner_link @ shape.T_link_shape, one.triangles)
                pieces.setdefault((link.owner, paint), []).append(placed)
                seen.add(link.name)
    surfaces = []
    for (owner, paint), some in pieces.items():
        corners = np.concatenate(some).reshape(-1, 3)
        if np.isfinite(corners).all() and len(corners):
            surfaces.append(VisualSurface(owner, paint, corners, np.arange(len(corners)).reshape(-1, 3)))
    shown: dict[int, tuple[str, ...]] = {}
    for part in parts:
        if part.sources & seen:
            shown[part.link] = (*shown.get(part.link, ()), part.solid.name)
    coarse = coarsened(tuple(surfaces), TRIANGLES)
    return tuple(replace(one, stands_for=shown.pop(one.link, ())) for one in coarse)


def _surfaces(shape: CollisionShape, meshes: MeshFiles) -> Iterator[Surface]:
    """Yield the surface of a visual element in its own frame."""
    if shape.kind != "mesh":
        yield Surface(hull_triangles(_corners(shape)), None)
        return
    with suppress(InputError):
        yield from (one for one in meshes.colored(shape) if len(one.triangles) <= LARGEST_MESH)


def _corners(shape: CollisionShape) -> Array:
    """Return corners whose hull is a box, a cylinder or a sphere (n, 3)."""
    if shape.kind == "box":
        box: Array = CUBE_CORNERS * np.array(shape.size) / 2
        return box
    angle = 2 * np.pi * np.arange(_FACETS) / _FACETS
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_FACETS)])
    up = np.array([0.0, 0.0, 1.0])
    if shape.kind == "cylinder":
        radius, length = shape.size
        return np.concatenate([radius * ring + end * length / 2 * up for end in (-1, 1)])
    heights = np.linspace(-1, 1, _FACETS // 2 + 1)
    sphere = [np.sqrt(1 - z * z) * ring + z * up for z in np.sin(heights * np.pi / 2).tolist()]
    return np.unique(shape.size[0] * np.concatenate(sphere), axis=0)
