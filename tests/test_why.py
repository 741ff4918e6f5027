"""Why not: exact cases by hand, and laws on random ones, by the functions of the benchmark."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from regionik.cli.app import run
from regionik.explain.arm_failures import target_in_solid
from regionik.explain.causes import deletion_filter, irreducible
from regionik.explain.changes import repaired, share
from regionik.explain.constraints import constraints_of
from regionik.pipeline import plan, why
from regionik.reachability.reach import reach
from regionik.scene import Scene, scene_of
from regionik.view.picture import Color
from regionik.view.world_picture import picture_of_explanation
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import Explanation, InputError, NoPlanFound, Repair
from regionik.worlds.obstacles import Box, Sphere
from regionik.worlds.robot import Tool, with_tool
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.furnished import robot_with
from tests.maths import translation
from tests.why_cases import as_small_as_brute_force, cases, proven_irreducible

REACH = 0.033 + 0.155 + 0.135 + 0.2175  # of the youbot, stretched level
SHOULDER = 0.147
ROUNDED = 0.003  # 48 chords to a circle [m]


def hall(**changes: object) -> World:
    """The paper's robot, a point base, on a wide floor; nothing kept from the ends of the reach."""
    floor = Floor(shapely.box(-4, -4, 4, 4))
    world = World("hall", robot_named("youbot"), floor, rules=Rules(clearance=0.3, reach_margin=0.0))
    return replace(world, **changes)  # type: ignore[arg-type]


def explained(world: World, target: object) -> Explanation:
    found = why(world, target)  # type: ignore[arg-type]
    assert found is not None
    return found


def of_kind(found: Explanation, kind: str) -> Repair:
    return next(repair for repair in found.repairs if repair.kind == kind)


def test_nothing_in_the_way_is_none() -> None:
    assert why(hall(), [1.0, 0.0, 0.3]) is None
    assert why(load_world("free")) is None


def test_a_plate_before_a_target_wants_less_clearance() -> None:
    half = 0.6
    plate = Box("plate", np.array([2 * half, 2 * half, 0.1]), np.array([0.0, 0.0, 0.05]))
    found = explained(hall(obstacles=(plate,)), [0.0, 0.0, SHOULDER])
    assert [(cause.kind, cause.name) for cause in found.causes] == [("obstacle", "plate")]
    assert {repair.kind for repair in found.repairs} == {"move-target", "move-obstacle"}
    narrow = Box("plate", np.array([0.6, 8.0, 0.1]), np.array([0.0, 0.0, 0.05]))
    found = explained(hall(obstacles=(narrow,)), [0.0, 0.0, SHOULDER])
    assert [cause.name for cause in found.causes] == ["plate", "rules.clearance"]
    assert of_kind(found, "clearance").amount == pytest.approx(REACH - 0.3, abs=ROUNDED)
    missing = 0.3 - (REACH - 0.3)
    for kind in ("move-target", "move-obstacle"):
        repair = of_kind(found, kind)
        assert repair.amount == pytest.approx(missing, abs=ROUNDED)
        assert abs(repair.vector[0]) == pytest.approx(missing, abs=ROUNDED)
        assert repair.vector[1] == pytest.approx(0.0, abs=ROUNDED)
    assert "This is a proof" in found.reason


def test_a_target_off_the_floor_moves_as_far_as_it_lies_off() -> None:
    found = explained(hall(), [4.0 + REACH + 0.1, 0.0, SHOULDER])
    assert [cause.kind for cause in found.causes] == ["floor"]
    repair = found.repairs[0]
    assert repair.kind == "move-target"
    assert repair.amount == pytest.approx(0.1, abs=ROUNDED)
    assert repair.vector == pytest.approx((-0.1, 0.0, 0.0), abs=ROUNDED)
    assert (repair.unit, repair.name) == ("m", "the target")


def test_a_target_too_high_wants_a_mast() -> None:
    high = SHOULDER + REACH - 0.033 + 0.2
    found = explained(hall(), [0.0, 0.0, high])
    assert [cause.kind for cause in found.causes] == ["reach"]
    assert found.causes[0].margin == pytest.approx(0.2)
    assert of_kind(found, "raise").amount == pytest.approx(0.2, abs=ROUNDED)
    assert "too short" in found.reason


def test_a_plan_carries_causes_and_repairs() -> None:
    world = load_world("free")
    task = (*world.task[:2], Target(world.task[2].position + [0.0, 0.0, 0.6]))
    with pytest.raises(NoPlanFound) as no:
        plan(replace(world, task=task))
    found = no.value.explanation
    assert (found.verdict, found.setpoint) == ("unreachable", 2)
    move = of_kind(found, "move-target")
    assert move.name == "set-point 3"
    assert plan(repaired(scene_of(replace(world, task=task)), move, 2).world)


def test_bad_targets_are_refused() -> None:
    with pytest.raises(InputError, match="target"):
        why(hall(), [0.0, 1.0])


def test_a_random_case_is_irreducible_and_mended_the_smallest_change_first() -> None:
    """`benchmarks/bench_why.py` asks more of them, some by `tests/test_still_shown.py`."""
    case = cases(range(52, 54))[0]
    found = explained(case, case.task[0])
    assert proven_irreducible(case, found)
    shares = [share(scene_of(case), repair) for repair in found.repairs]
    assert shares == sorted(shares)
    for repair in found.repairs:
        changed = repaired(scene_of(case), repair)
        assert reach(changed.world, changed.task).reachable.all(), repair.text
        assert as_small_as_brute_force(case, repair), repair.text


def test_the_command_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "why.html"
    high = ["--target", "0.5", "0", "0.7"]
    assert run(["why", "pillar", *high, "--json", "--html", str(page)]) == 1
    told = capsys.readouterr()
    document = json.loads(told.out)
    assert document["causes"][0]["kind"] == "reach"
    assert document["reason"] in told.err
    assert {"move-target", "raise"} == {repair["kind"] for repair in document["repairs"]}
    assert len(document["repairs"][0]["vector"]) == 3
    assert "in the way: youbot" in page.read_text()
    assert run(["why", "pillar", "--target", "0.5", "0", "0.25"]) == 0
    assert "nothing stands in the way" in capsys.readouterr().err
    assert run(["why", "pillar", *high, *high]) == 2
    assert "expected one target" in capsys.readouterr().err


def test_the_command_says_causes_first_and_repairs_as_they_are_found(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["why", "pillar", "--target", "0.5", "0", "0.7"]) == 1
    failed, causes, *repairs, smallest = capsys.readouterr().err.splitlines()
    assert "above all that youbot reaches" in failed
    assert "too short" in causes
    assert [line[:20] for line in repairs] == ["This would mend it: "] * 2
    assert smallest.removeprefix("The smallest change: ") in {line[20:] for line in repairs}


def test_a_target_deep_in_a_solid_is_told_before_any_search() -> None:
    crate = Box("crate", np.array([0.6, 0.6, 0.8]), np.array([1.3, 0.1, 0.4]))
    world = load_world("free")
    far = with_tool(world.robot, Tool(translation(0.0, 0.0, 0.1)))
    assert far.tip_depth[0] == 0.0
    middle, side = (Target(np.array([x, 0.1, 0.4])) for x in (1.3, 1.05))  # 0.3 m deep, and 0.05 m
    asked = replace(world, robot=far, obstacles=(crate,), task=(side, middle))
    found = target_in_solid(scene_of(asked))
    assert found is not None
    assert (found.setpoint, [cause.name for cause in found.causes]) == (1, ["crate"])
    assert "m deep in crate" in found.reason
    assert target_in_solid(scene_of(replace(asked, task=(side,)))) is None

    class EnoughError(Exception):
        """Ends the explanation at its first sentence."""

    def say(sentence: str) -> None:
        raise EnoughError(sentence)

    with pytest.raises(EnoughError, match="crate"):
        why(replace(world, obstacles=(crate,)), middle, say=say)


def test_a_repair_says_which_set_point_it_leaves_out_of_reach() -> None:
    places = np.array([[0.5, 0.0, 0.7], [0.6, 0.0, 0.75], [0.6, 0.0, 0.3]])
    world = replace(load_world("pillar"), task=tuple(map(Target, places)))
    with pytest.raises(NoPlanFound) as refused:
        plan(world)
    texts = [repair.text for repair in refused.value.explanation.repairs]
    assert texts
    assert all(text.endswith("with which set-point 2 still has no known place") for text in texts)
    with pytest.raises(NoPlanFound) as refused:
        plan(replace(world, task=world.task[::2]))
    assert not any("still" in repair.text for repair in refused.value.explanation.repairs)


def test_the_picture_shows_causes_and_moves() -> None:
    narrow = Box("plate", np.array([0.6, 8.0, 0.1]), np.array([0.0, 0.0, 0.05]))
    world, target = hall(obstacles=(narrow,)), Target(np.array([0.0, 0.0, SHOULDER]))
    found = explained(world, target)
    picture = picture_of_explanation(world, found, target)
    bodies = {body.path: body for body in picture.bodies}
    assert bodies["obstacles/0"].color == Color.CAUSE
    assert len(bodies["why/before"].mesh.faces) == 0
    assert len(bodies["why/after"].mesh.faces) > 0
    for k, repair in enumerate(found.repairs):
        assert (f"why/move {k}" in bodies) == bool(repair.vector)
        if repair.vector:
            ends = bodies[f"why/move {k}"].mesh.vertices @ [*repair.vector, 0.0, 0.0][:3] / repair.amount
            assert np.ptp(ends) == pytest.approx(repair.amount, abs=0.005)


# Laws of the search ------------------------------------------------------------------------------------


@given(st.sets(st.frozensets(st.integers(0, 6), min_size=1, max_size=3), min_size=1, max_size=4))
def test_the_filter_leaves_one_minimal_set(conflicts: set[frozenset[int]]) -> None:
    names = [f"solid {k}" for k in range(7)]
    solids = tuple(Sphere(name, 0.1, np.array([k, 0.0, 0.0])) for k, name in enumerate(names))
    world = hall(obstacles=solids, task=(Target(np.zeros(3)),))
    closed = [frozenset(names[k] for k in one) for one in conflicts]

    def ruled_out(changed: Scene) -> bool:
        held = {solid.name for solid in changed.world.obstacles}
        return any(one <= held for one in closed)

    kept = {one.name for one in irreducible(scene_of(world), constraints_of(scene_of(world)), ruled_out)}
    assert any(one == kept for one in closed)
    assert not any(one < kept for one in closed)


@given(st.sets(st.frozensets(st.integers(0, 8)), max_size=40))
def test_the_filter_leaves_nothing_that_can_be_left_out_though_more_need_not_hold(
    some: set[frozenset[int]],
) -> None:
    holding = some | {frozenset(range(9))}
    left = frozenset(deletion_filter(range(9), lambda kept: frozenset(kept) in holding))
    assert left in holding
    assert not any(left - {one} in holding for one in left)


def test_a_table_top_and_the_column_under_it_are_the_cause() -> None:
    robot = robot_with("column", np.random.default_rng(0))
    high = float(robot.mount[2])
    top = Box("table top", np.array([6.0, 6.0, 0.03]), np.array([0.0, 0.0, robot.body_height + 0.115]))
    world = hall(robot=robot, obstacles=(top,), rules=Rules(clearance=0.02))
    found = explained(world, [0.0, 0.0, high + 0.2])
    assert [cause.name for cause in found.causes] == ["table top", "what stands on the base"]
    assert "column of column, which the base carries, would touch table top" in found.reason
    assert found.verdict == "unreachable"
    assert why(replace(world, obstacles=()), [0.0, 0.0, high + 0.2]) is None
