"""Tool paths: generators against their formulas, and CSV files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regionik.worlds.documents.world_file import load_world, world_from_document
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target
from tests.maths import Array, rot_x, rot_y, rot_z

coordinate = st.floats(-50, 50).map(lambda value: round(value, 6))
point = st.tuples(coordinate, coordinate, coordinate)
FLOOR = {"polygon": [[-99, -99], [99, -99], [99, 99], [-99, 99]]}


def targets(piece: dict[str, Any], **task: Any) -> tuple[Target, ...]:
    """What a world has of one piece of a task."""
    world = {"version": 1, "robot": "youbot", "floor": FLOOR, "task": [piece | task]}
    return world_from_document(world).task


def places(piece: dict[str, Any]) -> Array:
    return np.array([target.position for target in targets(piece)])


def line(start: Sequence[float], end: Sequence[float], count: int) -> dict[str, Any]:
    return {"line": {"from": list(start), "to": list(end), "count": count}}


def sine(start: list[float], end: list[float], count: int, **more: Any) -> dict[str, Any]:
    return {"sine": {"from": start, "to": end, "count": count} | more}


def arc(
    center: list[float], radius: float, start: float, end: float, count: int, **more: Any
) -> dict[str, Any]:
    return {"arc": {"center": center, "radius": radius, "from": start, "to": end, "count": count} | more}


@given(point, point, st.integers(2, 60))
def test_lines_begin_and_end_where_they_should_and_are_even(
    start: tuple[float, ...], end: tuple[float, ...], count: int
) -> None:
    if start == end:
        with pytest.raises(InputError, match="must differ"):
            places(line(start, end, count))
        return
    if np.linalg.norm(np.subtract(start, end)) < 1e-3:
        return  # neighbours would be one set-point
    points = places(line(start, end, count))
    assert points.shape == (count, 3)
    assert points[0].tolist() == list(start)
    assert points[-1].tolist() == list(end)
    np.testing.assert_allclose(np.diff(points, n=2, axis=0), 0, atol=1e-11)


def test_waves_go_to_the_left_first_or_along_an_axis_with_a_phase() -> None:
    points = places(sine([0, 0, 0.2], [0, 4, 0.2], 5, amplitude=0.3, periods=1))  # along y: left is -x
    np.testing.assert_allclose(points[:, 0], [0, -0.3, 0, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(points[:, 1], [0, 1, 2, 3, 4], atol=1e-12)
    more = {"amplitude": 0.5, "periods": 2, "phase": np.pi / 2, "axis": [0, 0, 7]}
    s = np.linspace(0, 1, 9)
    wave = np.column_stack([s, 0 * s, 0.5 * np.cos(4 * np.pi * s)])
    np.testing.assert_allclose(places(sine([0, 0, 0], [1, 0, 0], 9, **more)), wave, atol=1e-12)


@given(st.floats(0.01, 10), st.floats(-7, 7), st.floats(-7, 7), st.integers(2, 40))
def test_arcs_stay_on_their_circle(radius: float, start: float, end: float, count: int) -> None:
    if abs(end - start) < 0.01:
        return
    points = places(arc([1.0, 2.0, 0.3], radius, start, end, count))
    np.testing.assert_allclose(np.hypot(points[:, 0] - 1, points[:, 1] - 2), radius, atol=1e-11)
    ends = [[1 + radius * np.cos(angle), 2 + radius * np.sin(angle)] for angle in (start, end)]
    np.testing.assert_allclose(points[[0, -1], :2], ends, atol=1e-11)
    assert (points[:, 2] == 0.3).all()


@pytest.mark.parametrize(
    ("piece", "message"),
    [
        (line([0, 0, 0], [1, 0, 0], 1), "count"),
        (sine([0, 0, 0], [0, 0, 1], 5, amplitude=1, periods=1), "vertical"),
        (sine([0, 0, 0], [1, 0, 1], 5, amplitude=1, periods=1, axis=[0, 0, 0]), "axis"),
        (arc([0, 0, 0], 0, 0, 1, 5), "radius"),
        (arc([0, 0, 0], 1, 1, 1, 5), "differ"),
        (arc([0, 0, 0], 1, 0, 1, 1), "count"),
        (line([0, 0], [1, 0, 0], 3), "from"),
        ({"points": [[0, 0, 0]], "orientation": [0, 0, 0, 0], "cone": 0.1}, "unit quaternion"),
    ],
)
def test_pieces_that_make_no_path_are_refused(piece: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        targets(piece)


@given(st.floats(-3, 3), st.sampled_from([(0, rot_x), (1, rot_y), (2, rot_z)]))
def test_quaternions_turn_as_their_axes_do(angle: float, about: tuple[int, Callable[[float], Array]]) -> None:
    quaternion = [*(np.sin(angle / 2) * np.eye(3)[about[0]]).tolist(), float(np.cos(angle / 2))]
    (target,) = targets({"points": [[0, 0, 0]]}, orientation=quaternion, cone=0.1)
    assert target.orientation is not None
    np.testing.assert_allclose(target.orientation, about[1](angle)[:3, :3], atol=1e-12)


def read(folder: Path, text: str) -> tuple[Target, ...]:
    """What a world has of a table."""
    (folder / "path.csv").write_text(text)
    world = {"version": 1, "robot": "youbot", "floor": FLOOR, "task": [{"csv": "path.csv"}]}
    (folder / "w.json").write_text(json.dumps(world))
    return load_world(folder / "w.json").task


def test_csv_of_points_directions_and_orientations(tmp_path: Path) -> None:
    found = read(tmp_path, "# a comment\nx, y, z\n\n1,2,3\n4, 5e-1 ,6\n")
    assert [target.position.tolist() for target in found] == [[1, 2, 3], [4, 0.5, 6]]
    (aimed,) = read(tmp_path, "1,2,3,0,0,2\r\n")
    assert aimed.direction is not None
    assert aimed.direction.tolist() == [0, 0, 1]
    (turned,) = read(tmp_path, "x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1")
    assert turned.orientation is not None
    assert np.array_equal(turned.orientation, np.eye(3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "at least one line"),
        ("x,y,z\n", "at least one line"),
        ("1,2,3\n1,2\n", "line 2: z: expected a finite number, got ''"),
        ("x,y,z,qw,qx,qy\n1,2,3,1,0,0\n", "line 1: expected titles for x,y,z, .*: qz missing, titles: "),
        ("1,2,3\n\n1,2,3,0,0,1\n", "line 3: expected 3 columns as in line 1, got 6"),
        ("1,2,3\n1,two,3\n", "line 2: y: expected a finite number, got 'two'"),
        ("1,2,nan\n", "line 1: z: expected a finite number"),
        ("1,2,3\nx,y,z\n", "line 2: x"),
        ("1,2,3,0,0,0\n", "line 1: dx,dy,dz must not be zero"),
        ("1,2,3,0,0,0,1\n1,2,3,1,1,0,0\n", "line 2: qx,qy,qz,qw: expected a unit quaternion"),
        ("1,5;2,5;3,5\n", "line 1: expected x,y,z or .* got 4 columns"),
    ],
)
def test_bad_rows_are_named_by_their_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, text)
    assert str(tmp_path / "path.csv") in str(caught.value)


def test_an_arc_climbs_evenly() -> None:
    points = places(arc([1.0, 2.0, 0.3], 0.5, 0.0, 1.0, 5, rise=0.2))
    np.testing.assert_allclose(points[:, 2], [0.3, 0.35, 0.4, 0.45, 0.5], atol=1e-12)
    assert np.array_equal(points[:, :2], places(arc([1.0, 2.0, 0.3], 0.5, 0.0, 1.0, 5))[:, :2])


@given(st.floats(-7, 7), st.floats(-7, 7), st.integers(2, 9))
def test_a_tool_that_follows_its_arc_looks_alike_from_its_centre(
    start: float, end: float, count: int
) -> None:
    if abs(end - start) < 0.01:
        return
    piece = arc([0, 0, 0.2], 1.0, start, end, count) | {"follow": True, "cone": 0.1}
    for target in targets(piece, direction=[-1.0, 0, 0]):
        assert target.direction is not None
        np.testing.assert_allclose(target.direction, np.array([0, 0, 0.2]) - target.position, atol=1e-11)
    turn = rot_z(0.3)[:3, :3] @ rot_x(1.0)[:3, :3]
    found = targets(piece, orientation=Rotation.from_matrix(turn).as_quat().tolist())
    for angle, target in zip(np.linspace(start, end, count), found, strict=True):
        assert target.orientation is not None
        np.testing.assert_allclose(target.orientation, rot_z(angle)[:3, :3] @ turn, atol=1e-9)
