"""Plans of bundled worlds, each made once for all tests of a process, or of the workers of one run."""

import os
import pickle
from functools import cache
from pathlib import Path

from regionik.pipeline import plan
from regionik.values import Plan
from regionik.worlds.documents.world_file import load_world

_folder: list[Path] = []  # of the plans that workers share


def share(folder: Path) -> None:
    """Keep plans in a folder for other processes, and take theirs."""
    folder.mkdir(exist_ok=True)
    _folder[:] = [folder]


@cache
def planned(name: str) -> Plan:
    """Return the plan of a bundled world."""
    if not _folder:
        return plan(load_world(name))
    kept = _folder[0] / name
    if not kept.exists():
        new = kept.with_suffix(f".{os.getpid()}")
        new.write_bytes(pickle.dumps(plan(load_world(name))))
        new.replace(kept)
    found: Plan = pickle.loads(kept.read_bytes())
    return found
