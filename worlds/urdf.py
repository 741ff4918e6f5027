"""Robots from URDF files."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.bundled import BODY_HEIGHT, robot_named, robot_names, without_limits
from regionik.worlds.chain import Chain, planar_pose
from regionik.worlds.errors import InputError
from regionik.worlds.fromurdf.body import body_of
from regionik.worlds.fromurdf.chain import Parts, chain_of, masses_of, parts_of, route_of
from regionik.worlds.fromurdf.tree import SUFFIXES, read_urdf
from regionik.worlds.fromurdf.words import listed
from regionik.worlds.readers.checking import LARGEST, at, wrong
from regionik.worlds.robot import BASE, BaseKind, Robot
from regionik.worlds.robotchecks import carried, check_footprint, check_turning
from regionik.worlds.solids.loose import loose_pairs

_UPRIGHT = 1e-9
DEEP_TIP = 1e-3  # of the tool point in its own link, from which on it is told [m]


def load_robot(
    name_or_path: str | Path,
    base: BaseKind | None = None,
    tip: str | None = None,
    root: str | None = None,
    footprint: ArrayLike | None = None,
    mount: ArrayLike | None = None,
    turning_radius: float | None = None,
    body_height: float | None = None,
    carry: ArrayLike | None = None,
    limits: Literal["ignore"] | None = None,
    payload: float = 0.0,
) -> Robot:
    """A bundled robot by its name, or a robot from a URDF file.

    The chain runs over the moving joints from ``root`` to ``tip``; fixed joints are folded into its frames.
    Its solids are the collision elements of all links that move with it: boxes as they are, the least
    capsule around each cylinder and sphere, a few boxes and capsules around each mesh; no more than twenty
    or so in all, as small ones share a bound. Links behind other joints (fingers, heads) stand still at zero.
    What is fixed to the root, wheels included, gives the footprint and the body height where they are not
    both given; what stands higher, such as a mast on a low base, becomes solids of its own. Where to cut is
    chosen so that all of it takes least room, or is ``body_height``. Two bounds that touch in many postures,
    while the hulls inside them are not seen to touch in any of 2000, need not keep apart. Speed limits of 0
    and limits of a million and beyond count as none; soft limits, moments of inertia and visual elements are
    not read. The masses of inertial elements are, of all links that move with the chain.

    Parameters
    ----------
    name_or_path : str or Path
        A bundled name, or a path that ends in .urdf or .xml.
    base : {"omni", "differential", "car"}, optional
        By default omni, or what the bundled robot has.
    tip, root : str, optional
        Links of the URDF file. By default the end of its one longest arm, and its root.
    footprint : (n, 2) array_like, optional
        Corners in order of the base's convex outline, or one point [m].
    mount : (4,) array_like, optional
        Where the root link stands in the base frame, which lies on the floor: x, y, z [m], yaw [rad]; by
        default it is the base frame. Of a bundled robot, where its arm stands.
    turning_radius : float, optional
        Least turning radius [m]; must be given for a car.
    body_height : float, optional
        [m]
    carry : (dof,) array_like, optional
        Joint values in which the arm is driven about; by default zero, or the limits nearest to it.
    limits : "ignore", optional
        Joints without limits.
    payload : float
        What the tool carries at its frame's origin [kg].

    Returns
    -------
    Robot
        At base pose 0, ``Robot.tool`` is the tip's frame as the file gives it in the root's, moved by
        ``mount``.

    Raises
    ------
    InputError
        One line: the file, the place in it, what was expected and the valid choices.

    Warns
    -----
    UserWarning
        Where a mesh is missing or unreadable and a capsule stands for it, and where links are left out.

    Examples
    --------
    >>> load_robot("youbot", base="differential").base
    'differential'
    """
    is_file, path = _is_file(name_or_path), Path(name_or_path)
    where = str(path)
    if base is not None and base not in get_args(BaseKind):
        raise wrong(where, "base", f"expected one of {', '.join(get_args(BaseKind))}, got {base!r}")
    if limits not in (None, "ignore"):
        raise wrong(where, "limits", f"expected ignore, got {limits!r}")
    given_mount = None if mount is None else _numbers(mount, (4,), f"{where}: mount")
    given_height = None if body_height is None else _above_zero(body_height, where, "body_height")
    if is_file:
        robot = _from_urdf(path, tip, root, given_mount, footprint is None, given_height, limits is None)
    else:
        robot = _bundled(where, tip, root)
        if given_mount is not None:
            robot = replace(robot, mount=given_mount)
    if footprint is not None:
        corners = _numbers(footprint, (None, 2), f"{where}: footprint")
        check_footprint(corners.tolist(), where, "footprint")
        robot = replace(robot, footprint=corners)
    if limits is not None:
        robot = without_limits(robot)
    if carry is not None:
        values = _numbers(carry, (None,), f"{where}: carry").tolist()
        robot = replace(robot, carry=carried(values, robot.chain, where, "carry"))
    height = robot.body_height if given_height is None else given_height
    kind: BaseKind = robot.base if base is None else base
    radius = _turning(robot, kind, turning_radius, where)
    with at(where, "payload"):
        return replace(robot, base=kind, body_height=height, turning_radius=radius, payload=payload)


def _from_urdf(
    path: Path,
    tip: str | None,
    root: str | None,
    mount: Array | None,
    want_footprint: bool,
    height: float | None,
    limited: bool,
) -> Robot:
    file = read_urdf(path)
    route = route_of(file, root, tip)
    chain = chain_of(file, route, limited)
    T_base_root = np.eye(4) if mount is None else planar_pose(mount[0], mount[1], mount[3], mount[2])
    yaw = 0.0 if mount is None else float(mount[3])
    arm_mount, chain = _mounted(chain, T_base_root, yaw)
    parts = parts_of(file, route, T_base_root)
    measured = want_footprint or height is None
    body = body_of(file, [link for link in parts.placed if measured or link.owner != BASE], chain, height)
    found = body.base
    robot = Robot(
        name=file.name,
        base="omni",
        footprint=found.outline if len(found.outline) and want_footprint else np.zeros((1, 2)),
        mount=arm_mount,
        chain=chain,
        solids=tuple(part.solid for part in body.parts),
        body_height=found.height if found.height > 0 else BODY_HEIGHT,
        carry=carried(None, chain, file.where, "carry"),
        base_solids=tuple(part.solid for part in found.parts),
        masses=masses_of(file, parts),
    )
    unchecked, loose = loose_pairs(robot, [part.points for part in (*body.parts, *found.parts)])
    for note in (*body.notes, *_notes(parts, measured), *_tip_notes(robot), *loose):
        warnings.warn(f"{file.where}: {note}", stacklevel=3)
    return replace(robot, unchecked=tuple(unchecked))


def _mounted(chain: Chain, T_base_root: Array, yaw: float) -> tuple[Array, Chain]:
    """Where the arm's base frame stands, (4,), and the chain seen from it.

    It stands upright at the first joint; where that is a vertical pivot, or lifts stand below one, on the
    pivot's axis, as all that reasons about such arms expects.
    """
    first = chain.joints[0]
    T_base_first = T_base_root @ first.T_parent_joint
    at_zero = T_base_root @ chain.frames(np.zeros(chain.dof))
    place = T_base_first[:3, 3].copy()
    for joint, T in zip(chain.joints, at_zero, strict=False):
        if abs((T[:3, :3] @ joint.axis)[2]) < 1 - _UPRIGHT:
            break
        if joint.kind == "revolute":
            place[:2] = T[:2, 3]
            break
    mount = np.array([*place, yaw])
    T_arm_first = np.linalg.inv(planar_pose(place[0], place[1], yaw, place[2])) @ T_base_first
    joints = (replace(first, T_parent_joint=T_arm_first), *chain.joints[1:])
    return mount, Chain(joints, chain.T_last_tool)


def _notes(parts: Parts, measured: bool) -> list[str]:
    notes = []
    if parts.left_out and measured:
        names = listed(parts.left_out, 8)
        notes.append(
            f"what hangs on the base by joints that the arm has not ({names}) is left out; "
            "give footprint and body_height to cover it"
        )
    if parts.copies:
        notes.append(f"joints that copy the arm's ({listed(parts.copies, 8)}) are taken to stand still")
    return notes


def _tip_notes(robot: Robot) -> list[str]:
    depth, name = robot.tip_depth
    if depth < DEEP_TIP:
        return []
    return [
        f"the tool point lies {depth:.4f} m inside {name}: it sinks that deep into what the tool touches, "
        "which rules.contact_depth must allow; or give a tip at the end of the tool"
    ]


def _is_file(name_or_path: str | Path) -> bool:
    text = str(name_or_path)
    suffixes = (*SUFFIXES, ".xacro")
    return isinstance(name_or_path, Path) or text.lower().endswith(suffixes) or "/" in text or "\\" in text


def _bundled(name: str, tip: str | None, root: str | None) -> Robot:
    if name not in robot_names():
        choices = f"a path that ends in {', '.join(SUFFIXES)}, or one of {', '.join(robot_names())}"
        raise InputError(f"unknown robot {name!r}: expected {choices}")
    if tip is not None or root is not None:
        raise wrong(name, "tip" if tip is not None else "root", "a bundled robot has no links to choose from")
    return robot_named(name)


def _turning(robot: Robot, base: BaseKind, radius: float | None, where: str) -> float:
    own = robot.turning_radius if base == "car" else 0.0
    known = own if radius is None else _above_zero(radius, where, "turning_radius")
    check_turning(base, known, where, "turning_radius")
    return known


def _above_zero(value: float, where: str, place: str) -> float:
    number = float(_numbers(value, (), f"{where}: {place}"))
    if number <= 0:
        raise wrong(where, place, f"must be above 0, got {number:g}")
    return number


def _numbers(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    array = frozen(values, shape, what)
    if array.size and np.abs(array).max() > LARGEST:
        raise InputError(f"{what}: expected numbers of at most {LARGEST:g} in size")
    return array
