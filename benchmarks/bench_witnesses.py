"""Worlds with a witness, a motion known to be free: which of them are planned, and what becomes of the rest.

Worlds are the folders in FOLDER that hold a `world.yaml` and a `witness.json`, whose ``way`` has rows of
base x, y, yaw and joints and whose ``setpoints`` are rows of it; or those that `tests.witnesses` makes of
kinds and seeds, written KIND:SEED or KIND:FIRST-LAST. Of a witness that does not hold in `verify` it is said.
A world that takes longer than ``--longest`` of the processor, twice, is given up.
Exits 1 where a proof is claimed that there is no plan, or planning ends in an error.
Run: python -m benchmarks.bench_witnesses [FOLDER] [--random KIND:SEED ...] [--longest S] [--workers N]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from regionik.pipeline import search
from regionik.scene import scene_of
from regionik.values import Configuration, Motion, Plan, Stop
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError, NoPlanFound
from tests.bounded import Ended, bounded_calls
from tests.witnesses import traits_of, witness

LOST = "its witness does not hold"
FAULTS = ("unreachable", "start-blocked", "plan-invalid", "failed")  # what no world with a witness may be


class Outcome(NamedTuple):
    """What came of a world."""

    verdict: str
    seconds: float  # of the processor
    reason: str
    traits: tuple[str, ...]


def outcome(kind: str, name: str) -> Outcome:
    """Plan a world; its kind is one of arms, or the folder that it lies in."""
    known = _in_folder(Path(kind) / name) if Path(kind).is_dir() else witness(kind, int(name))
    began, verdict, reason = time.process_time(), "planned", ""
    try:
        search(scene_of(known.world))
    except NoPlanFound as failure:
        verdict, reason = failure.explanation.verdict, failure.explanation.reason
    except InputError as refused:
        verdict, reason = "refused", str(refused)
    except Exception as error:  # the very thing that is looked for
        verdict, reason = "failed", f"{type(error).__name__}: {error}"
    took, holds = time.process_time() - began, verify(known).ok
    return Outcome(verdict, took, reason, (*traits_of(known.world), *(() if holds else (LOST,))))


def _in_folder(folder: Path) -> Plan:
    """The witness of a world in a folder, as a plan."""
    world, known = load_world(folder / "world.yaml"), json.loads((folder / "witness.json").read_text())
    way, at = np.array(known["way"]), np.array(known["setpoints"])
    rows = np.arange(len(way))
    behind = np.searchsorted(at, rows, side="right") - 1
    kinds = np.where(np.isin(rows, at), "setpoint", np.where(behind < 0, "transit", "step"))
    states = Motion(way[:, :3], way[:, 3:], kinds, behind, np.full(len(way), np.nan))
    found = tuple(Configuration(way[k, :3], way[k, 3:], 0.0, 0, True) for k in at)
    rules, stops = world.rules, tuple[Stop, ...]()
    if rules.mode == "stops":
        stops = (Stop(way[-1, :3], tuple(range(len(at))), rules.stop_tolerance, rules.stop_criterion),)
    return Plan(world, 0, found, states, (), 0, stops)


def asked_worlds(folder: Path | None, drawn: list[str]) -> list[tuple[str, str]]:
    """Kinds and names of worlds."""
    found = (
        [] if folder is None else sorted(folder.glob("*/witness.json"), key=lambda p: p.parent.name.zfill(9))
    )
    worlds = [(str(folder), path.parent.name) for path in found]
    for text in drawn:
        kind, _, seeds = text.partition(":")
        first, _, last = seeds.partition("-")
        worlds += [(kind, str(seed)) for seed in range(int(first), int(last or first) + 1)]
    return worlds


def main(folder: Path | None, drawn: list[str], longest: float, workers: int) -> int:
    """Exit code 1 where a witness is contradicted."""
    counts, contradicted = dict[str, Counter[str]](), 0
    for (kind, name), answer in bounded_calls(outcome, asked_worlds(folder, drawn), workers, longest):
        one = Outcome("given up", longest, "", ()) if isinstance(answer, Ended) else answer
        counts.setdefault(kind, Counter())[one.verdict] += 1
        contradicted += one.verdict in FAULTS and LOST not in one.traits
        print(
            f"{kind} {name}: {one.verdict}, {one.seconds:.1f} s, {', '.join(one.traits)}. {one.reason}",
            flush=True,
        )
    for kind, verdicts in counts.items():
        told = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.most_common())
        print(f"{kind}: {verdicts['planned']} of {verdicts.total()} planned; {told}")
    return int(contradicted > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, nargs="?", help="of worlds with witnesses")
    parser.add_argument("--random", nargs="+", default=[], metavar="KIND:SEED", help="worlds to make")
    parser.add_argument("--longest", type=float, default=60.0, help="processor time of a world [s]")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    sys.exit(main(asked.folder, asked.random, asked.longest, asked.workers))
