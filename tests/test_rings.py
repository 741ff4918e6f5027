from dataclasses import replace

import numpy as np
import pytest

from regionik.planners.reach.rings import (
    FREE,
    boundary_circles,
    reach_intervals,
    reach_spans,
    turning_heights,
)
from regionik.planners.solvers.planar_kinematics import PlanarLinkage, critical_posture
from regionik.worlds.arms import planar_arm
from regionik.worlds.bundled import robot_named

ARM = planar_arm(robot_named("youbot").chain)
Z = float(ARM.shoulder[1])
PLANE = PlanarLinkage(float(ARM.shoulder[0]), Z, ARM.lengths, ARM.lower, ARM.upper)

# Reach of the youBot arm with limits, found on a 2 mm grid of postures: height, free pitch, last link
# horizontal, last link down; intervals of r in mm.
TABLE: list[tuple[float, list[tuple[float, float]], list[tuple[float, float]], list[tuple[float, float]]]] = [
    (0, [(-387, 507)], [], [(-241, 5), (85, 313)]),
    (50, [(-419, 525)], [(373, 499)], [(-223, 25), (41, 289)]),
    (100, [(-441, -27), (93, 537)], [(93, 183), (353, 531)], [(-161, -37), (103, 227)]),
    (147, [(-453, -43), (113, 539)], [(141, 175), (339, 539)], []),
    (200, [(-459, -37), (123, 537)], [(321, 535)], []),
    (250, [(-457, -19), (121, 529)], [(241, 521)], []),
    (300, [(-447, 15), (107, 515)], [(213, 495)], []),
    (350, [(-431, 497)], [(85, 457)], []),
    (400, [(-405, 471)], [(125, 391)], []),
    (450, [(-373, 439)], [], []),
    (500, [(-331, 397)], [], []),
    (550, [(-275, 341)], [], []),
    (600, [(-195, 261)], [], []),
    (650, [(-33, 99)], [], []),
]  # fmt: skip


def joined(intervals: np.ndarray) -> list[tuple[float, float]]:
    """Intervals with the split at the axis undone, in mm."""
    out: list[tuple[float, float]] = []
    for low, high in (intervals * 1000).tolist():
        if out and abs(out[-1][1] - low) < 1e-6:
            out[-1] = (out[-1][0], high)
        else:
            out.append((low, high))
    return out


@pytest.mark.parametrize("column", [1, 2, 3])
def test_reach_of_the_youbot(column: int) -> None:
    pitches = {1: FREE, 2: (0.0, 0.0), 3: (-np.pi / 2, -np.pi / 2)}[column]
    for height, *columns in TABLE:
        found = joined(reach_intervals(ARM, Z, np.array([height / 1000]), pitches)[0])
        expected = columns[column - 1]
        assert len(found) == len(expected), height
        np.testing.assert_allclose(np.reshape(found, (-1, 2)), np.reshape(expected, (-1, 2)), atol=2.0 + 0.5)


@pytest.mark.parametrize("pitches", [FREE, (0.0, 0.0), (-1.0, -1.0), (-0.5, 0.5), (2.0, 3.5)])
def test_every_end_of_the_reach_is_sharp(pitches: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    args = (PLANE, *pitches)
    for z in rng.uniform(-0.3, 0.7, 60):
        intervals = reach_intervals(ARM, Z, np.array([z]), pitches)[0]
        for r in rng.uniform(-0.6, 0.6, 50):
            inside = any(low < r < high for low, high in intervals)
            if min((abs(r - end) for end in intervals.ravel()), default=1.0) > 1e-9:
                assert critical_posture(*args, r, z)[0] == inside


def test_sampled_postures_lie_within_the_reach() -> None:
    rng = np.random.default_rng(4)
    bends = rng.uniform(ARM.lower, ARM.upper, (3000, 3))
    angles = np.cumsum(bends, axis=1)
    r = ARM.shoulder[0] + np.cos(angles) @ ARM.lengths
    z = Z + np.sin(angles) @ ARM.lengths
    for interval, spot in zip(reach_intervals(ARM, Z, z), r, strict=True):
        assert any(low - 1e-9 <= spot <= high + 1e-9 for low, high in interval)


def test_a_band_of_pitches_is_the_union_of_its_pitches() -> None:
    rng = np.random.default_rng(6)
    args = (PLANE,)
    for r, z in rng.uniform([-0.6, -0.2], [0.6, 0.7], (400, 2)):
        band = critical_posture(*args, -0.4, 0.3, r, z)[0]
        each = [critical_posture(*args, pitch, pitch, r, z)[0] for pitch in np.linspace(-0.4, 0.3, 141)]
        assert band >= any(each)
        if band and not any(each):  # only a sliver between two pitches may differ
            fine = np.linspace(-0.4, 0.3, 20001)
            assert any(critical_posture(*args, pitch, pitch, r, z)[0] for pitch in fine)


def test_boundary_circles_hold_the_stretched_arm() -> None:
    circles = boundary_circles(ARM, Z)
    assert np.isclose(circles[:, 2], ARM.lengths.sum()).any()


@pytest.mark.parametrize("pitches", [FREE, (0.0, 0.0), (-1.0, -1.0), (-0.5, 0.5), (2.0, 3.5)])
@pytest.mark.parametrize("seed", range(3))
def test_many_heights_have_the_reach_of_each(pitches: tuple[float, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, sides = ARM, [(True, True), (True, False), (False, True)][seed]
    if seed:  # other limits, so that other circles bound the reach
        limits = np.sort(rng.uniform(-3, 3, (2, 3)), axis=0)
        arm = replace(ARM, lower=limits[0], upper=limits[1])
    turns = turning_heights(boundary_circles(arm, 0.1, pitches))
    heights = np.concatenate([rng.uniform(-1, 1, 600), turns, turns + 2e-6, turns - 2e-6, turns + 5e-5])
    heights = np.append(rng.choice(heights, 400), rng.uniform(0.2, 0.3, 400))
    owner, spans = reach_spans(arm, 0.1, heights, pitches, front=sides[0], back=sides[1])
    assert (np.diff(owner) >= 0).all()
    for k, z in enumerate(heights.tolist()):
        _, alone = reach_spans(arm, 0.1, np.array([z]), pitches, front=sides[0], back=sides[1])
        np.testing.assert_allclose(spans[owner == k], alone, rtol=0, atol=1e-9)
