"""A table of very many targets among 100 obstacles: seconds, memory, and the same bytes after ten kills.

`regionik reach` answers a CSV file of random targets, position only, with worker processes; time and the
memory of all its processes together are measured from outside. `reach` is asked target by target for some.
Then as many runs of a smaller table are killed at random moments and called again, and the bytes are compared
with those of an unbroken run. Exits 1 where they differ or a process is left behind.
Run: python -m benchmarks.bench_scale [--count N] [--workers N] [--kills N] [--kill-count N] [--scalar N]
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import psutil
import yaml

from regionik.reachability.reach import reach
from regionik.worlds.documents.world_file import load_world

OBSTACLES = 100
LOOK = 0.05  # how often memory is looked at [s]


class Run(NamedTuple):
    """What one run of the command took."""

    seconds: float
    memory: int  # most of all processes at once [bytes]
    killed: bool
    processes: tuple[int, ...]  # that it had started, itself among them


def world_file(folder: Path) -> Path:
    """The floor of a hall with small boxes strewn over it."""
    rng = np.random.default_rng(6)
    boxes = []
    for k in range(OBSTACLES):
        x, y = rng.uniform(1.0, 19.0, 2).round(3).tolist()
        size = [*rng.uniform(0.1, 0.5, 2).round(3).tolist(), 1.0]
        box = {"size": size, "center": [x, y, 0.5], "yaw": round(float(rng.uniform(-3, 3)), 3)}
        boxes.append({"name": f"box {k}", "box": box})
    document = {
        "version": 1,
        "robot": "youbot",
        "floor": {"polygon": [[0, 0], [20, 0], [20, 20], [0, 20]]},
        "obstacles": boxes,
        "task": [{"points": [[0.5, 0.5, 0.3]]}],
    }
    path = folder / "hall.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


def table_file(path: Path, count: int) -> Path:
    points = np.random.default_rng(7).uniform([0, 0, 0.05], [20, 20, 0.5], (count, 3))
    np.savetxt(path, points, delimiter=",", header="x,y,z", comments="", fmt="%.6f")
    return path


def run(world: Path, table: Path, output: Path, workers: int, kill_after: float = np.inf) -> Run:
    """Run the command, and kill it after so many seconds."""
    command = [sys.executable, "-m", "regionik", "reach", str(world), "--csv", str(table), "-o", str(output)]
    began, most, seen = time.perf_counter(), 0, set()
    with subprocess.Popen(
        [*command, "--workers", str(workers)], stderr=subprocess.PIPE, text=True
    ) as process:
        while process.poll() is None and time.perf_counter() - began < kill_after:
            family = _family(process.pid)
            seen |= {one.pid for one in family}
            most = max(most, sum(_memory(one) for one in family))
            time.sleep(LOOK)
        killed = process.poll() is None
        if killed:
            process.send_signal(signal.SIGKILL)
        elif process.returncode not in (0, 1):
            print(process.stderr.read() if process.stderr else "")
            raise SystemExit(process.returncode)
    return Run(time.perf_counter() - began, most, killed, tuple(seen))


def _family(pid: int) -> list[psutil.Process]:
    try:
        first = psutil.Process(pid)
        return [first, *first.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def _memory(process: psutil.Process) -> int:
    try:
        return int(process.memory_info().rss)
    except psutil.NoSuchProcess:
        return 0


def left_behind(pids: tuple[int, ...]) -> list[int]:
    """Processes that are still there some seconds later."""
    until = time.monotonic() + 10
    while (alive := [pid for pid in pids if psutil.pid_exists(pid)]) and time.monotonic() < until:
        time.sleep(LOOK)
    return alive


def measure(folder: Path, world: Path, count: int, workers: int, scalar: int) -> None:
    table, output = table_file(folder / "targets.csv", count), folder / "answers.csv"
    found = run(world, table, output, workers)
    with output.open(newline="") as file:
        verdicts = [row["verdict"] for row in csv.DictReader(file)]
    told = ", ".join(f"{verdicts.count(word)} {word}" for word in ("reachable", "unreachable", "undecided"))
    each = found.seconds / count
    print(f"{count} targets, {OBSTACLES} obstacles, {workers} workers: {told}")
    print(
        f"  {found.seconds:.1f} s, {1 / each:.0f} targets a second, {os.cpu_count()} cores, most memory "
        f"{found.memory / 2**30:.2f} GiB in all processes, table of {output.stat().st_size / 2**20:.1f} MiB"
    )
    if scalar:
        scene = load_world(str(world))
        points = np.loadtxt(table, delimiter=",", skiprows=1, max_rows=scalar)
        reach(scene, points[:2])
        began = time.perf_counter()
        for point in points:
            reach(scene, [point])
        one = (time.perf_counter() - began) / len(points)
        print(f"  one by one: {one * 1e3:.2f} ms a target, {one / each:.1f} times as long")


def survive(folder: Path, world: Path, count: int, workers: int, kills: int) -> int:
    """Kill runs at random moments; return how many things were wrong."""
    table = table_file(folder / "fewer.csv", count)
    whole, output = folder / "whole.csv", folder / "broken.csv"
    unbroken = run(world, table, whole, workers)
    parts = folder / "broken.csv.parts"
    rng, wrong, done = np.random.default_rng(8), 0, 0
    while done < kills:
        output.unlink(missing_ok=True)
        began = done
        while not output.exists():
            one = run(
                world, table, output, workers, rng.uniform(0.0, unbroken.seconds) if done < kills else np.inf
            )
            if one.killed:
                done += 1
                there = sum("of" in path.name for path in parts.iterdir()) if parts.exists() else 0
                orphans = left_behind(one.processes)
                wrong += len(orphans)
                print(
                    f"  kill {done} after {one.seconds:.1f} s: {there} parts, {len(orphans)} processes left"
                )
        same = output.read_bytes() == whole.read_bytes()
        wrong += not same
        print(f"  after {done - began} kills: {'the same bytes' if same else 'OTHER BYTES'}")
    if parts.exists():
        shutil.rmtree(parts)
        wrong += 1
    return wrong


def main(options: argparse.Namespace) -> int:
    with TemporaryDirectory() as name:
        folder = Path(name)
        world = world_file(folder)
        measure(folder, world, options.count, options.workers, options.scalar)
        wrong = survive(folder, world, options.kill_count, options.workers, options.kills)
    print(f"wrong: {wrong}")
    return 1 if wrong else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--kill-count", type=int, default=20_000)
    parser.add_argument("--scalar", type=int, default=200)
    sys.exit(main(parser.parse_args()))
