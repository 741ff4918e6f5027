"""What is wrong with a plan, as far as dense samples of it show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.opinion.course import Course, angle_between, wrapped
from tests.opinion.machine import Array, Facts, Machine
from tests.opinion.moment import Moment
from tests.opinion.pace import differences, pace
from tests.opinion.quality import shortfalls
from tests.opinion.shortest import Ground, driven, drives, least_turned

MET = 1e-8  # of what states say [m] or [rad]
SPARSE = 0.02  # motion of any point between two samples [m]
FIRST = 3  # of objections of a kind
NEAR = 0.1  # a drive that could be shorter than this is none to be compared [m]
SAVED = 1e-4  # that free floor and edges are taken wider than they are, at the most [m]


def objections(document: dict[str, Any], urdf: str, facts: Facts, track: Array | None = None) -> list[str]:
    """All that is wrong with a plan's document; of a kind the first few.

    Parameters
    ----------
    document : dict
        As ``plan.json`` has it.
    urdf : str
        The robot, its base on the joints ``base_x``, ``base_y`` and ``base_yaw``, its tool the link ``tool``.
    facts : Facts
    track : (n, 4 + dof) array, optional
        Rows of a timed plan's trajectory: time, base and joints, at even steps but for the last.
    """
    judge = _Judge(Course(document, Machine(urdf, facts)))
    kinds = (judge.order, judge.limits, judge.targets, judge.hops, judge.pace, judge.criteria, judge.samples)
    found = [text for kind in (*kinds, judge.lengths) for text in _first(kind())]
    return found if track is None else [*found, *differences(judge.course, track)]


def posture_objections(document: dict[str, Any], urdf: str, facts: Facts) -> list[str]:
    """All that is wrong with the states of a document by themselves, however they come about."""
    judge = _Judge(Course(document, Machine(urdf, facts)))
    looks = (text for k in range(len(document["states"])) for text in Moment(judge.course).look(k, 0.0))
    kinds = (judge.limits(), judge.targets(), judge.criteria(), looks)
    return [text for kind in kinds for text in _first(kind)]


def detours(document: dict[str, Any], urdf: str, facts: Facts) -> dict[tuple[int, int], float]:
    """Lengths of drives with the tool lifted, as parts of the shortest ones; very short ones are left out.

    By the first and the last state of each.
    """
    judge = _Judge(Course(document, Machine(urdf, facts)))
    return {(a, b): way / least for a, b, way, least in judge.measured() if NEAR < least < np.inf}


def _first(texts: Iterator[str]) -> list[str]:
    return [text for text, _ in zip(texts, range(FIRST), strict=False)]


@dataclass(frozen=True)
class _Judge:
    course: Course

    # --- what states say

    def order(self) -> Iterator[str]:
        done = [s["setpoint"] for s in self.course.document["states"] if s["kind"] == "setpoint"]
        if done != list(range(len(self.course.task))):
            yield f"order: set-points are done in the order {done}"
        start = self.course.world.get("start")
        if start is not None:
            moved = np.append(self.course.base[0] - start["base"], self.course.joints[0] - start["joints"])
            moved[2] = wrapped(moved[2])
            if np.abs(moved).max() > MET:
                yield "order: the first state is not the start"
        first = self.course.kinds.index("setpoint")
        lifted = [k == "transit" for k in self.course.kinds[first:]]
        runs = sum(b and not a for a, b in zip(lifted, lifted[1:], strict=False))
        if runs != self.course.document["lift_offs"]:
            yield f"order: {runs} lift-offs, the plan says {self.course.document['lift_offs']}"
        for stop in self.course.document["stops"]:
            mine = [
                k
                for k, s in enumerate(self.course.document["states"])
                if s["kind"] == "setpoint" and s["setpoint"] in stop["setpoints"]
            ]
            if np.ptp(self.course.base[mine], axis=0).max() > MET:
                yield f"order: the base moves at the stop for set-points {stop['setpoints']}"

    def limits(self) -> Iterator[str]:
        off = np.maximum(
            self.course.machine.lower - self.course.joints, self.course.joints - self.course.machine.upper
        )
        for k, j in np.argwhere(off > MET):
            yield f"limits: joint {j} of state {k} is {off[k, j]:.2e} beyond its limit"
        if self.course.rules["heading"] == "fixed" and self.course.rules["mode"] == "continuous":
            turned = np.abs(wrapped(self.course.base[:, 2] - self.course.base[0, 2]))
            for k in np.flatnonzero(turned > 1e-6):
                yield f"limits: the base is turned by {turned[k]:.2e} in state {k}, its heading is fixed"
        if self.course.rules["heading"] == "face_target" and self.course.machine.pivots:
            ahead = np.clip(0.0, self.course.machine.lower[0], self.course.machine.upper[0])
            for k, kind in enumerate(self.course.kinds):
                if kind == "setpoint" and abs(wrapped(self.course.joints[k, 0] - ahead)) > MET:
                    yield f"limits: the base does not face its target in state {k}, but its pivot turns"

    def targets(self) -> Iterator[str]:
        for k, state in enumerate(self.course.document["states"]):
            self.course.machine.place(self.course.base[k], self.course.joints[k])
            tool = self.course.machine.tool()
            if np.abs(tool[:3, 3] - state["tool"]).max() > MET:
                yield f"targets: the tool of state {k} is not where the file says"
            if state["kind"] != "setpoint":
                continue
            target = self.course.task[state["setpoint"]]
            off = float(np.linalg.norm(tool[:3, 3] - target["point"]))
            if off > self.course.rules["tolerance"] + MET:
                yield f"targets: state {k} is {off:.3e} m off its set-point"
            angle = _off_angle(tool[:3, :3], target)
            if angle > target.get("cone", np.pi) + 1e-6:
                yield f"targets: state {k} is {angle:.3e} rad off its direction"

    def hops(self) -> Iterator[str]:
        facts = self.course.machine.facts
        for k, (here, there) in enumerate(zip(self.course.base[:-1], self.course.base[1:], strict=True)):
            turn = float(wrapped(there[2] - here[2]))
            chord = there[:2] - here[:2]
            length = float(np.hypot(*chord)) / (
                1.0 if facts.base == "omni" else float(np.sinc(turn / 2 / np.pi))
            )
            if length > self.course.rules["step"] + 1e-7:
                yield f"hops: the base moves {length:.4f} m after state {k}"
            middle = here[2] + turn / 2
            aside = abs(float(chord @ [-np.sin(middle), np.cos(middle)]))
            if facts.base != "omni" and aside > 2e-9:
                yield f"hops: wheels slip {aside:.2e} m after state {k}"
            if facts.base == "car" and abs(turn) * facts.turning_radius > length + 1e-8:
                yield f"hops: a car turns too tightly after state {k}"

    def pace(self) -> Iterator[str]:
        yield from pace(self.course)

    def criteria(self) -> Iterator[str]:
        for state in self.course.document["states"]:
            if state["kind"] == "setpoint":
                base, joints = np.array(state["base"]), np.array(state["joints"])
                for text in shortfalls(self.course.machine, self.course.rules, base, joints):
                    yield f"criteria: {text} at set-point {state['setpoint']}"

    def lengths(self) -> Iterator[str]:
        for first, last, way, least in self.measured():
            if way < least - SAVED:
                yield (
                    f"lengths: the base goes {way:.5f} m from state {first} to state {last}, "
                    f"the shortest way is {least:.5f} m"
                )

    def measured(self) -> Iterator[tuple[int, int, float, float]]:
        """Of every drive with the tool lifted: first and last state, its length, that of the shortest way."""
        moves, facts = list(drives(self.course)), self.course.machine.facts
        ground = Ground(self.course) if moves else None
        for first, last in moves:
            here, there = self.course.base[first], self.course.base[last]
            if ground is not None and ground.holds(here) and ground.holds(there):
                least = max(ground.shortest(here[:2], there[:2]), least_turned(facts, here, there))
                yield first, last, driven(self.course, first, last), least

    # --- what samples between them show

    def samples(self) -> Iterator[str]:
        check = Moment(self.course)
        for k in range(len(self.course.base)):
            yield from check.look(k, 0.0)
            if k + 1 == len(self.course.base):
                return
            for share in np.linspace(0, 1, self._pieces(k) + 1)[1:-1]:
                yield from check.look(k, float(share))

    def _pieces(self, k: int) -> int:
        bend = np.abs(np.diff(self.course.joints[k : k + 2], axis=0)).sum()
        turn = abs(float(wrapped(self.course.base[k + 1, 2] - self.course.base[k, 2])))
        slid = float(np.hypot(*(self.course.base[k + 1] - self.course.base[k])[:2]))
        return max(2, int(np.ceil((slid + turn + bend) / SPARSE)))


def _off_angle(R: Array, target: dict[str, Any]) -> float:
    if "orientation" in target:
        asked = np.array(target["orientation"])
        cosine = (np.trace(asked.T @ R) - 1) / 2
        return float(np.arccos(np.clip(cosine, -1, 1)))
    return angle_between(R[:, 2], np.array(target["direction"])) if "direction" in target else 0.0
