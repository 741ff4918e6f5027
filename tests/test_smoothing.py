"""Smoothing of whole runs: proven, on the path, less bent than before, and never at the cost of the plan."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import pytest
import shapely
from scipy.optimize import lsq_linear
from scipy.sparse import csc_array
from scipy.spatial.transform import Rotation
from shapely.affinity import rotate, translate

from regionik.moving.state_constraints import AREA_MARGIN, CHECKED_DISTANCE, StateConstraints
from regionik.pipeline import search
from regionik.planners.smoothing.path_smoothing import HalfSpaces, within_reach
from regionik.planners.smoothing.quadratic_program import minimize_quadratic
from regionik.planners.solvers.aims import beyond_cones, missed_by, tool_jacobians
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aims
from regionik.scene import scene_of
from regionik.smoothing import runs
from regionik.smoothing.smooth_motion import smooth_motion
from regionik.timing.retime import retime
from regionik.values import Plan, Report, Violation
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.limits import Speeds
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.kinds import BaseKind
from tests.maths import Array
from tests.measures import axis_of

SMOOTHED = ("l_shape", "pillar", "shelf")


class Stage(NamedTuple):
    """What smoothing is asked while a world is planned, and the plan that comes of it."""

    scene: Any
    found: Plan
    standing: Any
    smooth: Plan


def staged(world: World) -> Stage:
    asked = list[tuple[Any, Plan, Any]]()

    def stage(scene: Any, found: Plan, free_space: Any) -> Plan:
        asked.append((scene, found, free_space))
        return smooth_motion(scene, found, free_space)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_module(search.__module__), "smooth_motion", stage)
        smooth = search(scene_of(world))
    return Stage(*asked[-1], smooth)


@lru_cache
def of(name: str) -> Stage:
    return staged(load_world(name))


def again(name: str) -> Plan:
    """The same found plan, smoothed once more."""
    return smooth_motion(*of(name)[:3])


def way_of_path(plan: Plan, k: int) -> float:
    """Distance of the tool from its path at a state [m]."""
    i, task = int(plan.motion.setpoint[k]), plan.world.task
    tool, line = plan.tools()[k], [task[i].position, task[min(i + 1, len(task) - 1)].position]
    way = line[1] - line[0]
    share = np.clip((tool - line[0]) @ way / max(way @ way, 1e-12), 0, 1)
    return float(np.linalg.norm(tool - line[0] - share * way))


@pytest.mark.parametrize("name", SMOOTHED)
def test_a_smoothed_plan_holds_is_on_its_path_and_is_driven_sooner(name: str) -> None:
    _, found, _, smooth = of(name)
    assert verify(smooth).ok
    assert smooth is not found
    assert smooth.lift_offs == found.lift_offs
    assert np.array_equal(smooth.motion.base[0], found.motion.base[0])
    assert np.array_equal(smooth.motion.joints[0], found.motion.joints[0])
    old = {row.tobytes() for row in np.hstack([found.motion.base, found.motion.joints])}
    rows = np.hstack([smooth.motion.base, smooth.motion.joints])
    working = smooth.motion.kind != "transit"
    moved = [k for k, row in enumerate(rows) if working[k] and row.tobytes() not in old]
    assert len(moved) > 10
    assert max(way_of_path(smooth, k) for k in moved) < 1e-6
    for setpoint, area in zip(smooth.setpoints, smooth.areas, strict=True):
        spot = shapely.Point(axis_of(smooth.world.robot, setpoint.base))
        assert area.pruned.distance(spot) < 1e-6
    before, after = (retime(plan, Speeds(tool_velocity=0.2)) for plan in (found, smooth))
    assert after.motion.time[-1] < before.motion.time[-1]
    assert after.stats["timing"]["tool"]["held"] > before.stats["timing"]["tool"]["held"]


@pytest.mark.parametrize(("name", "most"), [("free", 0.71), ("shelf", 0.50)])
def test_the_arm_goes_no_farther_than_resolved_rates_lead_it(name: str, most: float) -> None:
    """RoboPlan 0.7.0 by `benchmarks/bench_travel.py`, which begins in the same posture [rad]."""
    motion = of(name).smooth.motion
    first = int(np.argmax(motion.kind == "setpoint"))
    assert np.abs(np.diff(motion.joints[first:], axis=0)).sum() <= most


def test_runs_begin_where_the_arm_has_less_to_move() -> None:
    """M-FABRIK folds the last link over; from the carry posture the arm need not."""
    _, found, _, smooth = of("free")
    first = [plan.setpoints[0].joints for plan in (found, smooth)]
    assert np.abs(first[0] - found.motion.joints[0]).max() > 3.0
    assert np.abs(first[1] - found.motion.joints[0]).max() < 1.0
    bends = [np.abs(np.diff(plan.motion.joints, axis=0)).sum() for plan in (found, smooth)]
    assert bends[1] < 0.5 * bends[0]


def test_the_same_bytes_again() -> None:
    smooth, other = of("shelf").smooth, again("shelf")
    assert np.array_equal(other.motion.base, smooth.motion.base)
    assert np.array_equal(other.motion.joints, smooth.motion.joints)


def test_a_long_run_is_smoothed_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts share the state between them, which the plan has once."""
    whole = of("free")
    monkeypatch.setattr(runs, "OPTIONS", replace(runs.OPTIONS, max_states=30))
    parts = again("free")
    assert parts is not whole.found
    assert verify(parts).ok
    rows = np.hstack([parts.motion.base, parts.motion.joints])
    assert (np.diff(rows, axis=0) != 0).any(axis=1).all()
    assert not np.array_equal(parts.motion.joints, whole.smooth.motion.joints)


def test_what_cannot_be_proven_stays_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    refusal = Report(False, {}, (Violation("arm", 5, 0, 1.0, "no"),))
    monkeypatch.setattr("regionik.smoothing.smooth_motion.verify", lambda plan: refusal)
    assert again("pillar") is of("pillar").found


def test_a_state_that_fails_is_held_closer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A check that wants the base near to where it was is met in the end."""
    _, found, _, free = of("l_shape")
    near = np.array([configuration.base[:2] for configuration in found.setpoints])

    def strict(plan: Plan) -> Report:
        report = verify(plan)
        for k in np.flatnonzero(plan.motion.kind == "setpoint").tolist():
            i = int(plan.motion.setpoint[k])
            if i == 20 and np.linalg.norm(plan.motion.base[k, :2] - near[i]) > 0.02:
                far = Violation("base", k, i, 1.0, "too far")
                return replace(report, ok=False, violations=(*report.violations, far))
        return report

    monkeypatch.setattr("regionik.smoothing.smooth_motion.verify", strict)
    kept = again("l_shape")
    assert np.linalg.norm(free.setpoints[20].base[:2] - near[20]) > 0.02
    assert np.linalg.norm(kept.setpoints[20].base[:2] - near[20]) <= 0.02
    assert kept is not found


def robot_on(robot: Robot, drive: BaseKind) -> Robot:
    return replace(robot, base=drive, turning_radius=0.3 if drive == "car" else 0.0)


def on_wheels(drive: BaseKind) -> Stage:
    world = load_world("l_shape")
    return staged(replace(world, robot=robot_on(world.robot, drive)))


def test_a_car_keeps_its_way() -> None:
    _, found, _, smooth = on_wheels("car")
    moved = smooth.motion.base - found.motion.base
    moved[:, 2] -= 2 * np.pi * np.round(moved[:, 2] / (2 * np.pi))  # whole turns may be left out
    assert np.abs(moved).max() < 1e-9
    assert not np.array_equal(smooth.motion.joints, found.motion.joints)
    assert verify(smooth).ok


def test_a_differential_drive_rolls_without_slip_and_sooner() -> None:
    _, found, _, smooth = on_wheels("differential")
    drive = smooth.world.robot.drive
    assert not np.array_equal(smooth.motion.base, found.motion.base)
    assert np.abs(drive.slip(smooth.motion.base)[0]).max() < 1e-10
    assert verify(smooth).ok
    limits = Speeds(base_velocity=0.5, base_acceleration=1.0, joint_velocity=1.5, joint_acceleration=3.0)
    before, after = (retime(plan, limits).motion.time[-1] for plan in (found, smooth))
    assert after < before


def test_a_base_found_off_its_areas_is_not_drawn_into_them() -> None:
    """As where pruning cut the component, or base and joints went on together."""
    scene, found, free_space, _ = of("free")
    away = tuple(replace(area, pruned=translate(area.pruned, 0.0, 0.9)) for area in found.areas)
    (run,) = runs.runs_of(scene, replace(found, areas=away), free_space, 0.025, loose=False)
    assert run.problem.half_spaces_at(run.states).least.max() <= 0.0


def test_a_base_found_off_the_floor_of_all_slabs_stays_where_it_was() -> None:
    """As its footprint may have room where no slab of headings shows any; it was drawn back, off its path."""
    scene, found, free_space, _ = of("free")
    away = tuple(replace(area, pruned=translate(area.pruned, 0.0, 90.0)) for area in found.areas)
    sides = tuple(replace(side, floor=translate(side.floor, 0.0, 90.0)) for side in free_space.sides)
    free_space = replace(free_space, sides=sides)
    (run,) = runs.runs_of(scene, replace(found, areas=away), free_space, 0.025, loose=False)
    assert run.problem.half_spaces_at(run.states).least.max() <= 0.0
    still = np.zeros(len(run.states))
    assert run.mended(run.states, [0], still, still) == pytest.approx(run.states)


def test_a_distance_that_is_demanded_is_not_given_up() -> None:
    """A state 1 mm within its area may stay, or must come 4 mm farther in where 5 mm are demanded."""
    world = load_world("free")
    start = world.start
    assert start is not None
    states = np.concatenate([start.base, start.joints])[None]
    x, y = axis_of(world.robot, states[:, :3])[0]
    area = np.array([shapely.box(x - 0.001, y - 1, x + 1, y + 1)])
    asked = [
        StateConstraints(world.robot, scene_of(world).collision, None, area, np.array([mm / 1000]))
        for mm in (0, 5)
    ]
    easy, strict = (constraints.half_spaces(states) for constraints in asked)
    assert easy.least[0] <= 0.0
    assert strict.least[0] == pytest.approx(0.004)
    assert strict.normal[0, :2] == pytest.approx([1.0, 0.0])


def test_half_spaces_that_are_left_out_hold_after_every_step() -> None:
    """And those that are not are left by some corner of the box of steps."""
    rng, n, m, count = np.random.default_rng(35), 40, 6, 500
    upper, lower = rng.uniform(0, 0.1, (n, m)), rng.uniform(-0.1, 0, (n, m))
    normal, state = rng.normal(size=(count, m)), rng.integers(n, size=count)
    every = HalfSpaces(state, normal, rng.uniform(-0.6, 0.1, count), np.arange(count).astype(float))
    left = within_reach(every, lower, upper)
    out = np.setdiff1d(np.arange(count), left.cost.astype(int))
    assert len(out) > 100 < len(left.cost)
    steps = rng.uniform(lower, upper, (300, n, m))
    changes = np.einsum("km,skm->sk", normal[out], steps[:, state[out]])
    assert (changes >= every.least[out]).all()
    corner = np.where(left.normal > 0, lower[left.state], upper[left.state])
    assert ((left.normal * corner).sum(axis=1) < left.least).all()


def test_half_spaces_of_the_footprint_are_its_distance_and_how_it_changes() -> None:
    """Beside walls, a box and a post, against distances of the outline itself."""
    outline = np.array([[0.5, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.5, -0.3]])
    cart = replace(robot_named("youbot"), footprint=outline)
    things = (
        Box("box", np.array([0.4, 0.4, 0.5]), np.array([1.0, 1.0, 0.25])),
        Cylinder("post", 0.1, 0.5, np.array([-1.0, 0.6, 0.25])),
    )
    floor = shapely.box(-2, -2, 2, 2)
    world = World("hall", cart, Floor(floor), things, (Target(np.array([0, 0, 0.3])),), Rules(clearance=0.05))
    kept = {floor.exterior: 0.0, shapely.box(0.8, 0.8, 1.2, 1.2): 0.05, shapely.Point(-1.0, 0.6): 0.15}
    rng = np.random.default_rng(5)
    states = np.zeros((2000, 3 + cart.chain.dof))
    states[:, :2], states[:, 2] = rng.uniform(-1.7, 1.7, (2000, 2)), rng.uniform(-4, 4, 2000)

    def room(state: Array) -> float:
        """Distance of the footprint beyond what it keeps, from the nearest of all."""
        placed = rotate(shapely.Polygon(outline), state[2], (0, 0), use_radians=True)
        placed = translate(placed, state[0], state[1])
        return min(placed.distance(one) - least for one, least in kept.items())

    constraints = StateConstraints(
        cart, scene_of(world).collision, scene_of(world).footprint, np.full(2000, floor), np.zeros(2000)
    )
    spaces, seen = constraints.on_floor(states), 0
    for k, state in enumerate(states):
        before = room(state)
        if AREA_MARGIN < before < CHECKED_DISTANCE:  # nearer, only what it may not lose is asked
            mine = spaces.state == k
            tight = np.argmax(spaces.least[mine])
            assert AREA_MARGIN - spaces.least[mine][tight] == pytest.approx(before, abs=2e-6)
            step = 1e-5 * rng.normal(size=len(state))
            assert spaces.normal[mine][tight] @ step == pytest.approx(room(state + step) - before, abs=1e-8)
            seen += 1
    assert seen > 30


@pytest.mark.parametrize("yaw", np.linspace(0.1, 3.0, 12))
def test_both_sides_of_a_front_keep_their_distance(yaw: float) -> None:
    """Before two posts the base may turn into neither of them."""
    outline = np.array([[0.5, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.5, -0.3]])
    cart = replace(robot_named("youbot"), footprint=outline)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    posts = tuple(
        Cylinder(f"post {k}", 0.1, 0.5, np.array([*(turn @ [0.61 + 0.01 * k, y]), 0.25]))
        for k, y in enumerate((-0.2, 0.2))
    )
    floor = shapely.box(-2, -2, 2, 2)
    world = World("posts", cart, Floor(floor), posts, (Target(np.array([0, 0, 0.3])),), Rules(clearance=0.0))
    state = np.zeros((1, 3 + cart.chain.dof))
    state[0, 2] = yaw
    spaces = StateConstraints(
        cart, scene_of(world).collision, scene_of(world).footprint, np.array([floor]), np.zeros(1)
    ).on_floor(state)
    held = spaces.normal[spaces.least >= 0.0, 2]
    assert sorted(held) == pytest.approx([-0.2, 0.2], abs=1e-6)


def test_a_base_that_has_room_at_some_headings_only_is_smoothed() -> None:
    """A long base between two walls, and a post on its way."""
    cart = replace(
        robot_named("youbot"), footprint=np.array([[0.5, 0.25], [-0.5, 0.25], [-0.5, -0.25], [0.5, -0.25]])
    )
    task = tuple(Target(np.array([x, 0.25, 0.35])) for x in np.linspace(-1.0, 1.0, 15))
    post = Cylinder("post", 0.05, 0.1, np.array([0.0, -0.45, 0.05]))
    floor = Floor(shapely.box(-2.5, -0.45, 2.5, 0.45))
    world = World("lane", cart, floor, (post,), task, Rules(clearance=0.02))
    assert scene_of(world).free_floor.turns_matter
    _, found, _, smooth = staged(world)
    assert smooth is not found
    assert verify(smooth).ok


@pytest.mark.parametrize("name", ["youbot-real", "hinge5", "pioneer7"])
def test_jacobians_are_differences(name: str) -> None:
    robot = robot_named(name)
    rng = np.random.default_rng(3)
    states = rng.uniform(-1, 1, (20, 3 + robot.chain.dof))
    frames, J = tool_jacobians(robot, states)
    h = 1e-6
    for c in range(states.shape[1]):
        step = h * (np.arange(states.shape[1]) == c)
        ahead, behind = (robot.tool(s[:, :3], s[:, 3:]) for s in (states + step, states - step))
        assert np.abs((ahead - behind)[:, :3, 3] / (2 * h) - J[:, :3, c]).max() < 1e-8
        turn = (ahead - behind)[:, :3, :3] / (2 * h) @ np.swapaxes(frames[:, :3, :3], 1, 2)
        rate = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
        assert np.abs(rate - J[:, 3:, c]).max() < 1e-8


@pytest.mark.parametrize("kind", [DIRECTION, ORIENTATION])
def test_of_a_turn_within_a_cone_only_its_angle_counts(kind: int) -> None:
    """The rest of a turn is free on a cone's edge as within it: of rank one, and its slope is the angle's."""
    robot, rng = robot_named("youbot-real"), np.random.default_rng(4)
    states = rng.uniform(-1, 1, (20, 3 + robot.chain.dof))
    turns = Rotation.from_rotvec(rng.normal(0.0, 0.5, (20, 3))).as_matrix()
    tools = robot.tool(states[:, :3], states[:, 3:])
    wished = turns @ tools[:, :3, :3]
    aims = Aims(tools[:, :3, 3], np.full(20, kind), wished, np.full(20, 0.05), np.zeros(20))
    miss, J = beyond_cones(aims, missed_by(robot, aims, states))
    h, step = 1e-6, rng.normal(size=states.shape)
    ahead, behind = (
        np.linalg.norm(beyond_cones(aims, missed_by(robot, aims, states + s * step)).miss[:, 3:], axis=1)
        for s in (h, -h)
    )
    beyond = np.linalg.norm(miss[:, 3:], axis=1)
    slope = np.einsum("ni,nij,nj->n", miss[:, 3:] / beyond[:, None], J[:, 3:], step)
    assert (beyond > 0).all()
    assert np.abs((ahead - behind) / (2 * h) + slope).max() < 1e-6
    assert (np.linalg.matrix_rank(J[:, 3:], tol=1e-9) == 1).all()


def test_programs_are_solved_as_least_squares_within_bounds() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        A, b = rng.normal(size=(9, 6)), rng.normal(size=9)
        lower, upper = -rng.uniform(0, 1, 6), rng.uniform(0, 1, 6)
        hessian, none = csc_array(A.T @ A), csc_array((0, 6))
        found = minimize_quadratic(hessian, -A.T @ b, none, np.empty(0), np.empty(0), lower, upper)
        assert found is not None
        wanted: Array = lsq_linear(A, b, (lower, upper), tol=1e-14).x
        assert np.abs(found - wanted).max() < 1e-5


@pytest.mark.slow
def test_states_far_from_one_that_failed_stay() -> None:
    run = next(runs.runs_of(*of("depot")[:3], 0.05, loose=False))
    smooth, n = run.smoothed(), len(run.states)
    failed, demanded = [3, n // 2], np.zeros(n)
    narrow = np.full(n, np.inf)
    narrow[n // 2] = 0.5 * np.abs(smooth - run.states)[n // 2].max()
    mended = run.mended(smooth, failed, narrow, demanded)
    far = np.abs(np.arange(n)[:, None] - failed).min(axis=1) >= runs.OPTIONS.window
    assert far.any()
    assert np.abs(mended[far] - smooth[far]).max() < 1e-9  # on their areas' edges to rounding
    assert np.abs(mended - run.states)[n // 2].max() <= narrow[n // 2] + 1e-6
    assert not np.array_equal(mended[~far], smooth[~far])
