"""The complete search: soundness of every bound it rests on, and its answers against dense sweeps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from regionik.planners.collision.distances import Obstacles, nearest_distance, obstacles_from
from regionik.planners.collision.upright_solids import least_along, signed_distance, uprights_from
from regionik.planners.search.box_search import Verdict
from regionik.planners.search.fixed_base import FixedBaseResult, search_fixed_base
from regionik.planners.search.motion_bounds import (
    chords,
    displacement,
    displacement_from_tool,
    link_capsules,
    longest_levers,
    tool_displacement,
)
from regionik.planners.search.posture_boxes import (
    NO_SELF_CLEARANCE,
    FixedBase,
    fixed_base_for,
    may_hold,
    place_arm,
)
from regionik.planners.solvers.serial_chain import chain_jacobian, serial_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule, capsules_along
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from tests import examples
from tests.kinds import Solid
from tests.maths import Array, rot_x, rot_y, translation

NOTHING = obstacles_from([])
SOLIDS: dict[str, Solid] = {
    "box": Box("box", np.array([0.5, 0.3, 0.4]), np.array([0.1, -0.1, 0.05]), 0.7),
    "post": Cylinder("post", 0.2, 0.6, np.array([0.02, 0.0, 0.1])),
    "plate": Cylinder("plate", 0.4, 0.05, np.zeros(3)),
    "ball": Sphere("ball", 0.3, np.array([0.1, 0.0, 0.0])),
    "prism": Prism("prism", Polygon([(-0.2, -0.1), (0.3, -0.2), (0.1, 0.3)]), -0.3, 0.1),
}
CUBE = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]])
CUBE = np.vstack([CUBE, [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]])


def planar(links: int = 4) -> Chain:
    """Unit links in the plane, joints without limits."""
    places = [translation(1.0 if k else 0.0, 0, 0) for k in range(links)]
    joints = [Joint(f"j{k}", "revolute", -np.inf, np.inf, T) for k, T in enumerate(places)]
    return Chain(tuple(joints), translation(1, 0, 0))


def lifted() -> Chain:
    """A torso lift, a pivot, a slide amid the arm, and joints about odd axes."""
    frames = [
        translation(0.1, 0, 0.2),
        rot_x(0.3),
        translation(0, 0.2, 0.1) @ rot_y(-0.7),
        translation(0.3, 0, 0),
    ]
    axes = [[0, 0, 1.0], [0, 0, 1.0], [1.0, 2.0, -1.0], [0, 1.0, 0]]
    verdicts = ["prismatic", "revolute", "revolute", "prismatic"]
    joints = [
        Joint(f"j{k}", verdicts[k], -1.0, 1.0, T, np.array(axis))  # type: ignore[arg-type]
        for k, (T, axis) in enumerate(zip(frames, axes, strict=True))
    ]
    return Chain(
        (*joints, Joint("j4", "revolute", -2.0, 3.0, translation(0.3, 0, 0))), translation(0.1, 0.2, 0.3)
    )


CHAINS = {"planar": planar(), "lifted": lifted(), "youbot": robot_named("youbot").chain}
SEEDS = st.integers(0, 10**6)


def box_round(chain: Chain, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """A box of joint values within the limits, and a posture in it."""
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    half = (upper - lower) * 10 ** rng.uniform(-4, 0) * rng.uniform(0, 0.5, chain.dof)
    centre = rng.uniform(lower + half, upper - half)
    at = rng.choice([-1.0, 1.0], chain.dof) if rng.random() < 0.5 else rng.uniform(-1, 1, chain.dof)
    return centre - half, centre + half, centre + at * half


def task_of(chain: Chain, obstacles: Obstacles, target: Array, tolerance: float = 1e-3) -> FixedBase:
    capsules, solids = link_capsules(chain, capsules_along(chain, 0.03)), uprights_from(obstacles.pieces)
    return fixed_base_for(serial_arm(chain), capsules, solids, target, tolerance, 0.0, NO_SELF_CLEARANCE)


def room_of(chain: Chain, solids: list[LinkCapsule], obstacles: Obstacles, q: Array) -> float:
    """Clearance by the collision checks that the search does not bound with."""
    frames = chain.frames(q)
    ends = [s.corners @ frames[s.link, :3, :3].T + frames[s.link, :3, 3] for s in solids]
    pairs = zip(solids, ends, strict=True)
    return min(nearest_distance(obstacles, a, b, s.radius) for s, (a, b) in pairs)


@settings(max_examples=examples(200))
@given(seed=SEEDS, name=st.sampled_from(sorted(SOLIDS)))
def test_signed_distance_is_that_of_the_solid(seed: int, name: str) -> None:
    solid = SOLIDS[name]
    flat = uprights_from(obstacles_from([solid]).pieces)
    point = np.random.default_rng(seed).uniform(-0.6, 0.6, 3)
    assert signed_distance(flat, 0, *point) == pytest.approx(solid.distance(point), abs=1e-12)


@settings(max_examples=examples(300))
@given(seed=SEEDS, name=st.sampled_from(sorted(SOLIDS)))
def test_least_along_is_the_least_of_samples(seed: int, name: str) -> None:
    rng, solid = np.random.default_rng(seed), SOLIDS[name]
    flat = uprights_from(obstacles_from([solid]).pieces)
    a, b = rng.uniform(-0.8, 0.8, (2, 3))
    grow = rng.uniform(-1, 1, 2) * rng.choice([0.0, 0.1, 2.0])
    shares = np.linspace(0, 1, 401)
    values = [solid.distance(a + t * (b - a)) + (1 - t) * grow[0] + t * grow[1] for t in shares]
    least = least_along(flat, 0, a, b, grow[0], grow[1], -np.inf, np.inf, 30)
    spacing = (np.linalg.norm(b - a) + abs(grow[1] - grow[0])) / 400
    assert min(values) - spacing <= least <= min(values) + 1e-6


@settings(max_examples=examples(300))
@given(seed=SEEDS, name=st.sampled_from(sorted(CHAINS)))
def test_no_point_moves_farther_than_told(seed: int, name: str) -> None:
    chain, rng = CHAINS[name], np.random.default_rng(seed)
    low, high, q = box_round(chain, rng)
    task = task_of(chain, NOTHING, np.zeros(3))
    arm, capsules, n = task.arm, task.capsules, chain.dof
    work = task.posed
    work.q[:], work.half[:] = (low + high) / 2, (high - low) / 2
    place_arm(task)
    chords(arm, work.half, work.chord)
    J = np.zeros((6, n))
    chain_jacobian(arm, work.frames, J)
    before, after = chain.frames(work.q), chain.frames(q)
    shift = after[n, :3, 3] - before[n, :3, 3]
    moved, bent = tool_displacement(arm, work.frames, work.axes, work.chord, work.half, capsules.levers[0])
    assert np.linalg.norm(shift) <= moved + 1e-12
    assert np.linalg.norm(shift - J[:3] @ (q - work.q)) <= bent + 1e-12
    for s, link in enumerate(capsules.link):
        for end in range(2):
            there = after[link, :3, :3] @ capsules.ends[s, end] + after[link, :3, 3]
            here, levers = work.ends[s, end], capsules.levers[1 + 2 * s + end]
            most = displacement(arm, work.frames, work.axes, work.chord, levers, link, 0, here)
            assert np.linalg.norm(there - here) <= most + 1e-12
            beside = np.linalg.norm(there - here - shift)
            tool = capsules.levers[0]
            assert (
                beside
                <= displacement_from_tool(arm, work.frames, work.axes, work.chord, tool, link, here) + 1e-12
            )


@settings(max_examples=examples(100))
@given(seed=SEEDS, name=st.sampled_from(sorted(CHAINS)))
def test_levers_bound_every_posture(seed: int, name: str) -> None:
    chain, rng = CHAINS[name], np.random.default_rng(seed)
    _, _, q = box_round(chain, rng)
    frames = chain.frames(q)
    point, link = rng.uniform(-0.3, 0.3, 3), int(rng.integers(chain.dof))
    levers, reach = longest_levers(chain, link, point)
    there = frames[link, :3, :3] @ point + frames[link, :3, 3]
    assert np.linalg.norm(there - chain.joints[0].T_parent_joint[:3, 3]) <= reach + 1e-12
    for k in range(link + 1):
        if chain.joints[k].kind == "revolute":
            off = np.cross(frames[k, :3, :3] @ chain.joints[k].axis, there - frames[k, :3, 3])
            assert np.linalg.norm(off) <= levers[k] + 1e-12


@settings(max_examples=examples(400))
@given(seed=SEEDS, name=st.sampled_from(sorted(CHAINS)))
def test_no_free_posture_is_ever_thrown_away(seed: int, name: str) -> None:
    chain, rng = CHAINS[name], np.random.default_rng(seed)
    low, high, q = box_round(chain, rng)
    knots = chain.frames(q)[:, :3, 3]
    scatter = 0.3 * np.ptp(knots, axis=0).max()
    solids: list[Solid] = []
    for k in range(4):
        middle = knots[rng.integers(len(knots))] + rng.normal(0, scatter, 3)
        size = scatter * rng.uniform(0.2, 1.5)
        solids += [
            Box(f"b{k}", rng.uniform(0.3, 1, 3) * size, middle, rng.uniform(0, 3)),
            Cylinder(f"c{k}", size / 2, size * 3, middle + scatter),
            Sphere(f"s{k}", size / 2, middle - scatter),
        ]
    links = list(capsules_along(chain, 0.03))
    free = [s for s in solids if room_of(chain, links, obstacles_from([s]), q) > 0]
    off = rng.normal(size=3)
    target = knots[-1] + 0.999e-3 * off / np.linalg.norm(off)
    task = task_of(chain, obstacles_from(free), target)
    kept_low, kept_high = low.copy(), high.copy()
    assert may_hold(task, kept_low, kept_high)
    assert (kept_low <= q + 1e-12).all()
    assert (q <= kept_high + 1e-12).all()
    assert (low <= kept_low).all()
    assert (kept_high <= high).all()


def circle_scene(test: int, seed: int) -> tuple[FixedBaseResult, Array, Array, float]:
    """Four links among five circles, after Tao et al."""
    target, corner = ((2.8, 2.5), (2.4, 2.1), (2.0, 1.7))[test]
    rng = np.random.default_rng(seed)
    middles, radii = rng.uniform(0.3, corner, (5, 2)), rng.uniform(0.1, 0.3, 5)
    posts = [Cylinder(f"c{k}", radii[k], 4.0, np.array([*middles[k], 0.0])) for k in range(5)]
    arm = planar()
    result = search_fixed_base(
        arm, capsules_along(arm, 1e-6), obstacles_from(posts), [target, target, 0], 1e-3
    )
    return result, middles, radii, target


def links_clear(knots: Array, middles: Array, radii: Array) -> Array:
    """Least distance of links between knots (..., 5, 2) from circles, (...)."""
    a, along = knots[..., :-1, None, :], np.diff(knots, axis=-2)[..., None, :]
    share = np.clip(((middles - a) * along).sum(-1) / (along * along).sum(-1), 0, 1)
    gaps = np.linalg.norm(a + share[..., None] * along - middles, axis=-1) - radii
    least: Array = gaps.min((-1, -2))
    return least


def swept(target: float, middles: Array, radii: Array) -> float:
    """Largest clearance on a grid of two angles of 1 degree, the other links bent either way."""
    turns = np.radians(np.arange(-180, 180, 1.0))
    ways = np.column_stack([np.cos(turns), np.sin(turns)])
    one, two = np.broadcast_arrays(ways[:, None], ways[:, None] + ways)
    keep = np.linalg.norm(target - two, axis=2) < 2.0
    one, two = one[keep], two[keep]
    gap = target - two
    half = np.linalg.norm(gap, axis=1, keepdims=True) / 2
    aside = np.sqrt(1 - half**2) / (2 * half) * np.column_stack([-gap[:, 1], gap[:, 0]])
    end = np.full_like(one, target)
    bent = [np.stack([0 * one, one, two, two + gap / 2 + e * aside, end], 1) for e in (-1, 1)]
    return float(links_clear(np.concatenate(bent), middles, radii).max())


@pytest.mark.parametrize("test", range(3))
def test_circles_are_decided_and_confirmed(test: int) -> None:
    verdicts = []
    for seed in (0, 1, 2, 3, 19, 20, 21) if test == 0 else range(4):
        result, middles, radii, target = circle_scene(test, seed)
        verdicts.append(result.verdict)
        if result.joints is None:
            assert result.verdict == Verdict.RULED_OUT
            assert result.clearance < 0
            assert swept(target, middles, radii) < 0
            continue
        turned = np.cumsum(result.joints)
        knots = np.vstack([np.zeros(2), np.cumsum(np.column_stack([np.cos(turned), np.sin(turned)]), 0)])
        assert np.linalg.norm(knots[-1] - target) <= 1e-3
        assert float(links_clear(knots, middles, radii)) == pytest.approx(result.clearance + 1e-6, abs=1e-9)
        assert result.clearance >= 0
    assert (Verdict.RULED_OUT in verdicts) == (test == 0)
    assert Verdict.PROVEN in verdicts


def box_scene(seed: int) -> tuple[list[Box], Array]:
    """Boxes in front of the arm, and a target among them."""
    rng = np.random.default_rng(seed)
    boxes = [
        Box(
            f"b{k}",
            rng.uniform(0.05, 0.3, 3),
            rng.uniform([0.15, -0.2, 0], [0.5, 0.2, 0.5]),
            rng.uniform(0, 3),
        )
        for k in range(4)
    ]
    while True:
        target = rng.uniform([0.2, -0.2, 0.05], [0.45, 0.2, 0.5])
        if min(box.distance(target) for box in boxes) > 0.04:
            return boxes, target


def pitch_sweep(chain: Chain, target: Array) -> Array:
    """Postures of the youBot arm that reach, every half degree of pitch, (n, 5)."""
    pitch = np.radians(np.arange(0, 360, 0.5))
    found = []
    for r, turn in ((np.hypot(*target[:2]), 0.0), (-np.hypot(*target[:2]), np.pi)):
        first = np.arctan2(target[1], target[0]) + turn
        x = r - 0.033 - 0.2175 * np.cos(pitch)
        z = target[2] - 0.147 - 0.2175 * np.sin(pitch)
        bend = (x * x + z * z - 0.155**2 - 0.135**2) / (2 * 0.155 * 0.135)
        ok = np.abs(bend) <= 1
        for side in (-1.0, 1.0):
            third = side * np.arccos(bend[ok])
            lead = np.arctan2(z[ok], x[ok])
            second = lead - np.arctan2(0.135 * np.sin(third), 0.155 + 0.135 * np.cos(third))
            fourth = pitch[ok] + np.pi / 2 - second - third
            found.append(np.column_stack([np.full(ok.sum(), first), second, third, fourth, 0 * third]))
    q = np.concatenate(found)
    middle = (chain.lower + chain.upper) / 2
    q = middle + (q - middle + np.pi) % (2 * np.pi) - np.pi
    q = q[((q >= chain.lower) & (q <= chain.upper)).all(1)]
    np.testing.assert_allclose(chain.forward(q)[:, :3, 3], np.broadcast_to(target, (len(q), 3)), atol=1e-9)
    return q


def sampled_room(solids: list[LinkCapsule], chain: Chain, boxes: list[Box], q: Array) -> Array:
    """Clearance of postures (n, dof) from boxes, by points 5 mm apart or less along the links."""
    frames, least = chain.frames(q), np.full(len(q), np.inf)
    for solid in solids:
        share = np.linspace(0, 1, 2 + int(np.linalg.norm(solid.end - solid.start) / 0.005))[:, None]
        spots = solid.start + share * (solid.end - solid.start)
        T = frames[:, solid.link]
        points = spots @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]
        for box in boxes:
            c, s = np.cos(box.yaw), np.sin(box.yaw)
            local = (points - box.center) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
            over = np.abs(local) - box.size / 2
            gap = np.linalg.norm(np.maximum(over, 0), axis=-1) + np.minimum(over.max(-1), 0)
            least = np.minimum(least, gap.min(1) - solid.radius)
    return least


def test_youbot_among_boxes_agrees_with_a_sweep_of_pitches() -> None:
    robot = robot_named("youbot")
    chain = robot.chain
    solids = [solid for solid in robot.solids if isinstance(solid, LinkCapsule)]
    verdicts = []
    for seed in range(12):
        boxes, target = box_scene(seed)
        result = search_fixed_base(chain, solids, obstacles_from(boxes), target, 1e-3)
        verdicts.append(result.verdict)
        q = pitch_sweep(chain, target)
        best = float(sampled_room(solids, chain, boxes, q).max()) if len(q) else -np.inf
        if result.joints is None:
            assert result.verdict == Verdict.RULED_OUT
            assert best < 1e-4  # of half the spacing, squared, over the radius
        else:
            room = float(sampled_room(solids, chain, boxes, result.joints[None])[0])
            assert -1e-9 <= result.clearance <= room + 1e-9
            assert (chain.lower <= result.joints).all()
            assert (result.joints <= chain.upper).all()
            assert np.linalg.norm(chain.forward(result.joints)[:3, 3] - target) <= 1e-3
            assert best > -5e-3  # half a degree and the tolerance move the links a few millimetres
    assert min(verdicts.count(Verdict.PROVEN), verdicts.count(Verdict.RULED_OUT)) >= 2


def test_target_out_of_reach_takes_no_box() -> None:
    result = search_fixed_base(planar(), [], NOTHING, [2.9, 2.9, 0], 1e-3)
    assert (result.verdict, result.boxes, result.joints) == (Verdict.RULED_OUT, 0, None)
    result = search_fixed_base(planar(), [], NOTHING, [0.5, 0.1, 0.01], 1e-3)
    assert (result.verdict, result.boxes) == (Verdict.RULED_OUT, 0)


@pytest.mark.parametrize(
    ("target", "verdict"), [([1.9995, 0, 0], Verdict.PROVEN), ([0.9, 0, 0], Verdict.RULED_OUT)]
)
def test_reach_alone(target: list[float], verdict: Verdict) -> None:
    rows = [(0, 0, 1, 0, -3, 3), (0, 0, 1, 0, -2, 2)]  # the elbow stops before the tool comes that near
    arm = Chain.from_dh(rows)
    assert search_fixed_base(arm, capsules_along(arm, 0.01), NOTHING, target, 1e-3).verdict == verdict


def test_no_solids_and_no_obstacles_leave_nothing_to_hit() -> None:
    post = obstacles_from([Cylinder("post", 5.0, 1.0, np.zeros(3))])
    for solids, about in (((), post), (capsules_along(planar(), 0.01), NOTHING)):
        result = search_fixed_base(planar(), solids, about, [1.0, 2.0, 0], 1e-3)
        assert (result.verdict, result.clearance) == (Verdict.PROVEN, np.inf)


@pytest.mark.parametrize(
    ("target", "at", "verdict"),
    [
        ([0.0, 1.0, 0.0], 3.0, Verdict.PROVEN),
        ([0.0, 1.1, 0.0], 3.0, Verdict.RULED_OUT),  # not on the circle
        ([-1.0, 0.0, 0.0], 3.0, Verdict.RULED_OUT),  # beyond the limit
        ([0.0, 1.0, 0.0], 0.5, Verdict.RULED_OUT),  # a ball on the link
    ],
)
def test_one_joint(target: list[float], at: float, verdict: Verdict) -> None:
    arm = Chain.from_dh([(0, 0, 1, 0, -2, 2)])
    ball = obstacles_from([Sphere("ball", 0.1, np.array([0.0, at, 0.0]))])
    assert search_fixed_base(arm, capsules_along(arm, 0.01), ball, target, 1e-3).verdict == verdict


def test_a_fixed_joint_and_a_slide() -> None:
    lift = Joint("lift", "prismatic", 0.0, 1.0, np.eye(4))
    held = Joint("held", "revolute", 0.5, 0.5, np.eye(4))
    arm = Chain((lift, held), translation(1, 0, 0))
    target = np.array([np.cos(0.5), np.sin(0.5), 0.3])
    assert search_fixed_base(arm, capsules_along(arm, 0.01), NOTHING, target, 1e-3).verdict == Verdict.PROVEN
    assert (
        search_fixed_base(arm, capsules_along(arm, 0.01), NOTHING, target + [0, 0, 0.8], 1e-3).verdict
        == Verdict.RULED_OUT
    )


def test_clearance_decides() -> None:
    arm = Chain.from_dh([(0, 0, 1, 0, -2, 2)])
    ball = obstacles_from([Sphere("ball", 0.1, np.array([0.5, 0.3, 0.0]))])
    links = capsules_along(arm, 0.05)  # the gap is 0.15
    assert search_fixed_base(arm, links, ball, [1, 0, 0], 1e-6, clearance=0.1499).verdict == Verdict.PROVEN
    assert search_fixed_base(arm, links, ball, [1, 0, 0], 1e-6, clearance=0.1501).verdict == Verdict.RULED_OUT


def test_budget_spent_is_told_and_the_same_question_has_the_same_answer() -> None:
    posts: list[Solid] = [Cylinder("c", 0.35, 4.0, np.array([1.4, 1.4, 0.0]))]
    posts += [Sphere("s", 0.3, np.array([2.0, 2.3, 0.0]))]
    arm = planar()
    links, about = capsules_along(arm, 1e-6), obstacles_from(posts)
    short = search_fixed_base(arm, links, about, [2.8, 2.8, 0], 1e-3, most=5)
    assert short.verdict == Verdict.OPEN
    assert short.boxes <= 6
    one, two = (search_fixed_base(arm, links, about, [2.8, 2.8, 0], 1e-3) for _ in range(2))
    assert (one.verdict, one.boxes, one.clearance) == (two.verdict, two.boxes, two.clearance)


def test_meshes_refuse_postures_but_prove_nothing() -> None:
    corners = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)])
    arm = Chain.from_dh([(0, 0, 1, 0, -2, 2)])
    links = capsules_along(arm, 0.01)
    on_link = obstacles_from([Mesh("mesh", corners + [0.5, 0, 0], CUBE)])
    aside = obstacles_from([Mesh("mesh", corners + [0.5, 0.6, 0], CUBE)])
    result = search_fixed_base(arm, links, on_link, [1, 0, 0], 1e-3, most=500)
    assert result.verdict == Verdict.OPEN
    assert result.clearance < 0
    assert search_fixed_base(arm, links, aside, [1, 0, 0], 1e-3).clearance == pytest.approx(0.39, abs=0.002)


LIFT = Chain((Joint("lift", "prismatic", 0.0, np.inf, np.eye(4)),), translation(1, 0, 0))
CAPSULE = LinkCapsule(7, "seventh", np.zeros(3), np.ones(3), 0.1)
BOX = LinkBox(0, "body", np.eye(4), np.ones(3))


@pytest.mark.parametrize(
    ("chain", "solids", "target", "options", "words"),
    [
        (planar(), [], [1, 2], {}, "target: expected 3 numbers"),
        (planar(), [], [1, 2, np.nan], {}, "target: every number must be finite"),
        (planar(), [], [1, 2, 0], {"tolerance": 0.0}, "tolerance: expected a length above 0"),
        (planar(), [], [1, 2, 0], {"tolerance": np.nan}, "tolerance: expected a length above 0"),
        (planar(), [], [1, 2, 0], {"clearance": -0.1}, "clearance: expected a length of 0 or more"),
        (planar(), [], [1, 2, 0], {"most": 0}, "most: expected at least one box"),
        (LIFT, [], [1, 0, 1], {}, "joint lift: a sliding joint needs limits"),
        (planar(), [CAPSULE], [1, 2, 0], {}, "seventh: link must be 0 to 3, got 7"),
        (planar(), [BOX], [1, 2, 0], {}, "body: expected a capsule"),
    ],
)
def test_bad_input_is_one_line(chain, solids, target, options, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=words):
        search_fixed_base(chain, solids, NOTHING, target, **{"tolerance": 1e-3, **options})
