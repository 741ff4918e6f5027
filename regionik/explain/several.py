"""Several set-points in one explanation: which cannot be done, each with its reason, in one sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby

from regionik.explain.constraints import join
from regionik.explain.options import EXPLAIN
from regionik.values import Skipped
from regionik.worlds.errors import Explanation, NoPlanFound, SetpointFailure, Verdict

ALONE: tuple[Verdict, ...] = ("unreachable", "undecided", "no-posture")  # said of a set-point by itself
_WORDS: dict[Verdict, str] = {
    "unreachable": "cannot be reached",
    "undecided": "could not be decided",
    "ladder-broken": "could not be driven to",
    "no-posture": "could not be given a clear posture",
}


def failures_of(explanation: Explanation) -> tuple[SetpointFailure, ...]:
    """Set-points of an explanation that cannot be done, whichever others are."""
    if explanation.failures or explanation.setpoint is None or explanation.verdict not in ALONE:
        return explanation.failures
    return (SetpointFailure(explanation.setpoint, explanation.verdict, explanation.reason, explanation.code),)


def together(explanations: Sequence[Explanation]) -> Explanation:
    """One explanation of several: what the first says, and the set-points of all.

    A proof comes before all that is none.
    """
    first = next((one for one in explanations if one.verdict == "unreachable"), explanations[0])
    return replace(first, failures=in_order(failure for one in explanations for failure in failures_of(one)))


def naming_all(explanation: Explanation, count: int) -> Explanation:
    """The explanation after a sentence on all its set-points, of ``count``, where there are several."""
    failures = failures_of(explanation)
    if len(failures) < 2:
        return explanation
    return replace(explanation, reason=f"{all_in_words(failures, count)} {explanation.reason}")


def in_order(failures: Iterable[SetpointFailure]) -> tuple[SetpointFailure, ...]:
    """The first failure of each set-point, by set-point."""
    first: dict[int, SetpointFailure] = {}
    for failure in failures:
        first.setdefault(failure.setpoint, failure)
    return tuple(first[i] for i in sorted(first))


def all_in_words(failures: Sequence[SetpointFailure], count: int) -> str:
    """A sentence on set-points, grouped by what is wrong with them.

    >>> far, high = (SetpointFailure(i, "unreachable", "") for i in (2, 6))
    >>> all_in_words((far, high, SetpointFailure(7, "no-posture", "")), 40)
    'Set-points 3 and 7 of 40 cannot be reached; set-point 8 could not be given a clear posture.'
    """
    groups = {verdict: [one.setpoint for one in failures if one.verdict == verdict] for verdict in _WORDS}
    parts = [f"{numbered(some, count)} {_WORDS[verdict]}" for verdict, some in groups.items() if some]
    rest = [part.replace(f" of {count}", "", 1) for part in parts[1:]]
    return "; ".join([parts[0], *(part[0].lower() + part[1:] for part in rest)]) + "."


def left_out(skipped: Sequence[Skipped], count: int) -> str:
    """Words on set-points that were left out, of ``count`` as given."""
    failures = [SetpointFailure(one.setpoint, one.verdict, one.reason) for one in skipped]
    words = all_in_words(failures, count).rstrip(".")
    return f"left out: {words[0].lower()}{words[1:]}"


def numbered(setpoints: Sequence[int], count: int) -> str:
    """Set-points as people count them: long lists by spans, very long ones not to their end.

    >>> numbered([2, 4, 5, 6, 9], 12)
    'Set-points 3, 5 to 7 and 10 of 12'
    """
    spans = _spans(setpoints)
    more = len(setpoints) - sum(size for _, size in spans[: EXPLAIN.max_listed])
    names = [name for name, _ in spans[: EXPLAIN.max_listed]] + ([f"{more} more"] if more else [])
    return f"Set-point{'s' * (len(setpoints) > 1)} {join(names)} of {count}"


def _spans(setpoints: Sequence[int]) -> list[tuple[str, int]]:
    """Numbers in words, three and more in a row as one, and how many set-points each stands for."""
    found = list[tuple[str, int]]()
    for _, run in groupby(enumerate(sorted(setpoints)), key=lambda pair: pair[1] - pair[0]):
        numbers = [i + 1 for _, i in run]
        if len(numbers) > 2:
            found.append((f"{numbers[0]} to {numbers[-1]}", len(numbers)))
        else:
            found += [(str(number), 1) for number in numbers]
    return found


def renumbered(explanation: Explanation, remaining: Sequence[int], count: int) -> Explanation:
    """An explanation about some of ``count`` set-points, with the numbers that they have among all of them.

    ``remaining`` has the index among all of each.
    """
    if list(remaining) == list(range(count)) or explanation.setpoint is None:
        return explanation
    failures = tuple(
        replace(
            one, setpoint=remaining[one.setpoint], reason=_renamed(one.reason, one.setpoint, remaining, count)
        )
        for one in explanation.failures
    )
    reason = _renamed(explanation.reason, explanation.setpoint, remaining, count)
    return replace(explanation, setpoint=remaining[explanation.setpoint], reason=reason, failures=failures)


@contextmanager
def naming_as_given(order: Sequence[int]) -> Iterator[None]:
    """Tell a refusal raised inside by the numbers as given of set-points that are in another order."""
    try:
        yield
    except NoPlanFound as no:
        raise NoPlanFound(renumbered(no.explanation, order, len(order))) from None


def _renamed(reason: str, i: int, remaining: Sequence[int], count: int) -> str:
    """A reason with the set-point that it is about by its number among all."""
    if len(remaining) == 1 < count:
        return as_setpoint(reason, remaining[i], count)
    own = rf"([Ss])et-point {i + 1} of {len(remaining)}(?!\d)"
    return re.sub(own, rf"\g<1>et-point {remaining[i] + 1} of {count}", reason)


def as_setpoint(reason: str, i: int, count: int) -> str:
    """A reason about an only target, with the target told as set-point i of several.

    >>> as_setpoint("No way was found to reach the target 'cup' at (1, 2, 3)", 6, 40)
    "No way was found to reach set-point 7 of 40 'cup' at (1, 2, 3)"
    """
    for before, after in (("The target", "Set-point"), ("the target", "set-point")):
        reason = re.sub(rf"{before}(?=( '.*')? at \()", f"{after} {i + 1} of {count}", reason)
    return reason
