"""Obstacles of a world file that were scanned: point clouds and octomaps, read as boxes."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.errors import FileNote, InputError, located
from regionik.worlds.obstacles import Box
from regionik.worlds.readers.csv_path import PER_METRE, LengthUnit
from regionik.worlds.readers.octomap import read_octomap
from regionik.worlds.readers.point_cloud import read_points
from regionik.worlds.readers.text import FileName, Positive, Strict, file_in
from regionik.worlds.readers.voxels import boxes_of, coarser, occupied_cells

Heights = Annotated[list[float], Field(min_length=2, max_length=2)]
_WHOLE = 1e-6  # by which a number of cells may be off


class _Scan(Strict):
    z: Heights | None = Field(
        default=None, description="bottom and top of what is kept, as without the floor [m]"
    )

    def _heights(self) -> tuple[float, float]:
        low, high = (-np.inf, np.inf) if self.z is None else self.z
        if not low < high:
            raise InputError(f"z: expected bottom below top, got [{low:g}, {high:g}]")
        return low, high


class CloudShape(_Scan):
    """A point cloud, whose cells with points in them are solid."""

    file: FileName = Field(description="a PLY, PCD, XYZ or CSV file of points")
    voxel: Positive = Field(default=0.05, description="side of the cells, by which boxes may stand out [m]")
    unit: LengthUnit = Field(default="m", description="of the file's coordinates")
    min_points: Annotated[int, Field(ge=1)] = Field(
        default=1, description="points in a cell, of which fewer count as noise"
    )

    def solids(self, name: str, folder: Path, T_world_cloud: Array) -> tuple[Box, ...]:
        """Return the boxes that hold all points but noise, along the axes of the world."""
        low, high = self._heights()
        path = file_in(folder, self.file)
        with located("file", ""):
            points = transform_points(T_world_cloud, read_points(path) / PER_METRE[self.unit])
        points = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
        if not len(points):
            raise InputError(
                f"z: expected heights of the cloud, none of its points is from {low:g} to {high:g} m"
            )
        cells = occupied_cells(points, self.voxel, self.min_points)
        if not len(cells):
            raise InputError(f"min_points: no cell of {self.voxel:g} m has {self.min_points} points")
        boxes = boxes_of(name, cells, self.voxel)
        _note(path, f"{len(points)} points", boxes, self.voxel)
        return boxes


class OctomapShape(_Scan):
    """An octomap, whose occupied cells are solid."""

    file: FileName = Field(description="a .bt or .ot file of OctoMap")
    voxel: Positive | None = Field(
        default=None, description="side of larger cells, a multiple of the map's own, for fewer boxes [m]"
    )

    def solids(self, name: str, folder: Path, T_world_map: Array) -> tuple[Box, ...]:
        """Return the boxes that fill all occupied cells, along the axes of the map, which stands upright."""
        low, high = self._heights()
        path = file_in(folder, self.file)
        with located("file", ""):
            cells, side = read_octomap(path)
        bottom = cells[:, 2] * side + T_world_map[2, 3]
        kept = cells[(bottom + side > low) & (bottom < high)]
        if not len(kept):
            raise InputError(
                f"z: expected heights of the map, none of its cells is from {low:g} to {high:g} m"
            )
        factor = self._factor(side)
        boxes = boxes_of(name, coarser(kept, factor), factor * side)
        _note(path, f"{len(kept)} occupied cells", boxes, factor * side)
        return tuple(box.transformed(T_world_map) for box in boxes)

    def _factor(self, side: float) -> int:
        factor = 1 if self.voxel is None else round(self.voxel / side)
        if factor < 1 or abs(factor * side - (self.voxel or side)) > _WHOLE * side:
            raise InputError(f"voxel: expected a multiple of the map's {side:g} m, got {self.voxel:g}")
        return factor


def _note(path: Path, what: str, boxes: tuple[Box, ...], side: float) -> None:
    held = f"{len(boxes)} box{'es' if len(boxes) > 1 else ''}"
    note = f"{path}: {what} in {held}, up to {side:g} m (voxel) larger than what was scanned"
    warnings.warn(note, FileNote, stacklevel=2)
