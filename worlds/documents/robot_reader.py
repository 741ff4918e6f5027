"""The robot part of a document -> a Robot."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named, without_limits
from regionik.worlds.chain import Chain, Joint, chain_from_dh, pose
from regionik.worlds.documents import robot_schema
from regionik.worlds.errors import InputError
from regionik.worlds.readers.robot_checks import carried, check_footprint, check_turning
from regionik.worlds.readers.validation import at, wrong
from regionik.worlds.robot import BASE, LinkBox, LinkCapsule, LinkMass, LinkSolid, Robot, capsules_along
from regionik.worlds.urdf.elements import listed
from regionik.worlds.urdf.loader import load_robot

_RIGID = 1e-6


def build_robot(part: robot_schema.RobotPart, where: str, folder: Path) -> Robot:
    """Robot from a bundled name, DH rows, a joint list or a URDF file; its path is relative to ``folder``."""
    if isinstance(part, robot_schema.UrdfRobot):
        return _urdf_robot(part, where, folder)
    if isinstance(part, str):
        with at(where, "robot"):
            return robot_named(part)
    if isinstance(part, robot_schema.NamedRobot):
        with at(where, "robot.name"):
            robot = robot_named(part.name)
    else:
        robot = _own_robot(part, where)
    masses = _masses(part.masses, robot.chain, where)
    robot = replace(robot, masses=masses, payload=part.payload)
    return without_limits(robot) if part.limits == "ignore" else robot


def rotation(matrix: Array) -> Array:
    """The matrix itself, once it is known to be a rotation."""
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > _RIGID or np.linalg.det(matrix) < 0:
        raise InputError("expected a rotation matrix (right-handed, unit rows at right angles)")
    return matrix


def _urdf_robot(part: robot_schema.UrdfRobot, where: str, folder: Path) -> Robot:
    with at(where, "robot"):
        return load_robot(
            folder / part.urdf,
            base=part.base,
            tip=part.tip,
            root=part.root,
            footprint=part.footprint,
            mount=part.mount,
            turning_radius=part.turning_radius or None,
            body_height=part.body_height,
            carry=part.carry,
            limits=part.limits,
            payload=part.payload,
        )


def _own_robot(part: robot_schema.DhRobot | robot_schema.ChainRobot, where: str) -> Robot:
    check_turning(part.base, part.turning_radius, where, "robot.turning_radius")
    chain = (
        _dh_chain(part, where) if isinstance(part, robot_schema.DhRobot) else _joint_chain(part.chain, where)
    )
    check_footprint(part.footprint, where, "robot.footprint")
    solids = _solids(part, chain, where)
    return Robot(
        name=part.name,
        base=part.base,
        footprint=np.array(part.footprint),
        mount=np.array(part.mount),
        chain=chain,
        solids=tuple(solid for solid in solids if solid.link != BASE),
        body_height=part.body_height,
        carry=carried(part.carry, chain, where, "robot.carry"),
        turning_radius=part.turning_radius,
        gauge=part.gauge,
        base_solids=tuple(solid for solid in solids if solid.link == BASE),
        unchecked=_unchecked(part.unchecked, solids, where),
    )


def _dh_chain(part: robot_schema.DhRobot, where: str) -> Chain:
    rows = []
    for k, (theta, d, a, alpha, lower, upper) in enumerate(part.dh):
        if theta is None or d is None or a is None or alpha is None:
            raise wrong(where, f"robot.dh[{k}]", "theta, d, a, alpha: expected numbers, got null")
        rows.append((theta, d, a, alpha, *_limits(lower, upper, where, f"robot.dh[{k}]")))
    if part.names is not None and len(part.names) != len(rows):
        raise wrong(where, "robot.names", f"expected {len(rows)} joint names, got {len(part.names)}")
    with at(where, "robot.names"):
        return chain_from_dh(rows, part.names)


def _joint_chain(part: robot_schema.ChainPart, where: str) -> Chain:
    joints = []
    for k, joint in enumerate(part.joints):
        place = f"robot.chain.joints[{k}]"
        lower, upper = _limits(joint.lower, joint.upper, where, place)
        frame = _frame(joint.frame, where, f"{place}.frame")
        with at(where, place):
            speed = inf if joint.velocity is None else joint.velocity
            joints.append(Joint(joint.name, joint.kind, lower, upper, frame, np.array(joint.axis), speed))
    tool = _frame(part.tool, where, "robot.chain.tool")
    with at(where, "robot.chain.joints"):
        return Chain(tuple(joints), tool)


def _frame(rows: list[list[float]], where: str, place: str) -> Array:
    T = np.array(rows)
    with at(where, place):
        rotation(T[:3, :3])
        if not np.array_equal(T[3], [0, 0, 0, 1]):
            raise InputError(f"expected 0, 0, 0, 1 as last row, got {T[3].tolist()}")
    return T


def _limits(lower: float | None, upper: float | None, where: str, place: str) -> tuple[float, float]:
    low, high = -inf if lower is None else lower, inf if upper is None else upper
    if low > high:
        raise wrong(where, place, f"expected lower limit <= upper limit, got {low:g} and {high:g}")
    return low, high


def _solids(
    part: robot_schema.DhRobot | robot_schema.ChainRobot, chain: Chain, where: str
) -> tuple[LinkSolid, ...]:
    if part.solids is None:
        return capsules_along(chain, part.link_radius)
    solids = []
    for k, solid in enumerate(part.solids):
        place = f"robot.solids[{k}]"
        if solid.link >= chain.dof:
            text = f"expected a link from {BASE} (the base) to {chain.dof - 1}, got {solid.link}"
            raise wrong(where, f"{place}.link", text)
        solids.append(_link_solid(solid, where, place))
    return tuple(solids)


def _masses(parts: list[robot_schema.MassPart], chain: Chain, where: str) -> tuple[LinkMass, ...]:
    for k, part in enumerate(parts):
        if part.link >= chain.dof:
            text = f"expected a link from 0 to {chain.dof - 1}, got {part.link}"
            raise wrong(where, f"robot.masses[{k}].link", text)
    return tuple(LinkMass(part.link, part.mass, np.array(part.center)) for part in parts)


def _unchecked(
    pairs: list[list[str]], solids: tuple[LinkSolid, ...], where: str
) -> tuple[tuple[str, str], ...]:
    names = sorted({solid.name for solid in solids})
    for k, pair in enumerate(pairs):
        unknown = next((name for name in pair if name not in names), None)
        if unknown is not None:
            text = f"expected names of solids ({listed(names, 8)}), got {unknown!r}"
            raise wrong(where, f"robot.unchecked[{k}]", text)
    return tuple((one, other) for one, other in pairs)


def _link_solid(part: robot_schema.LinkSolidPart, where: str, place: str) -> LinkSolid:
    match part:
        case robot_schema.Capsule():
            return LinkCapsule(part.link, part.name, np.array(part.start), np.array(part.end), part.radius)
        case robot_schema.PlacedBox():
            T_link_box = pose(part.position, part.rpy)
        case robot_schema.FramedBox():
            T_link_box = _frame(part.frame, where, f"{place}.frame")
    return LinkBox(part.link, part.name, T_link_box, np.array(part.size))
