"""Shortest curves of a car that can reverse, in closed form (Reeds and Shepp, Pacific J. Math. 145, 1990).

A word is a row of at most five signed lengths and turns for a turning radius of 1. Formulas have their
numbers in section 8 of the paper. The quadrant that a formula holds in is not tested: each word is driven
from its start, and those that do not end at the goal are dropped. Every word left is a valid curve; where an
obstacle is on the shortest, a longer one may be free.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.driving.arcs import arc_end
from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array

MAX_MOTIONS = 5  # motions of a word, at most
_GOAL_TOLERANCE = 1e-10  # distance from the goal at which a word may end, in turning radii and radians
_MIN_MOTION = 1e-13  # shorter motions are left out
LSL, LSR, LRL, LRSL, LRSR, LRSLR, LRLR = range(7)
SIDES = np.array(  # 1 to the left, -1 to the right, 0 straight on
    [
        [1.0, 0.0, 1.0, 0.0, 0.0],
        [1.0, 0.0, -1.0, 0.0, 0.0],
        [1.0, -1.0, 1.0, 0.0, 0.0],
        [1.0, -1.0, 0.0, 1.0, 0.0],
        [1.0, -1.0, 0.0, -1.0, 0.0],
        [1.0, -1.0, 0.0, 1.0, -1.0],
        [1.0, -1.0, 1.0, -1.0, 0.0],
    ]
)


@compiled
def _write(words: Array, n: int, kind: int, a: float, b: float, c: float, d: float, e: float) -> int:
    """Write word n of a kind with the lengths of its motions; returns n + 1."""
    word = words[n]
    word[0, 0], word[1, 0], word[2, 0], word[3, 0], word[4, 0] = a, b, c, d, e
    for k in range(MAX_MOTIONS):
        word[k, 1] = word[k, 0] * SIDES[kind, k]
    return n + 1


@compiled
def _tau_omega(u: float, v: float, xi: float, eta: float, phi: float) -> tuple[float, float]:
    """First and last arc of a word of four arcs (Reeds and Shepp, 8.7 and 8.8)."""
    delta = wrap(u - v)
    a, b = math.sin(u) - math.sin(delta), math.cos(u) - math.cos(delta) - 1.0
    tau = math.atan2(eta * a - xi * b, xi * a + eta * b)
    if 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0 < 0.0:
        tau = wrap(tau + math.pi)
    return tau, wrap(tau - u + v - phi)


@compiled
def _one_sided(x: float, y: float, phi: float, words: Array, n: int, forth: bool) -> int:
    """Words whose first and last arc turn to the same side; ``forth`` with those symmetric in time."""
    xi, eta = x - math.sin(phi), y - 1.0 + math.cos(phi)
    far, theta = np.hypot(xi, eta), math.atan2(eta, xi)
    if forth:
        n = _write(words, n, LSL, theta, far, wrap(phi - theta), 0.0, 0.0)  # 8.1
    if far <= 4.0:
        u = -2.0 * math.asin(far / 4.0)
        t = wrap(theta + 0.5 * u + math.pi)
        n = _write(words, n, LRL, t, u, wrap(phi - t + u), 0.0, 0.0)  # 8.3
    if far >= 2.0:
        r = math.sqrt(far * far - 4.0)
        t = wrap(theta + math.atan2(r, -2.0))
        v = wrap(phi - 0.5 * math.pi - t)
        n = _write(words, n, LRSL, t, -0.5 * math.pi, 2.0 - r, v, 0.0)  # 8.9
    return n


@compiled
def _two_sided(x: float, y: float, phi: float, words: Array, n: int, forth: bool) -> int:
    """Words whose first and last arc turn to opposite sides; ``forth`` with those symmetric in time."""
    xi, eta = x + math.sin(phi), y - 1.0 - math.cos(phi)
    far, theta = np.hypot(xi, eta), math.atan2(eta, xi)
    half = 0.5 * math.pi
    if far >= 2.0:
        t = math.atan2(xi, -eta)
        n = _write(words, n, LRSR, t, -half, 2.0 - far, wrap(t + half - phi), 0.0)  # 8.10
    if not forth:
        return n
    if far >= 2.0:
        u = math.sqrt(far * far - 4.0)
        t = wrap(theta + math.atan2(2.0, u))
        n = _write(words, n, LSR, t, u, wrap(t - phi), 0.0, 0.0)  # 8.2
        u = 4.0 - u
        t = math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta)
        n = _write(words, n, LRSLR, t, -half, u, -half, wrap(t - phi))  # 8.11
    else:
        u = math.acos((2.0 + far) / 4.0)
        t, v = _tau_omega(u, -u, xi, eta, phi)
        n = _write(words, n, LRLR, t, u, -u, v, 0.0)  # 8.7
    square = (20.0 - far * far) / 16.0
    if 0.0 <= square <= 1.0:
        u = -math.acos(square)
        t, v = _tau_omega(u, u, xi, eta, phi)
        n = _write(words, n, LRLR, t, u, u, v, 0.0)  # 8.8
    return n


@compiled
def _reverse(words: Array, first: int, n: int) -> None:
    """Reverse the order of motions in words first to n, found for the way back."""
    for m in range(first, n):
        last = MAX_MOTIONS
        while last > 0 and words[m, last - 1, 0] == 0.0:
            last -= 1
        for k in range(last // 2):
            for column in range(2):
                other = words[m, last - 1 - k, column]
                words[m, last - 1 - k, column] = words[m, k, column]
                words[m, k, column] = other


@compiled
def _words(x: float, y: float, phi: float) -> Array:
    """Candidate words (n, 5, 2) from the origin to a pose, by the symmetries of Reeds and Shepp."""
    words = np.empty((56, MAX_MOTIONS, 2))
    n = 0
    for flip in (1.0, -1.0):  # time flip: the same curve in the other gear
        for side in (1.0, -1.0):  # reflection: left for right
            first = n
            gx, gy, turn = flip * x, side * y, flip * side * phi
            n = _one_sided(gx, gy, turn, words, n, True)
            n = _two_sided(gx, gy, turn, words, n, True)
            mirrored = n
            c, s = math.cos(turn), math.sin(turn)
            n = _one_sided(gx * c + gy * s, gx * s - gy * c, turn, words, n, False)
            n = _two_sided(gx * c + gy * s, gx * s - gy * c, turn, words, n, False)
            _reverse(words, mirrored, n)
            for m in range(first, n):
                for k in range(MAX_MOTIONS):
                    words[m, k, 0] *= flip
                    words[m, k, 1] *= flip * side
    return words[:n]


@compiled
def _ends_at(word: Array, x: float, y: float, phi: float) -> bool:
    """True if a word driven from the origin ends at a pose."""
    px, py, yaw = 0.0, 0.0, 0.0
    for k in range(MAX_MOTIONS):
        px, py, yaw = arc_end(px, py, yaw, word[k, 0], word[k, 1])
    return max(abs(px - x), abs(py - y), abs(wrap(yaw - phi))) <= _GOAL_TOLERANCE * (1.0 + abs(x) + abs(y))


@compiled
def words_between(start: Array, goal: Array, radius: float) -> tuple[Array, Array]:
    """All words that lead from one pose to another, shortest first.

    Parameters
    ----------
    start, goal : (3,) array
        x, y [m], yaw [rad].
    radius : float
        Of every arc [m].

    Returns
    -------
    words : (n, 5, 2) array
        Signed length [m] and turn [rad] of each motion; zeros for none.
    lengths : (n,) array
        In ascending order [m].
    """
    c, s = math.cos(start[2]), math.sin(start[2])
    dx, dy = (goal[0] - start[0]) / radius, (goal[1] - start[1]) / radius
    x, y, phi = c * dx + s * dy, c * dy - s * dx, wrap(goal[2] - start[2])
    words = _words(x, y, phi)
    found, lengths = np.empty((len(words), MAX_MOTIONS, 2)), np.empty(len(words))
    n = 0
    for m in range(len(words)):
        word, length = words[m], 0.0
        for k in range(MAX_MOTIONS):
            if abs(word[k, 0]) < _MIN_MOTION:
                word[k, 0] = word[k, 1] = 0.0
            length += radius * abs(word[k, 0])
        if _ends_at(word, x, y, phi):
            rank = n
            while rank > 0 and lengths[rank - 1] > length:
                lengths[rank] = lengths[rank - 1]
                for k in range(MAX_MOTIONS):
                    found[rank, k, 0], found[rank, k, 1] = found[rank - 1, k, 0], found[rank - 1, k, 1]
                rank -= 1
            lengths[rank] = length
            for k in range(MAX_MOTIONS):
                found[rank, k, 0], found[rank, k, 1] = radius * word[k, 0], word[k, 1]
            n += 1
    return found[:n], lengths[:n]
