"""How long a saved change takes to be seen: 100 set-points among 100 obstacles, some of which move.

Run: python -m benchmarks.bench_live
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely
import yaml

from regionik.view import live
from regionik.view.viewer import start_server, stop
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World

SETPOINTS, OBSTACLES, SAVES = 100, 100, 30


def hall() -> World:
    """A wave through a hall full of boxes."""
    rng, share = np.random.default_rng(0), np.linspace(0, 1, SETPOINTS)
    path = np.column_stack([1 + 12 * share, 5 + np.sin(8 * share), np.full(SETPOINTS, 0.6)])
    size = np.array([0.3, 0.3, 0.5])
    boxes = [
        Box(f"box {k}", size, np.array([*rng.uniform([0, 0], [14, 10]), 0.25]), float(rng.uniform(0, 3)))
        for k in range(OBSTACLES)
    ]
    floor = Floor(shapely.box(0, 0, 14, 10))
    rules = Rules(clearance=0.1)
    return World("hall", robot_named("youbot"), floor, tuple(boxes), tuple(map(Target, path)), rules)


def main() -> None:
    document, times = world_to_document(hall()), []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "hall.yaml")
        path.write_text(yaml.safe_dump(document))
        rng, viewer = np.random.default_rng(1), start_server()

        def changes() -> Iterator[None]:
            for _ in range(SAVES):
                solid = document["obstacles"][int(rng.integers(OBSTACLES))]
                x = float(rng.uniform(1, 13))
                y = 5 + np.sin(8 * (x - 1) / 12) + rng.uniform(-0.6, 0.6)
                solid["box"]["center"][:2] = [x, float(y)]
                path.write_text(yaml.safe_dump(document))
                begun = time.perf_counter()
                yield
                times.append(time.perf_counter() - begun)

        try:
            live.watch(path, viewer, lambda line: None, changes())
        finally:
            stop(viewer)
    told = np.median(times), np.max(times)
    print(
        f"{SETPOINTS} set-points, {OBSTACLES} obstacles, {SAVES} saves, each moves an obstacle to the path:"
    )
    print(f"from the file to the viewer: median {told[0]:.3f} s, worst {told[1]:.3f} s")


if __name__ == "__main__":
    main()
