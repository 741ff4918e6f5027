"""Triangles in a tree: what it finds is what asking every triangle finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from regionik.planners.collision.gjk import hull_distance
from regionik.planners.collision.meshes import nearest_triangle, triangle_tree
from tests import examples
from tests.maths import Array


def soup(count: int, seed: int) -> tuple[Array, NDArray[np.int64]]:
    """Small triangles anywhere, some of them twice, and some without area."""
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-0.2, 0.2, (count, 3, 3))
    thin = rng.random(count) < 0.1
    vertices[thin, 2] = vertices[thin, :2].mean(1)
    faces = np.arange(3 * count).reshape(-1, 3)
    faces[rng.random(count) < 0.1] = faces[0]
    return vertices.reshape(-1, 3), faces


def gap_of_all(vertices: Array, faces: NDArray[np.int64], hull: Array) -> float:
    return min(max(hull_distance(hull, vertices[f], 0.0, np.zeros(3), np.empty(3))[0], 0.0) for f in faces)


@settings(max_examples=examples(60))
@given(st.integers(1, 150), st.integers(0, 10**6), st.sampled_from([2, 8]), st.sampled_from([0.2, 1.0, 3.0]))
def test_the_tree_finds_what_all_triangles_say(count: int, seed: int, corners: int, far: float) -> None:
    vertices, faces = soup(count, seed)
    tree = triangle_tree(vertices, faces)
    rng = np.random.default_rng(seed + 1)
    hull = rng.uniform(-0.3, 0.3, (corners, 3)) + far * rng.uniform(-1, 1, 3)
    expected = gap_of_all(vertices, faces, hull)
    for guess in ([0.0, 0.0, 1.0], hull[0] / np.linalg.norm(hull[0])):
        way, spot = np.array(guess), np.zeros(3)
        assert nearest_triangle(tree, hull, np.inf, way, spot) == pytest.approx(expected, abs=1e-9)
        if expected > 1e-6:
            shown = [(hull @ way).min() - (vertices[f] @ way).max() for f in faces]
            assert max(shown) >= expected - 1e-9
            assert np.linalg.norm(way) == pytest.approx(1.0)
        told = way.copy()
        assert nearest_triangle(tree, hull, 0.5 * expected, way, spot) == 0.5 * expected
        np.testing.assert_array_equal(way, told)
