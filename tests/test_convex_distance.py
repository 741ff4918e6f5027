"""Distances of hulls against least squares, convex hulls of differences, and tables."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from regionik.verification.self_collision import (
    RoundedHull,
    gap_along,
    prism_hull,
    signed_distances,
)
from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull
from regionik.worlds.obstacles import Prism
from tests.bodies import random_frame, signed_distance
from tests.kinds import LinkSolid
from tests.maths import Array, translation

HEPTAGON = Prism("body", Polygon(Point(0, 0).buffer(0.2, 2).exterior.coords[:-2]), 0.0, 0.15)


def link_hull(solid: LinkSolid) -> RoundedHull:
    return RoundedHull(solid.corners, solid.radius)


def segment(*ends: tuple[float, float, float], radius: float = 0.1) -> RoundedHull:
    return link_hull(LinkCapsule(0, "capsule", np.array(ends[0]), np.array(ends[1]), radius))


def cube(size: float = 1.0) -> RoundedHull:
    return link_hull(LinkBox(0, "cube", np.eye(4), np.full(3, size)))


def some_hull(rng: np.random.Generator, kind: str) -> RoundedHull:
    if kind == "prism":
        return prism_hull(HEPTAGON)
    if kind == "box":
        return link_hull(LinkBox(0, "box", random_frame(rng, 0.1), rng.uniform(0.01, 0.5, 3)))
    if kind == "hull":
        return link_hull(LinkHull(0, "hull", rng.uniform(-0.2, 0.2, (20, 3))))
    ends = rng.uniform(-0.3, 0.3, (2, 3))
    if kind == "point":
        ends[1] = ends[0]
    return link_hull(LinkCapsule(0, "capsule", ends[0], ends[1], 0.05))


@pytest.mark.parametrize("moving", ["capsule", "box", "point", "hull"])
@pytest.mark.parametrize("still", ["capsule", "box", "prism", "point", "hull"])
def test_distance_is_that_of_the_difference_body(still: str, moving: str) -> None:
    rng = np.random.default_rng(4)
    one, other = some_hull(rng, still), some_hull(rng, moving)
    T = np.array([random_frame(rng, reach) for reach in (0.0, 0.1, 0.2, 0.4, 0.8) for _ in range(12)])
    found = signed_distances(one, other, T)
    for k, corners in enumerate(other.corners_in(T)):
        expected = signed_distance(one.corners, corners) - one.radius - other.radius
        assert found.distance[k] == pytest.approx(expected, abs=2e-7)
    proof = gap_along(one, other.corners_in(T), found.normal) - one.radius - other.radius
    assert proof == pytest.approx(found.distance, abs=1e-12)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("one", "other", "at", "distance"),
    [
        (cube(), cube(), (1.5, 0, 0), 0.5),
        (cube(), cube(), (0.75, 0.1, 0.2), -0.25),
        (cube(), cube(), (0, 0, 0), -1.0),
        (cube(), cube(), (1.0, 1.0, 1.0), 0.0),
        (cube(), cube(), (2.0, 2.0, 2.0), np.sqrt(3)),
        (cube(), cube(), (2.0, 2.0, 0.3), np.sqrt(2)),
        (cube(), cube(0.1), (0, 0, 0.2), -0.35),
        (segment((0, 0, 0), (1, 0, 0)), segment((0, 0, 0), (1, 0, 0)), (0, 0.5, 0), 0.3),
        (segment((0, 0, 0), (1, 0, 0)), segment((0, 0, 0), (1, 0, 0)), (3, 0, 0), 1.8),
        (segment((0, 0, 0), (1, 0, 0)), segment((0, 0, 0), (1, 0, 0)), (0.5, 0, 0), -0.2),
        (segment((0, 0, 0), (1, 0, 0)), segment((0, -1, 0), (0, 1, 0)), (0.5, 0, 0.15), -0.05),
        (segment((0, 0, 0), (0, 0, 0)), segment((0, 0, 0), (0, 0, 0)), (0, 0, 0), -0.2),
        (segment((0, 0, 0), (0, 0, 0)), segment((1, -1, 0), (1, 1, 0)), (0, 0, 0), 0.8),
        (cube(), segment((-1, 0, 0), (1, 0, 0)), (0, 0, 0.7), 0.1),
        (cube(), segment((-2, 0, 0), (2, 0, 0)), (0, 0, 0), -0.6),
        (
            prism_hull(Prism("p", Polygon([(0, 0), (0, 1), (1, 1), (1, 0)]), 0, 1)),
            cube(),
            (2, 0.5, 0.5),
            0.5,
        ),
    ],
)
def test_distances_by_hand(
    one: RoundedHull, other: RoundedHull, at: tuple[float, float, float], distance: float
) -> None:
    found = signed_distances(one, other, translation(*at)[None])
    assert found.distance[0] == pytest.approx(distance, abs=1e-12)
    swapped = signed_distances(other, one, translation(*(-np.array(at)))[None])
    assert swapped.distance[0] == pytest.approx(distance, abs=1e-12)


@pytest.mark.parametrize("slant", [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3])
def test_edges_that_are_nearly_parallel(slant: float) -> None:
    """Where two lines meet is ill-conditioned then; how near they come is not, and never told too large."""
    one = segment((0, 0, 0), (1, 0, 0))
    other = segment((0.2, 0.3, 0), (0.9, 0.3 + slant, slant))
    found = signed_distances(one, other, np.eye(4)[None])
    assert 0.1 - 2e-9 < found.distance[0] < 0.1 + 1e-12
    box = signed_distances(
        cube(), segment((-0.3, 0.5, 0.7), (0.3, 0.5 + slant, 0.7 + slant)), np.eye(4)[None]
    )
    assert box.distance[0] == pytest.approx(0.1, abs=1e-12)


def test_no_poses_give_no_distances() -> None:
    none: Array = np.zeros((0, 4, 4))
    for other in (cube(), segment((0, 0, 0), (1, 0, 0)), segment((0, 0, 0), (0, 0, 0))):
        assert signed_distances(cube(), other, none).distance.shape == (0,)
        assert signed_distances(other, cube(), none).normal.shape == (0, 3)
