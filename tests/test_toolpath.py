"""Tool paths: generators against their formulas, and CSV files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regionik.worlds.errors import InputError
from regionik.worlds.readers.csv_path import read_csv
from regionik.worlds.toolpath import (
    ToolPath,
    arc,
    line,
    rotation_from_quaternion,
    sine,
    targets_along,
    transform_path,
    turn_with_arc,
)
from tests.maths import planar_pose, rot_x, rot_y, rot_z

coordinate = st.floats(-50, 50).map(lambda value: round(value, 6))
point = st.tuples(coordinate, coordinate, coordinate)


@given(point, point, st.integers(2, 60))
def test_lines_begin_and_end_where_they_should_and_are_even(
    start: tuple[float, ...], end: tuple[float, ...], count: int
) -> None:
    if start == end:
        with pytest.raises(InputError, match="must differ"):
            line(start, end, count)
        return
    points = line(start, end, count)
    assert points.shape == (count, 3)
    assert points[0].tolist() == list(start)
    assert points[-1].tolist() == list(end)
    np.testing.assert_allclose(np.diff(points, n=2, axis=0), 0, atol=1e-11)


def test_a_wave_goes_to_the_left_first() -> None:
    points = sine([0, 0, 0.2], [0, 4, 0.2], 0.3, 1, 5)  # along y: left is -x
    np.testing.assert_allclose(points[:, 0], [0, -0.3, 0, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(points[:, 1], [0, 1, 2, 3, 4], atol=1e-12)


def test_a_wave_along_an_axis_with_a_phase() -> None:
    points = sine([0, 0, 0], [1, 0, 0], 0.5, 2, 9, phase=np.pi / 2, axis=[0, 0, 7])
    s = np.linspace(0, 1, 9)
    np.testing.assert_allclose(points, np.column_stack([s, 0 * s, 0.5 * np.cos(4 * np.pi * s)]), atol=1e-12)


@given(st.floats(0.01, 10), st.floats(-7, 7), st.floats(-7, 7), st.integers(2, 40))
def test_arcs_stay_on_their_circle(radius: float, start: float, end: float, count: int) -> None:
    if start == end:
        return
    points = arc([1.0, 2.0, 0.3], radius, start, end, count)
    np.testing.assert_allclose(np.hypot(points[:, 0] - 1, points[:, 1] - 2), radius, atol=1e-11)
    np.testing.assert_allclose(
        points[0, :2], [1 + radius * np.cos(start), 2 + radius * np.sin(start)], atol=1e-11
    )
    np.testing.assert_allclose(
        points[-1, :2], [1 + radius * np.cos(end), 2 + radius * np.sin(end)], atol=1e-11
    )
    assert (points[:, 2] == 0.3).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line([0, 0, 0], [1, 0, 0], 1), "count"),
        (lambda: sine([0, 0, 0], [0, 0, 1], 1, 1, 5), "vertical"),
        (lambda: sine([0, 0, 0], [1, 0, 1], 1, 1, 5, axis=[0, 0, 0]), "axis"),
        (lambda: arc([0, 0, 0], 0, 0, 1, 5), "radius"),
        (lambda: arc([0, 0, 0], 1, 1, 1, 5), "differ"),
        (lambda: arc([0, 0, 0], 1, 0, 1, 1), "count"),
        (lambda: line([0, 0], [1, 0, 0], 3), "from"),
        (lambda: rotation_from_quaternion([0, 0, 0, 0]), "unit quaternion"),
    ],
)
def test_generators_refuse_what_makes_no_path(make: object, message: str) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=message):
        make()


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_quaternions_turn_as_their_axes_do(a: float, b: float, c: float) -> None:
    quarter = [
        rotation_from_quaternion([np.sin(a / 2), 0, 0, np.cos(a / 2)]),
        rotation_from_quaternion([0, np.sin(b / 2), 0, np.cos(b / 2)]),
        rotation_from_quaternion([0, 0, np.sin(c / 2), np.cos(c / 2)]),
    ]
    for R, expected in zip(quarter, (rot_x(a), rot_y(b), rot_z(c)), strict=True):
        np.testing.assert_allclose(R, expected[:3, :3], atol=1e-12)


def test_csv_of_points_directions_and_orientations(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("# a comment\nx, y, z\n\n1,2,3\n4, 5e-1 ,6\n")
    assert read_csv(path).points.tolist() == [[1, 2, 3], [4, 0.5, 6]]
    path.write_text("1,2,3,0,0,2\r\n")
    assert read_csv(path).directions.tolist() == [[0, 0, 2]]  # type: ignore[union-attr]
    path.write_text("x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1")
    assert np.array_equal(read_csv(path).orientations, [np.eye(3)])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "at least one line"),
        ("x,y,z\n", "at least one line"),
        ("1,2,3\n1,2\n", "line 2: expected x,y,z or .*got 2 columns"),
        ("x,y,z,qw,qx,qy,qz\n1,2,3,1,0,0,0\n", "line 1: expected the columns .* in this order, got x,y,z,qw"),
        ("1,2,3\n\n1,2,3,0,0,1\n", "line 3: expected 3 columns as in line 1, got 6"),
        ("1,2,3\n1,two,3\n", "line 2: y: expected a finite number, got 'two'"),
        ("1,2,nan\n", "line 1: z: expected a finite number"),
        ("1,2,3\nx,y,z\n", "line 2: x"),
        ("1,2,3,0,0,0\n", "line 1: dx,dy,dz must not be zero"),
        ("1,2,3,0,0,0,1\n1,2,3,1,1,0,0\n", "line 2: qx,qy,qz,qw: expected a unit quaternion"),
        ("1;2;3\n", "line 1: expected x,y,z"),
    ],
)
def test_bad_rows_are_named_by_their_line(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_csv(path)
    assert str(caught.value).startswith(str(path))


def test_an_arc_climbs_evenly() -> None:
    points = arc([1.0, 2.0, 0.3], 0.5, 0.0, 1.0, 5, rise=0.2)
    np.testing.assert_allclose(points[:, 2], [0.3, 0.35, 0.4, 0.45, 0.5], atol=1e-12)
    assert np.array_equal(points[:, :2], arc([1.0, 2.0, 0.3], 0.5, 0.0, 1.0, 5)[:, :2])


@given(st.floats(-7, 7), st.floats(-7, 7), st.integers(2, 9))
def test_a_tool_that_follows_its_arc_looks_alike_from_its_centre(
    start: float, end: float, count: int
) -> None:
    if start == end:
        return
    points = arc([0, 0, 0.2], 1.0, start, end, count)
    aimed = turn_with_arc(ToolPath(points, directions=np.tile([-1.0, 0, 0], (count, 1))), start, end)
    assert aimed.directions is not None
    np.testing.assert_allclose(aimed.directions, np.array([0, 0, 0.2]) - points, atol=1e-11)
    R = rot_z(0.3)[:3, :3] @ rot_x(1.0)[:3, :3]
    turned = turn_with_arc(ToolPath(points, orientations=np.tile(R, (count, 1, 1))), start, end)
    assert turned.orientations is not None
    for angle, found in zip(np.linspace(start, end, count), turned.orientations, strict=True):
        np.testing.assert_allclose(found, rot_z(angle)[:3, :3] @ R, atol=1e-11)


def test_a_path_is_scaled_then_placed() -> None:
    path = ToolPath(np.array([[1000.0, 0, 500]]), np.array([[1.0, 0, 0]]), None)
    there = transform_path(replace(path, points=0.001 * path.points), planar_pose(1.0, 2.0, np.pi / 2, 0.1))
    np.testing.assert_allclose(there.points, [[1, 3, 0.6]], atol=1e-12)
    np.testing.assert_allclose(there.directions, [[0, 1, 0]], atol=1e-12)  # type: ignore[arg-type]


def test_targets_carry_what_the_path_says() -> None:
    R = planar_pose(0, 0, 0.3)[:3, :3]
    free, aimed, turned = (
        targets_along(path, 0.2)[0]
        for path in (
            ToolPath(np.zeros((1, 3))),
            ToolPath(np.zeros((1, 3)), directions=np.array([[0, 3.0, 4.0]])),
            ToolPath(np.zeros((1, 3)), orientations=R[None]),
        )
    )
    assert free.direction is None
    assert aimed.direction is not None
    np.testing.assert_allclose(aimed.direction, [0, 0.6, 0.8])
    assert turned.orientation is not None
    assert np.array_equal(turned.orientation, R)
