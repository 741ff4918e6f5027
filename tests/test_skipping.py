"""Set-points that cannot be done: all named where a plan is refused, left out where the rules say so."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from regionik.area_verification import verify_areas
from regionik.cli.app import run
from regionik.explain.arm_failures import target_in_solid
from regionik.explain.several import naming_as_given, numbered
from regionik.output.plan_file import load_plan
from regionik.parking.stops import stops
from regionik.pipeline import plan
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.plans import plan_text
from tests.test_any_base import kept_heading, level

HALL = Floor(shapely.box(-1.0, -1.0, 4.0, 1.0))
WALL = Box("wall", np.array([0.1, 2.0, 1.0]), np.array([1.55, 0.0, 0.5]))


def hall(*spots: tuple[float, float, float], **rules: object) -> World:
    """The paper's robot on a wide floor, and the set-points of its task."""
    task = tuple(Target(np.array(spot)) for spot in spots)
    asked = Rules(**{"clearance": 0.05, **rules})  # type: ignore[arg-type]
    return World("hall", robot_named("youbot"), HALL, (), task, asked)


SPOTS = ((0.0, 0.0, 0.3), (0.5, 0.0, 2.0), (1.0, 0.1, 0.3), (1.5, 0.0, 0.3), (6.5, 0.0, 0.3), (2.0, 0.0, 0.3))
MODES = [{}, {"mode": "stops"}, {"mode": "stops", "order": "any"}]
OUT = [1, 4]


def refused(world: World) -> Explanation:
    with pytest.raises(NoPlanFound) as no:
        plan(world)
    return no.value.explanation


def skipping(world: World) -> World:
    return replace(world, rules=replace(world.rules, skip_unreachable=True))


def left_out(found: Plan) -> list[int]:
    assert verify(found).ok
    assert verify_areas(found).ok
    assert len(found.world.task) == len(found.setpoints)
    return [one.setpoint for one in found.skipped]


@pytest.mark.parametrize("rules", MODES)
def test_a_refusal_names_every_set_point(rules: dict[str, str]) -> None:
    world = hall(*SPOTS, **rules)
    found = refused(world)
    assert found.reason.startswith("Set-points 2 and 5 of 6 cannot be reached. Set-point 2 of 6 at (0.500")
    assert [(one.setpoint, one.verdict) for one in found.failures] == [(1, "unreachable"), (4, "unreachable")]
    assert "above all" in found.failures[0].reason
    assert found.failures[1].reason.startswith("Set-point 5 of 6 at (6.500")
    if rules:
        with pytest.raises(
            NoPlanFound, match=r"^Set-points 2 and 5 of 6 cannot be reached\. Set-point 2"
        ) as no:
            stops(world)
        assert no.value.explanation.failures == found.failures


@pytest.mark.parametrize("rules", MODES)
def test_the_rest_is_planned(rules: dict[str, str]) -> None:
    world = skipping(hall(*SPOTS, **rules))
    found = plan(world)
    assert left_out(found) == OUT
    order = found.stats["order"]
    assert sorted([*order, *OUT]) == list(range(6))
    for i, target in zip(order, found.world.task, strict=True):
        assert (target.position == SPOTS[i]).all()
    for one in found.skipped:
        assert (one.target.position == SPOTS[one.setpoint]).all()
        assert f"et-point {one.setpoint + 1} of 6" in one.reason
    if rules:
        assert sorted(i for stop in stops(world) for i in stop.setpoints) == [0, 2, 3, 5]


def test_what_can_be_done_whole_is_planned_as_without_the_rule() -> None:
    world = hall(*(SPOTS[i] for i in (0, 2, 3)))
    kept, bare = plan(skipping(world)), plan(world)
    assert kept.skipped == ()
    assert (kept.motion.base == bare.motion.base).all()
    assert kept.stats == bare.stats


def test_nothing_that_can_be_done_is_refused_all_the_same() -> None:
    found = refused(skipping(hall(SPOTS[1], SPOTS[4])))
    assert [one.setpoint for one in found.failures] == [0, 1]
    assert found.causes


def test_a_set_point_without_a_clear_posture_is_left_out() -> None:
    forward = Target(np.array([0.7, 0.0, 0.3]))
    found = plan(skipping(replace(kept_heading(), task=(forward, level(0.05, 0.7)))))
    assert left_out(found) == [1]
    assert found.skipped[0].verdict == "no-posture"
    assert found.skipped[0].reason.startswith("Set-point 2 of 2 at")


def test_stops_leave_out_what_has_no_clear_posture() -> None:
    forward, back = Target(np.array([0.7, 0.0, 0.3])), level(0.05, 0.7)
    world = skipping(replace(kept_heading(), task=(back, forward)))
    (stop,) = stops(world)
    assert (stop.setpoints, stop.unconfirmed) == ((1,), ())


@pytest.mark.slow
def test_all_set_points_without_a_clear_posture_are_named() -> None:
    forward, back, beside = Target(np.array([0.7, 0.0, 0.3])), level(0.05, 0.7), level(0.05, 0.72)
    found = refused(replace(kept_heading(), task=(forward, back, forward, beside)))
    assert found.verdict == "no-posture"
    assert [one.setpoint for one in found.failures] == [1, 3]
    assert found.reason.startswith("Set-point")
    assert found.failures[1].reason.startswith("Set-point 4 of 4 at")


def test_targets_in_solids_are_all_named_and_left_out() -> None:
    crate = Box("crate", np.array([0.6, 0.6, 0.8]), np.array([1.3, 0.0, 0.4]))
    spots = (SPOTS[0], (1.3, 0.1, 0.4), (1.3, -0.1, 0.4), (2.5, 0.0, 0.3))
    world = replace(hall(*spots), obstacles=(crate,))
    found = target_in_solid(scene_of(world))
    assert found is not None
    assert [one.setpoint for one in found.failures] == [1, 2]
    assert all("crate" in one.reason for one in found.failures)
    assert left_out(plan(skipping(world))) == [1, 2]


@pytest.mark.parametrize("start", [True, False])
@pytest.mark.parametrize("rules", MODES)
def test_floor_that_the_base_cannot_get_to(rules: dict[str, str], start: bool) -> None:
    beyond, here = ((2.6, 0.0, 0.3), (2.9, 0.0, 0.3)), (SPOTS[0], SPOTS[2], (0.4, 0.1, 0.3))
    world = replace(hall(beyond[0], *here, beyond[1], **rules), obstacles=(WALL,))
    if start:
        world = replace(world, start=Start(np.array([-0.7, 0.0, 0.0]), world.robot.carry))
    found = refused(world)
    assert found.verdict == "ladder-broken"
    assert [(one.setpoint, one.verdict) for one in found.failures] == [
        (0, "ladder-broken"),
        (4, "ladder-broken"),
    ]
    assert all("wall cuts it off" in one.reason for one in found.failures)
    assert left_out(plan(skipping(world))) == [0, 4]


def test_too_many_lift_offs_leave_nothing_out() -> None:
    world = skipping(replace(hall(*SPOTS, mode="stops", max_lift_offs=0), obstacles=()))
    found = refused(world)
    assert found.verdict == "ladder-broken"
    assert found.reason.startswith("Set-points 2 and 5 of 6 are left out.")
    assert [one.setpoint for one in found.failures] == OUT


# Files, checks and commands ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(skipping(hall(*SPOTS)))


def test_a_plan_file_says_what_is_left_out(made: Plan, tmp_path: Path) -> None:
    made.save(tmp_path / "plan.json")
    again = load_plan(tmp_path / "plan.json")
    assert plan_text(again) == plan_text(made)
    assert [(one.setpoint, one.verdict, one.reason) for one in again.skipped] == [
        (one.setpoint, one.verdict, one.reason) for one in made.skipped
    ]
    assert verify(again).ok


def test_a_plan_that_leaves_out_wrongly_does_not_hold(made: Plan) -> None:
    one, other = made.skipped
    strict = replace(made.world, rules=replace(made.world.rules, skip_unreachable=False))
    wrong = {
        "is not set": replace(made, world=strict),
        "each once": replace(made, skipped=(one, replace(other, setpoint=0))),
        "stats.order": replace(made, stats={**made.stats, "order": None}),
        "for no reason": replace(made, skipped=(one, replace(other, reason=""))),
    }
    for text, bad in wrong.items():
        violations = verify(bad).violations
        assert [found.kind for found in violations] == ["structure"], text
        assert text in violations[0].text
    near = replace(other, target=Target(np.array([1.2, 0.0, 0.3])))
    (violation,) = verify_areas(replace(made, skipped=(one, near))).violations
    assert "can be reached" in violation.text


def test_commands_say_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, made, page = (tmp_path / name for name in ("hall.json", "plan.json", "page.html"))
    path.write_text(json.dumps(world_to_document(hall(*SPOTS))))
    assert run(["plan", str(path), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert [one["setpoint"] for one in document["failures"]] == OUT
    assert run(["plan", str(path), "--skip", "--json", "-o", str(made), "--html", str(page)]) == 0
    told = capsys.readouterr()
    document = json.loads(told.out)
    assert [one["setpoint"] for one in document["skipped"]] == OUT
    assert "4 of 6 set-points within" in told.err
    assert "left out: set-points 2 and 5 of 6 cannot be reached" in told.err
    assert "Set-point 5 of 6 at (6.500" in told.err
    assert page.read_text().count("Set-point 5 of 6 at (6.500") == 1
    assert "left out: set-points 2 and 5 of 6 cannot be reached" in page.read_text()
    assert run(["verify", str(made), "--json"]) == 0
    told = capsys.readouterr()
    assert [one["setpoint"] for one in json.loads(told.out)["skipped"]] == OUT
    assert "the plan holds for 4 of 6 set-points" in told.err
    assert run(["verify", str(made), "--world", str(path)]) == 0
    assert "left out: set-points 2 and 5 of 6" in capsys.readouterr().err
    assert run(["stops", str(path), "--skip", "--json"]) == 0
    told = capsys.readouterr()
    assert [one["setpoint"] for one in json.loads(told.out)["skipped"]] == OUT
    assert "for 4 of 6 set-points" in told.err
    assert run(["stops", str(path), "--json"]) == 1
    assert [one["setpoint"] for one in json.loads(capsys.readouterr().out)["failures"]] == OUT


# Words -------------------------------------------------------------------------------------------------


def test_many_numbers_are_short() -> None:
    assert numbered([0], 3) == "Set-point 1 of 3"
    assert numbered([1, 2], 3) == "Set-points 2 and 3 of 3"
    every = numbered(range(0, 400, 2), 400)
    assert every.endswith("23 and 188 more of 400")
    assert numbered(range(400), 400) == "Set-points 1 to 400 of 400"


def test_in_any_order_set_points_are_named_as_given() -> None:
    told = Explanation("no-posture", 0, "Set-point 1 of 12 at (0, 0, 0) touches set-point 1 of 120")
    with pytest.raises(NoPlanFound) as no, naming_as_given((4, *range(4), *range(5, 12))):
        raise NoPlanFound(told)
    assert no.value.explanation.setpoint == 4
    assert str(no.value) == "Set-point 5 of 12 at (0, 0, 0) touches set-point 1 of 120"
