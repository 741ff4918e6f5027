"""The solids of URDF robots: nothing sticks out of what stands for it, and files stay in their folders."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation

from regionik.worlds.documents.robots import UrdfRobot, read_robot
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.links import LINK_RADIUS, LinkBox, LinkCapsule, LinkHull
from regionik.worlds.readers.meshes import read_geometries
from regionik.worlds.robot import BODY_HEIGHT, Robot
from regionik.worlds.urdf.bounding import (
    bounding_solid,
    convex_hull,
    cylinder_hull,
    oriented_box,
    outer_hull,
)
from regionik.worlds.urdf.loader import load_robot
from tests import examples
from tests.kinds import LinkSolid
from tests.maths import Array, pose
from tests.urdfs import CRANE, UPPER_SIZE, crane, depth, frames_of


def solid(robot: Robot, name: str) -> LinkSolid:
    return next(solid for solid in robot.solids if solid.name == name)


def volume(solid: LinkSolid) -> float:
    if isinstance(solid, LinkBox):
        return float(np.prod(solid.size))
    if isinstance(solid, LinkHull):
        return float(ConvexHull(solid.corners).volume)
    length = float(np.linalg.norm(solid.end - solid.start))
    return float(np.pi * solid.radius**2 * (length + 4 / 3 * solid.radius))


# --- bounds

_POSE = st.tuples(*[st.floats(-3, 3)] * 6).map(lambda values: pose(values[:3], values[3:]))


@settings(max_examples=examples(50))
@given(st.floats(0.002, 0.6), st.floats(0.001, 1.5), _POSE)
def test_a_cylinder_is_flat_at_its_ends_and_round_to_a_millimetre(
    radius: float, length: float, T: Array
) -> None:
    hull = cylinder_hull(0, "pad", T, radius, length)
    local = (hull.corners - T[:3, 3]) @ T[:3, :3]
    np.testing.assert_allclose(np.abs(local[:, 2]), length / 2, atol=1e-9)
    out = np.linalg.norm(local[:, :2], axis=1) - radius
    assert 0 < out.min() <= out.max() < max(1e-3, 0.01 * radius) + 1e-9
    angles = np.random.default_rng(0).uniform(0, 2 * np.pi, 50)
    for angle, end in zip(angles, np.linspace(-0.5, 0.5, 50), strict=True):
        rim = np.array([radius * np.cos(angle), radius * np.sin(angle), end * length, 1.0])
        assert hull.depth((T @ rim)[:3]) > -1e-9


@settings(max_examples=examples(50))
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.tuples(*[st.floats(0, 1)] * 3), _POSE)
@example(0, 14, (1.0, 1.0, 1e-14), np.eye(4))  # the hull engine lost corners of it
@example(0, 14, (1.0, 1.0, 1e-13), np.eye(4))
@example(0, 14, (1e-7, 1e-8, 1e-10), np.eye(4))  # the box engine found none
@example(2, 4, (1.0, 0.0, 2.3e-186), pose((0, 0, 0), (0, 0, 1e-14)))  # a circle of NaN
def test_points_are_inside_their_bounding_solid(
    seed: int, count: int, sizes: tuple[float, ...], T: Array
) -> None:
    cloud = np.random.default_rng(seed).normal(size=(count, 3)) * sizes  # flat or a point, where sizes are 0
    points = cloud @ T[:3, :3].T + T[:3, 3]
    bound = bounding_solid(1, "cloud", convex_hull(points))
    assert depth(bound, points).max() < 1e-8
    along_axes = np.prod(np.maximum(np.ptp(points, axis=0), 1e-4))
    assert volume(bound) <= along_axes * (1 + 1e-6)


def test_the_smaller_bound_is_taken() -> None:
    turn = Rotation.from_euler("xyz", [0.3, 0.4, 0.5]).as_matrix()
    rod = trimesh.creation.capsule(height=1.0, radius=0.1).vertices @ turn.T
    slab = trimesh.creation.box((0.5, 0.3, 0.1)).vertices @ turn.T
    assert isinstance(bounding_solid(0, "rod", np.asarray(rod)), LinkCapsule)
    bound = bounding_solid(0, "slab", np.asarray(slab))
    assert isinstance(bound, LinkBox)
    assert sorted(bound.size) == pytest.approx([0.1, 0.3, 0.5])


def test_a_box_fits_a_turned_cloud() -> None:
    T = pose([1, 2, 3], [0.3, -0.2, 0.9])
    corners = trimesh.creation.box((1.0, 0.5, 0.2)).vertices @ T[:3, :3].T + T[:3, 3]
    frame, size = oriented_box(np.asarray(corners))
    assert sorted(size) == pytest.approx([0.2, 0.5, 1.0])
    assert frame[:3, 3] == pytest.approx([1, 2, 3])
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1)


def test_a_box_fits_a_finger_whose_corners_are_doubled() -> None:
    """Of a Stretch's gripper: corners a nanometre apart, on which the engine of boxes fails."""
    side = [
        (-5.89678766e-02, 1.26535268e-01), (-5.78805739e-02, 1.81524509e-01),
        (-2.03183000e-02, 5.78432217e-02), (-2.03182985e-02, 5.78432217e-02),
        (-1.65457722e-02, 2.48635027e-01), (-1.65457706e-02, 2.48635027e-01),
    ]  # fmt: skip
    corners = np.array([(x, y, z) for x, z in side for y in (-9.77647322e-10, 2.30000010e-02)])
    T, size = oriented_box(corners)
    local = (corners - T[:3, 3]) @ T[:3, :3]
    assert (np.abs(local) <= size / 2 + 1e-12).all()
    assert np.prod(size) <= np.prod(np.ptp(corners, axis=0))


# --- the crane


def test_every_collision_element_is_covered_where_it_is(tmp_path: Path) -> None:
    robot = load_robot(crane(tmp_path), tip="tool")
    assert [(s.link, s.name) for s in robot.solids if s.link == 0] == [(0, "torso"), (0, "head")]
    assert {s.name for s in robot.solids if s.link == 2} == {"fore 1", "fore 2", "left", "right"}
    joints = np.array([0.2, 0.7, -0.4])
    ours = robot.frames(np.zeros(3), joints)
    values = dict(zip(robot.chain.names, joints, strict=True)) | {"grip": 0.01, "grip_too": 0.005}
    theirs = frames_of(CRANE, values)
    upper = trimesh.creation.box(np.array(UPPER_SIZE) / 1000).vertices
    shapes = {
        "torso": ("torso", pose([0, 0, -0.2], [0, 0, 0]), trimesh.creation.cylinder(0.05, 0.6).vertices),
        "head": ("head", np.eye(4), trimesh.creation.icosphere(radius=0.1).vertices),
        "upper": ("upper", pose([0.1, 0, 0], [0, 0, 0.3]), upper),
        "fore 1": (
            "fore",
            pose([0.1, 0, 0], [0.2, 0.3, 0.4]),
            trimesh.creation.box((0.2, 0.05, 0.06)).vertices,
        ),
        "fore 2": ("fore", pose([0.2, 0, 0], [0, 0, 0]), trimesh.creation.icosphere(radius=0.04).vertices),
        "left": ("left", np.eye(4), trimesh.creation.box((0.02, 0.01, 0.05)).vertices),
        "right": ("right", np.eye(4), trimesh.creation.box((0.02, 0.01, 0.05)).vertices),
    }
    assert set(shapes) == {s.name for s in robot.solids}
    for name, (link, T, vertices) in shapes.items():
        body = solid(robot, name)
        T_solid_shape = np.linalg.inv(ours[body.link]) @ theirs[link] @ T
        points = np.asarray(vertices) @ T_solid_shape[:3, :3].T + T_solid_shape[:3, 3]
        assert depth(body, points).max() < 1e-8, name
        assert depth(body, points).max() > -1e-3, name  # and nothing much to spare


def test_boxes_stay_boxes(tmp_path: Path) -> None:
    body = solid(load_robot(crane(tmp_path), tip="tool"), "fore 1")
    assert isinstance(body, LinkBox)
    assert body.size.tolist() == [0.2, 0.05, 0.06]
    assert np.allclose(body.T_link_box, pose([0.1, 0, 0], [0.2, 0.3, 0.4]))


def test_the_footprint_contains_base_and_wheels(tmp_path: Path) -> None:
    robot = load_robot(crane(tmp_path), tip="tool")
    outline = shapely.Polygon(robot.footprint)
    wheel = shapely.box(0, 0.23, 0.2, 0.27)  # seen from above
    body = shapely.box(-0.3, -0.2, 0.3, 0.2)
    hull = (wheel | body).convex_hull
    assert outline.buffer(1e-9).covers(hull)
    assert outline.area < hull.area * 1.01
    assert robot.body_height == pytest.approx(0.35)
    moved = load_robot(crane(tmp_path), tip="tool", mount=[1, 0, 0.1, np.pi / 2])
    turned = shapely.affinity.translate(shapely.affinity.rotate(outline, 90, origin=(0, 0)), 1, 0)
    assert shapely.Polygon(moved.footprint).symmetric_difference(turned).area < 1e-9
    assert moved.body_height == pytest.approx(0.45)


def test_links_above_the_root_count_when_they_are_fixed_to_it(tmp_path: Path) -> None:
    outer = '<link name="floor"><collision><geometry><box size="2 2 0.02"/></geometry></collision></link>'
    robot = load_robot(crane(tmp_path, ('<link name="floor"/>', outer)), root="base", tip="tool")
    assert np.ptp(robot.footprint, axis=0) == pytest.approx([2, 2])


def test_a_footprint_that_is_given_is_taken(tmp_path: Path) -> None:
    corners = [[0.5, 0.3], [-0.5, 0.3], [-0.5, -0.3], [0.5, -0.3]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing is said of what is left out of a footprint that is given
        robot = load_robot(crane(tmp_path), root="plate", tip="tool", footprint=corners, body_height=0.4)
    assert robot.footprint.tolist() == corners
    assert robot.body_height == 0.4


def test_a_base_without_solids_is_a_point(tmp_path: Path) -> None:
    box = '<collision><origin xyz="0 0 0.2"/><geometry><box size="0.6 0.4 0.2"/></geometry></collision>'
    wheel = '<collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision>'
    robot = load_robot(crane(tmp_path, (box, ""), (wheel, "")), tip="tool")
    assert robot.footprint.tolist() == [[0, 0]]
    assert robot.body_height == BODY_HEIGHT


def test_links_that_are_ignored_have_no_solids(tmp_path: Path) -> None:
    path = crane(tmp_path)
    whole, bare = load_robot(path, tip="tool"), load_robot(path, tip="tool", ignore=["torso", "wheel"])
    names = [one.name for one in whole.all_solids]
    assert "torso" in names
    assert [one.name for one in bare.all_solids] == [name for name in names if name != "torso"]
    assert np.ptp(bare.footprint, axis=0)[1] < np.ptp(whole.footprint, axis=0)[1]
    assert len(bare.visuals) == len(whole.visuals)
    part = UrdfRobot(urdf=path.name, tip="tool", ignore=["torso", "wheel"])
    assert [one.name for one in read_robot(part, "w", path.parent).all_solids] == [
        one.name for one in bare.all_solids
    ]
    with pytest.raises(InputError, match=r"ignore\[1\]: unknown link 'box', valid links: floor, base"):
        load_robot(path, tip="tool", ignore=["torso", "box"])
    with pytest.raises(InputError, match="youbot: ignore: a bundled robot has no links"):
        load_robot("youbot", ignore=["torso"])


def test_a_box_of_no_size_is_nothing(tmp_path: Path) -> None:
    whole = load_robot(crane(tmp_path), tip="tool")
    bare = '<collision><geometry><box size="0 0 0"/></geometry></collision>'
    robot = load_robot(
        crane(tmp_path, ('<link name="floor"/>', f'<link name="floor">{bare}</link>')), tip="tool"
    )
    assert np.array_equal(robot.footprint, whole.footprint)
    assert len(robot.all_solids) == len(whole.all_solids)


def test_outlines_of_many_corners_are_coarser_and_contain_the_fine_one(tmp_path: Path) -> None:
    disc = trimesh.creation.cylinder(radius=0.3, height=0.2, sections=200)
    path = crane(tmp_path, ('<box size="0.6 0.4 0.2"/>', '<mesh filename="meshes/disc.stl"/>'))
    disc.export(path.parent / "meshes" / "disc.stl")
    outline = shapely.Polygon(load_robot(path, tip="tool").footprint)
    assert len(outline.exterior.coords) <= 33
    fine = shapely.MultiPoint(disc.vertices[:, :2]).convex_hull
    assert outline.buffer(1e-6).covers(fine)  # STL files hold numbers of seven digits
    assert outline.is_valid
    assert outline.exterior.is_ccw


# --- meshes


def test_missing_meshes_are_named_and_stood_in_for(tmp_path: Path) -> None:
    path = crane(tmp_path)
    (path.parent / "meshes" / "upper.stl").unlink()
    with pytest.warns(
        UserWarning, match=r"link upper: mesh meshes/upper.stl: there is no such file; a capsule"
    ):
        robot = load_robot(path, tip="tool")
    stand_in = solid(robot, "pivot stand-in")
    assert isinstance(stand_in, LinkCapsule)
    assert (stand_in.link, stand_in.radius) == (1, LINK_RADIUS)
    assert stand_in.end.tolist() == [0.4, 0, 0]


def test_meshes_may_be_named_from_a_folder_above(tmp_path: Path) -> None:
    """As robots are that were written to be loaded from the folder that holds them all."""
    whole = load_robot(crane(tmp_path / "plain"), tip="tool")
    folder = tmp_path / "all" / "crane"
    path = crane(folder, ("meshes/upper.stl", "crane/{}/meshes/upper.stl"))
    inside = path.parent.relative_to(folder).as_posix()
    path.write_text(path.read_text().replace("crane/{}/", f"crane/{inside}/"))
    named = solid(load_robot(path, tip="tool"), "upper")
    assert type(named) is type(solid(whole, "upper"))


@pytest.mark.parametrize(
    "content", [b"", b"solid nothing", b"\0" * 90, b"\xff" * 1000], ids=["empty", "cut", "zeros", "noise"]
)
def test_unreadable_meshes_are_named_and_stood_in_for(tmp_path: Path, content: bytes) -> None:
    path = crane(tmp_path)
    (path.parent / "meshes" / "upper.stl").write_bytes(content)
    with pytest.warns(UserWarning, match="mesh meshes/upper.stl: expected .*replaces it"):
        load_robot(path, tip="tool")


def test_a_missing_mesh_of_the_base_is_said(tmp_path: Path) -> None:
    path = crane(tmp_path, ('<box size="0.6 0.4 0.2"/>', '<mesh filename="meshes/none.stl"/>'))
    with pytest.warns(UserWarning, match="none.stl: there is no such file; a box of the size of its mass"):
        robot = load_robot(path, tip="tool")
    assert "stand-in" in " ".join(solid.name for solid in robot.base_solids) or robot.body_height > 0.1


def test_meshes_that_are_missing_for_one_reason_share_a_note(tmp_path: Path) -> None:
    mesh = '<collision><geometry><mesh filename="package://gone/{0}.stl"/></geometry></collision>'
    links = "".join(f'<link name="{name}">{mesh.format(name)}</link>' for name in "abcd")
    joint = '<joint name="to_{1}" type="continuous"><parent link="{0}"/><child link="{1}"/></joint>'
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r">{links}{"".join(joint.format(*pair) for pair in ("ab", "bc", "cd"))}</robot>'
    )
    with pytest.warns(FileNote) as told:
        load_robot(tmp_path / "r.urdf")
    base, arm = (str(note.message) for note in told if "there is no folder gone" in str(note.message))
    assert base.endswith("stands in for it")
    assert arm.endswith("from joint to_b to the next replaces it; likewise of c, d")


def test_arms_without_any_solid_get_capsules(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/></joint><link name="c"/><joint name="f" type="fixed">'
        '<origin xyz="0 0 1"/><parent link="b"/><child link="c"/></joint></robot>'
    )
    deep = f"the tool point lies {LINK_RADIUS:.4f} m inside link 1 .*contact_depth"
    with (
        pytest.warns(UserWarning, match=deep),
        pytest.warns(UserWarning, match="no arm link has a collision element: capsules"),
    ):
        robot = load_robot(path)
    assert [(s.link, s.radius) for s in robot.solids] == [(0, LINK_RADIUS)]


@pytest.mark.parametrize(
    "name",
    [
        "package://crane/meshes/upper.stl",
        "package://crane/./meshes/../meshes/upper.stl",
        "file:meshes/upper.stl",
        "package://shared/upper.stl",
    ],
)
def test_where_meshes_are_looked_for(tmp_path: Path, name: str) -> None:
    path = crane(tmp_path, ("meshes/upper.stl", name))
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "upper.stl").write_bytes((path.parent / "meshes" / "upper.stl").read_bytes())
    if name.startswith("file:"):
        path.write_text(path.read_text().replace(name, f"file://{path.parent}/meshes/upper.stl"))
    body = solid(load_robot(path, tip="tool"), "upper")
    assert isinstance(body, LinkBox)
    assert sorted(body.size) == pytest.approx([0.06, 0.08, 0.4], rel=1e-5)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("../../secret.stl", "expected a file below {package}"),
        ("{folder}/secret.stl", "expected a file below {package}"),
        ("file://{folder}/secret.stl", "expected a file below {package}"),
        ("package://crane/../secret.stl", "expected a file below {package}"),
        ("package://crane//{folder}/secret.stl", "expected a file below {package}"),
        ("meshes/link.stl", "expected a file below {package}"),
        ("http://example.org/upper.stl", "expected package://name/file or a file relative"),
        ("https://example.org/upper.stl", "expected package://name/file or a file relative"),
        ("model://crane/upper.stl", "expected package://name/file or a file relative"),
    ],
)
def test_files_outside_the_package_are_refused(tmp_path: Path, name: str, expected: str) -> None:
    path = crane(tmp_path, ("meshes/upper.stl", name.format(folder=tmp_path)))
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "secret.stl")
    os.symlink(tmp_path / "secret.stl", path.parent / "meshes" / "link.stl")
    with pytest.raises(InputError) as caught:
        load_robot(path, tip="tool")
    assert expected.format(package=path.parent) in str(caught.value)
    assert "link upper: mesh" in str(caught.value)


@pytest.mark.parametrize(
    "name", ["package://../secret.stl", "package://etc/secret.stl", "package://", "package:x"]
)
def test_packages_that_are_none_are_missing(tmp_path: Path, name: str) -> None:
    path = crane(tmp_path, ("meshes/upper.stl", name))
    with pytest.warns(UserWarning, match="there is no folder"):
        load_robot(path, tip="tool")


def test_numbers_no_machine_can_hold_are_no_mesh(tmp_path: Path) -> None:
    path = crane(tmp_path)
    corners = np.random.default_rng(0).normal(size=(9, 3)) * 1e30
    whole = trimesh.Trimesh(corners, np.arange(9).reshape(-1, 3), process=False)
    whole.export(path.parent / "meshes" / "upper.stl")
    with pytest.warns(UserWarning, match="expected finite numbers of at most 1e\\+09 in size; a capsule"):
        load_robot(path, tip="tool")


def test_names_too_long_for_any_file_are_missing(tmp_path: Path) -> None:
    path = crane(tmp_path, ("meshes/upper.stl", "m" * 5000 + ".stl"))
    with pytest.warns(UserWarning, match="there is no such file"):
        load_robot(path, tip="tool")
    with pytest.raises(InputError, match="cannot be read"):
        load_robot("r" * 5000 + ".urdf")


def test_many_triangles_and_many_solids_become_few_solids(tmp_path: Path) -> None:
    stone = '<collision><origin xyz="{} 0 {}"/><geometry><sphere radius="0.04"/></geometry></collision>'
    many = "".join(stone.format(0.0002 * k, 0.001 * (k % 37)) for k in range(300))
    path = crane(
        tmp_path, ('<collision><origin xyz="0.2 0 0"/>', many + '<collision><origin xyz="0.2 0 0"/>')
    )
    ball = trimesh.creation.icosphere(subdivisions=6, radius=200)  # 80,000 triangles, in mm
    ball.export(path.parent / "meshes" / "upper.stl")
    robot = load_robot(path, tip="tool")
    assert len(robot.solids) <= 20
    body = solid(robot, "upper")
    points = ball.vertices / 1000 @ pose([0, 0, 0], [0, 0, 0.3])[:3, :3].T + [0.1, 0, 0]
    assert depth(body, points).max() < 1e-6
    assert volume(body) < 1.1 * 4 / 3 * np.pi * 0.2**3


@settings(max_examples=examples(30))
@given(st.integers(0, 1000), st.tuples(*[st.floats(0.01, 1)] * 3))
def test_an_outer_hull_contains_its_points_and_little_more(seed: int, sizes: tuple[float, ...]) -> None:
    points = np.random.default_rng(seed).normal(size=(300, 3)) * sizes
    outer = Delaunay(outer_hull(points))
    inward = points.mean(0) + (points - points.mean(0)) * (1 - 1e-9)
    assert (outer.find_simplex(inward) >= 0).all()
    assert ConvexHull(outer.points).volume < 1.3 * ConvexHull(points).volume
    flat = points * [1, 1, 0]
    assert np.array_equal(outer_hull(flat), convex_hull(flat))


# --- COLLADA

DAE = """\
<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0
      1</float_array></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s">
    <node><translate>10 0 0</translate><node><rotate>0 0 1 90</rotate><scale>2 2 2</scale>
      <instance_geometry url="#g"/></node></node>
    <node><matrix>1 0 0 0  0 1 0 0  0 0 1 5  0 0 0 1</matrix><instance_geometry url="#g"/></node>
  </visual_scene></library_visual_scenes>
</COLLADA>
"""


def points_of(path: Path) -> Array:
    return np.concatenate([points for points, _ in read_geometries(path)])


def test_collada_points_stand_where_the_scene_puts_them(tmp_path: Path) -> None:
    path = tmp_path / "a.dae"
    path.write_text(DAE)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    turned = 2 * corners @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [10, 0, 0]
    expected = 0.01 * np.concatenate([turned, corners + [0, 0, 5]])
    found = {tuple(point) for point in np.round(points_of(path), 9) + 0.0}
    assert found == {tuple(point) for point in np.round(expected, 9) + 0.0}
    path.write_text(DAE[: DAE.index("  <library_visual")] + "</COLLADA>")
    assert np.allclose(points_of(path), 0.01 * corners)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("<COLLADA", "<COLLADE", "not valid XML"),
        ("0 0 0 1 0 0", "0 0 0 1 0 x", "line 5: float_array: expected finite numbers"),
        ("0 0 0 1 0 0", "0 0 0 1 0 nan", "line 5: float_array: expected finite numbers"),
        ("0 0 0 1 0 0", "0 0 0 1 0", "expected three numbers a vertex, got 11"),
        ('source="#p"', 'source="#q"', "vertices: expected the id of a source"),
        ('meter="0.01"', 'meter="-1"', "unit: expected meter above 0"),
        ("<translate>10 0 0", "<translate>10 0", "translate: expected 3 numbers, got 2"),
        ("0 0 1 90", "0 0 0 90", "axis must not be zero"),
        ('<matrix>1 0 0 0  0 1 0 0  0 0 1 5  0 0 0 1</matrix><instance_geometry url="#g"/>',
         '<instance_geometry url="#h"/>', "instance_geometry: expected the id of a geometry"),
        ('semantic="POSITION"', 'semantic="NORMAL"', "expected a mesh with finite vertices"),
        ("<COLLADA", "<!DOCTYPE COLLADA [<!ENTITY a 'b'>]><COLLADA", "leave out <!DOCTYPE"),
    ],
)  # fmt: skip
def test_broken_collada(tmp_path: Path, old: str, new: str, expected: str) -> None:
    path = tmp_path / "a.dae"
    assert DAE.count(old) == 1
    path.write_text(DAE.replace(old, new))
    with pytest.raises(InputError) as caught:
        points_of(path)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
