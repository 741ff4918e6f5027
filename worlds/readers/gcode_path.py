"""Tool paths from G-code (RS-274, ISO 6983): straight and circular moves, as points in metres.

Rapid and cutting moves (G0, G1) are straight lines, arcs (G2, G3) are cut into chords in the plane of G17,
G18 or G19, with R or with I, J, K; units (G20, G21), absolute and relative positions (G90, G91) and centres
(G90.1, G91.1) are heeded, and what says how fast or with which tool is passed over: the tool's speed is that
of the world. M2 and M30 end a program. Variables, turning axes, cycles and other work offsets than the first
are refused.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from regionik.worlds.errors import InputError
from regionik.worlds.readers.text import LARGEST, clip, read_lines
from regionik.worlds.toolpath import ToolPath

GCODE_LIMIT = 64 * 2**20  # [bytes]
POINTS_LIMIT = 1_000_000
LENGTH_LIMIT = 1000  # of a line [characters]
INCH, MILLIMETRE = 0.0254, 0.001  # [m]
ROUND = 0.005, 1e-3  # by which an arc's ends may differ in radius: in its unit, and as a share of the radius
_COMMENT = re.compile(r"\([^()]*\)|;.*")
_WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))")
_EXPONENT = re.compile(r"[\d.]E[-+]?[\d.]")  # a word E, the filament of printers, stands apart
_MOVES, _ARCS = ("G0", "G1", "G2", "G3"), ("G2", "G3")
_PLANES = {"G17": ("X", "Y", "Z"), "G18": ("Z", "X", "Y"), "G19": ("Y", "Z", "X")}  # of arcs, the last across
_UNITS = {"G20": INCH, "G21": MILLIMETRE}
_PASSED_OVER = {f"G{number}" for number in (4, 9, 40, 49, 54, 61, 61.1, 64, 80, 93, 94, 95, 97)}
_OFFSETS = dict(zip("XYZ", "IJK", strict=True))


def read_gcode(path: Path, chord: float) -> ToolPath:
    """Return the tool path in a G-code file, its points in the frame of the program [m].

    ``chord`` is the largest distance of an arc from the chords it is cut into [m].
    """
    lines = read_lines(path, GCODE_LIMIT)
    program = _Program(chord)
    for number, line in enumerate(lines, start=1):
        try:
            if program.run(line):
                break
        except InputError as error:
            raise InputError(f"{path}: line {number}: {error}") from None
    if not program.points:
        raise InputError(f"{path}: expected at least one move, G0 to G3 with X, Y or Z")
    return ToolPath(np.array(program.points))


@dataclass
class _Program:
    """State of a program while it is read; lengths in metres."""

    chord: float
    points: list[list[float]] = field(default_factory=list)
    at: dict[str, float] = field(default_factory=lambda: dict.fromkeys("XYZ", 0.0))
    unit: float = MILLIMETRE
    move: str = ""
    plane: tuple[str, str, str] = _PLANES["G17"]
    relative: bool = False
    centre_absolute: bool = False

    def run(self, line: str) -> bool:
        """Do a line; True where it ends the program."""
        values, codes = _words(line)
        for code in codes:
            self._set(code)
        if values.keys() & {"X", "Y", "Z"} or (values.keys() & {"I", "J", "K"} and self.move in _ARCS):
            self._go(values)
        return bool({"M2", "M30"} & set(codes))

    def _set(self, code: str) -> None:
        if code in _MOVES:
            self.move = code
        elif code in _PLANES:
            self.plane = _PLANES[code]
        elif code in _UNITS:
            self.unit = _UNITS[code]
        elif code in ("G90", "G91"):
            self.relative = code == "G91"
        elif code in ("G90.1", "G91.1"):
            self.centre_absolute = code == "G90.1"
        elif code[0] == "G" and code not in _PASSED_OVER:
            valid = ", ".join([*_MOVES, *_PLANES, *_UNITS, "G90, G91, G90.1, G91.1"])
            raise InputError(f"{code} is not read, valid moves and settings: {valid}")

    def _go(self, values: dict[str, float]) -> None:
        if not self.move:
            raise InputError("expected G0, G1, G2 or G3 before the first position")
        start, end = dict(self.at), dict(self.at)
        for axis in values.keys() & set("XYZ"):
            end[axis] = values[axis] * self.unit + (start[axis] if self.relative else 0.0)
        if self.move in _ARCS:
            if not self.points:
                raise InputError(f"{self.move}: expected a straight move before the first arc")
            self._add_arc(start, end, values)
        else:
            self._add(end)
        self.at = end

    def _add_arc(self, start: dict[str, float], end: dict[str, float], values: dict[str, float]) -> None:
        """Chords of an arc, or of a helix."""
        u, v, w = self.plane
        cu, cv = self._centre(start, end, values)
        radius, angle = math.hypot(start[u] - cu, start[v] - cv), math.atan2(start[v] - cv, start[u] - cu)
        sweep = math.atan2(end[v] - cv, end[u] - cu) - angle
        whole = (start[u], start[v]) == (end[u], end[v])
        sweep = _turned(0.0 if whole else sweep, clockwise=self.move == "G2")
        most = 2 * math.acos(max(1 - self.chord / radius, 0.0)) if self.chord < radius else math.pi / 2
        count = max(1, math.ceil(abs(sweep) / max(most, 1e-9) - 1e-9))
        if len(self.points) + count > POINTS_LIMIT:
            raise InputError(f"expected at most {POINTS_LIMIT} points in all, a larger chord leaves fewer")
        for k in range(1, count):
            turn, share = angle + sweep * k / count, k / count
            place = {u: cu + radius * math.cos(turn), v: cv + radius * math.sin(turn)}
            self._add({**place, w: start[w] + share * (end[w] - start[w])})
        self._add(end)

    def _centre(
        self, start: dict[str, float], end: dict[str, float], values: dict[str, float]
    ) -> tuple[float, float]:
        u, v, _ = self.plane
        if "R" in values:
            return self._centre_of_radius(start, end, values["R"] * self.unit)
        offsets = [_OFFSETS[u], _OFFSETS[v]]
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
        if length == 0.0:
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


def _words(line: str) -> tuple[dict[str, float], list[str]]:
    """Values by their letters, and G and M codes without leading zeros."""
    if len(line) > LENGTH_LIMIT:
        raise InputError(f"expected at most {LENGTH_LIMIT} characters")
    plain = _COMMENT.sub(" ", line).upper()
    if _EXPONENT.search(plain):
        raise InputError("expected numbers without an exponent, as X1000")
    text = "".join(plain.split())
    if text.startswith("/"):
        return {}, []  # a block that may be skipped is
    values: dict[str, float] = {}
    codes: list[str] = []
    place = 0
    while place < len(text) and text != "%":
        found = _WORD.match(text, place)
        if found is None:
            raise InputError(f"expected words of a letter and a number, as X1.5, got {clip(text[place:])}")
        letter, number, place = found[1], found[2], found.end()
        if letter in "ABCUVW":
            raise InputError(f"axis {letter} is not read, expected X, Y and Z alone")
        value = float(number)
        if abs(value) > LARGEST:
            raise InputError(
                f"{letter}: expected a number of at most {LARGEST:g} in size, got {clip(number)}"
            )
        if letter in "GM":
            codes.append(f"{letter}{value:g}")
        elif letter in values:
            raise InputError(f"{letter} is given twice")
        else:
            values[letter] = value
    return values, codes
