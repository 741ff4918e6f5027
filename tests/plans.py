"""Worlds and plans made by hand, good and broken, for tests of what reads and checks plans.

The plan is honest where it is cheap to be: areas are cut by their solids, bases stand inside them, the tool
is on every set-point by closed-form inverse kinematics, and states between set-points are interpolated.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon, box
from shapely.ops import nearest_points

from regionik.output.plan_file import save_plan
from regionik.values import Configuration, Motion, Plan, PlannedArea, Report, Violation
from regionik.verification.verifier import verify
from regionik.worlds.chain import Chain
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.kinds import Solid
from tests.maths import Array

DH = (
    (0.0, 0.147, 0.033, np.pi / 2),
    (0.0, 0.0, 0.155, 0.0),
    (0.0, 0.0, 0.135, 0.0),
    (0.0, 0.0, 0.0, np.pi / 2),
    (0.0, 0.2175, 0.0, 0.0),
)
LIMITS: Array = np.radians(np.array([[-169, 169], [0, 155], [-146, 151], [-12.5, 192.5], [-167.5, 167.5]]))
Q = np.array([0.0, 1.2, -1.0, 1.0, 0.0])  # the tool 0.424 m ahead of the base and 0.239 m up
FLOOR = box(-1.0, -1.5, 3.0, 1.5)
RULES = Rules(clearance=0.2, step=0.1)
FOOTPRINT = ((0.29, 0.19), (-0.29, 0.19), (-0.29, -0.19), (0.29, -0.19))


def plan_to_document(plan: Plan) -> dict[str, Any]:
    """A plan as its file has it."""
    document: dict[str, Any] = json.loads(plan_text(plan))
    return document


def plan_text(plan: Plan) -> str:
    """The text of a plan's file."""
    with TemporaryDirectory() as folder:
        save_plan(plan, file := Path(folder) / "plan.json")
        return file.read_text("utf-8")


def youbot(
    footprint: tuple[tuple[float, float], ...] = ((0.0, 0.0),), mount: tuple[float, ...] = (0, 0, 0, 0)
) -> Robot:
    """The paper's arm on a point base, or on another footprint."""
    chain = Chain.from_dh([(*row, *limits) for row, limits in zip(DH, LIMITS.tolist(), strict=True)])
    carry = np.array([0.0, 2.6, -2.0, 1.5, 0.0])
    return Robot(
        "youbot",
        "omni",
        np.array(footprint),
        np.array(mount),
        chain,
        capsules_along(chain, 0.035),
        0.14,
        carry,
    )


def l_shape() -> World:
    """A sine past an L of two bars and a block, 40 set-points."""
    k = np.arange(40)
    targets = np.column_stack([0.3 + 0.08 * k, 0.65 + 0.12 * np.sin(2 * np.pi * k / 20), np.full(40, 0.25)])
    obstacles = (
        Box("L long", np.array([0.9, 0.1, 0.1]), np.array([1.45, 0.65, 0.05])),
        Box("L short", np.array([0.1, 1.0, 0.1]), np.array([1.85, 0.2, 0.05])),
        Box("block", np.array([0.3, 0.3, 0.1]), np.array([2.75, 0.85, 0.05])),
    )
    return World(
        name="l_shape",
        robot=youbot(),
        floor=Floor(box(-0.5, -1.0, 4.0, 2.0)),
        obstacles=obstacles,
        task=tuple(Target(t) for t in targets),
        rules=Rules(clearance=0.2),
        start=Start(np.array([0.0, 1.0, 0.0]), youbot().carry),
        about="made by hand",
    )


def every_solid() -> World:
    """One solid of every kind, map cells, and a robot with a footprint."""
    corners = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.4, 0], [0, 0, 0.5]]) + [2.2, 1.2, 0.0]
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    ring = Polygon(box(3.0, 0.0, 3.6, 0.6).exterior, [box(3.2, 0.2, 3.4, 0.4).exterior])
    obstacles: tuple[Solid, ...] = (
        Box("crate", np.array([0.4, 0.3, 0.5]), np.array([1.5, -0.6, 0.25]), 0.5),
        Cylinder("post", 0.1, 1.2, np.array([0.6, 1.3, 0.6])),
        Sphere("ball", 0.2, np.array([-0.1, 1.5, 0.8])),
        Prism("shelf", ring, 0.9, 1.0),
        Mesh("wedge", corners, faces),
    )
    cells = tuple(
        Prism(f"cell {k}", box(-0.5, -1 + 0.1 * k, -0.4, -0.9 + 0.1 * k), 0.0, 1.0) for k in range(0, 30, 2)
    )
    return World(
        name="every_solid",
        robot=youbot(FOOTPRINT, (0.143, 0.0, 0.11, 0.0)),
        floor=Floor(box(-0.5, -1.0, 4.0, 2.0), cells),
        obstacles=obstacles,
        task=tuple(Target(np.array([0.7 + 0.1 * k, 0.5, 0.3])) for k in range(12)),
        rules=Rules(clearance=0.02),
    )


def synthetic_plan(world: World, seed: int = 0, between: int = 3) -> Plan:
    """A plan of the right form for a world whose robot is `youbot`; it need not hold in every respect."""
    rejection = _rejection(world)
    areas, bases = [], []
    last = Point(world.start.base[:2] if world.start else world.task[0].position[:2])
    for target in world.task:
        reach = Point(target.position[:2]).buffer(0.5, 32) - Point(target.position[:2]).buffer(0.2, 32)
        admissible = (reach & world.floor.polygon) - rejection
        roomy = [part for part in shapely.get_parts(admissible) if not part.buffer(-0.02).is_empty]
        pruned = min(roomy, key=lambda part: float(part.distance(last)))
        last = nearest_points(pruned.buffer(-0.02), last)[0]
        areas.append(PlannedArea(admissible, MultiPolygon([pruned]), reach - admissible))
        bases.append((last.x, last.y))
    setpoints = []
    yaw = 0.0
    for target, spot in zip(world.task, bases, strict=True):
        yaw += 0.02
        setpoints.append(_reaching(world.robot, np.array([*spot, yaw]), target.position))
    return Plan(
        world=world,
        seed=seed,
        setpoints=tuple(setpoints),
        motion=_motion(world, setpoints, between),
        areas=tuple(areas),
        lift_offs=1,
        stats={"base_travel": 1.25, "largest_error": 0.01},
    )


def _rejection(world: World) -> shapely.Geometry:
    shadows = [solid.shadow(world.robot.body_height) for solid in world.solids]
    grow = world.rules.clearance + float(np.hypot(*world.robot.footprint.T).max())
    return shapely.union_all([s.core.buffer(s.radius + grow) for s in shadows if s is not None])


def _reaching(robot: Robot, base: Array, target: Array) -> Configuration:
    """Place the arm's axis where the base is meant to be and solve the planar arm in closed form."""
    c, s = np.cos(base[2]), np.sin(base[2])
    x, y, z, _ = robot.mount
    base = np.array([base[0] - c * x + s * y, base[1] - s * x - c * y, base[2]])
    away = target[:2] - (base[:2] + [c * x - s * y, s * x + c * y])
    r, height = float(np.hypot(*away)) - 0.033, float(target[2]) - z - 0.147
    for pitch in np.radians([-60, -75, -45, -30, -90, -15, 0, 15, 30, 45, -120, 60]):
        u, v = r - 0.2175 * np.cos(pitch), height - 0.2175 * np.sin(pitch)
        bend = (u * u + v * v - 0.155**2 - 0.135**2) / (2 * 0.155 * 0.135)
        if abs(bend) < 1:
            break
    q3 = -np.arccos(np.clip(bend, -1, 1))
    q2 = np.arctan2(v, u) - np.arctan2(0.135 * np.sin(q3), 0.155 + 0.135 * np.cos(q3))
    q1 = np.remainder(np.arctan2(away[1], away[0]) - base[2] + np.pi, 2 * np.pi) - np.pi
    joints = np.array([q1, q2, q3, pitch + np.pi / 2 - q2 - q3, 0.0])
    error = float(np.linalg.norm(robot.tool(base, joints)[:3, 3] - target))
    return Configuration(base, joints, error, 3, error < 1e-6)


def _motion(world: World, setpoints: list[Configuration], between: int) -> Motion:
    start = world.start
    knots = [np.array([*s.base, *s.joints]) for s in setpoints]
    rows, kinds, owners = [], [], []
    if start is not None:
        leads = np.linspace(np.array([*start.base, *start.joints]), knots[0], 11)[:-1]
        rows += list(leads)
        kinds += ["transit"] * len(leads)
        owners += [-1] * len(leads)
    for k, knot in enumerate(knots):
        if k:
            lifted = k == len(knots) // 2
            steps = np.linspace(knots[k - 1], knot, between + 2)[1:-1]
            rows += list(steps)
            kinds += ["transit" if lifted else "step"] * between
            owners += [-1 if lifted else k - 1] * between
        rows.append(knot)
        kinds.append("setpoint")
        owners.append(k)
    table = np.array(rows)
    time = np.full(len(table), np.nan)
    return Motion(table[:, :3], table[:, 3:], np.array(kinds), np.array(owners), time)


def timed(plan: Plan, rate: float = 0.37) -> Plan:
    """A plan of an omnidirectional base with times: it goes evenly along its path, from rest to rest."""
    motion = plan.motion
    turn = np.remainder(np.diff(motion.base[:, 2]) + np.pi, 2 * np.pi) - np.pi
    steps = np.diff(motion.base[:, :2], axis=0), turn, np.diff(motion.joints, axis=0)
    far = np.linalg.norm(np.column_stack(steps), axis=1)
    moving = np.flatnonzero(far > 1e-9)
    rates = np.full(len(motion), rate)
    rates[: moving[0] + 1] = rates[moving[-1] + 1 :] = 0.0
    means = (rates[1:] + rates[:-1]) / 2
    spans = np.divide(far, means, out=np.zeros_like(far), where=means > 0)
    return replace(plan, motion=replace(motion, time=np.concatenate([[0.0], np.cumsum(spans)])))


# Plans that are held against their proofs, and what is found of them


def motion_of(rows: Sequence[tuple[Array, Array, str, int]]) -> Motion:
    base, joints, kind, owner = zip(*rows, strict=True)
    return Motion(
        np.array(base), np.array(joints), np.array(kind), np.array(owner), np.full(len(rows), np.nan)
    )


def plan_of(world: World, motion: Motion, lift_offs: int = 0) -> Plan:
    at = [
        np.flatnonzero((motion.kind == "setpoint") & (motion.setpoint == i)) for i in range(len(world.task))
    ]
    configurations = tuple(
        configuration(world, i, motion.base[k[0]], motion.joints[k[0]]) for i, k in enumerate(at) if len(k)
    )
    return Plan(world, 0, configurations, motion, (), lift_offs)


def configuration(world: World, i: int, base: Array, joints: Array) -> Configuration:
    """Base and joints at a set-point, with the error that they have."""
    error = float(np.linalg.norm(world.robot.tool(base, joints)[:3, 3] - world.task[i].position))
    return Configuration(base, joints, error, 1, True)


def straight(count: int = 5, between: int = 1, pitch: float = 0.1) -> Motion:
    """The base goes along x and carries the arm as it is."""
    rows = []
    for k in range(count * (between + 1) - between):
        i, part = divmod(k, between + 1)
        base = np.array([pitch * (i + part / (between + 1)), 0.0, 0.0])
        rows.append((base, Q, "step" if part else "setpoint", i))
    return motion_of(rows)


def world_of(
    motion: Motion, *solids: Solid, robot: Robot | None = None, rules: Rules = RULES, axes: bool = False
) -> World:
    """A world whose set-points are where the motion puts the tool."""
    robot = robot or youbot()
    at = np.flatnonzero(motion.kind == "setpoint")
    tools = robot.tool(motion.base[at], motion.joints[at])
    task = tuple(Target(T[:3, 3], T[:3, 2] if axes else None) for T in tools)
    return World("by hand", robot, Floor(FLOOR), solids, task, rules)


def moved(
    motion: Motion, state: int, base: Sequence[float] = (0, 0, 0), joints: Sequence[float] = (0,) * 5
) -> Motion:
    bases, arms = motion.base.copy(), motion.joints.copy()
    bases[state] += base
    arms[state] += joints
    return replace(motion, base=bases, joints=arms)


def drive(*bases: Sequence[float], joints: Array = Q) -> Motion:
    """One set-point, and from there with the tool lifted."""
    first, *rest = (np.array(base, dtype=float) for base in bases)
    return motion_of([(first, joints, "setpoint", 0), *((base, joints, "transit", -1) for base in rest)])


def of_kind(report: Report, kind: str) -> list[Violation]:
    found = [violation for violation in report.violations if violation.kind == kind]
    assert found, [violation.text for violation in report.violations]
    assert not report.ok
    return found


def only(report: Report, kind: str) -> Violation:
    assert {violation.kind for violation in report.violations} == {kind}, report.violations
    return report.violations[0]


class Proof(NamedTuple):
    """What one check of a plan found; the margin is infinite where there was nothing to measure."""

    margin: float
    violations: tuple[Violation, ...]


def proofs_of(world: World, motion: Motion, *kinds: str) -> tuple[Proof, ...]:
    """Return what `verify` finds of some kinds in a motion, whatever else is wrong with it as a plan."""
    report = verify(Plan(world, 0, (), motion, (), 0))
    return tuple(
        Proof(report.margins.get(kind, np.inf), tuple(one for one in report.violations if one.kind == kind))
        for kind in kinds
    )


def far_off(robot: Robot, *solids: Solid, **rules: Any) -> World:
    """Return a wide hall whose one set-point is far away, for motions that have none."""
    task = (Target(np.array([9.0, 9.0, 9.0])),)
    return World("by hand", robot, Floor(box(-9, -9, 9, 9)), solids, task, Rules(**rules))
