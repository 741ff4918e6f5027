"""Plans of bundled worlds and others, each made once for all tests of a process, or of one run's workers."""

import os
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path

from regionik.pipeline import plan
from regionik.values import Plan
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.scene import World

_folder: list[Path] = []  # of the plans that workers share


def share(folder: Path) -> None:
    """Keep plans in a folder for other processes, and take theirs."""
    folder.mkdir(exist_ok=True)
    _folder[:] = [folder]


@cache
def planned(name: str, make: Callable[[], World] | None = None) -> Plan:
    """Return the plan of a bundled world, or of one that is made, under a name of its own."""
    if not _folder:
        return _made(name, make)
    kept = _folder[0] / name
    if not kept.exists():
        new = kept.with_suffix(f".{os.getpid()}")
        new.write_bytes(pickle.dumps(_made(name, make)))
        new.replace(kept)
    found: Plan = pickle.loads(kept.read_bytes())
    return found


def _made(name: str, make: Callable[[], World] | None) -> Plan:
    return plan(load_world(name) if make is None else make())
