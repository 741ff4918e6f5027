"""Worlds for the second opinion: the bundled ones, and random ones that may have no plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from regionik.worlds.bundled import world_names
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.limits import Criteria, Speeds
from regionik.worlds.links import capsules_along
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Start, World
from tests.grounds import floor_of
from tests.kinds import BaseKind
from tests.random_arms import through_urdf
from tests.test_overhead_worlds import overhead_world
from tests.test_random_worlds import random_world

KINDS = ("floor", "overhead", "made", "wheels", "urdf")  # of random worlds
STOPS, GROUND = "stops", "ground"  # kinds of their own, made of these: done from stops, on random floors


def soaked_world(kind: str, seed: int) -> World:
    """A random world of one of `KINDS`, of `STOPS` or of `GROUND`, or of the bundled ones the seed-th."""
    if kind == "bundled":
        return load_world(world_names()[seed])
    world = demanding(_drawn(kind, seed), np.random.default_rng([seed, 1]))
    deep = replace(world.rules, tool_contact=0.2, contact_depth=0.05)  # a link is that thick
    return replace(world, rules=deep) if seed % 2 else world


def _drawn(kind: str, seed: int) -> World:
    match kind:
        case "floor":
            return random_world(seed)
        case "overhead":
            return overhead_world(seed, most=6)
        case "made":
            world = random_world(seed)
            return _with(world, made_robot(np.random.default_rng(seed)))
        case "wheels":
            return on_wheels(random_world(seed), seed)
        case "stops":
            return standing_still(_drawn(("floor", "made", "urdf")[seed % 3], seed), seed)
        case "ground":
            return replace(_drawn(KINDS[seed % len(KINDS)], seed), floor=floor_of(seed))
        case _:
            return _with(random_world(seed), through_urdf(random_world(seed).robot))


def _with(world: World, robot: Robot) -> World:
    start = world.start
    return replace(world, robot=robot, start=None if start is None else Start(start.base, robot.carry))


def made_robot(rng: np.random.Generator) -> Robot:
    """An arm of three hinges on a pivot, of random lengths and limits, on a base of random shape."""
    up, out, one, two, tip = rng.uniform([0.08, 0.0, 0.12, 0.1, 0.1], [0.2, 0.05, 0.3, 0.3, 0.3])
    low, high = -rng.uniform(0.8, 2.8, 5), rng.uniform(0.8, 2.8, 5)
    quarter = np.pi / 2
    rows = [
        (0.0, up, out, quarter, low[0], high[0]),
        (0.0, 0.0, one, 0.0, low[1] + quarter, high[1] + quarter),
        (0.0, 0.0, two, 0.0, low[2], high[2]),
        (0.0, 0.0, 0.0, quarter, low[3] + quarter, high[3] + quarter),
        (0.0, tip, 0.0, 0.0, low[4], high[4]),
    ]
    chain = Chain.from_dh(rows)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 7))
    round_ = rng.uniform(0.08, 0.3) * np.column_stack([np.cos(angles), rng.uniform(0.5, 1) * np.sin(angles)])
    outline = np.asarray(shapely.MultiPoint(round_).convex_hull.exterior.coords)[:-1]
    carry = np.array([0.0, quarter, 0.0, quarter, 0.0])
    mount = np.array([rng.uniform(-0.1, 0.15), rng.uniform(-0.05, 0.05), 0.1, rng.uniform(-1, 1)])
    solids = capsules_along(chain, float(rng.uniform(0.02, 0.04)))
    return Robot("made", "omni", outline, mount, chain, solids, 0.1, carry)


def demanding(world: World, rng: np.random.Generator) -> World:
    """The same, now and then with criteria for postures, and now and then with speeds to be timed by."""
    if rng.random() < 0.25:
        payload = float(rng.uniform(0.2, 1.5))
        criteria = Criteria(
            manipulability=float(rng.uniform(0.0, 0.01)) if rng.random() < 0.6 else None,
            joint_margin=float(rng.uniform(0.0, 0.08)) if rng.random() < 0.6 else None,
            effort=float(rng.uniform(3.0, 10.0)) * payload if rng.random() < 0.6 else None,
        )
        robot, rules = replace(world.robot, payload=payload), replace(world.rules, criteria=criteria)
        world = replace(world, robot=robot, rules=rules)
    if rng.random() < 0.25:
        speeds = Speeds(
            joint_velocity=float(rng.uniform(0.3, 2.0)),
            base_velocity=float(rng.uniform(0.1, 1.0)),
            turn_velocity=float(rng.uniform(0.3, 2.0)),
            tool_velocity=float(rng.uniform(0.05, 0.5)) if rng.random() < 0.5 else None,
        )
        world = replace(world, speeds=speeds)
    return world


def on_wheels(world: World, seed: int) -> World:
    """The same with a base that rolls: differential, or a car."""
    kind: BaseKind = "differential" if seed % 2 else "car"
    robot = replace(world.robot, base=kind, turning_radius=0.0 if seed % 2 else 0.4)
    return replace(world, robot=robot, rules=replace(world.rules, heading="free"))


def standing_still(world: World, seed: int) -> World:
    """The same, done from stops, in the order given or in any."""
    rules = world.rules
    if rules.heading == "face_target":  # a base that stands still does not turn to each
        rules = replace(rules, heading="free")
    return replace(world, rules=replace(rules, mode="stops", order="any" if seed % 2 else "given"))
