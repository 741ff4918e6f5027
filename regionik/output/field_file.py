"""Reach fields as files: arrays, a GeoTIFF, a picture."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np

from regionik.field import Field
from regionik.output.geotiff import geotiff
from regionik.storage.files import write_whole
from regionik.view.figures import SUFFIXES, picture_of_field
from regionik.worlds.errors import InputError


def write_field(field: Field, path: str | os.PathLike[str]) -> None:
    """Write a field to an ``.npz``, ``.tif``, ``.png`` or ``.svg`` file; the same field gives the same bytes.

    Parameters
    ----------
    field : Field
    path : path
        An ``.npz`` holds the arrays x, y, values, heading and the numbers cell, most, height.

    Raises
    ------
    InputError
        When the suffix is another, what it needs is not installed, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        data = _arrays(field)
    elif suffix in (".tif", ".tiff"):
        data = geotiff(field)
    elif suffix in SUFFIXES:
        data = picture_of_field(field, suffix)
    else:
        raise InputError(f"{path}: expected a file name ending in .npz, .tif, .tiff, {', '.join(SUFFIXES)}")
    write_whole(path, data)


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
    )
    return data.getvalue()
