import numpy as np
import pytest
import shapely

from regionik.mfabrik import Solver
from regionik.reachable import FRONT
from regionik.regions import path_areas
from regionik.worlds.errors import InputError
from regionik.worlds.library import robot_named
from regionik.worlds.scene import Floor, Rules, Target, World

YOUBOT = robot_named("youbot")


@pytest.mark.parametrize("mobile", [True, False])
def test_every_target_within_limits_is_solved(mobile: bool) -> None:
    rng = np.random.default_rng(2)
    scene = World("w", YOUBOT, Floor(shapely.box(-3, -3, 3, 3)), (), (), Rules())
    targets = np.column_stack([rng.uniform(-1, 1, (1500, 2)), rng.uniform(0.0, 0.65, 1500)])
    areas = path_areas(scene, [Target(target) for target in targets], (FRONT,))
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


def test_heading_policies() -> None:
    target, base, joints = [1.0, 1.0, 0.25], [0.0, 0.0, 0.3], np.deg2rad([0, 60, -40, 90, 0])
    facing = Solver(YOUBOT, heading="face_target")(target, base, joints)
    fixed = Solver(YOUBOT, heading="fixed")(target, base, joints)
    free = Solver(YOUBOT, heading="free")(target, base, joints)
    assert facing.joints[0] == 0.0
    assert facing.base[2] == pytest.approx(np.pi / 4, abs=1e-3)
    assert fixed.base[2] == free.base[2] == 0.3


def test_free_heading_turns_only_by_what_the_pivot_cannot_take() -> None:
    joints = np.deg2rad([160, 60, -40, 90, 0])
    found = Solver(YOUBOT).hold([-0.4, -0.02, 0.25], [0, 0, 0], joints)
    assert found.converged
    assert found.joints[0] == pytest.approx(np.deg2rad(169))
    assert 0 < found.base[2] < np.deg2rad(20)


def test_one_by_one_equals_batch() -> None:
    rng = np.random.default_rng(5)
    targets = np.column_stack([rng.uniform(-1, 1, (50, 2)), rng.uniform(0.1, 0.4, 50)])
    bases, joints = np.zeros((50, 3)), rng.uniform(YOUBOT.chain.lower, YOUBOT.chain.upper, (50, 5))
    solver = Solver(YOUBOT)
    batch = solver.batch(targets, bases, joints)
    for k in range(50):
        one = solver(targets[k], bases[k], joints[k])
        np.testing.assert_array_equal(one.base, batch.base[k])
        np.testing.assert_array_equal(one.joints, batch.joints[k])


def test_out_of_reach_does_not_converge() -> None:
    found = Solver(YOUBOT)([0, 0, 2.0], [0, 0, 0], YOUBOT.carry)
    assert not found.converged
    assert found.error > 1.0


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="heading must be one of"):
        Solver(YOUBOT, heading="left")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="finite"):
        Solver(YOUBOT)([0, 0, np.nan], [0, 0, 0], YOUBOT.carry)
    with pytest.raises(InputError, match="joints"):
        Solver(YOUBOT)([0, 0, 0.2], [0, 0, 0], [0, 0])
