"""Names, numbers and frames in the attributes of a URDF file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import isfinite

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.readers.checking import LARGEST, wrong
from regionik.worlds.readers.textfile import clip
from regionik.worlds.readers.xmlfile import Element

_NAME_LIMIT = 120
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)


def listed(names: Iterable[str], most: int = 60) -> str:
    """Names for a message, the first ones where there are many."""
    known = list(names)
    rest = len(known) - most
    return ", ".join(known[:most]) + (f" and {rest} more" if rest > 0 else "")


def origin_of(element: Element, where: str, place: str) -> Array:
    """Where an element's <origin> puts it, (4, 4)."""
    origin = element.first("origin")
    zero = (0.0, 0.0, 0.0)
    return pose(numbers_in(origin, "xyz", where, place, zero), numbers_in(origin, "rpy", where, place, zero))


def end_of(element: Element, role: str, where: str, place: str) -> str:
    """The link at one end of a joint."""
    end = element.first(role)
    link = "" if end is None else end.attributes.get("link", "")
    if not link:
        raise wrong(where, place, f'expected <{role} link="..."/>')
    return link


def name_of(element: Element, where: str, what: str) -> str:
    """The name of an element, printable on one line."""
    name = element.attributes.get("name", "").strip()
    if not name or not name.isprintable() or len(name) > _NAME_LIMIT:
        text = f"expected a name of at most {_NAME_LIMIT} printable characters, got {clip(name)}"
        raise wrong(where, f"line {element.line}: {what}", text)
    return name


def numbers_in(
    element: Element | None, key: str, where: str, place: str, default: tuple[float, ...]
) -> tuple[float, ...]:
    """Numbers of an element's attribute; the default where it has none."""
    text = None if element is None else element.attributes.get(key)
    if element is None or text is None:
        return default
    return values_in(text, len(default), where, f"{place}: {element.tag} {key}")


def values_in(text: str, count: int, where: str, place: str) -> tuple[float, ...]:
    """Exactly ``count`` finite numbers of a size that squares of them can bear."""
    words = text.split()
    plain = len(words) == count and all(NUMBER.fullmatch(word) for word in words)
    values = tuple(float(word) for word in words) if plain else ()
    if not plain or not all(isfinite(value) and abs(value) <= LARGEST for value in values):
        many = "one finite number" if count == 1 else f"{count} finite numbers"
        raise wrong(where, place, f"expected {many} of at most {LARGEST:g} in size, got {clip(text)}")
    return values
