"""Bundled robots, and the names and files of bundled worlds."""

from __future__ import annotations

from math import inf, pi, radians
from pathlib import Path

import numpy as np

from regionik.worlds.chain import Chain, translation
from regionik.worlds.errors import InputError, suggestion
from regionik.worlds.links import LINK_RADIUS, capsules_along
from regionik.worlds.robot import BODY_HEIGHT, Robot

DATA = Path(__file__).parent / "data"
WORLD_SUFFIX = ".world.yaml"
ARM_RADIUS = 0.025  # of the FABRIK-R paper's arms, whose links are 68 to 150 mm long [m]

# M-FABRIK, table 1: d, a [m], alpha [rad]. Limits [deg] are the datasheet's (+-169, -65..90, -151..146,
# +-102.5, +-167.5, zero with the arm straight up), converted to the table's angles: theta1 = q1,
# theta2 = 90 - q2, theta3 = -q3, theta4 = 90 - q4, theta5 = q5.
_YOUBOT = (
    (0.147, 0.033, pi / 2, -169.0, 169.0),
    (0.0, 0.155, 0.0, 0.0, 155.0),
    (0.0, 0.135, 0.0, -146.0, 151.0),
    (0.0, 0.0, pi / 2, -12.5, 192.5),
    (0.2175, 0.0, 0.0, -167.5, 167.5),
)

# FABRIK-R's arms without limits: theta offset [rad], d, a [m], alpha [rad].
_ARMS = {
    # Table 1: a pivot, three parallel hinges and an orthogonal one, 340 mm in five links.
    "hinge5": (
        (0.0, 0.068, 0.0, -pi / 2),
        (0.0, 0.0, 0.068, 0.0),
        (0.0, 0.0, 0.068, 0.0),
        (0.0, 0.0, 0.068, -pi / 2),
        (0.0, 0.0, 0.068, 0.0),
    ),
    # Table 2: 900 mm in ten links.
    "dof10": (
        (0.0, 0.09, 0.0, -pi / 2),
        *2 * ((0.0, 0.0, 0.09, 0.0),),
        *5 * ((0.0, 0.0, 0.09, -pi / 2),),
        *2 * ((0.0, 0.0, 0.09, 0.0),),
    ),
    # Table 5 with d_1 = 148.9 mm, with which the printed results of table 6 agree.
    "pioneer7": (
        (0.0, 0.1489, 0.0, -pi / 2),
        (0.0, 0.0, 0.0, -pi / 2),
        (0.0, 0.15, 0.0, -pi / 2),
        (0.0, 0.0, 0.0, -pi / 2),
        (0.0, 0.145, 0.0, -pi / 2),
        (0.0, 0.0, 0.075, pi / 2),
        (0.0, 0.0, 0.075, 0.0),
    ),
}
# Xu et al.: theta offset [rad], d, a [m], alpha [rad]; limits [deg]. Joint 1 has the paper's limits; it gives
# none for the others: these are ours.
_PARM = (
    (0.0, 0.12, 0.06875, -pi / 2, -90.0, 90.0),
    (0.0, 0.0, 0.16, 0.0, -120.0, 90.0),
    (-pi / 2, 0.0, 0.0, -pi / 2, -150.0, 150.0),
    (0.0, 0.13775, 0.0, pi / 2, -180.0, 180.0),
    (0.0, 0.0, 0.0, -pi / 2, -90.0, 90.0),
)
_PARM_TOOL = 0.11321  # from the last joint [m]
_PIONEER_MOUNT = 0.155  # of the arm before and above the middle of the wheels [m]
_PIONEER_GAUGE = 0.32  # [m]
# Straight up [deg]; for pioneer7 that is all servos at 150 deg.
_CARRY = {
    "hinge5": (0.0, -90.0, 0.0, 0.0, 0.0),
    "dof10": (0.0, -90.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "pioneer7": (-90.0, 180.0, 0.0, 180.0, 0.0, -90.0, 0.0),
}
_STRAIGHT_UP = np.radians([0.0, 90.0, 0.0, 90.0, 0.0])


def robot_names() -> tuple[str, ...]:
    """Return the names of the bundled robots."""
    return ("youbot", "youbot-real", "hinge5", "dof10", "pioneer7", "pioneer-parm")


def robot_named(name: str) -> Robot:
    """Return a bundled robot.

    ``youbot`` is the robot of the M-FABRIK paper: a point base with the arm on its centre.
    ``youbot-real`` carries the same arm 0.143 m ahead of the centre of a 0.58 x 0.38 m base.
    ``hinge5``, ``dof10`` and ``pioneer7`` are the arms of the FABRIK-R paper (340, 900 and 594 mm), without
    joint limits, on the centre of a point base. Joint values are the thetas of their DH tables; pioneer7's
    are ``s (servo - 150 deg) + o`` with s = (+, +, +, +, +, +, -), o = (-90, 180, 0, 180, 0, -90, 0) deg.
    ``pioneer-parm`` is the robot of Xu et al.: a differential base and the PArm of five joints. Lengths and
    the distance of the wheels are the paper's; the outline, the solids and all limits but joint 1's are ours.

    >>> robot_named("youbot").chain.names
    ('joint_1', 'joint_2', 'joint_3', 'joint_4', 'joint_5')
    """
    if name == "youbot":
        return _youbot(name, 0.0, [[0.0, 0.0]])
    if name == "youbot-real":
        return _youbot(name, 0.143, [[0.29, 0.19], [-0.29, 0.19], [-0.29, -0.19], [0.29, -0.19]])
    if name in _ARMS:
        return _bare_arm(name)
    if name == "pioneer-parm":
        return _pioneer_parm(name)
    near = suggestion(name, robot_names())
    raise InputError(f"unknown robot {name!r}{near or ','} valid names: {', '.join(robot_names())}")


def world_names() -> tuple[str, ...]:
    """Return the names of the bundled worlds, sorted."""
    return tuple(sorted(path.name.removesuffix(WORLD_SUFFIX) for path in DATA.glob(f"*{WORLD_SUFFIX}")))


def world_path(name: str) -> Path:
    """Return the file of a bundled world; an `InputError` lists the valid names."""
    if name not in world_names():
        raise InputError(
            f"unknown world {name!r}{suggestion(name, world_names()) or ':'} "
            "expected a path that ends in .yaml, .yml or .json, "
            f"or one of {', '.join(world_names())}"
        )
    return DATA / f"{name}{WORLD_SUFFIX}"


def _youbot(name: str, ahead: float, footprint: list[list[float]]) -> Robot:
    rows = [(0.0, d, a, alpha, radians(lo), radians(hi)) for d, a, alpha, lo, hi in _YOUBOT]
    chain = Chain.from_dh(rows)
    solids = capsules_along(chain, LINK_RADIUS)
    mount = np.array([ahead, 0.0, 0.0, 0.0])
    return Robot(name, "omni", np.array(footprint), mount, chain, solids, BODY_HEIGHT, _STRAIGHT_UP)


def _bare_arm(name: str) -> Robot:
    chain = Chain.from_dh([(*row, -inf, inf) for row in _ARMS[name]])
    carry = np.radians(_CARRY[name])
    solids = capsules_along(chain, ARM_RADIUS)
    return Robot(name, "omni", np.zeros((1, 2)), np.zeros(4), chain, solids, BODY_HEIGHT, carry)


def _pioneer_parm(name: str) -> Robot:
    h = _PIONEER_MOUNT
    chain = Chain.from_dh([(*row[:4], radians(row[4]), radians(row[5])) for row in _PARM])
    chain = Chain(chain.joints, chain.T_last_tool @ translation(0.0, 0.0, _PARM_TOOL))
    return Robot(
        name,
        "differential",
        np.array([[0.2, 0.185], [-0.24, 0.185], [-0.24, -0.185], [0.2, -0.185]]),
        np.array([h, 0.0, h, 0.0]),
        chain,
        capsules_along(chain, ARM_RADIUS),
        h,
        np.radians([0.0, -90.0, 90.0, 0.0, 0.0]),
        gauge=_PIONEER_GAUGE,
    )
