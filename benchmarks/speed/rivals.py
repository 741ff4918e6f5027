"""Rivals of our own: damped least squares by the arm's closed form, and passes that ask shapely."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.planners.geometry.flat import compiled
from regionik.planners.geometry.trigonometry import turned
from regionik.planners.solvers.callsheet import bends_at, links_in
from regionik.planners.solvers.fabrik import PATIENCE, STALLED
from regionik.planners.solvers.onecall import axis_at
from regionik.planners.solvers.passes import Inner, Knots, Pair, fast, inwards, outwards, placed, sight
from regionik.postures.serialarm import MOST_PASSES
from regionik.worlds.arrays import Array

DAMPING = 1e-6  # the best of 1e-2, 1e-4 and 1e-6
STEPS = 100  # before a target is given up
FREE = (0.0, 0.0)  # a last link that may point anywhere


@fast
def damped_steps(
    call: Array, bounds: Array, targets: Array, bases: Array, joints: Array, tolerance: float, errors: Array
) -> None:
    """Full steps of damped least squares over base and arm, joints to joints; overwrites the last three.

    ``call`` is a solver's prepared array, and ``bounds`` (8, 2) the limits to which every step is clipped,
    base first. The arm must stand on the axis about which the base turns.
    """
    J = np.zeros((3, 8))
    for k in range(len(targets)):
        base, q, target = bases[k], joints[k], targets[k]
        errors[k] = np.inf
        for _ in range(STEPS):
            x, y, plane = axis_at(call, base, q)
            u, v = np.cos(plane), np.sin(plane)
            a, b, c = bends_at(call, q)
            r0, r1, r2 = call[2] * np.cos(a), call[3] * np.cos(a + b), call[4] * np.cos(a + b + c)
            z0, z1, z2 = call[2] * np.sin(a), call[3] * np.sin(a + b), call[4] * np.sin(a + b + c)
            r, z = call[0] + r0 + r1 + r2, call[1] + z0 + z1 + z2
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
                sign = call[32 + i]
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
def begun(call: Array, base: Array, joints: Array) -> tuple[float, float, float, Knots]:
    """Arm axis, direction of the plane and knots of a start."""
    links = links_in(call)
    x, y, plane = axis_at(call, base, joints)
    a, b, c = bends_at(call, joints)
    knots = placed(links.shoulder, links.lengths, turned(a), turned(a + b), turned(a + b + c))
    return x, y, plane, knots


@compiled
def seen_first(r: float, z: float, knots: Knots) -> Pair:
    """Direction of the last link before the first pass."""
    return sight(FREE, (r, z), knots)


@compiled
def in_pass(call: Array, r: float, z: float, seen: Pair, knots: Knots) -> Inner:
    """Forward reaching."""
    links = links_in(call)
    return inwards(links.shoulder, links.lengths, links.holds[1], links.holds[2], seen, (r, z), knots)


@compiled
def out_pass(call: Array, r: float, z: float, inner: Inner, by: float) -> tuple[Knots, Pair]:
    """Backward reaching."""
    links = links_in(call)
    return outwards(links.shoulder, links.lengths, links.holds, FREE, (r, z), inner, by)


def passes_with_shapely(
    call: Array,
    area: BaseGeometry,
    edge: BaseGeometry,
    target: Array,
    base: Array,
    joints: Array,
    tolerance: float,
) -> tuple[float, int, float, float]:
    """The loop of M-FABRIK, its passes compiled, the axis held in a prepared area by calls of shapely.

    ``edge`` is the area's prepared boundary. Returns error [m], passes and the arm axis [m], of the first
    start alone.
    """
    x, y, plane, knots = begun(call, base, joints)
    tx, ty, tz = target.tolist()
    ux, uy = math.cos(plane), math.sin(plane)
    miss = x + knots[4] * ux - tx, y + knots[4] * uy - ty, knots[5] - tz
    error, passes = math.hypot(*miss), 0
    settled = shapely.intersects_xy(area, x, y)
    mark, seen = math.inf, FREE
    while (error > tolerance or not settled) and passes < MOST_PASSES:
        if passes % PATIENCE == PATIENCE - 1:
            if error > STALLED * mark:
                break
            mark = error
        passes += 1
        before = math.hypot(tx - x, ty - y)
        ux, uy = (tx - x) / before, (ty - y) / before
        seen = seen if passes > 1 else seen_first(before, tz, knots)
        inner = in_pass(call, before, tz, seen, knots)
        shift = inner.root - call[0]
        x, y = x + shift * ux, y + shift * uy
        if not shapely.intersects_xy(area, x, y):
            x, y = shapely.get_coordinates(shapely.shortest_line(edge, shapely.Point(x, y)))[0].tolist()
        r = math.hypot(tx - x, ty - y)
        knots, seen = out_pass(call, r, tz, inner, r - before)
        error, settled = math.hypot(knots[4] - r, knots[5] - tz), True
    return error, passes, x, y
