"""Convex bodies that keep apart."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from regionik.worlds.separation import ConvexBody, apart_somewhere, separated
from tests.maths import Array, pose, translation

HERE = np.eye(4)[None]


def distance(one: Array, other: Array) -> float:
    """Between the hulls of two clouds, by an optimiser over their weights."""

    def gap(weights: Array) -> float:
        p, q = np.split(np.abs(weights), [len(one)])
        return float(np.linalg.norm(p @ one / p.sum() - q @ other / q.sum()))

    starts = np.random.default_rng(0).random((3, len(one) + len(other)))
    return min(float(minimize(gap, start).fun) for start in starts)


@given(st.integers(0, 2**32 - 1), st.floats(0, 3), st.floats(0, 0.3))
def test_bodies_that_are_found_apart_are(seed: int, away: float, radius: float) -> None:
    """A plane between both is a proof: no points of the one are as near to the other as the radii."""
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=(5, 3)), rng.normal(size=(2, 3))
    T = pose([away, 0, 0], rng.uniform(-3, 3, 3).tolist())
    if separated(ConvexBody(one, radius), HERE, ConvexBody(other, radius), T[None])[0]:
        assert distance(one, other @ T[:3, :3].T + T[:3, 3]) > 2 * radius - 1e-9


@given(st.integers(0, 2**32 - 1), st.floats(0.02, 1), st.floats(0, 0.3))
def test_bodies_on_both_sides_of_a_gap_are_found_apart(seed: int, gap: float, radius: float) -> None:
    rng = np.random.default_rng(seed)
    low, high = rng.uniform(-1, 1, (20, 3)), rng.uniform(-1, 1, (8, 3))
    low[:, 2] -= low[:, 2].max()
    high[:, 2] += 2 * radius + gap - high[:, 2].min()
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed % 1000).as_matrix()
    assert separated(ConvexBody(low, radius), T[None], ConvexBody(high, radius), T[None])[0]


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.99))
def test_bodies_that_share_a_point_are_not(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=(12, 3)), rng.normal(size=(12, 3))
    spots = rng.dirichlet(np.ones(12), 2)
    T = translation(*(spots[0] @ one - spots[1] @ other))
    assert not separated(ConvexBody(one, share), HERE, ConvexBody(other), T[None])[0]


def test_each_pair_of_poses_by_itself() -> None:
    ball = ConvexBody(np.zeros((1, 3)), 0.5)
    spots = np.array([0.9, 1.1, 0.0, 5.0])
    moved = np.stack([translation(x, 0, 0) for x in spots])
    assert separated(ball, np.repeat(HERE, 4, 0), ball, moved).tolist() == [False, True, False, True]


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(1e-4, 0.02), st.floats(0.01, 0.1))
def test_a_ball_over_the_middle_of_a_large_face_is_apart(
    x: float, y: float, gap: float, radius: float
) -> None:
    """Where Gilbert's method is slow; a pair that were taken to touch always would not be checked."""
    corners = np.array([[x, y, z] for x in (-0.35, 0.35) for y in (-0.35, 0.35) for z in (-0.3, 0.0)])
    box, ball = ConvexBody(corners), ConvexBody(np.zeros((1, 3)), radius)
    over, into = (np.array([np.eye(4)]) for _ in range(2))
    over[0, :3, 3], into[0, :3, 3] = (x, y, radius + gap), (x, y, radius - gap)
    assert apart_somewhere(box, HERE, ball, over)
    assert not apart_somewhere(box, HERE, ball, into)
