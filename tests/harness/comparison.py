"""Figures of two runs compared: *same*, *as good* within written tolerances, or what fell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Row = Mapping[str, Any]
State = Literal["same", "same motion", "as good", "better", "fell", "missing", "new", "other world"]
BAD = ("fell", "missing", "other world")

PLAN, PROOF = 0, 1
VERDICTS = {  # how much is known: a plan, a proof that there is none, or neither
    "planned": PLAN,
    "unreachable": PROOF, "start-blocked": PROOF,
    "undecided": 2, "ladder-broken": 2, "no-posture": 2,
    "plan-invalid": 3, "refused": 3, "given up": 3, "crashed": 3,
}  # fmt: skip


@dataclass(frozen=True)
class Tolerance:
    """By how much a figure may grow: by a share of what it was, or by so much, whichever is more."""

    name: str
    unit: str
    share: float
    amount: float
    why: str

    def most(self, before: float) -> float:
        return max(before * (1 + self.share), before + self.amount)


TOLERANCES = (
    Tolerance("skipped", "set-points", 0.0, 0.0, "what could be done is to be done"),
    Tolerance("lift_offs", "lift-offs", 0.0, 0.0, "each leaves a mark on the work"),
    Tolerance("stops", "stops", 0.0, 0.0, "each takes the time to park"),
    Tolerance("duration", "s", 0.02, 0.05, "what a user waits for; less is rounding of corners"),
    Tolerance("base_way", "m", 0.05, 0.02, "bases may share the way with the arm a little otherwise"),
    Tolerance("turning", "rad", 0.1, 0.1, "costs time only where it is the slowest, which duration tells"),
    Tolerance("arm_travel", "rad", 0.05, 0.05, "joints may share the way with the base a little otherwise"),
)


@dataclass(frozen=True)
class Room:
    """How much room of a kind is enough: beyond it plans may trade it for a better motion."""

    name: str
    enough: float
    why: str


ROUNDING = 1e-4  # by which margins may shrink [m], [rad]
ROOMS = (  # of what `verify` tells beyond the rules
    Room("clearance", 0.0, "the rules say how far the base keeps off"),
    Room("arm", 0.0, "the rules say how far the arm keeps off"),
    Room("floor", 0.0, "the floor's edge is a rule"),
    Room("self", 0.005, "links that all but touch would, on the real arm"),
    Room("joints", 0.02, "a joint at its limit cannot correct anything"),
)


@dataclass(frozen=True)
class Compared:
    """What became of a world: how it compares, what fell and what is better, in words."""

    name: str
    state: State
    fell: tuple[str, ...] = ()
    better: tuple[str, ...] = ()
    ratios: Mapping[str, float] = field(default_factory=dict)  # after to before, of times and ways


def compare(name: str, before: Row | None, after: Row | None) -> Compared:
    """Compare the rows of a world; what a run lacks is None."""
    if before is None or after is None:
        return Compared(name, "new" if before is None else "missing")
    if before["world"] != after["world"]:
        return Compared(name, "other world", ("the two runs had other world files",))
    ratios = {
        key: after[key] / before[key]
        for key in ("cpu", "duration", "base_way", "arm_travel")
        if before.get(key) and after.get(key)
    }
    fell, better = tuple(_fallen(before, after)), tuple(_gained(before, after))
    if fell:
        return Compared(name, "fell", fell, better, ratios)
    return Compared(name, _state(before, after, better), (), better, ratios)


def _state(before: Row, after: Row, better: tuple[str, ...]) -> State:
    if before.get("digest") == after.get("digest"):
        return "same"
    if before.get("motion") and before["motion"] == after.get("motion"):
        return "same motion"
    return "better" if better else "as good"


def _fallen(before: Row, after: Row) -> Iterator[str]:
    """Yield what is worse than before by more than its tolerance."""
    known, knows = (VERDICTS.get(row["verdict"], 3) for row in (before, after))
    if knows > known:
        yield f"verdict {before['verdict']} -> {after['verdict']}"
    if (known, knows) == (PROOF, PLAN):
        yield f"verdict {before['verdict']} -> planned: what was proven was wrong, or the plan is"
    if after["verdict"] != "planned":
        return
    if not after["verified"]:
        yield "verify does not accept the plan"
    if before["verdict"] != "planned":
        return
    if before["duration"] is not None and after["duration"] is None:
        yield f"cannot be timed: {after.get('not_timed', '')}"
    for one in TOLERANCES:
        old, new = before[one.name], after[one.name]
        if old is not None and new is not None and new > one.most(old) + 1e-9:
            yield f"{_change(one, old, new)}, at most {one.most(old):.4g}"
    for room in ROOMS:
        old, new = before["margins"].get(room.name), after["margins"].get(room.name)
        if old is not None and new is not None and new < min(room.enough, old) - ROUNDING:
            yield f"margin {room.name} {old:.4f} -> {new:.4f}, at least {min(room.enough, old):.4f}"


def _gained(before: Row, after: Row) -> Iterator[str]:
    """Yield what is better than before by more than the tolerance would let it be worse."""
    known, knows = (VERDICTS.get(row["verdict"], 3) for row in (before, after))
    if knows < known != PROOF:
        yield f"verdict {before['verdict']} -> {after['verdict']}"
    if before["verdict"] != "planned" or after["verdict"] != "planned":
        return
    for one in TOLERANCES:
        old, new = before[one.name], after[one.name]
        if old is not None and new is not None and old > one.most(new) + 1e-9:
            yield _change(one, old, new)


def _change(one: Tolerance, old: float, new: float) -> str:
    share = f" ({100 * (new / old - 1):+.1f} %)" if one.share and old else ""
    return f"{one.name.replace('_', ' ')} {old:.4g} -> {new:.4g} {one.unit}{share}"
