"""Arrays of Python as a compiled call sees them: only plain rows of floats of the right length get in."""

import threading
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from regionik.mfabrik import Solver
from regionik.planners.solvers import handed, onecall
from regionik.worlds.bundled import robot_named

YOUBOT = robot_named("youbot")
TARGET, BASE = np.array([1.0, 0.25, 0.25]), np.array([0.0, 0.5, 0.25])
JOINTS = np.array([0.0, 1.5, -1.0, 0.5, 0.0])


class Row(np.ndarray[Any, Any]):
    """An array of another class."""


def _sealed(row: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    row = row.copy()
    row.flags.writeable = False
    return row


def _askew(row: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The same numbers, where the processor does not want them."""
    room = np.zeros(8 * len(row) + 1, dtype=np.uint8)[1:].view(np.float64)
    room[:] = row
    return room


def _passes(solver: Solver, target: Any, base: Any, joints: Any) -> int:
    """Passes of the compiled call for what is given as it is, -1 where it is refused."""
    assert solver._call is not None
    call, dof, known = solver._call
    return call(known, target, base, joints, np.empty(3), np.empty(dof))[1]


@pytest.mark.parametrize("kind", [np.copy, _sealed, lambda row: np.concatenate([[9.0], row])[1:]])
def test_plain_rows_get_in(kind: Any) -> None:
    solver = Solver(YOUBOT)
    assert _passes(solver, kind(TARGET), kind(BASE), kind(JOINTS)) == solver(TARGET, BASE, JOINTS).iterations


OTHERS = {
    "a list": list,
    "nothing": lambda row: None,
    "a number": lambda row: 3,
    "a class": lambda row: np.ndarray,
    "short": lambda row: row[:-1],
    "long": lambda row: np.append(row, 0.0),
    "single precision": lambda row: row.astype(np.float32),
    "whole numbers": lambda row: row.astype(np.int64),
    "the other byte order": lambda row: row.astype(">f8"),
    "complex": lambda row: row.astype(complex),
    "objects": lambda row: row.astype(object),
    "a matrix": lambda row: row[None],
    "no axis": lambda row: np.array(1.0),
    "every other": lambda row: np.repeat(row, 2)[::2],
    "backwards": lambda row: row[::-1],
    "another class": lambda row: row.view(Row),
    "not aligned": _askew,
    "not finite": lambda row: np.full_like(row, np.inf),
    "NaN": lambda row: np.full_like(row, np.nan),
}


@pytest.mark.parametrize("kind", OTHERS.values(), ids=list(OTHERS))
def test_nothing_else_gets_in(kind: Any) -> None:
    solver = Solver(YOUBOT)
    for which in range(3):
        given: list[Any] = [TARGET, BASE, JOINTS]
        given[which] = kind(given[which])
        assert _passes(solver, *given) == -1


def test_finite_numbers_get_in_whatever_their_size() -> None:
    huge = np.full(3, 1e308)
    assert _passes(Solver(YOUBOT), huge, huge, JOINTS) >= 0


def test_where_the_layout_is_unknown_python_looks_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is slower, to the same answers."""
    quick = Solver(YOUBOT)(TARGET, BASE, JOINTS)
    assert handed.layout_is_known()
    monkeypatch.setattr(onecall, "layout_is_known", lambda: False)
    onecall.one_call.cache_clear()
    try:
        solver = Solver(YOUBOT)
        assert solver._call is not None
        assert solver._call[0] is onecall._looked_at
        slow = solver(TARGET, BASE, JOINTS)
        for refused in ([1.0, 0.2, 0.3], None, TARGET[:2], TARGET.astype(np.float32), np.full(3, np.nan)):
            assert _passes(solver, refused, BASE, JOINTS) == -1
    finally:
        onecall.one_call.cache_clear()
    np.testing.assert_allclose(slow.joints, quick.joints, atol=1e-12)
    np.testing.assert_allclose(slow.base, quick.base, atol=1e-12)


def test_what_the_layout_is_taken_for_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    handed.layout_is_known.cache_clear()
    monkeypatch.setattr(handed, "_KIND", 48)
    try:
        assert not handed.layout_is_known()
    finally:
        handed.layout_is_known.cache_clear()


def test_one_solver_for_many_threads() -> None:
    """A call keeps nothing in the solver."""
    solver, rng = Solver(YOUBOT), np.random.default_rng(2)
    cases = [(np.append(rng.uniform(-1, 1, 2), 0.25), rng.uniform(-1, 1, 3), JOINTS) for _ in range(300)]
    alone = [solver(*case).base for case in cases]
    found: list[list[Any]] = [[] for _ in range(4)]

    def work(mine: list[Any]) -> None:
        mine.extend(solver(*case).base for case in cases)

    threads = [threading.Thread(target=work, args=(mine,)) for mine in found]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for mine in found:
        np.testing.assert_array_equal(mine, alone)


def test_answers_are_frozen_and_keep_their_arrays() -> None:
    solver = Solver(YOUBOT)
    first = solver(TARGET, BASE, JOINTS)
    before = first.joints.copy()
    second = solver(TARGET + 0.1, BASE, JOINTS)
    assert first.joints is not second.joints
    np.testing.assert_array_equal(first.joints, before)
    with pytest.raises(FrozenInstanceError):
        first.error = 0.0  # type: ignore[misc]
