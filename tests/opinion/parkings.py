"""Whether the robot can do its work from where its base came to stand, by brute force over arms in one plane.

How far out such an arm reaches at a height is the same all round its pivot. That is looked for step by step
along a line, each posture begun from that of the step before and from others near it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from tests.opinion.course import Course, wrapped
from tests.opinion.machine import Array, Machine, jacobian

STEP = 1e-3  # along a line outwards [m]
DRAWN = 20_000  # postures that the first are taken from
NEAREST = 4  # of them that are tried at a step
FAR = 0.05  # from the nearest of them, beyond which none is looked for [m]
STEPS = 30  # of damped least squares
CLOSE = 1e-5  # [m]

Mask = NDArray[np.bool_]


def good_parkings(document: dict[str, Any], machine: Machine, points: Array, poses: Array) -> Mask:
    """Which poses of the base (n, 3) keep its clearance and floor, the arm in reach of points (k, 3).

    Parameters
    ----------
    document : dict
        Of the world.
    machine : Machine
        Its pivot is vertical, and all that follows lies in one plane with it.
    """
    good = _has_room(document, machine, poses)
    axes = poses[:, :2] + np.einsum("nij,j->ni", _turns(poses[:, 2]), machine.mount[:2, 3])
    yaw = poses[:, 2] + float(np.arctan2(machine.mount[1, 0], machine.mount[0, 0]))
    low, high = machine.lower[0], machine.upper[0]
    known = _drawn(machine)
    for point in points:
        radii, met = _line(machine, float(point[2]), *known)
        away = point[:2] - axes
        far, bearing = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
        reached = np.zeros(len(poses), dtype=bool)
        for sign, turn in ((1.0, 0.0), (-1.0, np.pi)):
            at = np.round((sign * far - radii[0]) / STEP).astype(int)
            inside = (at >= 0) & (at < len(radii))
            pivot = wrapped(bearing + turn - yaw)
            turned = pivot[:, None] + 2 * np.pi * np.arange(-2, 3)
            within = ((low <= turned) & (turned <= high)).any(axis=1)
            reached |= inside & met[np.clip(at, 0, len(radii) - 1)] & within
        good &= reached
    return good


def _has_room(document: dict[str, Any], machine: Machine, poses: Array) -> Mask:
    """Which poses keep the base on its floor and off all that stands there."""
    course = Course({"world": document, "states": []}, machine)
    corners = np.einsum("nij,kj->nki", _turns(poses[:, 2]), machine.facts.footprint) + poses[:, None, :2]
    shapes = shapely.convex_hull(shapely.multipoints(list(corners)))
    floor = shapely.Polygon(document["floor"]["polygon"], document["floor"].get("holes", []))
    shapely.prepare(floor)
    good: Mask = shapely.covers(floor, shapes)
    for thing in course.things:
        if thing.core is not None:
            good &= shapely.distance(shapes, thing.core) - thing.radius >= document["rules"]["clearance"]
    return good


def _turns(yaw: Array) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


def _line(machine: Machine, height: float, joints: Array, tools: Array) -> tuple[Array, Mask]:
    """Distances from the pivot's axis (n,), signed, and at which of them the tool gets to a height [m]."""
    most = float(np.abs(tools[:, 0]).max()) + 5 * STEP
    radii = np.arange(-most, most, STEP)
    met, last = np.zeros(len(radii), dtype=bool), None
    for n, radius in enumerate(radii):
        off = np.hypot(tools[:, 0] - radius, tools[:, 1] - height)
        near = np.argpartition(off, NEAREST)[:NEAREST]
        if off[near].min() > FAR:
            continue
        for start in [*([] if last is None else [last]), *joints[near]]:
            found = _bent(machine, start, radius, height)
            if found is not None:
                met[n], last = True, found
                break
    return radii, met


def _drawn(machine: Machine) -> tuple[Array, Array]:
    """Postures with the pivot at zero (m, dof), and their tools' distances from it and heights (m, 2)."""
    low = np.where(np.isfinite(machine.lower), machine.lower, -np.pi)
    high = np.where(np.isfinite(machine.upper), machine.upper, np.pi)
    joints = np.random.default_rng(0).uniform(low, high, (DRAWN, machine.dof))
    joints[:, 0] = 0.0
    tools = np.array([_tool(machine, q) for q in joints])
    assert np.abs(tools[:, 1]).max() < 1e-9, "the arm does not lie in one plane"
    return joints, tools[:, ::2]


def _tool(machine: Machine, joints: Array) -> Array:
    """The tool from the pivot's axis, along and across the arm's plane, and its height over the floor [m]."""
    machine.place(np.zeros(3), joints)
    off = machine.tool()[:3, 3] - np.array([*machine.mount[:2, 3], 0.0])
    return np.append(machine.mount[:2, :2].T @ off[:2], off[2])


def _bent(machine: Machine, joints: Array, radius: float, height: float) -> Array | None:
    """Joint values with the tool at a distance and height, by damped least squares; None where it misses."""
    q, damping = joints.copy(), 1e-3
    for _ in range(STEPS):
        off = np.array([radius, 0.0, height]) - _tool(machine, q)
        if np.abs(off).max() < CLOSE:
            return q
        off[:2] = machine.mount[:2, :2] @ off[:2]
        J = jacobian(machine, machine.configuration(np.zeros(3), q))[:3, machine.columns]
        J[:, 0] = 0.0
        step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(3), off)
        q = np.clip(q + np.clip(step, -0.5, 0.5), machine.lower, machine.upper)
        damping = max(damping / 2, 1e-9)
    return None
