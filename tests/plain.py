"""Kernels as plain Python, so that their lines can be counted: a plugin for pytest, see `make coverage`.

Interpreted kernels are a hundred times slower, so every law is tried on a few cases. Whether it holds is
asked of the compiled kernels.
"""

from __future__ import annotations

import pytest
from hypothesis import settings

CASES = 3  # of a law
OF_LAW = "_hypothesis_internal_use_settings"  # where hypothesis, too, looks for them; there is no other way


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Fewer cases for laws that say themselves how many they want."""
    for item in items:
        law = getattr(item, "obj", None)
        if hasattr(law, OF_LAW):
            setattr(law, OF_LAW, settings(getattr(law, OF_LAW), max_examples=CASES))
