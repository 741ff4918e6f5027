"""Run whole jobs, each side in a process of its own, and write docs/benchmarks.json and docs/benchmarks.md.

Run: python -m benchmarks.page [-o docs/benchmarks] [--data FOLDER] [--only rasters,...]

With ``--only`` the other topics are kept as the JSON file has them. What is run here takes some fifteen
minutes of a processor.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.page import growth, placement, rasters
from benchmarks.page.outcomes import NOTHING, Outcome, Topic, as_markdown

PREFACE = """\
# Whole jobs, beside what you would pick instead

Written by `make bench`. Each side does the whole job in a process of its own, on one thread; the time is that
of the processor from start to answer, with loading, with kernels that no run before compiled and, of ours,
with verification. Other work may run on the machine: the two sides of a job are timed one after the
other, and their ratio says more than either. "Not run here" marks figures of a publication,
or says what it takes to run it. What each side proves:

- *proven motion*: the whole motion between all states keeps limits, clearances and path, and `verify` agrees;
- *proven that it cannot be done*: no motion of this robot can do the job, whatever the planner;
- *collision-checked states*: the states are free, what lies between them was not looked at;
- *joints at each pose*: a solution at every pose, nothing of the way from one to the next;
- *nothing*: no answer, or one that says nothing about the job.
"""
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def topics(data: Path | None) -> dict[str, Topic]:
    """Return all topics by name, in their order on the page."""
    return {"rasters": rasters.topic(), "placement": placement.topic(data), "growth": growth.topic()}


def measured(name: str, topic: Topic, data: Path | None) -> list[dict[str, Any]]:
    """Return rows of a topic, printed as they come."""
    rows = []
    for k, job in enumerate(topic.jobs):
        for side, work in job.sides.items():
            found = work if isinstance(work, Outcome) else _apart(name, k, side, data)
            rows.append({"job": job.what, "side": side, **asdict(found)})
            print(f"{job.what}, {side}: {found}", flush=True)
    return rows


def _apart(name: str, k: int, side: str, data: Path | None) -> Outcome:
    """Return the outcome of one side, from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.page", "--side", name, str(k), side]
    command += [] if data is None else ["--data", str(data)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **THREADS})
    if done.returncode:
        why = (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1]
        return Outcome(None, why.replace("|", "/"), NOTHING)
    return Outcome(**json.loads(done.stdout.splitlines()[-1]))


def written(out: Path, rows: dict[str, list[dict[str, Any]]], known: dict[str, Topic]) -> None:
    """Write the page of rows by topic in both forms."""
    page = []
    for name, topic in known.items():
        if name in rows:
            cells = [
                (row["job"], row["side"], Outcome(row["seconds"], row["said"], row["proves"]))
                for row in rows[name]
            ]
            page.append((topic.title, topic.about, cells))
    text = json.dumps(rows, indent=1, ensure_ascii=False)
    out.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
    out.with_suffix(".md").write_text(as_markdown(page, PREFACE), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description="Run whole jobs beside what one would pick instead.")
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/benchmarks"), help="files, no suffix")
    parser.add_argument("--data", type=Path, help="folder with bstar and iklink")
    parser.add_argument("--only", help="topics to measure, with commas between; the others are kept")
    parser.add_argument("--side", nargs=3, metavar=("TOPIC", "JOB", "SIDE"), help="run one side, print JSON")
    given = parser.parse_args()
    known = topics(given.data)
    if given.side:
        name, k, side = given.side
        work = known[name].jobs[int(k)].sides[side]
        print(json.dumps(asdict(work if isinstance(work, Outcome) else work())))
        return
    names = given.only.split(",") if given.only else list(known)
    if unknown := sorted(set(names) - set(known)):
        parser.error(f"no topic {', '.join(unknown)}; there are {', '.join(known)}")
    data = given.out.with_suffix(".json")
    rows = json.loads(data.read_text(encoding="utf-8")) if given.only and data.exists() else {}
    for name in names:
        rows[name] = measured(name, known[name], given.data)
        written(given.out, rows, known)


if __name__ == "__main__":
    main()
