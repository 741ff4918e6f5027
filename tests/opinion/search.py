"""A configuration for a target, looked for by brute force: what is found is a fact, nothing found is none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import shapely

from tests.opinion.course import Course
from tests.opinion.machine import Array, Machine, jacobian
from tests.opinion.moment import Moment
from tests.opinion.quality import shortfalls
from tests.opinion.things import asked_of, floor_of, things_of

PLACES = 4000  # of the base that are drawn
TURNS = 36  # of the base that are tried at one place
TRIED = 300  # free ones at which the arm is bent, each from a posture of its own
BENT = 80  # postures tried from one pose of the base
ROUNDS = 3  # of all that, where the arm must keep off things
STEPS = 25
INSIDE = 0.9  # of the cone that a turn aims for
CLOSE = 1e-6  # [m] or [rad]
BERTH = 1e-4  # of base and arm beyond their clearances, so that what is found is beyond doubt [m]


def find(world: dict[str, Any], machine: Machine, target: dict[str, Any], seed: int = 0) -> Array | None:
    """Base pose and joint values with the tool on a target, the base free on its floor, limits kept.

    Obstacles to the arm are left out of account, but for those to its first link, which hardly leaves its
    place, and to what stands on the base. None where none was found.
    """
    found = list(_about(world, machine, target, seed))
    moment = _moment(world, machine, target, found)
    return next((one for k, one in enumerate(found) if not any(moment.look_at_body(k))), None)


def find_clear(
    world: dict[str, Any], machine: Machine, target: dict[str, Any], seed: int = 0
) -> Array | None:
    """The same with an arm that keeps off obstacles, itself and its base as the rules say."""
    found = [one for k in range(ROUNDS) for one in _about(world, machine, target, seed + k)]
    moment = _moment(world, machine, target, found)
    return next((one for k, one in enumerate(found) if not any(moment.look(k, 0.0))), None)


def find_clear_at(
    world: dict[str, Any], machine: Machine, target: dict[str, Any], base: Array, seed: int = 0
) -> Array | None:
    """Joint values with the tool on a target from one pose of the base (3,), the arm as in `find_clear`."""
    rng, locked = np.random.default_rng(seed), 1 if world["rules"]["heading"] == "face_target" else 0
    bent = (_bend(machine, base, target, locked, rng) for _ in range(BENT))
    found = [q for q in bent if q is not None and not any(shortfalls(machine, world["rules"], base, q))]
    moment = _moment(world, machine, target, [np.concatenate([base, q]) for q in found])
    return next((q for k, q in enumerate(found) if not any(moment.look(k, 0.0))), None)


def _moment(world: dict[str, Any], machine: Machine, target: dict[str, Any], found: list[Array]) -> Moment:
    """Return what looks at configurations for a target, each a state."""
    asked = [{**{key: target[key] for key in target if key != "point"}, "points": [target["point"]]}]
    states = [{"base": one[:3], "joints": one[3:], "kind": "transit"} for one in found]
    return Moment(Course({"world": {**world, "task": asked}, "states": states}, machine), BERTH)


def _about(world: dict[str, Any], machine: Machine, target: dict[str, Any], seed: int) -> Iterator[Array]:
    """Configurations with the arm's mount at random distances from a target."""
    rng = np.random.default_rng(seed)
    away, around = _length(machine) * np.sqrt(rng.random(PLACES)), rng.uniform(-np.pi, np.pi, PLACES)
    axis = np.array(target["point"])[:2] + np.column_stack([away * np.cos(around), away * np.sin(around)])
    return _found(world, machine, target, axis, rng)


def stand_at(
    world: dict[str, Any], machine: Machine, target: dict[str, Any], spot: Array, rng: np.random.Generator
) -> Array | None:
    """The same with the arm's mount over one spot of the floor, at headings tried at random."""
    return next(_found(world, machine, target, np.tile(spot, (TURNS, 1)), rng), None)


def _found(
    world: dict[str, Any], machine: Machine, target: dict[str, Any], axis: Array, rng: np.random.Generator
) -> Iterator[Array]:
    """Configurations with the arm's mount over one of some spots (n, 2)."""
    base = _poses(world, machine, np.array(target["point"])[:2], axis, rng)
    locked = 1 if world["rules"]["heading"] == "face_target" else 0  # the pivot, then left at zero
    for one in base[_free(world, machine, base)][:TRIED]:
        joints = _bend(machine, one, target, locked, rng)
        if joints is not None and not any(shortfalls(machine, world["rules"], one, joints)):
            yield np.array([*one, *joints])


def _poses(
    world: dict[str, Any], machine: Machine, point: Array, axis: Array, rng: np.random.Generator
) -> Array:
    """Base poses (n, 3) with the arm's mount over spots (n, 2), headings as the rules have them."""
    mount = machine.mount
    yaw = rng.uniform(-np.pi, np.pi, len(axis))
    if world["rules"]["heading"] == "fixed":
        start = world.get("start") or {"base": [0.0, 0.0, 0.0]}
        yaw = np.full(len(axis), float(start["base"][2]))
    elif world["rules"]["heading"] == "face_target":
        ahead = point - axis
        yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) - np.arctan2(mount[1, 0], mount[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = mount[:2, 3]
    return np.column_stack([axis - np.column_stack([c * x - s * y, s * x + c * y]), yaw])


def _free(world: dict[str, Any], machine: Machine, base: Array) -> Any:
    """Which base poses lie on the floor and keep their clearance, beyond doubt."""
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], 1)
    corners = machine.facts.footprint @ turn + base[:, None, :2]
    shapes = np.array([shapely.MultiPoint(one).convex_hull for one in corners], dtype=object)
    floor = floor_of(world)
    shapely.prepare(floor)
    free = shapely.covers(floor, shapes)
    for thing in things_of(world, machine.facts.body_height):
        if thing.core is not None:
            gap = shapely.distance(shapes, thing.core) - thing.radius
            free &= (gap > asked_of(thing, world["rules"]) + BERTH) & ~shapely.intersects(shapes, thing.core)
    return free


def _length(machine: Machine) -> float:
    """More than the tool can be from the arm's axis."""
    model = machine.model
    far = sum(float(np.linalg.norm(model.jointPlacements[i].translation)) for i in machine.ids[4:])
    return far + float(np.linalg.norm(model.frames[machine.tool_frame].placement.translation)) + 0.05


def _bend(
    machine: Machine, base: Array, target: dict[str, Any], locked: int, rng: np.random.Generator
) -> Array | None:
    """Joint values by damped least squares within the limits, from a random posture."""
    low = np.where(np.isfinite(machine.lower), machine.lower, -np.pi)
    high = np.where(np.isfinite(machine.upper), machine.upper, np.pi)
    joints = rng.uniform(low, high)
    joints[:locked] = np.clip(0.0, low, high)[:locked]
    damping = 1e-3
    for _ in range(STEPS):
        q = machine.configuration(base, joints)
        J = jacobian(machine, q)[:, machine.columns]
        pin.framesForwardKinematics(machine.model, machine.data, q)
        off, axis = _missing(machine.tool(), target)
        if np.abs(off).max() < CLOSE:
            return joints
        rows = J[:3] if axis is None else np.vstack([J[:3], axis @ J[3:]])
        step = rows.T @ np.linalg.solve(rows @ rows.T + damping * np.eye(len(off)), off)
        step[:locked] = 0.0
        joints = np.clip(joints + np.clip(step, -0.5, 0.5), machine.lower, machine.upper)
        damping = max(damping / 2, 1e-9)
    return None


def _missing(tool: Array, target: dict[str, Any]) -> tuple[Array, Array | None]:
    """What is missing: of the place (3,), then of the turn into the cone, and its axis."""
    place = np.array(target["point"]) - tool[:3, 3]
    if "orientation" in target:
        turn = np.asarray(pin.log3(np.array(target["orientation"]) @ tool[:3, :3].T))
    elif "direction" in target:
        across = np.cross(tool[:3, 2], target["direction"])
        angle = float(np.arctan2(np.linalg.norm(across), tool[:3, 2] @ np.array(target["direction"])))
        turn = across / max(float(np.linalg.norm(across)), 1e-12) * angle
    else:
        return place, None
    angle = float(np.linalg.norm(turn))
    if angle <= target["cone"]:
        return place, None
    return np.append(place, angle - INSIDE * target["cone"]), turn / angle
