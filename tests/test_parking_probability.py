"""Probability that stops are good after parking: against counting, and where it decides."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, multivariate_normal

from regionik.output.plan_file import load_plan
from regionik.parking.parking_probability import normal_probability, parking_probability
from regionik.parking.stops import stops
from regionik.pipeline import plan
from regionik.scene import scene_of
from regionik.values import Configuration, Plan, Stop
from regionik.verification.stops import _reachable_poses, _rooms
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.limits import ParkingAccuracy
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples
from tests.maths import Array

SMALL = np.diag([0.01, 0.01, 0.02]) ** 2
WIDE = np.diag([0.07, 0.07, 0.02]) ** 2
TURNED = np.diag([0.04, 0.03, 0.1]) ** 2 + 0.001 * np.outer([0, 1, 1], [0, 1, 1])  # y goes with the yaw


def drilling(robot: str, covariance: Array, probability: float | None = None, length: float = 0.3) -> World:
    """Some holes in a row beside a post."""
    task = [Target(np.array([x, 0.0, 0.3])) for x in np.linspace(0, length, 4)]
    post = Cylinder("post", 0.1, 1.0, np.array([0.15, 0.8, 0.5]))
    rules = Rules(clearance=0.05, mode="stops", parking=ParkingAccuracy(covariance, probability))
    floor = Floor(shapely.box(-3, -2, 3, 2))
    return World("drilling", robot_named(robot), floor, (post,), tuple(task), rules)


@lru_cache(maxsize=4)
def drilled() -> Plan:
    return plan(drilling("youbot-real", SMALL))


def counted(world: World, base: Array, setpoints: tuple[int, ...], count: int) -> float:
    """Share of parkings after which footprint and arm are in order, by the solver of `verify`."""
    assert world.rules.parking is not None
    C, rng = np.array(world.rules.parking.covariance), np.random.default_rng(1)
    poses = rng.multivariate_normal(base, C, count)
    poses = poses[_rooms(world, poses) >= 0]
    carried = Configuration(base, world.robot.carry, 0.0, 0, True)
    held = Plan(world, 0, (carried,) * len(world.task), drilled().motion, (), 0)
    return float(_reachable_poses(held, Stop(base, setpoints, 0.0, "tolerance"), poses).sum()) / count


@given(
    corner=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    size=st.tuples(st.floats(0.01, 4), st.floats(0.01, 4)),
    deviations=st.tuples(st.floats(0.1, 3), st.floats(0.1, 3)),
    rho=st.floats(-0.95, 0.95),
)
@settings(max_examples=examples(60))
def test_a_box_is_as_probable_as_scipy_has_it(
    corner: tuple[float, float], size: tuple[float, float], deviations: tuple[float, float], rho: float
) -> None:
    a, b = deviations
    C = np.array([[a * a, rho * a * b], [rho * a * b, b * b]])
    low, high = np.array(corner), np.array(corner) + size
    mean = np.array([0.3, -0.2])
    expected = multivariate_normal(mean, C).cdf(high, lower_limit=low)
    assert normal_probability(shapely.box(*low, *high), mean, C) == pytest.approx(expected, abs=1e-7)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=examples(30))
def test_holes_parts_and_counting_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    disc = [shapely.Point(rng.normal(size=2)).buffer(r) for r in rng.uniform(0.3, 1.5, 4)]
    shape = shapely.union_all(disc[:2]) - disc[2] - disc[3].buffer(-0.2)
    root = rng.normal(size=(2, 2))
    mean, count = rng.normal(size=2), 20_000
    points = mean + rng.normal(size=(count, 2)) @ root.T
    share = shapely.contains_xy(shape, points).mean()
    assert normal_probability(shape, mean, root @ root.T) == pytest.approx(share, abs=0.018)


def test_a_covariance_without_any_spread_says_yes_or_no() -> None:
    box, none = shapely.box(0, 0, 1, 1), np.zeros((2, 2))
    assert normal_probability(box, np.array([0.5, 0.5]), none) == pytest.approx(1.0)
    assert normal_probability(box, np.array([1.5, 0.5]), none) == pytest.approx(0.0)
    line = np.array([[1.0, 1.0], [1.0, 1.0]])  # along a diagonal
    assert normal_probability(shapely.box(-9, -9, 0, 9), np.zeros(2), line) == pytest.approx(0.5)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["youbot", "youbot-real", "hinge5"])
@pytest.mark.parametrize("off", [(0.05, 0.02, 0.1), (0.12, -0.1, 0.3)])
def test_the_bound_is_below_the_truth_and_near_it(robot: str, off: tuple[float, float, float]) -> None:
    world = drilling(robot, TURNED)
    stop = stops(world)[0]
    base, count = stop.base + np.array(off), 300
    bound = parking_probability(scene_of(world), base, stop.setpoints)
    truth = counted(world, base, stop.setpoints, count)
    assert binom.cdf(truth * count, count, bound) > 3e-5
    assert bound > truth - 0.02 - 4 * np.sqrt(truth * (1 - truth) / count)


def test_a_smaller_error_and_fewer_setpoints_are_more_probable() -> None:
    world, stop = drilled().world, drilled().stops[0]
    base = stop.base + [0.15, 0.0, 0.0]
    found = [
        parking_probability(scene_of(drilling("youbot-real", size * TURNED)), base, stop.setpoints)
        for size in (0.25, 1.0, 2.0)
    ]
    assert found == sorted(found, reverse=True)
    world = drilling("youbot-real", TURNED)
    assert parking_probability(scene_of(world), base, stop.setpoints[:1]) >= found[1]


@pytest.mark.slow
def test_a_stop_is_divided_until_each_has_the_probability() -> None:
    easy, asked = stops(drilling("youbot", WIDE, length=0.73)), 0.95
    assert min(stop.probability or 0.0 for stop in easy) < asked
    hard = stops(drilling("youbot", WIDE, asked, length=0.73))
    assert len(hard) > len(easy)
    assert all(stop.probability is not None and stop.probability >= asked for stop in hard)
    assert [i for stop in hard for i in stop.setpoints] == list(range(4))


def test_what_cannot_be_as_probable_is_explained() -> None:
    world = drilling("youbot", np.diag([0.5, 0.5, 0.02]) ** 2, 0.999)
    with pytest.raises(NoPlanFound, match=r"Set-point 1 of 4.*probability of 0\.999; the best") as caught:
        stops(world)
    assert caught.value.explanation.verdict == "undecided"


def test_any_order_has_the_probabilities_of_its_own_setpoints() -> None:
    world = drilling("youbot", SMALL, length=1.1)
    freed = replace(world, task=world.task[::2] + world.task[1::2], rules=replace(world.rules, order="any"))
    for stop in stops(freed):
        assert stop.probability == parking_probability(scene_of(freed), stop.base, stop.setpoints) > 0.9


def test_the_criterion_finds_a_more_probable_place() -> None:
    world = drilling("youbot", TURNED, length=0.9)
    likely = replace(world, rules=replace(world.rules, stop_criterion="probability"))
    middle, best = (stops(one)[0].probability or 0.0 for one in (world, likely))
    assert best >= middle - 1e-4


def test_a_plan_keeps_and_proves_its_probability(tmp_path: Path) -> None:
    found = drilled()
    assert found.stops[0].probability is not None
    assert found.stops[0].probability > 0.99
    assert verify(found).ok
    found.save(tmp_path / "plan.json")
    again = load_plan(tmp_path / "plan.json")
    assert again.stops[0].probability == found.stops[0].probability
    assert again.world.rules == found.world.rules


def test_verify_refuses_a_promise_that_does_not_hold() -> None:
    found = drilled()
    for covariance in (np.diag([0.15, 0.15, 0.1]) ** 2, np.diag([0.01, 1.0, 0.0]) ** 2):
        accuracy = ParkingAccuracy(covariance)
        world = replace(found.world, rules=replace(found.world.rules, parking=accuracy))
        stop = replace(found.stops[0], probability=0.9999)
        texts = [one.text for one in verify(replace(found, world=world, stops=(stop,))).violations]
        assert any("promises to be good after parking with 0.9999" in text for text in texts)
    world = replace(found.world, rules=replace(found.world.rules, parking=ParkingAccuracy(SMALL, 0.9999)))
    stop = replace(found.stops[0], probability=0.99)
    texts = [one.text for one in verify(replace(found, world=world, stops=(stop,))).violations]
    assert any("the rules ask for 0.9999" in text for text in texts)


def test_a_rule_comes_back_from_its_document() -> None:
    world = drilling("youbot", TURNED, 0.99)
    assert world_from_document(world_to_document(world)).rules == world.rules
    document = world_to_document(world)
    document["rules"]["parking"] = {"deviations": [0.1, 0.2, 0.0]}
    accuracy = world_from_document(document).rules.parking
    assert accuracy == ParkingAccuracy(np.diag([0.1, 0.2, 0.0]) ** 2)


@pytest.mark.parametrize("aside", [0.1])
def test_directions_of_any_arm_have_a_proven_probability(aside: float) -> None:
    """Their reach is sampled for plans, and proven square by square here."""
    world, tool = drilling("pioneer7", TURNED), np.array([0.1, -0.2, 0.15])
    way = np.array([0.5, 0.1, -0.7]) / np.linalg.norm([0.5, 0.1, -0.7])
    task = tuple(Target(tool + [0.0, 0.02 * k, 0.0], direction=way, cone=0.2) for k in range(4))
    world = replace(world, task=task)
    base, count = stops(world)[0].base + [0.0, aside, 0.0], 200
    bound, truth = (
        parking_probability(scene_of(world), base, (0, 1, 2, 3)),
        counted(world, base, (0, 1, 2, 3), count),
    )
    assert bound > 0
    assert binom.cdf(truth * count, count, bound) > 3e-5
    print(bound, truth)
    assert bound > truth - 0.4
