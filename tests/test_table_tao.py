"""Tables 1 to 3 of Tao et al., recomputed; fewer scenes than in the document."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.tables import tao

SCENES = 40


@pytest.mark.parametrize("test", [1, 2, 3])
def test_the_run_without_obstacles_has_every_printed_digit(test: int) -> None:
    iterations, distance, _ = tao.PRINTED[test - 1][0]
    found = tao.run(test, None)
    assert found.converged
    assert found.iterations == iterations
    assert f"{found.error:.4e}" == f"{distance:.4e}"


@pytest.mark.parametrize(("test", "error"), [(1, 9.863800e-4), (2, 8.681949e-4), (3, 4.956507e-4)])
def test_its_distance_to_seven_digits(test: int, error: float) -> None:
    assert f"{tao.run(test, None).error:.6e}" == f"{error:.6e}"


@pytest.mark.parametrize(("test", "most", "least"), [(2, 8.0, 10), (3, 4.0, 1)])
def test_circles_are_gone_round(test: int, most: float, least: int) -> None:
    many = tao.runs(test, SCENES)
    assert len(many.found) == SCENES
    assert many.refuted == 0
    assert len(many.iterations) >= SCENES - 1
    assert tao.blocked(test, SCENES) >= least
    assert np.median(many.iterations) <= most


@pytest.mark.slow
def test_circles_that_leave_no_way_are_told_from_those_that_do() -> None:
    many = tao.runs(1, SCENES)
    assert many.refuted == 0
    assert 0.6 * SCENES <= len(many.iterations) <= 0.85 * SCENES  # 141 of 200 in the specification
    assert 25 <= np.median(many.iterations) <= 55
    failed = [seed for seed, one in enumerate(many.found) if not one.converged]
    kinds = tao.proven(1, failed[:4])
    assert set(kinds) == {"found", "none"}
    assert tao.proven(1, [seed for seed, one in enumerate(many.found) if one.converged][:2]) == ["found"] * 2
