"""FABRIK that goes round things: the paper's numbers, limits, all kinds of joints and links."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.clutter import body_of, distance_to, keeps_off
from regionik.planners.avoidance.avoiding_fabrik import (
    AvoidanceResult,
    avoid_obstacles,
    links_clear,
)
from regionik.planners.collision.robot_bodies import Bodies, ContactTargets, bodies_from
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule, capsules_along
from regionik.worlds.obstacles import Box, Cylinder, Sphere
from regionik.worlds.robot import Robot
from tests.kinds import Solid
from tests.maths import Array, rot_x, rot_y, translation

TOLERANCE = 1e-3
HERE = np.zeros(3)


def robot_of(chain: Chain, radius: float = 0.02, boxes: bool = False) -> Robot:
    """A chain on a point base; its links as capsules, or as boxes about as thick."""
    capsules = capsules_along(chain, radius)
    solids = tuple(_case(one) for one in capsules) if boxes else capsules
    return Robot("arm", "omni", np.zeros((1, 2)), np.zeros(4), chain, solids, 0.1, np.zeros(chain.dof))


def _case(capsule: LinkCapsule) -> LinkBox:
    """A box as long as a capsule's axis, askew about it."""
    along = capsule.end - capsule.start
    x = along / np.linalg.norm(along)
    y = np.cross(x, [0.31, 0.83, 0.47])
    y /= np.linalg.norm(y)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack([x, y, np.cross(x, y)]), (capsule.start + capsule.end) / 2
    size = np.array([np.linalg.norm(along), 1.6 * capsule.radius, 1.2 * capsule.radius])
    return LinkBox(capsule.link, capsule.name, T, size)


def planar(limit: float = np.inf) -> Chain:
    """Four unit links in the plane, as in Tao's experiments."""
    return Chain.from_dh([(0, 0, 1, 0, -limit, limit)] * 4)


def lift() -> Chain:
    """A slide up, a pivot, a slide out, and two hinges."""
    frames = [translation(0, 0, 0.2), np.eye(4), translation(0.2, 0, 0) @ rot_y(np.pi / 2)]
    frames += [translation(0, 0, 0.3) @ rot_x(np.pi / 2), translation(0.25, 0, 0)]
    kinds = ["prismatic", "revolute", "prismatic", "revolute", "revolute"]
    limits = [(0, 0.6), (-3, 3), (0, 0.4), (-2.4, 2.4), (-2.4, 2.4)]
    rows = zip(kinds, limits, frames, strict=True)
    joints = [Joint(f"j{k}", kind, *ends, T) for k, (kind, ends, T) in enumerate(rows)]  # type: ignore[arg-type]
    return Chain(tuple(joints), translation(0.25, 0, 0))


def circles(rng: np.random.Generator) -> list[Solid]:
    """Five posts between root and target."""
    return [
        Cylinder(f"c{k}", rng.uniform(0.1, 0.3), 4.0, np.array([*rng.uniform(0.3, 2.1, 2), 0.0]))
        for k in range(5)
    ]


def cases(rng: np.random.Generator, chain: Chain, count: int) -> tuple[list[Solid], Array]:
    """Boxes about an arm, off its root, and a target that some posture reaches."""
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    q = rng.uniform(lower, upper, (200, chain.dof))
    frames = chain.frames(q)
    reach = float(np.linalg.norm(frames[:, -1, :3, 3], axis=1).max())
    solids: list[Solid] = []
    while len(solids) < count:
        at = frames[rng.integers(200), rng.integers(1, chain.dof + 1), :3, 3]
        box = Box(f"box {len(solids)}", rng.uniform(0.1, 0.25, 3) * reach, at, rng.uniform(-3, 3))
        if box.distance(np.zeros(3)) > 0.25 * reach:
            solids.append(box)
    return solids, np.array(frames[0, -1, :3, 3])


def led(bodies: Bodies, target: Array, joints: Array, seed: int = 0) -> AvoidanceResult:
    clear = links_clear(bodies, HERE, target, 0.0)
    return avoid_obstacles(bodies.robot.chain, target, joints, clear, tolerance=TOLERANCE, seed=seed)


def is_clear(bodies: Bodies, joints: Array) -> bool:
    """Whether every link keeps out of every obstacle, by other means than the library's."""
    frames, solids = bodies.robot.frames(HERE, joints), bodies.robot.solids
    links = [body_of(solid, frames[solid.link]) for solid in solids]
    return all(keeps_off(link, distance_to(one)) for link in links for one in bodies.obstacles)


@pytest.mark.parametrize(
    ("chain", "boxes", "least"),
    [
        (planar(np.radians(150)), False, 16),
        (lift(), False, 5),
        (lift(), True, 5),
        (robot_named("youbot").chain, False, 10),
        (robot_named("youbot").chain, True, 10),
        (robot_named("dof10").chain, True, 18),
    ],
    ids=["limits", "lift", "lift-boxes", "youbot", "youbot-boxes", "dof10-boxes"],
)
def test_answers_are_clear_and_within_limits(chain: Chain, boxes: bool, least: int) -> None:
    solved, robot = 0, robot_of(chain, boxes=boxes)
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    for seed in range(25):
        rng = np.random.default_rng([3, seed])
        solids, target = cases(rng, chain, 6)
        if len(solids) and min(solid.distance(target) for solid in solids) < 0.05:
            continue
        bodies = bodies_from(robot, solids)
        found = led(bodies, target, rng.uniform(lower, upper), seed)
        assert (found.joints >= chain.lower).all()
        assert (found.joints <= chain.upper).all()
        if found.converged:
            solved += 1
            assert is_clear(bodies, found.joints)
            assert np.linalg.norm(chain.forward(found.joints)[:3, 3] - target) < TOLERANCE
    assert solved >= least


def test_same_seed_same_bits() -> None:
    bodies = bodies_from(robot_of(planar(), 1e-6), circles(np.random.default_rng(3)))
    target, start = np.array([2.8, 2.8, 0.0]), np.array([np.pi / 2, 0, 0, 0])
    one, same, other = (led(bodies, target, start, seed) for seed in (5, 5, 6))
    assert one.joints.tobytes() == same.joints.tobytes()
    assert (one.error, one.iterations) == (same.error, same.iterations)
    assert one.joints.tobytes() != other.joints.tobytes()


def test_what_the_tool_works_on_may_be_touched() -> None:
    ball = Sphere("ball", 0.1, np.array([0.4, 0.0, 0.3]))
    bodies = bodies_from(robot_named("youbot"), [ball], 0.0, 0.2)
    contact = ContactTargets(ball.center[None], np.array([0]), 0.05)
    there, below = translation(0.4, 0, 0.3), translation(0.4, 0, 0.3 - 0.2175)  # its tool in the middle
    assert contact.touchable(ball.center + [0.04, 0, 0]) == [0]
    assert contact.touchable(ball.center + [0.06, 0, 0]) == []
    assert contact.touchable(ball.center + [0.06, 0, 0], 0.02) == [0]
    assert not links_clear(bodies, HERE, ball.center, 0.0)(4, below)
    near = links_clear(bodies, HERE, ball.center, 0.0, contact)
    assert near(4, below)
    assert not near(4, there)
    shallow = bodies_from(robot_named("youbot"), [ball], 0.0, 0.03)
    assert not links_clear(shallow, HERE, ball.center, 0.0, contact)(4, below)
    assert not near(2, there)
    assert not links_clear(bodies, HERE, ball.center + [0.06, 0, 0], 0.0, contact)(4, below)
