"""Robots from URDF files."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.bundled import robot_named, robot_names
from regionik.worlds.chain import Chain, planar_pose
from regionik.worlds.drives import BaseKind, drive_of
from regionik.worlds.errors import InputError, located, located_error
from regionik.worlds.readers.validation import LARGEST
from regionik.worlds.robot import BASE, BODY_HEIGHT, Robot, check_turning_radius, without_limits
from regionik.worlds.self_collision import disabled_pairs
from regionik.worlds.urdf.collision import collision_model
from regionik.worlds.urdf.elements import SUFFIXES, join_names, read_urdf
from regionik.worlds.urdf.kinematic_tree import (
    LinkPlacement,
    chain_along,
    kinematic_path,
    link_masses,
    place_links,
)

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
    """Return a bundled robot by its name, or the robot of a URDF file.

    The chain runs over the moving joints from ``root`` to ``tip``; fixed joints are folded into its frames.
    Its solids bound the collision elements of all links that move with it: boxes as they are, the least
    capsule around each cylinder and sphere, a few boxes and capsules around each mesh; no more than about
    twenty in all, as small ones share a bound. Links behind other joints (fingers, heads) stand still at
    zero. The root and all that is fixed to it, wheels included, give the footprint and the body height where
    they are not both given; what stands higher, such as a mast on a low base, becomes solids of its own. The
    height of the cut is ``body_height``, or such that all takes least volume. Two bounds that touch in many
    postures, while the hulls inside them touch in none of 2000, need not keep apart. Speed limits of 0 and
    limits of a million and more count as none. Masses are read, of all links that move with the chain; soft
    limits, moments of inertia and visual elements are not.

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
        Pose of the root link in the base frame, which lies on the floor: x, y, z [m], yaw [rad]; by default
        the two coincide. Of a bundled robot, the pose of its arm.
    turning_radius : float, optional
        Least turning radius [m]; must be given for a car.
    body_height : float, optional
        [m]
    carry : (dof,) array_like, optional
        Joint values with which the arm is driven about; by default zero, or the limits nearest to it.
    limits : "ignore", optional
        Leave out all joint limits.
    payload : float
        Mass held at the tool frame's origin [kg].

    Returns
    -------
    Robot
        At base pose 0, ``Robot.tool`` is the tip's frame in the root's, as the file gives it, moved by
        ``mount``.

    Raises
    ------
    InputError
        One line: the file, the place in it, what was expected and the valid choices.

    Warns
    -----
    UserWarning
        Where a mesh is missing or unreadable and a capsule replaces it, and where links are left out.

    Examples
    --------
    >>> load_robot("youbot", base="differential").base
    'differential'
    """
    path, where = Path(name_or_path), str(name_or_path)
    if base is not None and base not in get_args(BaseKind):
        raise located_error(where, "base", f"expected one of {', '.join(get_args(BaseKind))}, got {base!r}")
    if limits not in (None, "ignore"):
        raise located_error(where, "limits", f"expected ignore, got {limits!r}")
    with located(where, ""):
        given_mount = None if mount is None else _numbers(mount, (4,), "mount")
        height = None if body_height is None else _above_zero(body_height, "body_height")
    if _is_file(name_or_path):
        robot = _from_urdf(path, tip, root, given_mount, footprint is None, height, limits is None)
    else:
        robot = _bundled(where, tip, root)
        robot = robot if given_mount is None else replace(robot, mount=given_mount)
    robot = robot if limits is None else without_limits(robot)
    kind = robot.base if base is None else base
    with located(where, ""):
        if footprint is not None:
            robot = replace(robot, footprint=_numbers(footprint, (None, 2), "footprint"))
        if carry is not None:
            values = _numbers(carry, (None,), "carry")
            robot.chain.check_limits(values.tolist(), "carry")
            robot = replace(robot, carry=values)
        radius = drive_of(kind, robot.turning_radius).turning_radius
        if turning_radius is not None:
            radius = _above_zero(turning_radius, "turning_radius")
        check_turning_radius(kind, radius)
        height = robot.body_height if height is None else height
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
    model = read_urdf(path)
    kinematic = kinematic_path(model, root, tip)
    chain = chain_along(model, kinematic, limited)
    T_base_root = np.eye(4) if mount is None else planar_pose(mount[0], mount[1], mount[3], mount[2])
    yaw = 0.0 if mount is None else float(mount[3])
    arm_mount, chain = _mounted(chain, T_base_root, yaw)
    placement = place_links(model, kinematic, T_base_root)
    measured = want_footprint or height is None
    links = [link for link in placement.links if measured or link.owner != BASE]
    body = collision_model(model, links, chain, height)
    robot = Robot(
        name=model.name,
        base="omni",
        footprint=body.base.outline if len(body.base.outline) and want_footprint else np.zeros((1, 2)),
        mount=arm_mount,
        chain=chain,
        solids=tuple(part.solid for part in body.parts),
        body_height=body.base.height if body.base.height > 0 else BODY_HEIGHT,
        base_solids=tuple(part.solid for part in body.base.parts),
        masses=link_masses(model, placement),
    )
    unchecked, touching = disabled_pairs(robot, [part.points for part in (*body.parts, *body.base.parts)])
    for note in (*body.notes, *_notes(placement, measured), *_tip_notes(robot), *touching):
        warnings.warn(f"{model.where}: {note}", stacklevel=3)
    return replace(robot, unchecked=tuple(unchecked))


def _mounted(chain: Chain, T_base_root: Array, yaw: float) -> tuple[Array, Chain]:
    """Return the mount (4,) of the arm's base frame, and the chain seen from it.

    The frame stands upright at the first joint; where that is a vertical pivot, or lifts stand below one, on
    the pivot's axis, as `regionik.worlds.arms` expects.
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


def _notes(placement: LinkPlacement, measured: bool) -> list[str]:
    notes = []
    if placement.left_out and measured:
        names = join_names(placement.left_out, 8)
        notes.append(
            f"links behind joints of the base that are not the arm's ({names}) are left out; "
            "give footprint and body_height to cover them"
        )
    if placement.copies:
        names = join_names(placement.copies, 8)
        notes.append(f"joints that mimic the arm's ({names}) are taken to stand still")
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
        raise located_error(
            name, "tip" if tip is not None else "root", "a bundled robot has no links to choose from"
        )
    return robot_named(name)


def _above_zero(value: float, what: str) -> float:
    number = float(_numbers(value, (), what))
    if number <= 0:
        raise InputError(f"{what}: must be above 0, got {number:g}")
    return number


def _numbers(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    array = frozen(values, shape, what)
    if array.size and np.abs(array).max() > LARGEST:
        raise InputError(f"{what}: expected numbers of at most {LARGEST:g} in size")
    return array
