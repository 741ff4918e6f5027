"""Rivals of our own: damped least squares by the arm's closed form, and passes that ask shapely."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.planners.kernels import compiled
from regionik.planners.solvers.fabrik import (
    ANY,
    Knots,
    backward_reaching,
    forward_reaching,
    knots_at,
)
from regionik.planners.solvers.mfabrik_planar import MAX_STALL_SHARE, STALL_WINDOW, PlanarSetup
from regionik.postures.arm import MAX_PASSES
from regionik.worlds.arrays import Array

DAMPING = 1e-6  # the best of 1e-2, 1e-4 and 1e-6
STEPS = 100  # before a target is given up


@compiled
def damped_steps(
    arm: PlanarSetup,
    bounds: Array,
    targets: Array,
    bases: Array,
    joints: Array,
    tolerance: float,
    errors: Array,
) -> None:
    """Full steps of damped least squares over base and arm, joints to joints; overwrites the last three.

    ``arm`` is a solver's setup, and ``bounds`` (8, 2) the limits to which every step is clipped,
    base first. The arm must stand on the axis about which the base turns.
    """
    J = np.zeros((3, 8))
    l0, l1, l2 = arm.links.lengths
    for k in range(len(targets)):
        base, q, target = bases[k], joints[k], targets[k]
        errors[k] = np.inf
        for _ in range(STEPS):
            x, y, plane = base[0], base[1], base[2] + arm.plane_zero + q[0]
            u, v = np.cos(plane), np.sin(plane)
            a = arm.sign[0] * q[1] + arm.offset[0]
            b = a + arm.sign[1] * q[2] + arm.offset[1]
            c = b + arm.sign[2] * q[3] + arm.offset[2]
            r0, r1, r2 = l0 * np.cos(a), l1 * np.cos(b), l2 * np.cos(c)
            z0, z1, z2 = l0 * np.sin(a), l1 * np.sin(b), l2 * np.sin(c)
            r, z = arm.links.shoulder[0] + r0 + r1 + r2, arm.links.shoulder[1] + z0 + z1 + z2
            e0, e1, e2 = target[0] - x - r * u, target[1] - y - r * v, target[2] - z
            errors[k] = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
            if errors[k] <= tolerance:
                break
            J[0, 0] = J[1, 1] = 1.0
            J[0, 2] = J[0, 3] = -r * v
            J[1, 2] = J[1, 3] = r * u
            for i in range(3):
                up = r0 + r1 + r2 if i == 0 else (r1 + r2 if i == 1 else r2)
                out = -(z0 + z1 + z2) if i == 0 else (-(z1 + z2) if i == 1 else -z2)
                sign = arm.sign[i]
                J[0, 4 + i], J[1, 4 + i], J[2, 4 + i] = sign * out * u, sign * out * v, sign * up
            p00 = p11 = p22 = DAMPING
            p01 = p02 = p12 = 0.0
            for i in range(7):
                p00 += J[0, i] * J[0, i]
                p01 += J[0, i] * J[1, i]
                p02 += J[0, i] * J[2, i]
                p11 += J[1, i] * J[1, i]
                p12 += J[1, i] * J[2, i]
                p22 += J[2, i] * J[2, i]
            c00, c01, c02 = p11 * p22 - p12 * p12, p02 * p12 - p01 * p22, p01 * p12 - p02 * p11
            c11, c12, c22 = p00 * p22 - p02 * p02, p01 * p02 - p00 * p12, p00 * p11 - p01 * p01
            over = 1.0 / (p00 * c00 + p01 * c01 + p02 * c02)
            s0 = (c00 * e0 + c01 * e1 + c02 * e2) * over
            s1 = (c01 * e0 + c11 * e1 + c12 * e2) * over
            s2 = (c02 * e0 + c12 * e1 + c22 * e2) * over
            for i in range(3):
                step = J[0, i] * s0 + J[1, i] * s1 + J[2, i] * s2
                base[i] = min(max(base[i] + step, bounds[i, 0]), bounds[i, 1])
            for i in range(4):
                step = J[0, 3 + i] * s0 + J[1, 3 + i] * s1 + J[2, 3 + i] * s2
                q[i] = min(max(q[i] + step, bounds[3 + i, 0]), bounds[3 + i, 1])


@compiled
def begun(arm: PlanarSetup, joints: Array) -> Knots:
    """Knots of a start."""
    a = arm.sign[0] * joints[1] + arm.offset[0]
    b = arm.sign[1] * joints[2] + arm.offset[1]
    return knots_at(arm.links, (a, b, arm.sign[2] * joints[3] + arm.offset[2]))


def passes_with_shapely(
    setup: PlanarSetup,
    area: BaseGeometry,
    edge: BaseGeometry,
    target: Array,
    base: Array,
    joints: Array,
    tolerance: float,
) -> tuple[float, int, float, float]:
    """The loop of M-FABRIK, its passes compiled, the axis held in a prepared area by calls of shapely.

    ``edge`` is the area's prepared boundary. The arm must stand on the axis about which the base turns.
    Returns error [m], passes and the arm axis [m], of the first start alone.
    """
    links, knots = setup.links, begun(setup, joints)
    (x, y, yaw), (tx, ty, tz) = base.tolist(), target.tolist()
    plane = yaw + setup.plane_zero + joints[0]
    miss = x + knots[4] * math.cos(plane) - tx, y + knots[4] * math.sin(plane) - ty, knots[5] - tz
    error, passes = math.hypot(*miss), 0
    settled = shapely.intersects_xy(area, x, y)
    mark = math.inf
    while (error > tolerance or not settled) and passes < MAX_PASSES:
        if passes % STALL_WINDOW == STALL_WINDOW - 1:
            if error > MAX_STALL_SHARE * mark:
                break
            mark = error
        passes += 1
        before = math.hypot(tx - x, ty - y)
        ux, uy = (tx - x) / before, (ty - y) / before
        root, knots = forward_reaching(links, ANY, (before, tz), knots)
        shift = root - links.shoulder[0]
        x, y = x + shift * ux, y + shift * uy
        if not shapely.intersects_xy(area, x, y):
            x, y = shapely.get_coordinates(shapely.shortest_line(edge, shapely.Point(x, y)))[0].tolist()
        r = math.hypot(tx - x, ty - y)
        by = r - before
        moved = knots[0] + by, knots[1], knots[2] + by, knots[3], knots[4] + by, knots[5]
        knots = backward_reaching(links, ANY, (r, tz), moved)
        error, settled = math.hypot(knots[4] - r, knots[5] - tz), True
    return error, passes, x, y
