"""Tool paths from G-code."""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import regionik as rik
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.gcode import read_gcode
from tests import examples
from tests.maths import Array
from tests.sliced import HEADERS, sliced


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
    text = f"{plane} G1 {axes[0]}{here[0]:.12f} {axes[1]}{here[1]:.12f} {axes[2]}0\n"
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
    found = 1000 * points_of("G0 X10 Z0\nG2 I-10 Z3", tmp_path)
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
    ("G1 X-.5e-05", "line 1: expected numbers without an exponent"),
    ("g1 x1e-05", "line 1: expected numbers without an exponent"),
    ("G1 X1\nM98 P7 L3", "line 2: M98: calls and jumps are not followed, expected one program"),
    ("G1 X1\nG65 P9010 X5", "line 2: G65: calls and jumps are not followed"),
    ("G1 X1\nM99 P20", "line 2: M99: calls and jumps are not followed"),
    ("O7\nG1 X1\nM99\nO8\nG1 X2\nM30", "line 3: M99: expected the end of the file, or M30"),
    ("o100 call [5]", "line 1: subprograms, loops and conditions are not followed"),
    ("G1 X1\nM206 X5", "line 2: M206 may shift or scale what the program's axes mean"),
    ("G1 X1\nG92 X0", "line 2: G92 may shift"),
    ("G1 X1\nG92", "line 2: G92 may shift"),
    ("G1 X1\nG10 L2 P1 X5", "line 2: G10 may shift"),
    ("G1 X1\nG4 X5 G1", "line 2: G4: expected a block of its own"),
    ("G0 X1 G1", "line 1: expected one of G0, G1 in a block"),
    ("G1 X1\nG1 X5 R2", "line 2: R is not read in G1"),
    ("G1 X1\nG1 X5 L4", "line 2: L is not read in G1"),
    ("G1 X1\nG2 X1 I5 Z-8 K2", "line 2: K is not read in G2"),
    ("G1 X1\nG2 X3 R1 I1", "line 2: G2: expected R, or I and J, not both"),
    ("G1 X1\nG2 X1 I5 P1.5", "line 2: P: expected a whole number of turns from 1, got 1.5"),
    ("G1 X1\nG2 X1 I5 P2 M62", "line 2: P: expected G2 without M62"),
    ("G1 X1\nG1 G53 Z0", "line 2: G53: expected G0"),
    ("G1 X0 Z1\nG28 G91 Z0\nG90\nG1 X5", "line 4: Z is not known after G28 in line 2, expected it before G1"),
    ("", "expected at least one move, G0 to G3"),
    ("G28 Z0\nG0 X5", "Z is not known after G28 in line 1, expected it before G0"),
    ("(nothing)\nM30", "expected at least one move, G0 to G3 with X, Y or Z"),
])  # fmt: skip
def test_lines_that_do_not_fit_are_told(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        points_of(text, tmp_path)
    assert told in str(caught.value)


@pytest.mark.parametrize(("block", "named"), [
    ("G4 X1.5", ""), ("G04 U2", ""), ("G4 X200", ""), ("N9 G4 P500", ""), ("M5 M9", ""), ("T3 M6", ""),
    ("M205 X8 Y8", "M205"), ("M201 X500 Y500 Z100 E5000", "M201"), ("M600 X10 Y10 Z5", "M600"),
    ("M84 X Y E", "M84"), ("G43 H3", "G43"), ("G92 E0", "G92"), ("G69", "G69"), ("M117 Layer 2 of 9", "M117"),
    ("G5.1 Q1", "G5.1"), ("G10", "G10"), ("M104 S210", "M104"), ("M150 R9 U2 B9", "M150"),
    ("M115 U3.11.0", "M115"), ("M777 X5 Y9", "M777"), ("M3 S9", ""),
    ("M862.3 P \"MK3S\"", "M862.3"), ("M555 X80 Y80 W100 H100", "M555"),
    ("/G1 X99", "blocks that begin with /"),
    ("G28 X Y", "G28"), ("G91 G28 U0 W0\nG90", "G28"), ("G0 G53 X0 Y0", "G53"),
])  # fmt: skip
def test_words_of_blocks_that_are_no_move_leave_the_path_as_it_is(
    block: str, named: str, tmp_path: Path
) -> None:
    """Times, speeds, homes and places to park are not positions; what is not plain is named once."""
    program = "G21 G90\nG0 X20 Y0 Z5\n{0}\nG0 X40 Y5 Z5\n{0}\n"
    plain = points_of(program.format(""), tmp_path)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = points_of(program.format(block), tmp_path)
    assert np.array_equal(found, plain)
    assert [
        f"passed over, each from this line on: {named} (line 3)" in str(note.message) for note in told
    ] == ([True] if named else [])


def test_filament_needs_no_blank(tmp_path: Path) -> None:
    found = 1000 * points_of("G1X0Y0\nG1X10Y0E0.5\ng1x20e2\nG1 X30 E2.8", tmp_path)
    assert np.allclose(found[:, 0], [0, 10, 20, 30])


def test_the_way_home_and_back_is_left_out(tmp_path: Path) -> None:
    """The tool rises where it was to the height at which the program goes on."""
    text = "G0 X10 Y0 Z5\nG1 Z-2\nG91 G28 Z0\nG90\nT2 M6\nG0 X50 Y20\nG43 H2 Z8\nG1 Z-2"
    with pytest.warns(FileNote, match=r"G28 \(line 3\), G43 \(line 7\)"):
        found = 1000 * points_of(text, tmp_path)
    wanted = [[10, 0, 5], [10, 0, -2], [10, 0, 8], [50, 20, 8], [50, 20, -2]]
    assert np.allclose(found, wanted)


@pytest.mark.parametrize(("text", "first"), [
    ("G28 G91 Z0\nG90\nG0 X10 Y5\nG43 Z15 H1\nG1 Z-2", [10, 5, 15]),
    ("G28\nG1 Z15\nG0 X10 Y5 Z1", [10, 5, 1]),
    ("G0 G53 Z0\nG0 X10 Y5\nZ2", [10, 5, 2]),
])  # fmt: skip
def test_a_path_begins_where_it_is_known_after_the_way_home(
    text: str, first: list[float], tmp_path: Path
) -> None:
    with pytest.warns(FileNote):
        assert np.allclose(1000 * points_of(text, tmp_path)[0], first)


def test_a_program_that_returns_ends(tmp_path: Path) -> None:
    with pytest.warns(FileNote, match="M99"):
        assert len(points_of("O7\nG0 X1\nG1 X2\nM99\n; end\n(of it)\n%", tmp_path)) == 2


@pytest.mark.parametrize(("text", "turns", "radius", "rise"), [
    ("G0 X0 Y80 Z150\nG2 X0 Y80 Z90 J-80 P4", 4.0, 80.0, -60.0),
    ("G0 X60\nG3 X-60 I-60 P2", 1.5, 60.0, 0.0),
    ("G0 X10 Y0\nG2 X0 Y-10 R10 P3", 2.25, 10.0, 0.0),
    ("G18 G0 X10 Y0\nG2 I-10 Y4 P2", 2.0, 10.0, 4.0),
])  # fmt: skip
def test_arcs_of_several_turns(text: str, turns: float, radius: float, rise: float, tmp_path: Path) -> None:
    found = 1000 * points_of(text, tmp_path, chord=1e-6)
    steps = np.diff(found, axis=0)
    wanted = math.hypot(2 * math.pi * turns * radius, rise)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(wanted, rel=1e-4)


@given(
    steps=st.lists(st.tuples(st.integers(-400, 400), st.integers(-400, 400)), min_size=1, max_size=4),
    center=st.tuples(st.integers(-300, 300), st.integers(20, 300)), unit=st.sampled_from(["G20", "G21"]),
    plane=st.sampled_from(["G17", "G18", "G19"]), clockwise=st.booleans(),
)  # fmt: skip
@settings(max_examples=examples(100))
def test_a_full_circle_is_not_lost_by_rounding(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[int, int]], center: tuple[int, int],
    unit: str, plane: str, clockwise: bool,
) -> None:  # fmt: skip
    """Its start comes from relative steps of tenths, whose sum in binary is off by a last digit."""
    u, v, i, j = {"G17": tuple("XYIJ"), "G18": tuple("ZXKI"), "G19": tuple("YZJK")}[plane]
    text = f"{unit} {plane} G91\nG1 {u}0 {v}0\n"
    text += "".join(f"{u}{a / 10} {v}{b / 10}\n" for a, b in steps)
    end = [sum(step[k] for step in steps) / 10 for k in (0, 1)]
    arc = f"{'G2' if clockwise else 'G3'} {u}{end[0]} {v}{end[1]} {i}{center[0] / 10} {j}{center[1] / 10}"
    found = points_of(f"{text}G90\n{arc}", tmp_path_factory.mktemp("circle"))
    scale = {"G20": 25.4, "G21": 1.0}[unit] / 10
    lines = sum(math.hypot(*step) for step in steps) * scale
    length = 1000 * np.linalg.norm(np.diff(found, axis=0), axis=1).sum()
    assert length - lines == pytest.approx(2 * math.pi * math.hypot(*center) * scale, rel=0.06)


PRINT = """; generated by PrusaSlicer 2.7.4+linux-x64
M73 P0 R95
M201 X1000 Y1000 Z100 E5000 ; sets maximum accelerations
M205 X8.00 Y8.00 Z0.40 E4.50
G21 ; set units to millimeters
G90
M83 ; use relative distances for extrusion
;LAYER_CHANGE
G92 E0
G1 E-2.00000 F2400.00000
G1 X150 Y0 Z10.000 F9000.000
G1 E2.00000 F2400.00000
;TYPE:Perimeter
G1 F3000.000
G1 X600.000 Y0.000 E22.50000
G3 X700.000 Y100.000 I0.000 J100.000 E7.85400
G1 X700.000 Y300.000 E10.00000
G1 E-2.00000 F2400.00000
;LAYER_CHANGE
G92 E0
G1 Z20.000 F9000.000
G1 E2.00000 F2400.00000
G1 X700.000 Y100.000 E10.00000
G2 X600.000 Y0.000 I-100.000 J0.000 E7.85400
G1 X150.000 Y0.000 E22.50000
G1 E-2.00000 F2400.00000
M107
M84
"""


def test_a_print_of_two_layers_is_read_planned_and_timed(tmp_path: Path) -> None:
    """Retractions, feeds and accelerations are no points; layers follow one another without a lift-off."""
    (tmp_path / "wall.gcode").write_text(PRINT)
    path = tmp_path / "print.world.yaml"
    path.write_text("""version: 1
robot: youbot
floor: {polygon: [[-1, -1], [2, -1], [2, 1.5], [-1, 1.5]]}
frames: {plate: {position: [0, 0, 0.1]}}
task: [{gcode: wall.gcode, frame: plate, direction: [0, 0, -1], cone: 0.1, chord: 0.002}]
rules: {clearance: 0.05, tool_contact: 0.1, contact_depth: 0.035}
speeds: {base_velocity: 0.3, tool_velocity: 0.05}
""")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FileNote)
        world = rik.load_world(path)
    points = np.array([target.position for target in world.task])
    layer = 0.45 + 0.1 * np.pi / 2 + 0.2
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(2 * layer + 0.01, abs=3e-3)
    np.testing.assert_allclose(points[[0, -1]], [[0.15, 0, 0.11], [0.15, 0, 0.12]], atol=1e-9)
    made = rik.plan(world)
    assert made.lift_offs == 0
    assert rik.verify(made).ok
    assert made.motion.time[-1] >= 2 * layer / 0.05


@pytest.mark.parametrize("kind", HEADERS)
def test_what_slicers_write_is_read_as_beads(kind: str, tmp_path: Path) -> None:
    """Of three layers of two walls, no point comes from a header or a footer, and each wall is a stroke."""
    path = tmp_path / "ring.gcode"
    path.write_text(sliced(kind, layers=3, moves=12))
    with pytest.warns(FileNote) as notes:
        found = read_gcode(path, 1e-4)
    told = "\n".join(str(note.message) for note in notes)
    assert "passed over" in told
    assert found.strokes is not None
    assert found.strokes.tolist() == [k for k in range(1, 7) for _ in range(13)]
    radius = 1000 * np.linalg.norm(found.points[:, :2] - 0.2, axis=1)
    assert np.allclose(radius.reshape(3, 2, 13), [[[100.0], [90.0]]], atol=1e-2)
    assert np.allclose(found.points[:, 2].reshape(3, 26), [[0.0002], [0.0004], [0.0006]])


def test_fifty_thousand_moves_are_read(tmp_path: Path) -> None:
    path = tmp_path / "ring.gcode"
    path.write_text(sliced("marlin", layers=30, moves=834))
    with pytest.warns(FileNote):
        found = read_gcode(path, 1e-4)
    assert len(found.points) == 60 * 835
    assert found.strokes is not None
    assert found.strokes[-1] == 60


@pytest.mark.parametrize("seed", range(examples(100)))
def test_no_motion_comes_out_of_a_header(seed: int, tmp_path: Path) -> None:
    """Lines of all headers, shuffled, some twice, with other numbers: the path is as without them."""
    rng = np.random.default_rng(seed)
    kind = ("marlin", "klipper")[seed % 2]
    kept = {"G21", "G90", "M83", "M82 ;absolute"}
    lines = [line for header in HEADERS.values() for line in header.splitlines() if line not in kept]
    lines = [lines[k] for k in rng.integers(len(lines), size=30)]
    changed = [
        re.sub(r"(?<= [XYZESPR])-?\d+(\.\d+)?", lambda _: f"{rng.uniform(0, 900):.2f}", line)
        if line.startswith("M")
        else line
        for line in lines
    ]
    changed += [f"M{rng.integers(100, 999)} X{rng.integers(99)} Y{rng.integers(99)} Z3 E5"] * (seed % 3 == 0)
    changed = [
        line for line in changed if not re.match(r"M(206|290|428|556|579|605|665|666|852|198|8[01]\d) ", line)
    ]
    program = sliced(kind, layers=1, moves=8)
    path = tmp_path / "ring.gcode"
    path.write_text("\n".join(changed) + "\n" + program)
    with pytest.warns(FileNote):
        found = read_gcode(path, 1e-4)
    path.write_text(program)
    with pytest.warns(FileNote):
        assert np.array_equal(found.points, read_gcode(path, 1e-4).points)


def strokes_of(text: str, folder: Path) -> list[int]:
    path = folder / "p.nc"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FileNote)
        found = read_gcode(path, 1e-4).strokes
    assert found is not None
    return found.tolist()


@pytest.mark.parametrize(("text", "strokes"), [
    ("G0 X0 Y0 Z5\nG1 Z0\nX9\nG0 Z5\nX20\nG1 Z0\nG0 Z5", [1, 1, 1, 0, 2, 2, 0]),
    ("M82\nG1 X0 Y0 Z1\nG1 X1 E1\nG1 X2 E1\nG1 X3 E2", [1, 1, 2, 2]),
    ("M82\nG1 X0 Y0 Z1\nG1 X1 E1\nG92 E0\nG1 X2 E1", [1, 1, 1]),
    ("M82\nG1 X0 Y0 Z1\nG1 X1 E1\nG1 E-1\nG1 E1\nG1 X2 E2", [1, 1, 1]),
    ("M83\nG1 X0 Y0 Z1\nG1 X1 E1\nG1 E-1\nG1 Z2\nX5\nZ1\nG1 E1\nG1 X6 E1\nG1 X7", [1, 1, 0, 0, 2, 2]),
    ("M83\nG1 X0 Y0 Z1\nG1 X1 E1\nG1 X2 E-1\nG1 X3 E1", [1, 1, 2, 2]),
    ("M83\nG1 X0 Y0 Z1\nG3 X2 Y0 R1\nG0 X3 E1", [1, 1]),
])  # fmt: skip
def test_moves_are_work_or_travel(text: str, strokes: list[int], tmp_path: Path) -> None:
    """E decides where there is any: it grows on beads, by G0 too; else all moves are work but G0."""
    assert strokes_of(text, tmp_path) == strokes


def test_all_lines_that_are_refused_are_told_at_once(tmp_path: Path) -> None:
    text = "G68 R45\nG1 X1 Y0 Z0\nG5 X3 Y4 I1 J1\nG2 X9 Y9 I1\nSET_GCODE_OFFSET X=4\nG68 R9\nG1 X0 Y0\nG2 X5"
    with pytest.raises(InputError) as caught:
        points_of(text, tmp_path)
    told = str(caught.value)
    assert "lines 1, 6: G68 is not read" in told
    assert "; line 3: G5 is not read" in told
    assert "line 5: SET_GCODE_OFFSET may move the tool or shift its axes" in told
    assert "line 8: G2: expected R, or I and J" in told
    assert "line 4" not in told  # it begins where a refused line ends


# What becomes of words in files for Marlin, Klipper and RepRapFirmware; docs/howto/print.md tells it.
READ = (
    "G0 X9", "G1 X9", "G2 X9 R9", "G3 X9 R9", "G17", "G18", "G19", "G20", "G21", "G90", "G91", "M82", "M83",
    "G92 E0",
)  # fmt: skip
PASSED = (
    "G4 P9", "G10", "G11", "G12", "G26", "G27", "G28 X", "G29 P1 X5 Y5", "G30", "G32", "G80", "M73 P9",
    "M0 Remove it", "M104 S9", "M117 G1 X9", "M203 X9 Y9", "M204 P9", "M205 X9", "M220 S9", "M486 AName",
    "M600 X9", "M900 K9", "M1002 judge flag", "T1", "Tx", "N4 M105*71", "START_PRINT BED_TEMP=60",
    "SET_VELOCITY_LIMIT ACCEL=9", "EXCLUDE_OBJECT_START NAME=a", "PAUSE", "G10 P0 S215 R180", "M584 X0 Y1",
    "M563 P0 D0", "/G1 X9",
)  # fmt: skip
REFUSED = (
    "G5 X9 Y9 I1 J1 P1 Q1", "G68 R45", "G92 X0", "G10 P0 X9", "G42 X9", "G81 X9 Z1", "M98 P1", "M206 X9",
    "M290 Z1", "M808 L3", "SET_GCODE_OFFSET Z=1", "RESTORE_GCODE_STATE NAME=a", "FORCE_MOVE DISTANCE=9",
    "G28 G92 E0", "if true", "while true", "G1 X{var.x}", "G1 A9", "O100 call",
)  # fmt: skip
FRAME = "M83\nG1 X0 Y0 Z1\nG1 X5 E1\n{0}\nG90\nG21\nG17\nM83\nG1 X5 Y0 Z1\nG1 X7 E1\n"


@pytest.mark.parametrize("line", PASSED)
def test_words_that_are_passed_over(line: str, tmp_path: Path) -> None:
    path = tmp_path / "p.nc"
    path.write_text(FRAME.format(line))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FileNote)
        found = 1000 * read_gcode(path, 1e-4).points
    assert np.allclose(found, [[0, 0, 1], [5, 0, 1], [7, 0, 1]])


@pytest.mark.parametrize("line", REFUSED)
def test_words_that_are_refused(line: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 4: "):
        points_of(FRAME.format(line), tmp_path)


@pytest.mark.parametrize("line", READ)
def test_words_that_are_read(line: str, tmp_path: Path) -> None:
    """A move there and back is travel, as E does not grow on it."""
    moves = line[:2] in {"G0", "G1", "G2", "G3"} and "X" in line
    assert strokes_of(FRAME.format(line), tmp_path) == ([1, 1, 0, 2, 2] if moves else [1, 1, 1])
