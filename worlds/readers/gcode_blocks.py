"""Lines of G-code (RS-274, ISO 6983, and as Marlin, Klipper and RepRapFirmware read it), one block each.

Words belong to the code of their block: those of M-codes, of homing, probing and dwells are never positions.
What leaves the tool's path as it is is passed over by name; what may move the tool or its axes and is not
followed is refused. The tables of codes are here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from regionik.worlds.errors import InputError
from regionik.worlds.readers.text import MAX_NUMBER, clip

INCH, MILLIMETRE = 0.0254, 0.001  # [m]
MOVES, ARCS = ("G0", "G1", "G2", "G3"), ("G2", "G3")
PLANES = {"G17": ("X", "Y", "Z"), "G18": ("Z", "X", "Y"), "G19": ("Y", "Z", "X")}  # of arcs, the last across
UNITS = {"G20": INCH, "G21": MILLIMETRE}
POSITIONS, CENTRES = ("G90", "G91"), ("G90.1", "G91.1")
FILAMENTS = ("M82", "M83")  # absolute and relative lengths of filament
FEEDS = ("G93", "G94", "G95")  # what F is: the inverse of a time, a way a minute, a way a turn
MODES = frozenset({*MOVES, *PLANES, *UNITS, *POSITIONS, *CENTRES, *FILAMENTS, *FEEDS})
AWAY = ("G27", "G28", "G30", "G53")  # moves to places of the machine, which the program's frame does not know
ENDS = ("M2", "M30", "M99")
OFFSETS = dict(zip("XYZ", "IJK", strict=True))  # words of a centre by the axes that they are along
BLOCK_DELETE = "blocks that begin with /"

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_CHECKSUM = re.compile(r"\*\s*\d+\s*$")
_WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))?")
# C and Python write small numbers as 1e-05; the filament of a program without blanks is X10E0.5.
_EXPONENT = re.compile(r"[\d.]E[-+]0\d", re.IGNORECASE)
_SMALL_EXPONENT = re.compile(r"[\d.]e[-+]?[\d.]")
_FLOW = re.compile(
    r"\s*(?:N\d+\s*)?(?:O(?:\d+|<[^>]*>)\s*(?:SUB|CALL|IF|WHILE|DO|REPEAT)\b"
    r"|(?:IF|ELIF|ELSE|WHILE|GOTO|REPEAT|CALL|SDCARD_LOOP_BEGIN)(?![A-Z_=]))",
    re.IGNORECASE,
)
_M_CODE = re.compile(r"\s*(?:N\d+\s*)?M(\d+(?:\.\d+)?)(?![\d.])(.*)", re.IGNORECASE)
_TEXT = re.compile(r"(?:23|28|115|117|118|486|862(?:\.\d+)?|928)$")  # M-codes before text
_MOVING_WORD = re.compile(r"(?<![A-Z_])G0*[0-3](?![\d.])", re.IGNORECASE)
_TOOL = re.compile(r"\s*(?:N\d+\s*)?T[?XC]?\s*$", re.IGNORECASE)  # as multi-material units ask for one
_MACRO = re.compile(r"\s*([A-Z_][A-Z_]{2,}\w*)(?:\s+(.*\S))?\s*$", re.IGNORECASE)
_SETTING = re.compile(r"\w+\s*=")
_GROUPS = (MOVES, tuple(PLANES), tuple(UNITS), POSITIONS, CENTRES, FILAMENTS, FEEDS)
AXES, _OTHER_AXES = frozenset("XYZ"), frozenset("ABCUVW")


def _codes(letter: str, *numbers: float) -> frozenset[str]:
    return frozenset(f"{letter}{number:g}" for number in numbers)


# How fast, with which tool, how precisely; and what ends a mode that is refused.
_PLAIN = _codes("G", 4, 9, 40, 49, 54, 61, 61.1, 64, 80, 96, 97) | _codes("M", *range(10), 30)
_PASSED_OVER = _codes("G", 8, 11, 15, 43, 44, 67, 69, 92.1, 98, 99, 103, 187)
# Retraction, probing, levelling, cleaning; with axis words some controls take them for other things.
_WITHOUT_AXES = _codes("G", 5, 5.1, 10, 12, 22, 23, 26, 31, 32, 33, 34, 35, 50, 50.1, 76, 81)
# Axis words are what these set, not where the tool goes: times, homes, speeds, currents, places to park.
_OWN_WORDS = _codes("G", 4, 27, 28, 29, 30) | _codes(
    "M", 17, 18, 48, 84, 85, 92, 114, 119, 125, 201, 202, 203, 204, 205, 207, 208, 209, 211, 218, 350, 420,
    421, 422, 425, 555, 566, 569, 572, 593, 600, 601, 603, 701, 702, 851, 900, 906, 907, 908, 911, 912, 913,
    914, 915, 919,
)  # fmt: skip
_CALLS = _codes("G", 65, 66, 66.1) | _codes("M", 32, 47, 96, 97, 98, 198, 808, *range(810, 820))
_SHIFTS = _codes("G", 10, 52, 92) | _codes("M", 72, 206, 290, 428, 556, 579, 605, 665, 666, 852)
_KNOWN = MODES | _PLAIN | _PASSED_OVER | _OWN_WORDS | {*AWAY}
_GENERAL = _PLAIN | _CALLS | _SHIFTS | MODES | {"M99"}  # beside which a block may have other words
_SHIFTING_MACROS = frozenset({
    "FORCE_MOVE", "MANUAL_STEPPER", "RESTORE_GCODE_STATE", "SET_DUAL_CARRIAGE", "SET_GCODE_OFFSET",
    "SET_KINEMATIC_POSITION", "SET_SKEW", "SKEW_PROFILE",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
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


def read_block(line: str) -> Block:
    """Return the block of a line; what cannot be read, or is not followed, is an `InputError`."""
    plain = _CHECKSUM.sub("", _COMMENT.sub(" ", line))
    if not plain.strip():
        return Block()
    if plain.lstrip().startswith("/"):
        return Block(passed_over=(BLOCK_DELETE,))
    if _FLOW.match(plain):
        raise InputError(f"subprograms, loops and conditions are not followed, {_WRITE_OUT}")
    named = _printer_block(plain) or _macro_block(plain)
    if named is not None:
        return named
    if _EXPONENT.search(plain) or (_SMALL_EXPONENT.search(plain) and plain != plain.lower()):
        raise InputError("expected numbers without an exponent, as X1000")
    codes, words = _words("".join(plain.upper().split()))
    _check_codes(codes, words)
    return _block(codes, words)


_WRITE_OUT = "expected one program with all moves written out, as postprocessors do when asked"


def _printer_block(plain: str) -> Block | None:
    """The block of a printer's M-code, whose words and text are its own; None for other blocks."""
    found = _M_CODE.match(plain)
    if found is None:
        return Block() if _TOOL.match(plain) else None
    code = f"M{float(found[1]):.10g}"
    if _TEXT.match(found[1]):
        return Block(passed_over=(code,))
    if code in ("M0", "M1") and found[2].strip() and not re.search(r"\d", found[2]):
        return Block()  # waits, and shows a text
    if _MOVING_WORD.search(found[2]) or code in _GENERAL:
        return None
    return Block(passed_over=(code,))


def _macro_block(plain: str) -> Block | None:
    """The block of a named command or macro, as Klipper has them; None for other blocks."""
    found = _MACRO.match(plain)
    if found is None or not (
        "_" in found[1] or (found[1].isalpha() and not found[2]) or _SETTING.match(found[2] or "")
    ):
        return None
    name = found[1].upper()
    if name in _SHIFTING_MACROS:
        raise InputError(f"{name} may move the tool or shift its axes, which is not followed")
    return Block(passed_over=(name,))


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
    with_axes = bool(words.keys() & (AXES | _OTHER_AXES | set(OFFSETS.values())))
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
    axes = words.keys() & AXES
    homed = frozenset(axes or AXES) if set(codes) & set(AWAY) else frozenset[str]()
    if own is not None:
        if "G92" in codes:
            raise InputError(f"{own}: expected a block of its own, as E may be G92's or its own")
        if own not in AWAY and axes and set(codes) & set(MOVES):
            raise InputError(f"{own}: expected a block of its own, as {min(axes)} may be a move's or its own")
        return Block(codes, None, homed, passed_over)
    values = {letter: number for letter, number in words.items() if number is not None}
    lacking = next((letter for letter in words if letter not in values), None)
    if lacking is not None:
        raise _no_words(lacking)
    turning = next((letter for letter in words if letter in _OTHER_AXES), None)
    if turning is not None:
        raise InputError(f"axis {turning} is not read, expected X, Y and Z alone")
    return Block(codes, values, homed, passed_over)
