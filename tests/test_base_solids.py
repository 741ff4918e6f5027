"""What stands on a base: cut off its block, kept off by the arm and off things, proven, written, drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh

from regionik.output.urdf import robot_to_urdf
from regionik.values import Motion
from regionik.view.world_picture import robot_meshes
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import BASE, LinkBox, LinkCapsule
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Target, World
from regionik.worlds.self_collision import BODY, self_collision_pairs
from regionik.worlds.urdf.bounding import convex_hull
from regionik.worlds.urdf.collision import base_shape
from regionik.worlds.urdf.decomposition import CollisionPart, mesh_part
from regionik.worlds.urdf.loader import load_robot
from tests.bodies import Guarded, motion_through
from tests.kinds import Solid
from tests.maths import Array, pose, translation
from tests.plans import Proof, far_off, proofs_of
from tests.urdfs import depth

PAINTER = Path(__file__).parent.parent / "examples" / "painter.urdf"
SQUARE = np.array([[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3]])
MAST = LinkBox(BASE, "mast", translation(-0.2, 0, 0.6), np.array([0.1, 0.1, 0.8]))
BEAM = Box("beam", np.array([0.1, 4.0, 0.2]), np.array([1.0, 0.0, 0.9]))
NO_SURFACE = np.empty((0, 3, 3))


def boom(turned: float = 0.0) -> Robot:
    """Two links that turn above a base, ahead of a mast that the outer one reaches."""
    joints = (
        Joint("turn", "revolute", -3.1, 3.1, np.eye(4)),
        Joint("bend", "revolute", -3.1, 3.1, translation(0.2, 0, 0)),
    )
    rods = [LinkCapsule(k, f"rod {k}", np.zeros(3), np.array([0.2, 0, 0]), 0.02) for k in (0, 1)]
    chain = Chain(joints, translation(0.2, 0, 0))
    mount = np.array([0.1, 0.0, 0.5, turned])
    return Robot("boom", "omni", SQUARE, mount, chain, tuple(rods), 0.2, np.zeros(2), base_solids=(MAST,))


def prove(robot: Robot, motion: Motion, *solids: Solid) -> tuple[Proof, ...]:
    return proofs_of(far_off(robot, *solids), motion, "arm", "self")


# --- pairs and questions


def test_the_mast_and_all_links_but_the_first() -> None:
    assert self_collision_pairs(boom()) == ((BODY, 1), (1, 2))
    bare = replace(boom(), footprint=np.zeros((1, 2)))
    assert self_collision_pairs(bare) == ((1, 2),)


def test_what_touches_the_mast_in_every_posture_is_built_that_way() -> None:
    robot = boom()
    tied = replace(robot, base_solids=(replace(MAST, size=np.array([2.0, 2.0, 0.8])),))
    assert self_collision_pairs(tied) == ((BODY, 1),)


@pytest.mark.parametrize("turned", [0.0, 0.7, -2.0])
def test_the_arm_keeps_off_the_mast(turned: float) -> None:
    robot = boom(turned)
    alone = Guarded(robot)
    open_, folded = np.array([-turned, 0.0]), np.array([-turned, 3.0])
    assert alone.nearest([1, 2, 0.3], open_, 0.02).kind == "none"
    proximity = alone.nearest([1, 2, 0.3], np.array([np.pi - turned, 0.0]))
    assert (proximity.kind, proximity.solid, proximity.other) == ("self", 1, 2)
    assert proximity.distance < 0
    assert "rod 1 overlaps mast" in alone.scene.collision.words(proximity)
    assert alone.nearest([1, 2, 0.3], folded).distance > 0
    swing = alone.stop([0, 0, 0], open_, [0, 0, 0], open_ + [3.0, 0])
    assert swing is not None
    assert (swing.kind, swing.other) == ("self", 2)


def test_the_distance_from_the_mast_is_that_of_the_solids() -> None:
    robot = boom(0.4)
    alone = Guarded(robot)
    rng = np.random.default_rng(0)
    met = 0
    for joints in rng.uniform(-3.1, 3.1, (200, 2)):
        T = robot.frames(np.zeros(3), joints)[1]
        line = (
            np.linspace(robot.solids[1].corners[0], robot.solids[1].corners[1], 2001) @ T[:3, :3].T + T[:3, 3]
        )
        off = np.abs(line - MAST.T_link_box[:3, 3]) - MAST.size / 2
        outside = np.linalg.norm(np.maximum(off, 0), axis=1).min() - 0.02
        proximity = alone.nearest(rng.uniform(-2, 2, 3), joints)
        if proximity.kind == "self" and outside > 0:
            assert proximity.distance == pytest.approx(outside, abs=1e-4)
            met += 1
    assert met > 20


def test_the_mast_keeps_off_what_the_base_drives_under() -> None:
    robot = boom()
    beam = Guarded(robot, BEAM)
    joints = np.array([0.0, 0.0])
    proximity = beam.nearest([1.2, 0, 0], joints)
    assert (proximity.kind, proximity.solid, proximity.other) == ("obstacle", 2, 0)
    assert proximity.distance == pytest.approx(-0.1)
    assert beam.nearest([1.05, 0, 0], joints).distance == pytest.approx(0.05)
    blocked = beam.stop([0, 0, 0], joints, [2, 0, 0], joints)
    assert blocked is not None
    assert (blocked.solid, blocked.other) == (2, 0)
    assert beam.stop([0, 0, 0], joints, [1.0, 0.4, 0], joints, 0.05) is None
    # Half a turn on the spot takes the mast from behind the arm under the beam.
    assert beam.stop([0.8, 0, 0], joints, [0.8, 0, 3.0], joints) is not None
    low = Guarded(replace(robot, base_solids=()), BEAM)
    assert low.stop([0, 0, 0], joints, [2, 0, 0], joints) is None


# --- proofs


def test_a_mast_that_meets_a_beam_between_two_states() -> None:
    robot = boom()
    drive = motion_through(np.array([[0.0, 0, 0], [2.4, 0, 0]]), np.zeros((2, 2)))
    arm, _ = prove(robot, drive, BEAM)
    assert [violation.state for violation in arm.violations] == [0]
    assert "mast overlaps beam" in arm.violations[0].text
    assert prove(replace(robot, base_solids=()), drive, BEAM)[0].violations == ()
    short = motion_through(np.array([[0.0, 0, 0], [1.0, 0.3, 0]]), np.zeros((2, 2)))
    clear, _ = prove(robot, short, BEAM)
    assert clear.violations == ()
    turn = motion_through(np.array([[0.8, 0, 0], [0.8, 0, 3.0]]), np.zeros((2, 2)))
    assert "mast" in prove(robot, turn, BEAM)[0].violations[0].text


def test_an_arm_that_runs_into_its_mast() -> None:
    robot = boom()
    still = np.zeros((2, 3))
    _, own = prove(robot, motion_through(still, np.array([[0.0, 0.0], [3.1, 0.0]])))
    assert {violation.kind for violation in own.violations} == {"self"}
    assert "rod 1 overlaps mast" in own.violations[0].text
    assert prove(robot, motion_through(still, np.array([[0.0, 0.0], [1.5, 0.0]])))[1].violations == ()


# --- cut from a URDF's elements


def block(x: float, y: float, low: float, high: float, size: float, name: str) -> CollisionPart:
    box = LinkBox(BASE, name, translation(x, y, (low + high) / 2), np.array([size, size, high - low]))
    return CollisionPart(BASE, name, box.corners, NO_SURFACE, box)


def test_a_base_is_cut_below_its_mast() -> None:
    parts = [block(0, 0, 0.1, 0.3, 0.6, "body"), block(-0.2, 0, 0.3, 1.2, 0.1, "mast")]
    base = base_shape(parts, None)
    assert base.height == pytest.approx(0.3)
    assert np.ptp(base.outline, axis=0) == pytest.approx([0.6, 0.6])
    assert [part.solid for part in base.parts] == [parts[1].exact]


def test_what_saves_little_or_covers_other_floor_is_not_cut() -> None:
    wide = [block(0, 0, 0.1, 0.3, 0.6, "body"), block(0, 0, 0.3, 0.5, 0.55, "deck")]
    mushroom = [block(0, 0, 0.0, 0.5, 0.2, "foot"), block(0, 0, 0.5, 0.55, 0.8, "hat")]
    for parts in (wide, mushroom):
        base = base_shape(parts, None)
        assert base.height == pytest.approx(max(part.points[:, 2].max() for part in parts))
        assert base.parts == ()


def test_a_height_that_is_given_is_where_it_is_cut() -> None:
    parts = [block(0, 0, 0.1, 0.3, 0.6, "body"), block(-0.2, 0, 0.3, 1.2, 0.1, "mast")]
    assert base_shape(parts, 1.2).parts == ()
    low = base_shape(parts, 0.2)
    assert {part.name for part in low.parts} == {"body", "mast"}
    assert np.ptp(low.outline, axis=0) == pytest.approx([0.6, 0.6])


@pytest.mark.parametrize("height", [None, 0.2, 0.55])
def test_nothing_of_a_base_is_left_out(height: float | None) -> None:
    mesh = trimesh.util.concatenate(
        [
            trimesh.creation.box((0.7, 0.5, 0.3), translation(0, 0, 0.2)),
            trimesh.creation.cylinder(0.08, 0.9, transform=pose([-0.2, 0.1, 0.8], [0, 0.1, 0])),
        ]
    )
    assert isinstance(mesh, trimesh.Trimesh)
    parts = [mesh_part(BASE, "frame", np.asarray(mesh.triangles)), block(0.2, 0, 0.3, 0.7, 0.1, "box")]
    base = base_shape(parts, height)
    rng = np.random.default_rng(0)
    inner = [np.asarray(box.vertices) for box in mesh.split()] + [parts[1].points]
    weights = [rng.dirichlet(np.full(len(v), 0.2), 500) for v in inner]
    points = np.concatenate([w @ v for w, v in zip(weights, inner, strict=True)])
    in_block = shapely.covers(shapely.Polygon(base.outline).buffer(1e-9), shapely.points(points[:, :2]))
    covered = in_block & (points[:, 2] <= base.height + 1e-9)
    for part in base.parts:
        covered |= depth(part.solid, points) < 1e-8
    assert covered.all()
    assert len(convex_hull(points)) > 8


def test_a_urdf_with_a_mast() -> None:
    robot = load_robot(PAINTER, tip="nozzle")
    assert robot.body_height == pytest.approx(0.28)
    assert [solid.name for solid in robot.base_solids] == ["base_link 2", "carriage"]
    assert all(solid.link == BASE for solid in robot.base_solids)
    low = load_robot(PAINTER, tip="nozzle", body_height=1.0)
    assert low.base_solids == ()
    given = load_robot(PAINTER, tip="nozzle", footprint=SQUARE, body_height=0.3)
    assert (given.body_height, given.base_solids) == (0.3, ())


# --- as a value, written and drawn


def test_solids_belong_to_links_that_are_there() -> None:
    for link in (BASE, 2):
        with pytest.raises(InputError, match=rf"^solids\[0\].link: expected a link from 0 to 1, got {link}"):
            replace(boom(), solids=(replace(MAST, link=link),))
    with pytest.raises(InputError, match=r"base_solids\[0\].link: expected link -1, got 0"):
        replace(boom(), base_solids=(replace(MAST, link=0),))


def test_documents_hold_what_stands_on_the_base() -> None:
    task = (Target(np.array([1.0, 0, 0.5])),)
    world = World("by hand", boom(), Floor(shapely.box(-9, -9, 9, 9)), (), task)
    document = world_to_document(world)
    again = world_from_document(document).robot
    assert world_to_document(replace(world, robot=again)) == document
    assert [solid.name for solid in again.base_solids] == ["mast"]
    assert np.array_equal(again.base_solids[0].corners, MAST.corners)
    assert [solid.link for solid in again.solids] == [0, 1]


@pytest.mark.filterwarnings("ignore:.*the tool point lies")
def test_it_is_drawn_and_exported(tmp_path: Path) -> None:
    robot = boom()

    def drawn(robot: Robot) -> dict[str, Array]:
        world = World("yard", robot, Floor(shapely.box(-5, -5, 5, 5)))
        return {body.path: body.mesh.vertices for body in robot_meshes(world, np.zeros(3), np.zeros(2))[0]}

    assert "robot/seen" not in drawn(replace(robot, base_solids=()))
    mast = drawn(robot)["robot/seen"]
    assert np.allclose([mast.min(0), mast.max(0)], [MAST.corners.min(0), MAST.corners.max(0)])
    path = tmp_path / "boom.urdf"
    path.write_text(robot_to_urdf(robot, shapely.box(-5, -5, 5, 5)))
    again = load_robot(path, root="base", tip="tool")
    assert again.body_height == pytest.approx(0.2)
    assert len(again.base_solids) == 1
    assert np.allclose(sorted(again.base_solids[0].corners.tolist()), sorted(MAST.corners.tolist()))
