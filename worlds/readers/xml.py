"""XML files as trees of elements, and the names, numbers and origins that their attributes give.

Nothing is fetched, expanded or executed: a document type declaration, which defines entities, is refused.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from xml.parsers import expat

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.text import MAX_DEPTH, MAX_NUMBER, clip, read_text
from regionik.worlds.toolpath import rotation_from_quaternion

MAX_NAME_LENGTH = 120
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
ORIGIN = ("xyz", "rpy", "quat_xyzw")
_ZERO = (0.0, 0.0, 0.0)
_NAMES = {"name", "id"}  # on any element, they say nothing


@dataclass(frozen=True)
class Element:
    """One element of an XML file."""

    tag: str
    attributes: dict[str, str]
    line: int  # where it begins in its file, from 1
    children: list[Element] = field(default_factory=list)
    # text between its tags and those of its children, in pieces
    texts: list[str] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[Element]:
        """Return the children with this tag, in order."""
        return (child for child in self.children if child.tag == tag)

    def inside(self, *tags: str) -> list[Element]:
        """Return the descendants at a path of tags, in order."""
        found = [self]
        for tag in tags:
            found = [child for element in found for child in element.all(tag)]
        return found

    def first(self, tag: str) -> Element | None:
        """Return the first child with this tag, or None."""
        return next(self.all(tag), None)

    def error(self, text: str) -> InputError:
        """Return an error that names the line of this element; `located` puts the file before it."""
        return InputError(f"line {self.line}: {text}")


def read_xml(path: Path, first: str) -> Element:
    """Return the root element of an XML file in UTF-8, whose tag is ``first``."""
    text = read_text(path)
    with located(str(path), ""):
        root = _TreeBuilder().parse(text)
        if root.tag != first:
            raise root.error(f"expected <{first}> as first element, got <{clip(root.tag)[1:-1]}>")
    return root


class _TreeBuilder:
    """Builds the tree of elements as the parser meets them."""

    def __init__(self) -> None:
        self.parser = parser = expat.ParserCreate()
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler = self._refuse_doctype
        self.top = Element("", {}, 0)
        self.open = [self.top]

    def parse(self, text: str) -> Element:
        try:
            self.parser.Parse(text, True)
        except expat.ExpatError as error:
            what = expat.ErrorString(error.code)
            raise InputError(f"line {error.lineno}: not valid XML: {what}") from None
        return self.top.children[0]

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, self.parser.CurrentLineNumber)
        if len(self.open) > MAX_DEPTH:
            raise element.error(f"expected at most {MAX_DEPTH} levels of nesting")
        self.open[-1].children.append(element)
        self.open.append(element)

    def _text(self, piece: str) -> None:
        if not piece.isspace():
            self.open[-1].texts.append(piece)

    def _end(self, _tag: str) -> None:
        self.open.pop()

    def _refuse_doctype(self, name: str, _system: str | None, _public: str | None, _inner: int) -> None:
        advice = f"leave out <!DOCTYPE {clip(name)} ...>"
        line = self.parser.CurrentLineNumber
        raise InputError(f"line {line}: document types and entities are not supported, {advice}")


# --- attributes; messages begin with the place


def name_of(element: Element, what: str) -> str:
    """Return the name of an element, printable on one line."""
    name = element.attributes.get("name", "").strip()
    if not name or not name.isprintable() or len(name) > MAX_NAME_LENGTH:
        text = f"expected a name of at most {MAX_NAME_LENGTH} printable characters, got {clip(name)}"
        raise InputError(f"line {element.line}: {what}: {text}")
    return name


def numbers(element: Element | None, key: str, place: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """Return the numbers of an attribute; the default where there is none."""
    text = None if element is None else element.attributes.get(key)
    if element is None or text is None:
        return default
    return finite_numbers(text, len(default), f"{place}: {element.tag} {key}")


def finite_numbers(text: str, count: int, place: str) -> tuple[float, ...]:
    """Return exactly ``count`` finite numbers, small enough to square."""
    words = text.split()
    plain = len(words) == count and all(NUMBER.fullmatch(word) for word in words)
    values = tuple(float(word) for word in words) if plain else ()
    if not plain or not all(isfinite(value) and abs(value) <= MAX_NUMBER for value in values):
        many = "one finite number" if count == 1 else f"{count} finite numbers"
        raise InputError(f"{place}: expected {many} of at most {MAX_NUMBER:g} in size, got {clip(text)}")
    return values


def refuse_others(element: Element | None, known: Collection[str], place: str) -> None:
    """Refuse attributes that may change where or how large something is, and are not known.

    Those of other namespaces are for other tools.
    """
    for key in () if element is None else element.attributes:
        if key not in known and key not in _NAMES and ":" not in key and element is not None:
            valid = ", ".join(known)
            raise InputError(f"{place}: {element.tag}: unknown attribute {clip(key)}, valid ones: {valid}")


def origin(element: Element, place: str) -> Array:
    """Return the transform of an element's <origin>, (4, 4): by rpy, or by quat_xyzw of URDF 1.1."""
    given = element.first("origin")
    refuse_others(given, ORIGIN, place)
    T = pose(numbers(given, "xyz", place, _ZERO), numbers(given, "rpy", place, _ZERO))
    if given is not None and "quat_xyzw" in given.attributes:
        if "rpy" in given.attributes:
            raise InputError(f"{place}: origin: expected one of rpy, quat_xyzw")
        with located("", f"{place}: origin quat_xyzw"):
            T[:3, :3] = rotation_from_quaternion(numbers(given, "quat_xyzw", "", (*_ZERO, 1.0)))
    return T
