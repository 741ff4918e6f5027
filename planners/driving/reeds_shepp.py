"""Shortest curves of a car: Dubins (forward only) and Reeds-Shepp (with reversing), in closed form.

A curve is a row of at most five signed lengths and turns for a turning radius of 1. The formulas are those of
Reeds and Shepp (Pacific J. Math. 145, 1990, section 8) and of Dubins (Amer. J. Math. 79, 1957). Which
quadrant a formula is meant for is not asked: each word is driven from its start, and those that do not end
at the goal are dropped. Every word left is a true curve, so a list of them is good for going round things.
"""

from __future__ import annotations

import math

import numpy as np

from regionik.planners.driving.arcs import moved, wrapped
from regionik.planners.geometry.flat import compiled
from regionik.worlds.arrays import Array

PARTS = 5  # of a curve, at most
_EXACT = 1e-10  # how near to the goal a word must end, in turning radii and radians
_NIL = 1e-13  # a part shorter than this is none
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
def _put(words: Array, n: int, kind: int, a: float, b: float, c: float, d: float, e: float) -> int:
    """Write a word of a kind by the lengths of its parts; returns how many there are now."""
    word = words[n]
    word[0, 0], word[1, 0], word[2, 0], word[3, 0], word[4, 0] = a, b, c, d, e
    for k in range(PARTS):
        word[k, 1] = word[k, 0] * SIDES[kind, k]
    return n + 1


@compiled
def _tau_omega(u: float, v: float, xi: float, eta: float, phi: float) -> tuple[float, float]:
    """First and last arc of a word of four arcs (Reeds, Shepp, 8.7 and 8.8)."""
    delta = wrapped(u - v)
    a, b = math.sin(u) - math.sin(delta), math.cos(u) - math.cos(delta) - 1.0
    tau = math.atan2(eta * a - xi * b, xi * a + eta * b)
    if 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0 < 0.0:
        tau = wrapped(tau + math.pi)
    return tau, wrapped(tau - u + v - phi)


@compiled
def _one_sided(x: float, y: float, phi: float, words: Array, n: int, forth: bool) -> int:
    """Words whose first and last arc turn to the same side; ``forth`` with those that read the same back."""
    xi, eta = x - math.sin(phi), y - 1.0 + math.cos(phi)
    far, theta = math.hypot(xi, eta), math.atan2(eta, xi)
    if forth:
        n = _put(words, n, LSL, theta, far, wrapped(phi - theta), 0.0, 0.0)  # 8.1
    if far <= 4.0:
        u = -2.0 * math.asin(far / 4.0)
        t = wrapped(theta + 0.5 * u + math.pi)
        n = _put(words, n, LRL, t, u, wrapped(phi - t + u), 0.0, 0.0)  # 8.3
    if far >= 2.0:
        r = math.sqrt(far * far - 4.0)
        t = wrapped(theta + math.atan2(r, -2.0))
        v = wrapped(phi - 0.5 * math.pi - t)
        n = _put(words, n, LRSL, t, -0.5 * math.pi, 2.0 - r, v, 0.0)  # 8.9
    return n


@compiled
def _two_sided(x: float, y: float, phi: float, words: Array, n: int, forth: bool) -> int:
    """Words whose first and last arc turn to different sides; ``forth`` as above."""
    xi, eta = x + math.sin(phi), y - 1.0 - math.cos(phi)
    far, theta = math.hypot(xi, eta), math.atan2(eta, xi)
    half = 0.5 * math.pi
    if far >= 2.0:
        t = math.atan2(xi, -eta)
        n = _put(words, n, LRSR, t, -half, 2.0 - far, wrapped(t + half - phi), 0.0)  # 8.10
    if not forth:
        return n
    if far >= 2.0:
        u = math.sqrt(far * far - 4.0)
        t = wrapped(theta + math.atan2(2.0, u))
        n = _put(words, n, LSR, t, u, wrapped(t - phi), 0.0, 0.0)  # 8.2
        u = 4.0 - u
        t = math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta)
        n = _put(words, n, LRSLR, t, -half, u, -half, wrapped(t - phi))  # 8.11
    else:
        u = math.acos((2.0 + far) / 4.0)
        t, v = _tau_omega(u, -u, xi, eta, phi)
        n = _put(words, n, LRLR, t, u, -u, v, 0.0)  # 8.7
    square = (20.0 - far * far) / 16.0
    if 0.0 <= square <= 1.0:
        u = -math.acos(square)
        t, v = _tau_omega(u, u, xi, eta, phi)
        n = _put(words, n, LRLR, t, u, u, v, 0.0)  # 8.8
    return n


@compiled
def _backwards(words: Array, first: int, n: int) -> None:
    """Words that were found for the way back, turned round."""
    for m in range(first, n):
        last = PARTS
        while last > 0 and words[m, last - 1, 0] == 0.0:
            last -= 1
        for k in range(last // 2):
            for column in range(2):
                other = words[m, last - 1 - k, column]
                words[m, last - 1 - k, column] = words[m, k, column]
                words[m, k, column] = other


@compiled
def reeds_shepp_words(x: float, y: float, phi: float) -> Array:
    """Candidates (n, 5, 2) for the way from the origin to a pose, by the symmetries of the set of curves."""
    words = np.empty((56, PARTS, 2))
    n = 0
    for flip in (1.0, -1.0):  # the same curve driven the other way
        for side in (1.0, -1.0):  # and seen in a mirror
            first = n
            gx, gy, turn = flip * x, side * y, flip * side * phi
            n = _one_sided(gx, gy, turn, words, n, True)
            n = _two_sided(gx, gy, turn, words, n, True)
            mirrored = n
            c, s = math.cos(turn), math.sin(turn)
            n = _one_sided(gx * c + gy * s, gx * s - gy * c, turn, words, n, False)
            n = _two_sided(gx * c + gy * s, gx * s - gy * c, turn, words, n, False)
            _backwards(words, mirrored, n)
            for m in range(first, n):
                for k in range(PARTS):
                    words[m, k, 0] *= flip
                    words[m, k, 1] *= flip * side
    return words[:n]


@compiled
def _ahead(angle: float) -> float:
    """The same angle from 0 up to 2 pi; what rounding put below 0 is 0, not a full circle."""
    angle = angle % (2.0 * math.pi)
    return 0.0 if 2.0 * math.pi - angle < 1e-11 else angle


@compiled
def dubins_words(x: float, y: float, phi: float) -> Array:
    """Candidates (n, 5, 2) for the way from the origin to a pose without reversing."""
    words = np.empty((8, PARTS, 2))
    n = 0
    for side in (1.0, -1.0):
        first = n
        gy, turn = side * y, side * phi
        xi, eta = x - math.sin(turn), gy - 1.0 + math.cos(turn)
        far, theta = math.hypot(xi, eta), math.atan2(eta, xi)
        t = _ahead(theta) if far > 0.0 else 0.0
        n = _put(words, n, LSL, t, far, _ahead(turn - t), 0.0, 0.0)
        if far <= 4.0:
            for beta in (math.acos(far / 4.0), -math.acos(far / 4.0)):
                t, u = _ahead(theta + beta + 0.5 * math.pi), _ahead(math.pi + 2.0 * beta)
                n = _put(words, n, LRL, t, u, _ahead(turn - theta + beta + 0.5 * math.pi), 0.0, 0.0)
        xi, eta = x + math.sin(turn), gy - 1.0 - math.cos(turn)
        far, theta = math.hypot(xi, eta), math.atan2(eta, xi)
        if far >= 2.0:
            u = math.sqrt(far * far - 4.0)
            t = _ahead(theta + math.atan2(2.0, u))
            n = _put(words, n, LSR, t, u, _ahead(t - turn), 0.0, 0.0)
        for m in range(first, n):
            for k in range(PARTS):
                words[m, k, 1] *= side
    return words[:n]


@compiled
def _ends_at(word: Array, x: float, y: float, phi: float) -> bool:
    px, py, yaw = 0.0, 0.0, 0.0
    for k in range(PARTS):
        px, py, yaw = moved(px, py, yaw, word[k, 0], word[k, 1])
    return max(abs(px - x), abs(py - y), abs(wrapped(yaw - phi))) <= _EXACT * (1.0 + abs(x) + abs(y))


@compiled
def curves(start: Array, goal: Array, radius: float, reverse: bool) -> tuple[Array, Array]:
    """All words that join two poses, shortest first.

    Parameters
    ----------
    start, goal : (3,) array
        x, y [m], yaw [rad].
    radius : float
        Of every arc [m].
    reverse : bool
        Reeds-Shepp words, else Dubins words.

    Returns
    -------
    words : (n, 5, 2) array
        Signed length [m] and turn [rad] of each part; parts of no length are zeros.
    lengths : (n,) array
        Never falling [m].
    """
    c, s = math.cos(start[2]), math.sin(start[2])
    dx, dy = (goal[0] - start[0]) / radius, (goal[1] - start[1]) / radius
    x, y, phi = c * dx + s * dy, c * dy - s * dx, wrapped(goal[2] - start[2])
    words = reeds_shepp_words(x, y, phi) if reverse else dubins_words(x, y, phi)
    found, lengths = np.empty((len(words), PARTS, 2)), np.empty(len(words))
    n = 0
    for m in range(len(words)):
        word, length = words[m], 0.0
        for k in range(PARTS):
            if abs(word[k, 0]) < _NIL:
                word[k, 0] = word[k, 1] = 0.0
            length += radius * abs(word[k, 0])
        if _ends_at(word, x, y, phi):
            place = n
            while place > 0 and lengths[place - 1] > length:
                lengths[place] = lengths[place - 1]
                for k in range(PARTS):
                    found[place, k, 0], found[place, k, 1] = found[place - 1, k, 0], found[place - 1, k, 1]
                place -= 1
            lengths[place] = length
            for k in range(PARTS):
                found[place, k, 0], found[place, k, 1] = radius * word[k, 0], word[k, 1]
            n += 1
    return found[:n], lengths[:n]
