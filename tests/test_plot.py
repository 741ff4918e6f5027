"""PlanCurves of plans, what of the floor is drawn, and the figures made of them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from matplotlib import rc_context, rcParams
from PIL import Image

import regionik as rik
from regionik.planners.collision.proximity import nearest
from regionik.planners.collision.robot_bodies import bodies_from
from regionik.values import Plan
from regionik.verification.base_clearance import footprint_hulls
from regionik.view.floor_view import floor_view
from regionik.view.options import VIEW
from regionik.view.timeline import clearances, plan_curves
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.scene import World
from tests.plans import every_solid, l_shape, synthetic_plan, timed


@pytest.fixture(scope="module", params=[l_shape, every_solid], ids=lambda make: make.__name__)
def plan(request: pytest.FixtureRequest) -> Plan:
    return synthetic_plan(request.param())


def short() -> Plan:
    """A plan that is soon drawn."""
    return synthetic_plan(replace(l_shape(), task=l_shape().task[:6]))


def words(path: Path) -> str:
    """All text of an SVG file, which is drawn as glyphs and told in comments beside them."""
    return " ".join(re.findall(r"<!-- (.*?) -->", path.read_text()))


def test_clearances_are_those_of_each_state(plan: Plan) -> None:
    world, motion = plan.world, plan.motion
    found = clearances(world, motion.base, motion.joints)
    shadows = [solid.shadow(world.robot.body_height) for solid in world.solids]
    bodies = bodies_from(world.robot, world.solids)
    outlines = footprint_hulls(world.robot, motion.base)
    for k in range(0, len(motion), 7):
        gaps = [shadow.distance(outlines[k]) for shadow in shadows if shadow is not None]
        assert found.base[k] == pytest.approx(min(gaps), abs=1e-9)
        either = nearest(bodies, motion.base[k], motion.joints[k]).distance
        assert min(found.arm[k], found.own[k]) == pytest.approx(either, abs=1e-9)


def test_where_there_are_no_solids_clearance_is_infinite() -> None:
    empty = replace(l_shape(), obstacles=(), rules=replace(l_shape().rules, solid_floor=False))
    motion = synthetic_plan(empty).motion
    found = clearances(empty, motion.base, motion.joints)
    assert np.isinf(found.base).all()
    assert np.isinf(found.arm).all()


def test_curves_without_times_run_over_states(plan: Plan) -> None:
    curves, motion = plan_curves(plan), plan.motion
    assert not curves.timed
    assert not curves.speeds
    assert curves.along.tolist() == list(range(1, len(motion) + 1))
    assert np.array_equal(curves.setpoints, 1.0 + np.flatnonzero(motion.kind == "setpoint"))


def test_curves_of_a_timed_plan_hold_its_states_and_speeds(plan: Plan) -> None:
    moving = timed(plan)
    curves, motion = plan_curves(moving), moving.motion
    at = np.searchsorted(curves.along, motion.time)
    assert np.array_equal(curves.along[at], motion.time)
    assert np.abs(curves.joints[at] - motion.joints).max() < 1e-9
    # What is come by along the way: no shorter than the tool's straight steps, and not much longer.
    spans = np.diff(curves.along)
    way = float((spans * (curves.speeds["tool"][1:] + curves.speeds["tool"][:-1]) / 2).sum())
    steps = float(np.linalg.norm(np.diff(moving.tools(), axis=0), axis=1).sum())
    assert 0.98 * steps < way < 1.1 * steps


def test_lifted_spans_are_the_transits_with_their_ends(plan: Plan) -> None:
    spans, kind = plan_curves(plan).lifted, plan.motion.kind
    hops = {k for low, high in spans.tolist() for k in range(int(low) - 1, int(high) - 1)}
    assert hops == {k for k in range(len(kind) - 1) if "transit" in kind[k : k + 2]}
    assert (spans[1:, 0] > spans[:-1, 1]).all()


def test_the_floor_is_parted(plan: Plan) -> None:
    view = floor_view(plan)
    parts = [view.free, view.turning, view.rejected, view.pale, view.strong]
    assert sum(part.area for part in parts) == pytest.approx(view.all.area, rel=0.01)
    assert shapely.union_all(parts).area == pytest.approx(view.all.area, rel=0.01)
    assert len(view.footprints) == len(view.headings) == min(VIEW.floor.shown_poses, len(plan.setpoints))
    everything = shapely.box(*view.low, *view.high)
    assert everything.covers(shapely.multipoints(np.vstack([view.axis_path, view.tool_path, view.setpoints])))


def test_a_picture_names_what_it_shows(plan: Plan, tmp_path: Path) -> None:
    rik.plot(timed(plan), tmp_path / "timed.svg")
    rik.plot(plan, tmp_path / "plain.svg")
    assert ElementTree.parse(tmp_path / "plain.svg").getroot().tag.endswith("svg")
    timed_words, plain_words = words(tmp_path / "timed.svg"), words(tmp_path / "plain.svg")
    for name in plan.world.robot.chain.names:
        assert name in plain_words
        assert f"{name}, velocity" in timed_words
    for word in ("time [s]", "speed", "[m/s]", "[rad/s]"):
        assert word in timed_words
        assert word not in plain_words
    assert "not timed" in plain_words
    assert "not timed" not in timed_words
    for word in (
        "clearance",
        "x [m]",
        "[rad]",
        "tool lifted",
        "beyond the limits",
        "obstacles",
        "base to solids",
    ):
        assert word in timed_words
        assert word in plain_words


def test_the_same_plan_gives_the_same_picture(tmp_path: Path) -> None:
    for name, family in (("a", "serif"), ("b", "monospace")):
        with rc_context({"font.family": [family], "lines.linewidth": 5.0}):
            rik.plot(timed(short()), tmp_path / f"{name}.svg")
            assert rcParams["lines.linewidth"] == 5.0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_png_is_a_picture(tmp_path: Path) -> None:
    rik.plot(short(), tmp_path / "plan.png")
    with Image.open(tmp_path / "plan.png") as image:
        assert min(image.size) > 800
        colors = image.convert("RGB").getcolors(1 << 24)
        assert colors is not None
        assert len(colors) > 50


def bare() -> World:
    """One set-point, nothing else on the floor, and joints without limits."""
    world = l_shape()
    chain = world.robot.chain
    joints = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in chain.joints)
    robot = replace(world.robot, chain=Chain(joints, chain.T_last_tool), solids=())
    return replace(world, robot=robot, obstacles=(), task=world.task[:1], start=None)


def test_a_single_state_without_solids_and_limits_is_drawn(tmp_path: Path) -> None:
    plan = synthetic_plan(bare())
    assert len(plan.motion) == 1
    rik.plot(plan, tmp_path / "plain.svg")
    rik.plot(replace(plan, motion=replace(plan.motion, time=np.zeros(1))), tmp_path / "timed.svg")
    assert "base to solids" not in words(tmp_path / "timed.svg")


def test_velocity_limits_are_shaded(tmp_path: Path) -> None:
    plan = timed(short())
    chain = plan.world.robot.chain
    joints = tuple(replace(joint, velocity=1.5) for joint in chain.joints)
    robot = replace(plan.world.robot, chain=Chain(joints, chain.T_last_tool))
    limited = replace(plan, world=replace(plan.world, robot=robot))
    rik.plot(plan, tmp_path / "free.svg")
    rik.plot(limited, tmp_path / "limited.svg")
    shades = [(tmp_path / name).read_text().count("fill: #9aa0a6") for name in ("free.svg", "limited.svg")]
    assert shades[1] - shades[0] == 2 * chain.dof


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"plan.pdf: expected a file name ending in .svg, .png"):
        rik.plot(synthetic_plan(l_shape()), tmp_path / "plan.pdf")
    assert list(tmp_path.iterdir()) == []
