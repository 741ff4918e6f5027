"""YAML, JSON and XML files, read within bounds of size, depth and count.

YAML is read by the core schema of YAML 1.2 (``1e-3`` is a number and ``no`` is a word), without aliases,
tags or duplicate keys. Of XML nothing is fetched, expanded or executed: a document type declaration, which
defines entities, is refused.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import yaml

from regionik.worlds.errors import InputError, located

JSON_LIMIT = 64 * 2**20  # [bytes]
YAML_LIMIT = 16 * 2**20  # [bytes]
DEPTH_LIMIT = 40
VALUES_LIMIT = 2_000_000  # of a JSON file
EVENTS_LIMIT = 400_000  # of a YAML file, which is read far more slowly: values, and both ends of lists
XML_LIMIT = 16 * 2**20  # [bytes]
ELEMENT_LIMIT = 100_000  # of an XML file
LINES_LIMIT = 1_000_000  # of a table or a program that is read at once
ATTRIBUTE_LIMIT = 150_000  # as the parser's time grows with the square of their number in one element
SUFFIXES = (".yaml", ".yml", ".json")
LARGEST = 1e9  # any length, angle or count in a file is smaller: squares and sums must not overflow

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_Base):  # type: ignore[misc]
    """Safe loader with the scalars of YAML 1.2 only."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(problem="a key must be plain text", problem_mark=key.start_mark)
            if key.value in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"key {key.value!r} is given twice", problem_mark=key.start_mark
                )
            seen.add(key.value)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


for _tag, _pattern, _first in (
    ("null", r"~|null|", ["~", "n", ""]),
    ("bool", r"true|false", ["t", "f"]),
    ("int", r"[-+]?(?:0|[1-9][0-9]*)", list("-+0123456789")),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", list("-+.")),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def name_as_text(name: str) -> str:
    """Return a file's name as one line of text; what the locale does not know of it is read as UTF-8."""
    text = name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    return re.sub(r"[\x00-\x1f]", " ", text)


def file_in(folder: Path, name: str) -> Path:
    """Return the path of a file that a document names, as it is called where the locale is not UTF-8 too."""
    return folder / os.fsdecode(name.encode("utf-8", "surrogateescape"))


@contextmanager
def reading(path: Path, limit: int | None = None) -> Iterator[None]:
    """Turn what keeps a file of at most ``limit`` bytes from being read into an `InputError`.

    Folders, devices and pipes, which may have no end, are refused.
    """
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: cannot be read: expected a file, this is a folder, a device or a pipe")
        size = path.stat().st_size
        if limit is not None and size > limit:
            raise InputError(f"{path}: expected at most {limit / 2**20:g} MB, got {size / 2**20:.1f} MB")
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected UTF-8 text, byte {error.start} is not") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_text(path: Path, limit: int) -> str:
    """Return the text of a UTF-8 file of at most ``limit`` bytes."""
    with reading(path, limit):
        return path.read_text(encoding="utf-8-sig")


def read_lines(path: Path, limit: int) -> list[str]:
    """Return the lines of a UTF-8 file of at most ``limit`` bytes and `LINES_LIMIT` lines."""
    lines = read_text(path, limit).splitlines()
    if len(lines) > LINES_LIMIT:
        raise InputError(f"{path}: expected at most {LINES_LIMIT} lines, got {len(lines)}")
    return lines


def is_file_name(name_or_path: str | Path, suffixes: tuple[str, ...]) -> bool:
    """Return True for paths, and for text that is one: by its suffix, or as it names a folder."""
    text = str(name_or_path)
    return isinstance(name_or_path, Path) or text.lower().endswith(suffixes) or "/" in text or "\\" in text


def count_values(text: str | bytes) -> int:
    """Return about how many values JSON has, and at least as many."""
    data = text.encode() if isinstance(text, str) else text
    return sum(data.count(sign) for sign in (b",", b"[", b"{"))


def check_count(text: str | bytes, limit: int, where: str) -> None:
    """Refuse JSON of more values than fit into memory, before any of them is made."""
    count = count_values(text)
    if count > limit:
        raise InputError(f"{where}: expected at most {limit} values, got about {count}")


def read_document(path: Path) -> dict[str, Any]:
    """Return the keys and plain values of a YAML or JSON file."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a file that ends in {', '.join(SUFFIXES)}")
    where = str(path)
    if suffix == ".json":
        value = _json_value(read_text(path, JSON_LIMIT), where)
    else:
        value = _yaml_value(read_text(path, YAML_LIMIT), where)
    return plain_mapping(value, where)


def plain_mapping(value: Any, where: str) -> dict[str, Any]:
    """Return ``value`` itself, once it is known to be a mapping of plain values, none beyond `LARGEST`."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: expected a mapping of keys to values, got {clip(value)}")
    _plain(value, where, "", 0)
    return value


def clip(value: Any) -> str:
    """Return a short one-line form of a value for messages."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def join_names(names: Iterable[str], most: int = 60) -> str:
    """Return names for a message, only the first ``most`` where there are more."""
    known = list(names)
    rest = len(known) - most
    return ", ".join(known[:most]) + (f" and {rest} more" if rest > 0 else "")


def _plain(value: Any, where: str, place: str, depth: int) -> None:
    at = f"{where}: {place}" if place else where
    if depth > DEPTH_LIMIT:
        raise InputError(f"{where}: expected at most {DEPTH_LIMIT} levels of nesting")
    if isinstance(value, dict):
        for key, item in value.items():
            if not isinstance(key, str):
                raise InputError(f"{at}: expected text as key, got {clip(key)}")
            _plain(item, where, f"{place}.{key}" if place else key, depth + 1)
    elif isinstance(value, list):
        for k, item in enumerate(value):
            _plain(item, where, f"{place}[{k}]", depth + 1)
    elif isinstance(value, int | float):
        if not abs(value) <= LARGEST:
            raise InputError(
                f"{at}: expected a finite number of at most {LARGEST:g} in size, got {clip(value)}"
            )
    elif value is not None and not isinstance(value, str):
        raise InputError(f"{at}: expected numbers, text, lists and mappings, got {type(value).__name__}")


def _json_value(text: str, where: str) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        mapping = dict(pairs)
        if len(mapping) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in keys if keys.count(key) > 1)
            raise InputError(f"{where}: key {clip(twice)} is given twice")
        return mapping

    check_count(text, VALUES_LIMIT, where)
    try:
        return json.loads(text, object_pairs_hook=once)
    except json.JSONDecodeError as error:
        raise InputError(f"{where}: line {error.lineno}: not valid JSON: {error.msg}") from None
    except (RecursionError, ValueError):  # ValueError: a number of thousands of digits
        raise InputError(f"{where}: not valid JSON: nested too deeply, or a number is too long") from None


def _yaml_value(text: str, where: str) -> Any:
    try:
        _scan(text, where)
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f"line {mark.line + 1}: " if mark else ""
        raise InputError(f"{where}: {line}not valid YAML: {_flat(error.problem)}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{where}: not valid YAML: {_flat(error)}") from None
    except ValueError:  # a number of thousands of digits
        raise InputError(f"{where}: not valid YAML: a number is too long") from None


def _scan(text: str, where: str) -> None:
    """Refuse aliases, deep nesting and too many values before anything is built from them."""
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=_Base)):
        if count > EVENTS_LIMIT:
            what = f"expected at most {EVENTS_LIMIT} values and ends of lists; JSON may hold more"
            raise InputError(f"{where}: {what}")
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            mark = event.start_mark
            line = f"line {mark.line + 1}: " if mark else ""
            raise InputError(
                f"{where}: {line}YAML anchors and aliases are not supported, write the value out"
            )
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEPTH_LIMIT:
            raise InputError(f"{where}: expected at most {DEPTH_LIMIT} levels of nesting")


def _flat(value: object) -> str:
    return " ".join(str(value).split())


# --- XML


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


def read_xml(path: Path, limit: int = XML_LIMIT) -> Element:
    """Return the root element of an XML file in UTF-8 of at most ``limit`` bytes."""
    text = read_text(path, limit)
    with located(str(path), ""):
        if text.count("=") > ATTRIBUTE_LIMIT:
            raise InputError(f"expected at most {ATTRIBUTE_LIMIT} attributes")
        return _TreeBuilder().parse(text)


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
        self.count = 0

    def parse(self, text: str) -> Element:
        try:
            self.parser.Parse(text, True)
        except expat.ExpatError as error:
            what = expat.ErrorString(error.code)
            raise InputError(f"line {error.lineno}: not valid XML: {what}") from None
        return self.top.children[0]

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, self.parser.CurrentLineNumber)
        self.count += 1
        if self.count > ELEMENT_LIMIT:
            raise element.error(f"expected at most {ELEMENT_LIMIT} elements")
        if len(self.open) > DEPTH_LIMIT:
            raise element.error(f"expected at most {DEPTH_LIMIT} levels of nesting")
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
