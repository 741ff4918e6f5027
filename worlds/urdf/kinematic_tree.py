"""The tree of a URDF file: its root, the way from root to tip, and what every other link moves with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import Literal

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint, motion
from regionik.worlds.readers.validation import at, wrong
from regionik.worlds.robot import BASE, LinkMass
from regionik.worlds.urdf.collision import Placed
from regionik.worlds.urdf.elements import TreeJoint, UrdfFile, listed

_KINDS: dict[str, Literal["revolute", "prismatic"]] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}


@dataclass(frozen=True, eq=False)
class Route:
    """The way from a root link to a tip link.

    Attributes
    ----------
    root, tip : str
    joints : tuple of TreeJoint
        From root to tip, fixed ones included.
    """

    root: str
    tip: str
    joints: tuple[TreeJoint, ...]


@dataclass(frozen=True, eq=False)
class Parts:
    """What every link moves with.

    Attributes
    ----------
    placed : tuple of Placed
    left_out : tuple of str
        Joints of the base that the arm has not, whose links with solids are not placed.
    copies : tuple of str
        Joints that copy one of the arm's and are taken to stand still, with solids behind them.
    """

    placed: tuple[Placed, ...]
    left_out: tuple[str, ...]
    copies: tuple[str, ...]


def route_of(file: UrdfFile, root: str | None, tip: str | None) -> Route:
    """The way from ``root`` (the file's own by default) to ``tip`` (by default the end of the longest arm).

    Raises
    ------
    InputError
        When the links are no tree, a name is unknown, or nothing moves between the two; lists valid names.
    """
    top = _root(file)
    above = {joint.child: joint for joint in file.joints}
    _refuse_loops(file, above)
    for what, name in (("root", root), ("tip", tip)):
        if name is not None and name not in file.links:
            raise wrong(file.where, what, f"unknown link {name!r}, valid links: {listed(file.links)}")
    start = top if root is None else root
    end = _longest(file, above, start) if tip is None else tip
    route = _way(above, start, end)
    if route is None:
        upward = [joint.parent for joint in _way(above, top, end) or ()]
        text = f"link {end} does not hang on link {start}, valid roots: {listed(upward) or 'none'}"
        raise wrong(file.where, "tip", text)
    if not any(joint.kind != "fixed" for joint in route):
        moved = [link for link in file.links if _moving(_way(above, start, link) or ())]
        text = f"no joint moves between {start} and {end}, valid tips: {listed(moved) or 'none'}"
        raise wrong(file.where, "tip", text)
    return Route(start, end, route)


def chain_of(file: UrdfFile, route: Route, limited: bool) -> Chain:
    """The moving joints of a route; fixed ones are folded into the frames. Its base frame is the root link.

    Parameters
    ----------
    limited : bool
        Whether revolute and prismatic joints must have limits.

    Raises
    ------
    InputError
        For joints that are no single free motion, or lack their limits.
    """
    T = np.eye(4)
    joints = []
    for joint in route.joints:
        T = T @ joint.T_parent_joint
        if joint.kind == "fixed":
            continue
        _check_moving(file, joint, limited)
        lower = -inf if joint.lower is None else joint.lower
        upper = inf if joint.upper is None else joint.upper
        with at(file.where, joint.place):
            axis = joint.axis / np.abs(joint.axis).max()
            joints.append(Joint(joint.name, _KINDS[joint.kind], lower, upper, T, axis, joint.velocity))
        T = np.eye(4)
    return Chain(tuple(joints), T)


def parts_of(file: UrdfFile, route: Route, T_base_root: Array) -> Parts:
    """Every link with what it moves with.

    Links behind joints that are not the chain's (fingers, heads) stay where those joints put them at zero,
    or at the limit nearest to it. On the base this holds for wheels alone, by which is meant whatever turns
    without limits; links behind other joints of the base are left out.
    """
    chain = {joint.name: k for k, joint in enumerate(j for j in route.joints if j.kind != "fixed")}
    below: dict[str, list[TreeJoint]] = {name: [] for name in file.links}
    for joint in file.joints:
        below[joint.parent].append(joint)
    placed: list[Placed] = []
    left_out: list[TreeJoint] = []
    copies: list[TreeJoint] = []
    stack = _bases(route.root, {joint.child: joint for joint in file.joints}, T_base_root)
    taken = {link.name for link in stack}
    while stack:
        link = stack.pop()
        placed.append(link)
        for joint in below[link.name]:
            if joint.child in taken:
                continue
            if joint.name in chain:
                stack.append(Placed(joint.child, chain[joint.name], np.eye(4)))
                continue
            if link.owner == BASE and joint.kind != "fixed" and not _is_wheel(joint, below):
                left_out.append(joint)
                continue
            copies += [joint] if joint.mimic in chain else []
            T = link.T_owner_link @ joint.T_parent_joint @ _at_rest(joint)
            stack.append(Placed(joint.child, link.owner, T))
    solid = [[j.name for j in joints if _has_shapes(file, j, below)] for joints in (left_out, copies)]
    return Parts(tuple(placed), tuple(solid[0]), tuple(solid[1]))


def masses_of(file: UrdfFile, parts: Parts) -> tuple[LinkMass, ...]:
    """What moves with each joint of the chain, all of it as one mass at its centre."""
    weights: dict[int, list[tuple[float, Array]]] = {}
    for link in parts.placed:
        inertial = file.inertials.get(link.name)
        if inertial is not None and link.owner != BASE:
            mass, center = inertial
            T = link.T_owner_link
            weights.setdefault(link.owner, []).append((mass, T[:3, :3] @ center + T[:3, 3]))
    found = []
    for owner, rows in sorted(weights.items()):
        total = sum(mass for mass, _ in rows)
        center = np.sum([mass * point for mass, point in rows], axis=0) / total
        found.append(LinkMass(owner, total, center))
    return tuple(found)


# --- the tree


def _root(file: UrdfFile) -> str:
    children = {joint.child for joint in file.joints}
    roots = [link for link in file.links if link not in children]
    if not file.links:
        raise wrong(file.where, "", "expected at least one <link>")
    if not roots:
        raise wrong(
            file.where, "", "no link is the root: every link is some joint's child, so joints form a loop"
        )
    if len(roots) > 1:
        raise wrong(file.where, "", f"expected one root link, got {len(roots)}: {listed(roots)}")
    return roots[0]


def _refuse_loops(file: UrdfFile, above: dict[str, TreeJoint]) -> None:
    safe: set[str] = set()
    for link in file.links:
        walked: dict[str, None] = {}
        here: str | None = link
        while here is not None and here not in safe:
            if here in walked:
                loop = list(walked)[list(walked).index(here) :]
                raise wrong(
                    file.where, above[here].place, f"links form a loop: {listed([*loop[::-1], loop[-1]])}"
                )
            walked[here] = None
            here = above[here].parent if here in above else None
        safe |= walked.keys()


def _way(above: dict[str, TreeJoint], root: str, tip: str) -> tuple[TreeJoint, ...] | None:
    joints: list[TreeJoint] = []
    here = tip
    while here != root:
        if here not in above:
            return None
        joints.append(above[here])
        here = above[here].parent
    return tuple(reversed(joints))


def _moving(joints: Iterable[TreeJoint]) -> int:
    return sum(joint.kind != "fixed" for joint in joints)


def _longest(file: UrdfFile, above: dict[str, TreeJoint], root: str) -> str:
    """The one leaf with most moving joints between it and the root."""
    parents = {joint.parent for joint in file.joints}
    ways = {link: _way(above, root, link) for link in file.links if link not in parents}
    counts = Counter({link: _moving(way) for link, way in ways.items() if way is not None})
    most = max(counts.values(), default=0)
    ends = [link for link, count in counts.items() if count == most]
    if len(ends) != 1:
        text = (
            f"expected the name of a link, as {len(ends)} arms have {most} moving joints: {listed(ends, 12)}"
        )
        raise wrong(file.where, "tip", f"{text}; valid links: {listed(file.links)}")
    return ends[0]


def _check_moving(file: UrdfFile, joint: TreeJoint, limited: bool) -> None:
    if joint.kind not in _KINDS:
        text = f"a {joint.kind} joint cannot be part of the arm, valid types: {', '.join(_KINDS)}, fixed"
        raise wrong(file.where, joint.place, f"{text}; choose a root below it")
    if joint.mimic is not None:
        text = f"it copies joint {joint.mimic} (mimic), which an arm's joint must not: choose a tip above it"
        raise wrong(file.where, joint.place, f"{text}, such as {joint.parent}")
    if limited and (joint.lower is None or joint.upper is None):
        text = f'expected <limit lower="..." upper="..."/>, as its type is {joint.kind}'
        raise wrong(file.where, joint.place, text)


# --- what moves with what


def _bases(root: str, above: dict[str, TreeJoint], T_base_root: Array) -> list[Placed]:
    """The root, and the links above it that are fixed to it."""
    found = [Placed(root, BASE, T_base_root)]
    while found[-1].name in above and above[found[-1].name].kind == "fixed":
        joint = above[found[-1].name]
        T = found[-1].T_owner_link @ np.linalg.inv(joint.T_parent_joint)
        found.append(Placed(joint.parent, BASE, T))
    return found


def _is_wheel(joint: TreeJoint, below: dict[str, list[TreeJoint]]) -> bool:
    stack = [joint]
    while stack:
        part = stack.pop()
        if part.kind not in ("continuous", "fixed"):
            return False
        stack += below[part.child]
    return True


def _at_rest(joint: TreeJoint) -> Array:
    """Motion of a joint that no plan moves: zero, what it copies at zero, or the limit nearest to that."""
    if joint.kind not in _KINDS:
        return np.eye(4)
    lower = -inf if joint.lower is None else joint.lower
    upper = inf if joint.upper is None else joint.upper
    value = np.clip(joint.offset if joint.mimic is not None else 0.0, lower, upper)
    axis = joint.axis / np.abs(joint.axis).max()
    return motion(Joint(joint.name, _KINDS[joint.kind], lower, upper, np.eye(4), axis), value)


def _has_shapes(file: UrdfFile, joint: TreeJoint, below: dict[str, list[TreeJoint]]) -> bool:
    stack = [joint]
    while stack:
        part = stack.pop()
        if file.links[part.child]:
            return True
        stack += below[part.child]
    return False
