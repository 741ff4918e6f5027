"""Timed plans executed in a physics simulation, and the controller that tracks them."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

import regionik as rik
from regionik.cli.app import run
from regionik.simulation.noise import Noise, PoseEstimate, typical_noise
from regionik.simulation.physics import STEP, Physics
from regionik.simulation.reference import PERIOD, Reference, reference
from regionik.simulation.run import Contact
from regionik.simulation.run_file import run_to_csv, run_to_mcap
from regionik.simulation.run_picture import picture_of_run
from regionik.simulation.simulate import SUBSTEPS, BaseDrives, simulate
from regionik.simulation.tracking import TrackingController
from regionik.timing.retime import retime
from regionik.values import Motion, Plan
from regionik.worlds.errors import EngineError, InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot
from tests import examples
from tests.kinds import BaseKind
from tests.planned import planned
from tests.plans import every_solid, youbot
from tests.test_export import awkward

TOOL_SPEED = 0.1  # [m/s]


@cache
def timed_plan() -> Plan:
    """A short line, base and arm at work together."""
    world = planned("free").world
    task = tuple(rik.Target(np.array([0.4 + 0.1 * k, 0.05 * k, 0.25])) for k in range(6))
    made = rik.plan(replace(world, task=task, start=None))
    return retime(made, Speeds(base_velocity=0.3, tool_velocity=TOOL_SPEED))


def test_without_noise_the_tool_keeps_its_path_and_its_speed() -> None:
    run = simulate(timed_plan())
    figures = run.figures
    assert run.ok
    assert not run.contacts
    assert figures["tool_error"]["worst"] < 1e-3
    assert figures["speed_held"] >= 0.99
    assert max(figures["used"].values()) < 1.01
    assert figures["base_error"] < 1e-3
    assert np.ptp(run.base[:, 0]) > 0.1  # it drove
    assert run.tool_speed[0] < 0.01  # from rest


def test_noise_is_taken_up_by_the_arm_and_a_seed_repeats_its_bytes() -> None:
    run, again, other = (simulate(timed_plan(), typical_noise(), seed=seed) for seed in (1, 1, 2))
    assert run_to_csv(run) == run_to_csv(again) != run_to_csv(other)
    for one in (run, other):
        error = one.figures["tool_error"]
        assert error["p95"] < 5e-3
        assert error["median"] > 1e-4  # there is noise
        assert np.abs(one.estimate - one.base).max() > 1e-4


def test_the_tool_is_known_as_well_as_the_base_is() -> None:
    """Its spread is that of tools on bases drawn about the true one by the estimate's covariance."""
    run, rng = simulate(timed_plan(), typical_noise(), seed=1), np.random.default_rng(0)
    for k in (0, len(run.time) // 2, len(run.time) - 1):
        bases = run.base[k] + rng.multivariate_normal(np.zeros(3), run.covariance[k], 4000)
        tools = run.plan.world.robot.tool(bases, np.tile(run.joints[k], (len(bases), 1)))[:, :2, 3]
        spread = np.sqrt(np.linalg.eigvalsh(np.cov(tools.T))[-1])
        assert run.tool_spread[k] == pytest.approx(spread, rel=0.05)
    assert not simulate(timed_plan()).tool_spread.any()


def test_a_run_fails_where_its_tolerance_is_left() -> None:
    run = simulate(timed_plan(), Noise(position=0.05, heading=0.02), tolerance=1e-3)
    assert not run.ok
    left = np.flatnonzero(run.reference.on_path & (run.tool_error > 1e-3))
    assert run.failure.startswith(f"at {run.time[left[0]]:.2f} s the tool is ")


ROUND = tuple(
    (0.3 * float(np.cos(angle)), 0.3 * float(np.sin(angle))) for angle in np.arange(40) * np.pi / 20
)


@pytest.mark.parametrize("robot", [youbot(), youbot(ROUND), awkward()], ids=["youbot", "round", "awkward"])
def test_the_model_moves_as_the_robot_does(robot: Robot) -> None:
    world, rng = replace(every_solid(), robot=robot, start=None), np.random.default_rng(3)
    for _ in range(5):
        base, joints = rng.uniform(-2, 2, 3), rng.uniform(-0.3, 0.3, (1, robot.chain.dof))
        physics = Physics(world, base, joints, 50.0)
        assert np.abs(physics.tool - robot.tool(base, joints[0])[:3, 3]).max() < 1e-9


def test_the_speed_of_the_tool_is_that_of_its_motion() -> None:
    """While the base speeds up evenly."""
    world = every_solid()
    physics = Physics(world, np.array([20.0, 20.0, 0.0]), world.robot.carry[None], 100.0)
    places, speeds = [], []
    for k in range(100):
        physics.step((k * STEP, 0.5 * k * STEP, 0.0), world.robot.carry)
        physics.refresh()
        places.append(physics.tool.copy())
        speeds.append(physics.tool_velocity())
    moved = (np.array(places[2:]) - places[:-2]) / (2 * STEP)
    assert np.abs(moved - speeds[1:-1])[50:].max() < 5e-5
    assert np.abs(physics.position[:2] - [20 + (99 * STEP) ** 2 / 2, 20 + (99 * STEP) ** 2 / 4]).max() < 3e-4


def test_contacts_name_what_touches() -> None:
    world = every_solid()
    straight_up = np.array([[0.0, np.pi / 2, 0.0, np.pi / 2, 0.0]])
    seen = 0
    for k, solid in enumerate(world.obstacles):
        middle = solid.vertices.mean(0) if isinstance(solid, rik.Mesh) else solid.bounds.mean(0)
        if solid.distance(middle) > 0 or middle[2] > 0.85:
            continue  # its middle is free, or over the arm
        base = np.array([*middle[:2], 0.0]) - [*world.robot.mount[:2], 0.0]
        physics = Physics(world, base, straight_up, 50.0)
        assert k in {touch.other for touch in physics.touches() if not touch.own}, solid.name
        seen += 1
    assert seen == 4
    away = Physics(world, np.array([20.0, 20.0, 0.0]), straight_up, 50.0)
    assert not [touch for touch in away.touches() if not touch.own]


def test_a_run_fails_where_the_arm_meets_what_the_plan_does_not_know() -> None:
    plan = timed_plan()
    spot = plan.world.robot.frames(plan.motion.base[-1], plan.motion.joints[-1])[2, :3, 3]
    post = rik.Sphere("lamp", 0.04, spot)
    run = simulate(replace(plan, world=replace(plan.world, obstacles=(post,))))
    assert not run.ok
    assert "lamp" in run.failure
    assert run.contacts[0].time > 0
    assert run.contacts[0].depth > 0


def test_a_plan_of_one_state_is_a_run_of_one_row() -> None:
    plan, one = timed_plan(), slice(0, 1)
    motion = plan.motion
    still = Motion(motion.base[one], motion.joints[one], motion.kind[one], motion.setpoint[one], np.zeros(1))
    run = simulate(replace(plan, motion=still), typical_noise())
    assert run.ok
    assert len(run.time) == 1


def test_a_motion_that_is_not_finite_is_an_error() -> None:
    world = every_solid()
    physics = Physics(world, np.zeros(3), world.robot.carry[None], 50.0)
    physics.position[0] = np.nan
    with pytest.raises(EngineError, match="is not finite"):
        physics.refresh()


# --- the controller and the estimate, without the physics


def arc(drive: BaseKind, speed: float, turn: float, seconds: float = 5.0) -> tuple[Robot, Reference]:
    """A robot, its base on an arc."""
    robot = replace(youbot(), base=drive, turning_radius=0.5 if drive == "car" else 0.0)
    time = np.arange(0.0, seconds, PERIOD)
    yaw = turn * time
    reach = time * np.sinc(yaw / 2 / np.pi) * speed
    base = np.column_stack([reach * np.cos(yaw / 2), reach * np.sin(yaw / 2), yaw])
    velocity = np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), np.full(len(time), turn)])
    joints = np.tile(robot.carry, (len(time), 1))
    tool, zero = robot.tool(base, joints), np.zeros(len(time))
    on_path, setpoint = np.ones(len(time), dtype=bool), np.zeros(len(time), dtype=np.int64)
    return robot, Reference(time, base, velocity, joints, tool, zero, on_path, setpoint)


@settings(max_examples=examples(12))
@given(
    st.sampled_from(["omni", "differential", "car"]),
    st.sampled_from([-0.3, 0.3]),
    st.floats(-0.4, 0.4),
    st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.1, 0.1)),
)
@example("differential", -0.3, 0.0, (0.0, 0.05, -0.1))
def test_every_base_comes_back_to_its_way(
    drive: BaseKind, speed: float, turn: float, off: tuple[float, float, float]
) -> None:
    robot, way = arc(drive, speed, turn, seconds=10.0)
    speeds = Speeds(base_velocity=0.5, turn_velocity=1.0)
    drives = BaseDrives(robot, speeds, np.ones((20, 3)), way.curvature[0])
    controller, pose, joints = TrackingController(robot, speeds, way), way.base[0] + off, way.joints[0]
    for k in range(len(way.time) - 1):
        command = controller.command(k, pose, drives.twist, joints)
        joints = command.joints
        for _ in range(SUBSTEPS):
            pose = pose + STEP * np.array(drives.step(command.twist, command.curvature, pose[2]))
    error = pose - way.base[-1]
    assert np.hypot(*error[:2]) < 0.01
    assert abs(error[2]) < 0.02


def test_localisation_at_rest_averages() -> None:
    noise, rng = Noise(position=0.01, heading=0.01), np.random.default_rng(0)
    true = np.array([1.0, 2.0, 3.1])
    ends = []
    for _ in range(100):
        estimate = PoseEstimate(
            true + noise.deviations * rng.standard_normal(3), np.diag(noise.deviations**2)
        )
        for _ in range(24):
            seen = true + noise.deviations * rng.standard_normal(3)
            estimate = estimate.corrected(seen, estimate.pose, noise.deviations)
        ends.append(estimate.pose - true)
    spread = np.std(np.array(ends), axis=0)
    assert np.abs(spread / (noise.deviations / 5) - 1).max() < 0.3  # 25 fixes in all
    assert np.abs(np.diag(estimate.covariance) / (noise.deviations**2 / 25) - 1).max() < 1e-6


def test_odometry_follows_a_circle_and_grows_less_sure() -> None:
    estimate, twist = PoseEstimate(np.zeros(3)), np.array([0.2, 0.0, 0.5])
    before = 0.0
    for _ in range(round(np.pi / 0.5 / 1e-3)):
        estimate = estimate.moved(twist, 1e-3, 0.02)
        spread = float(np.trace(estimate.covariance))
        assert spread > before
        before = spread
    assert np.abs(estimate.pose - [0.0, 0.8, np.pi]).max() < 1e-3


# --- the command


def test_the_command_writes_a_table_and_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, table, page = tmp_path / "timed.json", tmp_path / "run.csv", tmp_path / "run.html"
    timed_plan().save(plan)
    assert run(["simulate", str(plan), "-o", str(table), "--html", str(page)]) == 0
    said = capsys.readouterr().err
    assert "tool error: median" in said
    header, *rows = table.read_text().splitlines()
    assert header.startswith("time,base_x,base_y,base_yaw,joint_1")
    assert len(rows) == len(reference(timed_plan()).time)
    assert "path of the tool as planned" in page.read_text("utf-8")
    assert run(["simulate", str(plan), "-o", str(tmp_path / "run.mcap")]) == 0
    assert (tmp_path / "run.mcap").read_bytes() == run_to_mcap(simulate(timed_plan()))
    noisy = ["--noise", "position=0.05,heading=0.02", "--tolerance", "0.001"]
    assert run(["simulate", str(plan), *noisy, "--json"]) == 1
    told = capsys.readouterr()
    assert '"ok": false' in told.out
    assert "this run needs rules.execution: {base_error: 0." in told.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--noise", "much"], "--noise: expected none, typical or KEY=NUMBER,..., got 'much'"),
        (
            ["--noise", "wind=1"],
            "--noise: unknown key 'wind', valid keys: position, heading, rate, delay, slip",
        ),
        (["--noise", "rate=0"], "noise: rate: must be above 0, got 0"),
        (["--tolerance", "0"], "tolerance: must be above 0, got 0"),
        (["-o", "run.txt"], "run.txt: expected a file name ending in .csv, .mcap"),
        (["--html", "run"], "run: expected a file name ending in .html, .htm"),
    ],
)
def test_what_does_not_go_is_one_line(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = tmp_path / "timed.json"
    timed_plan().save(plan)
    assert run(["simulate", str(plan), *words]) == 2
    assert said in capsys.readouterr().err


def test_an_untimed_plan_and_a_missing_engine_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="it is not timed"):
        simulate(planned("free"))
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"a simulation needs regionik\[simulate\]"):
        simulate(timed_plan())


def test_a_bag_of_a_run_holds_what_moved_and_what_touched() -> None:
    run = simulate(timed_plan(), typical_noise(), seed=1)
    bag = run_to_mcap(replace(run, contacts=(Contact(0.5, "link", "lamp", 0.002),)))
    store, read = get_typestore(Stores.ROS2_HUMBLE), dict[str, list[Any]]()
    for schema, channel, message in make_reader(io.BytesIO(bag)).iter_messages():
        assert schema is not None
        read.setdefault(channel.topic, []).append(store.deserialize_cdr(message.data, schema.name))
    assert [state.position.tolist() for state in read["/joint_states"]] == run.joints.tolist()
    base = [one.transforms[0].transform.translation for one in read["/tf"]]
    assert [[one.x, one.y] for one in base] == run.base[:, :2].tolist()
    assert [one.data for one in read["/tool_error"]] == run.tool_error.tolist()
    assert [one.data for one in read["/contacts"]] == ["link touches lamp, 2.0 mm deep at most"]
    assert len(read["/planned_path"][0].poses) == len(run.plan.motion)


def test_the_picture_shows_the_run_over_the_plan() -> None:
    run = simulate(timed_plan())
    picture = picture_of_run(run)
    paths = [body.path for body in picture.bodies]
    assert {"tool/trace", "tool/planned"} <= set(paths)
    assert len(paths) == len(set(paths))
    assert any("worst" in fact for fact in picture.facts)
