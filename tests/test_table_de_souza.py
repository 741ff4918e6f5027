"""Tables 2 to 7 of paper 004: what is printed, what is misprinted, and ours within the stated bands."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.tables import de_souza
from benchmarks.tables.de_souza import MOST_ANGLE, TARGETS, arm, genetic, motion, network, solved
from benchmarks.tables.planar3r import Planar3R
from tests.maths import Array


@pytest.mark.parametrize("order", [3, 4, 5])
def test_every_printed_digit_of_the_motions(order: int) -> None:
    np.testing.assert_array_equal(np.round(motion(order), 2), de_souza.printed_motion(order))
    assert de_souza.motion_table(order).notes[0].startswith("0 of 18 printed figures differ")


def test_misprinted_rows_are_those_of_the_tables() -> None:
    """Tables 2 to 4: the printed angles and places against forward kinematics."""
    np.testing.assert_allclose(de_souza.algebra_off(), [35.84, 0.22, 0.30, 33.10, 10.58], atol=0.006)
    assert (de_souza.genes_off()[:4] < 0.0125).all()
    assert de_souza.genes_off()[4] == pytest.approx(0.476, abs=0.001)
    np.testing.assert_allclose(de_souza.place(de_souza.GENETIC_ANGLES[4]), [22.961, 17.821], atol=0.001)
    assert de_souza.network_off().max() < 0.01


def test_forward_kinematics_is_that_of_the_paper() -> None:
    """Eqs. (2) and (3), written out."""
    angles = np.array([10.0, 20.0, 40.0])
    turned = np.radians(np.cumsum(angles))
    x, y = (np.dot(de_souza.LINKS, part(turned)) for part in (np.cos, np.sin))
    np.testing.assert_allclose(de_souza.place(angles), [x, y], atol=1e-12)


@pytest.mark.parametrize("start", [0.0, 30.0, 60.0])
def test_algebra_is_exact_within_the_limits(start: float) -> None:
    q, errors = solved(Planar3R(arm()), start)
    assert errors.max() <= 1e-12
    assert _within(q)


def test_genes_within_their_band() -> None:
    q, errors = solved(genetic())
    assert errors.mean() <= 0.3
    assert _within(q)


@pytest.mark.slow
def test_network_within_its_band() -> None:
    q, errors = solved(network())
    assert q.shape == (len(TARGETS), 3)
    assert errors.mean() <= 0.05
    assert _within(q)


def _within(q: Array) -> bool:
    return bool(((q >= 0.0) & (q <= MOST_ANGLE + 1e-9)).all())


def test_what_is_printed_of_the_algebra() -> None:
    table = de_souza.table_2()
    assert len(table.rows) == 5
    assert all(len(row) == len(table.header) for row in table.rows)
    assert "rows 1, 4, 5" in table.notes[0]
