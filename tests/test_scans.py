"""Point clouds and octomaps as obstacles: boxes that hold them, few and not larger than said."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import regionik as rik
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import FileNote
from tests import examples
from tests.maths import Array, rot_z
from tests.scans import clouds, octomap_of

LOW, HIGH = np.array([1.0, -0.7, 0.0]), np.array([1.2, 0.7, 1.1])  # of a wall [m]
FLOOR = {"polygon": [[-1.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-1.0, 2.0]]}
TARGET = [0.9, 0.0, 0.4]


def world_with(obstacle: dict[str, Any], folder: Path) -> rik.World:
    document = {
        "version": 1,
        "robot": "youbot",
        "floor": FLOOR,
        "obstacles": [{"name": "scan", **obstacle}],
        "task": [{"points": [TARGET]}],
        "rules": {"clearance": 0.05},
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FileNote)
        return world_from_document(json.loads(json.dumps(document)), "w.yaml", folder)


def on_wall(count: int) -> Array:
    """Points on all sides of the wall."""
    rng = np.random.default_rng(0)
    points = rng.uniform(LOW, HIGH, (count, 3))
    side = rng.integers(0, 3, count)
    points[np.arange(count), side] = np.where(rng.random(count) < 0.5, LOW[side], HIGH[side])
    return points


def ends(solid: Any) -> Array:
    """Lower and upper corner of a box that is not turned (2, 3)."""
    return np.array([solid.center - solid.size / 2, solid.center + solid.size / 2])


def outside(world: rik.World, points: Array) -> float:
    """How far the farthest of points is from the obstacles [m]."""
    return max(min(solid.distance(point) for solid in world.obstacles) for point in points)


@pytest.mark.parametrize("name", clouds(np.zeros((1, 3))))
def test_boxes_hold_the_points_of_every_form(name: str, tmp_path: Path) -> None:
    points = on_wall(500)
    (tmp_path / name).write_bytes(clouds(points * 1000)[name])
    world = world_with({"cloud": {"file": name, "unit": "mm", "voxel": 0.1}}, tmp_path)
    assert outside(world, points) < 1e-9
    bounds = np.array([ends(box) for box in world.obstacles])
    assert (bounds[:, 0].min(axis=0) > points.min(axis=0) - 0.1).all()
    assert (bounds[:, 1].max(axis=0) < points.max(axis=0) + 0.1 + 1e-9).all()
    again = world_from_document(world_to_document(world))
    assert world_to_document(again) == world_to_document(world)


def area(world: rik.World) -> shapely.geometry.base.BaseGeometry:
    return rik.admissible_area(world, world.task[0]).inner


def test_areas_beside_a_scanned_wall_are_those_of_the_wall_within_a_voxel(tmp_path: Path) -> None:
    (tmp_path / "p.xyz").write_bytes(clouds(on_wall(60_000))["p.xyz"])
    scanned = world_with({"cloud": {"file": "p.xyz", "voxel": 0.05}}, tmp_path)
    assert len(scanned.obstacles) < 10

    def wall(more: float) -> rik.World:
        size, center = HIGH - LOW + 2 * more, (LOW + HIGH) / 2
        return world_with({"box": {"size": size.tolist(), "center": center.tolist()}}, tmp_path)

    assert area(scanned).area > 0.1
    assert area(scanned).difference(area(wall(0.0)).buffer(1e-6)).area < 1e-6
    assert area(wall(0.05)).difference(area(scanned).buffer(1e-6)).area < 1e-6


@settings(max_examples=examples(30))
@given(st.sets(st.tuples(*[st.integers(-5, 6)] * 3), min_size=1, max_size=80), st.booleans(), st.booleans())
def test_boxes_of_an_octomap_fill_its_cells_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, cells: set[tuple[int, int, int]], binary: bool, color: bool
) -> None:
    folder, name = tmp_path_factory.mktemp("map"), "m.bt" if binary else "m.ot"
    (folder / name).write_bytes(octomap_of(sorted(cells), 0.1, binary=binary, color=color))
    world = world_with({"octomap": {"file": name}}, folder)
    filled = []
    for box in world.obstacles:
        low, high = (np.round(end / 0.1).astype(int) for end in ends(box))
        spans = [range(*span) for span in zip(low.tolist(), high.tolist(), strict=True)]
        filled += [(x, y, z) for x in spans[0] for y in spans[1] for z in spans[2]]
    assert sorted(filled) == sorted(cells)  # each once


def test_a_block_is_one_box_and_a_frame_turns_it(tmp_path: Path) -> None:
    block = [(x, y, z) for x in range(10, 16) for y in range(-3, 5) for z in range(4)]
    (tmp_path / "m.bt").write_bytes(octomap_of(block, 0.05))
    frame = {"position": [0.2, 0.1, 0.0], "rpy": [0.0, 0.0, 0.7]}
    (box,) = world_with({"octomap": {"file": "m.bt"}, "frame": frame, "clearance": 0.3}, tmp_path).obstacles
    assert isinstance(box, rik.Box)
    assert (box.name, box.clearance) == ("scan", 0.3)
    assert box.yaw == pytest.approx(0.7)
    np.testing.assert_allclose(box.size, [0.3, 0.4, 0.2])
    np.testing.assert_allclose(box.center, (rot_z(0.7) @ [0.65, 0.05, 0.1, 1])[:3] + [0.2, 0.1, 0.0])
    (larger,) = world_with({"octomap": {"file": "m.bt", "voxel": 0.1}}, tmp_path).obstacles
    np.testing.assert_allclose(ends(larger), [[0.5, -0.2, 0.0], [0.8, 0.3, 0.2]], atol=1e-9)


def test_noise_and_the_floor_are_left_out(tmp_path: Path) -> None:
    post = [[1.02, 0.01, 0.02 + 0.01 * k] for k in range(100)]
    (tmp_path / "p.xyz").write_bytes(clouds(np.array([*post, [2.0, 1.0, 0.5], [2.0, -1.0, 0.005]]))["p.xyz"])
    cloud = {"file": "p.xyz", "voxel": 0.1, "min_points": 2, "z": [0.01, 0.6]}
    (box,) = world_with({"cloud": cloud}, tmp_path).obstacles
    np.testing.assert_allclose(ends(box), [[1.0, 0.0, 0.0], [1.1, 0.1, 0.6]], atol=1e-9)


def test_what_stands_out_is_said(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("x,y,z\n1,0,0.5\nnan,nan,nan\n1,0.01,0.5\n")
    document = {
        "version": 1, "robot": "youbot", "floor": FLOOR, "task": [{"points": [TARGET]}],
        "obstacles": [{"name": "scan", "cloud": {"file": "p.csv", "voxel": 0.2}}],
    }  # fmt: skip
    with pytest.warns(FileNote, match=r"p.csv: 2 points in 1 box, up to 0.2 m \(voxel\) larger"):
        world_from_document(document, "w.yaml", tmp_path)


PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA {}\n"
REFUSED: dict[str, tuple[str, dict[str, Any], str]] = {
    "p.obj": ("v 0 0 0\n", {}, "cloud.file: .*ends in .ply, .pcd, .xyz, .csv"),
    "none.xyz": ("# nothing\n", {}, "expected lines of numbers x y z"),
    "words.xyz": ("0 0 1\na b c\n", {}, "words.xyz: expected a point a line: .*row 1"),
    "few.pcd": (PCD.format("ascii") + "0 0 1\n", {}, "expected 2 points, got 1"),
    "short.pcd": (PCD.format("binary") + "0123456789ab", {}, "expected 2 points, the file ends after 1"),
    "packed.pcd": (
        PCD.format("binary_compressed"),
        {},
        "DATA: expected ascii or bin.*pcl_convert",
    ),
    "flat.pcd": (PCD.replace("x y z", "u v w"), {}, "expected x, y and z among the fields, got 'u, v, w'"),
    "p.ply": ("ply\nformat ascii 1.0\nelement face 1\nend_header\n", {}, "vertices as the first element"),
    "low.xyz": ("0 0 0\n", {"z": [1, 2]}, "cloud.z: expected heights of the cloud"),
    "upside.xyz": ("0 0 0\n", {"z": [2, 1]}, "cloud.z: expected bottom below top"),
    "thin.xyz": ("0 0 0\n", {"min_points": 2}, "cloud.min_points: no cell of 0.05 m has 2 points"),
    "wide.xyz": ("0 0 0\n1000 0 0\n", {"voxel": 1e-5}, "cloud.voxel: expected one of which"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_is_said_in_one_line(name: str, tmp_path: Path) -> None:
    text, keys, words = REFUSED[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(rik.InputError, match=rf"^w.yaml: obstacles\[0\].*{words}") as refused:
        world_with({"cloud": {"file": name, **keys}}, tmp_path)
    assert "\n" not in str(refused.value)


def test_too_many_boxes_are_refused_with_the_voxel_that_makes_few_enough(tmp_path: Path) -> None:
    apart = [[0.2 * x, 0.2 * y, 0.5] for x in range(-20, 20) for y in range(-20, 20)]
    (tmp_path / "p.xyz").write_bytes(clouds(np.array(apart) + 0.01)["p.xyz"])
    with pytest.raises(
        rik.InputError, match=r"voxel: .*most 1000 boxes, these make 1600: voxel: 0.2 makes 1;"
    ):
        world_with({"cloud": {"file": "p.xyz", "voxel": 0.05}}, tmp_path)
    assert len(world_with({"cloud": {"file": "p.xyz", "voxel": 0.2}}, tmp_path).obstacles) == 1


def test_octomaps_that_are_cut_off_or_tilted_are_refused(tmp_path: Path) -> None:
    whole = octomap_of([(0, 0, 0), (5, 5, 5)], 0.05)
    (tmp_path / "m.bt").write_bytes(whole[:-1])
    with pytest.raises(rik.InputError, match=r"octomap.file: .*m.bt: expected a whole tree"):
        world_with({"octomap": {"file": "m.bt"}}, tmp_path)
    (tmp_path / "m.bt").write_bytes(whole)
    with pytest.raises(rik.InputError, match=r"obstacles\[0\].frame: an octomap stands upright"):
        world_with({"octomap": {"file": "m.bt"}, "frame": {"rpy": [0.1, 0, 0]}}, tmp_path)
    with pytest.raises(rik.InputError, match=r"voxel: expected a multiple of the map's 0.05 m, got 0.07"):
        world_with({"octomap": {"file": "m.bt", "voxel": 0.07}}, tmp_path)
    (tmp_path / "m.bt").write_bytes(whole.replace(b"id OcTree", b"id OcTreeStamped"))
    with pytest.raises(rik.InputError, match="id: expected one of OcTree, ColorOcTree, got 'OcTreeStamped'"):
        world_with({"octomap": {"file": "m.bt"}}, tmp_path)
