import pickle
import threading
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike

from regionik.mfabrik import Solver
from regionik.postures.families import BACK, FRONT, Family
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.kinds import Heading
from tests.maths import Array

YOUBOT = robot_named("youbot")


def frozen_copy(values: object) -> Array:
    array = np.array(values)
    array.flags.writeable = False
    return array


def strided(values: object) -> Array:
    return np.repeat(np.array(values), 2)[::2]


@pytest.mark.parametrize("mobile", [True, False])
def test_every_target_within_limits_is_solved(mobile: bool) -> None:
    rng = np.random.default_rng(2)
    scene = World("w", YOUBOT, Floor(shapely.box(-3, -3, 3, 3)), (), (), Rules())
    targets = np.column_stack([rng.uniform(-1, 1, (1500, 2)), rng.uniform(0.0, 0.65, 1500)])
    areas = path_areas(scene_of(scene), [Target(target) for target in targets], (FRONT,))
    lower, upper = YOUBOT.chain.lower, YOUBOT.chain.upper
    assert len(areas.target) > 1200
    for i, area in zip(areas.target, areas.inner, strict=True):
        solver = Solver(YOUBOT, area)
        joints = rng.uniform(lower, upper)
        if mobile:
            found = solver(targets[i], rng.uniform(-1, 1, 3), joints)
        else:
            spot = random_point(area, rng)
            found = solver.hold(targets[i], [*spot, rng.uniform(-3, 3)], joints)
            np.testing.assert_array_equal(found.base[:2], spot)
        tool = YOUBOT.tool(found.base, found.joints)[:3, 3]
        assert found.converged
        assert np.linalg.norm(tool - targets[i]) <= 1e-3 * (1 + 1e-9)
        assert (found.joints >= lower - 1e-9).all()
        assert (found.joints <= upper + 1e-9).all()
        assert area.distance(shapely.Point(found.base[:2])) < 1e-9


def random_point(area: shapely.Polygon, rng: np.random.Generator) -> list[float]:
    x0, y0, x1, y1 = area.bounds
    while True:
        spot = rng.uniform([x0, y0], [x1, y1])
        if area.contains(shapely.Point(spot)):
            return [float(spot[0]), float(spot[1])]


def test_nothing_to_do_takes_no_iteration() -> None:
    joints = np.deg2rad([10, 60, -40, 90, 0])
    base = np.array([0.3, -0.2, 0.7])
    target = YOUBOT.tool(base, joints)[:3, 3]
    found = Solver(YOUBOT)(target, base, joints)
    assert found.iterations == 0
    np.testing.assert_allclose(found.joints, joints, atol=1e-9)


@pytest.mark.parametrize("directed", [False, True])
@pytest.mark.parametrize("name", ["youbot", "youbot-real"])
def test_a_start_on_target_beyond_a_limit_is_led_back_within(name: str, directed: bool) -> None:
    """It needs no iteration to reach the target, and is no answer."""
    rng, robot, seen = np.random.default_rng(11), robot_named(name), 0
    lower, upper = robot.chain.lower, robot.chain.upper
    solver = Solver(robot, shapely.box(-3, -3, 3, 3))
    for _ in range(60):
        joints, base = rng.uniform(np.maximum(lower, -3), np.minimum(upper, 3)), rng.uniform(-1, 1, 3)
        k = rng.choice(np.flatnonzero(np.isfinite(upper)))
        joints[k] = rng.choice([lower[k] - 0.02, upper[k] + 0.02])
        tool = robot.tool(base, joints)
        target = Target(tool[:3, 3], direction=tool[:3, 2] if directed else None, cone=0.05)
        found = [solver(target, base, joints), solver.hold(target, base, joints)]
        least = solver.least_change(target, base, joints)
        for one in [*found, *([] if least is None else [least])]:
            assert (one.joints >= lower - 1e-9).all()
            assert (one.joints <= upper + 1e-9).all()
            seen += one.converged
    assert seen > 20


def test_heading_policies() -> None:
    target, base, joints = [1.0, 1.0, 0.25], [0.0, 0.0, 0.3], np.deg2rad([0, 60, -40, 90, 0])
    facing = Solver(YOUBOT, heading="face_target")(target, base, joints)
    fixed = Solver(YOUBOT, heading="fixed")(target, base, joints)
    free = Solver(YOUBOT, heading="free")(target, base, joints)
    assert facing.joints[0] == 0.0
    assert facing.base[2] == pytest.approx(np.pi / 4, abs=1e-3)
    assert fixed.base[2] == free.base[2] == 0.3


def test_a_fixed_heading_is_that_of_the_span_wherever_the_base_is_turned() -> None:
    """What missed the set-point before may have turned it."""
    joints = np.deg2rad([20, 60, -40, 90, 0])
    tool = YOUBOT.tool([0.1, 0.2, 0.3], joints)
    solver = Solver(YOUBOT, heading="fixed", span=(0.3, 0.3))
    for target in (Target(tool[:3, 3]), Target(tool[:3, 3], direction=tool[:3, 2], cone=0.1)):
        found = solver(target, [0.1, 0.2, 0.8], joints)
        assert found.converged
        assert found.base[2] == pytest.approx(0.3, abs=1e-9)


def test_free_heading_turns_only_by_what_the_pivot_cannot_take() -> None:
    joints = np.deg2rad([160, 60, -40, 90, 0])
    found = Solver(YOUBOT).hold([-0.4, -0.02, 0.25], [0, 0, 0], joints)
    assert found.converged
    assert found.joints[0] == pytest.approx(np.deg2rad(169))
    assert 0 < found.base[2] < np.deg2rad(20)


AREAS = {
    "the whole floor": None,
    "round pillars": shapely.box(-2, -2, 2, 2).difference(
        shapely.union_all([shapely.Point(x, y).buffer(0.3, 4) for x in (-1, 0, 1) for y in (-1, 0, 1)])
    ),
}


@pytest.mark.parametrize("area", AREAS.values(), ids=list(AREAS))
@pytest.mark.parametrize("family", [Family(FRONT), Family(BACK), Family(FRONT, pitch=-1.2)])
@pytest.mark.parametrize("heading", ["free", "face_target", "fixed"])
def test_one_by_one_equals_batch(heading: Heading, family: Family, area: shapely.Polygon | None) -> None:
    """One call, many rows in one and the arm's own solver are three ways to one thing."""
    rng, n = np.random.default_rng(5), 200
    targets = np.column_stack([rng.uniform(-1, 1, (n, 2)), rng.uniform(0.0, 0.6, n)])
    targets[-1] = 0.0, 0.0, 5.0  # out of reach
    bases, joints = rng.uniform(-1, 1, (n, 3)), rng.uniform(YOUBOT.chain.lower, YOUBOT.chain.upper, (n, 5))
    solver = Solver(YOUBOT, area, heading=heading, family=family)
    batch = solver.batch(targets, bases, joints)
    for k in range(n):
        slow = solver._general(Target(targets[k]), bases[k], joints[k], mobile=True)
        for one in (solver(targets[k], bases[k], joints[k]), slow):
            np.testing.assert_allclose(one.base, batch.base[k], atol=1e-9)
            np.testing.assert_allclose(one.joints, batch.joints[k], atol=1e-9)
            assert (one.iterations, one.converged) == (batch.iterations[k], batch.converged[k])
            assert one.error == pytest.approx(batch.error[k], abs=1e-12)
        held = solver.hold(targets[k], bases[k], joints[k])
        slow = solver._general(Target(targets[k]), bases[k], joints[k], mobile=False)
        np.testing.assert_allclose(held.base, slow.base, atol=1e-9)
        np.testing.assert_allclose(held.base[:2], bases[k, :2], atol=1e-12)
        np.testing.assert_allclose(held.joints, slow.joints, atol=1e-9)
        assert (held.iterations, held.converged) == (slow.iterations, slow.converged)


def test_a_batch_of_many_rows_equals_single_calls() -> None:
    """Rows that start again or are given up, and angles of many turns."""
    rng, n = np.random.default_rng(7), 8017
    targets = np.column_stack([rng.uniform(-1, 1, (n, 2)), rng.uniform(0.0, 0.6, n)])
    bases, joints = rng.uniform(-1, 1, (n, 3)), rng.uniform(YOUBOT.chain.lower, YOUBOT.chain.upper, (n, 5))
    bases[5, 2], bases[6, 2], targets[7] = 1e4, 3e7, (0.0, 0.0, 5.0)
    solver = Solver(YOUBOT)
    batch = solver.batch(targets, bases, joints)
    again = np.flatnonzero(batch.iterations > 20)
    assert len(again) > 50
    for k in [*range(9), *again[:200], *range(n - 20, n)]:
        one = solver(targets[k], bases[k], joints[k])
        np.testing.assert_allclose(one.base, batch.base[k], atol=1e-9)
        np.testing.assert_allclose(one.joints, batch.joints[k], atol=1e-9)
        assert (one.iterations, one.converged) == (batch.iterations[k], batch.converged[k])


@pytest.mark.parametrize("span", [(0.5, 0.5), (0.5, 0.6), (-0.2, 0.2), (3.0, 3.4)])
def test_the_tool_is_where_it_is_said_to_be_whatever_the_span(span: tuple[float, float]) -> None:
    rng = np.random.default_rng(6)
    solver = Solver(YOUBOT, span=span)
    for _ in range(100):
        target, base = [*rng.uniform(-1, 1, 2), 0.25], rng.uniform(-1, 1, 3)
        joints = rng.uniform(YOUBOT.chain.lower, YOUBOT.chain.upper)
        met = [one for one in (solver.hold(target, base, joints),) if one.converged]
        for found in (
            *met,
            solver(target, base, joints),
            solver._general(Target(np.array(target)), base, joints, mobile=True),
        ):
            tool = YOUBOT.tool(found.base, found.joints)[:3, 3]
            assert np.linalg.norm(tool - target) == pytest.approx(found.error, abs=1e-12)


class Row(np.ndarray[Any, Any]):
    """An array of another class."""


def unaligned(values: object) -> Array:
    row = np.array(values, dtype=np.float64)
    room = np.zeros(8 * len(row) + 1, dtype=np.uint8)[1:].view(np.float64)
    room[:] = row
    return room


AS_GIVEN: dict[str, Callable[[Any], ArrayLike]] = {
    "lists": list,
    "tuples": tuple,
    "single precision": np.float32,
    "the other byte order": lambda row: np.array(row).astype(">f8"),
    "objects": lambda row: np.array(row, dtype=object),
    "read-only": frozen_copy,
    "strided": strided,
    "backwards": lambda row: np.array(row)[::-1].copy()[::-1],
    "another class": lambda row: np.array(row).view(Row),
    "not aligned": unaligned,
}


@pytest.mark.parametrize("as_given", AS_GIVEN.values(), ids=list(AS_GIVEN))
def test_numbers_of_every_kind_are_taken(as_given: Callable[[object], ArrayLike]) -> None:
    target, base, joints = [1.0, 0.25, 0.25], [0.0, 0.5, 0.25], [0.0, 1.5, -1.0, 0.5, 0.0]
    plain = Solver(YOUBOT)(np.array(target), np.array(base), np.array(joints))
    found = Solver(YOUBOT)(as_given(target), as_given(base), as_given(joints))
    np.testing.assert_array_equal(found.base, plain.base)
    np.testing.assert_array_equal(found.joints, plain.joints)
    assert Solver(YOUBOT)(Target(np.array(target)), base, joints).error == plain.error


def test_out_of_reach_does_not_converge() -> None:
    found = Solver(YOUBOT)([0, 0, 2.0], [0, 0, 0], YOUBOT.carry)
    assert not found.converged
    assert found.error > 1.0


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="heading must be one of"):
        Solver(YOUBOT, heading="left")  # type: ignore[arg-type]
    good: dict[str, Any] = {"target": [0, 0, 0.2], "base": [0, 0, 0], "joints": YOUBOT.carry}
    for kind in (list, np.array):
        for name, wrong, said in (
            ("target", [0, 0, np.nan], "finite"),
            ("base", [0, np.inf, 0], "base: every number must be finite"),
            ("joints", [0, 0, 0, 0, -np.inf], "joints: every number must be finite"),
            ("joints", [0, 0], "joints: expected 5 numbers"),
            ("base", [0, 0, 0, 0], "base: expected 3 numbers"),
            ("target", [0, 0], "expected 3 numbers"),
            ("target", [[0, 0, 0.2]], "expected 3 numbers"),
        ):
            with pytest.raises(InputError, match=said) as raised:
                Solver(YOUBOT)(**good | {name: kind(wrong)})
            assert "\n" not in str(raised.value)
    for none, said in (
        (None, "expected 3 numbers"),
        (3, "expected 3 numbers"),
        (np.ndarray, "expected numbers"),
    ):
        with pytest.raises(InputError, match=said):
            Solver(YOUBOT)(**good | {"base": none})


def test_rows_that_were_unpickled_are_solved_for() -> None:
    """Their kind of number is the same, but not the same object."""
    solver, rows = (
        Solver(robot_named("youbot")),
        ([1.0, 0.2, 0.3], np.zeros(3), np.array([0, 1.5, -1, 0.5, 0])),
    )
    made = [np.array(row, dtype=np.float64) for row in rows]
    sent = pickle.loads(pickle.dumps(made))
    here, there = solver(*made), solver(*sent)
    assert np.array_equal(here.base, there.base)
    assert np.array_equal(here.joints, there.joints)
    assert np.array_equal(solver(Target(sent[0]), *sent[1:]).joints, here.joints)


def test_finite_numbers_are_taken_whatever_their_size() -> None:
    huge = np.full(3, 1e308)
    assert not Solver(YOUBOT)(huge, huge, YOUBOT.carry).converged


def test_one_solver_for_many_threads() -> None:
    """A call keeps nothing in the solver."""
    solver, rng, joints = Solver(YOUBOT), np.random.default_rng(2), np.array([0.0, 1.5, -1.0, 0.5, 0.0])
    cases = [(np.append(rng.uniform(-1, 1, 2), 0.25), rng.uniform(-1, 1, 3), joints) for _ in range(300)]
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


def test_answers_are_frozen_and_share_nothing() -> None:
    solver, target = Solver(YOUBOT), np.array([1.0, 0.25, 0.25])
    base, joints = np.array([0.0, 0.5, 0.25]), np.array([0.0, 1.5, -1.0, 0.5, 0.0])
    given = base.copy(), joints.copy()
    first = solver(target, base, joints)
    before = first.joints.copy()
    second = solver(target + 0.1, base, joints)
    assert first.joints is not second.joints
    np.testing.assert_array_equal(first.joints, before)
    np.testing.assert_array_equal(base, given[0])
    np.testing.assert_array_equal(joints, given[1])
    with pytest.raises(FrozenInstanceError):
        first.error = 0.0  # type: ignore[misc]
