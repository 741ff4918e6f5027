"""`show --live`: a world file is watched, and what its changes touch is drawn anew."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from regionik.view.camera import camera_for
from regionik.view.live_areas import Look, look
from regionik.view.live_picture import look_bodies, verdict
from regionik.view.picture import Body, Picture
from regionik.view.viewer import draw, erase, stage, write
from regionik.view.world_picture import extent, first_posture, robot_bodies
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.scene import World

EVERY = 0.05  # between two glances at the file [s]

Say = Callable[[str], None]
Shown = dict[str, Body]


def follow(path: Path, visualizer: Any, say: Say, changes: Iterator[None] | None = None) -> None:
    """Draw a world, and again each time its file changes, until the changes end.

    A file that cannot be used is told in one line, and the picture stays. Only the file itself is watched,
    not those it names.

    Parameters
    ----------
    path : Path
        A world file.
    visualizer : meshcat.Visualizer
    say : callable
        Takes the verdict, line by line.
    changes : iterator, optional
        Gives one item a change; by default the file is looked at many times a second.

    Raises
    ------
    InputError
        When the file cannot be used at the start.
    """
    seen = look(_loaded(path))
    camera = camera_for(seen.world, first_posture(seen.world)[0][None, :2])
    picture = Picture(seen.world.name, (), (), (), {}, camera, extent(seen.world, camera))
    stage(visualizer, picture)
    shown = redraw(visualizer, {}, seen)
    write(visualizer, verdict(seen), camera)
    say(verdict(seen))
    gc.freeze()  # what is here to stay: walking it again takes a tenth of a second each time
    for _ in saved(path) if changes is None else changes:
        begun = time.perf_counter()
        try:
            seen = look(_loaded(path), seen)
        except InputError as error:
            write(visualizer, str(error), camera)
            say(str(error))
            continue
        shown = redraw(visualizer, shown, seen)
        write(visualizer, verdict(seen), camera)
        taken = time.perf_counter() - begun
        say(f"{verdict(seen)} ({len(seen.touched)} of {len(seen.world.task)} areas made anew, {taken:.2f} s)")


def saved(path: Path) -> Iterator[None]:
    """One item each time a file is not what it was, for ever; one that is away is waited for."""
    last = _stamp(path)
    while True:
        time.sleep(EVERY)
        now = _stamp(path)
        if now is not None and now != last:
            last = now
            yield


def redraw(visualizer: Any, shown: Shown, seen: Look) -> Shown:
    """Send what differs from what is shown; what there is to see afterwards."""
    base, joints = first_posture(seen.world)
    robot, poses = robot_bodies(seen.world.robot, base, joints)
    wanted = {body.path: body for body in (*look_bodies(seen), *robot) if len(body.mesh.faces)}
    for path in shown.keys() - wanted.keys():
        erase(visualizer, path)
    changed = [body for path, body in wanted.items() if not _same(shown.get(path), body)]
    draw(visualizer, changed, poses)
    return wanted


def _loaded(path: Path) -> World:
    world = load_world(path)
    if not world.task:
        raise InputError(f"{path}: task: expected at least one set-point to look at")
    return world


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """What changes when a file is saved, in place or by putting another in its place."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _same(old: Body | None, new: Body) -> bool:
    if old is None or old is new:
        return old is new
    if (old.color, old.opacity, old.layer, old.lit) != (new.color, new.opacity, new.layer, new.lit):
        return False
    a, b = old.mesh, new.mesh
    alike = np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)
    return old.colors is new.colors and alike
