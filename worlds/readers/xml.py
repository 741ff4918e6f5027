"""XML files as trees of elements, read within bounds.

Nothing is fetched, expanded or executed: a document type declaration, which defines entities, is refused, and
size, depth and the number of elements are bounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from regionik.worlds.errors import located_error
from regionik.worlds.readers.text import DEPTH_LIMIT, clip, read_text

XML_LIMIT = 16 * 2**20  # [bytes]
ELEMENT_LIMIT = 100_000
ATTRIBUTE_LIMIT = 150_000  # as the parser's time grows with the square of their number in one element


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


def read_xml(path: Path, limit: int = XML_LIMIT) -> Element:
    """Return the root element of an XML file in UTF-8 of at most ``limit`` bytes.

    Raises
    ------
    InputError
        One line: the file, the line in it where known, and what was expected.
    """
    text, where = read_text(path, limit), str(path)
    if text.count("=") > ATTRIBUTE_LIMIT:
        raise located_error(where, "", f"expected at most {ATTRIBUTE_LIMIT} attributes")
    parser = expat.ParserCreate()
    builder = _Builder(parser, where)
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.text
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = builder.refuse_doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        what = expat.ErrorString(error.code)
        raise located_error(where, f"line {error.lineno}", f"not valid XML: {what}") from None
    return builder.top.children[0]


class _Builder:
    """Builds the tree of elements as the parser meets them."""

    def __init__(self, parser: expat.XMLParserType, where: str) -> None:
        self.parser = parser
        self.where = where
        self.top = Element("", {}, 0)
        self.open = [self.top]
        self.count = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self.count += 1
        if self.count > ELEMENT_LIMIT:
            raise located_error(self.where, f"line {line}", f"expected at most {ELEMENT_LIMIT} elements")
        if len(self.open) > DEPTH_LIMIT:
            raise located_error(
                self.where, f"line {line}", f"expected at most {DEPTH_LIMIT} levels of nesting"
            )
        element = Element(tag, attributes, line)
        self.open[-1].children.append(element)
        self.open.append(element)

    def text(self, piece: str) -> None:
        if not piece.isspace():
            self.open[-1].texts.append(piece)

    def end(self, _tag: str) -> None:
        self.open.pop()

    def refuse_doctype(self, name: str, _system: str | None, _public: str | None, _inner: int) -> None:
        line = f"line {self.parser.CurrentLineNumber}"
        raise located_error(
            self.where,
            line,
            f"document types and entities are not supported, leave out <!DOCTYPE {clip(name)} ...>",
        )
