"""Occupancy maps of ROS map_server: a YAML file and an image.

Pixel values become occupied, free or unknown as in https://wiki.ros.org/map_server (trinary maps).
No other file imports Pillow.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import ConfigDict, Field
from shapely.geometry import Polygon, box

from regionik.worlds.arrays import Array, Mask
from regionik.worlds.errors import FileNote, InputError, located
from regionik.worlds.obstacles import Prism
from regionik.worlds.readers.text import Strict, file_in, read_document, reading, validated
from regionik.worlds.scene import Floor

MAX_CELLS = 25_000_000
MAX_RUNS = 400_000  # of blocked cells along rows
_UNSEEN = (205, 128, 127)  # of map_server, and of mappers that take the middle
_SAME_GREY = 1e-3  # well below a step of 1/255
_FULL_SCALE = {"1": 1.0, "L": 255.0, "RGB": 255.0, "I": 65535.0, "I;16": 65535.0, "I;16B": 65535.0}


class MapDocument(Strict):
    """Keys of a map file; others are ignored."""

    model_config = ConfigDict(extra="ignore")

    image: Annotated[str, Field(min_length=1, description="the image file")]
    resolution: Annotated[float, Field(gt=0, description="the side of a cell [m]")]
    origin: Annotated[
        list[float],
        Field(min_length=3, max_length=3, description="x, y, yaw of the lower left corner [m, rad]"),
    ]
    occupied_thresh: Annotated[float, Field(ge=0, le=1, description="a number from 0 to 1")]
    free_thresh: Annotated[float, Field(ge=0, le=1, description="a number from 0 to 1")]
    negate: Literal[0, 1] | bool = 0
    mode: Literal["trinary"] = "trinary"


def load_map(yaml_path: Path, height: float, free_thresh: float | None = None) -> Floor:
    """Return the floor of a map file.

    Its polygon is the map's whole rectangle, its cells are one prism for each edge-connected blob of occupied
    or unknown cells, of a height [m]. The image (PGM or PNG) is relative to the file.

    ``free_thresh`` replaces the map's own. Maps are often saved with unseen cells as grey 205 and a threshold
    of 0.25, by which unseen cells (1 - 205/255 = 0.1961) count as free floor; 0.196 keeps them unknown.

    Warns
    -----
    FileNote
        Where cells of a grey that stands for unseen ones count as free.
    """
    where = str(yaml_path)
    document = validated(MapDocument, read_document(yaml_path), where)
    if not 0 < height < np.inf:
        raise InputError(f"height: must be above 0, got {height:g}")
    free = document.free_thresh if free_thresh is None else free_thresh
    if free >= document.occupied_thresh:
        raise InputError(
            f"{where}: free_thresh: must be below occupied_thresh {document.occupied_thresh:g}, got {free:g}"
        )
    with located(where, "image"):
        darkness, opaque = _read_image(file_in(yaml_path.parent, document.image), bool(document.negate))
        blocked = ~((darkness < free) & opaque)
    for note in _unseen(darkness[~blocked], bool(document.negate), free):
        warnings.warn(f"{where}: {note}", FileNote, stacklevel=2)
    with located(where, "image"):
        blobs = _blobs(blocked)
    rows, columns = blocked.shape
    cells = _prisms([_placed(part, document) for part in blobs], height)
    return Floor(_placed(box(0, 0, columns, rows), document), cells)


def _unseen(free: Array, negate: bool, threshold: float) -> Iterator[str]:
    """Yield a note for each grey of unseen cells that free ones have."""
    for grey in _UNSEEN:
        occupancy = 1 - grey / 255
        count = int((np.abs(free - occupancy) < _SAME_GREY).sum())
        if count:
            yield (
                f"{count} cells of grey {255 - grey if negate else grey}, which maps have where nothing was "
                f"seen, count as free floor by free_thresh {threshold:g}; "
                f"free_thresh: {int(occupancy * 1000) / 1000:g} beside map keeps them unknown"
            )


def _read_image(path: Path, negate: bool) -> tuple[Array, Mask]:
    """Return occupancy from 0 (free) to 1, and a mask of opaque cells; row 0 is the lowest y."""
    with reading(path):
        data = path.read_bytes()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            # Reading from memory, Pillow allocates no more than there is, whatever sizes the file claims.
            with Image.open(BytesIO(data), formats=["PPM", "PNG"]) as image:
                columns, rows = image.size
                if columns * rows > MAX_CELLS:
                    raise InputError(f"{path}: expected at most {MAX_CELLS} cells, got {columns} x {rows}")
                grey, opaque = _channels(image)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise InputError(f"{path}: expected at most {MAX_CELLS} cells") from None
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, EOFError):
        raise InputError(f"{path}: expected a PGM or PNG image that can be read whole") from None
    occupied = grey if negate else 1.0 - grey
    return np.flipud(occupied), np.flipud(opaque)


def _channels(image: Image.Image) -> tuple[Array, Mask]:
    """Return grey from 0 to 1, and a mask of opaque cells."""
    if image.mode in ("P", "PA", "RGBA", "LA") or "transparency" in image.info:
        values = np.asarray(image.convert("RGBA"))
        return _grey(values[..., :3], 255.0), values[..., 3] == 255
    if image.mode not in _FULL_SCALE:
        raise ValueError(f"image mode {image.mode}")
    grey = _grey(np.asarray(image), _FULL_SCALE[image.mode])
    return grey, np.ones(grey.shape, dtype=np.bool_)


def _grey(values: NDArray[Any], full: float) -> Array:
    return (values.mean(axis=-1, dtype=np.float64) if values.ndim == 3 else values) / full


def _blobs(blocked: Mask) -> list[Polygon]:
    """Return edge-connected blobs of cells, in units of cells.

    Runs along rows are joined in whole numbers, where the union is exact. A union keeps blobs apart that only
    touch at a corner, so that no label image is needed.
    """
    edges = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    _, last = np.nonzero(edges == -1)
    if len(row) > MAX_RUNS:
        text = f"expected at most {MAX_RUNS} runs of occupied or unknown cells along rows, got {len(row)}"
        raise InputError(text)
    runs = shapely.box(first, row, last, row + 1)
    joined = shapely.get_parts(shapely.union_all(runs))
    parts = [part for part in shapely.simplify(joined, 0.0) if not part.is_empty]  # all at once takes long
    return sorted(parts, key=lambda part: (part.bounds[1], part.bounds[0], part.bounds))


def _placed(part: Polygon, document: MapDocument) -> Polygon:
    """Return a polygon in cells as one in the world [m]."""
    x, y, yaw = document.origin
    c, s = (np.cos(yaw), np.sin(yaw)) if yaw else (1.0, 0.0)
    R = np.array([[c, s], [-s, c]])
    placed: Polygon = shapely.transform(part, lambda cells: cells * document.resolution @ R + [x, y])
    return placed


def _prisms(parts: list[Polygon], height: float) -> tuple[Prism, ...]:
    taken: dict[str, int] = {}
    prisms = []
    for part in parts:
        spot = part.representative_point()
        name = f"map cells near ({spot.x:z.1f}, {spot.y:z.1f})"
        taken[name] = taken.get(name, 0) + 1
        if taken[name] > 1:
            name = f"{name}, {taken[name]}"
        prisms.append(Prism(name, part, 0.0, height))
    return tuple(prisms)
