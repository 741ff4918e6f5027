"""The algebraic solution: exact, within the limits, and found wherever there is one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.tables.goals import aim_at, solve_goal
from benchmarks.tables.planar3r import Planar3R
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from tests import examples

MOST = np.pi / 3


def arm(low: float = 0.0, high: float = MOST) -> Chain:
    """Links of paper 004 [m]."""
    return Chain.from_dh([(0.0, 0.0, length, 0.0, low, high) for length in (0.07, 0.10, 0.14)])


shares = st.floats(0.0, 1.0)


@settings(max_examples=examples(150))
@example((0.1484375, 0.0, 0.0), (0.0, 0.0, 0.0))  # stretched, and rounding takes the cosine beyond 1
@given(st.tuples(shares, shares, shares), st.tuples(shares, shares, shares))
def test_every_place_of_the_arm_is_met_exactly(posture: tuple[float, ...], start: tuple[float, ...]) -> None:
    """The law of the table: whatever posture made the target, to 1e-12 cm and within 0 to 60 degrees."""
    chain = arm()
    target = chain.forward(MOST * np.array(posture))[:3, 3]
    answer = solve_goal(Planar3R(chain, 1e-7), aim_at(target), MOST * np.array(start))
    assert answer.converged
    # An isolated posture at a corner of the limits is met to the root of rounding only.
    inside = all(0.01 < share < 0.99 for share in posture)
    assert not inside or answer.error < 1e-14
    assert (answer.joints >= 0.0).all()
    assert (answer.joints <= MOST).all()


def test_a_start_on_target_stays() -> None:
    chain, q = arm(), np.array([0.3, 0.5, 0.7])
    answer = solve_goal(Planar3R(chain), aim_at(chain.forward(q)[:3, 3]), q)
    np.testing.assert_allclose(answer.joints, q, atol=1e-12)


@pytest.mark.parametrize("low", [-np.inf, -np.pi])
def test_wide_limits(low: float) -> None:
    chain = arm(low, -low)
    for angle in np.linspace(-np.pi, np.pi, 13):
        goal = aim_at([0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.0])
        assert solve_goal(Planar3R(chain), goal, [0.1, 0.2, 0.3]).error < 1e-15


def test_out_of_reach_is_said() -> None:
    answer = solve_goal(Planar3R(arm()), aim_at([0.5, 0.0, 0.0]), [0.1, 0.2, 0.3])
    assert not answer.converged


def test_other_arms_and_more_than_positions_are_refused() -> None:
    with pytest.raises(InputError, match="three hinges"):
        Planar3R(robot_named("youbot").chain)
    with pytest.raises(InputError, match="positions alone"):
        solve_goal(Planar3R(arm()), aim_at([0.2, 0.1, 0.0], [0.0, 0.0, 1.0]), [0.1, 0.2, 0.3])
