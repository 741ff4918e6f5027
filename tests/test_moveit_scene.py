"""Scene files of MoveIt, of both its formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml

from regionik.worlds.bundled import world_path
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Sphere
from regionik.worlds.readers.moveit_scene import read_scene

POSE = "0 0 0\n0 0 0 1"
NEW = f"""(noname)+
* table
1 2 0.5
0 0 0.7071068 0.7071068
2
box
0.4 0.2 0.1
{POSE}
0 0 0 0
cylinder
0.05 0.5
0 0 -0.3
0 0 0 1
0 0 0 0
1
handle
{POSE}
* ball
0 0 0
0 0 0 1
1
sphere
0.2
1 1 1
0 0 0 1
1 0 0 1
0
.
"""
OLD = """kitchen
* box 0
1
box
0.2 0.3 0.4
1 0 0.2
0 0 0 1
0 0 0 0
.
"""


def scene(text: str, tmp_path: Path) -> Path:
    path = tmp_path / "hall.scene"
    path.write_text(text, "utf-8")
    return path


def test_objects_have_poses_shapes_and_subframes(tmp_path: Path) -> None:
    board, leg, ball = read_scene(scene(NEW, tmp_path))
    assert [one.name for one in (board, leg, ball)] == ["table 1", "table 2", "ball"]
    assert isinstance(board, Box)
    assert isinstance(leg, Cylinder)
    assert isinstance(ball, Sphere)
    assert board.center == pytest.approx([1, 2, 0.5])
    assert board.yaw == pytest.approx(np.pi / 2)
    assert (leg.radius, leg.height) == (0.05, 0.5)
    assert leg.center == pytest.approx([1, 2, 0.2])
    assert (ball.radius, ball.center.tolist()) == (0.2, [1.0, 1.0, 1.0])


def test_the_older_format_has_no_poses_of_objects(tmp_path: Path) -> None:
    (box,) = read_scene(scene(OLD, tmp_path))
    assert isinstance(box, Box)
    assert (box.name, box.center.tolist()) == ("box 0", [1.0, 0.0, 0.2])


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        ("box\n0.4 0.2 0.1", 0.4 * 0.2 * 0.1),
        ("cylinder\n0.1 0.5", np.pi * 0.1**2 * 0.5),
        ("cone\n0.1 0.5", np.pi * 0.1**2 * 0.5 / 3),
    ],
)
def test_what_is_tilted_becomes_a_mesh_around_it(shape: str, volume: float, tmp_path: Path) -> None:
    text = f"x\n* thing\n{POSE}\n1\n{shape}\n1 0 1\n0.5 0 0 0.8660254\n0 0 0 0\n0\n.\n"
    (thing,) = read_scene(scene(text, tmp_path))
    assert isinstance(thing, Mesh)
    solid = trimesh.Trimesh(thing.vertices, thing.faces, process=False)
    assert solid.is_watertight
    assert 1 - 1e-9 <= solid.volume / volume <= 1.005
    axis = [0.0, -np.sin(np.pi / 3), np.cos(np.pi / 3)]
    assert (solid.vertices - [1, 0, 1]) @ axis == pytest.approx(
        np.sign((solid.vertices - [1, 0, 1]) @ axis) * np.ptp((solid.vertices - [1, 0, 1]) @ axis) / 2
    )


def test_meshes_are_solids_or_sheets(tmp_path: Path) -> None:
    corners, faces = "0 0 0\n1 0 0\n0 1 0\n0 0 1", "0 2 1\n0 1 3\n1 2 3\n0 3 2"
    text = f"x\n* wedge\n0 0 1\n0 0 0 1\n1\nmesh\n4 4\n{corners}\n{faces}\n{POSE}\n0 0 0 0\n0\n.\n"
    (wedge,) = read_scene(scene(text, tmp_path))
    assert isinstance(wedge, Mesh)
    assert not wedge.sheet
    assert wedge.contains(np.array([0.1, 0.1, 1.1]))
    open_text = text.replace("4 4", "4 3").replace("\n0 3 2", "")
    with pytest.warns(FileNote, match="wedge is not closed: it is a sheet"):
        (wedge,) = read_scene(scene(open_text, tmp_path))
    assert isinstance(wedge, Mesh)
    assert wedge.sheet


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "expected the scene's name, the file ends after line 0"),
        ("x\n", "expected an object after a star, or a point, the file ends after line 1"),
        (
            "x\nbox\n.\n",
            r"line 2: expected \* and an object's name, or a point that ends the scene, got 'box'",
        ),
        (
            NEW.replace("box", "octree"),
            "line 6: expected one of box, sphere, cylinder, cone, mesh, got 'octree'",
        ),
        (NEW.replace("sphere", "plane"), "line 24: expected one of .* got 'plane'"),
        (
            NEW.replace("0.4 0.2 0.1", "0.4 0.2"),
            "line 7: expected the size of a box, 3 numbers, got '0.4 0.2'",
        ),
        (NEW.replace("0.4 0.2 0.1", "0.4 0.2 0"), "line 7: expected a box whose sizes are above 0"),
        (NEW.replace("0.4 0.2 0.1", "0.4 nan 0"), "line 7: expected the size of a box, 3 numbers"),
        (NEW.replace("0 0 0.7071068 0.7071068", "0 0 0 0"), "line 4: expected a quaternion, got 0 0 0 0"),
        (NEW.replace("\n2\nbox", "\n2.5\nbox"), "line 5: expected the number of shapes, got 2.5"),
        (NEW.replace("\n.\n", "\n"), "expected an object after a star, or a point, the file ends"),
    ],
)
def test_what_is_no_scene_is_refused_with_its_line(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        read_scene(scene(text, tmp_path))


def test_a_world_takes_the_objects_of_a_scene(tmp_path: Path) -> None:
    document: dict[str, Any] = yaml.safe_load(world_path("slab").read_text("utf-8"))
    document["frames"] = {"planning": {"position": [-2.0, 1.0, 0.0], "rpy": [0.0, 0.0, np.pi / 2]}}
    document["moveit_scene"] = {"file": scene(NEW, tmp_path).name, "frame": "planning"}
    path = tmp_path / "hall.yaml"
    path.write_text(yaml.safe_dump(document))
    world = load_world(path)
    slab, board, leg, ball = world.obstacles
    assert [one.name for one in world.obstacles] == [slab.name, "table 1", "table 2", "ball"]
    assert isinstance(leg, Cylinder)
    assert leg.center == pytest.approx([-4.0, 2.0, 0.2])
    assert isinstance(ball, Sphere)
    assert isinstance(board, Box)
    again = world_to_document(world_from_document(world_to_document(world)))
    assert again["obstacles"] == world_to_document(world)["obstacles"]
    document["moveit_scene"] = {"file": "hall.scene", "frame": "nowhere"}
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(InputError, match=r"moveit_scene.frame: unknown frame 'nowhere'"):
        load_world(path)
    (tmp_path / "hall.scene").write_text("x\nbox\n")
    with pytest.raises(InputError, match=r"moveit_scene.file: .*hall.scene: line 2: expected \*"):
        load_world(path)
