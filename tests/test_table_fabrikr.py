"""Tables 1 and 3 to 6 of the FABRIK-R paper, recomputed."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.tables import fabrikr
from benchmarks.tables import fabrikr_printed as printed
from benchmarks.tables.batch import solve_batch
from regionik.planners.solvers.multistart_ik import ArmSolver
from regionik.worlds.bundled import robot_named


def test_five_joints_of_table_1() -> None:
    ours = fabrikr.five_joints()
    assert ours.single.converged.sum() >= 173
    assert ours.restarted.converged.sum() >= 195
    assert ours.polished.converged.all()
    assert ours.single.iterations.mean() <= printed.TABLE_1[1]
    assert ours.restarted.iterations.mean() <= 23.0
    assert ours.polished.iterations.mean() <= 23.0


def test_ten_joints_of_tables_3_and_4() -> None:
    chain, given = robot_named("dof10").chain, fabrikr.far_cases()
    assert given.targets.shape == (200, 3)
    apart = np.linalg.norm(fabrikr.points(chain, given.joints) - given.targets, axis=1)
    assert apart.min() >= 0.6
    found = fabrikr.ten_joints()
    for rival in found.values():
        assert rival.converged.all()
        assert np.linalg.norm(fabrikr.points(chain, rival.joints) - given.targets, axis=1).max() <= 1e-6
    ours = found[fabrikr.OURS]
    order = ["FABRIK-R", "Jacobian DLS", "CCD", "Jacobian transpose"]
    assert sorted(found, key=lambda name: found[name].iterations.mean()) == order
    assert ours.iterations.mean() == pytest.approx(4.3, abs=0.7)
    assert all(0 < time < 60 for time in fabrikr.times_of_ten_joints().values())


def test_calculated_angles_of_table_6() -> None:
    angles, asked = [row[1] for row in printed.CALCULATED], [row[2] for row in printed.CALCULATED]
    off = fabrikr.distances(robot_named("pioneer7").chain, angles)
    np.testing.assert_allclose(off, asked, atol=0.002)
    assert np.mean(off) == pytest.approx(2.752, abs=0.001)


def test_the_printed_d1_of_table_5_is_not_what_table_6_was_made_with() -> None:
    found = fabrikr.distances(fabrikr.as_printed(), [row[1] for row in printed.CALCULATED])
    expected = [1.12, 8.21, 3.78, 2.67, 1.10, 1.04, 1.06, 9.58, 1.09, 3.16]
    np.testing.assert_allclose(found, expected, atol=0.01)
    np.testing.assert_allclose(fabrikr.lengths(), [0.1489, 0, 0.15, 0, 0.145, 0, 0], atol=1e-15)


def test_measured_angles_of_table_6_are_the_servos_but_not_the_printed_distances() -> None:
    angles = np.array([row[0] for row in printed.MEASURED])
    steps = angles * 1023 / 300
    assert np.abs(steps - np.round(steps)).max() < 1e-3
    asked = np.array([row[1] for row in printed.MEASURED])
    off = fabrikr.distances(robot_named("pioneer7").chain, angles)
    assert np.mean(asked) == pytest.approx(16.368, abs=0.001)
    assert np.abs(off - asked).min() > 0.1


def test_our_answers_to_table_6() -> None:
    chain, targets = robot_named("pioneer7").chain, fabrikr.targets_of_table_6()
    ours = fabrikr.from_upright()
    assert ours.converged.all()
    assert ours.iterations.mean() <= printed.TABLE_6_ITERATIONS
    assert np.linalg.norm(fabrikr.points(chain, ours.joints) - targets, axis=1).max() <= 0.01
    fine = solve_batch(ArmSolver(chain, tolerance=1e-5), targets, robot_named("pioneer7").carry)
    assert fine.converged.all()
    assert np.linalg.norm(fabrikr.points(chain, fine.joints) - targets, axis=1).max() <= 1e-5


def test_tables_stand_beside_the_printed_figures() -> None:
    made = fabrikr.tables()
    assert [table.number for table in made] == ["Table 1", "Table 3", "Table 4", "Table 5", "Table 6"]
    for table in made:
        assert {len(row) for row in table.rows} == {len(table.header)}
        assert table.notes
