"""The kinematic tree of a URDF file: its root, the path from root to tip, and what other links move with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError, located, located_error
from regionik.worlds.joints import Joint, Mimic
from regionik.worlds.links import BASE, LinkMass
from regionik.worlds.readers.text import join_names
from regionik.worlds.urdf.elements import UrdfJoint, UrdfModel
from regionik.worlds.urdf.options import URDF

OPTIONS = URDF.doubts

_LEVEL = 1e-6

_KINDS: dict[str, Literal["revolute", "prismatic"]] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}


@dataclass(frozen=True, eq=False)
class KinematicPath:
    """Joints from a root link to a tip link."""

    root: str
    tip: str
    joints: tuple[UrdfJoint, ...]  # from root to tip, fixed ones included


@dataclass(frozen=True, eq=False)
class PlacedLink:
    """A link that moves with a joint of the chain, or with the base."""

    name: str
    owner: int  # index of the chain's joint that it moves with; `BASE` for the base
    T_owner_link: Array  # (4, 4) its frame in the link that this joint moves; for the base, in the base frame


@dataclass(frozen=True, eq=False)
class LinkPlacement:
    """All links, each with what it moves with."""

    links: tuple[PlacedLink, ...]
    resting: frozenset[str]  # links of the base behind joints that are no wheels', such as a second arm's
    # joints that are taken to stand still, with solids behind them: those of the base that are no wheels' and
    # the first of their kind, and those that mimic one of the arm's
    stills: tuple[str, ...]
    copies: tuple[str, ...]


def kinematic_path(model: UrdfModel, root: str | None, tip: str | None) -> KinematicPath:
    """Return the path from ``root`` (the file's by default) to ``tip`` (by default, of the longest arm).

    Joints by which a file moves its base over the floor are left out where no root is given: see
    `_virtual_joints`. An `InputError` lists the valid names where one is unknown or nothing moves.
    """
    top = _root(model)
    above = {joint.child: joint for joint in model.joints}
    _refuse_loops(model, above)
    for what, name in (("root", root), ("tip", tip)):
        if name is not None:
            model.check_link(name, what)
    start = top if root is None else root
    end = _longest_arm(model, above, start) if tip is None else tip
    path = _path(above, start, end)
    if path is None:
        upward = [joint.parent for joint in _path(above, top, end) or ()]
        text = f"link {end} does not hang on link {start}, valid roots: {join_names(upward) or 'none'}"
        raise located_error(model.where, "tip", text)
    if not _moving_count(path):
        moved = [link for link in model.links if _moving_count(_path(above, start, link) or ())]
        text = f"no joint moves between {start} and {end}, valid tips: {join_names(moved) or 'none'}"
        raise located_error(model.where, "tip", text)
    virtual = _virtual_joints(path) if root is None else 0
    if virtual:
        start, path = path[virtual - 1].child, path[virtual:]
        if not _moving_count(path):
            text = f"only the joints of a virtual base move {end}, expected a tip behind joints of an arm"
            raise located_error(model.where, "tip", text)
    return KinematicPath(start, end, path)


def chain_along(model: UrdfModel, path: KinematicPath, limited: bool) -> Chain:
    """Return the moving joints of a path; fixed ones are folded into the frames. Its base is the root link.

    ``limited`` is True where revolute and prismatic joints must have limits. A joint that is no single free
    motion is an `InputError`.
    """
    T = np.eye(4)
    joints = []
    for joint in path.joints:
        T = T @ joint.T_parent_joint
        if joint.kind == "fixed":
            continue
        _check_moving(model, joint, limited)
        with located(model.where, joint.place):
            mimic = None if joint.mimic is None else _mimic_on_path(path, joint, joint.mimic)
            joints.append(replace(_chain_joint(joint, T), mimic=mimic))
        T = np.eye(4)
    with located(model.where, ""):
        return Chain(tuple(one if one.mimic else _with_mimic_limits(one, joints) for one in joints), T)


def place_links(
    model: UrdfModel, path: KinematicPath, T_base_root: Array, rest: Mapping[str, float]
) -> LinkPlacement:
    """Return every link with what it moves with.

    Links behind joints that are not the chain's (fingers, heads, wheels, a second arm) stay where those
    joints put them at their values at ``rest``, by their names, else at zero, or at the limit nearest to it.
    """
    chain = {joint.name: k for k, joint in enumerate(j for j in path.joints if j.kind != "fixed")}
    below: dict[str, list[UrdfJoint]] = {name: [] for name in model.links}
    for joint in model.joints:
        below[joint.parent].append(joint)
    placed: list[PlacedLink] = []
    stills: list[UrdfJoint] = []
    resting: set[str] = set()
    copies: list[UrdfJoint] = []
    stack = _base_links(path.root, {joint.child: joint for joint in model.joints}, T_base_root)
    taken = {link.name for link in stack}
    while stack:
        link = stack.pop()
        placed.append(link)
        for joint in below[link.name]:
            if joint.child in taken:
                continue
            if joint.name in chain:
                stack.append(PlacedLink(joint.child, chain[joint.name], np.eye(4)))
                continue
            moves = link.owner == BASE and joint.kind != "fixed" and link.name not in resting
            if moves and not _is_wheel(joint, below):
                stills.append(joint)
                resting |= {part.child for part in _subtree(joint, below)}
            copies += [joint] if joint.mimic is not None and joint.mimic.joint in chain else []
            T = link.T_owner_link @ joint.T_parent_joint @ _at_rest(joint, rest)
            stack.append(PlacedLink(joint.child, link.owner, T))
    told = (
        tuple(j.name for j in joints if any(model.links[part.child] for part in _subtree(j, below)))
        for joints in (stills, copies)
    )
    return LinkPlacement(tuple(placed), frozenset(resting), *told)


def link_masses(model: UrdfModel, placement: LinkPlacement) -> tuple[LinkMass, ...]:
    """Return, for each joint of the chain, all that moves with it as one mass at its centre."""
    weights: dict[int, list[tuple[float, Array]]] = {}
    for link in placement.links:
        inertial = model.inertials.get(link.name)
        if inertial is not None and link.owner != BASE:
            center = (link.T_owner_link @ inertial.T_link_inertial)[:3, 3]
            weights.setdefault(link.owner, []).append((inertial.mass, center))
    found = []
    for owner, rows in sorted(weights.items()):
        total = sum(mass for mass, _ in rows)
        center = np.sum([mass * point for mass, point in rows], axis=0) / total
        found.append(LinkMass(owner, total, center))
    return tuple(found)


# --- the tree


def _root(model: UrdfModel) -> str:
    children = {joint.child for joint in model.joints}
    roots = [link for link in model.links if link not in children]
    if not model.links:
        raise located_error(model.where, "", "expected at least one <link>")
    if not roots:
        text = "no link is the root: every link is some joint's child, so joints form a loop"
        raise located_error(model.where, "", text)
    if len(roots) > 1:
        raise located_error(model.where, "", f"expected one root link, got {len(roots)}: {join_names(roots)}")
    return roots[0]


def _refuse_loops(model: UrdfModel, above: dict[str, UrdfJoint]) -> None:
    safe: set[str] = set()
    for link in model.links:
        walked: dict[str, None] = {}
        here: str | None = link
        while here is not None and here not in safe:
            if here in walked:
                loop = list(walked)[list(walked).index(here) :]
                text = f"links form a loop: {join_names([*loop[::-1], loop[-1]])}"
                raise located_error(model.where, above[here].place, text)
            walked[here] = None
            here = above[here].parent if here in above else None
        safe |= walked.keys()


def _path(above: dict[str, UrdfJoint], root: str, tip: str) -> tuple[UrdfJoint, ...] | None:
    joints: list[UrdfJoint] = []
    here = tip
    while here != root:
        if here not in above:
            return None
        joints.append(above[here])
        here = above[here].parent
    return tuple(reversed(joints))


def _virtual_joints(path: tuple[UrdfJoint, ...]) -> int:
    """Return how many joints of a path, from its root on, stand for the motion of a base over the floor.

    These are planar and floating joints, level slides of `min_endless_travel` and more, and turns about the
    vertical between them, or without limits behind them.
    """
    turn, count, slides = np.eye(3), 0, 0
    for k, joint in enumerate(path):
        turn = turn @ joint.T_parent_joint[:3, :3]
        if joint.kind == "fixed":
            continue
        rise = abs(float((turn @ joint.axis)[2]) / float(np.linalg.norm(joint.axis)))
        room = (joint.upper or 0.0) - (joint.lower or 0.0)
        endless = joint.kind == "prismatic" and rise < _LEVEL and room >= OPTIONS.min_endless_travel
        free = joint.kind in ("planar", "floating") and not _moving_count(path[count:k])
        if endless or free:
            count, slides = k + 1, slides + 1
        elif joint.kind in ("revolute", "continuous") and rise > 1 - _LEVEL:
            count = k + 1 if slides > 1 and room >= OPTIONS.min_endless_travel else count
        else:
            break
    return count


def _moving_count(joints: Iterable[UrdfJoint]) -> int:
    return sum(joint.kind != "fixed" for joint in joints)


def _longest_arm(model: UrdfModel, above: dict[str, UrdfJoint], root: str) -> str:
    """Return the one leaf with most moving joints between it and the root."""
    parents = {joint.parent for joint in model.joints}
    paths = {link: _path(above, root, link) for link in model.links if link not in parents}
    counts = Counter({link: _moving_count(path) for link, path in paths.items() if path is not None})
    most = max(counts.values(), default=0)
    ends = [link for link, count in counts.items() if count == most]
    if len(ends) != 1:
        arms = f"{len(ends)} arms have {most} moving joints: {join_names(ends, 12)}"
        text = f"expected the name of a link, as {arms}; valid links: {join_names(model.links)}"
        raise located_error(model.where, "tip", text)
    return ends[0]


def _check_moving(model: UrdfModel, joint: UrdfJoint, limited: bool) -> None:
    if joint.kind not in _KINDS:
        text = f"a {joint.kind} joint cannot be part of the arm, valid types: {', '.join(_KINDS)}, fixed"
        raise located_error(model.where, joint.place, f"{text}; choose a root below it")
    if limited and joint.mimic is None and (joint.lower is None or joint.upper is None):
        text = f'expected <limit lower="..." upper="..."/>, as its type is {joint.kind}'
        raise located_error(model.where, joint.place, text)


def _mimic_on_path(path: KinematicPath, joint: UrdfJoint, mimic: Mimic) -> Mimic:
    """Return how a joint follows one that moves by itself, over those between that copy others in turn."""
    moving = {one.name: one for one in path.joints if one.kind != "fixed" and one is not joint}
    while (leader := moving.pop(mimic.joint, None)) is not None:
        if leader.mimic is None:
            return mimic
        (offset, _), further = mimic.limits(leader.mimic.offset, leader.mimic.offset), leader.mimic
        mimic = Mimic(further.joint, mimic.multiplier * further.multiplier, offset)
    text = f"it copies joint {mimic.joint} (mimic), which does not move by itself between {path.root} and"
    raise InputError(f"{text} {path.tip}: choose a tip above it, such as {joint.parent}")


def _with_mimic_limits(joint: Joint, joints: Iterable[Joint]) -> Joint:
    """Return a joint with limits that those which mimic it keep theirs by."""
    for one in joints:
        if one.mimic is not None and one.mimic.joint == joint.name:
            low, high = one.mimic.leader_limits(one.lower, one.upper)
            ratio = abs(one.mimic.multiplier)
            velocity, acceleration = (
                rate / ratio if ratio else inf for rate in (one.velocity, one.acceleration)
            )
            joint = replace(
                joint,
                lower=max(joint.lower, low),
                upper=min(joint.upper, high),
                velocity=min(joint.velocity, velocity),
                acceleration=min(joint.acceleration, acceleration),
            )
    return joint


def _chain_joint(joint: UrdfJoint, T_parent_joint: Array) -> Joint:
    lower = -inf if joint.lower is None else joint.lower
    upper = inf if joint.upper is None else joint.upper
    axis = joint.axis / np.abs(joint.axis).max()
    rates = joint.velocity, joint.acceleration
    return Joint(joint.name, _KINDS[joint.kind], lower, upper, T_parent_joint, axis, *rates)


# --- placement of links


def _base_links(root: str, above: dict[str, UrdfJoint], T_base_root: Array) -> list[PlacedLink]:
    """Return the root, and the links above it that are fixed to it."""
    found = [PlacedLink(root, BASE, T_base_root)]
    while found[-1].name in above and above[found[-1].name].kind == "fixed":
        joint = above[found[-1].name]
        T = found[-1].T_owner_link @ np.linalg.inv(joint.T_parent_joint)
        found.append(PlacedLink(joint.parent, BASE, T))
    return found


def _subtree(joint: UrdfJoint, below: dict[str, list[UrdfJoint]]) -> Iterable[UrdfJoint]:
    """Yield a joint and all joints behind it."""
    stack = [joint]
    while stack:
        part = stack.pop()
        yield part
        stack += below[part.child]


def _is_wheel(joint: UrdfJoint, below: dict[str, list[UrdfJoint]]) -> bool:
    return all(part.kind in ("continuous", "fixed") for part in _subtree(joint, below))


def _at_rest(joint: UrdfJoint, rest: Mapping[str, float]) -> Array:
    """Return the transform of a joint that no plan moves: at rest, else at zero, or the limit nearest to it.

    A joint that mimics another follows that one there.
    """
    if joint.kind not in _KINDS:
        return np.eye(4)
    still = _chain_joint(joint, np.eye(4))
    value = rest.get(joint.name, 0.0)
    if joint.mimic is not None:
        value = joint.mimic.multiplier * rest.get(joint.mimic.joint, 0.0) + joint.mimic.offset
    return still.transform(np.clip(value, still.lower, still.upper))
