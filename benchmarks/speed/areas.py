"""Areas, planning stages, base paths and how they grow: rows of the table of speeds."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely
from shapely.geometry import Polygon

from benchmarks.bench_areas import crowded, loop
from benchmarks.bench_drive import MAPS, STEP, clutter, length, shortest
from benchmarks.speed.harness import Row, Rows, Size, Spread, Wanted, Work, against, counted, timed
from regionik.mfabrik import configurations
from regionik.motion import connect_setpoints
from regionik.moving.drivers import driver_for
from regionik.moving.transit import MAX_ITERATIONS, TransitPlanner, WholeBodyPlanner
from regionik.pipeline import search
from regionik.planners.driving.point_planner import drive_point
from regionik.postures.families import FRONT
from regionik.postures.poses import Pose
from regionik.pruning import choose_chain, solvers_along, start_place, start_pose, whole_path
from regionik.regions import path_areas
from regionik.scene import scene_of
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Target, World

PAPER = 9e-3  # of M-FABRIK's paper for one set-point of its L-shaped path, on its authors' machine [s]
FEW = 5  # rounds of what takes seconds
LONG = 40.0  # of what takes longer, one call does [s]
PLANNING = """
import resource, sys, time
from benchmarks.speed.areas import meander
from regionik.pipeline import search
from regionik.scene import scene_of
search(scene_of(meander(100, 100)))
begun = time.process_time()
search(scene_of(meander(int(sys.argv[1]), 100)))
print(time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)
"""


def rows(size: Size) -> Iterator[Row]:
    """See `benchmarks.speed.__main__`."""
    few = replace(size, rounds=min(size.rounds, FEW))
    groups: tuple[tuple[Rows, Size], ...] = (
        (_areas, few), (_path, size), (_jump, size), (_lengths, few), (_growth, few), (_commands, few)
    )  # fmt: skip
    for group, much in groups:
        yield from group(much)


def _areas(size: Size) -> Iterator[Row]:
    """Areas of a long path, against a loop over its set-points."""
    world = crowded(size.count(10_000), size.count(1000))
    what = f"areas of {len(world.task):,} set-points among {len(world.obstacles):,} obstacles"
    rival = "shapely, one set-point after the other, STRtree"
    count = len(world.task)

    def plain() -> object:
        return loop(world)

    def bulk() -> object:
        return path_areas(scene_of(world), facings=(FRONT,))

    yield against(f"{what}, polygons", rival, bulk, plain, Wanted(2.0), size, pieces=(count, count))


def _path(size: Size) -> Iterator[Row]:
    """The stages of a whole plan, per set-point."""
    world = load_world("l_shape")
    count = len(world.task)
    whole = timed("", "", lambda: search_stages(world), None, size)
    each = _each(whole.figure, count)
    paper = Spread(PAPER / each.median, PAPER / each.high, PAPER / each.low, each.rounds)
    shares = ", ".join(f"{name} {share:.0%}" for name, share in _stages(world).items())
    yield Row(
        "areas, pruning, IK and motion of l_shape, one set-point",
        "9 ms, as the paper has it",
        each,
        Spread(PAPER, PAPER, PAPER, 1),
        paper,
        Wanted(20.0),
        f"the time goes to {shares}",
    )


def _each(spread: Spread | None, count: int) -> Spread:
    assert spread is not None
    return Spread(spread.median / count, spread.low / count, spread.high / count, spread.rounds)


def search_stages(world: World) -> dict[str, float]:
    """Areas, pruning, configurations and motion, each with its seconds."""
    marks = [time.perf_counter()]
    free_space, _, pruned = whole_path(scene_of(world))
    marks.append(time.perf_counter())
    chain = choose_chain(pruned, free_space, start_place(scene_of(world)))
    start = start_pose(scene_of(world), pruned, chain[0])
    configurations(world.task, solvers_along(scene_of(world), pruned.ladder, free_space, chain), start)
    marks.append(time.perf_counter())
    connect_setpoints(scene_of(world), pruned, free_space, 0)
    marks.append(time.perf_counter())
    names = ("areas and pruning", "configurations", "motion")
    return dict(zip(names, np.diff(marks).tolist(), strict=True))


def _stages(world: World) -> dict[str, float]:
    spent = [search_stages(world) for _ in range(5)]
    medians = {name: statistics.median(one[name] for one in spent) for name in spent[0]}
    return {name: value / sum(medians.values()) for name, value in medians.items()}


def _jump(size: Size) -> Iterator[Row]:
    """The way of base and arm with the tool lifted, by stages and in the space of the whole robot."""
    world = load_world("pillar")
    found = search(scene_of(world))
    motion, kinds = found.motion, np.array(found.motion.kind)
    first = int(np.argmax(kinds == "setpoint"))
    lifted = np.flatnonzero((kinds == "transit") & (np.arange(len(kinds)) > first))
    runs = np.split(lifted, np.flatnonzero(np.diff(lifted) > 1) + 1)
    run = max(runs, key=lambda one: world.robot.drive.travel(motion.base[one[0] - 1 : one[-1] + 2]))
    here, there = (Pose(motion.base[k], motion.joints[k]) for k in (run[0] - 1, run[-1] + 1))
    free_space, _, _ = whole_path(scene_of(world))
    collision = scene_of(world).collision
    driver = driver_for(scene_of(world), free_space, 0)
    piece = free_space.piece_at(here.base[:2], float(here.base[2]))
    assert piece is not None
    transits = TransitPlanner(scene_of(world), collision, driver)

    def staged() -> list[Pose]:
        way = transits.folded(here, there, piece)
        assert way is not None
        return [here, *way, there]

    seeds = iter(range(10**6))

    def whole() -> list[Pose]:
        way = None
        while way is None:  # a run that finds none counts with the one that does
            seeded = replace(driver, seed=next(seeds))
            way = WholeBodyPlanner(scene_of(world), collision, seeded, piece).way(
                here, there, seeded.seed, MAX_ITERATIONS
            )
        return way

    lengths = [world.robot.drive.travel(np.array([pose.base for pose in work()])) for work in (staged, whole)]
    yield against(
        "the far jump of pillar, proven clear",
        "OMPL RRTConnect over base and arm, 8 dimensions, the same checker",
        staged,
        whole,
        Wanted(10.0),
        size,
    )
    others = [
        world.robot.drive.travel(np.array([pose.base for pose in whole()])) for _ in range(size.count(15))
    ]
    yield counted(
        "the same: our base path / theirs", "RRTConnect, shortened", [lengths[0] / one for one in others],
        Wanted(1.0, at_least=False),
    )  # fmt: skip


def _lengths(size: Size) -> Iterator[Row]:
    """Base paths over random maps against the shortest."""
    start, goal = np.array([0.1, 0.1]), np.array([9.9, 9.9])
    ratios = []
    for seed in range(size.count(MAPS)):
        free: Polygon = clutter(seed)
        ratios.append(length(drive_point(free, start, goal, step=STEP).points) / shortest(free, start, goal))
    what, rival = f"length of base paths over {len(ratios)} maps", "the exact shortest path"
    yield counted(f"{what}, median", rival, ratios, Wanted(1.005, at_least=False))
    yield counted(f"{what}, worst", rival, [max(ratios)], Wanted(1.05, at_least=False))


def meander(count: int, obstacles: int, side: float = 30.0, spacing: float = 0.02) -> World:
    """Rows of a long path a little apart, among boxes on both sides of a floor."""
    rng = np.random.default_rng(0)
    far = np.arange(count) * spacing
    row, along = np.divmod(far, side)
    x = np.where(row % 2 == 0, along, side - along)
    path = np.column_stack([x, 0.05 * row, np.full(count, 0.25)])
    places = rng.uniform([0, -40], [side, -2], (obstacles, 2))
    boxes = tuple(
        Box(f"box {k}", np.array([0.1, 0.1, 0.1]), np.array([*place, 0.05]), 0.3)
        for k, place in enumerate(places)
    )
    floor = Floor(shapely.box(-2, -42, side + 2, 0.05 * row.max() + 3))
    return World("meander", load_world("free").robot, floor, boxes, tuple(map(Target, path)))


def _growth(size: Size) -> Iterator[Row]:
    """Slopes of the time in the double logarithm."""
    counts = [n for n in (100, 1000, 10_000, 100_000) if n <= size.count(100_000)]
    seconds = [_areas_and_pruning(meander(n, 100)) for n in counts]
    yield _slope("areas and pruning, set-points", counts, seconds, 1.1)
    seconds = [_seconds(lambda n=n: search(scene_of(meander(n, 100)))) for n in counts[:-1]]  # type: ignore[misc]
    last, most = planned_alone(counts[-1])
    yield _slope("whole plans, verified, set-points", counts, [*seconds, last], 1.1)
    what = f"most memory of a process that plans {counts[-1]:,} set-points"
    yield counted(what, "GiB", [most], Wanted(2.0, False, "GiB"))
    counts = [n for n in (10, 100, 1000, 10_000) if n <= size.count(10_000)]
    seconds = [_areas_and_pruning(meander(300, n)) for n in counts]
    yield _slope("areas and pruning, obstacles of which none is near", counts, seconds, 0.3)


def planned_alone(count: int) -> tuple[float, float]:
    """Processor time of a whole plan in a process of its own [s], and the most memory it takes [GiB]."""
    done = subprocess.run(
        [sys.executable, "-c", PLANNING, str(count)], capture_output=True, text=True, check=True
    )
    seconds, most = map(float, done.stdout.split())
    return seconds, most


def _areas_and_pruning(world: World) -> float:
    return _seconds(lambda: whole_path(scene_of(world)))


def _seconds(work: Work) -> float:
    """Least of two calls, of processor time: the first readies what belongs to the world alone.

    Work of many seconds is done once.
    """
    spent: list[float] = []
    while len(spent) < 2 and sum(spent) < LONG:
        begun = time.process_time()
        work()
        spent.append(time.process_time() - begun)
    return min(spent)


def _slope(what: str, counts: list[int], seconds: list[float], most: float) -> Row:
    what = f"{what}: {counts[0]:,} to {counts[-1]:,}"
    if len(counts) < 2:
        return counted(what, "log-log slope", [np.nan], None, "too few sizes")
    slopes = [float(np.polyfit(np.log(counts), np.log(seconds), 1)[0])]
    told = ", ".join(f"{n:,}: {spent:.3g} s" for n, spent in zip(counts, seconds, strict=True))
    return counted(what, "log-log slope", slopes, Wanted(most, at_least=False, unit=""), told)


def _commands(size: Size) -> Iterator[Row]:
    """Commands from the shell, all that they start included."""
    with TemporaryDirectory() as folder:
        for words, most in (
            (["--help"], 0.5),
            (["plan", "pillar", "-o", str(Path(folder) / "plan.json")], 3.0),
        ):

            def command(words: list[str] = words) -> object:
                return subprocess.run(
                    [sys.executable, "-m", "regionik", *words], check=True, capture_output=True
                )

            yield timed(
                f"regionik {' '.join(words[:2])}",
                "seconds",
                command,
                Wanted(most, at_least=False, unit="s"),
                size,
                clock=time.perf_counter,
            )
