"""Random rooms with tables, shelves and columns, for robots with columns, masts and torsos on their bases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import BASE, LinkBox, LinkCapsule, capsules_along
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.kinds import LinkSolid, Solid
from tests.maths import Array, translation
from tests.random_arms import random_arm, random_footprint, random_links, span_of
from tests.soaked import made_robot

BODIES = ("column", "mast", "torso", "plain")  # of robots, on their bases
FLOOR = shapely.box(-1.5, -2.0, 4.5, 2.0)
DISC = 16  # corners of a footprint that is as good as round


def furnished_world(seed: int) -> World:
    """A room of tables, shelves and columns; set-points lie over tables and in shelves, done from stops."""
    rng = np.random.default_rng([seed, 11])
    robot = robot_with(BODIES[seed % len(BODIES)], rng)
    height, length = span_of(robot.chain)
    shoulder = height + float(robot.mount[2])
    solids, spots = list[Solid](), list[Array]()
    for k in range(rng.integers(1, 4)):
        top = max(float(shoulder + rng.uniform(-0.5, 0.2) * length), robot.body_height + 0.05)
        piece, over = (table if rng.random() < 0.7 else shelf)(f"{k}", top, rng)
        solids += piece
        spots += over
    solids += [column(f"column {k}", rng) for k in range(rng.integers(0, 3))]
    chosen = rng.permutation(len(spots))[: rng.integers(2, 8)]
    is_fixed = rng.random() < 0.15 and robot.base == "omni"
    in_any = rng.random() < 0.5
    rules = Rules(
        clearance=float(rng.uniform(0.0, 0.05)),
        heading="fixed" if is_fixed else "free",
        mode="stops",
        order="any" if in_any else "given",
        stop_tolerance=float(rng.uniform(0.0, 0.02)),
    )
    task = tuple(Target(spots[k]) for k in chosen.tolist())
    return World(f"furnished {seed}", robot, Floor(FLOOR), tuple(solids), task, rules)


def robot_with(body: str, rng: np.random.Generator) -> Robot:
    """A robot whose arm stands on a column, in front of a mast or on a torso that rises, or on its base."""
    if body == "plain":
        return robot_named("youbot-real") if rng.random() < 0.5 else made_robot(rng)
    if rng.random() < 0.6:
        chain = made_robot(rng).chain
        links: tuple[LinkSolid, ...] = capsules_along(chain, float(rng.uniform(0.02, 0.04)))
    else:
        chain = random_arm(str(rng.choice(["wrists", "offsets"])), rng)
        links = random_links(chain, rng)
    low, high, wide = (
        float(rng.uniform(0.1, 0.3)),
        float(rng.uniform(0.45, 0.9)),
        float(rng.uniform(0.05, 0.12)),
    )
    outline = disc(float(rng.uniform(0.18, 0.3))) if rng.random() < 0.6 else random_footprint(rng)
    x = float(rng.uniform(-0.1, 0.1))
    mount = np.array([x, 0.0, high, float(rng.uniform(-1, 1))])
    robot = Robot(body, "omni", outline, mount, chain, links, low)
    if body == "torso":
        return rising(robot, wide)
    if body == "mast":
        top, behind = high + float(rng.uniform(0.2, 0.5)), x - wide - 0.08
        mast = LinkCapsule(BASE, "mast", np.array([behind, 0, low]), np.array([behind, 0, top]), wide / 2)
        return replace(robot, base_solids=(mast, pillar("column", low, high, wide / 2, x)))
    return replace(robot, base_solids=(pillar("column", low, high, wide, x),))


def pillar(name: str, low: float, high: float, wide: float, x: float) -> LinkBox:
    """A box of the base between two heights [m]."""
    return LinkBox(
        BASE, name, translation(x, 0, (low + high) / 2), np.array([2 * wide, 2 * wide, high - low - 0.05])
    )


def rising(robot: Robot, wide: float) -> Robot:
    """The same with its arm on a torso, which rises by up to 0.3 m from the top of the base on."""
    up = Joint("torso", "prismatic", 0.0, 0.3, np.eye(4), np.array([0.0, 0.0, 1.0]))
    chain = Chain((up, *robot.chain.joints), robot.chain.T_last_tool)
    height = float(robot.mount[2]) - robot.body_height
    size = np.array([2 * wide, 2 * wide, height - 0.06])
    torso = LinkBox(0, "torso", translation(0, 0, -height / 2 - 0.01), size)
    moved = tuple(replace(one, link=one.link + 1) for one in robot.solids)
    return replace(robot, chain=chain, solids=(torso, *moved), carry=np.empty(0))


def disc(radius: float) -> Array:
    """Corners of a footprint that is as good as round (n, 2) [m]."""
    turns = 2 * np.pi * np.arange(DISC) / DISC
    return radius * np.column_stack([np.cos(turns), np.sin(turns)])


def table(name: str, top: float, rng: np.random.Generator) -> tuple[list[Solid], list[Array]]:
    """A table with its top at a height, and places over it, mostly near its edge [m]."""
    middle, size = rng.uniform([0.0, -1.0], [3.0, 1.0]), rng.uniform([0.5, 0.4], [1.4, 0.8])
    thick = float(rng.uniform(0.02, 0.05))
    solids: list[Solid] = [
        Box(f"table {name}", np.array([*size, thick]), np.array([*middle, top - thick / 2]))
    ]
    legs = (size / 2 - 0.03) * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    for k, leg in enumerate((middle + legs).tolist()):
        tall = top - thick
        solids.append(Box(f"leg {k} of {name}", np.array([0.04, 0.04, tall]), np.array([*leg, tall / 2])))
    share = rng.uniform(-1, 1, (6, 2))
    share[np.arange(6), rng.integers(0, 2, 6)] = rng.choice([-0.85, 0.85], 6)
    spots = np.column_stack([middle + share * size / 2, top + rng.uniform(0.06, 0.25, 6)])
    return solids, list(spots)


def shelf(name: str, top: float, rng: np.random.Generator) -> tuple[list[Solid], list[Array]]:
    """Two boards over one another on a back wall, the lower at a height, and places in the front [m]."""
    middle = rng.uniform([0.0, -1.0], [3.0, 1.0])
    wide, deep, gap = rng.uniform([0.5, 0.25, 0.3], [1.2, 0.4, 0.5])
    back = Box(f"back of {name}", np.array([wide, 0.03, top + gap]), np.array([*middle, (top + gap) / 2]))
    boards = [
        Box(
            f"board {k} of {name}",
            np.array([wide, deep, 0.03]),
            np.array([middle[0], middle[1] - deep / 2, z]),
        )
        for k, z in enumerate((top, top + gap))
    ]
    share = rng.uniform([-0.4, -1.0, 0.3], [0.4, -0.7, 0.7], (4, 3))
    spots = np.array([*middle, top]) + share * (wide, deep, gap)
    return [back, *boards], list(spots)


def column(name: str, rng: np.random.Generator) -> Solid:
    """A column of the room, from the floor or hanging over it."""
    x, y = rng.uniform([-0.5, -1.5], [4.0, 1.5])
    low = float(rng.choice([0.0, rng.uniform(0.3, 0.8)]))
    return Cylinder(name, float(rng.uniform(0.05, 0.15)), 2.0 - low, np.array([x, y, 1.0 + low / 2]))
