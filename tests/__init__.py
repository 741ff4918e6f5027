"""The tests."""

import pytest
from hypothesis import settings

# Marks of a test that takes minutes; a smaller form of it runs with every change.
MINUTES = (pytest.mark.slow, pytest.mark.long)


def examples(count: int) -> int:
    """Return how many of ``count`` random examples the profile asks for, see `tests.conftest`."""
    return max(1, round(count * settings().max_examples / 100))
