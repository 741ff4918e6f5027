"""Subproblems that closed forms of inverse kinematics are made of, for many problems at once.

Source: Elias and Wen, IK-Geo: Unified robot inverse kinematics using subproblem decomposition (Mechanism and
Machine Theory 2025), subproblems 1 and 4; Pieper's position problem of three axes, reduced to a quartic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionik.worlds.arrays import Array

COSINE_SLACK = 1e-3  # by which a cosine may pass 1, and a root the real line: the polishing after it decides
MEETING_TOLERANCE = 1e-6  # distances and sines below which two axes count as meeting, or as parallel
ANGLE_SHIFT = 0.7  # of the unknown angle, so that half a turn, which no polynomial has, is rare [rad]


def row_dot(a: Array, b: Array) -> Array:
    """Inner products (..., ) of vectors (..., 3)."""
    found: Array = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return found


def row_cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3), several times as fast as numpy's for few vectors."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k, i, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return found


def rotated_about(axis: Array, angle: Array, vector: Array) -> Array:
    """Vectors (..., 3) turned about unit axes: Rodrigues' formula."""
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    along = row_dot(axis, vector)[..., None] * axis
    found: Array = along + c * (vector - along) + s * row_cross(axis, vector)
    return found


def angle_to(axis: Array, vector: Array, wanted: Array) -> Array:
    """Angles (...,) that turn vectors about axes to others, or nearest to them (subproblem 1)."""
    flat = row_dot(vector, wanted) - row_dot(axis, vector) * row_dot(axis, wanted)
    return np.arctan2(row_dot(axis, row_cross(vector, wanted)), flat)


def angles_onto_plane(normal: Array, axis: Array, vector: Array, height: Array) -> Array:
    """Both angles (2, ...) that turn vectors to a height over a plane, NaN where none does (subproblem 4).

    normal . R(axis, angle) vector = height.
    """
    still = row_dot(normal, axis) * row_dot(axis, vector)
    cosine, sine = row_dot(normal, vector) - still, row_dot(normal, row_cross(axis, vector))
    return linear_roots(cosine, sine, still - height)


def linear_roots(cosine: Array, sine: Array, rest: Array) -> Array:
    """Both roots (2, ...) of cosine cos(x) + sine sin(x) + rest = 0; NaN where there are none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        share = -rest / np.hypot(cosine, sine)
        share = np.where(np.abs(share) <= 1.0 + COSINE_SLACK, np.clip(share, -1.0, 1.0), np.nan)
    middle, half = np.arctan2(sine, cosine), np.arccos(share)
    return np.stack([middle + half, middle - half])


def quadratic_roots(form: Array) -> Array:
    """The roots (4, m) of quadratic forms (m, 3, 3) in (cos x, sin x, 1); NaN where there are fewer."""
    c, s = np.cos(ANGLE_SHIFT), np.sin(ANGLE_SHIFT)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    Q = turn.T @ form @ turn
    A, B, C = Q[:, 0, 0], 2 * Q[:, 0, 1], Q[:, 1, 1]
    D, E, F = 2 * Q[:, 0, 2], 2 * Q[:, 1, 2], Q[:, 2, 2]
    # With t = tan(x / 2), times (1 + t^2)^2.
    terms = np.stack([A + D + F, 2 * (B + E), 2 * (2 * C - A + F), 2 * (E - B), A - D + F], axis=1)
    lead = np.where(np.abs(terms[:, 4]) > 1e-300, terms[:, 4], 1e-300)
    companion = np.zeros((len(form), 4, 4))
    companion[:, 1:, :3] = np.eye(3)
    companion[:, :, 3] = -terms[:, :4] / lead[:, None]
    companion[~np.isfinite(companion).all(axis=(1, 2))] = 0.0
    roots = np.linalg.eigvals(companion).T
    real = np.abs(roots.imag) <= np.sqrt(COSINE_SLACK) * (1.0 + np.abs(roots.real))
    found: Array = np.where(real, 2 * np.arctan(roots.real) + ANGLE_SHIFT, np.nan)
    return found


def position_angles(axes: Array, points: Array, end: Array, goal: Array) -> tuple[Array, NDArray[np.intp]]:
    """Angles about three lines that bring a point to a goal.

    Parameters
    ----------
    axes, points : (m, 3, 3) array
        Unit direction and a point of each line, all angles at zero.
    end, goal : (m, 3) array
        The point at zero, and where it shall be.

    Returns
    -------
    angles : (k, 3) array
    which : (k,) array of int
        Of the m problems.
    """
    h1, h2, h3 = axes[:, 0], axes[:, 1], axes[:, 2]
    o1, o2 = nearest_points(points[:, 0], h1, points[:, 1], h2)
    a, b, d, p = o2 - o1, points[:, 2] - o2, end - points[:, 2], goal - o1
    s = np.linalg.norm(row_cross(h1, h2), axis=1)
    far = np.linalg.norm(a, axis=1)
    third = _third_angles(a, b, d, p, (h1, h2, h3), s, far)
    row, which = np.nonzero(np.isfinite(third))
    x3 = third[row, which]
    h1, h2, h3, a, b, d, p, s, far = (one[which] for one in (h1, h2, h3, a, b, d, p, s, far))
    v = b + rotated_about(h3, x3, d)
    # w is R2 v but for its part along h2; across and ahead are its parts along the common normal and h1.
    across = row_dot(p, p) - row_dot(a, a) - row_dot(v, v)
    ahead = row_dot(h1, p) - row_dot(h1, h2) * row_dot(h2, v)
    flat = row_dot(v, v) - row_dot(h2, v) ** 2
    lead = np.where((s > MEETING_TOLERANCE)[:, None], h1 - row_dot(h1, h2)[:, None] * h2, row_cross(a, h2))
    lead /= np.maximum(np.linalg.norm(lead, axis=1), 1e-300)[:, None]
    side = row_cross(h2, lead)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_side = across / (2 * row_dot(a, side))
        by_lead = ahead / s
    meets, parallel = far <= MEETING_TOLERANCE, s <= MEETING_TOLERANCE
    rest = np.where(meets, flat - by_lead**2, flat - by_side**2)
    root = np.sqrt(np.where(rest > -COSINE_SLACK, np.maximum(rest, 0.0), np.nan))
    found, owner = [], []
    for sign in (1.0, -1.0):
        x = np.where(parallel, sign * root, by_lead)
        y = np.where(meets, sign * root, by_side)
        w = x[:, None] * lead + y[:, None] * side
        x2 = angle_to(h2, v, w)
        x1 = angle_to(h1, a + rotated_about(h2, x2, v), p)
        own = np.isfinite(x2) & np.isfinite(x1) & ((sign > 0) | meets | parallel)
        found.append(np.column_stack([x1, x2, x3])[own])
        owner.append(which[own])
    return np.concatenate(found), np.concatenate(owner)


def _third_angles(
    a: Array, b: Array, d: Array, p: Array, axes: tuple[Array, Array, Array], s: Array, far: Array
) -> Array:
    """Angles (4, m) about the third line at which the other two can do the rest; NaN for none."""
    h1, h2, h3 = axes
    still = row_dot(h3, d)[:, None] * h3
    basis = np.stack([d - still, row_cross(h3, d), still + b], axis=2)  # v as a form of (cos x, sin x, 1)
    one = np.zeros((len(a), 3))
    one[:, 2] = 1.0
    squared = 2 * np.einsum("mi,mij->mj", b, basis)  # |v|^2 = |b|^2 + |d|^2 + 2 b . R3 d
    squared[:, 2] += row_dot(d, d) - row_dot(b, b)
    up = np.einsum("mi,mij->mj", h2, basis)
    across = (row_dot(p, p) - row_dot(a, a))[:, None] * one - squared
    ahead = row_dot(h1, p)[:, None] * one - row_dot(h1, h2)[:, None] * up
    form = (s**2)[:, None, None] * _outer(across, across)
    form += (4 * far**2)[:, None, None] * (
        _outer(ahead, ahead) - (s**2)[:, None, None] * (_outer(squared, one) - _outer(up, up))
    )
    third = quadratic_roots(form / np.maximum(np.abs(form).max(axis=(1, 2)), 1e-300)[:, None, None])
    for degenerate, row in ((far <= MEETING_TOLERANCE, across), (s <= MEETING_TOLERANCE, ahead)):
        third[:, degenerate] = np.nan
        third[:2, degenerate] = linear_roots(*row[degenerate].T)
    return third


def _outer(a: Array, b: Array) -> Array:
    """Symmetric products (m, 3, 3)."""
    found: Array = 0.5 * (a[:, :, None] * b[:, None] + b[:, :, None] * a[:, None])
    return found


def nearest_points(p1: Array, h1: Array, p2: Array, h2: Array) -> tuple[Array, Array]:
    """Points (..., 3) at which two lines come nearest; on parallel ones those nearest to the first point."""
    apart, c = p2 - p1, row_dot(h1, h2)
    square = 1.0 - c * c
    crossing = square > MEETING_TOLERANCE**2
    with np.errstate(invalid="ignore", divide="ignore"):
        t1 = np.where(crossing, (row_dot(h1, apart) - c * row_dot(h2, apart)) / square, 0.0)
        t2 = np.where(crossing, (c * row_dot(h1, apart) - row_dot(h2, apart)) / square, -row_dot(h2, apart))
    return p1 + t1[..., None] * h1, p2 + t2[..., None] * h2
