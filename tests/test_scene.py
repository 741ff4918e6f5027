"""A scene: parts are made once, and a changed one has the parts that it would make itself."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from regionik.scene import DEPENDS_ON, Scene, scene_of
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.scene import Start, World

PILLAR = load_world("pillar")
CHANGES: dict[str, Any] = {
    "task": PILLAR.task[:3],
    "start": Start(np.array([-0.5, 0.3, 1.0]), PILLAR.robot.carry),
    "rules": replace(PILLAR.rules, clearance=0.1, heading="fixed"),
    "obstacles": (Cylinder("post", 0.1, 1.0, np.array([0.2, 0.9, 0.5])),),
    "robot": replace(PILLAR.robot, mount=PILLAR.robot.mount + [0.05, 0.0, 0.1, 0.0]),
    "floor": replace(PILLAR.floor, polygon=PILLAR.floor.polygon.buffer(-0.3)),
}


def made(scene: Scene) -> Scene:
    """The scene with all of its parts made."""
    for part in DEPENDS_ON:
        getattr(scene, part)
    return scene


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_scene_has_the_parts_that_its_world_would_make(name: str) -> None:
    scene = made(Scene(PILLAR))
    changed, anew = scene.changed(**{name: CHANGES[name]}), Scene(replace(PILLAR, **{name: CHANGES[name]}))
    for side in ("inner", "outer"):
        assert getattr(changed.ground, side).free.equals(getattr(anew.ground, side).free)
    assert changed.free_floor.headings == anew.free_floor.headings
    assert changed.free_floor.anywhere.somewhere.free.equals(anew.free_floor.anywhere.somewhere.free)
    assert np.array_equal(changed.footprint.corners, anew.footprint.corners)
    assert changed.collision.contact.owner.tolist() == anew.collision.contact.owner.tolist()
    assert (changed.collision.rules, changed.collision.spare) == (anew.collision.rules, anew.collision.spare)


@pytest.mark.parametrize("name", CHANGES)
def test_parts_that_a_change_leaves_alone_are_the_very_same(name: str) -> None:
    scene = made(Scene(PILLAR))
    changed = scene.changed(**{name: CHANGES[name]})
    same = {part for part in DEPENDS_ON if getattr(changed, part) is getattr(scene, part)}
    assert same >= {part for part, on in DEPENDS_ON.items() if name not in on}


def test_parts_depend_on_fields_of_the_world() -> None:
    assert set().union(*DEPENDS_ON.values()) <= {one.name for one in fields(World)}


def test_what_a_stage_makes_of_a_scene_is_made_once() -> None:
    asked = list[int]()

    def double(_: Scene, number: int) -> int:
        asked.append(number)
        return 2 * number

    scene = Scene(PILLAR)
    assert [scene.once(double, 2), scene.once(double, 3), scene.once(double, 2)] == [4, 6, 4]
    assert asked == [2, 3]
    assert scene.changed(task=()).once(double, 2) == 4
    assert asked == [2, 3, 2]


def test_few_solids_are_left_as_they_are() -> None:
    scene = scene_of(PILLAR)
    assert scene.about_path() is scene
    assert scene.within_reach(np.zeros((1, 2))) is scene
    assert scene_of(PILLAR) is scene
