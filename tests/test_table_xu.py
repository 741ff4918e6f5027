"""Xu et al.: equations and simulations, recomputed."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.tables import xu
from tests.maths import Array

LIMIT = np.pi / 2


def test_equations_hold_but_for_the_misprint() -> None:
    off = xu.equations()
    wrong = {name for name, value in off.items() if value > 1e-9}
    assert wrong == {"(9), cos q4 ≠ 0, cos q23 ≠ 0, as printed"}
    assert off[wrong.pop()] == pytest.approx(2.36, abs=0.05)
    assert len(off) == 7


@pytest.mark.parametrize("pivot", [LIMIT, xu.HELD], ids=["pivot", "no-pivot"])
@pytest.mark.parametrize("poses", [xu.circle(), xu.door()], ids=["circle", "door"])
def test_every_pose_is_met_without_slip(poses: list[Array], pivot: float) -> None:
    found = xu.simulation(poses, pivot)
    assert found.place < 1e-12
    assert found.turn < 1e-11
    assert found.slip < 1e-12
    assert np.abs(found.joints[:, 0]).max() <= pivot


def test_figures_of_the_circle() -> None:
    still, free = xu.simulation(xu.circle(), xu.HELD), xu.simulation(xu.circle(), LIMIT)
    q, turned = np.degrees(still.joints), np.degrees(free.joints)
    assert len(q) == 360
    assert q[[0, -1], 1] == pytest.approx([-11.175, -17.818], abs=1e-3)
    assert q[[0, -1], 2] == pytest.approx([101.175, 107.818], abs=1e-3)
    assert [q[:, 3].min(), q[:, 3].max()] == pytest.approx([-178.5, 169.16], abs=0.01)
    assert [turned[:, 3].min(), turned[:, 3].max()] == pytest.approx([-88.5, 85.53], abs=0.01)
    assert still.wheel == pytest.approx(0.03709, abs=2e-5)
    assert free.wheel == pytest.approx(0.04153, abs=2e-5)
    assert still.paper_slip.min() == pytest.approx(0.006285, abs=1e-4)
    assert still.paper_slip.max() == pytest.approx(0.00634, abs=1e-4)


def test_figures_of_the_door() -> None:
    found = xu.simulation(xu.door(), xu.HELD)
    assert len(found.joints) == 91
    assert np.degrees(found.joints[:, 1]) == pytest.approx(11.157, abs=1e-3)
    assert np.degrees(found.joints[:, 2]) == pytest.approx(-101.157, abs=1e-3)
    assert found.wheel <= 0.00436
    assert found.paper_slip.max() == pytest.approx(0.0066, abs=1e-4)


def test_the_printed_height_of_the_knob_is_out_of_reach() -> None:
    low, high = xu.knob_heights()
    assert (low, high) == pytest.approx((0.36596, 0.68596), abs=1e-9)
    assert low > xu.KNOB
    assert low < xu.door()[0][2, 3] < high


def test_tables_stand_beside_the_printed_figures() -> None:
    for table in xu.tables():
        assert {len(row) for row in table.rows} == {len(table.header)}
        assert table.notes
