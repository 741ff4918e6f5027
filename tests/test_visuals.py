"""Visual surfaces: read with their colours, coarse enough, kept in files, drawn where the links are."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from regionik.view.page import html_page
from regionik.view.picture import Color
from regionik.view.world_picture import picture_of_world, robot_meshes
from regionik.worlds.arrays import transform_points
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.links import BASE, LinkCapsule
from regionik.worlds.readers.meshes import read_surfaces
from regionik.worlds.robot import Robot, Tool
from regionik.worlds.scene import Floor, Target, World
from regionik.worlds.surfaces import VisualSurface, coarsened
from regionik.worlds.urdf.loader import load_robot
from regionik.worlds.urdf.options import URDF
from tests.maths import translation

DAE = """\
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit meter="0.01"/></asset>
  <library_effects><effect id="shine"><profile_COMMON><technique sid="t"><phong>
    <diffuse><color>1 0.5 0 1</color></diffuse></phong></technique></profile_COMMON></effect>
  </library_effects>
  <library_materials><material id="orange"><instance_effect url="#shine"/></material></library_materials>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="15">0 0 0 10 0 0 10 10 0 0 10 0 0 0 20</float_array></source>
    <source id="n"><float_array id="b" count="3">0 0 1</float_array></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <polylist material="front" count="1"><input semantic="NORMAL" source="#n" offset="0"/>
      <input semantic="VERTEX" source="#v" offset="1"/><vcount>4</vcount><p>0 0 0 1 0 2 0 3</p></polylist>
    <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 4</p></triangles>
    <polygons><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 3</p><p>1 2 4</p></polygons>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node><translate>0 0 100</translate>
    <instance_geometry url="#g"><bind_material><technique_common>
      <instance_material symbol="front" target="#orange"/></technique_common></bind_material>
    </instance_geometry></node></visual_scene></library_visual_scenes>
</COLLADA>
"""

ROBOT = """\
<robot name="painted">
  <material name="sky"><color rgba="0 0.5 1 1"/></material>
  <link name="base">
    <visual><geometry><box size="0.4 0.3 0.2"/></geometry><material name="sky"/></visual>
    <collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision>
  </link>
  <link name="flap"><visual><geometry><box size="0.1 0.1 0.5"/></geometry></visual>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="upper">
    <visual><origin xyz="0 0 0.1"/><geometry><mesh filename="upper.dae" scale="2 2 2"/></geometry></visual>
    <visual><geometry><mesh filename="gone.stl"/></geometry></visual>
    <visual><geometry><cone/></geometry></visual>
    <collision><origin xyz="0.1 0.1 2.1"/><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <link name="fore">
    <visual><geometry><mesh filename="ball.stl"/></geometry>
      <material name="own"><color rgba="0 1 0 1"/></material></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="tip"/>
  <joint name="hinge" type="revolute"><origin xyz="0 0.3 0"/><parent link="base"/><child link="flap"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="turn" type="revolute"><origin xyz="0 0 0.2"/><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><origin xyz="0 0 2.5"/><parent link="upper"/><child link="fore"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><origin xyz="0 0 0.3"/><parent link="fore"/><child link="tip"/></joint>
</robot>
"""


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    (tmp_path / "painted.urdf").write_text(ROBOT)
    (tmp_path / "upper.dae").write_text(DAE)
    trimesh.creation.icosphere(subdivisions=5, radius=0.1).export(tmp_path / "ball.stl")
    with pytest.warns(UserWarning, match="hinge"):
        return load_robot(tmp_path / "painted.urdf", tip="tip")


def test_collada_faces_have_the_colours_of_their_materials(tmp_path: Path) -> None:
    path = tmp_path / "upper.dae"
    path.write_text(DAE)
    found = read_surfaces(path)
    assert [(one.color, len(one.triangles)) for one in found] == [(0xFF8000, 2), (None, 1), (None, 3)]
    square = found[0].triangles.reshape(-1, 3)
    assert np.allclose(square.min(axis=0), [0, 0, 1])
    assert np.allclose(square.max(axis=0), [0.1, 0.1, 1])
    a, b, c = found[0].triangles.swapaxes(0, 1)
    normals = np.array(np.cross(b - a, c - a))
    assert np.isclose(np.linalg.norm(normals, axis=1).sum() / 2, 0.01)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("<p>0 1 4</p>", "<p>0 1 5</p>", "triangles: expected the corners"),
        ("<p>0 1 4</p>", "<p>0 1 -4</p>", "p: expected whole numbers from 0"),
        ("<vcount>4", "<vcount>5", "polylist: expected the corners"),
        ('offset="1"', 'offset="100"', "input: expected an offset up to 99"),
        ('<triangles count="1"><input semantic="VERTEX"', '<triangles><input semantic="NORMAL"', "vertices"),
    ],
)  # fmt: skip
def test_broken_faces(tmp_path: Path, old: str, new: str, expected: str) -> None:
    path = tmp_path / "a.dae"
    assert DAE.count(old) == 1
    path.write_text(DAE.replace(old, new))
    with pytest.raises(InputError, match=expected):
        read_surfaces(path)


def test_visual_elements_are_read_with_their_colours_and_the_rest_passed_over(robot: Robot) -> None:
    seen = {(one.link, one.color) for one in robot.visuals}
    assert seen == {
        (BASE, 0x0080FF),
        (BASE, URDF.seen.grey),
        (0, 0xFF8000),
        (0, URDF.seen.grey),
        (1, 0x00FF00),
    }
    orange = next(one for one in robot.visuals if one.color == 0xFF8000)
    assert np.allclose(orange.vertices.min(axis=0), [0, 0, 2.1])  # twice a metre, and the origin
    flap = next(one for one in robot.visuals if (one.link, one.color) == (BASE, URDF.seen.grey))
    assert np.allclose(flap.vertices.max(axis=0), [0.05, 0.35, 0.25])  # behind a joint that stands still
    assert sum(len(one.faces) for one in robot.visuals) <= URDF.seen.max_triangles
    assert {name for one in robot.visuals for name in one.stands_for} == {"upper", "fore"}


def test_a_world_file_keeps_what_is_seen_to_the_bit(robot: Robot) -> None:
    world = World("w", robot, Floor(shapely.box(-1, -1, 1, 1)), task=(Target(np.array([0.5, 0.0, 1.0])),))
    document = json.loads(json.dumps(world_to_document(world)))
    again = world_from_document(document, "again", Path()).robot.visuals
    assert len(again) == len(robot.visuals)
    for one, other in zip(robot.visuals, again, strict=True):
        assert (one.link, one.color, one.stands_for) == (other.link, other.color, other.stands_for)
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)
    document["robot"]["visuals"][0]["faces"] = "AAAA"
    with pytest.raises(InputError, match=r"again: robot.visuals\[0\].faces: expected rows of three numbers"):
        world_from_document(document, "again", Path())


def test_pictures_show_visual_surfaces_and_the_solids_beyond_them(robot: Robot) -> None:
    pen = Tool(translation(0, 0, 0.5), (LinkCapsule(0, "pen", np.zeros(3), np.array([0, 0, 0.4]), 0.01),))
    solids = (*robot.solids, *(one.moved(1, robot.chain.T_last_tool) for one in pen.solids))
    world = World("w", replace(robot, solids=solids), Floor(shapely.box(-1, -1, 1, 1)))
    meshes, poses = robot_meshes(world, np.array([0.0, 0.0, 0.0]), np.zeros(2))
    colors = {mesh.color for mesh in meshes}
    assert {0x0080FF, URDF.seen.grey, 0xFF8000, 0x00FF00} <= colors
    assert Color.ROBOT not in colors  # nothing is made up where the base is known
    dark = [mesh for mesh in meshes if mesh.color == Color.ARM]
    assert [mesh.path.rsplit("/", 2)[1] for mesh in dark] == ["joint_1"]  # the pen
    orange = next(mesh for mesh in meshes if mesh.color == 0xFF8000)
    T = poses["robot"] @ poses["robot/arm"] @ poses["robot/arm/at_0"] @ poses["robot/arm/at_0/joint_0"]
    assert np.allclose(transform_points(T, orange.mesh.vertices)[:, 2].min(), 2.1 + 0.2)
    assert len(html_page(picture_of_world(world))) < 2_500_000


def test_a_base_of_which_only_a_part_is_seen_has_its_footprint_drawn(robot: Robot) -> None:
    mast = next(one for one in robot.visuals if (one.link, one.color) == (BASE, URDF.seen.grey))
    world = World("w", replace(robot, visuals=(mast,)), Floor(shapely.box(-1, -1, 1, 1)))
    meshes, _ = robot_meshes(world, np.zeros(3), np.zeros(2))
    assert {Color.ROBOT, Color.WHEEL, URDF.seen.grey} <= {mesh.color for mesh in meshes}


@given(st.integers(0, 10**6), st.integers(30, 3000))
def test_coarse_surfaces_stay_within_the_fine_ones(seed: int, most: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    shift = np.random.default_rng(seed).uniform(-1, 1, 3)
    fine = VisualSurface(0, 0xFFFFFF, ball.vertices + shift, ball.faces)
    (coarse,) = coarsened((fine,), most)
    assert len(coarse.faces) <= most
    assert (coarse.vertices >= fine.vertices.min(axis=0) - 1e-6).all()
    assert (coarse.vertices <= fine.vertices.max(axis=0) + 1e-6).all()
    if most > 1000:  # still a ball
        assert np.linalg.norm(coarse.vertices - shift, axis=1).min() > 0.27


@pytest.mark.parametrize(
    ("faces", "color"), [([[0, 1, 3]], 0), ([[0, 1]], 0), ([[0, 1, -1]], 0), ([[0, 1, 2]], 2**24)]
)
def test_wrong_surfaces_are_refused(faces: list[list[int]], color: int) -> None:
    with pytest.raises(InputError, match="visual surface: "):
        VisualSurface(0, color, np.eye(3), np.array(faces))
