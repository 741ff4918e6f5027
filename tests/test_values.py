"""Values made in Python and not by a file: each checks itself where it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh

from regionik.papers.comparison import Comparison, Score
from regionik.reachability.field import Field
from regionik.values import Answer, Report, Stop, Violation
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import Explanation, InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule, LinkMass
from regionik.worlds.obstacles import Box, Mesh, Prism
from regionik.worlds.scene import Target
from tests.plans import l_shape, synthetic_plan

YOUBOT, ONE, NONE = robot_named("youbot"), np.ones(3), np.zeros(3)
HINGE, FRAME = Joint("hinge", "revolute", -1.0, 1.0, np.eye(4)), np.eye(4)
BOW = shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])

REFUSED: dict[str, Callable[[], object]] = {
    "joint hinge: expected lower limit <= upper limit, got 2 and 1": lambda: replace(HINGE, lower=2.0),
    "joint hinge: axis must not be zero": lambda: replace(HINGE, axis=NONE),
    "chain: joint names must differ, got hinge twice": lambda: Chain((HINGE, HINGE), FRAME),
    "joints: expected 5 values, got shape (2,)": lambda: YOUBOT.chain.forward([0.0, 0.0]),
    "names: expected 1 joint names, got 2": lambda: Chain.from_dh([(0, 0, 1, 0, -1, 1)], names=("a", "b")),
    "dh[0]: expected theta, d, a, alpha, lower, upper, got 2 numbers": lambda: Chain.from_dh([(0, 0)]),
    "rod: radius must be above 0, got 0.0": lambda: LinkCapsule(0, "rod", NONE, ONE, 0.0),
    "case: size must be above 0, got [0.0, 0.0, 0.0]": lambda: LinkBox(0, "case", FRAME, NONE),
    "footprint: expected one point or at least three corners, got 2": lambda: replace(
        YOUBOT, footprint=np.eye(2)
    ),
    "body_height: must be above 0, got 0": lambda: replace(YOUBOT, body_height=0.0),
    "payload: must be at least 0, got -1": lambda: replace(YOUBOT, payload=-1.0),
    "masses[0].link: expected a link from 0 to 4, got 5": lambda: replace(
        YOUBOT, masses=(LinkMass(5, 1.0, NONE),)
    ),
    "mass: expected a finite number above 0, got 0.0": lambda: LinkMass(0, 0.0, NONE),
    "target: direction must not be zero": lambda: Target(ONE, NONE),
    "target: cone must be above 0 and at most pi, got 0.0": lambda: Target(ONE, ONE, 0.0),
    "crate: size must be above 0, got 0, 0, 0": lambda: Box("crate", NONE, ONE),
    "bow: polygon: expected an outline that does not cross or touch itself: Self-intersection": lambda: Prism(
        "bow", BOW, 0.0, 1.0
    ),
    "rock: mesh: expected rows of three of its 3 vertices": lambda: Mesh(
        "rock", CORNERS, np.array([[0, 1, 3]])
    ),
    "reed: mesh: expected rows of three of its 3 vertices": lambda: Mesh("reed", CORNERS, np.array([[0, 1]])),
    "void: mesh: expected triangles, got none": lambda: Mesh(
        "void", CORNERS, np.empty((0, 3), dtype=np.int64)
    ),
}


@pytest.mark.parametrize("said", REFUSED)
def test_a_value_that_cannot_be_says_what_was_expected(said: str) -> None:
    with pytest.raises(InputError) as refused:
        REFUSED[said]()
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)


def test_results_show_themselves_in_one_line() -> None:
    plan = synthetic_plan(l_shape())
    score = Score("dls", 9, 8, 3.0, 50.0, np.nan, 1e-4, 2e-3, 0, 1, 1)
    shown = {
        f"Plan(l_shape: {len(plan.setpoints)} set-points, ": plan,
        f"Motion({len(plan.motion)} states, ": plan.motion,
        "Configuration(x ": plan.setpoints[0],
        "PlannedArea(": plan.areas[0],
        "Stop(x 1.000 m, y 1.000 m, yaw 1.000 rad, 2 set-points, 0.05 m)": Stop(
            ONE, (0, 1), 0.05, "distance"
        ),
        "Report(ok, 1 margins)": Report(True, {"floor": 0.1}, ()),
        "Report(1 violations, the first: too near)": Report(
            False, {}, (Violation("floor", 0, None, 0.1, "too near"),)
        ),
        "Explanation(unreachable: too high [0 causes, 0 repairs])": Explanation(
            "unreachable", 0, "too\nhigh"
        ),
        "Answer(1 target: 1 reachable)": Answer(
            ONE[None],
            np.array([True]),
            np.array(["reachable"]),
            ONE[None],
            ONE[None],
            [""],
            NONE[:1],
            [""],
            [""],
        ),
        "Field(hall: 2 x 1 cells of 0.1 m, the best place reaches 1 of 1 targets, by areas alone)": Field(
            "hall",
            np.zeros(2),
            np.zeros(1),
            0.1,
            np.ones((1, 2), dtype=np.int32),
            1,
            np.zeros((1, 2)),
            l_shape(),
            ONE[None],
        ),
        "Comparison(hall: dls 8/9)": Comparison("hall", (score,), {}),
    }
    for start, value in shown.items():
        assert repr(value).startswith(start)
        assert len(repr(value).splitlines()) == 1
        assert len(repr(value)) < 120


def test_a_mesh_casts_the_shadow_of_all_its_faces() -> None:
    """Of some of these rings an overlay of faces without a grid loses whole ones."""
    rng = np.random.default_rng(1)
    for _ in range(150):
        ring = trimesh.creation.torus(rng.uniform(0.2, 0.5), rng.uniform(0.05, 0.15), 7, 7)
        ring.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        mesh = Mesh("ring", ring.vertices, ring.faces)
        low, high = mesh.z_range
        below = rng.uniform(low, high)
        shadow = mesh.shadow(below)
        assert shadow is not None
        points = rng.dirichlet(np.ones(3), (len(mesh.faces), 30)) @ mesh.vertices[mesh.faces]
        x, y, _ = points[points[..., 2] < below].T
        assert shapely.dwithin(shadow.core, shapely.points(x, y), 1e-8).all()
