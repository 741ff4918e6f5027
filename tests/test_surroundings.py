"""Of maps with many blobs only those within reach are prepared, and answers stay the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.area_verification import verify_areas
from regionik.areas import surroundings
from regionik.areas.options import AREAS
from regionik.pipeline import plan, why
from regionik.planners.collision.convex_bodies import Piece, solid_pieces
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.values import Plan
from regionik.verification import arm_clearance
from regionik.verification.verifier import verify
from regionik.view.floor_view import shown_floor
from regionik.worlds.bundled import robot_named
from regionik.worlds.obstacles import Prism
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.shadows import Shadow
from tests import MINUTES
from tests.kinds import Solid
from tests.maths import Array


def speckled(task: tuple[Target, ...] = ()) -> World:
    """A floor of 60 x 60 m with 900 blobs two metres apart, and a ragged wall along all of it."""
    spots = np.stack(np.meshgrid(*[np.arange(-29.0, 30.0, 2.0)] * 2), axis=-1).reshape(-1, 2)
    blobs = [
        Prism(f"blob {k}", shapely.box(x, y, x + 0.05, y + 0.05), 0.0, 0.4) for k, (x, y) in enumerate(spots)
    ]
    x = np.linspace(-30.0, 30.0, 601)
    edge = 0.45 + 0.02 * np.sin(40 * x)
    outline = np.concatenate([np.column_stack([x, edge]), [[30.0, 0.6], [-30.0, 0.6]]])
    wall = Prism("wall", shapely.Polygon(outline), 0.0, 0.4)
    floor = Floor(shapely.box(-30, -30, 30, 30), (*blobs, wall))
    robot = robot_named("youbot")
    start = Start(np.array([0.3, -0.5, 0.0]), robot.carry)
    return World("speckled", robot, floor, (), task, Rules(clearance=0.05), start)


def test_answers_of_reach_stay_and_far_blobs_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    world, rng = speckled(), np.random.default_rng(3)
    targets = np.column_stack([rng.uniform(-1, 1, (9, 2)), rng.uniform(0.1, 0.7, 9)])
    looked, shadow = list[str](), Prism.shadow

    def looking(self: Prism, *heights: float) -> Shadow | None:
        looked.append(self.name)
        return shadow(self, *heights)

    with monkeypatch.context() as patch:
        patch.setattr(Prism, "shadow", looking)
        found = reach(world, targets)
    assert 0 < len(set(looked)) < 100
    monkeypatch.setattr(surroundings, "AREAS", replace(AREAS, min_cut_solids=10**9))
    whole = reach(speckled(), targets)
    assert found.verdict.tolist() == whole.verdict.tolist()
    assert found.reason == whole.reason
    assert np.allclose(found.base, whole.base, equal_nan=True, atol=1e-9)


def test_from_one_pose_only_what_is_near_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    world, pose = speckled(), np.array([0.3, -0.5, 0.0])
    targets = np.array([[x, y, 0.3] for x in (0.0, 0.3, 0.6) for y in (-0.3, 0.2, 0.6)])
    asked, distance = set[str](), Prism.distance

    def asking(self: Prism, point: Array) -> float:
        asked.add(self.name)
        return distance(self, point)

    with monkeypatch.context() as patch:
        patch.setattr(Prism, "distance", asking)
        found = reach(world, targets, base=pose)
    assert len(asked) < 100
    monkeypatch.setattr(surroundings, "AREAS", replace(AREAS, min_cut_solids=10**9))
    whole = reach(speckled(), targets, base=pose)
    assert found.verdict.tolist() == whole.verdict.tolist()
    assert found.reason == whole.reason
    assert found.reachable.any()


@pytest.mark.parametrize(
    ("target", "beside"),
    [
        ([0.0, 0.2, 1.0], ()),  # too high
        # The base cannot come near, for an obstacle or for what the map has there
        pytest.param([8.0, 8.0, 0.3], ("slab",), marks=MINUTES),
        pytest.param([-8.0, 8.0, 0.3], ("stain",), marks=pytest.mark.slow),
        ([31.5, 0.0, 0.3], ("slab",)),  # off the floor
    ],
)
def test_why_looks_at_what_is_near_alone_and_says_the_same(
    target: list[float], beside: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    world, looked, shadow = _with_slabs(), set[str](), Prism.shadow

    def looking(self: Prism, below: float, above: float) -> Shadow | None:
        looked.add(self.name)
        return shadow(self, below, above)

    monkeypatch.setattr(surroundings, "AREAS", replace(AREAS, min_cut_solids=50))
    with monkeypatch.context() as patch:
        patch.setattr(Prism, "shadow", looking)
        near = why(world, target)
    assert len(looked) < 50
    assert looked.issuperset(beside if target[0] < 30 else ())
    monkeypatch.setattr(surroundings, "AREAS", replace(AREAS, min_cut_solids=10**9))
    whole = why(_with_slabs(), target)
    assert near is not None
    assert near == whole
    assert near.causes
    assert near.repairs


def _with_slabs() -> World:
    """A speckled floor with two slabs of 2.4 m, too wide to reach over: an obstacle and a blob of the map."""
    world = speckled()
    few = (*world.floor.cells[:-1:9], world.floor.cells[-1])
    slab, stain = (
        Prism(name, shapely.box(x - 1.2, 6.8, x + 1.2, 9.2), 0.0, 0.2)
        for name, x in (("slab", 8.0), ("stain", -8.0))
    )
    floor = replace(world.floor, cells=(*few, stain))
    return replace(world, floor=floor, obstacles=(slab,))


def test_a_plan_is_verified_by_what_is_near_it_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    task = tuple(Target(np.array([x, 0.1, 0.3])) for x in (0.2, 0.4, 0.6))
    found = plan(speckled(task))
    cut, cutting = list[str](), solid_pieces

    def counting(solid: Solid) -> list[Piece]:
        cut.append(solid.name)
        return cutting(solid)

    world = replace(found.world, name="again")
    with monkeypatch.context() as patch:
        patch.setattr("regionik.planners.collision.distances.solid_pieces", counting)
        few = verify(replace(found, world=world))
        assert 0 < len(cut) < 100
        patch.setattr(arm_clearance, "SOLIDS", replace(arm_clearance.SOLIDS, min_many=10**9))
        whole = verify(replace(found, world=world))
    assert few.ok
    assert verify_areas(found).ok
    assert few.margins == whole.margins
    beside = Prism("post", shapely.Point(found.setpoints[1].base[:2]).buffer(0.2), 0.0, 0.4)
    blocked = replace(world, floor=replace(world.floor, cells=(*world.floor.cells, beside)))
    assert any("post" in one.text for one in verify(replace(found, world=blocked)).violations)


def test_of_a_long_wall_verification_cuts_what_is_near_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few other solids there are."""
    world = speckled(tuple(Target(np.array([x, 0.4, 0.3])) for x in (0.2, 0.3)))
    found = plan(replace(world, floor=replace(world.floor, cells=world.floor.cells[-9:])))
    cut, cutting = list[Piece](), solid_pieces

    def counting(solid: Solid) -> list[Piece]:
        pieces = cutting(solid)
        cut.extend(pieces if solid.name == "wall" else ())
        return pieces

    with monkeypatch.context() as patch:
        patch.setattr("regionik.planners.collision.distances.solid_pieces", counting)
        for plan_in in (replace(found, world=replace(world, name="again")), found):
            cut.clear()
            assert verify(plan_in).ok
            assert 0 < len(cut) < 60
    _same_violations_on_the_wall(found, monkeypatch)


def _same_violations_on_the_wall(found: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    again = replace(found, world=replace(found.world, floor=replace(found.world.floor)))
    for place in ([0.0, 0.5], [29.0, 0.5]):  # on the wall
        base = found.motion.base + [*(place - found.motion.base[0, :2]), 0.0]
        moved = replace(again, motion=replace(found.motion, base=base))
        near = verify(moved)
        monkeypatch.setattr(arm_clearance, "SOLIDS", replace(arm_clearance.SOLIDS, min_many=10**9))
        whole = verify(moved)
        monkeypatch.undo()
        assert {"arm", "clearance"} <= {one.kind for one in near.violations}
        assert [one.kind for one in near.violations] == [one.kind for one in whole.violations]


def test_what_is_left_out_is_out_of_reach_and_what_is_cut_is_cut_beyond_it() -> None:
    world = speckled((Target(np.array([0.0, 0.2, 0.3])),))
    near, path = scene_of(world).within_reach(np.array([[0.0, 0.2]])), scene_of(world).about_path()
    assert len(near.world.solids) < len(path.world.solids) < len(world.solids)
    assert {one.name for one in near.world.solids} < {one.name for one in world.solids}
    (wall,) = (one for one in near.floor.cells if one.name == "wall")
    x0, _, x1, _ = wall.polygon.bounds
    assert -8 < x0 < -1
    assert 1 < x1 < 8
    few = replace(world, floor=replace(world.floor, cells=world.floor.cells[:100]))
    assert scene_of(few).within_reach(np.zeros((1, 2))) is scene_of(few)


def test_a_plan_made_near_its_path_is_verified_in_the_whole_world() -> None:
    world = speckled(tuple(Target(np.array([x, 0.1, 0.3])) for x in (0.2, 0.4, 0.6)))
    found = plan(world)
    assert found.world is world or found.world.floor is world.floor
    assert verify(found).ok


def test_the_rejected_floor_of_a_speckled_map_is_drawn_blob_by_blob(monkeypatch: pytest.MonkeyPatch) -> None:
    """All at once it takes minutes."""
    world, simplify, asked = speckled(), shapely.simplify, list[int]()

    def simplifying(shape: Array, *rest: float) -> Array:
        asked.append(int(np.max(shapely.get_num_geometries(shape))))
        simple: Array = simplify(shape, *rest)
        return simple

    monkeypatch.setattr(shapely, "simplify", simplifying)
    rejected = shown_floor(world).rejected
    assert shapely.get_num_geometries(rejected) > 500
    assert max(asked) == 1
