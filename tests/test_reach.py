import numpy as np
import pytest
import shapely

from regionik.reach import reach
from regionik.regions import admissible_area
from regionik.worlds.errors import InputError
from regionik.worlds.format import load_world


def test_every_yes_is_confirmed_and_every_no_is_empty() -> None:
    world = load_world("l_shape")
    rng = np.random.default_rng(0)
    targets = rng.uniform([-1, -1.5, 0], [4.5, 2.5, 0.9], (300, 3))
    answer = reach(world, targets)
    limits = world.robot.chain
    for k, target in enumerate(targets):
        area = admissible_area(world, target)
        if answer.reachable[k]:
            tool = world.robot.tool(answer.base[k], answer.joints[k])[:3, 3]
            assert np.linalg.norm(tool - target) <= 1e-3
            assert area.inner.distance(shapely.Point(answer.base[k, :2])) < 1e-9
            assert (answer.joints[k] >= limits.lower - 1e-9).all()
            assert (answer.joints[k] <= limits.upper + 1e-9).all()
            assert answer.reason[k] == ""
        else:
            assert area.inner.is_empty
            assert answer.reason[k]
            assert np.isnan(answer.base[k]).all()
            assert (answer.verdict[k] == "unreachable") == area.outer.is_empty
    assert 50 < answer.reachable.sum() < 300
    assert (answer.verdict == "undecided").sum() <= 3


def test_one_bare_point_is_enough() -> None:
    assert reach(load_world("pillar"), [0.5, 0, 0.25]).verdict.tolist() == ["reachable"]


def test_bad_targets_are_refused() -> None:
    with pytest.raises(InputError, match="targets"):
        reach(load_world("pillar"), [[0, 0]])
