"""One place of the base for a path of full poses: on paths of B* (RA-L 2025), which has one for each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

import regionik as rik
from regionik.worlds.chain import Chain
from regionik.worlds.links import capsules_along
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests.harness.rasters import TOOL, UR10E

TOLERANCE, CONE = 1e-5, 1e-3  # as there [m], [rad]
PATHS = np.loadtxt(Path(__file__).parent / "data" / "bstar_ur10e.csv", delimiter=",", skiprows=1)


@pytest.mark.parametrize("path", range(6))
def test_one_stop_serves_a_path_of_sixteen_poses(path: int) -> None:
    turn, length, *wrist = UR10E[-1]
    chain = Chain.from_dh([*UR10E[:-1], (turn, length - TOOL, *wrist)])
    robot = Robot(
        name="UR10e", base="omni", footprint=np.zeros((1, 2)), mount=np.zeros(4), chain=chain,
        solids=capsules_along(chain, 0.03),
    )  # fmt: skip
    rows = PATHS[PATHS[:, 0] == path]
    turns = Rotation.from_quat(rows[:, [5, 6, 7, 4]]).as_matrix()
    task = tuple(Target(p, orientation=R, cone=CONE) for p, R in zip(rows[:, 1:4], turns, strict=True))
    rules = Rules(mode="stops", tolerance=TOLERANCE, solid_floor=False)  # B* knows no floor
    floor = Floor(shapely.box(-3.0, -3.0, 3.0, 3.0))
    found = rik.plan(World(f"path {path}", robot, floor, (), task, rules))
    assert len(found.stops) == 1
    assert found.stats["largest_error"] <= TOLERANCE
    assert rik.verify(found).ok
