"""Calls that take too long are ended; whoever starts processes here imports nothing heavy."""

from __future__ import annotations

import os
import signal

from tests.bounded import Ended, bounded_calls


def ordeal(what: str, _seed: int) -> str:
    """Answer, take for ever or crash."""
    while what == "for ever":
        pass
    if what == "crash":
        os.kill(os.getpid(), signal.SIGKILL)
    return what


def test_what_takes_for_ever_or_crashes_is_ended_and_the_rest_answered() -> None:
    given = [("one", 1), ("for ever", 2), ("crash", 3), ("two", 4)]
    found = {one: answer for (one, _), answer in bounded_calls(ordeal, given, 2, 0.2)}
    assert found["one"] == "one"
    assert found["two"] == "two"
    assert found["for ever"] == Ended(True, -signal.SIGPROF)
    assert found["crash"] == Ended(False, -signal.SIGKILL)
