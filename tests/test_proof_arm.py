"""Links that are boxes, and chains of any joints, against solids: planted faults, near misses, samples."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon

from regionik.values import Motion
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from tests.bodies import motion_through, random_robot, signed_distance
from tests.kinds import LinkSolid, Solid
from tests.maths import Array, translation
from tests.plans import Proof, far_off, proofs_of

CIRCLE = np.linspace(0, 2 * np.pi, 96, endpoint=False)
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def check(robot: Robot, motion: Motion, *solids: Solid, clearance: float = 0.0) -> Proof:
    world = far_off(robot, *solids, arm_clearance=clearance, tool_contact=0.001, solid_floor=False)
    return proofs_of(world, motion, "arm")[0]


def crane(*solids: LinkSolid) -> Robot:
    """Turns about the vertical, then slides outwards."""
    joints = (
        Joint("turn", "revolute", -9, 9, translation(0, 0, 0.5)),
        Joint("slide", "prismatic", 0, 2, np.eye(4), np.array([1.0, 0, 0])),
    )
    chain = Chain(joints, np.eye(4))
    return Robot("crane", "omni", np.zeros((1, 2)), np.zeros(4), chain, solids, 0.1, np.zeros(2))


def paddle(size: float = 0.2) -> LinkBox:
    """A square that turns about one of its corners, its diagonal along x."""
    c = np.sqrt(0.5)
    T = translation(size * c, 0, 0) @ np.array([[c, -c, 0, 0], [c, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    return LinkBox(1, "paddle", T, np.array([size, size, 0.1]))


def moving(*joints: tuple[float, float]) -> Motion:
    return motion_through(np.zeros((len(joints), 3)), np.array(joints))


@pytest.mark.parametrize("gap", [-0.01, -1e-5, 0.0, 1e-5, 0.01])
@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere", "prism", "mesh"])
def test_a_box_that_sweeps_past_a_solid_between_two_states(kind: str, gap: float) -> None:
    near = 0.2 * np.sqrt(2) + 0.3 + gap  # the paddle is slid out by 0.3
    solids: dict[str, Solid] = {
        "box": Box("other", np.array([0.2, 0.01, 0.02]), np.array([near + 0.1, 0, 0.5])),
        "cylinder": Cylinder("other", 0.1, 0.02, np.array([near + 0.1, 0, 0.5])),
        "sphere": Sphere("other", 0.1, np.array([near + 0.1, 0, 0.5])),
        "prism": Prism("other", Polygon([(near, 0), (near + 0.1, -0.1), (near + 0.1, 0.1)]), 0.49, 0.51),
        "mesh": Mesh(
            "other",
            np.array([[0, 0, 0], [0.1, 0.1, 0], [0.1, -0.1, 0.0], [0.1, 0, 0.1]]) + [near, 0, 0.5],
            TETRAHEDRON[:, ::-1],
        ),
    }
    found = check(crane(paddle()), moving((-0.9, 0.3), (0.6, 0.3)), solids[kind])
    assert bool(found.violations) == (gap < 0)
    for violation in found.violations:
        assert violation.state == 0
        assert "between states 1 and 2" in violation.text
        # Two sharp corners meet for less than a ten thousandth of the hop when they are a hair deep.
        assert "paddle overlaps other by" in violation.text or gap > -1e-4


def test_a_box_that_slides_through_a_thin_plate() -> None:
    plate = Box("plate", np.array([0.002, 1.0, 1.0]), np.array([1.0, 0, 0.5]))
    through = moving((0.0, 0.3), (0.0, 1.5))
    assert "between" in check(crane(paddle()), through, plate).violations[0].text
    assert check(crane(paddle()), moving((0.0, 0.3), (0.0, 0.7)), plate).violations == ()
    assert check(crane(paddle()), moving((0.0, 0.3), (0.0, 0.7)), plate, clearance=0.02).violations


@pytest.mark.parametrize(("depth", "holds"), [(1e-7, True), (1e-5, False), (0.02, False), (0.15, False)])
def test_a_box_that_cuts_a_mesh_is_as_deep_as_it_must_shrink(depth: float, holds: bool) -> None:
    """At rest as on the way: the surfaces cross, so they are no distance apart."""
    tip = 0.2 * np.sqrt(2)
    wall = Box("wall", np.array([0.5, 2.0, 0.9]), np.array([tip + 0.25 - depth, 0, 0.5]))
    x, z = (0.5 * wall.size[k] * np.array([-1, 1]) + wall.center[k] for k in (0, 2))
    corners = np.array([[a, b, c] for a in x for b in (-1.0, 1.0) for c in z])
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
        + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )
    mesh = Mesh("wall", corners, faces)
    still = moving((0.0, 0.0), (0.0, 0.0))
    for solid, most in ((wall, 1.0), (mesh, 0.05)):  # the paddle is 0.1 thick
        found = check(crane(paddle()), still, solid)
        assert (not found.violations) == holds
        assert found.margin == pytest.approx(-min(depth, most), rel=0.5)
    deep = check(crane(paddle()), moving((0.0, 0.9), (0.0, 0.9)), Mesh("wall", corners * [3, 3, 1], faces))
    assert "overlaps wall" in deep.violations[0].text


def test_a_small_mesh_within_a_box() -> None:
    pebble = Mesh(
        "pebble", np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.01 + [0.14, 0, 0.5], TETRAHEDRON
    )
    found = check(crane(paddle()), moving((0.0, 0.0)), pebble)
    assert found.margin < -0.02


def test_margin_of_a_box_is_its_distance() -> None:
    tip = 0.2 * np.sqrt(2)
    ball = Sphere("ball", 0.1, np.array([tip + 0.13, 0, 0.5]))
    assert check(crane(paddle()), moving((0.0, 0.0)), ball).margin == pytest.approx(0.03, abs=1e-9)
    assert check(crane(paddle()), moving((0.0, 0.0)), ball, clearance=0.01).margin == pytest.approx(0.02)


# Against samples


def random_solid(rng: np.random.Generator, k: int) -> Solid:
    center = rng.uniform(-0.3, 0.3, 3)
    match k % 4:
        case 0:
            return Box("solid", rng.uniform(0.01, 0.4, 3), center, rng.uniform(-3, 3))
        case 1:
            return Cylinder("solid", rng.uniform(0.02, 0.2), rng.uniform(0.02, 0.4), center)
        case 2:
            return Sphere("solid", rng.uniform(0.02, 0.2), center)
        case _:
            corners = rng.uniform(-0.3, 0.3, (3, 2)) + center[:2]
            return Prism("solid", Polygon(corners), center[2], center[2] + 0.2)


def hull(solid: Solid) -> tuple[Array, float]:
    """Corners within the solid, and the radius round them; of a cylinder, those of a prism in it."""
    match solid:
        case Sphere():
            return solid.center[None], solid.radius
        case Cylinder():
            outline = solid.center[:2] + solid.radius * np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)])
        case Box():
            c, s = np.cos(solid.yaw), np.sin(solid.yaw)
            level = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * solid.size[:2] / 2
            outline = level @ np.array([[c, s], [-s, c]]) + solid.center[:2]
        case Prism():
            outline = np.asarray(solid.polygon.exterior.coords)[:-1]
        case _:
            raise NotImplementedError(solid)
    return np.vstack([np.column_stack([outline, np.full(len(outline), z)]) for z in solid.z_range]), 0.0


def sampled_gap(robot: Robot, motion: Motion, solid: Solid, samples: int) -> float:
    corners, radius = hull(solid)
    s = np.linspace(0, 1, samples)
    joints = motion.joints[0] + s[:, None] * (motion.joints[1] - motion.joints[0])
    frames = robot.frames(robot.drive.between(motion.base[0], motion.base[1], s), joints)
    least = np.inf
    for part in robot.solids:
        placed = (
            part.corners @ frames[:, part.link, :3, :3].swapaxes(1, 2) + frames[:, part.link, None, :3, 3]
        )
        gaps = [signed_distance(corners, own) - radius - part.radius for own in placed]
        least = min(least, *gaps)
    return least


def test_ok_is_never_contradicted_by_samples() -> None:
    """Nor is a violation told where samples find room."""
    rng = np.random.default_rng(15)
    told = {True: 0, False: 0}
    for k in range(60):
        robot, solid = random_robot(rng, 2, 0.2), random_solid(rng, k)
        base = rng.normal(scale=0.2, size=(2, 3)) * [[1], [rng.choice([0.0, 1.0])]]
        motion = motion_through(base, np.cumsum(rng.normal(scale=0.3, size=(2, 2)), axis=0))
        found = check(robot, motion, solid)
        gap = sampled_gap(robot, motion, solid, 15)
        told[not found.violations] += 1
        if not found.violations:
            assert gap >= -2e-6
        else:
            assert gap < 0.03  # the samples are so far apart
            assert not any("not proven" in v.text for v in found.violations)
            assert -gap >= max(v.amount for v in found.violations if "at state" in v.text or gap < 0) - 1e-3
    assert min(told.values()) >= 7
