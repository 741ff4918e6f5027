"""Random floors: outlines with bays and holes, and maps read from their files."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely
from PIL import Image
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from regionik.worlds.readers.occupancy_map import load_map
from regionik.worlds.scene import Floor

HOME = shapely.Point(-0.7, 0.0).buffer(0.6)  # round where random worlds start
CELL = 0.1  # of maps [m]
FREE, UNKNOWN, OCCUPIED = 254, 205, 0
MAP = (
    "image: map.pgm\nresolution: {}\norigin: [{}, {}, {}]\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\nnegate: 0\n"
)


def floor_of(seed: int) -> Floor:
    """A map for every third seed, an outline for the others; one in ten may leave no room for the start."""
    rng = np.random.default_rng([seed, 3])
    return mapped(rng) if seed % 3 == 0 else outlined(rng)


def outlined(rng: np.random.Generator, home: BaseGeometry = HOME) -> Floor:
    """A star of many corners, or a room with bays, with up to four holes; nearly always it holds ``home``."""
    if rng.random() < 0.5:
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 14)))
        reach = rng.uniform(1.2, 4.0, len(angles))
        corners = np.column_stack([1.2 + reach * np.cos(angles), reach * np.sin(angles)])
        ground: BaseGeometry = shapely.Polygon(corners).buffer(0)
    else:
        ground = shapely.box(-1.5, -2.0, 4.5, 2.0)
        for _ in range(rng.integers(1, 6)):
            x, y = rng.uniform([-1.5, -2.5], [4.5, 2.5])
            bay = patch(rng, x, y, 1.5)
            ground = ground.union(bay) if rng.random() < 0.5 else ground.difference(bay)
    for _ in range(rng.integers(0, 5)):
        x, y = rng.uniform([-0.5, -1.5], [3.5, 1.5])
        ground = ground.difference(patch(rng, x, y, 0.5))
    if rng.random() < 0.9:
        ground = ground.union(home)
    parts = [part for part in shapely.get_parts(ground) if part.geom_type == "Polygon" and part.area > 0.1]
    return Floor(max(parts, key=lambda part: part.area))


def patch(rng: np.random.Generator, x: float, y: float, size: float) -> BaseGeometry:
    """A turned rectangle, a disc or a cross about a place."""
    w, h = rng.uniform(0.05, 1.0, 2) * size
    shape: BaseGeometry = shapely.box(-w / 2, -h / 2, w / 2, h / 2)
    kind = rng.integers(3)
    if kind == 1:
        shape = shapely.Point(0, 0).buffer(w / 2)
    if kind == 2:
        shape = shape.union(shapely.box(-h / 2, -w / 2, h / 2, w / 2))
    placed: BaseGeometry = affinity.translate(affinity.rotate(shape, rng.uniform(0, 360)), x, y)
    return placed


def mapped(rng: np.random.Generator, home: BaseGeometry = HOME) -> Floor:
    """Blocks and specks, and what was not seen, on a map that may lie askew; ``home`` is mostly free."""
    rows, columns = 50, 65
    cells = np.full((rows, columns), FREE, dtype=np.uint8)
    for _ in range(rng.integers(2, 9)):
        row, column = rng.integers(rows), rng.integers(columns)
        tall, wide = rng.integers(1, 8, 2)
        cells[row : row + tall, column : column + wide] = rng.choice([OCCUPIED, OCCUPIED, UNKNOWN])
    cells[rng.random((rows, columns)) < 0.003] = OCCUPIED
    seen = rng.integers(0, 12)
    cells[:seen] = UNKNOWN
    yaw = float(rng.choice([0.0, rng.uniform(-0.4, 0.4)]))
    x, y = np.array([-1.5, -2.5]) + rng.uniform(-0.2, 0.2, 2)
    if rng.random() < 0.9:
        ahead, aside = (np.indices(cells.shape)[::-1] + 0.5) * CELL  # of the lower left corner
        across = x + np.cos(yaw) * ahead - np.sin(yaw) * aside
        up = y + np.sin(yaw) * ahead + np.cos(yaw) * aside
        cells[shapely.contains_xy(home, across, up)] = FREE
    with TemporaryDirectory() as folder:
        path = Path(folder) / "map.yaml"
        path.write_text(MAP.format(CELL, x, y, yaw))
        Image.fromarray(np.flipud(cells)).save(path.with_suffix(".pgm"))
        return load_map(path, float(rng.choice([0.1, 0.8])))
