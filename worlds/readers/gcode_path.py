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
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.gcode_blocks import (
    ARCS,
    AWAY,
    CENTRES,
    ENDS,
    MILLIMETRE,
    MODES,
    MOVES,
    PLANES,
    POSITIONS,
    UNITS,
    Block,
    read_block,
)
from regionik.worlds.readers.text import join_names, read_lines
from regionik.worlds.toolpath import ToolPath

GCODE_LIMIT = 64 * 2**20  # [bytes]
POINTS_LIMIT = 1_000_000
ROUND = 0.005, 1e-3  # by which an arc's ends may differ in radius: in its unit, and as a share of the radius
SAME = 1e-6  # in its unit, by which the ends of a full circle may differ: far less than programs' digits
_TOLD = 12  # names in a note
_OFFSETS = dict(zip("XYZ", "IJK", strict=True))
_STRAY = "PQL"  # words that some controls take for repeats, turns or corners


def read_gcode(path: Path, chord: float) -> ToolPath:
    """Return the tool path in a G-code file, its points in the frame of the program [m].

    ``chord`` is the largest distance of an arc from the chords it is cut into [m].

    Warns
    -----
    FileNote
        With what was passed over, where it is more than feeds, spindles and tools.
    """
    lines = read_lines(path, GCODE_LIMIT)
    program = _Program(chord)
    for number, line in enumerate(lines, start=1):
        try:
            if program.run(read_block(line), number):
                break
        except InputError as error:
            raise InputError(f"{path}: line {number}: {error}") from None
    if "M99" in program.passed_over and any(line.split("(")[0].strip(" %") for line in lines[number:]):
        raise InputError(
            f"{path}: line {number}: M99: expected the end of the file, or M30, after one program"
        )
    if not program.points and program.away and program.move:
        raise InputError(f"{path}: {program.lost()}")
    if not program.points:
        raise InputError(f"{path}: expected at least one move, G0 to G3 with X, Y or Z")
    if program.passed_over:
        named = join_names((f"{what} (line {k})" for what, k in program.passed_over.items()), _TOLD)
        note = f"{path}: passed over, each from this line on: {named}"
        warnings.warn(note, FileNote, stacklevel=2)
    return ToolPath(np.array(program.points))


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
            self._go(values, self._owners(block))
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

    @staticmethod
    def _owners(block: Block) -> list[str]:
        """Return the codes of a block that words other than axes may belong to."""
        return [code for code in block.codes if code not in MODES]

    def _go(self, values: dict[str, float], owners: list[str]) -> None:
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
        shape = {"P", *(_OFFSETS[axis] for axis in self.plane[:2]), "R"} if arc else set[str]()
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
        whole = math.dist((start[u], start[v]), (end[u], end[v])) <= SAME * self.unit
        sweep = _turned(0.0 if whole else sweep, clockwise=self.move == "G2")
        sweep += math.copysign(2 * math.pi, sweep) * (self._turns(values) - 1)
        most = 2 * math.acos(max(1 - self.chord / radius, 0.0)) if self.chord < radius else math.pi / 2
        count = max(1, math.ceil(abs(sweep) / max(most, 1e-9) - 1e-9))
        if len(self.points) + count > POINTS_LIMIT:
            raise InputError(f"expected at most {POINTS_LIMIT} points in all, a larger chord leaves fewer")
        for k in range(1, count):
            turn, share = angle + sweep * k / count, k / count
            place = {u: cu + radius * math.cos(turn), v: cv + radius * math.sin(turn)}
            self._add({**place, w: start[w] + share * (end[w] - start[w])})
        self._add(end)

    def _turns(self, values: dict[str, float]) -> float:
        turns = values.get("P", 1.0)
        if turns < 1 or turns != int(turns):
            raise InputError(f"P: expected a whole number of turns from 1, got {turns:g}")
        return turns

    def _centre(
        self, start: dict[str, float], end: dict[str, float], values: dict[str, float]
    ) -> tuple[float, float]:
        u, v, _ = self.plane
        offsets = [_OFFSETS[u], _OFFSETS[v]]
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
        if min(radii) <= 0 or off > max(ROUND[0] * self.unit, ROUND[1] * radii[0]):
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
        if length <= SAME * self.unit:
            raise InputError(f"{self.move}: with R, expected an end elsewhere; I, J, K give a full turn")
        if length > 2 * abs(radius) + 2 * ROUND[0] * self.unit:
            least = length / 2 / self.unit
            raise InputError(f"{self.move}: R: expected at least {least:.6g}, half the distance of the ends")
        rise = math.sqrt(max(radius**2 - length**2 / 4, 0.0)) / length
        side = rise if (self.move == "G3") == (radius > 0) else -rise
        return (start[u] + end[u]) / 2 - side * dv, (start[v] + end[v]) / 2 + side * du

    def _add(self, place: dict[str, float]) -> None:
        point = [round(place[axis], 12) + 0.0 for axis in "XYZ"]
        if not self.points or point != self.points[-1]:
            self.points.append(point)


def _turned(sweep: float, *, clockwise: bool) -> float:
    """The angle of a turn the way that an arc goes; 0 is a full one."""
    turn = sweep % (2 * math.pi)
    if clockwise:
        return turn - 2 * math.pi
    return turn or 2 * math.pi
