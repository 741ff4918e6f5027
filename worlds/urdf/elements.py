"""URDF files as values: links with their collision shapes and masses, and joints."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Literal

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, located, located_error
from regionik.worlds.joints import Mimic
from regionik.worlds.readers.text import clip, join_names
from regionik.worlds.readers.xml import (
    NUMBER,
    ORIGIN,
    Element,
    finite_numbers,
    name_of,
    numbers,
    origin,
    read_xml,
    refuse_others,
)

SUFFIXES = (".urdf", ".xml")
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
NO_LIMIT = 1e6  # URDF demands numbers; files without a limit give one of this size
_INFINITY = re.compile(r"[-+]?inf(?:inity)?", re.ASCII | re.IGNORECASE)

ShapeKind = Literal["box", "cylinder", "sphere", "capsule", "mesh"]
_SIZES: dict[ShapeKind, tuple[str, ...]] = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "mesh": ("scale",),
}


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """A collision or visual element of a link."""

    kind: ShapeKind
    T_link_shape: Array  # (4, 4)
    # box: x, y, z; cylinder: radius, length (along z); sphere: radius; capsule: radius, length without its
    # round ends (along z) [m]; mesh: scale along x, y, z
    size: tuple[float, ...]
    file: str  # file name of the mesh
    place: str  # place in the file, for messages


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint between two links."""

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: Array  # (4, 4)
    axis: Array  # (3,) in the joint's frame, of any length but zero
    lower: float | None  # [rad] or [m]; None where the file gives none, infinite where there is no limit
    upper: float | None
    velocity: float  # [rad/s] or [m/s]; infinite where there is no limit
    acceleration: float  # the lesser of speeding up and slowing down; infinite where there is no limit
    jerk: float  # infinite where there is no limit
    mimic: Mimic | None  # the joint that it copies
    place: str  # place in the file, for messages


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass of a link and how it is spread."""

    mass: float  # [kg]
    T_link_inertial: Array  # (4, 4) frame in the centre of mass
    tensor: Array  # (3, 3) moments of inertia in that frame, zero where the file gives none [kg m2]


@dataclass(frozen=True)
class UrdfModel:
    """Contents of a URDF file that regionik uses."""

    path: Path
    name: str  # of the robot
    links: dict[str, tuple[CollisionShape, ...]]  # collision shapes of each link, by its name
    joints: tuple[UrdfJoint, ...]  # in the order of the file; each name and each child once, every link known
    # what is seen of each link, with its colour where the file gives one (0xRRGGBB)
    visuals: dict[str, tuple[tuple[CollisionShape, int | None], ...]]
    inertials: dict[str, Inertial]  # of each link that has a mass, by its name

    @property
    def where(self) -> str:
        """Name of the file in messages."""
        return str(self.path)

    def check_link(self, name: str, what: str) -> None:
        """Refuse the name of a link that is not there."""
        if name not in self.links:
            text = f"unknown link {name!r}, valid links: {join_names(self.links)}"
            raise located_error(self.where, what, text)

    def without_shapes(self, ignored: Sequence[str]) -> UrdfModel:
        """Return the model without the collision shapes of some links."""
        for k, name in enumerate(ignored):
            self.check_link(name, f"ignore[{k}]")
        return replace(self, links={**self.links, **dict.fromkeys(ignored, ())})


def read_urdf(path: Path) -> UrdfModel:
    """Return links, joints and shapes of a URDF file."""
    if path.suffix.lower() == ".xacro":
        raise located_error(str(path), "", _expand_xacro(path))
    if path.suffix.lower() not in SUFFIXES:
        raise located_error(str(path), "", f"expected a file that ends in {', '.join(SUFFIXES)}")
    root = read_xml(path, "robot")
    with located(str(path), ""):
        _refuse_xacro(root, path)
        return _model(root, path)


def _expand_xacro(path: Path) -> str:
    stem = path.name.removesuffix(".xacro").removesuffix(".urdf")
    target = f"{stem}.urdf" if f"{stem}.urdf" != path.name else f"{stem}.expanded.urdf"
    command = f"xacro {shlex.quote(path.name)} > {shlex.quote(target)}"
    return f"xacro is not supported, expand it first: {command} (pip install xacro)"


def _refuse_xacro(root: Element, path: Path) -> None:
    """Refuse macros, which an expanded file has none of (it may still name their namespace)."""
    stack = [root]
    while stack:
        element = stack.pop()
        if element.tag.startswith("xacro:") or any("${" in text for text in element.attributes.values()):
            raise element.error(_expand_xacro(path))
        stack += reversed(element.children)


# Below, messages begin with the line; `read_urdf` puts the file before it.


def _model(root: Element, path: Path) -> UrdfModel:
    name = name_of(root, "robot")
    links: dict[str, tuple[CollisionShape, ...]] = {}
    inertials: dict[str, Inertial] = {}
    visuals: dict[str, tuple[tuple[CollisionShape, int | None], ...]] = {}
    palette = _palette(root.all("material"))
    for element in root.all("link"):
        link = name_of(element, "link")
        place = f"line {element.line}: link {link}"
        if link in links:
            raise InputError(f"{place}: this name is given twice")
        shapes = (_shape(solid, link) for solid in element.all("collision"))
        links[link] = tuple(shape for shape in shapes if shape is not None)
        visuals[link] = tuple(_visuals(element, link, palette))
        inertial = _inertial(element.first("inertial"), link)
        if inertial is not None:
            inertials[link] = inertial
    joints = tuple(_joint(element) for element in root.all("joint"))
    _check_joints(joints, links)
    return UrdfModel(path, name, links, joints, visuals, inertials)


def _visuals(
    link: Element, name: str, palette: dict[str, int]
) -> Iterator[tuple[CollisionShape, int | None]]:
    """Yield what is seen of a link and can be read: pictures do without the rest."""
    for element in link.all("visual"):
        material = next(element.all("material"), None)
        named = {} if material is None else {**palette, **_palette([material])}
        refuse_others(element.first("origin"), ORIGIN, f"line {element.line}: link {name}")
        with suppress(InputError):
            shape = _shape(element, name)
            if shape is not None:
                yield shape, named.get("" if material is None else material.attributes.get("name", ""))


def _palette(materials: Iterable[Element]) -> dict[str, int]:
    """Return the colour of each material that gives one, by its name."""
    found = {}
    for material in materials:
        with suppress(InputError):
            color = numbers(material.first("color"), "rgba", "", (-1.0, 0.0, 0.0, 0.0))
            if color[0] >= 0:
                red, green, blue = (np.clip(color[:3], 0, 1) * 255).round().astype(int).tolist()
                found[material.attributes.get("name", "")] = red << 16 | green << 8 | blue
    return found


def _check_joints(joints: tuple[UrdfJoint, ...], links: dict[str, tuple[CollisionShape, ...]]) -> None:
    """Refuse names given twice, unknown links, and links with two parents."""
    above: dict[str, str] = {}
    names: set[str] = set()
    for joint in joints:
        if joint.name in names:
            raise InputError(f"{joint.place}: this name is given twice")
        names.add(joint.name)
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                text = f"unknown {role} link {link!r}, valid links: {join_names(links)}"
                raise InputError(f"{joint.place}: {text}")
        if joint.child in above:
            text = f"link {joint.child} is already the child of joint {above[joint.child]}"
            raise InputError(f"{joint.place}: {text}: expected one parent")
        above[joint.child] = joint.name
    for joint in joints:
        if joint.mimic is not None and joint.mimic.joint not in names:
            text = f"mimic: unknown joint {joint.mimic.joint!r}, valid joints: {join_names(names)}"
            raise InputError(f"{joint.place}: {text}")


def _joint(element: Element) -> UrdfJoint:
    name = name_of(element, "joint")
    place = f"line {element.line}: joint {name}"
    kind = element.attributes.get("type", "")
    if kind not in JOINT_TYPES:
        raise InputError(f"{place}: unknown type {clip(kind)}, valid types: {', '.join(JOINT_TYPES)}")
    refuse_others(element.first("axis"), ("xyz",), place)
    axis = numbers(element.first("axis"), "xyz", place, (1.0, 0.0, 0.0))
    if kind != "fixed" and max(map(abs, axis)) < 1e-9:
        raise InputError(f"{place}: axis must not be zero")
    lower, upper = _limits(element, kind, place)
    acceleration = min(_rate(element, key, place) for key in ("acceleration", "deceleration"))
    return UrdfJoint(
        name=name,
        kind=kind,
        parent=_link_of(element, "parent", place),
        child=_link_of(element, "child", place),
        T_parent_joint=origin(element, place),
        axis=np.array(axis),
        lower=lower,
        upper=upper,
        velocity=_rate(element, "velocity", place),
        acceleration=acceleration,
        jerk=_rate(element, "jerk", place),
        mimic=_mimic(element.first("mimic"), place),
        place=place,
    )


def _mimic(element: Element | None, place: str) -> Mimic | None:
    if element is None:
        return None
    refuse_others(element, ("joint", "multiplier", "offset"), place)
    multiplier, offset = (
        numbers(element, key, place, (default,))[0] for key, default in (("multiplier", 1.0), ("offset", 0.0))
    )
    with located("", place):
        return Mimic(element.attributes.get("joint", ""), multiplier, offset)


def _limits(element: Element, kind: str, place: str) -> tuple[float | None, float | None]:
    if kind == "continuous":
        return -inf, inf
    lower, upper = (_limit(element, key, place) for key in ("lower", "upper"))
    lower, upper = _softened(element, lower, upper, place)
    if lower is not None and upper is not None and lower > upper:
        raise InputError(f"{place}: expected lower limit <= upper limit, got {lower:g} and {upper:g}")
    if upper == -inf:
        raise InputError(f"{place}: limit upper: expected a number above {-NO_LIMIT:g}")
    if lower == inf:
        raise InputError(f"{place}: limit lower: expected a number below {NO_LIMIT:g}")
    return lower, upper


def _softened(
    element: Element, lower: float | None, upper: float | None, place: str
) -> tuple[float | None, float | None]:
    """Return limits within the soft ones of <safety_controller>, where it gives any: a drive stops there.

    A range from 0 to 0 is what files give that know of none.
    """
    soft_lower, soft_upper = (
        _limit(element, f"soft_{side}_limit", place, "safety_controller") for side in ("lower", "upper")
    )
    if soft_lower == soft_upper == 0:
        return lower, upper
    if soft_lower is not None:
        lower = soft_lower if lower is None else max(lower, soft_lower)
    if soft_upper is not None:
        upper = soft_upper if upper is None else min(upper, soft_upper)
    return lower, upper


def _rate(element: Element, key: str, place: str) -> float:
    """Return a limit of speed, acceleration or jerk; files that know of none say 0."""
    value = _limit(element, key, place)
    if value is not None and value < 0:
        raise InputError(f"{place}: {key} must not be below 0, got {value:g}")
    return value or inf


def _limit(element: Element, key: str, place: str, tag: str = "limit") -> float | None:
    """Return an attribute of <limit>; infinite from `NO_LIMIT` on."""
    limit = element.first(tag)
    text = None if limit is None else limit.attributes.get(key)
    if text is None:
        return None
    text = text.strip()
    if not NUMBER.fullmatch(text) and not _INFINITY.fullmatch(text):
        raise InputError(f"{place}: {tag} {key}: expected a number, got {clip(text)}")
    value = float(text)
    return value if abs(value) < NO_LIMIT else inf if value > 0 else -inf


def _inertial(element: Element | None, link: str) -> Inertial | None:
    """Return mass and moments of inertia; None where the file gives no mass, or zero."""
    if element is None:
        return None
    place = f"line {element.line}: link {link}"
    (mass,) = numbers(element.first("mass"), "value", place, (0.0,))
    if mass < 0:
        raise InputError(f"{place}: mass must not be below 0, got {mass:g}")
    if not mass:
        return None
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (numbers(element.first("inertia"), key, place, (0.0,))[0] for key in keys)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Inertial(mass, origin(element, place), tensor)


def _shape(element: Element, link: str) -> CollisionShape | None:
    """Return a collision element; None for a box of no size at all, which some files have in a bare link."""
    place = f"line {element.line}: link {link}"
    geometry = element.first("geometry")
    found = [] if geometry is None else geometry.children
    kind: ShapeKind | None = next((k for k in _SIZES if [child.tag for child in found] == [k]), None)
    if kind is None:
        got = ", ".join(f"<{clip(child.tag)[1:-1]}>" for child in found[:3]) or "nothing"
        raise InputError(f"{place}: collision geometry: expected one of {', '.join(_SIZES)}, got {got}")
    T = origin(element, place)
    inner = found[0]
    refuse_others(inner, ("filename", "scale") if kind == "mesh" else _SIZES[kind], place)
    if kind == "mesh":
        return _mesh(inner, T, place)
    size: tuple[float, ...] = ()
    for key in _SIZES[kind]:
        count = 3 if kind == "box" else 1
        size += finite_numbers(inner.attributes.get(key, ""), count, f"{place}: {kind} {key}")
    if kind == "box" and not any(size):
        return None
    if not min(size) > 0:
        got = join_names(f"{s:g}" for s in size)
        raise InputError(f"{place}: {kind}: every size must be above 0, got {got}")
    return CollisionShape(kind, T, size, "", place)


def _mesh(element: Element, T: Array, place: str) -> CollisionShape:
    scale = element.attributes.get("scale", "1 1 1")
    factors = finite_numbers(scale * 3 if len(scale.split()) == 1 else scale, 3, f"{place}: mesh scale")
    file = element.attributes.get("filename", "").strip()
    if not file or not file.isprintable():
        raise InputError(f"{place}: mesh: expected a filename, got {clip(file)}")
    if 0 in factors:
        raise InputError(f"{place}: mesh scale must not be zero")
    return CollisionShape("mesh", T, factors, file, place)


def _link_of(element: Element, role: str, place: str) -> str:
    """Return the link at one end of a joint."""
    end = element.first(role)
    link = "" if end is None else end.attributes.get("link", "")
    if not link:
        raise InputError(f'{place}: expected <{role} link="..."/>')
    return link
