"""`show --live`: watch a world file, compute its areas anew on each save, and redraw what has changed."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.free_space import PathAreas
from regionik.areas.layers import grow, surely_taken
from regionik.pruning import Pruned, whole_path
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.view import triangle_meshes
from regionik.view.options import VIEW
from regionik.view.picture import Color, Picture, SceneMesh, count_noun
from regionik.view.viewer import delete_node, draw_meshes, draw_message, set_scene
from regionik.view.world_picture import (
    floor_layer,
    map_meshes,
    picture_with_robot,
    scene_obstacle,
    task_meshes,
    zone_meshes,
)
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import Explanation, InputError, NoPlanFound
from regionik.worlds.obstacles import Solid
from regionik.worlds.scene import World
from regionik.worlds.shadows import Shadow

OPTIONS = VIEW.animation


@dataclass(frozen=True, eq=False)
class LiveAreas:
    """Areas and verdict of a world, before anything is planned in full."""

    world: World
    areas: PathAreas  # of every set-point, over the arm's front and back, at any heading of the base
    pruned: Pruned | None  # areas that whole traversals use; None where there is none
    explanation: Explanation | None  # why there is none


def live_areas(world: World, before: LiveAreas | None = None) -> LiveAreas:
    """Return the areas of a world with a task, and whether they admit the whole path.

    Parts of the world that have not changed since areas ``before`` are the very same objects.

    >>> from regionik.worlds.documents.world_file import load_world
    >>> live_areas(load_world("pillar")).explanation is None
    True
    """
    if before is not None:
        world = _with_unchanged_parts(world, before.world)
    scene = scene_of(world)
    areas = path_areas(scene)
    try:
        return LiveAreas(world, areas, whole_path(scene)[2], None)
    except NoPlanFound as no:
        return LiveAreas(world, areas, None, no.explanation)


def _with_unchanged_parts(world: World, before: World) -> World:
    """The world with parts equal to those before replaced by them: caches know them by identity."""

    def same_part(now: Any, then: Any) -> Any:
        return then if is_equal(now, then) else now

    known = {solid.name: solid for solid in before.obstacles}
    obstacles = tuple(same_part(solid, known.get(solid.name)) for solid in world.obstacles)
    floor, robot = same_part(world.floor, before.floor), same_part(world.robot, before.robot)
    return replace(world, obstacles=obstacles, floor=floor, robot=robot)


def is_equal(a: Any, b: Any) -> bool:
    """Compare two values, dataclasses by their fields and arrays by their numbers."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and bool((a == b).all())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(is_equal, a, b))
    if is_dataclass(a):
        return all(is_equal(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    return bool(a == b)


def watch(
    path: Path, visualizer: Any, report: Callable[[str], None], changes: Iterator[None] | None = None
) -> None:
    """Draw a world file, and again each time it changes, until the changes end.

    A file that cannot be used is reported in one line, and the picture stays; at the start that is an
    `InputError`. Only the file itself is watched, not those it names. ``report`` is called with the verdict,
    a line each time; ``changes`` yields once a change, by default `file_changes`, which never ends.
    """
    changes = file_changes(path) if changes is None else changes  # a save while areas are found counts
    areas = live_areas(_load(path))
    picture = live_picture(areas)
    camera = picture.camera
    set_scene(visualizer, picture)
    shown = redraw(visualizer, {}, picture)
    draw_message(visualizer, verdict(areas), camera, picture.legend)
    report(verdict(areas))
    gc.freeze()  # what lives as long as the process: scanning it again takes a tenth of a second each time
    for _ in changes:
        began = time.perf_counter()
        try:
            areas = live_areas(_load(path), areas)
        except InputError as error:
            draw_message(visualizer, str(error), camera)
            report(str(error))
            continue
        picture = live_picture(areas)
        shown = redraw(visualizer, shown, picture)
        draw_message(visualizer, verdict(areas), camera, picture.legend)
        seconds = time.perf_counter() - began
        report(f"{verdict(areas)} ({seconds:.2f} s)")


def file_changes(path: Path) -> Iterator[None]:
    """Yield each time a file has changed since this call, for ever; one that is missing is waited for."""
    return _changes_since(path, _stamp(path))


def _changes_since(path: Path, last: tuple[int, int, int] | None) -> Iterator[None]:
    while True:
        time.sleep(OPTIONS.poll_interval)
        now = _stamp(path)
        if now is not None and now != last:
            last = now
            yield


def redraw(visualizer: Any, shown: dict[str, SceneMesh], picture: Picture) -> dict[str, SceneMesh]:
    """Send the meshes that differ from those shown; return those shown afterwards, by their paths."""
    wanted = {mesh.path: mesh for mesh in picture.bodies if len(mesh.mesh.faces)}
    for path in shown.keys() - wanted.keys():
        delete_node(visualizer, path)
    changed = [mesh for path, mesh in wanted.items() if not is_equal(shown.get(path), mesh)]
    draw_meshes(visualizer, changed, picture.poses)
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


def verdict(areas: LiveAreas) -> str:
    """Return one line that says if the path can be done, or why not."""
    if areas.explanation is not None:
        return areas.explanation.reason
    assert areas.pruned is not None
    lifts = len(areas.pruned.breaks)
    how = f"with {count_noun(lifts, 'lift-off')}" if lifts else "without lifting the tool"
    count = len(areas.world.task)
    return f"All {count} set-points can be reached {how}; a plan also checks the arm for collisions."


def live_picture(areas: LiveAreas) -> Picture:
    """The picture of areas and verdict.

    The robot stands at its start, or at the edge of the first set-point's area.
    """
    first = areas.areas.inner[areas.areas.target == 0]
    return picture_with_robot(areas.world, (), live_meshes(areas), shapely.union_all(first))


def live_meshes(areas: LiveAreas) -> list[SceneMesh]:
    """Floor, obstacles with what they reject, areas, and the tool path, but not the robot."""
    world = areas.world
    within = scene_of(world).ground.within
    obstacles = (
        _obstacle_meshes(solid, k, surely_taken(within, solid.name))
        for k, solid in enumerate(world.obstacles)
    )
    return [
        *_area_meshes(areas),
        *_floor_meshes(world),
        *(mesh for meshes in obstacles for mesh in meshes),
        *task_meshes(world, missing=failing_setpoints(areas)),
    ]


def failing_setpoints(areas: LiveAreas) -> NDArray[np.bool_]:
    """Mask of the set-points that the verdict speaks against, (n,): none where the path can be done.

    Else the one that the explanation names, and those without a place for the base.
    """
    count = len(areas.world.task)
    if areas.explanation is None:
        return np.zeros(count, dtype=bool)
    scene = scene_of(areas.world)
    failing = np.ones(count, dtype=bool)
    failing[areas.areas.target[~shapely.is_empty(areas.areas.inner)]] = False
    if failing.any() and scene.free_floor.turns_matter:  # some headings may do where its circle does not
        rows = np.flatnonzero(failing)
        turned = path_areas(scene, [scene.task[i] for i in rows], free_space=scene.free_floor.by_heading)
        failing[rows[turned.target[~shapely.is_empty(turned.inner)]]] = False
    failing[0 if areas.explanation.setpoint is None else areas.explanation.setpoint] = True
    return failing


def _floor_meshes(world: World) -> tuple[SceneMesh, ...]:
    floor = world.floor
    return (
        SceneMesh("floor/all", triangle_meshes.floor_mesh(floor.polygon), Color.FLOOR, 1.0, 0),
        floor_layer("floor/free", world.open_floor, Color.NAVIGABLE, 1, "other floor"),
        *zone_meshes(world),
        *map_meshes(floor),
    )


def _obstacle_meshes(solid: Solid, k: int, taken: tuple[tuple[Shadow, float], ...]) -> tuple[SceneMesh, ...]:
    """An obstacle and its rejection, shadows grown so far, which is opaque: two of them may overlap."""
    mesh = scene_obstacle(f"obstacles/{k}", solid)
    if not taken:
        return (mesh,)
    grown = [grow(shadow, by, inner=False) for shadow, by in taken]
    rejected = shapely.union_all(grown).simplify(VIEW.floor.detail)
    label = "rejected: too close to a solid"
    return mesh, floor_layer(f"floor/rejected/{k}", rejected, Color.REJECTION, 2, label)


def _area_meshes(areas: LiveAreas) -> list[SceneMesh]:
    every = shapely.union_all(areas.areas.inner).simplify(VIEW.floor.detail)
    if areas.pruned is None:
        return [floor_layer("areas/pale", every, Color.PALE, 3, "admissible for some set-point")]
    strong = shapely.union_all(areas.pruned.ladder.component[areas.pruned.keep]).simplify(VIEW.floor.detail)
    rolls = areas.world.robot.drive.rolls
    whole = "areas for the whole path" + (", if it drove every way" if rolls else "")
    rest = "admissible for some set-point" if rolls else "admissible, but a dead end"
    return [
        floor_layer("areas/strong", strong, Color.STRONG, 4, whole),
        floor_layer("areas/pale", every - strong, Color.PALE, 3, rest),
    ]
