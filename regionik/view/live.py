"""`show --live`: watch a world file and draw again what its changes affect."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import grow, shadow_of
from regionik.view import triangle_meshes
from regionik.view.camera import camera_for
from regionik.view.live_areas import LiveAreas, live_areas
from regionik.view.picture import Color, Picture, SceneMesh, count_noun
from regionik.view.viewer import delete_node, draw_meshes, draw_message, set_scene
from regionik.view.world_picture import (
    DETAIL,
    floor_layer,
    floor_radius,
    map_meshes,
    obstacle_mesh,
    robot_meshes,
    start_state,
    task_meshes,
)
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import Floor, World

POLL_INTERVAL = 0.05  # [s]


def watch(
    path: Path, visualizer: Any, report: Callable[[str], None], changes: Iterator[None] | None = None
) -> None:
    """Draw a world, and again each time its file changes, until the changes end.

    A file that cannot be used is reported in one line, and the picture stays. Only the file itself is
    watched, not those it names.

    Parameters
    ----------
    path : Path
        A world file.
    visualizer : meshcat.Visualizer
    report : callable
        Called with the verdict, a line each time.
    changes : iterator, optional
        Yields once a change; by default `file_changes`, which never ends.

    Raises
    ------
    InputError
        When the file cannot be used at the start.
    """
    areas = live_areas(_load(path))
    camera = camera_for(areas.world, start_state(areas.world)[0][None, :2])
    set_scene(
        visualizer, Picture(areas.world.name, (), (), (), {}, camera, floor_radius(areas.world, camera))
    )
    shown = redraw(visualizer, {}, areas)
    draw_message(visualizer, verdict(areas), camera)
    report(verdict(areas))
    gc.freeze()  # what lives as long as the process: scanning it again takes a tenth of a second each time
    for _ in file_changes(path) if changes is None else changes:
        began = time.perf_counter()
        try:
            areas = live_areas(_load(path), areas)
        except InputError as error:
            draw_message(visualizer, str(error), camera)
            report(str(error))
            continue
        shown = redraw(visualizer, shown, areas)
        draw_message(visualizer, verdict(areas), camera)
        seconds = time.perf_counter() - began
        count = f"{len(areas.recomputed)} of {len(areas.world.task)} areas recomputed"
        report(f"{verdict(areas)} ({count}, {seconds:.2f} s)")


def file_changes(path: Path) -> Iterator[None]:
    """Yield each time a file has changed, for ever; one that is missing is waited for."""
    last = _stamp(path)
    while True:
        time.sleep(POLL_INTERVAL)
        now = _stamp(path)
        if now is not None and now != last:
            last = now
            yield


def redraw(visualizer: Any, shown: dict[str, SceneMesh], areas: LiveAreas) -> dict[str, SceneMesh]:
    """Send the meshes that differ from those shown; return those shown afterwards, by their paths."""
    base, joints = start_state(areas.world)
    robot, poses = robot_meshes(areas.world.robot, base, joints)
    wanted = {mesh.path: mesh for mesh in (*live_meshes(areas), *robot) if len(mesh.mesh.faces)}
    for path in shown.keys() - wanted.keys():
        delete_node(visualizer, path)
    changed = [mesh for path, mesh in wanted.items() if not _is_same(shown.get(path), mesh)]
    draw_meshes(visualizer, changed, poses)
    return wanted


def _load(path: Path) -> World:
    world = load_world(path)
    if not world.task:
        raise InputError(f"{path}: task: expected at least one set-point to look at")
    return world


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """Attributes that change when a file is saved, in place or by putting another in its place."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _is_same(old: SceneMesh | None, new: SceneMesh) -> bool:
    if old is None or old is new:
        return old is new
    if (old.color, old.opacity, old.layer, old.lit) != (new.color, new.opacity, new.layer, new.lit):
        return False
    a, b = old.mesh, new.mesh
    same_mesh = np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)
    return old.colors is new.colors and same_mesh


def verdict(areas: LiveAreas) -> str:
    """One line: whether the path can be done, or why not."""
    if areas.explanation is not None:
        return areas.explanation.reason
    assert areas.pruned is not None
    lifts = len(areas.pruned.breaks)
    how = f"with {count_noun(lifts, 'lift-off')}" if lifts else "without lifting the tool"
    count = len(areas.world.task)
    return f"All {count} set-points can be reached {how}; a plan also checks the arm for collisions."


def live_meshes(areas: LiveAreas) -> list[SceneMesh]:
    """Floor, obstacles with what they reject, areas, and the tool path, but not the robot.

    Meshes of what has not changed since the areas before are the very same objects.
    """
    world = areas.world
    distance = world.rules.clearance + float(np.hypot(*world.robot.footprint.T).max())
    has_area = np.zeros(len(world.task), dtype=bool)
    has_area[areas.areas.target[~shapely.is_empty(areas.areas.inner)]] = True
    obstacles = (
        _obstacle_meshes(solid, k, world.robot.body_height, distance)
        for k, solid in enumerate(world.obstacles)
    )
    return [
        *_floor_meshes(world.floor),
        *(mesh for meshes in obstacles for mesh in meshes),
        *_area_meshes(areas),
        *task_meshes(world, missing=~has_area),
    ]


@lru_cache(maxsize=4)
def _floor_meshes(floor: Floor) -> tuple[SceneMesh, ...]:
    return (
        SceneMesh("floor/all", triangle_meshes.triangulate(floor.polygon), Color.FLOOR, 1.0, 0),
        floor_layer("floor/free", floor.polygon, Color.NAVIGABLE, 0.55, 1),
        *map_meshes(floor),
    )


@lru_cache(maxsize=4096)
def _obstacle_meshes(solid: Solid, k: int, height: float, distance: float) -> tuple[SceneMesh, ...]:
    """An obstacle and its rejection, which is opaque: two of them may overlap."""
    shadow, mesh = shadow_of(solid, height), obstacle_mesh(f"obstacles/{k}", solid)
    if shadow is None:
        return (mesh,)
    rejected = grow(shadow, distance, inner=False).simplify(DETAIL)
    return mesh, floor_layer(f"floor/rejected/{k}", rejected, Color.REJECTED, 1.0, 2)


def _area_meshes(areas: LiveAreas) -> list[SceneMesh]:
    every = shapely.union_all(areas.areas.inner).simplify(DETAIL)
    strong: BaseGeometry = shapely.Polygon()
    if areas.pruned is not None:
        strong = shapely.union_all(areas.pruned.ladder.component[areas.pruned.keep]).simplify(DETAIL)
    return [
        floor_layer("areas/pale", every - strong, Color.PALE, 0.8, 3),
        floor_layer("areas/strong", strong, Color.STRONG, 0.62, 4),
    ]
