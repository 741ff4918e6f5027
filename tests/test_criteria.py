"""Criteria: places of inner areas have a posture that meets all of them, places outside outer ones none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from regionik.areas.reachable import planar_reach, reach_model
from regionik.mfabrik import Solver
from regionik.pipeline import plan
from regionik.planners.solvers.posture_criteria import posture_margin, thresholds_of
from regionik.regions import admissible_area, outer_areas
from regionik.scene import scene_of
from regionik.verification import limits
from regionik.verification.verifier import verify
from regionik.worlds.arms import planar_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.joints import Joint
from regionik.worlds.limits import Criteria
from regionik.worlds.links import LinkMass, capsules_along
from regionik.worlds.robot import GRAVITY, Robot, with_joint_margin
from regionik.worlds.scene import Floor, Target, World
from tests import examples
from tests.maths import Array, rot_x, translation
from tests.measures import efforts, joint_margins, manipulability
from tests.soaked import soaked_world

SEEDS = st.integers(0, 10_000)
FLOOR = Floor(shapely.box(-3, -3, 3, 3))
WEIGHTS = (1.39, 1.32, 0.82, 0.77, 0.69)


def weighed(robot: Robot, payload: float = 0.5) -> Robot:
    """With masses halfway along the links."""
    steps = [joint.T_parent_joint[:3, 3] for joint in robot.chain.joints[1:]]
    steps.append(robot.chain.T_last_tool[:3, 3])
    masses = tuple(LinkMass(k, WEIGHTS[k], step / 2) for k, step in enumerate(steps))
    return replace(robot, masses=masses, payload=payload)


def planar_robot(seed: int, aside: float = 0.0) -> Robot:
    """A random arm in one plane; its masses are off the links, by ``aside`` off a last roll's axis."""
    rng = np.random.default_rng(seed)
    a, b, c = rng.uniform(0.1, 0.5, 3)
    middle, half = rng.uniform(-1, 1, 4), rng.uniform(0.4, 3.0, 4)
    low, high = middle - half, middle + half
    rows = [(0.0, rng.uniform(0, 0.3), rng.uniform(-0.1, 0.1), np.pi / 2, low[0], high[0])]
    rows += [(0.0, 0.0, length, 0.0, low[k], high[k]) for k, length in ((1, a), (2, b))]
    roll = bool(seed % 2)
    rows += [(0.0, 0.0, 0.0 if roll else c, np.pi / 2 if roll else 0.0, low[3], high[3])]
    rows += [(0.0, c, 0.0, 0.0, -2.0, 2.0)] if roll else []
    chain = Chain.from_dh(rows)
    masses = [LinkMass(k, rng.uniform(0.2, 2), rng.uniform(-0.1, 0.1, 3)) for k in range(4)]
    if roll:
        masses.append(LinkMass(4, rng.uniform(0.2, 2), np.array([aside, 0.0, rng.uniform(0, c)])))
    solids = capsules_along(chain, 0.02)
    robot = replace(
        robot_named("youbot"), name="random", chain=chain, solids=solids, carry=np.zeros(chain.dof)
    )
    return replace(robot, masses=tuple(masses), payload=float(rng.uniform(0, 1)))


def some_criteria(robot: Robot, seed: int) -> Criteria:
    """Thresholds that about half of the postures meet, each by itself."""
    rng = np.random.default_rng(seed)
    joints = postures(robot, rng, 200)
    worst = np.abs(efforts(robot, joints)).max(axis=1)
    return Criteria(
        float(np.quantile(manipulability(robot, joints), rng.uniform(0.2, 0.6))),
        float(rng.uniform(0, 0.2)),
        float(np.quantile(worst, rng.uniform(0.4, 0.8))),
    )


def postures(robot: Robot, rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(robot.chain.lower, robot.chain.upper, (count, robot.chain.dof))


def meet(robot: Robot, asked: Criteria, joints: Array, slack: float = 0.0) -> Array:
    """Which postures (n, dof) meet all criteria, from the chain in space alone."""
    good = joint_margins(robot, joints).min(axis=1) >= (asked.joint_margin or 0.0) - slack
    good &= manipulability(robot, joints) >= (asked.manipulability or 0.0) * (1 - slack)
    if asked.effort is not None:
        good &= (np.abs(efforts(robot, joints)) <= np.array(asked.effort) * (1 + slack)).all(axis=1)
    return np.asarray(good)


def rings(robot: Robot, asked: Criteria, z: float, *, inner: bool) -> Array:
    """Intervals of signed distance at a height, before any margin."""
    return planar_reach(with_joint_margin(robot, asked)).intervals(asked, np.array([z]), inner=inner)[1]


def spot_of(robot: Robot, joints: Array) -> tuple[float, float]:
    """Signed distance and height of a posture's tool."""
    arm, p = planar_arm(robot.chain), robot.tool(np.zeros(3), joints)[:3, 3]
    yaw = arm.pivot_zero + joints[0]
    return float(p[0] * np.cos(yaw) + p[1] * np.sin(yaw)), float(p[2])


def on_spot(robot: Robot, r: float, z: float, pitches: Array) -> Array:
    """Postures (n, dof) with the tool at (r, z), by trigonometry of its own; limits are not looked at."""
    arm = planar_arm(robot.chain)
    a, b, c = arm.lengths
    wrist = (r - arm.shoulder[0]) + 1j * (z - arm.shoulder[1] - robot.mount[2]) - c * np.exp(1j * pitches)
    cosine = (np.abs(wrist) ** 2 - a * a - b * b) / (2 * a * b)
    known = np.abs(cosine) <= 1
    pitches, wrist, bend = pitches[known], wrist[known], np.arccos(cosine[known])
    rows = []
    for side in (-1, 1):
        first = np.angle(wrist / (a + b * np.exp(1j * side * bend)))
        rows.append(np.column_stack([first, side * bend, pitches - first - side * bend]))
    bends = np.concatenate(rows)
    middle = (arm.lower + arm.upper) / 2
    bends = middle + np.remainder(bends - middle + np.pi, 2 * np.pi) - np.pi
    joints = np.tile((robot.chain.lower + robot.chain.upper) / 2, (len(bends), 1))
    joints[:, 1:4] = arm.sign * (bends - arm.offset)
    return joints


# --- what is measured


def test_manipulability_of_two_hinges_on_a_pivot() -> None:
    """The pivot adds the distance to what the plane's 2R arm has: r a1 a2 |sin q2|."""
    a1, a2 = 0.4, 0.3
    chain = Chain(
        (
            Joint("pivot", "revolute", -3, 3, np.eye(4)),
            Joint("one", "revolute", -3, 3, rot_x(np.pi / 2)),
            Joint("two", "revolute", -3, 3, translation(a1, 0, 0)),
        ),
        translation(a2, 0, 0),
    )
    robot = replace(robot_named("youbot"), chain=chain, solids=(), carry=np.zeros(3))
    q = np.random.default_rng(0).uniform(-3, 3, (50, 3))
    r = np.abs(a1 * np.cos(q[:, 1]) + a2 * np.cos(q[:, 1] + q[:, 2]))
    np.testing.assert_allclose(
        limits.manipulability(robot, q), r * a1 * a2 * np.abs(np.sin(q[:, 2])), atol=1e-9
    )


def test_a_weight_held_out_level() -> None:
    """Straight out from the shoulder every hinge bears weight times lever, the pivot nothing."""
    robot = replace(robot_named("youbot"), payload=2.0)
    q = np.array([0.3, 0.0, 0.0, np.pi / 2, 0.0])
    levers = np.array([0.0, 0.5075, 0.3525, 0.2175, 0.0])
    np.testing.assert_allclose(np.abs(limits.efforts(robot, q)), 2.0 * GRAVITY * levers, atol=1e-9)


@settings(max_examples=examples(30))
@given(SEEDS)
def test_efforts_are_the_slope_of_the_weights_height(seed: int) -> None:
    robot = planar_robot(seed, aside=0.05)
    q = postures(robot, np.random.default_rng(seed), 1)[0]

    def energy(joints: Array) -> float:
        frames = robot.frames(np.zeros(3), joints)
        heights = [(frames[one.link] @ np.append(one.center, 1.0))[2] for one in robot.loads]
        return GRAVITY * float(np.dot([one.mass for one in robot.loads], heights))

    for k, step in enumerate(1e-6 * np.eye(len(q))):
        slope = (energy(q + step) - energy(q - step)) / 2e-6
        assert limits.efforts(robot, q)[k] == pytest.approx(slope, abs=1e-6)


@settings(max_examples=examples(60))
@given(SEEDS)
def test_the_plane_measures_what_space_does(seed: int) -> None:
    robot = planar_robot(seed)
    q = postures(robot, np.random.default_rng(seed), 1)[0]
    arm = planar_arm(robot.chain)
    (both, _), w = thresholds_of(arm, robot, Criteria(manipulability=0.01)), float(manipulability(robot, q))
    assert posture_margin(plane(robot), both, arm.bends(q)) == pytest.approx(w / 0.01 - 1, abs=1e-6)
    asked, _ = thresholds_of(arm, robot, Criteria(effort=3.0))
    torques = np.abs(efforts(robot, q))[1:4]
    assert posture_margin(plane(robot), asked, arm.bends(q)) == pytest.approx((1 - torques / 3).min())


def plane(robot: Robot):  # type: ignore[no-untyped-def]  # a named tuple of the kernels
    return planar_reach(robot).plane


# --- areas


def test_thresholds_of_nothing_leave_the_plain_area() -> None:
    world = World("test", weighed(robot_named("youbot")), FLOOR)
    bare = admissible_area(world, [0, 0, 0.25])
    for asked in (Criteria(), Criteria(0.0, 0.0), Criteria(1e-9, None, 1e6)):
        area = admissible_area(world, [0, 0, 0.25], asked)
        assert area.outer.symmetric_difference(bare.outer).area < 1e-6
        assert bare.inner.difference(area.inner).area < 2e-3
        assert area.inner.difference(bare.inner).area < 1e-12


@pytest.mark.parametrize(
    "rising",
    [
        [Criteria(manipulability=w) for w in (0.001, 0.01, 0.03)],
        [Criteria(joint_margin=m) for m in (0.02, 0.4)],
        [Criteria(effort=t) for t in (12.0, 4.0, 1.0)],
        [Criteria(0.02 - 0.002 * t, 0.2 - 0.02 * t, float(t)) for t in (9, 5, 3)],
    ],
)
def test_a_higher_threshold_never_adds_area(rising: list[Criteria]) -> None:
    world = World("test", weighed(robot_named("youbot")), FLOOR)
    wide = admissible_area(world, [0, 0, 0.3])
    first = wide.outer.area
    for asked in rising:
        area = admissible_area(world, [0, 0, 0.3], asked)
        assert area.outer.difference(wide.outer).area < 1e-9
        assert area.inner.difference(wide.outer).area < 1e-9
        assert area.inner.area <= wide.inner.area + 1e-9
        wide = area
    assert wide.outer.area < 0.8 * first


@settings(max_examples=examples(50))
@given(SEEDS, st.sampled_from([0.0, 0.04]))
def test_postures_that_meet_all_lie_in_the_outer_rings(seed: int, aside: float) -> None:
    robot, rng = planar_robot(seed, aside), np.random.default_rng(seed)
    asked = some_criteria(robot, seed)
    joints = postures(robot, rng, 400)
    good = joints[meet(robot, asked, joints)][:6]
    for q in good:
        r, z = spot_of(robot, q)
        outer = rings(robot, asked, z, inner=False)
        assert any(low - 1e-9 <= r <= high + 1e-9 for low, high in outer)


@pytest.mark.slow
@settings(max_examples=8)
@given(SEEDS, st.sampled_from([0.0, 0.04]))
@example(282, 0.0)  # a pitch between two of a coarse grid serves
@example(7800, 0.0)
def test_places_of_the_inner_rings_have_a_posture_that_meets_all(seed: int, aside: float) -> None:
    robot, rng = planar_robot(seed, aside), np.random.default_rng(seed)
    asked = some_criteria(robot, seed)
    for q in postures(robot, rng, 3):
        _, z = spot_of(robot, q)
        inner, outer = rings(robot, asked, z, inner=True), rings(robot, asked, z, inner=False)
        for low, high in inner:
            assert any(a <= low and high <= b for a, b in outer)
            for r in (low, rng.uniform(low, high), high):
                roll = rng.uniform(*limits_of_roll(robot, asked), robot.chain.dof - 4)
                assert found_at(robot, asked, r, z, roll)


def limits_of_roll(robot: Robot, asked: Criteria) -> tuple[float, float]:
    last = with_joint_margin(robot, asked).chain.joints[-1]
    return last.lower, last.upper


def found_at(robot: Robot, asked: Criteria, r: float, z: float, roll: Array) -> bool:
    """Whether some pitch serves: on ever finer grids, then ever nearer to the best few."""
    grids = [np.linspace(-np.pi, np.pi, n) for n in (721, 5001, 40001)]
    width = 2 * np.pi / 40000
    for step in range(8):
        joints = on_spot(robot, r, z, grids[step])
        joints[:, 4:] = roll
        if meet(robot, asked, joints, 1e-7).any():
            return True
        if step >= 2:
            angles = planar_arm(robot.chain).bends(joints).sum(axis=1)
            best = angles[np.argsort(-lacking(robot, asked, joints), kind="stable")[:4]]
            grids.append(np.add.outer(best, width * np.linspace(-1.5, 1.5, 61)).ravel())
            width /= 20
    return False


def lacking(robot: Robot, asked: Criteria, joints: Array) -> Array:
    """Least margin of postures (n, dof), as a share of what is asked."""
    margins = [joint_margins(robot, joints).min(axis=1) - (asked.joint_margin or 0.0)]
    if asked.manipulability:
        margins.append(manipulability(robot, joints) / asked.manipulability - 1)
    if asked.effort is not None:
        margins.append((1 - np.abs(efforts(robot, joints)) / np.array(asked.effort)).min(axis=1))
    least: Array = np.min(margins, axis=0)
    return least


def test_what_is_left_undecided_is_mostly_thin() -> None:
    gaps = []
    for seed in range(6):
        robot = planar_robot(seed)
        asked = some_criteria(robot, seed)
        _, z = spot_of(robot, postures(robot, np.random.default_rng(seed), 1)[0])
        inner, outer = (rings(robot, asked, z, inner=side) for side in (True, False))
        gaps.append(np.diff(outer, axis=1).sum() - np.diff(inner, axis=1).sum())
    assert np.median(gaps) < 2e-3


def test_a_joint_margin_alone_is_the_reach_of_narrower_limits() -> None:
    for name in ("youbot", "pioneer-parm"):
        robot = robot_named(name)
        margin = 0.1
        joints = tuple(
            replace(
                j, lower=j.lower + margin * (j.upper - j.lower), upper=j.upper - margin * (j.upper - j.lower)
            )
            for j in robot.chain.joints
        )
        narrow = replace(robot, chain=Chain(joints, robot.chain.T_last_tool))
        one = admissible_area(World("a", robot, FLOOR), [0, 0, 0.3], Criteria(joint_margin=margin))
        two = admissible_area(World("b", narrow, FLOOR), [0, 0, 0.3])
        assert one.inner.equals(two.inner)
        assert one.outer.equals(two.outer)


def test_a_pointing_tool_has_criteria_too() -> None:
    world = World("test", weighed(robot_named("youbot")), FLOOR)
    target = Target(np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, -1.0]), 0.1)
    plain, area = admissible_area(world, target), admissible_area(world, target, Criteria(0.006))
    assert 0 < area.inner.area < plain.inner.area
    assert area.outer.area < plain.outer.area
    assert [cause.kind for cause in area.causes if cause.kind == "criteria"]


def test_a_load_that_a_roll_turns_is_taken_at_its_worst_and_at_its_best() -> None:
    heavy = replace(weighed(robot_named("youbot")), payload=0.0)
    off = replace(heavy, masses=(*heavy.masses, LinkMass(4, 1.0, np.array([0.1, 0.0, 0.2175]))))
    on = replace(heavy, masses=(*heavy.masses, LinkMass(4, 1.0, np.array([0.0, 0.0, 0.2175]))))
    asked = Criteria(effort=6.0)
    unsure, sure = (admissible_area(World("test", one, FLOOR), [0, 0, 0.3], asked) for one in (off, on))
    assert sure.inner.difference(unsure.inner).area > 1e-3
    assert unsure.inner.difference(sure.inner).area < 1e-9
    assert unsure.outer.difference(sure.outer).area > 1e-3
    tight = Criteria(effort=(9.0, 9.0, 9.0, 9.0, 0.5))  # the roll would bear up to 0.98 N m
    assert admissible_area(World("test", off, FLOOR), [0, 0, 0.3], tight).inner.is_empty


@pytest.mark.parametrize(("kind", "seed"), [("floor", 91), ("ground", 89)])
def test_outer_areas_under_criteria_are_valid(kind: str, seed: int) -> None:
    """Worlds of the soak whose sectors crossed the axis and themselves."""
    world = soaked_world(kind, seed)
    assert all(area.is_valid for area in outer_areas(scene_of(world), world.task))


# --- solvers, plans, verify


@pytest.mark.parametrize("asked", [Criteria(joint_margin=0.12), Criteria(0.005, 0.05, 8.0)])
def test_m_fabrik_finds_postures_that_meet_all(asked: Criteria) -> None:
    robot = weighed(robot_named("youbot"))
    area = admissible_area(World("test", robot, FLOOR), [0, 0, 0.25], asked)
    solver = Solver(robot, area.inner, criteria=asked)
    rng = np.random.default_rng(1)
    starts = np.column_stack([rng.uniform(-1, 1, (40, 2)), rng.uniform(-3, 3, 40)])
    rows = solver.batch(np.zeros((40, 3)) + [0, 0, 0.25], starts, postures(robot, rng, 40))
    found = [solver([0, 0, 0.25], base, q) for base, q in zip(starts, postures(robot, rng, 40), strict=True)]
    assert rows.converged.all()
    assert all(one.converged for one in found)
    joints = np.array([*rows.joints, *(one.joints for one in found)])
    assert meet(robot, asked, joints, 1e-9).all()
    assert all(reach_model(robot, "point").meets(asked, q) for q in joints)


@pytest.mark.parametrize("asked", [Criteria(joint_margin=0.1), Criteria(0.01, 0.05, 9.0)])
def test_plans_keep_criteria_at_their_set_points(asked: Criteria) -> None:
    bare = load_world("wall")
    world = replace(bare, robot=weighed(bare.robot), rules=replace(bare.rules, criteria=asked))
    made = plan(world)
    report = verify(made)
    assert report.ok
    joints = made.motion.joints[made.motion.kind == "setpoint"]
    assert meet(world.robot, asked, joints, 1e-9).all()
    wanted = [key for key in ("manipulability", "joint_margin", "effort") if getattr(asked, key) is not None]
    assert [key for key in report.margins if key in ("manipulability", "joint_margin", "effort")] == wanted
    assert min(report.margins[key] for key in wanted) >= -1e-9


def test_verify_finds_every_criterion_broken() -> None:
    bare = load_world("wall")
    made = plan(replace(bare, robot=weighed(bare.robot)))
    hard = Criteria(0.5, 0.45, (1.0, 0.1, 0.1, 0.1, 1.0))
    report = verify(replace(made, world=replace(made.world, rules=replace(made.world.rules, criteria=hard))))
    assert not report.ok
    assert {one.kind for one in report.violations} == {"manipulability", "joint_margin", "effort"}
    texts = [one.text for one in report.violations]
    assert any("the rules ask for at least 0.5 m3" in text for text in texts)
    assert any("the effort of joint_2 is" in text and "at most 0.1 N m" in text for text in texts)
    assert report.margins["effort"] < 0


def test_a_plan_that_criteria_forbid_says_so() -> None:
    bare = load_world("free")
    world = replace(bare, rules=replace(bare.rules, criteria=Criteria(manipulability=0.2)))
    with pytest.raises(NoPlanFound, match="Without the criteria of the rules it could be reached") as refused:
        plan(world)
    told = refused.value.explanation
    assert told.causes[0].kind == told.code == "criteria"


# --- what is refused


def test_what_criteria_cannot_be_asked() -> None:
    robot = robot_named("youbot")
    for wrong, text in (
        ({"manipulability": -1.0}, "manipulability: must be at least 0"),
        ({"joint_margin": 0.5}, "from 0 to below 0.5"),
        ({"effort": 0.0}, "effort: must be above 0"),
        ({"effort": (1.0, np.nan)}, "effort: must be above 0"),
    ):
        with pytest.raises(InputError, match=text):
            Criteria(**wrong)
    world = World("test", robot, FLOOR)
    with pytest.raises(InputError, match=r"youbot has no masses: give robot.masses or robot.payload"):
        admissible_area(world, [0, 0, 0.3], Criteria(effort=5.0))
    with pytest.raises(InputError, match=r"expected one limit, or 5 .*got 2"):
        admissible_area(world, [0, 0, 0.3], Criteria(effort=(1.0, 2.0)))
    other = replace(world, robot=robot_named("pioneer7"))
    with pytest.raises(InputError, match="pioneer7 has no masses"):
        admissible_area(other, [0, 0, 0.3], Criteria(effort=5.0))
    assert not admissible_area(other, [0, 0, 0.3], Criteria(joint_margin=0.1)).inner.is_empty
