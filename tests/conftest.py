"""Profiles of hypothesis: one in twelve of the examples, or with ``--hypothesis-profile=long`` all of them.

With ``planted``, for `tests.mutations`, the first that fails ends a test: to make it small takes minutes.

No law holds only on a fast machine: neither sets deadlines. Long files come first, so that two workers end
together. Kernels are compiled before they run, as tests run them for long.
"""

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import pytest
from hypothesis import Phase, settings

import regionik
from regionik.planners.kernels import compiled_at_once
from tests import planned

# While one of two workers compiles kernels for the first file, the other runs files that need hardly any.
FIRST = """cut_off
    view hostile world_file urdf urdf_collision urdf_versions faults examples docs cli occupancy_map visuals
    planfile files ros2_folder plot gcode srdf
    random_worlds repairs doors wheeled_plans colors shown_solver opinion doctests proximity stops rivals
    clear_posture motion bulk footprint retime wheels arms criteria
    few_stops strokes why why_arm poses laws"""
_FIRST = {f"test_{name}": k for k, name in enumerate(FIRST.split())}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    daily = [
        one.nodeid for one in items if one.get_closest_marker("long") and not one.get_closest_marker("slow")
    ]
    assert not daily, f"long tests are slow ones too, else they are daily: {daily}"
    items.sort(key=lambda item: _FIRST.get(Path(item.path).stem, len(_FIRST)))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Load the whole product if a seed is asked for.

    Hypothesis also draws constants of the modules loaded so far: which those are hangs on the order of tests.
    """
    if session.config.getoption("hypothesis_seed") is not None:
        for module in walk_packages(regionik.__path__, "regionik."):
            import_module(module.name)


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels() -> Iterator[None]:
    with compiled_at_once():
        yield


@pytest.fixture(scope="session", autouse=True)
def shared_plans(tmp_path_factory: pytest.TempPathFactory) -> None:
    if "PYTEST_XDIST_WORKER" in os.environ:
        planned.share(tmp_path_factory.getbasetemp().parent / "plans")


os.environ["REGIONIK_QUIET"] = "1"  # lines of progress come by the clock
os.environ["REGIONIK_CACHE_DIR"] = ""  # tests are of what is made, not of what was once made
settings.register_profile("quick", deadline=None, max_examples=8)
settings.register_profile("long", deadline=None, max_examples=100)
FOUND = (Phase.explicit, Phase.generate)
settings.register_profile("planted", deadline=None, max_examples=100, phases=FOUND)
settings.load_profile("quick")
