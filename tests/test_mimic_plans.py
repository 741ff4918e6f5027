"""Arms with joints that mimic others: reach against brute force, plans, and what is made of plans."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from regionik.cli.plan import EXPORT_FORMATS
from regionik.output.export import export
from regionik.output.plan_file import load_plan
from regionik.papers.comparison import prepare_methods
from regionik.pipeline import plan
from regionik.planners.collision.distances import obstacles_from
from regionik.planners.reach.level_reach import inner_reach, outer_reach, posture_at
from regionik.planners.search.fixed_base import search_fixed_base
from regionik.reachability.reach import reach
from regionik.simulation.simulate import simulate
from regionik.timing.retime import retime
from regionik.values import Plan
from regionik.verification.verifier import verify, verify_answers
from regionik.view.plan_picture import picture_of_plan
from regionik.view.world_picture import joint_node, robot_meshes
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Cylinder, Sphere
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.mimics import ARMS, arm, expanded, plain, postures, random_chain
from tests.soak import against

# --- reach


@pytest.mark.parametrize("name", [*ARMS, 0])
def test_reach_at_a_height_is_between_its_bounds(name: str | int) -> None:
    """Brute force: no posture is outside the outer reach, and all inner reach is some posture's."""
    chain = with_pivot(arm(name).chain if isinstance(name, str) else random_chain(name))
    tools = chain.forward(postures(chain, 20_000))[:, :3, 3]
    for rise in np.quantile(tools[:, 2], [0.1, 0.5, 0.9]).tolist():
        inner, outer = inner_reach(chain, rise), outer_reach(chain, rise)
        near = tools[np.abs(tools[:, 2] - rise) < 1e-3]
        assert all(any(a - 5e-3 <= r <= b + 5e-3 for a, b in outer) for r in np.hypot(*near[:, :2].T))
        assert inner
        for low, high in inner:
            assert any(a <= low and high <= b for a, b in outer)
            for r in np.linspace(low + 1e-6, high - 1e-6, 7):
                q = posture_at(chain, [r, 0.0, rise], np.clip(np.zeros(chain.dof), chain.lower, chain.upper))
                assert chain.forward(q)[:3, 3] == pytest.approx([r, 0.0, rise], abs=1e-6)
                others = np.arange(chain.dof) != pivot_index(chain)
                assert (chain.lower <= q)[others].all()
                assert (q <= chain.upper)[others].all()


@pytest.mark.parametrize("seed", range(2))
def test_boxes_of_postures_rule_out_what_no_posture_reaches(seed: int) -> None:
    chain = random_chain(seed)
    tools, rng = chain.forward(postures(chain, 50_000))[:, :3, 3], np.random.default_rng(seed)
    middle, spread = tools.mean(0), tools.std(0)
    for _ in range(10):
        target = middle + 2.5 * spread * rng.uniform(-1, 1, 3)
        found = search_fixed_base(chain, [], obstacles_from([]), target, 0.02, most=20_000)
        gap = float(np.linalg.norm(tools - target, axis=1).min())
        if found.verdict.name == "RULED_OUT":
            assert gap > 0.02
        elif found.verdict.name == "PROVEN":
            assert found.joints is not None
            assert np.linalg.norm(chain.forward(found.joints)[:3, 3] - target) <= 0.02
    assert search_fixed_base(chain, [], obstacles_from([]), tools[0], 0.02).verdict.name == "PROVEN"


@pytest.mark.parametrize("name", ARMS)
def test_verdicts_agree_with_brute_force(name: str) -> None:
    """A base that may be anywhere in a square, at any heading, and nothing in the way, against samples."""
    robot = replace(arm(name), solids=(), base_solids=(), footprint=np.zeros((1, 2)))
    world = World("square", robot, Floor(shapely.box(-0.2, -0.2, 0.2, 0.2)), (), (), Rules(tolerance=2e-3))
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0.2, 1.6, 60), np.zeros(60), rng.uniform(0.0, 1.5, 60)])
    answer = reach(world, points)
    assert verify_answers(world, answer).ok
    count = 400_000
    bases = rng.uniform([-0.2, -0.2, -np.pi], [0.2, 0.2, np.pi], (count, 3))
    tools = robot.tool(bases, postures(robot.chain, count))[:, :3, 3]
    gap = cKDTree(tools).query(points)[0]
    assert not (answer.verdict[gap < 2e-3] == "unreachable").any()
    assert (answer.verdict[gap < 0.02] == "reachable").mean() > 0.9
    assert not (answer.verdict[gap > 0.05] == "reachable").any()
    assert (answer.verdict[gap > 0.05] == "unreachable").mean() > 0.9
    assert (answer.verdict == "reachable").sum() > 10
    assert (answer.verdict == "unreachable").sum() > 10


# --- plans


def _seam(name: str, mode: str) -> World:
    robot, s = arm(name), np.linspace(0, 1, 16)
    height = 0.9 if name == "telescope" else 0.35
    path = np.column_stack([1.2 * s, 0.15 * np.sin(5 * s), height + 0.1 * np.sin(4 * s)])
    post = Cylinder("post", 0.08, 1.2, np.array([0.6, -0.55, 0.6]))
    rules = Rules(clearance=0.03, mode=mode, step=0.2)  # type: ignore[arg-type]
    start = Start(np.array([-1.0, -1.5, 0.0]), robot.carry)
    task = tuple(map(Target, path))
    return World(name, robot, Floor(shapely.box(-1.5, -2, 3, 2)), (post,), task, rules, start)


@cache
def seam_plan(name: str, mode: str) -> Plan:
    return plan(_seam(name, mode))


PLANS = [("telescope", "continuous"), ("palletizer", "stops")]


@pytest.mark.parametrize(("name", "mode"), PLANS)
def test_a_seam_is_planned_smooth_timed_and_proven(name: str, mode: str) -> None:
    found = seam_plan(name, mode)
    assert verify(found).ok
    assert found.lift_offs == 0
    timed = retime(found)
    assert verify(timed).ok
    assert against(timed) == ()  # pinocchio and coal
    assert found.motion.joints.shape[1] == 3


@pytest.mark.parametrize(("name", "mode"), PLANS)
def test_plans_are_proven_of_the_joints_expanded_by_hand(name: str, mode: str) -> None:
    """The verifier says the same of a robot whose joints all move by themselves, as they move in the plan."""
    found = seam_plan(name, mode)
    robot, motion = found.world.robot, found.motion
    by_hand = replace(robot, chain=plain(robot.chain), carry=expanded(name, robot.carry))
    start = found.world.start
    assert start is not None
    world = replace(found.world, robot=by_hand, start=Start(start.base, expanded(name, start.joints)))
    other = replace(
        found,
        world=world,
        motion=replace(motion, joints=np.array([expanded(name, q) for q in motion.joints])),
        setpoints=tuple(replace(one, joints=expanded(name, one.joints)) for one in found.setpoints),
    )
    one, two = (verify(one).margins for one in (found, other))
    # limits, and the joint that times are counted by, differ
    for kind in one.keys() - {"joints", "timing", "speeds"}:
        assert two[kind] == pytest.approx(one[kind], abs=1e-9), kind


@pytest.mark.parametrize("name", ["telescope"])
def test_a_ball_that_only_the_last_stage_meets_between_states_is_found(name: str) -> None:
    """The motion is the plan's; the ball lies where its last link passes and no state has it."""
    found = seam_plan(name, "continuous")
    motion, robot = found.motion, found.world.robot
    k = len(motion) // 2
    middle = robot.frames(
        (motion.base[k] + motion.base[k + 1]) / 2, (motion.joints[k] + motion.joints[k + 1]) / 2
    )
    ball = Sphere("ball", 0.01, middle[-2, :3, 3])
    world = replace(found.world, obstacles=(*found.world.obstacles, ball))
    assert "arm" in {one.kind for one in verify(replace(found, world=world)).violations}


@pytest.mark.parametrize("name", ["telescope"])
def test_plan_files_keep_all(name: str, tmp_path: Path) -> None:
    found, path = seam_plan(name, "continuous"), tmp_path / "seam.plan.json"
    found.save(path)
    again = load_plan(path)
    assert np.array_equal(again.motion.joints, found.motion.joints)
    assert verify(again).ok


@pytest.mark.parametrize("name", ["telescope"])
def test_exports_are_of_the_active_joints(name: str, tmp_path: Path) -> None:
    timed = retime(seam_plan(name, "continuous"))
    for format_ in EXPORT_FORMATS:
        export(timed, tmp_path / f"{format_}.yaml", format_)
    rows = list(csv.DictReader(StringIO((tmp_path / "csv.yaml").read_text())))
    joints = np.array([[float(row[joint]) for joint in timed.world.robot.chain.names] for row in rows])
    assert joints.shape == (len(rows), 3)


@pytest.mark.parametrize("name", ARMS)
def test_pictures_move_every_link(name: str) -> None:
    robot, world = arm(name), _seam(name, "continuous")
    q = postures(robot.chain, 1)[0]
    _, poses = robot_meshes(world, np.zeros(3), q)
    T = np.eye(4)
    for path in sorted((node for node in poses if node.startswith("robot")), key=len):
        T = T @ poses[path]
    assert pytest.approx(robot.tool(np.zeros(3), q), abs=1e-12) == T


@pytest.mark.parametrize("name", ["telescope"])
def test_a_page_has_a_track_for_every_link_that_moves(name: str) -> None:
    robot = arm(name)
    moving = {track.path for track in picture_of_plan(seam_plan(name, "continuous")).tracks}
    assert {joint_node(k) for k in range(len(robot.chain.joints))} <= moving


@pytest.mark.parametrize("name", ["telescope"])
def test_simulated_joints_follow_those_that_they_mimic(name: str) -> None:
    run = simulate(retime(seam_plan(name, "continuous")))
    assert run.ok
    assert run.joints.shape[1] == 3
    assert run.tool_error.max() < 2e-3


def test_rivals_are_not_asked() -> None:
    with pytest.raises(InputError, match="telescope has joints that mimic others"):
        prepare_methods(_seam("telescope", "continuous"), ["mfabrik"])
