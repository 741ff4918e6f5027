"""Plans of bundled worlds, each made once for all tests of a process."""

from functools import cache

from regionik.pipeline import plan
from regionik.values import Plan
from regionik.worlds.documents.world_file import load_world


@cache
def planned(name: str) -> Plan:
    """Return the plan of a bundled world."""
    return plan(load_world(name))
