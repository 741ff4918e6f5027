"""Random arms of five to seven joints on bases of every kind, by DH rows, joint by joint and as URDF."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args
from warnings import catch_warnings, filterwarnings

import numpy as np
import shapely

from regionik.output.urdf import robot_to_urdf
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, capsules_along
from regionik.worlds.robot import Robot
from regionik.worlds.urdf.loader import load_robot
from tests.kinds import BaseKind, LinkSolid
from tests.maths import Array, rot_x, rot_z, translation

ARMS = (
    "wrists",
    "offsets",
    "slides",
    "tilted",
)  # spherical wrists, links set off, a slide, a tilted first axis
KINDS = (*ARMS, "urdf arms")  # of robots: the last have any of these arms, written as URDF and read back
QUARTER = np.pi / 2
SIDES = 24  # of a footprint that is as good as round


def random_robot(kind: str, rng: np.random.Generator) -> Robot:
    """Return a robot of one of `KINDS`."""
    if kind == "urdf arms":
        return through_urdf(random_robot(str(rng.choice(ARMS)), rng))
    chain = random_arm(kind, rng)
    base: BaseKind = rng.choice(get_args(BaseKind))
    height = float(rng.uniform(0.15, 0.4))
    return Robot(
        name=kind,
        base=base,
        footprint=random_footprint(rng),
        mount=np.array([rng.uniform(-0.15, 0.15), rng.uniform(-0.05, 0.05), height, rng.uniform(-1, 1)]),
        chain=chain,
        solids=random_links(chain, rng),
        body_height=height,
        turning_radius=float(rng.uniform(0.3, 0.6)) if base == "car" else 0.0,
    )


def random_arm(kind: str, rng: np.random.Generator) -> Chain:
    """Return an arm of a kind of `ARMS`, upright at zero more or less."""
    match kind:
        case "wrists":
            return Chain.from_dh([(*row, *_limits(rng)) for row in _wrist_rows(rng)])
        case "offsets":
            return Chain.from_dh([(*row, *_limits(rng)) for row in _offset_rows(rng)])
        case "slides" | "tilted":
            return _joint_by_joint(kind, rng)
        case _:
            raise ValueError(f"expected one of {', '.join(ARMS)}, got {kind}")


def _limits(rng: np.random.Generator) -> tuple[float, float]:
    """Limits of a revolute joint, none of one in seven [rad]."""
    if rng.random() < 1 / 7:
        return -np.inf, np.inf
    return -float(rng.uniform(1.4, 2.9)), float(rng.uniform(1.4, 2.9))


def _wrist_rows(rng: np.random.Generator) -> list[tuple[float, float, float, float]]:
    """Return theta, d, a, alpha of six or seven joints, of which the last three axes meet."""
    up, upper, fore, tip = rng.uniform([0.05, 0.2, 0.2, 0.08], [0.25, 0.45, 0.4, 0.2])
    aside = float(rng.choice([0.0, rng.uniform(0.02, 0.1)]))
    wrist = [(0.0, fore, 0.0, -QUARTER), (0.0, 0.0, 0.0, QUARTER), (0.0, tip, 0.0, 0.0)]
    if rng.random() < 0.5:
        pivot = (0.0, up, aside, -QUARTER)
        return [pivot, (-QUARTER, 0.0, upper, 0.0), (0.0, 0.0, aside, -QUARTER), *wrist]
    shoulder = [(0.0, up, 0.0, -QUARTER), (0.0, 0.0, 0.0, QUARTER)]
    return [*shoulder, (0.0, upper, aside, QUARTER), (0.0, 0.0, -aside, -QUARTER), *wrist]


def _offset_rows(rng: np.random.Generator) -> list[tuple[float, float, float, float]]:
    """Return theta, d, a, alpha of five to seven joints, no three axes of which need meet."""
    rows = [
        (rng.uniform(-1, 1), rng.uniform(0.05, 0.25), rng.choice([0.0, 0.06]), rng.choice([-1, 1]) * QUARTER)
    ]
    for _ in range(rng.integers(3, 6)):
        twist = rng.choice([0.0, 0.0, -QUARTER, QUARTER, rng.uniform(-1.5, 1.5)])
        rows.append((rng.uniform(-1, 1), rng.choice([0.0, 0.05, 0.1, 0.2]), rng.uniform(0.05, 0.3), twist))
    rows.append((0.0, rng.uniform(0.05, 0.2), 0.0, 0.0))
    return [tuple(float(value) for value in row) for row in rows]  # type: ignore[misc]


def _joint_by_joint(kind: str, rng: np.random.Generator) -> Chain:
    """Return joints about any axes; one slides, or the first one's axis is tilted."""
    count = int(rng.integers(5, 8))
    slide = int(rng.integers(count)) if kind == "slides" else -1
    tilt = float(rng.uniform(0.2, QUARTER)) if kind == "tilted" else 0.0
    frames = [rot_z(rng.uniform(-np.pi, np.pi)) @ rot_x(tilt)]
    frames += [translation(*rng.uniform([-0.05, -0.05, 0.06], [0.05, 0.05, 0.25])) for _ in range(count - 1)]
    axes = [np.eye(3)[2], *(_axis(rng) for _ in range(count - 1))]
    joints = [
        Joint(f"j{k + 1}", "prismatic", 0.0, float(rng.uniform(0.1, 0.35)), T, np.eye(3)[2])
        if k == slide
        else Joint(f"j{k + 1}", "revolute", *_limits(rng), T, axis)
        for k, (T, axis) in enumerate(zip(frames, axes, strict=True))
    ]
    return Chain(
        tuple(joints), translation(0.0, 0.0, rng.uniform(0.08, 0.2)) @ rot_x(rng.choice([0.0, QUARTER]))
    )


def _axis(rng: np.random.Generator) -> Array:
    """Return a unit axis, three in four along x, y or z."""
    drawn = np.eye(3)[rng.choice([0, 1, 1, 2])] if rng.random() < 0.75 else rng.normal(size=3)
    axis: Array = drawn / np.linalg.norm(drawn)
    return axis


def random_links(chain: Chain, rng: np.random.Generator) -> tuple[LinkSolid, ...]:
    """Return a capsule a link, or, of one in four, a box about its axis."""
    radius = float(rng.uniform(0.02, 0.04))

    def links() -> Iterator[LinkSolid]:
        for capsule in capsules_along(chain, radius):
            along = capsule.end - capsule.start
            length = float(np.linalg.norm(along))
            if rng.random() < 0.75 or length < 2 * radius:
                yield capsule
                continue
            T = np.eye(4)
            T[:3, :3] = _turned_to(along / length)
            T[:3, 3] = (capsule.start + capsule.end) / 2
            yield LinkBox(capsule.link, capsule.name, T, np.array([1.5 * radius, 2 * radius, length]))

    return tuple(links())


def _turned_to(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is an axis."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    return np.column_stack([side, np.cross(axis, side), axis])


def span_of(chain: Chain) -> tuple[float, float]:
    """Return the height of the shoulder over the arm's base, and the length of what a pivot swings [m].

    Lifts before the pivot stand in the middle of their travel, which the arm makes up for by half of it.
    """
    pivot = next(k for k, joint in enumerate(chain.joints) if joint.kind == "revolute")
    middle, steps = np.zeros(chain.dof), chain.link_vectors
    middle[:pivot] = (chain.lower[:pivot] + chain.upper[:pivot]) / 2
    T = chain.frames(middle)[pivot]
    travel = sum(joint.upper - joint.lower for joint in chain.joints[:pivot]) / 2
    length = float(sum(np.linalg.norm(step) for step in steps[pivot + 1 :])) + travel
    return float((T[:3, 3] + T[:3, :3] @ steps[pivot])[2]), length


def random_footprint(rng: np.random.Generator) -> Array:
    """Return corners of a disc, a rectangle set off or a polygon (n, 2) [m]."""
    match rng.integers(3):
        case 0:
            angles = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
            return rng.uniform(0.15, 0.35) * np.column_stack([np.cos(angles), np.sin(angles)])
        case 1:
            rear, front, half = rng.uniform([0.15, 0.2, 0.15], [0.3, 0.45, 0.3])
            return np.array([[-rear, -half], [front, -half], [front, half], [-rear, half]])
        case _:
            angles = rng.uniform(0, 2 * np.pi, 7) / 7 + 2 * np.pi * np.arange(7) / 7
            rim = rng.uniform(0.2, 0.4, (7, 1)) * np.column_stack([np.cos(angles), 0.7 * np.sin(angles)])
            return np.asarray(shapely.MultiPoint(rim).convex_hull.exterior.coords)[:-1]


def through_urdf(robot: Robot) -> Robot:
    """Return a robot written as URDF and read back; its base is the box that URDF has of it."""
    with TemporaryDirectory() as folder, catch_warnings():
        path = Path(folder) / "robot.urdf"
        path.write_text(robot_to_urdf(robot, shapely.box(-2, -2, 6, 2)))
        filterwarnings("ignore", message=".*the tool point lies .* inside")
        filterwarnings("ignore", message=".* this pair is not checked")  # the youBot's link 2 and its base
        radius = robot.turning_radius or None
        read = load_robot(path, base=robot.base, tip="tool", root="base", turning_radius=radius)
    return replace(read, carry=robot.carry)
