"""Hulls as solids of links: what holds of a box holds of the hull of its corners, and tight bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.planners.collision.convex_bodies import inner_capsule
from regionik.planners.collision.distances import hull_separation, obstacles_from
from regionik.planners.collision.robot_bodies import core_of
from regionik.verification.contact import shrunk_weights
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.links import MIN_HULL_ROWS, LinkBox, LinkHull
from regionik.worlds.polytopes import polytope
from regionik.worlds.urdf.bounding import bounding_solid, convex_hull
from regionik.worlds.urdf.options import URDF
from tests import examples
from tests.bodies import random_frame
from tests.maths import translation
from tests.plans import every_solid
from tests.urdfs import depth


def hull_of(box: LinkBox) -> LinkHull:
    return LinkHull(box.link, box.name, box.corners)


def test_a_hull_has_more_rows_than_a_box_and_says_how_deep_a_point_is() -> None:
    box = LinkBox(2, "box", translation(0.1, 0, 0), np.array([0.2, 0.4, 0.6]))
    hull = hull_of(box)
    assert len(hull.corners) == MIN_HULL_ROWS
    assert len(hull.polytope.normals) == 6
    assert len(hull.polytope.edges) == 3
    for point in np.random.default_rng(0).uniform(-0.4, 0.4, (50, 3)):
        assert hull.depth(point) == pytest.approx(box.depth(point))
    for corners, what in ((np.zeros((3, 3)), "expected 4 to 256"), (np.eye(4)[:, :3], None)):
        if what:
            with pytest.raises(InputError, match=f"flat: {what} corners, got 3"):
                LinkHull(0, "flat", corners)
    with pytest.raises(InputError, match="flat: expected at least four corners that do not lie in one plane"):
        LinkHull(0, "flat", np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]))


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_hull_is_as_far_from_everything_as_the_same_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    box = LinkBox(0, "box", random_frame(rng, 0.05), rng.uniform(0.05, 0.3, 3))
    at = rng.uniform([-0.6, -0.9, 0], [2.5, 1.8, 1.2])
    corners, rows = box.corners + at, hull_of(box).corners + at
    for piece in obstacles_from(every_solid().solids).pieces:
        ours, theirs = hull_separation(piece, rows), hull_separation(piece, corners)
        if theirs.distance > 1e-6:
            assert ours.distance == pytest.approx(theirs.distance, abs=2e-6)
            assert (rows @ ours.normal).min() - piece.support(ours.normal) <= ours.distance + 1e-9
        elif piece.mesh is None:
            assert ours.distance == pytest.approx(theirs.distance, abs=1e-6)
        else:
            assert ours.distance < 1e-6


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0, 0.1))
def test_what_is_left_of_a_hull_is_within_the_depth_of_its_faces(seed: int, taken: float) -> None:
    rng = np.random.default_rng(seed)
    hull = LinkHull(0, "hull", rng.uniform(-0.15, 0.15, (15, 3)))
    core, radius = core_of(hull, taken, np.array([0, 0, 0.2]))
    assert radius == 0.0
    weights = shrunk_weights(hull.corners[None], taken, np.array([[0, 0, 0.2]]))[0]
    assert core == pytest.approx(weights @ hull.corners)
    inside = hull.polytope.depth(core)
    assert (inside >= 0.999 * min(taken, hull.depth(hull.corners.mean(0))) - 1e-9).all()
    assert polytope(core).depth(core.mean(0)) > 0


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_capsule_inside_a_hull_is_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hull = LinkHull(0, "hull", rng.normal(size=(15, 3)) * rng.uniform(0.02, 0.3, 3))
    core = inner_capsule(hull)
    assert (hull.polytope.depth(core.corners) >= core.radius - 1e-9).all()
    assert core.radius >= 0.85 * max(hull.depth(hull.corners.mean(0)), 0.0)


@settings(max_examples=examples(25), deadline=None)
@given(st.integers(0, 2**32 - 1), st.tuples(*[st.floats(0.02, 1)] * 3))
def test_bounds_hold_all_points_and_are_tighter_than_boxes(seed: int, sizes: tuple[float, ...]) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, 3)) * sizes @ random_frame(rng, 0.1)[:3, :3]
    bound = bounding_solid(0, "cloud", convex_hull(points))
    assert depth(bound, points).max() < 1e-8
    assert len(bound.corners) <= max(URDF.bounding.max_corners, MIN_HULL_ROWS)


@pytest.mark.parametrize(
    "mesh", [trimesh.creation.box((0.3, 0.2, 0.1)), trimesh.creation.capsule(height=0.4, radius=0.05)]
)
def test_what_a_simple_solid_bounds_tightly_has_no_hull(mesh: trimesh.Trimesh) -> None:
    assert not isinstance(bounding_solid(0, "simple", np.asarray(mesh.vertices)), LinkHull)


def test_a_tapered_link_is_bound_to_a_millimetre() -> None:
    wedge = np.array([[x, y * (1 + x), z] for x in (0, 1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]) * 0.3
    bound = bounding_solid(0, "wedge", wedge)
    assert isinstance(bound, LinkHull)
    assert polytope(wedge).depth(bound.corners).min() > -URDF.bounding.max_excess - 1e-6


def test_hulls_are_kept_in_world_files() -> None:
    world = load_world("slab")
    solids = (
        *world.robot.solids[:-1],
        LinkHull(4, "gripper", np.random.default_rng(0).uniform(-0.05, 0.05, (10, 3))),
    )
    document = world_to_document(replace(world, robot=replace(world.robot, solids=solids)))
    again = world_from_document(document)
    assert again.robot.solids[-1].corners.tolist() == solids[-1].corners.tolist()
    assert world_to_document(again) == document
    document["robot"]["solids"][-1]["radius"] = 0.1
    with pytest.raises(
        InputError, match=r"solids\[3\]: expected link, name and either start.*or corners \(a hull\)"
    ):
        world_from_document(document)


def test_a_moved_hull_is_the_hull_of_its_moved_corners() -> None:
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(14, 3))
    T = random_frame(rng, 1.0)
    moved, anew = polytope(corners).moved(T), polytope(corners @ T[:3, :3].T + T[:3, 3])
    points = rng.normal(size=(200, 3)) + T[:3, 3]
    assert moved.depth(points) == pytest.approx(anew.depth(points), abs=1e-9)
    assert len(moved.edges) == len(anew.edges)
    assert np.abs(moved.edges @ anew.edges.T).max(axis=1) == pytest.approx(1.0, abs=1e-9)
