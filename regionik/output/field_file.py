"""Reach fields as files: arrays, a GeoTIFF, a picture. The only file that imports rasterio."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np

from regionik.reachability.field import Field
from regionik.storage.files import write_atomic
from regionik.view.figures import SUFFIXES, field_image
from regionik.worlds.errors import InputError

# The floor has metres and no place on the Earth.
_LOCAL_FRAME = 'LOCAL_CS["floor",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'


def write_field(field: Field, path: str | os.PathLike[str]) -> None:
    """Write a field to an ``.npz``, ``.tif``, ``.png`` or ``.svg`` file; the same field gives the same bytes.

    Parameters
    ----------
    field : Field
    path : path
        An ``.npz`` holds the arrays x, y, values, heading, the numbers cell, most, height, and as its meaning
        what values are and what they rest on.

    Raises
    ------
    InputError
        When the suffix is another, what it needs is not installed, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        data = _arrays(field)
    elif suffix in (".tif", ".tiff"):
        data = _geotiff(field)
    elif suffix in SUFFIXES:
        data = field_image(field, suffix)
    else:
        raise InputError(f"{path}: expected a file name ending in .npz, .tif, .tiff, {', '.join(SUFFIXES)}")
    write_atomic(path, data)


def _arrays(field: Field) -> bytes:
    data = io.BytesIO()
    np.savez_compressed(
        data,
        x=field.x,
        y=field.y,
        values=field.values,
        heading=field.heading,
        cell=np.float64(field.cell),
        most=np.int64(field.most),
        height=np.float64(np.nan if field.height is None else field.height),
        meaning=np.str_(field.meaning),
    )
    return data.getvalue()


def _geotiff(field: Field) -> bytes:
    """One band of whole numbers, north up, in metres of the floor."""
    try:
        from rasterio import Affine
        from rasterio.crs import CRS
        from rasterio.io import MemoryFile
    except ModuleNotFoundError as error:
        raise InputError(f"a GeoTIFF needs regionik[geotiff]: {error}") from None
    rows, columns = field.values.shape
    left, top = field.x[0] - field.cell / 2, field.y[-1] + field.cell / 2
    corner = Affine(field.cell, 0.0, left, 0.0, -field.cell, top)
    with MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=columns, height=rows, count=1, dtype="int32", transform=corner,
            crs=CRS.from_wkt(_LOCAL_FRAME), compress="deflate",
        ) as image:  # fmt: skip
            image.write(field.values[::-1], 1)
            image.update_tags(world=field.world, most=field.most, meaning=field.meaning)
        data: bytes = memory.read()
    return data
