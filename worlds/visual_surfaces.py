"""Coloured surfaces of a robot: what pictures show of it, and nothing else knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.worlds.arrays import Array, Index, frozen, frozen_faces, one_line
from regionik.worlds.errors import InputError

MERGED = 1e-5  # corners in one cell of this side are one [m]
FINEST, GROWTH = 0.7, 1.25  # first cells that are tried, by the side of triangles of even size, and the next
_MOST_CELLS = 2_000_000  # along each side of a surface


@dataclass(frozen=True, eq=False)
class VisualSurface:
    """A surface of one colour that moves with one arm link."""

    link: int  # index into ``Chain.frames``; `regionik.worlds.links.BASE` for what is fixed to the base
    color: int  # 0xRRGGBB
    vertices: Array  # (n, 3) in the link's frame, in single precision, as files hold them [m]
    faces: Index  # (m, 3) indices of vertices
    stands_for: tuple[str, ...] = ()  # names of the robot's solids that need not be shown beside it

    def __post_init__(self) -> None:
        rounded = np.asarray(self.vertices, dtype=np.float32)
        object.__setattr__(self, "vertices", frozen(rounded, (None, 3), "visual surface: vertices"))
        faces = frozen_faces(self.faces, len(self.vertices), "visual surface: faces")
        object.__setattr__(self, "faces", faces)
        if not 0 <= self.color <= 0xFFFFFF:
            raise InputError(f"visual surface: color: expected 0 to 0xffffff, got {self.color}")
        object.__setattr__(self, "stands_for", tuple(self.stands_for))

    __repr__ = one_line


def coarsened(surfaces: tuple[VisualSurface, ...], most: int) -> tuple[VisualSurface, ...]:
    """Return surfaces with at most about ``most`` triangles in all.

    Corners in one cell of a grid become their mean, triangles in one cell vanish (vertex clustering,
    Rossignac and Borrel, 1993). All surfaces have the same grid, the finest that does.

    >>> corners = np.random.default_rng(1).uniform(size=(300, 3))
    >>> rough = coarsened((VisualSurface(0, 0, corners, np.arange(300).reshape(-1, 3)),), 40)
    >>> len(rough[0].faces) <= 40
    True
    """
    rough = tuple(_clustered(one, MERGED) for one in surfaces)
    cell = FINEST * np.sqrt(sum(_area(one) for one in rough) / most)
    while sum(len(one.faces) for one in rough) > most:
        rough = tuple(_clustered(one, cell) for one in rough)
        cell *= GROWTH
    return tuple(one for one in rough if len(one.faces))


def _area(surface: VisualSurface) -> float:
    """Area of a surface [m2]."""
    a, b, c = surface.vertices[surface.faces].swapaxes(0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


def _clustered(surface: VisualSurface, cell: float) -> VisualSurface:
    low = surface.vertices.min(axis=0)
    side = max(cell, float(np.ptp(surface.vertices, axis=0).max()) / _MOST_CELLS)
    x, y, z = ((surface.vertices - low) / side).astype(np.int64).T
    _, which, count = np.unique(
        (x * _MOST_CELLS + y) * _MOST_CELLS + z, return_inverse=True, return_counts=True
    )
    means = [np.bincount(which, column) / count for column in surface.vertices.T]
    faces = which[surface.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return VisualSurface(surface.link, surface.color, np.column_stack(means), faces)
