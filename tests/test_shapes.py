from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh

from regionik.view import triangle_meshes
from regionik.view.options import VIEW
from regionik.view.triangle_meshes import TriangleMesh
from regionik.worlds.links import LinkBox, LinkCapsule
from tests.kinds import Solid
from tests.maths import Array, pose
from tests.plans import every_solid


def area(part: TriangleMesh) -> float:
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def bounds(part: TriangleMesh) -> Array:
    return np.array([part.vertices.min(axis=0), part.vertices.max(axis=0)])


@pytest.mark.parametrize(
    "floor",
    [
        shapely.Polygon(),
        shapely.box(0, 0, 2, 1),
        shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2),
        shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.Point(5, 5).buffer(1)]),
        shapely.GeometryCollection([shapely.box(0, 0, 1, 1), shapely.LineString([(0, 0), (3, 3)])]),
    ],
)
def test_flat_covers_the_area_exactly(floor: shapely.Geometry) -> None:
    part = triangle_meshes.floor_mesh(floor, 0.25)
    assert area(part) == pytest.approx(floor.area)
    assert (part.vertices[:, 2] == 0.25).all()


def test_extruded_has_walls_and_a_lid() -> None:
    ring = shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2)
    part = triangle_meshes.extrude(ring, 0.5, 2.5)
    assert area(part) == pytest.approx(ring.area + 2.0 * ring.length)
    assert np.allclose(bounds(part), [[0, 0, 0.5], [3, 3, 2.5]])


@pytest.mark.parametrize("end", [[0, 0, 0.4], [0.1, -0.2, 0.3], [0, 0, -0.2], [0.3, 0, 0], [0, 0, 0]])
def test_a_capsule_lies_just_within_its_radius(end: list[float]) -> None:
    start = np.array([0.1, 0.2, 0.3])
    part = triangle_meshes.capsule(start, start + end, 0.05)
    along = np.array(end, dtype=float)
    t = np.clip((part.vertices - start) @ along / max(along @ along, 1e-30), 0, 1)[:, None]
    away = np.linalg.norm(part.vertices - start - t * along, axis=1)
    assert np.allclose(away, 0.05, atol=1e-9)
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=True, merge_norm=True)
    whole = 4 / 3 * np.pi * 0.05**3 + np.pi * 0.05**2 * float(np.linalg.norm(end))
    assert abs(mesh.volume) == pytest.approx(whole, rel=0.05)


def test_a_box_on_a_link_is_closed_and_has_its_corners() -> None:
    T_link_box, size = pose([0.1, -0.2, 0.3], [0.4, 0.5, -2.0]), np.array([0.1, 0.2, 0.4])
    part = triangle_meshes.link_mesh(LinkBox(0, "case", T_link_box, size))
    own = (part.vertices - T_link_box[:3, 3]) @ T_link_box[:3, :3]
    assert np.allclose(np.abs(own), size / 2, atol=1e-12)
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=True, merge_norm=True)
    assert len(mesh.vertices) == 8
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(np.prod(size))  # above zero: every side faces outwards


def test_a_capsule_on_a_link_is_drawn_as_one() -> None:
    start, end = np.array([0.0, 0.1, 0.2]), np.array([0.3, 0.1, 0.0])
    part = triangle_meshes.link_mesh(LinkCapsule(0, "tube", start, end, 0.05))
    assert np.array_equal(part.vertices, triangle_meshes.capsule(start, end, 0.05).vertices)


def test_tubes_and_balls_have_equal_shares_of_faces() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 2.0], [1, 3, 2]])
    tubes = triangle_meshes.tubes(points, 0.01)
    assert len(tubes.faces) == 4 * 2 * VIEW.scene.tube_sides
    assert np.isfinite(tubes.vertices).all()
    one = tubes.vertices[np.unique(tubes.faces[: 2 * VIEW.scene.tube_sides])]
    assert np.allclose(np.hypot(one[:, 1], one[:, 2]), 0.01)
    for count in (3, 400):
        balls = triangle_meshes.spheres(np.arange(3.0 * count).reshape(-1, 3), 0.02)
        share = len(balls.faces) // count
        assert share * count == len(balls.faces)
        last = balls.vertices[np.unique(balls.faces[-share:])]
        assert np.allclose(np.linalg.norm(last - [3 * count - 3, 3 * count - 2, 3 * count - 1], axis=1), 0.02)


@pytest.mark.parametrize("body", every_solid().solids, ids=lambda body: body.name)
def test_solids_are_drawn_where_they_are(body: Solid) -> None:
    part = triangle_meshes.obstacle_mesh(body)
    assert np.allclose(bounds(part)[:, 2], body.z_range, atol=1e-9)
    assert np.allclose(bounds(part)[:, :2].ravel(), triangle_meshes.shadow_polygon(body).bounds, atol=1e-6)
    surface = [abs(body.distance(vertex)) for vertex in part.vertices]
    assert max(surface) < 0.01


def test_merged_keeps_order_and_nothing_is_fine() -> None:
    a, b = (
        triangle_meshes.floor_mesh(shapely.box(0, 0, 1, 1)),
        triangle_meshes.floor_mesh(shapely.box(2, 0, 4, 1)),
    )
    both = triangle_meshes.merge([a, triangle_meshes.floor_mesh(shapely.Polygon()), b])
    assert np.allclose(both.vertices[both.faces[: len(a.faces)]], a.vertices[a.faces])
    assert np.allclose(both.vertices[both.faces[len(a.faces) :]], b.vertices[b.faces])
    assert len(triangle_meshes.merge([]).faces) == 0
