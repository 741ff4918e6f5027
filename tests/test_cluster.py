"""A Dask cluster as the executor: one worker killed in the middle, and nothing lost, nothing twice."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import dask
import distributed
import numpy as np
import pytest

from regionik.cli.app import run
from regionik.executors import dask_executor, map_unordered
from regionik.reachability.reach import reach
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import EngineError, InputError
from regionik.worlds.scene import World
from tests.test_bulk import same


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The address of a cluster of two worker processes with one thread each."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own event loop and ports
        # Two workers may die of one chunk, so that an error does not take four of them.
        with (
            dask.config.set({"distributed.scheduler.allowed-failures": 1}),
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
            ) as local,
        ):
            yield local.scheduler_address


def counted(world: World, item: tuple[str, int]) -> tuple[int, int]:
    """Note that this item was worked on, and kill this worker the first time that item 7 comes by."""
    folder, k = item
    first = not Path(folder, "killed").exists()
    if k == 7 and first:
        Path(folder, "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return k, os.getpid()


def deadly(world: World, item: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return item


@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_nothing_and_doubles_nothing(address: str, tmp_path: Path) -> None:
    world = load_world("free")
    with dask_executor(address) as (executor, ahead):
        items = [(k, (str(tmp_path), k)) for k in range(60)]
        found = list(map_unordered(world, counted, items, executor, ahead))
    assert (tmp_path / "killed").exists()
    assert sorted(k for k, _ in found) == list(range(60))
    assert all(k == asked for k, (asked, _) in found)
    assert os.getpid() not in {process for _, (_, process) in found}


@pytest.mark.filterwarnings("ignore")
def test_answers_are_those_of_one_process(address: str) -> None:
    world = load_world("l_shape")
    targets = np.random.default_rng(5).uniform([-1, -1.5, 0], [4.5, 2.5, 0.9], (40, 3))
    with dask_executor(address) as (executor, _):
        assert same(reach(world, targets, executor=executor, chunk=7), reach(world, targets))


@pytest.mark.filterwarnings("ignore")
def test_the_command_works_on_the_cluster(
    address: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    table, there, here = (tmp_path / name for name in ("targets.csv", "there.csv", "here.csv"))
    table.write_text("0.5,-0.1,0.3\n0,0,3\n0.6,-0.2,0.3\n")
    assert run(["reach", "free", "--csv", str(table), "-o", str(there), "--dask", address]) == 1
    assert run(["reach", "free", "--csv", str(table), "-o", str(here)]) == 1
    assert there.read_bytes() == here.read_bytes()
    assert "2 of 3 targets are reachable" in capfd.readouterr().err


@pytest.mark.filterwarnings("ignore")
def test_a_chunk_that_kills_every_worker_is_an_error(address: str) -> None:
    ended = pytest.raises(EngineError, match="a chunk ended worker after worker")
    with ended, dask_executor(address) as (pool, _):
        list(map_unordered(load_world("free"), deadly, enumerate(range(1)), pool))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere at all"])
def test_no_scheduler_is_one_line(
    address: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("regionik.executors.CONNECT_TIMEOUT", 1)
    assert run(["reach", "free", "--dask", address]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "expected the address of a Dask scheduler" in err


def test_without_distributed_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"regionik\[distributed\]"), dask_executor("tcp://127.0.0.1:1"):
        pytest.fail("entered")


def test_nobody_loads_distributed_unasked() -> None:
    code = "import sys, regionik.executors; print('distributed' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
