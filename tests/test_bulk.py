"""Targets in chunks: the same answers whatever works on them, nothing lost, nothing twice."""

from __future__ import annotations

import os
import pickle
import signal
import time
from collections.abc import Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import fields, replace
from functools import cache, partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from regionik.executors import MAX_FRESH_POOLS, map_unordered, process_pool
from regionik.reachability.reach import reach
from regionik.values import Answer
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.errors import EngineError, InputError
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Target, World

TARGETS = np.random.default_rng(3).uniform([-1, -1.5, 0], [4.5, 2.5, 0.9], (60, 3))


def same(one: Answer, other: Answer) -> bool:
    pairs = [(getattr(one, field.name), getattr(other, field.name)) for field in fields(Answer)]
    return all(
        a == b if isinstance(a, list) else a.dtype == b.dtype and a.tobytes() == b.tobytes() for a, b in pairs
    )


class Backwards(Executor):
    """Works when nobody looks, and hands back the last first."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        self.asked.append(args[3])
        return future


class Weak(ThreadPoolExecutor):
    """Breaks after so many tasks."""

    def __init__(self, strength: int) -> None:
        super().__init__(1)
        self.left = strength

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.left -= 1
        if self.left < -1:
            raise BrokenProcessPool("out of breath")
        if self.left < 0:
            lost: Future[Any] = Future()
            lost.set_exception(BrokenProcessPool("out of breath"))
            return lost
        return super().submit(fn, *args, **kwargs)


def squared(world: World, item: int) -> tuple[str, int]:
    return world.name, item * item


def fatal(world: World, item: tuple[str, int]) -> int:
    """Kill this worker the first time that item 7 comes by."""
    marker, k = item
    if k == 7 and not os.path.exists(marker):
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return k * k


@cache
def at_once() -> Answer:
    """What is said of all targets in this process, in one piece."""
    return reach(load_world("l_shape"), TARGETS)


@pytest.mark.parametrize("chunk", [1, 59])
def test_chunks_do_not_show(chunk: int) -> None:
    world = load_world("l_shape")
    told: list[tuple[str, int, int]] = []
    answer = reach(world, TARGETS, chunk=chunk, progress=lambda *row: told.append(row))
    assert same(answer, at_once())
    assert told[-1] == ("reach", 60, 60)
    assert sum(stage == "reach" for stage, _, _ in told) == -(-60 // chunk)


def row(answer: Answer, i: int) -> Answer:
    """The answer for one of many targets."""
    values = {field.name: getattr(answer, field.name) for field in fields(Answer)}
    return Answer(**{name: value[i : i + 1] for name, value in values.items()})


@pytest.mark.parametrize(
    ("name", "cone"),
    [
        ("l_shape", None),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in (("depot", None), ("wall", 0.4))),
    ],
)
def test_a_target_is_answered_alone_as_among_hundreds(name: str, cone: float | None) -> None:
    world, count = load_world(name), 240
    x0, y0, x1, y1 = world.floor.polygon.bounds
    spots = np.random.default_rng(4).uniform([x0, y0, 0], [x1, y1, 0.9], (count, 3))
    asked = [Target(spot) if cone is None else Target(spot, [1, 0, 0], cone) for spot in spots]  # type: ignore[arg-type]
    many = reach(world, asked)
    for i in range(0, count, count // 6):
        assert same(reach(world, asked[i : i + 1]), row(many, i))


def test_answers_of_an_arm_out_of_one_plane_do_not_depend_on_others() -> None:
    box = Box("box", np.array([0.6, 0.6, 0.3]), np.array([0.0, 0.0, 0.15]))
    robot = replace(
        robot_named("pioneer7"), footprint=np.array([[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]])
    )
    world = World("crate", robot, Floor(shapely.box(-1, -0.8, 1, 0.8)), (box,))
    spots = np.random.default_rng(2).uniform([-1, -0.8, 0.2], [1, 0.8, 0.2], (12, 3))
    spots[-1] = 0.0, 0.0, 0.1  # deep in the crate
    many = reach(world, spots)
    assert set(many.verdict) >= {"reachable", "unreachable"}
    assert same(many, reach(world, spots, chunk=5))
    for i in range(0, 12, 4):
        assert same(reach(world, spots[i : i + 1]), row(many, i))


def test_a_chunk_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="chunk"):
        reach(load_world("pillar"), TARGETS, chunk=0)


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, Backwards])
def test_executors_do_not_show(pool: Any) -> None:
    world = load_world("l_shape")
    with pool() as executor:
        assert same(reach(world, TARGETS, executor=executor, chunk=11), at_once())


@pytest.mark.parametrize("count", [2, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 3))])
def test_processes_do_not_show(count: int) -> None:
    world = load_world("l_shape")
    targets: Sequence[Target] = [Target(row, [1, 0, 0], 0.4) for row in TARGETS[:20]]  # type: ignore[arg-type]
    with process_pool(count) as executor:
        assert same(reach(world, TARGETS, executor=executor, chunk=9), at_once())
        assert same(reach(world, targets, executor=executor, chunk=3), reach(world, targets))


def test_bad_targets_are_refused_before_anything_is_handed_out() -> None:
    executor = Backwards()
    with pytest.raises(InputError, match="targets"):
        reach(load_world("pillar"), [[0, 0]], executor=executor)
    assert executor.asked == []


@pytest.mark.parametrize("name", ["pillar", "depot", "wall"])
def test_every_world_goes_to_another_process(name: str) -> None:
    world = load_world(name)
    reach(world, world.task[:2])  # what is cached for it must not hinder
    assert world_to_document(pickle.loads(pickle.dumps(world))) == world_to_document(world)


def test_a_world_is_sent_once() -> None:
    world = replace(load_world("free"), name="unseen")
    sent: list[bool] = []

    class Watched(Backwards):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            sent.append(args[2] is not None)
            return super().submit(fn, *args, **kwargs)

    found = dict(map_unordered(world, squared, enumerate(range(50)), Watched(), ahead=1))
    assert found == {k: ("unseen", k * k) for k in range(50)}
    assert sum(sent) == 1
    assert len(sent) == 51


def test_few_are_handed_out_ahead() -> None:
    taken = count()
    results = map_unordered(
        load_world("free"), squared, ((k, next(taken)) for k in range(40)), Backwards(), ahead=4
    )
    for done, _ in enumerate(results, start=1):
        assert next(taken) <= 2 * done + 8  # each look counts too
    assert done == 40


def test_lost_chunks_are_handed_out_again() -> None:
    pools: list[Weak] = []

    def another() -> Weak:
        pools.append(Weak(len(pools) + 2))
        return pools[-1]

    found = list(map_unordered(load_world("free"), squared, enumerate(range(30)), another, ahead=3))
    assert sorted(found) == [(k, ("free", k * k)) for k in range(30)]
    assert len(pools) > 3


def test_workers_that_are_always_lost_end_it() -> None:
    pools: list[Weak] = []

    def another() -> Weak:
        pools.append(Weak(0))
        return pools[-1]

    with pytest.raises(EngineError, match="lost"):
        list(map_unordered(load_world("free"), squared, enumerate(range(30)), another))
    assert len(pools) == MAX_FRESH_POOLS + 1


def test_a_broken_executor_of_the_caller_is_not_replaced() -> None:
    with pytest.raises(EngineError, match="a function that makes executors"):
        list(map_unordered(load_world("free"), squared, enumerate(range(30)), Weak(3)))


def test_a_killed_worker_process_loses_nothing(tmp_path: Path) -> None:
    marker = str(tmp_path / "killed")
    items = [(k, (marker, k)) for k in range(40)]
    found = list(map_unordered(load_world("free"), fatal, items, partial(process_pool, 2), ahead=6))
    assert sorted(found) == [(k, k * k) for k in range(40)]
    assert os.path.exists(marker)


def test_errors_of_workers_come_through() -> None:
    with process_pool(1) as executor, pytest.raises(InputError, match="three"):
        list(map_unordered(load_world("free"), refuse, enumerate(range(3)), executor))


def refuse(world: World, item: int) -> int:
    raise InputError("expected three numbers")


def test_workers_end_with_their_parent() -> None:
    with ProcessPoolExecutor(1, mp_context=process_pool(1)._mp_context) as parent:
        parent_id, child = parent.submit(start_worker).result()
        os.kill(parent_id, signal.SIGKILL)
        until = time.monotonic() + 120
        while time.monotonic() < until:
            try:
                os.kill(child, 0)
            except ProcessLookupError:
                return
            time.sleep(0.05)
    pytest.fail("a worker outlived the process that started it")


_kept: list[Executor] = []


def start_worker() -> tuple[int, int]:
    _kept.append(process_pool(1))
    return os.getpid(), _kept[0].submit(os.getpid).result()
