"""Tool paths from G-code (RS-274, ISO 6983): straight and circular moves, as points in metres.

Rapid and cutting moves (G0, G1) are straight lines, arcs (G2, G3) are cut into chords in the plane of G17,
G18 or G19, with R or with I, J, K, and with P for the number of turns, the last of which may be part of one,
as LinuxCNC has it; units (G20, G21), absolute and relative positions (G90, G91) and centres (G90.1, G91.1)
are heeded, and what says how fast or with which tool is passed over: the tool's speed is that of the world.
M2 and M30 end a program. Ways to places of the machine (G28, G30, G53) are left out: the tool rises to the
higher of the heights before and after, and goes on from there. What else does not change the path is named in
a note. Variables, turning axes, cycles, subprograms and other work offsets than the first are refused.
"""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.text import MAX_NUMBER, clip, join_names, read_text
from regionik.worlds.toolpath import ToolPath

INCH, MILLIMETRE = 0.0254, 0.001  # [m]
MOVES, ARCS = ("G0", "G1", "G2", "G3"), ("G2", "G3")
PLANES = {"G17": ("X", "Y", "Z"), "G18": ("Z", "X", "Y"), "G19": ("Y", "Z", "X")}  # of arcs, the last across
UNITS = {"G20": INCH, "G21": MILLIMETRE}
POSITIONS, CENTRES = ("G90", "G91"), ("G90.1", "G91.1")
MODES = frozenset({*MOVES, *PLANES, *UNITS, *POSITIONS, *CENTRES})
AWAY = ("G28", "G30", "G53")  # moves to places of the machine, which the program's frame does not know
ENDS = ("M2", "M30", "M99")
BLOCK_DELETE = "blocks that begin with /"

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))?")
# C and Python write small numbers as 1e-05; the filament of a program without blanks is X10E0.5.
_EXPONENT = re.compile(r"[\d.]E[-+]0\d", re.IGNORECASE)
_SMALL_EXPONENT = re.compile(r"[\d.]e[-+]?[\d.]")
_FLOW = re.compile(r"\s*(?:N\d+\s*)?O(?:\d+|<[^>]*>)\s*(?:SUB|CALL|IF|WHILE|DO|REPEAT)\b", re.IGNORECASE)
_WITH_TEXT = re.compile(
    r"\s*(?:N\d+\s*)?(M)0*(23|28|115|117|118|486|862(?:\.\d+)?|928)(?![\d.])", re.IGNORECASE
)
_GROUPS = (MOVES, tuple(PLANES), tuple(UNITS), POSITIONS, CENTRES)
_AXES, _OTHER_AXES = frozenset("XYZ"), frozenset("ABCUVW")
_CENTRES = dict(zip("XYZ", "IJK", strict=True))  # words of a centre by the axes that they are along


def _codes(letter: str, *numbers: float) -> frozenset[str]:
    return frozenset(f"{letter}{number:g}" for number in numbers)


# How fast, with which tool, how precisely; and what ends a mode that is refused.
_PLAIN = _codes("G", 4, 9, 40, 49, 54, 61, 61.1, 64, 80, 93, 94, 95, 96, 97) | _codes("M", *range(10), 30)
_PASSED_OVER = _codes("G", 8, 11, 15, 43, 44, 67, 69, 92.1, 98, 99, 103, 187)
_WITHOUT_AXES = _codes("G", 5, 5.1, 10, 22, 23, 29, 50, 50.1)  # with axis words they are other things
# Axis words are what these set, not where the tool goes: times, homes, speeds, currents, places to park.
_OWN_WORDS = _codes("G", 4, 28, 30) | _codes(
    "M", 17, 18, 48, 84, 85, 92, 114, 119, 125, 201, 202, 203, 204, 205, 207, 208, 209, 211, 218, 350, 420,
    421, 422, 425, 555, 566, 569, 572, 593, 600, 601, 603, 701, 702, 851, 900, 906, 907, 908, 911, 912, 913,
    914, 915, 919,
)  # fmt: skip
_CALLS = _codes("G", 65, 66, 66.1) | _codes("M", 32, 47, 96, 97, 98, 198, 808, *range(810, 820))
_SHIFTS = _codes("G", 10, 52, 92) | _codes("M", 72, 206, 290, 428, 556, 579, 605, 665, 666, 852)
_KNOWN = MODES | _PLAIN | _PASSED_OVER | _OWN_WORDS | {*AWAY}


@dataclass(frozen=True)
class Block:
    """One line of a program.

    Attributes
    ----------
    codes : tuple of str
        G and M codes in order, without leading zeros.
    values : dict
        Numbers by their letters, of a move or a setting; none where a code takes them for its own.
    homed : frozenset of str
        The axes of a block with one of `AWAY`.
    passed_over : tuple of str
        What does not change the tool's path and is worth naming.
    """

    codes: tuple[str, ...] = ()
    values: dict[str, float] | None = None
    homed: frozenset[str] = frozenset()
    passed_over: tuple[str, ...] = ()


def _read_block(line: str) -> Block:
    """Return the block of a line; what cannot be read, or is not followed, is an `InputError`."""
    plain = _COMMENT.sub(" ", line)
    if plain.lstrip().startswith("/"):
        return Block(passed_over=(BLOCK_DELETE,))
    text = _WITH_TEXT.match(plain)
    if text is not None:
        return Block(passed_over=(f"M{text[2]}",))
    if _FLOW.match(plain):
        raise InputError(f"subprograms, loops and conditions are not followed, {_WRITE_OUT}")
    if _EXPONENT.search(plain) or (_SMALL_EXPONENT.search(plain) and plain != plain.lower()):
        raise InputError("expected numbers without an exponent, as X1000")
    codes, words = _words("".join(plain.upper().split()))
    _check_codes(codes, words)
    return _block(codes, words)


_WRITE_OUT = "expected one program with all moves written out, as postprocessors do when asked"


def _words(text: str) -> tuple[tuple[str, ...], dict[str, float | None]]:
    """Return G and M codes, and numbers by their letters; None where a letter has none."""
    words: dict[str, float | None] = {}
    codes: list[str] = []
    place = 0
    while place < len(text) and text != "%":
        found = _WORD.match(text, place)
        if found is None or (found[2] is None and found[1] in "GM"):
            raise _no_words(text[place:])
        letter, place = found[1], found.end()
        number = None if found[2] is None else float(found[2])
        if number is not None and abs(number) > MAX_NUMBER:
            raise InputError(
                f"{letter}: expected a number of at most {MAX_NUMBER:g} in size, got {clip(found[2])}"
            )
        if letter in "GM":
            codes.append(f"{letter}{number:g}")
        elif letter in words:
            raise InputError(f"{letter} is given twice")
        else:
            words[letter] = number
    return tuple(codes), words


def _no_words(text: str) -> InputError:
    return InputError(f"expected words of a letter and a number, as X1.5, got {clip(text)}")


def _check_codes(codes: tuple[str, ...], words: dict[str, float | None]) -> None:
    """Refuse codes that may move the path and are not followed."""
    with_axes = bool(words.keys() & (_AXES | _OTHER_AXES | set(_CENTRES.values())))
    for code in codes:
        if code in MODES:
            continue
        if code in _CALLS or (code == "M99" and "P" in words):
            raise InputError(f"{code}: calls and jumps are not followed, {_WRITE_OUT}")
        if code in _WITHOUT_AXES and not with_axes and "L" not in words:
            continue
        if code == "G92" and words.keys() <= {"E", "F", "N", "S"} and "E" in words:
            continue
        if code in _SHIFTS:
            raise InputError(f"{code} may shift or scale what the program's axes mean, which is not followed")
        if code[0] == "G" and code not in _KNOWN:
            valid = ", ".join([*MOVES, *PLANES, *UNITS, *POSITIONS, *CENTRES])
            raise InputError(f"{code} is not read, valid moves and settings: {valid}")
    if len(codes) > 1 and not {"G28", "G30"} & set(codes):
        for group in _GROUPS:
            several = list(dict.fromkeys(code for code in codes if code in group))
            if len(several) > 1:
                raise InputError(f"expected one of {', '.join(several)} in a block")


def _block(codes: tuple[str, ...], words: dict[str, float | None]) -> Block:
    """Return a block whose words are known to belong to one thing."""
    passed_over = tuple(code for code in codes if code not in MODES and code not in _PLAIN)
    own = next((code for code in codes if code in _OWN_WORDS), None)
    axes = words.keys() & _AXES
    homed = frozenset(axes or _AXES) if set(codes) & set(AWAY) else frozenset[str]()
    if own is not None:
        if own not in AWAY and axes and set(codes) & set(MOVES):
            raise InputError(f"{own}: expected a block of its own, as {min(axes)} may be a move's or its own")
        return Block(codes, None, homed, passed_over)
    foreign = next((code for code in codes if code[0] == "M" and float(code[1:]) >= 100), None)
    if foreign is not None and not set(codes) & set(MOVES):
        if axes:
            told = f"{foreign} with {min(axes)} is not known, it may move the tool or its axes"
            raise InputError(f"{told}: expected X, Y, Z with moves alone")
        return Block(codes, None, homed, passed_over)
    values = {letter: number for letter, number in words.items() if number is not None}
    lacking = next((letter for letter in words if letter not in values), None)
    if lacking is not None:
        raise _no_words(lacking)
    turning = next((letter for letter in words if letter in _OTHER_AXES), None)
    if turning is not None:
        raise InputError(f"axis {turning} is not read, expected X, Y and Z alone")
    return Block(codes, values, homed, passed_over)


MAX_POINTS = 1_000_000  # of a program, as a small chord cuts its arcs into many
MAX_RADIUS_ERROR = 0.005, 1e-3  # by which an arc's ends may differ: in its unit, and as a share of the radius
MAX_CIRCLE_GAP = 1e-6  # between the ends of a full circle, in its unit: far less than programs' digits
MAX_NAMES = 12  # in a note
_STRAY = "PQL"  # words that some controls take for repeats, turns or corners


def read_gcode(path: Path, chord: float) -> ToolPath:
    """Return the tool path in a G-code file, its points in the frame of the program [m].

    ``chord`` is the largest distance of an arc from the chords it is cut into [m].

    Warns
    -----
    FileNote
        With what was passed over, where it is more than feeds, spindles and tools.
    """
    program = _run(read_text(path).splitlines(), chord, path)
    if not program.points:
        if program.away and program.move:
            raise InputError(f"{path}: {program.lost()}")
        raise InputError(f"{path}: expected at least one move, G0 to G3 with X, Y or Z")
    if program.passed_over:
        named = join_names((f"{what} (line {k})" for what, k in program.passed_over.items()), MAX_NAMES)
        warnings.warn(f"{path}: passed over, each from this line on: {named}", FileNote, stacklevel=2)
    return ToolPath(np.array(program.points))


def _run(lines: list[str], chord: float, path: Path) -> _Program:
    """Return a program that was read to its end."""
    program = _Program(chord)
    for number, line in enumerate(lines, start=1):
        try:
            if program.run(_read_block(line), number):
                if "M99" in program.passed_over:
                    _check_last(lines[number:])
                break
        except InputError as error:
            raise InputError(f"{path}: line {number}: {error}") from None
    return program


def _check_last(lines: list[str]) -> None:
    """Refuse a program that returns before others in its file: which is the main one is not known."""
    if any(line.partition("(")[0].partition(";")[0].strip(" %") for line in lines):
        raise InputError("M99: expected the end of the file, or M30, after one program")


@dataclass
class _Program:
    """State of a program while it is read; lengths in metres."""

    chord: float
    points: list[list[float]] = field(default_factory=list)
    at: dict[str, float] = field(default_factory=lambda: dict.fromkeys("XYZ", 0.0))
    unit: float = MILLIMETRE
    move: str = ""
    plane: tuple[str, str, str] = PLANES["G17"]
    relative: bool = False
    centre_absolute: bool = False
    away: dict[str, str] = field(default_factory=dict)  # the code that took an axis to a place not known here
    passed_over: dict[str, int] = field(default_factory=dict)  # with the first line

    def run(self, block: Block, number: int) -> bool:
        """Do a block; True where it ends the program."""
        for code in block.codes:
            self._set(code)
        for what in block.passed_over:
            self.passed_over.setdefault(what, number)
        values = block.values or {}
        if block.homed:
            self._leave(block, f"{next(code for code in block.codes if code in AWAY)} in line {number}")
        elif values.keys() & {"X", "Y", "Z"} or (values.keys() & {"I", "J", "K"} and self.move in ARCS):
            self._go(values, [code for code in block.codes if code not in MODES])
        return bool(set(ENDS) & set(block.codes))

    def _set(self, code: str) -> None:
        if code in MOVES:
            self.move = code
        elif code in PLANES:
            self.plane = PLANES[code]
        elif code in UNITS:
            self.unit = UNITS[code]
        elif code in POSITIONS:
            self.relative = code == "G91"
        elif code in CENTRES:
            self.centre_absolute = code == "G90.1"

    def _leave(self, block: Block, code: str) -> None:
        """Go to a place of the machine: axes are not known until the program gives them again."""
        if "G53" in block.codes and self.move != "G0":
            raise InputError("G53: expected G0, a move to a place of the machine is left out")
        self.away |= dict.fromkeys(block.homed, code)

    def _go(self, values: dict[str, float], owners: list[str]) -> None:
        """Move to a position; ``owners`` are codes of the block that words other than axes may belong to."""
        if not self.move:
            raise InputError("expected G0, G1, G2 or G3 before the first position")
        start, end = dict(self.at), dict(self.at)
        for axis in values.keys() & set("XYZ"):
            end[axis] = values[axis] * self.unit + (start[axis] if self.relative else 0.0)
        self._check_words(values, owners)
        returning = bool(self.away)
        if not self.relative:
            self.away = {axis: code for axis, code in self.away.items() if axis not in values}
        if self.away and self.move != "G0":
            if self.points:
                raise self.lost()
            self.away = {}  # printers' home is 0, as the start of any program
        if self.move in ARCS:
            if not self.points:
                raise InputError(f"{self.move}: expected a straight move before the first arc")
            self._add_arc(start, end, values)
        elif returning and self.points and not self.away:
            self._come_back(end)
        elif not self.away:
            self._add(end)
        self.at = end

    def lost(self) -> InputError:
        """Return the error of a program that works where an axis is not known."""
        axis, code = min(self.away.items())
        return InputError(f"{axis} is not known after {code}, expected it before {self.move}")

    def _check_words(self, values: dict[str, float], owners: list[str]) -> None:
        """Refuse words that say of a move what is not done."""
        arc = self.move in ARCS
        shape = {"P", *(_CENTRES[axis] for axis in self.plane[:2]), "R"} if arc else set[str]()
        stray = [letter for letter in "IJKR" if letter in values and letter not in shape and values[letter]]
        if not owners:
            stray += [letter for letter in _STRAY if letter in values and letter not in shape]
        elif arc and "P" in values:
            raise InputError(f"P: expected {self.move} without {owners[0]}, as P may be either's")
        if stray:
            raise InputError(f"{stray[0]} is not read in {self.move}")

    def _come_back(self, end: dict[str, float]) -> None:
        """Go on where the program is known again, at the higher of both heights."""
        last = dict(zip("XYZ", self.points[-1], strict=True))
        height = max(last["Z"], end["Z"])
        self._add({**last, "Z": height})
        self._add({**end, "Z": height})
        self._add(end)

    def _add_arc(self, start: dict[str, float], end: dict[str, float], values: dict[str, float]) -> None:
        """Chords of an arc, or of a helix."""
        u, v, w = self.plane
        cu, cv = self._centre(start, end, values)
        radius, angle = math.hypot(start[u] - cu, start[v] - cv), math.atan2(start[v] - cv, start[u] - cu)
        sweep = math.atan2(end[v] - cv, end[u] - cu) - angle
        whole = math.dist((start[u], start[v]), (end[u], end[v])) <= MAX_CIRCLE_GAP * self.unit
        sweep = 0.0 if whole else sweep % (2 * math.pi)
        sweep = sweep - 2 * math.pi if self.move == "G2" else sweep or 2 * math.pi
        turns = values.get("P", 1.0)
        if turns < 1 or turns != int(turns):
            raise InputError(f"P: expected a whole number of turns from 1, got {turns:g}")
        sweep += math.copysign(2 * math.pi, sweep) * (turns - 1)
        most = 2 * math.acos(max(1 - self.chord / radius, 0.0)) if self.chord < radius else math.pi / 2
        count = max(1, math.ceil(abs(sweep) / max(most, 1e-9) - 1e-9))
        if len(self.points) + count > MAX_POINTS:
            raise InputError(f"expected at most {MAX_POINTS} points in all, a larger chord leaves fewer")
        for k in range(1, count):
            turn, share = angle + sweep * k / count, k / count
            place = {u: cu + radius * math.cos(turn), v: cv + radius * math.sin(turn)}
            self._add({**place, w: start[w] + share * (end[w] - start[w])})
        self._add(end)

    def _centre(
        self, start: dict[str, float], end: dict[str, float], values: dict[str, float]
    ) -> tuple[float, float]:
        u, v, _ = self.plane
        offsets = [_CENTRES[u], _CENTRES[v]]
        if "R" in values:
            if values.keys() & set(offsets):
                raise InputError(f"{self.move}: expected R, or {' and '.join(offsets)}, not both")
            return self._centre_of_radius(start, end, values["R"] * self.unit)
        if not values.keys() & set(offsets):
            raise InputError(f"{self.move}: expected R, or {' and '.join(offsets)}")
        given = [values.get(letter, 0.0) * self.unit for letter in offsets]
        origin = (0.0, 0.0) if self.centre_absolute else (start[u], start[v])
        centre = [base + offset for base, offset in zip(origin, given, strict=True)]
        radii = [math.hypot(place[u] - centre[0], place[v] - centre[1]) for place in (start, end)]
        off = abs(radii[1] - radii[0])
        if min(radii) <= 0 or off > max(MAX_RADIUS_ERROR[0] * self.unit, MAX_RADIUS_ERROR[1] * radii[0]):
            told = " and ".join(f"{radius / self.unit:.6g}" for radius in radii)
            raise InputError(f"{self.move}: expected ends equally far from the centre, got {told}")
        return centre[0], centre[1]

    def _centre_of_radius(
        self, start: dict[str, float], end: dict[str, float], radius: float
    ) -> tuple[float, float]:
        """Centre of the arc of at most half a turn, or of more where the radius is negative."""
        u, v, _ = self.plane
        du, dv = end[u] - start[u], end[v] - start[v]
        length = math.hypot(du, dv)
        if length <= MAX_CIRCLE_GAP * self.unit:
            raise InputError(f"{self.move}: with R, expected an end elsewhere; I, J, K give a full turn")
        if length > 2 * abs(radius) + 2 * MAX_RADIUS_ERROR[0] * self.unit:
            least = length / 2 / self.unit
            raise InputError(f"{self.move}: R: expected at least {least:.6g}, half the distance of the ends")
        rise = math.sqrt(max(radius**2 - length**2 / 4, 0.0)) / length
        side = rise if (self.move == "G3") == (radius > 0) else -rise
        return (start[u] + end[u]) / 2 - side * dv, (start[v] + end[v]) / 2 + side * du

    def _add(self, place: dict[str, float]) -> None:
        point = [round(place[axis], 12) + 0.0 for axis in "XYZ"]
        if not self.points or point != self.points[-1]:
            self.points.append(point)
