"""Tool paths from G-code (RS-274, ISO 6983): straight and circular moves, as points in metres.

Rapid and cutting moves (G0, G1) are straight lines, arcs (G2, G3) are cut into chords in the plane of G17,
G18 or G19, with R or with I, J, K, and with P for the number of turns, the last of which may be part of one,
as LinuxCNC has it; units (G20, G21), absolute and relative positions (G90, G91) and centres (G90.1, G91.1)
are heeded. F is the speed of moves at work, in units a minute, until the next; travel has none, nor has work
under G93 or G95, where F is the inverse of a time or goes by turns. What says with which tool is passed over.
M2 and M30 end a program. Ways to places of the machine (G28, G30, G53) are left out: the tool rises to the
higher of the heights before and after, and goes on from there. What else does not change the path is named in
a note; all lines that may change it and are not followed are refused at once.

Of a program that extrudes, one with E in its moves or with M82 or M83, the strokes are the moves on which E
grows; what comes before the first and after the last is left out. What they feed a metre is their flow. Of
other programs strokes are all moves but G0.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.gcode_blocks import (
    ARCS,
    AWAY,
    AXES,
    CENTRES,
    ENDS,
    FEEDS,
    FILAMENTS,
    MILLIMETRE,
    MODES,
    MOVES,
    OFFSETS,
    PLANES,
    POSITIONS,
    UNITS,
    Block,
    read_block,
)
from regionik.worlds.readers.text import join_names, read_text
from regionik.worlds.strokes import numbered_strokes
from regionik.worlds.toolpath import ToolPath

MAX_POINTS = 1_000_000  # of a program, as a small chord cuts its arcs into many
MAX_RADIUS_ERROR = 0.005, 1e-3  # by which an arc's ends may differ: in its unit, and as a share of the radius
MAX_CIRCLE_GAP = 1e-6  # between the ends of a full circle, in its unit: far less than programs' digits
MAX_NAMES = 12  # of a kind in a message
LEAST_FILAMENT = 1e-9  # that a move feeds, in the program's unit: less is rounding
EARLY = "work before the first full position"
_STRAY = "PQL"  # words that some controls take for repeats, turns or corners


def read_gcode(path: Path, chord: float) -> ToolPath:
    """Return the tool path in a G-code file, its points in the frame of the program [m].

    ``chord`` is the largest distance of an arc from the chords it is cut into [m].

    Raises
    ------
    InputError
        With all the lines that cannot be read or are not followed.

    Warns
    -----
    FileNote
        With what was passed over, where it is more than spindles and tools.
    """
    blocks, refused = _blocks(read_text(path).splitlines())
    program = _Program.of(blocks, chord)
    refused |= _run(program, blocks, refused)
    if refused:
        raise InputError(f"{path}: {_told(refused)}")
    if not program.points:
        if program.away and program.move:
            raise InputError(f"{path}: {program.lost()}")
        raise InputError(f"{path}: expected at least one move, G0 to G3 with X, Y or Z")
    if program.passed_over:
        named = _grouped(program.passed_over)
        warnings.warn(f"{path}: passed over, each from this line on: {named}", FileNote, stacklevel=2)
    return program.path(path)


Numbered = tuple[int, Block]  # a block, and its line from 1
Refused = dict[int, str]  # why, by line


def _blocks(lines: Sequence[str]) -> tuple[list[Numbered], Refused]:
    """Return the blocks of a program up to its end, with their lines, and what is refused of which line."""
    blocks, refused = list[Numbered](), Refused()
    for number, line in enumerate(lines, start=1):
        if len(blocks) + len(refused) >= MAX_POINTS:
            refused[number] = f"expected at most {MAX_POINTS} moves and settings in all"
            break
        try:
            block = read_block(line)
            if "M99" in block.codes:
                _check_last(lines[number:])
        except InputError as error:
            refused[number] = str(error)
            continue
        if block.codes or block.values or block.passed_over:
            blocks.append((number, block))
        if set(ENDS) & set(block.codes):
            break
    return blocks, refused


def _run(program: _Program, blocks: Sequence[Numbered], refused: Refused) -> Refused:
    """Run a program; return what of it cannot be done, but for what may only follow from refused lines."""
    found, lines = Refused(), sorted(refused, reverse=True)
    sure = True
    for number, block in blocks:
        while lines and lines[-1] < number:
            sure = not lines.pop()
        sure |= program.straight_to(block)
        try:
            program.run(block, number)
        except InputError as error:
            if sure:
                found[number] = str(error)
            if len(program.points) >= MAX_POINTS:
                break
    return found


def _check_last(lines: Iterable[str]) -> None:
    """Refuse a program that returns before others in its file: which is the main one is not known."""
    if any(line.partition("(")[0].partition(";")[0].strip(" %") for line in lines):
        raise InputError("M99: expected the end of the file, or M30, after one program")


def _told(refused: Refused) -> str:
    """Refused lines in one message, those refused for the same reason together."""
    lines: dict[str, list[int]] = {}
    for number in sorted(refused):
        lines.setdefault(refused[number], []).append(number)
    told = [
        f"line{'s' * (len(some) > 1)} {join_names(map(str, some), MAX_NAMES)}: {text}"
        for text, some in lines.items()
    ]
    rest = len(told) - MAX_NAMES
    return "; ".join(told[:MAX_NAMES]) + (f"; and {rest} more refusals" if rest > 0 else "")


def _grouped(passed_over: dict[str, int]) -> str:
    """Names with their first lines, G-codes, M-codes and commands by name one after the other."""
    groups: dict[str, list[str]] = {}
    for what, line in passed_over.items():
        kind = what[0] if what[1:2].isdigit() else ""
        groups.setdefault(kind, []).append(f"{what} (line {line})")
    return "; ".join(join_names(groups[kind], MAX_NAMES) for kind in ("G", "M", "") if kind in groups)


@dataclass
class _Program:
    """State of a program while it is read; lengths in metres, NaN where an axis is not known."""

    chord: float
    extrudes: bool
    at: dict[str, float]
    points: list[list[float]] = field(default_factory=list)
    works: list[bool] = field(default_factory=list)  # on the move to each point
    speeds: list[float] = field(default_factory=list)  # of that move, infinite where none is told [m/s]
    flows: list[float] = field(default_factory=list)  # filament per metre of that move [mm/m]
    unit: float = MILLIMETRE
    move: str = ""
    plane: tuple[str, str, str] = PLANES["G17"]
    relative: bool = False
    centre_absolute: bool = False
    feed: float = math.inf  # of moves at work, infinite before the first F [m/s]
    feed_mode: str = "G94"
    filament: float = 0.0  # where E is, in the program's unit
    filament_relative: bool = False
    away: dict[str, str] = field(default_factory=dict)  # the code that took an axis to a place not known here
    passed_over: dict[str, int] = field(default_factory=dict)  # with the first line

    @classmethod
    def of(cls, blocks: Sequence[Numbered], chord: float) -> _Program:
        """Return the state before the first block: an axis first given by a relative move, or never, is 0.

        No other is known before it is given.
        """
        first, relative, move, extrudes = dict[str, bool](), False, "", False
        for _, block in blocks:
            for code in block.codes:
                relative = code == "G91" if code in POSITIONS else relative
                move = code if code in MOVES else move
                extrudes |= code in FILAMENTS
            for axis in block.homed:
                first.setdefault(axis, False)
            if move and block.values and not {"G92"} & set(block.codes):
                extrudes |= "E" in block.values
                for axis in block.values.keys() & AXES:
                    first.setdefault(axis, relative)
        return cls(chord, extrudes, {axis: 0.0 if first.get(axis, True) else math.nan for axis in OFFSETS})

    def path(self, file: Path) -> ToolPath:
        """Return the path that was read, that of a program that extrudes from its first to its last bead."""
        points, works = np.array(self.points), np.array(self.works)[1:]
        speeds, flows = np.array(self.speeds), np.array(self.flows)
        if self.extrudes:
            beads = np.flatnonzero(works)
            if not len(beads):
                raise InputError(f"{file}: expected moves on which E grows, as the program has E, M82 or M83")
            first, end = beads[0], beads[-1] + 2
            points, works = points[first:end], works[first : end - 1]
            speeds, flows = speeds[first:end], flows[first:end]
        speeds[0], flows[0] = math.inf, 0.0
        return ToolPath(
            points,
            strokes=numbered_strokes(works),
            speeds=speeds if np.isfinite(speeds).any() else None,
            flows=flows if self.extrudes else None,
        )

    def run(self, block: Block, number: int) -> None:
        """Do a block."""
        for code in block.codes:
            self._set(code)
        for what in block.passed_over:
            self.passed_over.setdefault(what, number)
        values = block.values or {}
        self._set_feed(block, number)
        if "G92" in block.codes:
            self.filament = values["E"]
        elif block.homed:
            self._leave(block, f"{next(code for code in block.codes if code in AWAY)} in line {number}")
        elif values.keys() & AXES or (values.keys() & {"I", "J", "K"} and self.move in ARCS):
            self._go(values, [code for code in block.codes if code not in MODES], number)
        elif "E" in values:
            self._fed(values)

    def straight_to(self, block: Block) -> bool:
        """True where a block moves straight to a place in X and Y, wherever it begins."""
        move = next((code for code in block.codes if code in MOVES), self.move)
        return not self.relative and move not in ARCS and (block.values or {}).keys() >= {"X", "Y"}

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
        elif code in FILAMENTS:
            self.filament_relative = code == "M83"

    def _set_feed(self, block: Block, number: int) -> None:
        """Take F for the speed from here on, but where it may be that of a code that is passed over."""
        self.feed_mode = next((code for code in block.codes if code in FEEDS), self.feed_mode)
        values = block.values or {}
        if self.feed_mode != "G94":
            self.feed = math.inf
            if "F" in values:
                self.passed_over.setdefault(f"F by {self.feed_mode}", number)
        elif values.get("F", 0.0) > 0 and (values.keys() & AXES or not block.passed_over):
            self.feed = values["F"] * self.unit / 60

    def _leave(self, block: Block, code: str) -> None:
        """Go to a place of the machine: axes are not known until the program gives them again."""
        if "G53" in block.codes and self.move != "G0":
            raise InputError("G53: expected G0, a move to a place of the machine is left out")
        self.away |= dict.fromkeys(block.homed, code)
        self.at |= dict.fromkeys(block.homed, math.nan)

    def _fed(self, values: dict[str, float]) -> float:
        """Feed filament; return how much."""
        if "E" not in values:
            return 0.0
        before = 0.0 if self.relative or self.filament_relative else self.filament
        fed = values["E"] - before
        self.filament += fed
        return fed

    def _go(self, values: dict[str, float], owners: list[str], number: int) -> None:
        """Move to a position; ``owners`` are codes of the block that words other than axes may belong to."""
        if not self.move:
            raise InputError("expected G0, G1, G2 or G3 before the first position")
        start, end = self.at, dict(self.at)
        for axis in values.keys() & AXES:
            end[axis] = values[axis] * self.unit + (start[axis] if self.relative else 0.0)
        fed, self.at = self._fed(values), end
        works, before = fed > LEAST_FILAMENT if self.extrudes else self.move != "G0", len(self.points)
        self._check_words(values, owners)
        if self.move in ARCS and (works or not self.extrudes):
            if not self.points or _lacking(start):
                lacking = "".join(f", {axis} is not known" for axis in _lacking(start)[:1])
                raise InputError(f"{self.move}: expected a straight move before the first arc{lacking}")
            self._add_arc(start, end, values)
        else:
            self._add_line(start, end, works, number)
        self._lay(before, fed * self.unit / MILLIMETRE)
        self.away = {axis: code for axis, code in self.away.items() if axis in _lacking(end)}

    def _lay(self, first: int, filament: float) -> None:
        """Lay filament [mm] evenly along the points from ``first`` on, as far as they are worked."""
        ways = [
            math.dist(self.points[k - 1], self.points[k]) * self.works[k]
            for k in range(first, len(self.points))
        ]
        self.flows += [filament / sum(ways) if way else 0.0 for way in ways]

    def _add_line(self, start: dict[str, float], end: dict[str, float], works: bool, number: int) -> None:
        """A straight move, as far as its ends are known."""
        begins, bead = not self.points, works and self.extrudes
        if not _lacking(start) and not _lacking(end):
            if begins and bead:
                self._add(start, works=False)
            self._add(end, works)
        elif begins:
            if works and (self.extrudes or _lacking(end)):
                self.passed_over.setdefault(EARLY, number)
            if not _lacking(end):
                self._add(end, works=False)
        elif not _lacking(end) and not bead:
            self._come_back(end)
        elif works:
            raise self.lost()

    def lost(self) -> InputError:
        """Return the error of a program that works where an axis is not known."""
        axis, code = min(self.away.items())
        return InputError(f"{axis} is not known after {code}, expected it before {self.move}")

    def _check_words(self, values: dict[str, float], owners: list[str]) -> None:
        """Refuse words that say of a move what is not done."""
        arc = self.move in ARCS
        shape = {"P", *(OFFSETS[axis] for axis in self.plane[:2]), "R"} if arc else set[str]()
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
        for place in ({**last, "Z": height}, {**end, "Z": height}, end):
            self._add(place, works=False)

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
            self._add({**place, w: start[w] + share * (end[w] - start[w])}, works=True)
        self._add(end, works=True)

    def _centre(
        self, start: dict[str, float], end: dict[str, float], values: dict[str, float]
    ) -> tuple[float, float]:
        u, v, _ = self.plane
        offsets = [OFFSETS[u], OFFSETS[v]]
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

    def _add(self, place: dict[str, float], works: bool) -> None:
        point = [round(place[axis], 12) + 0.0 for axis in "XYZ"]
        if self.points and point == self.points[-1]:
            return
        if len(self.points) >= MAX_POINTS:
            raise InputError(f"expected at most {MAX_POINTS} points in all")
        self.points.append(point)
        self.works.append(works)
        self.speeds.append(self.feed if works else math.inf)


def _lacking(at: dict[str, float]) -> list[str]:
    """Axes that are not known."""
    return [axis for axis, value in at.items() if value != value]
