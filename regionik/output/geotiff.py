"""Reach fields as GeoTIFF; the only file that imports rasterio."""

from __future__ import annotations

from regionik.field import Field
from regionik.worlds.errors import InputError

# The floor has metres and no place on the Earth.
_LOCAL = 'LOCAL_CS["floor",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'


def geotiff(field: Field) -> bytes:
    """A field as a GeoTIFF of one band of whole numbers, north up, in metres of the floor.

    Raises
    ------
    InputError
        When rasterio is not installed.
    """
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
            crs=CRS.from_wkt(_LOCAL), compress="deflate",
        ) as image:  # fmt: skip
            image.write(field.values[::-1], 1)
            image.update_tags(world=field.world, most=field.most, meaning=field.meaning)
        data: bytes = memory.read()
    return data
