"""Distances of links against computations that share no code with them."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import NonlinearConstraint, minimize, minimize_scalar
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from shapely.geometry import Point, Polygon, box

from regionik.planners.collision.convex_bodies import Piece, Separation, link_piece
from regionik.planners.collision.distances import (
    Obstacles,
    box_distances,
    hull_separation,
    keeps_apart,
    nearest_distance,
    obstacles_from,
)
from regionik.planners.geometry.convex_decomposition import convex_pieces
from regionik.planners.geometry.options import GEOMETRY
from regionik.worlds.errors import InputError
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from tests import examples
from tests.kinds import Solid
from tests.maths import Array

ELL = Polygon([(-0.4, -0.4), (0.4, -0.4), (0.4, 0.0), (0.0, 0.0), (0.0, 0.4), (-0.4, 0.4)])
RING = Point(0, 0).buffer(0.4, quad_segs=8) - box(-0.2, -0.1, 0.2, 0.15)
CUBE = (
    np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]),
    np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
        + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    ),
)
SOLIDS: dict[str, Solid] = {
    "box": Box("box", np.array([0.2, 0.4, 0.6]), np.zeros(3)),
    "turned box": Box("turned box", np.array([0.5, 0.02, 0.3]), np.array([0.1, -0.1, 0.05]), 0.7),
    "cylinder": Cylinder("cylinder", 0.1, 0.6, np.array([0.02, 0.0, 0.1])),
    "plate": Cylinder("plate", 0.3, 0.02, np.zeros(3)),
    "ball": Sphere("ball", 0.2, np.array([0.1, 0.0, 0.0])),
    "prism": Prism("prism", Polygon([(-0.2, -0.1), (0.3, -0.2), (0.1, 0.3)]), -0.3, 0.1),
    "ell": Prism("ell", ELL, -0.1, 0.1),
    "ring": Prism("ring", RING, -0.2, 0.2),
    "mesh": Mesh("mesh", *CUBE),
}
# Lengths that put segments on faces, edges, corners and at a radius from them.
NASTY = np.array([-0.4, -0.335, -0.3, -0.235, -0.2, -0.135, -0.1, 0, 0.1, 0.135, 0.2, 0.235, 0.3, 0.335, 0.4])


def segment_separation(piece: Piece, start: Array, end: Array) -> Separation:
    return hull_separation(piece, np.stack([start, end]))


def axis_distance(solid: Solid, a: Array, b: Array, count: int = 60) -> float:
    """Least distance of points on the segment: samples, then a search between the best of them."""

    def at(t: float) -> float:
        return solid.distance(a + t * (b - a))

    t = np.linspace(0, 1, count + 1)
    values = np.array([at(s) for s in t])
    best = float(values.min())
    for k in np.argsort(values)[:3]:
        bounds = (t[max(k - 1, 0)], t[min(k + 1, count)])
        best = min(best, minimize_scalar(at, bounds=bounds, method="bounded", options={"xatol": 1e-12}).fun)
    return best


def segments(count: int, seed: int) -> list[tuple[Array, Array]]:
    """Segments anywhere, and degenerate ones."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(count):
        if k % 2:
            a = rng.uniform(-0.6, 0.6, 3)
            found.append((a, a + rng.uniform(-0.3, 0.3, 3)))
            continue
        a = rng.choice(NASTY, 3)
        b = a.copy() if k % 4 else rng.choice(NASTY, 3)
        if k % 8 == 2:
            b[rng.integers(3)] += 0.155
        if k % 6 == 0:
            a = a + rng.normal(size=3) * 10.0 ** rng.integers(-16, -6)
        found.append((a, b))
    return found


@pytest.mark.parametrize("name", SOLIDS)
def test_distance_agrees_with_points_of_the_axis(name: str) -> None:
    solid = SOLIDS[name]
    obstacles = obstacles_from([solid])
    for a, b in segments(150, seed=len(name)):
        near = nearest_distance(obstacles, a, b, 0.035)
        expected = axis_distance(solid, a, b)
        if expected > 1e-7:
            assert near == pytest.approx(expected - 0.035, abs=1e-6)
        elif expected < -1e-7:
            assert near < -0.035 + 1e-9
        else:
            assert near < -0.035 + 1e-6


@pytest.mark.parametrize("name", SOLIDS)
def test_witnesses_lie_on_axis_and_surface(name: str) -> None:
    solid = SOLIDS[name]
    pieces = obstacles_from([solid]).pieces
    for a, b in segments(100, seed=3):
        near = min((segment_separation(piece, a, b) for piece in pieces), key=lambda one: one.distance)
        if near.distance < 1e-6:
            continue
        assert abs(solid.distance(near.on_axis - near.distance * near.normal)) < 1e-6
        square = max(float((b - a) @ (b - a)), 1e-12)
        t = np.clip((near.on_axis - a) @ (b - a) / square, 0, 1)
        np.testing.assert_allclose(near.on_axis, a + t * (b - a), rtol=0, atol=1e-6)
        assert np.linalg.norm(near.normal) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("name", ["box", "turned box", "cylinder", "plate", "ball", "prism"])
def test_the_way_out_frees_the_link_and_none_is_much_shorter(name: str) -> None:
    obstacles = obstacles_from([SOLIDS[name]])
    rng = np.random.default_rng(7)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    seen = 0
    for a, b in segments(200, seed=11):
        near = segment_separation(obstacles.pieces[0], a, b)
        if near.distance >= -1e-6:
            continue
        seen += 1
        depth = -near.distance
        freed = (depth + 1e-7) * near.normal
        assert segment_separation(obstacles.pieces[0], a + freed, b + freed).distance > 0
        short = 0.98 * depth
        for way in directions[:20]:
            moved = segment_separation(obstacles.pieces[0], a + short * way, b + short * way)
            assert moved.distance < 1e-9
    assert seen >= 8


def test_distance_from_a_ball_in_closed_form() -> None:
    obstacles = obstacles_from([Sphere("ball", 0.2, np.array([1.0, 0.0, 0.0]))])
    assert nearest_distance(obstacles, [0, -1, 0], [0, 1, 0], 0.05) == pytest.approx(0.75, abs=1e-12)
    near = segment_separation(obstacles.pieces[0], np.array([0.0, -1, 0]), np.array([0.0, 1, 0]))
    np.testing.assert_allclose(near.on_axis, [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(near.normal, [-1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("as_mesh", [False, True])
def test_an_upright_link_beside_an_upright_wall(as_mesh: bool) -> None:
    """Their edges are parallel but for rounding, where fcl may take others for the nearest."""
    size, middle = np.array([0.48736026, 0.26423666, 0.8]), np.array([-0.33203483, 0.07671397, 0.4])
    wall = Box("wall", size, middle, 1.9346469225358376)
    spots = np.random.default_rng(1).normal([-0.4467, -0.189, 0.147], 0.1, (2000, 3))
    corners = obstacles_from([wall]).pieces[0].corners  # the lower ones, then those above them
    sides = [[k, (k + 1) % 4, m] for k in range(4) for m in ((k + 1) % 4 + 4, k)]
    sides = [[a, b, c] if c > 3 else [a, b + 4, a + 4] for a, b, c in sides]
    surface = Mesh("mesh", corners, np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], *sides]))
    obstacles = obstacles_from([surface if as_mesh else wall])
    for a in [np.array([-0.4467059424322599, -0.18900687515437725, 0.147]), *spots]:
        b = a + (0.0, 0.0, 0.155)
        level = wall.distance(
            np.array([a[0], a[1], np.clip(0.4, a[2], b[2])])
        )  # it never stands over the wall
        if level > 0 and a[2] < 0.8 and b[2] > 0:
            assert nearest_distance(obstacles, a, b, 0.0) == pytest.approx(level, abs=1e-8)


def test_the_nearest_of_many() -> None:
    solids = [Sphere(f"ball {k}", 0.1, np.array([k, 0.0, 0.0])) for k in range(1, 20)]
    obstacles = obstacles_from(solids)
    assert nearest_distance(obstacles, [0, 0, 0], [0, 0, 1], 0.05) == pytest.approx(0.85)


def test_no_solids_is_infinitely_far() -> None:
    assert nearest_distance(obstacles_from([]), [0, 0, 0], [0, 0, 1], 0.05) == np.inf


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused(number: float) -> None:
    obstacles = obstacles_from([SOLIDS["box"]])
    for start, end, radius in (
        ([number, 0, 0], [1, 0, 0], 0.1),
        ([0, 0, 0], [1, number, 0], 0.1),
        ([0, 0, 0], [1, 0, 0], number),
    ):
        with pytest.raises(InputError, match="finite"):
            nearest_distance(obstacles, start, end, radius)


def test_numbers_that_are_not_finite_do_not_reach_the_engine() -> None:
    piece = obstacles_from([SOLIDS["mesh"]]).pieces[0]
    with pytest.raises(InputError, match="finite"):
        segment_separation(piece, np.array([np.nan, 0, 0]), np.zeros(3))


@pytest.mark.parametrize("name", ["box", "mesh"])
def test_a_link_that_lies_in_a_face_touches(name: str) -> None:
    obstacles = obstacles_from([SOLIDS[name]])
    for a, b in (([0.1, 0.05, -0.1], [0.1, 0.1, -0.12]), ([0.0, -0.15, 0.3], [0.05, -0.1, 0.3])):
        assert nearest_distance(obstacles, a, b, 0.035) == pytest.approx(-0.035, abs=2e-9)


def test_a_mesh_that_swallows_the_link_is_touched() -> None:
    vertices, faces = CUBE
    obstacles = obstacles_from([Mesh("mesh", vertices * 10, faces)])
    assert nearest_distance(obstacles, [0, 0, 0], [0.1, 0.1, 0.1], 0.035) == pytest.approx(-0.9 - 0.035)


@pytest.mark.slow
def test_a_mesh_of_many_triangles() -> None:
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(600, 3))
    vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    mesh = Mesh("ball", vertices, ConvexHull(vertices).simplices)
    obstacles = obstacles_from([mesh])
    for a, b in segments(40, seed=5):
        a, b = a + [0.9, 0.9, 0.0], b + [0.9, 0.9, 0.0]
        expected = axis_distance(mesh, a, b, 20)
        if expected > 0:
            assert nearest_distance(obstacles, a, b, 0.01) == pytest.approx(expected - 0.01, abs=1e-6)


def test_distances_of_boxes_are_lower_bounds() -> None:
    obstacles = obstacles_from(list(SOLIDS.values()))
    pairs = segments(60, seed=2)
    starts, ends = (np.array([p[k] for p in pairs]) + [0.5, 0, 0] for k in (0, 1))
    low, high = np.minimum(starts, ends)[:, None], np.maximum(starts, ends)[:, None]
    gaps = box_distances(obstacles, low, high) - 0.035
    assert gaps.shape == (60, len(obstacles.pieces))
    for n in range(60):
        for m, piece in enumerate(obstacles.pieces):
            true = segment_separation(piece, starts[n], ends[n]).distance - 0.035
            assert gaps[n, m] <= true + 1e-9
    assert (gaps > 0).any()


coordinate = st.integers(0, 12).map(lambda k: k * 0.05)


@settings(max_examples=examples(60))
@given(
    st.lists(st.tuples(coordinate, coordinate, coordinate, coordinate), min_size=1, max_size=8), st.booleans()
)
def test_convex_pieces_tile_the_polygon(rectangles: list[tuple[float, ...]], bite: bool) -> None:
    shape = shapely.union_all([box(x, y, x + w + 0.05, y + h + 0.05) for x, y, w, h in rectangles])
    if bite:
        shape = shape - Point(0.4, 0.4).buffer(0.13)
    for polygon in shapely.get_parts(shape):
        pieces = [Polygon(corners) for corners in convex_pieces(polygon)]
        assert all(
            piece.exterior.is_ccw and len(piece.exterior.coords) <= GEOMETRY.max_piece_corners + 1
            for piece in pieces
        )
        assert sum(piece.area for piece in pieces) == pytest.approx(polygon.area, abs=1e-10)
        assert shapely.union_all(pieces).symmetric_difference(polygon).area < 1e-10


def test_pieces_know_their_solid() -> None:
    obstacles: Obstacles = obstacles_from(list(SOLIDS.values()))
    assert sorted(set(obstacles.owner.tolist())) == list(range(len(SOLIDS)))
    for k, solid in enumerate(SOLIDS.values()):
        mine = obstacles.owner == k
        low, high = solid.z_range
        assert obstacles.low[mine, 2].min() == pytest.approx(low)
        assert obstacles.high[mine, 2].max() == pytest.approx(high)


def box_corners(size: Array, middle: Array, turn: Array) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, middle
    return LinkBox(0, "box", T, size).corners


def boxes(count: int, seed: int) -> list[Array]:
    """Boxes anywhere, and in degenerate places: level, upright, on the grid of lengths."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(count):
        turn = Rotation.random(random_state=seed * 1000 + k).as_matrix()
        if k % 3 == 0:
            turn = Rotation.from_euler("z", rng.choice([0.0, 0.7, np.pi / 2])).as_matrix()
        middle = rng.choice(NASTY, 3) if k % 2 else rng.uniform(-0.7, 0.7, 3)
        found.append(box_corners(rng.choice([0.01, 0.1, 0.2, 0.37], 3), middle, turn))
    return found


def within(corners: Array, count: int) -> Array:
    """Points all over a box, corners included."""
    t = np.linspace(0, 1, count)
    shares = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3)
    points: Array = corners[0] + shares @ (corners[[4, 2, 1]] - corners[0])
    return points


def least(solid: Box | Cylinder | Prism | Sphere, corners: Array) -> float:
    """Distance of a box from a convex solid, by searching both at once for the nearest pair of points."""

    def apart(x: Array) -> float:
        return float(((x[:3] - x[3:]) ** 2).sum())

    def slope(x: Array) -> Array:
        return 2 * np.concatenate([x[:3] - x[3:], x[3:] - x[:3]])

    def room(x: Array) -> Array:
        p, q = x[:3], x[3:]
        sides = corners[[4, 2, 1]] - corners[0]
        shares = (p - corners[0]) @ sides.T / (sides**2).sum(1)
        low, high = (0.0, 0.0) if isinstance(solid, Sphere) else solid.z_range
        match solid:
            case Sphere():
                own = [solid.radius**2 - ((q - solid.center) ** 2).sum()]
            case Cylinder():
                own = [solid.radius**2 - ((q - solid.center)[:2] ** 2).sum(), q[2] - low, high - q[2]]
            case _:
                shadow = solid.shadow(np.inf)
                assert shadow is not None
                outline = np.asarray(shapely.orient_polygons(shadow.core).exterior.coords)
                edges = np.diff(outline, axis=0)
                level = (
                    edges[:, 0] * (q[1] - outline[:-1, 1]) - edges[:, 1] * (q[0] - outline[:-1, 0])
                ).tolist()
                own = [*level, q[2] - low, high - q[2]]
        return np.concatenate([shares, 1 - shares, own])

    middle = solid.polygon.centroid.coords[0] if isinstance(solid, Prism) else solid.center[:2]
    start = np.concatenate([corners.mean(0), middle, [np.mean(solid.z_range)]])
    found = minimize(
        apart,
        start,
        jac=slope,
        method="SLSQP",
        constraints=[NonlinearConstraint(room, 0.0, np.inf)],
        options={"ftol": 1e-15, "maxiter": 300},
    )
    return float(np.sqrt(max(0.0, found.fun)))


@pytest.mark.parametrize("name", ["box", "turned box", "cylinder", "plate", "ball", "prism"])
def test_boxes_agree_with_a_search_for_the_nearest_points(name: str) -> None:
    solid = SOLIDS[name]
    assert isinstance(solid, Box | Cylinder | Prism | Sphere)
    piece = obstacles_from([solid]).pieces[0]
    seen = 0
    for corners in boxes(60, seed=len(name)):
        found = hull_separation(piece, corners)
        expected = least(solid, corners)
        if expected < 1e-3:  # the search is not good at depths and touches
            assert found.distance < 2e-3
            continue
        seen += 1
        assert found.distance == pytest.approx(expected, abs=2e-6)
        assert abs(solid.distance(found.on_axis - found.distance * found.normal)) < 1e-4
    assert seen > 20


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("least", [0.0, 0.05, 0.4])
def test_hulls_keep_apart_as_far_as_they_are(name: str, least: float) -> None:
    seen, clouds = set(), np.random.default_rng(6).normal(size=(40, 12, 3))
    for corners in [*boxes(60, seed=5), *clouds]:
        for piece in obstacles_from([SOLIDS[name]]).pieces:
            distance = hull_separation(piece, corners).distance
            if abs(distance - least) > 1e-6:
                seen.add(keeps_apart(piece, corners, least))
                assert keeps_apart(piece, corners, least) == (distance > least)
    assert seen == {True, False}


@pytest.mark.parametrize("name", SOLIDS)
def test_boxes_agree_with_their_points(name: str) -> None:
    solid = SOLIDS[name]
    pieces = obstacles_from([solid]).pieces
    for corners in boxes(25, seed=4):
        distance = min(hull_separation(piece, corners).distance for piece in pieces)
        sampled = min(solid.distance(p) for p in within(corners, 7))
        longest = float(np.linalg.norm(corners[7] - corners[0]))
        assert distance <= max(sampled, 0.0) + 1e-7
        assert distance >= sampled - longest / 12 - 1e-9 or distance <= 0
        if sampled < -1e-6:
            assert distance < 0


@pytest.mark.parametrize("name", ["box", "turned box", "prism", "cylinder", "ball"])
def test_the_way_out_frees_a_box_and_none_is_much_shorter(name: str) -> None:
    piece = obstacles_from([SOLIDS[name]]).pieces[0]
    ways = np.random.default_rng(3).normal(size=(20, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    seen = 0
    for corners in boxes(300, seed=9):
        found = hull_separation(piece, corners)
        if found.distance > -1e-6:
            continue
        seen += 1
        depth = -found.distance
        assert hull_separation(piece, corners + (depth + 1e-6) * found.normal).distance > 0
        for way in ways:
            assert hull_separation(piece, corners + 0.98 * depth * way).distance < 1e-9
    assert seen >= 8


@pytest.mark.parametrize("name", SOLIDS)
def test_what_swallows_the_other_overlaps(name: str) -> None:
    solid = SOLIDS[name]
    around = box_corners(
        np.full(3, 4.0), np.array([0.1, 0.2, 0.0]), Rotation.random(random_state=1).as_matrix()
    )
    for piece in obstacles_from([solid]).pieces:
        assert hull_separation(piece, around).distance < -0.5
    inside = solid.center if isinstance(solid, Box | Sphere | Cylinder) else np.zeros(3)
    if name == "ring":
        inside = np.array([0.3, 0.0, 0.05])
    crumb = box_corners(np.full(3, 1e-3), inside, Rotation.random(random_state=2).as_matrix())
    assert min(hull_separation(piece, crumb).distance for piece in obstacles_from([solid]).pieces) < 0


@pytest.mark.parametrize("name", ["box", "mesh"])
def test_a_box_that_lies_on_a_face_touches(name: str) -> None:
    piece = obstacles_from([SOLIDS[name]]).pieces[0]
    for size in ([0.02, 0.03, 0.04], [0.2, 0.4, 0.6], [1.0, 1.0, 1.0]):
        for axis in range(3):
            middle = np.zeros(3)
            middle[axis] = np.array([0.1, 0.2, 0.3])[axis] + size[axis] / 2
            found = hull_separation(piece, box_corners(np.array(size), middle, np.eye(3)))
            assert found.distance == pytest.approx(0.0, abs=3e-9)


def test_a_box_and_a_ball_in_closed_form() -> None:
    piece = obstacles_from([Sphere("ball", 0.2, np.array([1.0, 1.0, 0.0]))]).pieces[0]
    corners = box_corners(np.full(3, 1.0), np.zeros(3), np.eye(3))
    found = hull_separation(piece, corners)
    assert found.distance == pytest.approx(np.sqrt(0.5) - 0.2, abs=1e-9)
    np.testing.assert_allclose(found.normal, [-np.sqrt(0.5), -np.sqrt(0.5), 0], atol=1e-8)
    deep = hull_separation(piece, corners + [0.9, 1.0, 0.0])
    assert deep.distance == pytest.approx(-0.6, abs=1e-9)


def test_links_keep_away_from_links_either_way_round() -> None:
    rng = np.random.default_rng(6)
    for corners in boxes(60, seed=7):
        a, b = rng.uniform(-0.7, 0.7, (2, 3))
        rod = LinkCapsule(0, "rod", a, b, 0.05)
        turned = Rotation.random(random_state=8).as_matrix()
        sides = corners[[4, 2, 1]] - corners[0]
        size = np.linalg.norm(sides, axis=1)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = (sides / size[:, None]).T, corners.mean(0)
        one = hull_separation(link_piece(rod), corners).distance
        other = hull_separation(link_piece(LinkBox(0, "box", T, size)), rod.corners).distance - 0.05
        assert one == pytest.approx(other, abs=1e-8)
        T[:3] = turned @ T[:3]
        moved = (
            hull_separation(link_piece(LinkBox(0, "box", T, size)), rod.corners @ turned.T).distance - 0.05
        )
        assert moved == pytest.approx(one, abs=1e-8)


def test_two_capsules() -> None:
    piece = link_piece(LinkCapsule(0, "rod", np.array([0, 0, -1.0]), np.array([0, 0, 1.0]), 0.1))
    found = segment_separation(piece, np.array([0.5, -1, 0]), np.array([0.5, 1, 0]))
    assert found.distance == pytest.approx(0.4, abs=1e-9)
    np.testing.assert_allclose(found.on_axis, [0.5, 0, 0], atol=1e-9)
    np.testing.assert_allclose(found.normal, [1, 0, 0], atol=1e-9)
    assert segment_separation(piece, np.array([-1.0, 0, 0]), np.array([1.0, 0, 0])).distance == pytest.approx(
        -0.1
    )
    assert segment_separation(
        piece, np.array([0.3, 0, 5.0]), np.array([0.3, 0, 5.0])
    ).distance == pytest.approx(np.hypot(4.0, 0.3) - 0.1, abs=1e-9)


def test_boxes_that_are_not_finite_do_not_reach_the_engine() -> None:
    piece = obstacles_from([SOLIDS["mesh"]]).pieces[0]
    corners = box_corners(np.ones(3), np.zeros(3), np.eye(3))
    corners[3, 1] = np.nan
    with pytest.raises(InputError, match="finite"):
        hull_separation(piece, corners)
