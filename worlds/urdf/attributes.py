"""Attributes of URDF elements: names, numbers and origins; messages begin with the place."""

from __future__ import annotations

import re
from collections.abc import Collection
from math import isfinite

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.text import LARGEST, Element, clip
from regionik.worlds.toolpath import rotation_from_quaternion

_NAME_LIMIT = 120
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
ORIGIN = ("xyz", "rpy", "quat_xyzw")
_ZERO = (0.0, 0.0, 0.0)
_NAMES = {"name", "id"}  # on any element, they say nothing


def name_of(element: Element, what: str) -> str:
    """Return the name of an element, printable on one line."""
    name = element.attributes.get("name", "").strip()
    if not name or not name.isprintable() or len(name) > _NAME_LIMIT:
        text = f"expected a name of at most {_NAME_LIMIT} printable characters, got {clip(name)}"
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
    if not plain or not all(isfinite(value) and abs(value) <= LARGEST for value in values):
        many = "one finite number" if count == 1 else f"{count} finite numbers"
        raise InputError(f"{place}: expected {many} of at most {LARGEST:g} in size, got {clip(text)}")
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
