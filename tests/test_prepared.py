"""What is made of an object once: kept on it, for each set of values, and left behind by copies."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

from regionik.worlds.arms import with_pivot, with_pivot_limits
from regionik.worlds.bundled import robot_named
from regionik.worlds.prepared import Prepared, made_once


@dataclass(frozen=True, eq=False)
class Number(Prepared):
    value: int


def test_a_function_is_called_once_for_each_object_and_each_set_of_values() -> None:
    calls = []

    @made_once
    def times(number: Number, factor: int, *, plus: int = 0) -> int:
        calls.append((number.value, factor, plus))
        return number.value * factor + plus

    two, three = Number(2), Number(3)
    found = [times(*one) for one in ((two, 5), (three, 5), (two, 5), (two, 6))] + [times(two, 5, plus=1)] * 2
    assert found == [10, 15, 10, 12, 11, 11]
    assert calls == [(2, 5, 0), (3, 5, 0), (2, 6, 0), (2, 5, 1)]


def test_what_was_made_of_a_chain_does_not_travel_with_it() -> None:
    chain = robot_named("pioneer7").chain
    bare = len(pickle.dumps(chain))
    made = with_pivot_limits(chain, -1.0, 1.0)
    assert made is with_pivot_limits(chain, -1.0, 1.0)
    assert len(pickle.dumps(chain)) == bare
    again = pickle.loads(pickle.dumps(chain))
    assert with_pivot(again) is again
    assert with_pivot_limits(again, -1.0, 1.0) is not made
