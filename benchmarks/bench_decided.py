"""Random targets in random worlds: how many stay undecided, and does what was decided hold?

Half of the targets leave the tool's direction free, half ask for that of their world. Every "reachable" goes
through `verify`. Of those that are said to be out of reach some are drawn, and each is put to a brute force:
postures with the tool on the target, drawn at random all over the arm's plane, distance, pitch and headings;
those that come nearest to being an answer are then moved about at random as long as that brings them nearer.
Exits 1 where anything is refuted, or more than one in a thousand stays undecided.
Run: python -m benchmarks.bench_decided [--worlds N] [--targets N] [--drawn N] [--starts N]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.collision_checking import is_clear
from regionik.planners.collision.proximity import nearest
from regionik.planners.collision.robot_bodies import RobotScene
from regionik.planners.driving.footprint import fits
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.planners.geometry.angles import fit, wrap
from regionik.planners.kernels import compiled
from regionik.planners.reach.planar_cells import ArmMount
from regionik.planners.solvers.planar_kinematics import two_link_angles
from regionik.postures.collision_checker import contact_for
from regionik.reachability.any_base import prepared, writable
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.verification.verifier import verify_answers
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World
from tests.test_overhead_worlds import overhead_world
from tests.test_random_worlds import random_world

BEST, STEPS = 8, 300  # samples that are moved about, and how often each


class Question(NamedTuple):
    """What a posture is asked, as values for kernels."""

    target: Array
    direction: Array
    cone: float
    fixed: bool
    tool_on: int
    lower: Array
    upper: Array


@compiled
def placed(mount: ArmMount, asked: Question, at: Array, base: Array, q: Array) -> float:
    """Base and joints with the tool on the target; how far joints and tool are beyond what they may [rad].

    ``at`` holds the plane's yaw, the last link's pitch, the axis' distance, the pivot's turn, and the elbow.
    """
    plane = mount.plane
    x = at[2] - plane.shoulder_r - plane.lengths[2] * np.cos(at[1])
    z = asked.target[2] - plane.shoulder_z - plane.lengths[2] * np.sin(at[1])
    lead, root, tip, ok = two_link_angles(plane.lengths[0], plane.lengths[1], x, z)
    if not ok:
        return np.inf
    elbow = 1.0 if at[4] > 0.0 else -1.0
    angles = (lead + elbow * root, lead - elbow * tip, at[1])
    over, before = 0.0, 0.0
    for k in range(3):
        bend, beyond = fit(angles[k] - before, plane.lower[k], plane.upper[k])
        q[k + 1] = mount.sign[k] * (bend - mount.offset[k])
        over, before = max(over, beyond), angles[k]
    q[0] = wrap(at[0] - mount.yaw - mount.zero) if asked.fixed else at[3]
    over = max(over, asked.lower[0] - q[0], q[0] - asked.upper[0])
    base[2] = mount.yaw if asked.fixed else wrap(at[0] - mount.zero - q[0])
    c, s = np.cos(base[2]), np.sin(base[2])
    base[0] = asked.target[0] - at[2] * np.cos(at[0]) - (c * mount.mount[0] - s * mount.mount[1])
    base[1] = asked.target[1] - at[2] * np.sin(at[0]) - (s * mount.mount[0] + c * mount.mount[1])
    level, d = np.cos(at[1]), asked.direction
    along = d[0] * level * np.cos(at[0]) + d[1] * level * np.sin(at[0]) + d[2] * np.sin(at[1])
    return float(max(over, np.arccos(min(1.0, max(-1.0, along))) - asked.cone))


@compiled
def screened(
    mount: ArmMount,
    scene: RobotScene,
    avoids: bool,
    room: FootprintScene,
    asked: Question,
    samples: Array,
    base: Array,
    q: Array,
) -> tuple[int, Array]:
    """Row of a sample that is an answer, -1 for none; and how each falls short."""
    short = np.empty(len(samples))
    for i in range(len(samples)):
        over = placed(mount, asked, samples[i], base, q)
        short[i] = 10.0 + over
        if over <= 0.0:
            short[i] = 5.0
            if fits(room, base[0], base[1], base[2]):
                short[i] = 0.0
                if not avoids or is_clear(scene, 0.0, base, q, asked.tool_on):
                    return i, short
    return -1, short


def refuted(world: World, target: Target, starts: int, rng: np.random.Generator) -> bool:
    """Whether brute force finds a configuration."""
    mount, room, robot = prepared(scene_of(world)).mount, scene_of(world).footprint, world.robot
    scene, avoids = prepared(scene_of(world)).scene, world.rules.avoidance
    contact = contact_for(world, [target])
    free = target.direction is None
    direction = np.array([0.0, 0.0, 1.0]) if target.direction is None else writable(target.direction)
    asked = Question(
        writable(target.position), direction, np.pi if free else target.cone, world.rules.heading == "fixed",
        int(contact.owner[0]) if len(contact.owner) else -1,
        writable(robot.chain.lower), writable(robot.chain.upper),
    )  # fmt: skip
    reach = float(mount.plane.lengths.sum() + abs(mount.plane.shoulder_r))
    low = np.array([-np.pi, -np.pi, -reach, mount.low, -1.0])
    high = np.array([np.pi, np.pi, reach, mount.high, 1.0])
    if not free and target.cone < np.pi / 2:
        pitch = np.arctan2(direction[2], np.hypot(*direction[:2]))
        back = rng.random(starts) < 0.5
        low[1], high[1] = pitch - target.cone, pitch + target.cone
    samples = rng.uniform(low, high, (starts, 5))
    if not free and target.cone < np.pi / 2:
        azimuth = np.arctan2(direction[1], direction[0])
        if np.hypot(*direction[:2]) > np.sin(target.cone):  # the plane must lie near the direction
            samples[:, 0] = azimuth + rng.uniform(-1, 1, starts) * np.pi / 2
            narrow = rng.random(starts) < 0.8
            samples[narrow, 0] = azimuth + rng.uniform(-2, 2, int(narrow.sum())) * target.cone
        samples[back, 1], samples[back, 0] = np.pi - samples[back, 1], samples[back, 0] + np.pi
    base, q = np.empty(3), writable(robot.carry)
    row, short = screened(mount, scene, avoids, room, asked, samples, base, q)
    if row >= 0:
        return True
    return any(
        _climbs(world, mount, room, asked, samples[i], (base, q), rng)
        for i in np.argsort(short, kind="stable")[:BEST].tolist()
    )


def _climbs(
    world: World, mount: ArmMount, room: FootprintScene, asked: Question, at: Array, out: tuple[Array, Array],
    rng: np.random.Generator,
) -> bool:  # fmt: skip
    """Whether small random moves turn a sample into an answer."""
    best, step = -np.inf, 0.3
    for _ in range(STEPS):
        tried = at + step * rng.normal(size=5) * [1, 1, 0.3, 1, 0]
        over = placed(mount, asked, tried, *out)
        value = -10.0 - over
        if over <= 0.0:
            value = -5.0
            if fits(room, *out[0].tolist()):
                value = _room(world, asked, *out)
        if value >= 0.0:
            return True
        if value > best:
            best, at, step = value, tried, min(0.3, 1.5 * step)
        else:
            step = max(1e-4, 0.93 * step)
    return False


def _room(world: World, asked: Question, base: Array, q: Array) -> float:
    """By how much the arm keeps its distance [m]."""
    collision = scene_of(world).collision
    if not collision.enabled:
        return 0.0
    contact = contact_for(world, [Target(asked.target)])
    touch = nearest(collision.bodies, base, q, contact=contact)
    return collision.room(touch)


def world_of(seed: int) -> World:
    return random_world(seed) if seed % 2 else overhead_world(5 * seed + seed // 2 % 2)  # arms in one plane


def targets_of(world: World, count: int, rng: np.random.Generator) -> list[Target]:
    """Spots where the floor is, and a little beyond."""
    x0, y0, x1, y1 = world.floor.polygon.bounds
    spots = rng.uniform([x0, y0, 0.02], [x1, y1, 0.75], (count, 3))
    first = world.task[0]
    return [Target(spot, first.direction if k % 2 else None, first.cone) for k, spot in enumerate(spots)]


def main(worlds: int, targets: int, drawn: int, starts: int) -> int:
    rng, told = np.random.default_rng(0), Counter[str]()
    out: list[tuple[World, Target, str]] = []
    began, wrong = time.perf_counter(), 0
    for seed in range(worlds):
        world = world_of(seed)
        asked = targets_of(world, targets, rng)
        answer = reach(world, asked)
        told.update(answer.verdict.tolist())
        report = verify_answers(world, answer, asked)
        wrong += len(report.violations)
        for i in np.flatnonzero(answer.verdict == "unreachable").tolist():
            out.append((world, asked[i], "posture" if "in no posture" in answer.reason[i] else "area"))
        for i in np.flatnonzero(answer.verdict == "undecided").tolist():
            print(f"{world.name}: {answer.reason[i]} Gap {answer.gap[i]:.4f} m", flush=True)
        if (seed + 1) % 10 == 0:
            print(f"{seed + 1} worlds, {time.perf_counter() - began:.0f} s: {dict(told)}", flush=True)
    count = sum(told.values())
    share = told["undecided"] / count
    print(f"{count} targets: {dict(told)}, {100 * share:.3f} % undecided; verify turned {wrong} down")
    kinds = {kind: [one for one in out if one[2] == kind] for kind in ("posture", "area")}
    print(f"out of reach: { ({kind: len(some) for kind, some in kinds.items()}) }")
    half = [kinds["posture"][k] for k in rng.permutation(len(kinds["posture"]))[: drawn // 2]]
    rest = [kinds["area"][k] for k in rng.permutation(len(kinds["area"]))[: drawn - len(half)]]
    lost = 0
    for k, (world, target, kind) in enumerate([*half, *rest]):
        if refuted(world, target, starts, rng):
            lost += 1
            print(f"refuted ({kind}): {world.name}, {target}", flush=True)
        if (k + 1) % 100 == 0:
            print(f"{k + 1} tried by force, {lost} refuted, {time.perf_counter() - began:.0f} s", flush=True)
    return 1 if lost or wrong or share > 1e-3 else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--worlds", type=int, default=50)
    parser.add_argument("--targets", type=int, default=200)
    parser.add_argument("--drawn", type=int, default=500)
    parser.add_argument("--starts", type=int, default=20_000)
    options = parser.parse_args()
    sys.exit(main(options.worlds, options.targets, options.drawn, options.starts))
