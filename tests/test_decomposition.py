"""A few solids for a robot's links: nothing sticks out, cuts save volume, too many share bounds."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.worlds.links import LinkBox
from regionik.worlds.urdf.bounding import volume
from regionik.worlds.urdf.decomposition import CollisionPart, decompose, mesh_part
from tests import examples
from tests.kinds import LinkSolid
from tests.maths import Array, pose
from tests.urdfs import depth

NO_SURFACE = np.empty((0, 3, 3))


def crook(arms: int) -> trimesh.Trimesh:
    """Boxes at right angles, joined at their ends: an L, or a Z where there are three."""
    parts = [trimesh.creation.box((1.0, 0.1, 0.1), pose([0.5, 0, 0], [0, 0, 0]))]
    ends = [(0.05, 0.45), (0.95, -0.45)][: arms - 1]
    parts += [trimesh.creation.box((0.1, 0.1, 0.8), pose([x, 0, z], [0, 0, 0])) for x, z in ends]
    whole = trimesh.util.concatenate(parts)
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def triangles_of(mesh: trimesh.Trimesh, T: Array) -> Array:
    found: Array = np.asarray(mesh.triangles) @ T[:3, :3].T + T[:3, 3]
    return found


def inside(mesh: trimesh.Trimesh, count: int) -> Array:
    """Points in the boxes that a mesh is made of."""
    rng = np.random.default_rng(0)
    boxes = mesh.split(only_watertight=False)
    return np.concatenate([rng.uniform(box.bounds[0], box.bounds[1], (count, 3)) for box in boxes])


def outermost(solids: tuple[LinkSolid, ...], points: Array) -> float:
    """How far the point sticks out that sticks out most."""
    return float(np.min([depth(solid, points) for solid in solids], axis=0).max())


_POSE = st.tuples(*[st.floats(-3, 3)] * 6).map(lambda values: pose(values[:3], values[3:]))


@settings(max_examples=examples(30))
@given(_POSE, st.integers(2, 3))
def test_cut_meshes_stay_inside_and_shrink(T: Array, arms: int) -> None:
    mesh = crook(arms)
    part = mesh_part(3, "crook", triangles_of(mesh, T))
    solids = tuple(piece.solid for piece in decompose([part]))
    assert outermost(solids, inside(mesh, 200) @ T[:3, :3].T + T[:3, 3]) < 1e-8
    names = [f"crook part {k + 1}" for k in range(len(solids))]
    assert [(s.link, s.name) for s in solids] == [(3, name) for name in names]
    assert sum(map(volume, solids)) < 0.6 * volume(part.solid)


def test_what_is_nearly_its_bound_is_not_cut() -> None:
    for mesh in (trimesh.creation.box((0.5, 0.3, 0.1)), trimesh.creation.capsule(height=1.0, radius=0.1)):
        assert [s.name for s in decompose([mesh_part(0, "plain", np.asarray(mesh.triangles))])] == ["plain"]


def test_there_are_never_more_cuts_than_room() -> None:
    crooks = [mesh_part(k, f"crook {k}", triangles_of(crook(3), np.eye(4))) for k in range(3)]
    assert len(decompose(crooks, 20)) == 12
    assert len(decompose(crooks, 3)) == 3
    assert 3 < len(decompose(crooks, 5)) <= 5


def test_a_mesh_that_is_named_again_counts_once() -> None:
    once = mesh_part(0, "crook", triangles_of(crook(2), np.eye(4)))
    again = mesh_part(0, "crook 2", triangles_of(crook(2), np.eye(4)))
    assert len(decompose([once, again])) == len(decompose([once])) == 2


def test_too_many_solids_of_a_link_share_bounds() -> None:
    rng = np.random.default_rng(1)
    parts = [
        CollisionPart(k % 2, f"stone {k}", spot + 0.02 * rng.normal(size=(8, 3)), NO_SURFACE)
        for k, spot in enumerate(rng.choice([-1.0, 0.0, 1.0], (40, 3)))
    ]
    solids = tuple(piece.solid for piece in decompose(parts, 12))
    assert len(solids) == 12
    for link in (0, 1):
        own = tuple(solid for solid in solids if solid.link == link)
        assert outermost(own, np.concatenate([p.points for p in parts if p.link == link])) < 1e-8
    links = [CollisionPart(k, "alone", np.eye(3), NO_SURFACE) for k in range(4)]
    assert len(decompose(links, 2)) == 4  # what different links carry stays apart


def test_solids_that_are_known_are_taken() -> None:
    box = LinkBox(0, "box", np.eye(4), np.array([1.0, 2.0, 3.0]))
    (piece,) = decompose([CollisionPart(0, "box", box.corners, NO_SURFACE, box)])
    assert piece.solid is box
