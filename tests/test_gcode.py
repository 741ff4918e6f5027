"""Tool paths from G-code."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.readers.gcode_path import read_gcode
from tests import examples


def points_of(text: str, folder: Path, chord: float = 1e-4) -> Array:
    path = folder / "p.nc"
    path.write_text(text)
    return read_gcode(path, chord).points


def test_lines_units_and_modes(tmp_path: Path) -> None:
    text = """%
        O100 (pocket)
        N10 G21 G90 G54 G0 X10 Y20 Z5 ; over the part
        N20 G1 Z-1 F300 M3 S1000
        X20
        G91 Y5
        G4 P1
        /G1 X99
        G20 X1
        M30
        X1000
    """
    found = 1000 * points_of(text, tmp_path)
    wanted = np.array([[10, 20, 5], [10, 20, -1], [20, 20, -1], [20, 25, -1], [45.4, 25, -1]])
    assert np.allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("text", [
    "G1 X10 Y0\nG3 X0 Y10 I-10 J0", "G1 X10 Y0\nG3 X0 Y10 R10", "G1 X10 Y0\nG90.1 G3 X0 Y10 I0 J0",
    "G1 X10 Y0\nG91 G3 X-10 Y10 I-10", "G1 X0 Y10\nG2 X10 Y0 J-10",
])  # fmt: skip
def test_a_quarter_turn_in_all_its_forms(text: str, tmp_path: Path) -> None:
    """Its points lie on the circle about the origin, its chords within 10 micrometres of it."""
    found = 1000 * points_of(text, tmp_path, chord=1e-5)
    assert np.abs(np.linalg.norm(found, axis=1) - 10).max() < 1e-9
    middle = np.linalg.norm((found[1:] + found[:-1]) / 2, axis=1)
    assert 0.005 < (10 - middle).max() < 0.010001


@given(
    radius=st.floats(0.5, 200.0), start=st.floats(-3.0, 3.0), sweep=st.floats(0.1, 6.1),
    rise=st.floats(-5, 5), clockwise=st.booleans(), plane=st.sampled_from(["G17", "G18", "G19"]),
    by_radius=st.booleans(),
)  # fmt: skip
@settings(max_examples=examples(100))
def test_an_arc_goes_its_way_round(
    tmp_path_factory: pytest.TempPathFactory, radius: float, start: float, sweep: float, rise: float,
    clockwise: bool, plane: str, by_radius: bool,
) -> None:  # fmt: skip
    """Each chord turns the same way by the same angle, and all of them by the whole sweep; a helix climbs."""
    axes, offsets = {"G17": ("XYZ", "IJ"), "G18": ("ZXY", "KI"), "G19": ("YZX", "JK")}[plane]
    end = start + (-sweep if clockwise else sweep)
    here, there = ((radius * math.cos(a), radius * math.sin(a)) for a in (start, end))
    if by_radius:
        size = f"R{radius if sweep < math.pi else -radius:.12f}"
    else:
        size = f"{offsets[0]}{-here[0]:.12f} {offsets[1]}{-here[1]:.12f}"
    text = f"{plane} G1 {axes[0]}{here[0]:.12f} {axes[1]}{here[1]:.12f}\n"
    text += f"{'G2' if clockwise else 'G3'} {axes[0]}{there[0]:.12f} {axes[1]}{there[1]:.12f} "
    text += f"{axes[2]}{rise:.12f} {size}"
    found = 1000 * points_of(text, tmp_path_factory.mktemp("arc"), chord=1e-5)
    u, v, w = (found[:, "XYZ".index(axis)] for axis in axes)
    near = abs(sweep - math.pi) < 1e-3 and by_radius  # the centre of half a circle by its radius is not sharp
    assert np.abs(np.hypot(u, v) - radius).max() < (0.1 * radius if near else 1e-5)
    if not near:
        turns = np.diff(np.unwrap(np.arctan2(v, u)))
        assert turns.sum() == pytest.approx(end - start, abs=1e-6)
        assert np.ptp(turns) < 1e-6
        assert np.ptp(np.diff(w)) < 1e-6
    assert w[-1] == pytest.approx(rise, abs=1e-9)


def test_a_whole_turn_comes_back(tmp_path: Path) -> None:
    found = 1000 * points_of("G0 X10\nG2 I-10 Z3", tmp_path)
    assert np.abs(np.hypot(found[:, 0], found[:, 1]) - 10).max() < 1e-9
    assert np.allclose(found[-1], [10, 0, 3])
    assert len(found) > 15


@pytest.mark.parametrize(("text", "told"), [
    ("X1", "line 1: expected G0, G1, G2 or G3 before the first position"),
    ("G1 X1\n\nG1 X", "line 3: expected words of a letter and a number, as X1.5, got 'X'"),
    ("G1 X#5", "line 1: expected words of a letter and a number"),
    ("G1 X1\nG81 X1 Z-3", "line 2: G81 is not read, valid moves and settings: G0, G1, G2, G3, G17"),
    ("G1 A90", "line 1: axis A is not read, expected X, Y and Z alone"),
    ("G1 X1 X2", "line 1: X is given twice"),
    ("G2 X1 I1", "line 1: G2: expected a straight move before the first arc"),
    ("G1 X1\nG2 X5", "line 2: G2: expected R, or I and J"),
    ("G1 X1\nG2 X5 I1", "line 2: G2: expected ends equally far from the centre, got 1 and 3"),
    ("G1 X1\nG2 X1 R5", "line 2: G2: with R, expected an end elsewhere"),
    ("G1 X1\nG2 X11 R2", "line 2: G2: R: expected at least 5, half the distance of the ends"),
    ("G1 X1e3", "line 1: expected numbers without an exponent, as X1000"),
    ("G1 X9999999999", "line 1: X: expected a number of at most 1e+09 in size"),
    ("(nothing)\nM30", "expected at least one move, G0 to G3 with X, Y or Z"),
])  # fmt: skip
def test_lines_that_do_not_fit_are_told(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        points_of(text, tmp_path)
    assert told in str(caught.value)
