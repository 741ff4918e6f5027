"""Criteria of arms that do not lie in one plane: margins, their bounds, areas and plans that keep them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.areas.ground import united
from regionik.areas.reach_model import ReachModel
from regionik.areas.reachable import reach_model
from regionik.mfabrik import Solver
from regionik.pipeline import plan
from regionik.planners.reach.proven_poses import likely_distances, proven_distances
from regionik.planners.reach.serial_criteria import PostureDemand, margin_about
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.reach_table import reach_table
from regionik.reachability.field import reach_field
from regionik.regions import admissible_area, known_area
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.arms import pivot_index, pivot_joints
from regionik.worlds.bundled import robot_named
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.limits import Criteria
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import MINUTES, examples
from tests.kinds import Goal, Mode
from tests.maths import Array
from tests.measures import efforts, goal_error, manipulability, pose_of
from tests.mimics import ARMS as MIMICS
from tests.mimics import arm as mimic_robot
from tests.random_arms import ARMS, random_robot
from tests.test_proven_poses import places_in

SEEDS = st.integers(0, 10_000)
KINDS = st.sampled_from((*ARMS, "mimics"))
FLOOR = Floor(shapely.box(-4, -4, 4, 4))
GOALS: tuple[Goal, ...] = ("point", "direction", "orientation")


def loaded_robot(kind: str, seed: int) -> Robot:
    """A random arm that does not lie in one plane, with a payload."""
    rng = np.random.default_rng(seed)
    robot = mimic_robot(MIMICS[seed % 2]) if kind == "mimics" else random_robot(kind, rng)
    return replace(robot, payload=float(rng.uniform(0.2, 1.5)))


def postures(robot: Robot, seed: int, count: int) -> Array:
    low, high = np.maximum(robot.chain.lower, -np.pi), np.minimum(robot.chain.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, robot.chain.dof))


def some_criteria(robot: Robot, seed: int) -> Criteria:
    """Thresholds that most postures meet, each by itself."""
    q, rng = postures(robot, seed, 200), np.random.default_rng(seed)
    volumes, worst = manipulability(robot, q), np.abs(efforts(robot, q)).max(axis=1)
    most = float(np.quantile(worst, rng.uniform(0.4, 0.8)))
    return Criteria(
        float(np.quantile(volumes, rng.uniform(0.2, 0.6))), effort=most if most > 0 and seed % 3 else None
    )


def margins(robot: Robot, asked: Criteria, q: Array) -> Array:
    """Least margin of postures (n, dof) as a share of what is asked, by what `verify` computes."""
    found = [np.full(len(q), np.inf)]
    if asked.manipulability:
        found.append(manipulability(robot, q) / asked.manipulability - 1)
    if asked.effort is not None:
        found.append(1 - np.abs(efforts(robot, q)).max(axis=1) / asked.effort)
    least: Array = np.min(found, axis=0)
    return least


def target_of(robot: Robot, goal: Goal, seed: int) -> Target:
    """What the tool has in a random posture that holds the tool over the floor."""
    tools = robot.tool(np.zeros(3), postures(robot, seed, 50))
    T = tools[np.argmax(tools[:, 2, 3] > 0.1)]
    return Target(
        T[:3, 3],
        direction=T[:3, 2] if goal == "direction" else None,
        orientation=T[:3, :3] if goal == "orientation" else None,
        cone=0.1,
    )


def arm_of(robot: Robot) -> tuple[ReachModel, SerialArm]:
    model = reach_model(robot, "orientation")
    return model, serial_arm(model.chain)


# --- margins


@settings(max_examples=examples(80), deadline=None)
@given(KINDS, SEEDS, st.floats(1e-3, 0.2))
def test_no_posture_nearby_has_less_than_the_bound(kind: str, seed: int, wide: float) -> None:
    """Of a corner of what moves, the pivot turned at will."""
    robot, rng = loaded_robot(kind, seed), np.random.default_rng(seed)
    asked, q = some_criteria(robot, seed), postures(robot, seed + 1, 1)[0]
    model, arm = arm_of(robot)
    joints, n = pivot_joints(robot.chain, q), model.chain.dof
    along, off = wide * rng.normal(size=(n, 2)), 0.2 * wide * rng.random(n)
    pivot = pivot_index(model.chain)
    along[pivot] = off[pivot] = 0.0
    moves = np.abs(along).sum(axis=1) + off
    bound = margin_about(arm, PostureDemand(robot, asked).thresholds, joints, along, off, moves)
    shares, signs = rng.choice([-1.0, 1.0], (400, 2)), rng.choice([-1.0, 1.0], (400, n))
    others = joints + shares @ along.T + signs * off
    others[:, pivot] += rng.normal(size=400)
    behind = others[:, n - robot.chain.dof :]
    assert margins(robot, asked, behind).min() >= bound - 1e-6


# --- areas


def has_posture(robot: Robot, asked: Criteria, target: Target, place: Array) -> bool:
    """Whether a posture on target meets criteria with the arm axis at a place, by what `verify` computes."""
    family = reach_model(robot, "point").families(target, (1,), inner=True)[0]
    for criteria in (asked, None):
        solver = Solver(robot, None, 1e-6, "free", family, criteria=criteria)
        for yaw in (0.0, 2.0, 4.0):
            base = pose_of(robot, place, yaw)
            for one in solver.self_motion(target, base, robot.carry, 96):
                error, angle = goal_error(target, robot.tool(one.base, one.joints))
                good = error <= 1e-5 and angle <= target.cone + 1e-9
                if good and margins(robot, asked, one.joints[None])[0] >= -1e-6:
                    return True
    return False


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("offsets", 4),
        ("slides", 7),
        pytest.param("wrists", 1, marks=MINUTES),
        pytest.param("tilted", 5, marks=pytest.mark.slow),
    ],
)
def test_places_of_inner_areas_have_a_posture_that_meets_all(kind: str, seed: int, goal: Goal) -> None:
    robot = loaded_robot(kind, seed)
    asked, target = some_criteria(robot, seed), target_of(robot, goal, seed)
    plain, world = (World("test", robot, FLOOR, rules=Rules(criteria=one)) for one in (None, asked))
    bare, inner = (
        united(reach_table(scene_of(w), [target], (1,), inner=True, proven=True)[2]) for w in (plain, world)
    )
    outer = united(reach_table(scene_of(world), [target], (1,), inner=False)[2])
    assert inner.area <= bare.area + 1e-9
    assert (inner - outer).area < 1e-9
    if not inner.is_empty:
        for place in places_in(inner, 3, seed):
            assert has_posture(robot, asked, target, place), place


def test_inner_areas_under_criteria_are_worth_looking_at() -> None:
    """Two thirds of what was found is proven for points, a half for directions and orientations."""
    robot = replace(robot_named("pioneer7"), payload=1.0)
    asked = Criteria(float(np.quantile(manipulability(robot, postures(robot, 0, 500)), 0.3)))
    for goal, least in zip(GOALS, (0.8, 0.5, 0.4), strict=True):
        target = target_of(robot, goal, 3)
        world = World("test", robot, FLOOR, task=(target,), rules=Rules(criteria=asked))
        found = known_area(scene_of(world), target).area
        assert found > 0
        assert admissible_area(world, target).inner.area >= least * found


@settings(max_examples=examples(30), deadline=None)
@given(st.sampled_from(ARMS), SEEDS)
def test_proven_distances_lie_within_the_reach(kind: str, seed: int) -> None:
    robot = loaded_robot(kind, seed)
    demand = PostureDemand(robot, some_criteria(robot, seed))
    model = reach_model(robot, "point")
    z = float(target_of(robot, "point", seed).position[2])
    (outer,) = model.distances(None, np.array([z]), inner=False)
    for low, high in proven_distances(model.chain, z - model.height, demand):
        assert any(a - 1e-9 <= low and high <= b + 1e-9 for a, b in outer.tolist())
    for low, high in likely_distances(model.chain, z - model.height, demand):
        assert any(a - 1e-2 <= low and high <= b + 1e-2 for a, b in outer.tolist())


def test_a_field_under_criteria_counts_less() -> None:
    robot = robot_named("pioneer7")
    world = World("test", robot, Floor(shapely.box(-1, -1, 1, 1)))
    target = np.array([[0.1, 0.0, 0.3]])
    plain = reach_field(world, target, cell=0.1)
    asked = Criteria(float(np.quantile(manipulability(robot, postures(robot, 0, 500)), 0.97)))
    under = reach_field(replace(world, rules=Rules(criteria=asked)), target, cell=0.1)
    assert (under.values <= plain.values).all()
    assert 0 < under.values.sum() < plain.values.sum()


# --- solvers and plans


@pytest.mark.parametrize("goal", GOALS)
def test_m_fabrik_finds_postures_that_meet_all(goal: Goal) -> None:
    robot = replace(robot_named("pioneer7"), payload=1.0)
    asked, target = some_criteria(robot, 4), target_of(robot, goal, 4)
    world = World("test", robot, FLOOR, task=(target,), rules=Rules(criteria=asked))
    solver = Solver(robot, known_area(scene_of(world), target), criteria=asked)
    rng = np.random.default_rng(1)
    rows = [solver(target, rng.uniform([-1, -1, -3], [1, 1, 3]), q) for q in postures(robot, 1, 20)]
    met = [one for one in rows if one.converged]
    assert len(met) >= 0.9 * len(rows)
    assert (margins(robot, asked, np.array([one.joints for one in met])) > 0).all()


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("mode", ["continuous", "stops"])
def test_plans_keep_criteria_at_their_set_points(mode: Mode, goal: Goal) -> None:
    robot = replace(robot_named("pioneer7"), payload=1.0)
    first = target_of(robot, goal, 3)
    task = tuple(replace(first, position=first.position + [0.0, 0.05 * k, 0.0]) for k in range(5))
    asked = some_criteria(robot, 3)
    world = World("test", robot, FLOOR, task=task, rules=Rules(criteria=asked, mode=mode))
    made = plan(world)
    report = verify(made)
    assert report.ok
    joints = made.motion.joints[made.motion.kind == "setpoint"]
    assert (margins(robot, asked, joints) >= -1e-9).all()
    assert report.margins["manipulability"] >= -1e-9


def test_criteria_that_no_posture_meets_are_named() -> None:
    robot = robot_named("pioneer7")
    target = target_of(robot, "direction", 3)
    world = World("test", robot, FLOOR, task=(target,), rules=Rules(criteria=Criteria(manipulability=9.0)))
    with pytest.raises(NoPlanFound, match="Without the criteria of the rules it could be reached") as refused:
        plan(world)
    assert refused.value.explanation.verdict == "undecided"  # nothing is proven of them
    assert refused.value.explanation.causes[0].kind == "criteria"
