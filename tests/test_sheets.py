"""Meshes without an inside: skins and scans as obstacles, beside thin boxes that stand where they do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
import yaml

import regionik as rik
from regionik.worlds.arrays import Index
from regionik.worlds.bundled import world_path
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.obstacles import Box, Mesh, Solid
from regionik.worlds.scene import World
from tests.maths import Array

THICK = 1e-4  # of the boxes [m]


def quad(low: Array, high: Array) -> tuple[Array, Index]:
    """Corners and triangles of a rectangle that stands upright or lies level."""
    flat = int(np.argmin(high - low))
    u, v = (np.where(np.arange(3) == k, high - low, 0.0) for k in range(3) if k != flat)
    return np.array([low, low + u, low + u + v, low + v]), np.array([[0, 1, 2], [0, 2, 3]])


def sheet(name: str, low: list[float], high: list[float]) -> Mesh:
    return Mesh(name, *quad(np.array(low), np.array(high)), sheet=True)


def box(name: str, low: list[float], high: list[float]) -> Box:
    size, middle = np.array(high) - low, (np.array(high) + low) / 2
    return Box(name, np.maximum(size, THICK), middle)


WALL = ("wall", [1.0, -1.0, 0.0], [1.0, 1.0, 1.2])
PLATE = ("plate", [0.6, -0.5, 0.35], [1.4, 0.5, 0.35])


def with_obstacles(*solids: Solid) -> World:
    world = load_world("slab")
    rules = replace(world.rules, heading="free")
    return replace(world, obstacles=solids, rules=rules)


@pytest.mark.parametrize("which", [WALL, PLATE])
def test_a_sheet_rejects_what_a_thin_box_does(which: tuple[str, list[float], list[float]]) -> None:
    thin, solid = with_obstacles(sheet(*which)), with_obstacles(box(*which))
    for target in ([0.7, 0.0, 0.25], [1.3, 0.2, 0.25], [0.5, 0.0, 0.5]):
        areas = [rik.admissible_area(world, target) for world in (thin, solid)]
        ours, theirs = ([area.inner, area.outer] for area in areas)
        assert all(a.symmetric_difference(b).area < 1e-3 for a, b in zip(ours, theirs, strict=True))
    targets = [[0.9, 0.0, 0.25], [1.02, 0.0, 0.25], [1.3, 0.2, 0.3], [1.0, 0.0, 0.33], [1.0, 0.0, 0.45]]
    verdicts = zip(*(rik.reach(world, targets).verdict.tolist() for world in (thin, solid)), strict=True)
    assert all(a == b or "undecided" in (a, b) for a, b in verdicts)


def test_a_motion_through_a_sheet_is_refused_and_one_beside_it_holds() -> None:
    free = with_obstacles()
    ends = zip((0.5, 1.5), free.task, strict=False)
    task = tuple(replace(target, position=np.array([x, 0.0, 0.3])) for x, target in ends)
    free = replace(free, task=task, start=None)
    found = rik.plan(free)
    for blocking in (sheet(*WALL), sheet("lid", [0.4, -0.5, 0.2], [1.6, 0.5, 0.2])):
        report = rik.verify(replace(found, world=replace(free, obstacles=(blocking,))))
        assert not report.ok
        assert any(blocking.name in violation.text for violation in report.violations)
    beside = sheet("wall", [-2.0, 1.5, 0.0], [3.0, 1.5, 1.2])
    assert rik.verify(rik.plan(replace(free, obstacles=(beside,)))).ok


def test_the_room_behind_a_skin_is_free() -> None:
    """Of a box without its bottom a solid would fill the inside; its skin leaves it to the arm."""
    whole = trimesh.creation.box((0.6, 0.6, 0.6))
    whole.apply_translation([0.0, 0.0, 0.9])
    skin = Mesh("hood", whole.vertices, whole.faces[whole.face_normals[:, 2] > -0.5], sheet=True)
    inside = np.array([0.0, 0.0, 0.9])
    assert not skin.contains(inside)
    assert skin.distance(inside) == pytest.approx(0.3)
    assert Mesh("block", whole.vertices, whole.faces).contains(inside)
    shadow = skin.shadow(1.0, 0.7)
    assert shadow is not None
    assert not shapely.intersects_xy(shadow.core, 0.0, 0.0)


def test_files_say_that_a_mesh_is_a_sheet(tmp_path: Path) -> None:
    corners, faces = quad(np.array(WALL[1]), np.array(WALL[2]))
    trimesh.Trimesh(corners * 1000, faces, process=False).export(tmp_path / "skin.stl")
    document = yaml.safe_load(world_path("slab").read_text("utf-8"))
    document["obstacles"] = [{"name": "skin", "mesh": {"file": "skin.stl", "scale": 0.001}}]
    path = tmp_path / "hall.yaml"
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(rik.InputError, match=r"obstacles\[0\].mesh.file: .*closed.*sheet: true"):
        load_world(path)
    document["obstacles"][0]["mesh"]["sheet"] = True
    path.write_text(yaml.safe_dump(document))
    world = load_world(path)
    (skin,) = world.obstacles
    assert isinstance(skin, Mesh)
    assert skin.sheet
    again = world_from_document(world_to_document(world), "again", tmp_path)
    (skin,) = again.obstacles
    assert isinstance(skin, Mesh)
    assert skin.sheet
