"""One base pose for a path of full poses, and a long path by a driven arm, beside published figures."""

from __future__ import annotations

import statistics
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.bench_bstar import published, robot_of, solved, world_of
from benchmarks.page.outcomes import NOTHING, POSES, PROVEN, Job, Outcome, Side, Topic, planned
from regionik.worlds.scene import Rules, Target, World

ARMS, POSES_OF_A_PATH, PATHS = ("ur10e", "franka"), (4, 16), 5
EVERY = 16  # of the long path's poses, one
BSTAR = "B* (RA-L 2025), its authors' figures"
IKLINK = "IKLink, its README: base bolted down, all 767 poses"


def topic(data: Path | None) -> Topic:
    """Return paths of B* and IKLink; ``data`` holds `bstar` and `iklink`, without it ours are not run."""
    jobs = [
        Job(
            f"one place for a path of {count} poses, {PATHS} paths, {arm}, floor free",
            {"regionik": _run(data, partial(_one_stop, arm, count)), BSTAR: _bstar(count)},
        )
        for arm in ARMS
        for count in POSES_OF_A_PATH
    ]
    sides = {
        f"regionik, omnidirectional base, every {EVERY}th pose": _run(data, _long_path),
        IKLINK: Outcome(None, "2 reconfigurations", POSES),
    }
    jobs.append(Job("a path of 767 full poses, Panda", sides))
    about = (
        "Paths are those of the repositories `leiyaocui/B_STAR` (7fcea2e, Apache-2.0) and\n"
        "`uwgraphics/IKLink` (d2edc00, MIT); beside ours stands what their authors print, measured by them.\n"
        "B* prints 100 % of 2,400 paths solved, with a commercial solver. Ours also keeps links off each\n"
        "other all the way and gives a circle to park in."
    )
    return Topic("Where to stand for a path of full poses", about, jobs)


def _run(data: Path | None, work: Callable[[Path], Outcome]) -> Side:
    if data is None:
        return Outcome(None, "`make bench DATA=FOLDER` runs it, with their paths in FOLDER", NOTHING)
    return partial(work, data)


def _bstar(count: int) -> Outcome:
    return Outcome(None, f"one place each; {published(count):.2g} s a path", POSES)


def _one_stop(arm: str, count: int, data: Path) -> Outcome:
    robot, paths = robot_of(data / "bstar", arm), np.load(data / "bstar" / f"{arm}.npz")
    rows = [solved(world_of(robot, f"{arm} {k}", paths[f"{count}_{k}"])) for k in range(PATHS)]
    good = sum(not why for why, _ in rows)
    each = statistics.median(seconds for _, seconds in rows)
    return Outcome(time.process_time(), f"one place for {good} of {PATHS}; {each:.2g} s a path", PROVEN)


def _long_path(data: Path) -> Outcome:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = robot_of(data / "bstar", "franka")
    rows = np.loadtxt(data / "iklink" / "panda_767_poses.csv", delimiter=",", skiprows=1)[::EVERY]
    turns = Rotation.from_quat(rows[:, 4:]).as_matrix()
    task = tuple(Target(p, orientation=R, cone=1e-3) for p, R in zip(rows[:, 1:4], turns, strict=True))
    floor = world_of(robot, "", np.zeros((0, 7))).floor
    return planned(World("iklink", robot, floor, (), task, Rules(clearance=0.0, solid_floor=False)))
