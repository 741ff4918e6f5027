"""Rasters of full poses on a wall and on a bent panel, and arms on platforms that do them."""

from __future__ import annotations

from typing import Literal

import numpy as np
import shapely

from regionik.worlds.chain import Chain
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box, Mesh
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.kinds import BaseKind, Solid
from tests.known_arms import H, known_robot
from tests.maths import Array

PLATFORM = 0.9, 0.6, 0.45  # length, width, height [m]
TOOL = 0.13  # of the flange along its z [m]
SPACING, PITCH, STANDOFF = 0.06, 0.12, 0.07  # of rows, of poses on a row, of the path from the wall [m]
DEPTH, WAVE = 0.06, 5.0  # of the wall's bends, and from one to the next [m]
RADIUS, ARC = 2.0, 0.45  # of the bent panel [m], [rad]
Clutter = Literal["open", "clutter", "bollard"]

UR10E = [
    (0, 0.1807, 0, H, -6.28, 6.28), (0, 0, -0.6127, 0, -6.28, 6.28), (0, 0, -0.57155, 0, -3.14, 3.14),
    (0, 0.17415, 0, H, -6.28, 6.28), (0, 0.11985, 0, -H, -6.28, 6.28), (0, 0.11655 + TOOL, 0, 0, -6.28, 6.28),
]  # fmt: skip


def carried(arm: str, base: BaseKind = "omni") -> Robot:
    """Return a UR10e with a tool, or one of `tests.known_arms.NAMES`, on a platform that drives."""
    chain = Chain.from_dh(UR10E) if arm == "UR10e" else known_robot(arm).chain
    length, width, height = PLATFORM
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length / 2, width / 2)
    return Robot(
        name=arm,
        base=base,
        footprint=corners,
        mount=np.array([0.2, 0.0, height, 0.0]),
        chain=chain,
        solids=capsules_along(chain, 0.05),
        body_height=height,
        turning_radius=0.6 if base == "car" else 0.0,
    )


def raster(robot: Robot, clutter: Clutter, columns: int = 10, rows: int = 2, height: float = 0.9) -> World:
    """Return a raster of full poses on a wall that bends gently, the tool straight into the wall."""
    x = np.arange(columns) * PITCH
    along = np.concatenate([x if k % 2 == 0 else x[::-1] for k in range(rows)])
    task = tuple(
        _onto(np.array([spot, _wall(spot), height + SPACING * (k // columns)]), _slope(spot))
        for k, spot in enumerate(along.tolist())
    )
    solids = (*_wall_boxes(x[-1]), *_clutter(clutter, x[-1]))
    floor = Floor(shapely.box(-2.0, -3.5, x[-1] + 2.0, 0.6))
    rules = Rules(clearance=0.05, arm_clearance=0.01, path_tolerance=0.001, tool_contact=0.0)
    return World(f"raster {clutter} {robot.name}", robot, floor, solids, task, rules)


def _wall(x: float) -> float:
    return DEPTH * float(np.sin(2 * np.pi * x / WAVE + 0.4) - np.sin(0.4))


def _slope(x: float) -> float:
    return DEPTH * 2 * np.pi / WAVE * float(np.cos(2 * np.pi * x / WAVE + 0.4))


def _onto(spot: Array, slope: float) -> Target:
    """Return a full pose off a spot on the wall: z into it, x along it, y down."""
    z = np.array([-slope, 1.0, 0.0]) / np.hypot(1.0, slope)
    x = np.array([z[1], -z[0], 0.0])
    return Target(spot - STANDOFF * z, orientation=np.column_stack([x, np.cross(z, x), z]), cone=0.01)


def _wall_boxes(length: float) -> tuple[Solid, ...]:
    """Boxes a third of a metre wide behind the wall, each as far in front as it may be."""
    ends = np.linspace(-1.0, length + 1.0, int(np.ceil((length + 2.0) / 0.35)) + 1)
    boxes = list[Solid]()
    for k, (a, b) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
        yaw = float(np.arctan2(_wall(b) - _wall(a), b - a))
        normal = np.array([-np.sin(yaw), np.cos(yaw)])
        spots = np.array([[x, _wall(x)] for x in np.linspace(a, b, 9)])
        middle = (spots[0] + spots[-1]) / 2 + normal * (((spots - spots[0]) @ normal).max() + 0.05)
        size = np.array([np.hypot(*(spots[-1] - spots[0])), 0.1, 2.2])
        boxes.append(Box(f"wall {k}", size, np.array([*middle, 1.1]), yaw))
    return tuple(boxes)


def _clutter(kind: Clutter, length: float) -> tuple[Solid, ...]:
    """Nothing, what stands about such a wall, or a low post that the base has to go round."""
    if kind == "open":
        return ()
    middle = length / 2
    if kind == "bollard":
        return (_box("bollard", (0.3, 0.3, 0.5), (middle, _wall(middle) - 0.8, 0.25)),)
    return (
        _box("pilaster", (0.25, 0.3, 2.2), (-0.5, _wall(-0.5) - 0.15, 1.1)),
        _box("crate", (0.5, 0.3, 0.35), (middle, _wall(middle) - 0.29, 0.175)),
        _box("column", (0.25, 0.25, 2.2), (0.7, -1.95, 1.1)),
        _box("duct", (length, 0.2, 0.2), (middle, -0.75, 1.85)),
    )


def _box(name: str, size: tuple[float, float, float], center: tuple[float, float, float]) -> Solid:
    return Box(name, np.array(size), np.array(center))


def bent_panel(robot: Robot, columns: int = 8, rows: int = 3) -> World:
    """Return a raster on a panel bent about a level axis, the tool square to it and 0.1 m off it."""
    along, around = np.linspace(0.3, 2.2, columns), np.linspace(-ARC, ARC, rows + 2)[1:-1]
    task = tuple(
        _square(float(x), float(turn))
        for k, turn in enumerate(around)
        for x in (along if k % 2 == 0 else along[::-1])
    )
    rules = Rules(clearance=0.1, arm_clearance=0.02)
    floor = Floor(shapely.box(-2.0, -3.0, 4.5, 2.0))
    return World(f"bent panel {robot.name}", robot, floor, (_panel(),), task, rules)


def _square(x: float, turn: float) -> Target:
    """Return a pose before the panel, whose axis lies at y = 2 and 1.2 m above the floor."""
    z = np.array([0.0, np.cos(turn), -np.sin(turn)])
    spot = np.array([x, RADIUS, 1.2]) - (RADIUS + 0.1) * np.array([0.0, 1.0, 0.0]) * np.cos(turn)
    spot[2] += (RADIUS + 0.1) * np.sin(turn)
    return Target(spot, orientation=np.column_stack([[1.0, 0, 0], np.cross(z, [1.0, 0, 0]), z]), cone=0.1)


def _panel() -> Mesh:
    """Return the panel, a shell of one centimetre."""
    around = np.linspace(-ARC, ARC, 9)
    rims = [
        np.column_stack([np.full(9, x), RADIUS - r * np.cos(around), 1.2 + r * np.sin(around)])
        for r in (RADIUS, RADIUS - 0.01)
        for x in (0.0, 2.5)
    ]
    at = np.arange(36).reshape(4, 9)  # outside at 0 and 2.5 m, inside at both
    loop = [at[0], at[1], at[3], at[2]]
    quads = [
        (a[k], a[k + 1], b[k + 1], b[k])
        for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)
        for k in range(8)
    ]
    quads += [
        (at[0, k], at[2, k], at[3, k], at[1, k]) if k else (at[0, k], at[1, k], at[3, k], at[2, k])
        for k in (0, 8)
    ]
    faces = [face for a, b, c, d in quads for face in ((a, c, b), (a, d, c))]
    return Mesh("panel", np.vstack(rims), np.array(faces))
