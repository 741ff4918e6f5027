"""The examples in docstrings say what is true."""

from __future__ import annotations

import doctest
import pkgutil
from importlib import import_module

import pytest

import regionik

MODULES = [
    "regionik",
    *(m.name for m in pkgutil.walk_packages(regionik.__path__, "regionik.") if m.name != "regionik.__main__"),
]


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples_hold(name: str) -> None:
    result = doctest.testmod(import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0


def test_every_room_is_looked_at() -> None:
    assert {"regionik.values", "regionik.worlds.chain", "regionik.planners.solvers.planar_kinematics"} <= set(
        MODULES
    )
