"""Names, numbers and frames in the attributes of a URDF file."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Literal

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.errors import InputError
from regionik.worlds.readers.text import clip
from regionik.worlds.readers.validation import LARGEST, wrong
from regionik.worlds.readers.xml import Element, read_xml

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


SUFFIXES = (".urdf", ".xml")
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
NO_LIMIT = 1e6  # URDF demands numbers where there is no limit; who needs one writes such a number
SOLID_LIMIT = 1000
LINK_LIMIT = 4000
_ENDLESS = re.compile(r"[-+]?inf(?:inity)?", re.ASCII | re.IGNORECASE)

ShapeKind = Literal["box", "cylinder", "sphere", "mesh"]
_SIZES: dict[ShapeKind, tuple[str, ...]] = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("scale",),
}


@dataclass(frozen=True, eq=False)
class Shape:
    """A collision solid as its link carries it.

    Attributes
    ----------
    kind : {"box", "cylinder", "sphere", "mesh"}
    T_link_shape : (4, 4) array
    size : tuple of float
        Box: x, y, z; cylinder: radius, length (along z); sphere: radius [m]; mesh: scale along x, y, z.
    file : str
        What the file calls the mesh.
    place : str
        Where it stands in the file, for messages.
    """

    kind: ShapeKind
    T_link_shape: Array
    size: tuple[float, ...]
    file: str
    place: str


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint between two links.

    Attributes
    ----------
    name, kind, parent, child : str
    T_parent_joint : (4, 4) array
    axis : (3,) array
        In the joint's frame, of any length but zero.
    lower, upper : float or None
        [rad] or [m]; None where the file gives none, infinite where there is no limit.
    velocity : float
        [rad/s] or [m/s]; infinite where there is no limit.
    mimic : str or None
        The joint that it copies.
    offset : float
        Its value where that joint is at zero.
    place : str
        Where it stands in the file, for messages.
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: Array
    axis: Array
    lower: float | None
    upper: float | None
    velocity: float
    mimic: str | None
    offset: float
    place: str


@dataclass(frozen=True)
class UrdfFile:
    """Everything of a URDF file that regionik uses.

    Attributes
    ----------
    path : Path
    name : str
        The robot's.
    links : dict
        The shapes of each link, by its name.
    joints : tuple of TreeJoint
        In the order of the file; each name and each child once, every link known.
    inertials : dict
        Mass [kg] and its centre (3,) [m] of each link that has any, by its name.
    """

    path: Path
    name: str
    links: dict[str, tuple[Shape, ...]]
    joints: tuple[TreeJoint, ...]
    inertials: dict[str, tuple[float, Array]]

    @property
    def where(self) -> str:
        return str(self.path)


def read_urdf(path: Path) -> UrdfFile:
    """Links, joints and shapes of a URDF file.

    Raises
    ------
    InputError
        One line: the file, the line in it, what was expected and the valid choices.
    """
    where = str(path)
    if path.suffix.lower() == ".xacro":
        raise _xacro(path, "")
    if path.suffix.lower() not in SUFFIXES:
        raise wrong(where, "", f"expected a file that ends in {', '.join(SUFFIXES)}")
    root = read_xml(path)
    if root.tag != "robot":
        raise wrong(
            where, f"line {root.line}", f"expected <robot> as first element, got <{clip(root.tag)[1:-1]}>"
        )
    _refuse_xacro(root, path)
    name = name_of(root, where, "robot")
    links: dict[str, tuple[Shape, ...]] = {}
    inertials: dict[str, tuple[float, Array]] = {}
    for element in root.all("link"):
        link = name_of(element, where, "link")
        if link in links:
            raise wrong(where, f"line {element.line}: link {link}", "this name is given twice")
        links[link] = tuple(_shape(solid, where, link) for solid in element.all("collision"))
        weight = _inertial(element.first("inertial"), where, link)
        if weight is not None:
            inertials[link] = weight
    if len(links) > LINK_LIMIT:
        raise wrong(where, "", f"expected at most {LINK_LIMIT} links, got {len(links)}")
    if sum(map(len, links.values())) > SOLID_LIMIT:
        raise wrong(where, "", f"expected at most {SOLID_LIMIT} collision elements")
    joints = tuple(_joint(element, where) for element in root.all("joint"))
    _check_joints(joints, links, where)
    return UrdfFile(path, name, links, joints, inertials)


def _xacro(path: Path, place: str) -> InputError:
    stem = path.name.removesuffix(".xacro").removesuffix(".urdf")
    target = f"{stem}.urdf" if f"{stem}.urdf" != path.name else f"{stem}.expanded.urdf"
    command = f"xacro {shlex.quote(path.name)} > {shlex.quote(target)}"
    return wrong(str(path), place, f"xacro is not read, expand it first: {command}")


def _refuse_xacro(root: Element, path: Path) -> None:
    """Refuse macros, which an expanded file has none of (it may still name their namespace)."""
    stack = [root]
    while stack:
        element = stack.pop()
        if element.tag.startswith("xacro:") or any("${" in text for text in element.attributes.values()):
            raise _xacro(path, f"line {element.line}")
        stack += reversed(element.children)


def _check_joints(joints: tuple[TreeJoint, ...], links: dict[str, tuple[Shape, ...]], where: str) -> None:
    """Refuse names given twice, unknown links, and links with two parents."""
    above: dict[str, str] = {}
    names: set[str] = set()
    for joint in joints:
        if joint.name in names:
            raise wrong(where, joint.place, "this name is given twice")
        names.add(joint.name)
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise wrong(where, joint.place, f"unknown {role} link {link!r}, valid links: {listed(links)}")
        if joint.child in above:
            other = above[joint.child]
            raise wrong(
                where,
                joint.place,
                f"link {joint.child} is already the child of joint {other}: expected one parent",
            )
        above[joint.child] = joint.name
    for joint in joints:
        if joint.mimic is not None and joint.mimic not in names:
            text = f"mimic: unknown joint {joint.mimic!r}, valid joints: {listed(names)}"
            raise wrong(where, joint.place, text)


# --- elements


def _joint(element: Element, where: str) -> TreeJoint:
    name = name_of(element, where, "joint")
    place = f"line {element.line}: joint {name}"
    kind = element.attributes.get("type", "")
    if kind not in JOINT_TYPES:
        raise wrong(where, place, f"unknown type {clip(kind)}, valid types: {', '.join(JOINT_TYPES)}")
    axis = numbers_in(element.first("axis"), "xyz", where, place, (1.0, 0.0, 0.0))
    if kind != "fixed" and max(map(abs, axis)) < 1e-9:
        raise wrong(where, place, "axis must not be zero")
    lower, upper = _limits(element, kind, where, place)
    velocity = _limit(element, "velocity", where, place)
    if velocity is not None and velocity < 0:
        raise wrong(where, place, f"velocity must not be below 0, got {velocity:g}")
    copied = element.first("mimic")
    return TreeJoint(
        name=name,
        kind=kind,
        parent=end_of(element, "parent", where, place),
        child=end_of(element, "child", where, place),
        T_parent_joint=origin_of(element, where, place),
        axis=np.array(axis),
        lower=lower,
        upper=upper,
        velocity=velocity or inf,  # 0 is what files say that know of none
        mimic=None if copied is None else copied.attributes.get("joint", ""),
        offset=numbers_in(copied, "offset", where, place, (0.0,))[0],
        place=place,
    )


def _inertial(element: Element | None, where: str, link: str) -> tuple[float, Array] | None:
    """Mass and centre; None where the file gives no mass, or zero."""
    if element is None:
        return None
    place = f"line {element.line}: link {link}"
    (mass,) = numbers_in(element.first("mass"), "value", where, place, (0.0,))
    if mass < 0:
        raise wrong(where, place, f"mass must not be below 0, got {mass:g}")
    return (mass, origin_of(element, where, place)[:3, 3]) if mass > 0 else None


def _limits(element: Element, kind: str, where: str, place: str) -> tuple[float | None, float | None]:
    if kind == "continuous":
        return -inf, inf
    lower, upper = (_limit(element, key, where, place) for key in ("lower", "upper"))
    if lower is not None and upper is not None and lower > upper:
        raise wrong(where, place, f"expected lower limit <= upper limit, got {lower:g} and {upper:g}")
    if lower == inf or upper == -inf:
        wanted = f"lower: expected a number below {NO_LIMIT:g}"
        if upper == -inf:
            wanted = f"upper: expected a number above {-NO_LIMIT:g}"
        raise wrong(where, place, f"limit {wanted}")
    return lower, upper


def _limit(element: Element, key: str, where: str, place: str) -> float | None:
    """An attribute of <limit>; infinite from `NO_LIMIT` on."""
    limit = element.first("limit")
    text = None if limit is None else limit.attributes.get(key)
    if text is None:
        return None
    text = text.strip()
    if not NUMBER.fullmatch(text) and not _ENDLESS.fullmatch(text):
        raise wrong(where, place, f"limit {key}: expected a number, got {clip(text)}")
    value = float(text)
    return value if abs(value) < NO_LIMIT else inf if value > 0 else -inf


def _shape(element: Element, where: str, link: str) -> Shape:
    place = f"line {element.line}: link {link}"
    geometry = element.first("geometry")
    found = [] if geometry is None else geometry.children
    kind: ShapeKind | None = next((k for k in _SIZES if [child.tag for child in found] == [k]), None)
    if kind is None:
        got = ", ".join(f"<{clip(child.tag)[1:-1]}>" for child in found[:3]) or "nothing"
        raise wrong(where, place, f"collision geometry: expected one of {', '.join(_SIZES)}, got {got}")
    T = origin_of(element, where, place)
    inner = found[0]
    if kind == "mesh":
        scale = inner.attributes.get("scale", "1 1 1")
        each = values_in(scale * 3 if len(scale.split()) == 1 else scale, 3, where, f"{place}: mesh scale")
        file = inner.attributes.get("filename", "").strip()
        if not file or not file.isprintable():
            raise wrong(where, place, f"mesh: expected a filename, got {clip(file)}")
        if 0 in each:
            raise wrong(where, place, "mesh scale must not be zero")
        return Shape(kind, T, each, file, place)
    size: tuple[float, ...] = ()
    for key in _SIZES[kind]:
        what = f"{place}: {kind} {key}"
        size += values_in(inner.attributes.get(key, ""), 3 if kind == "box" else 1, where, what)
    if not min(size) > 0:
        raise wrong(where, place, f"{kind}: every size must be above 0, got {listed(f'{s:g}' for s in size)}")
    return Shape(kind, T, size, "", place)
