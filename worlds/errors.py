"""Errors of regionik, and the evidence they carry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Literal

Verdict = Literal["unreachable", "undecided", "ladder-broken", "no-posture", "start-blocked", "plan-invalid"]
CauseKind = Literal[
    "obstacle",
    "reach",
    "limits",
    "clearance",
    "direction",
    "floor",
    "zone",
    "base",
    "path",
    "self",
    "criteria",
    "execution",
]
ReasonCode = Literal[
    "",  # none: it is reachable, or what is said has to do with a path
    "too-high",  # above all that the arm reaches
    "too-low",
    "too-far",  # beyond where the base may stand, or beyond the reach from its one pose
    "no-posture",  # none within limits brings the tool there, wherever it points
    "tool-direction",  # none does with the wanted direction or orientation
    "no-room",  # nowhere on the floor is room for the base
    "base-blocked",  # the base is too near to obstacles wherever the arm reaches it from, or at its one pose
    "body-blocked",  # what stands on the base is, as under a table
    "zone-blocked",  # zones keep the base from all places that the arm reaches it from, or from its one pose
    "off-floor",  # the one pose of the base is
    "wrong-heading",  # of the one pose, by the rules
    "in-obstacle",  # the target is, or nearer to it than the end of the arm may come
    "arm-blocked",  # in each posture the arm touches something
    "criteria",  # the rules' criteria rule out what else would reach it
    "no-place",  # each place is ruled out, one for this reason and one for that
    "not-found",  # neither a posture nor a proof that there is none
]
RepairKind = Literal[
    "clearance",
    "move-target",
    "move-obstacle",
    "move-start",
    "cone",
    "raise",
    "lift-off",
    "lift-within",
    "stop-tolerance",
]
Unit = Literal["m", "rad", "1"]


@dataclass(frozen=True)
class Cause:
    """One thing that stands in the way."""

    kind: CauseKind
    name: str
    margin: float | None = None  # how much is missing [m]


@dataclass(frozen=True)
class Repair:
    """One change that would make the answer a yes.

    Attributes
    ----------
    kind : str
    name : str
        The thing that is changed.
    amount : float
        New clearance, cone or stop tolerance; way that a target, an obstacle, the start or the arm's mount is
        moved; number of lift-offs allowed besides, or within strokes 1.
    text : str
    unit : {"m", "rad", "1"}
        Of ``amount``.
    vector : tuple of float
        Of a target (x, y, z), an obstacle or the start (x, y) that is moved [m]; else empty.
    also : tuple of Repair
        What has to be changed besides; ``text`` tells it too.
    """

    kind: RepairKind
    name: str
    amount: float
    text: str
    unit: Unit = "m"
    vector: tuple[float, ...] = ()
    also: tuple[Repair, ...] = ()


@dataclass(frozen=True)
class SetpointFailure:
    """A set-point that cannot be done, whichever others are: it counts from 0, the reason from 1."""

    setpoint: int
    verdict: Verdict
    reason: str
    code: ReasonCode = ""


@dataclass(frozen=True)
class Explanation:
    """The reason for a no: one paragraph for people, the same as data for programs.

    ``verdict`` is "unreachable" where it is proven, "undecided" where no place for the base is known but
    none is ruled out; "ladder-broken" and "no-posture" say that no way and no posture was found.
    ``setpoint`` counts from 0; ``reason`` counts from 1, as people do. ``failures`` are all the set-points
    that cannot be done themselves, ``setpoint`` among them; none where it is the way between two that fails.
    ``code`` is the reason in a word, where it is about a target by itself.
    """

    verdict: Verdict
    setpoint: int | None
    reason: str
    causes: tuple[Cause, ...] = ()
    repairs: tuple[Repair, ...] = ()
    failures: tuple[SetpointFailure, ...] = ()
    code: ReasonCode = ""

    def __repr__(self) -> str:
        counts = f"{len(self.causes)} causes, {len(self.repairs)} repairs"
        return f"Explanation({self.verdict}: {' '.join(self.reason.split())} [{counts}])"


MAX_MESSAGE_LENGTH = 1000  # [characters]


class RegionikError(Exception):
    """Root of every error that regionik raises on purpose."""


class FileNote(UserWarning):
    """A note on something odd in a file, or on something that its reading or writing left out."""


class RobotNote(FileNote):
    """A note on something in a robot's file that was left out or replaced."""


class InputError(RegionikError):
    """Input that cannot be used; the message says where, and what was expected.

    The middle of a very long message is left out, as names in a file may have any length.
    """

    def __init__(self, message: str) -> None:
        half = MAX_MESSAGE_LENGTH // 2
        if len(message) > MAX_MESSAGE_LENGTH:
            message = f"{message[:half]} ... {message[-half:]}"
        super().__init__(message)


class EngineError(RegionikError):
    """A third-party engine failed on input that passed our checks."""


class NoPlanFound(RegionikError):
    """The answer is no, and ``explanation`` says why."""

    def __init__(self, explanation: Explanation) -> None:
        super().__init__(explanation.reason)
        self.explanation = explanation


def located_error(where: str, place: str, text: str) -> InputError:
    """Return the error ``where: place: text``, on one line.

    A ``place`` that ends in a dot is continued by the text: ``robot.`` and ``mount: expected ...`` give
    ``robot.mount: expected ...``.
    """
    parts = (where, place + text) if place.endswith(".") else (where, place, text)
    return InputError(": ".join(" ".join(part.split()) for part in parts if part))


def suggestion(name: str, choices: Iterable[str]) -> str:
    """Return ``, did you mean 'pillar'?`` for the choice nearest to a name; empty where none is near.

    >>> suggestion("piller", ["free", "pillar"])
    ", did you mean 'pillar'?"
    """
    near = get_close_matches(name, list(choices), n=1)
    return f", did you mean {near[0]!r}?" if near else ""


def read_each(where: str, place: str, parts: Iterable[Any], read: Callable[[Any], Any]) -> tuple[Any, ...]:
    """Return what is read from each part of a list, `located` at ``place[k].``."""
    found = []
    for k, part in enumerate(parts):
        with located(where, f"{place}[{k}]."):
            found.append(read(part))
    return tuple(found)


@contextmanager
def located(where: str, place: str) -> Iterator[None]:
    """Put file and place before the message of any `InputError` raised inside, as `located_error` does."""
    try:
        yield
    except InputError as error:
        raise located_error(where, place, str(error)) from None
