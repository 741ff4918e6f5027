"""The tests."""

from hypothesis import settings


def examples(count: int) -> int:
    """Return how many of ``count`` random examples the profile asks for, see `tests.conftest`."""
    return max(1, round(count * settings().max_examples / 100))
