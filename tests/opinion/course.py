"""A plan's document as a course of states, and the way between two of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tests.opinion.machine import Array, Machine
from tests.opinion.things import Thing, things_of


def wrapped(angle: Any) -> Any:
    """The same angle within half a turn of 0."""
    return np.arctan2(np.sin(angle), np.cos(angle))


def halfway(kind: str, here: Array, there: Array, share: float) -> Array:
    """The base pose at a share of the way between two states.

    On wheels it goes round the point that is equally far from both states on the line across the heading.
    """
    turn = float(wrapped(there[2] - here[2]))
    yaw = here[2] + share * turn
    if kind == "omni" or abs(turn) < 1e-7:
        return np.array([*(here[:2] + share * (there[:2] - here[:2])), yaw])
    chord = there[:2] - here[:2]
    ahead = np.array([np.cos(here[2]), np.sin(here[2])])
    left = np.array([-ahead[1], ahead[0]])
    # Here and there lie on a circle round here + r left; the chord is 2 r sin(turn / 2) long.
    r = float(chord @ (ahead * np.cos(turn / 2) + left * np.sin(turn / 2))) / (2 * np.sin(turn / 2))
    now = np.array([np.sin(yaw), -np.cos(yaw)])  # from the middle of the circle
    return np.array([*(here[:2] + r * left + r * now), yaw])


@dataclass(frozen=True)
class Course:
    """What a plan says, read once."""

    document: dict[str, Any]
    machine: Machine

    @property
    def world(self) -> dict[str, Any]:
        world: dict[str, Any] = self.document["world"]
        return world

    @property
    def rules(self) -> dict[str, Any]:
        rules: dict[str, Any] = self.world["rules"]
        return rules

    @cached_property
    def errors(self) -> dict[str, float]:
        """What the robot may be off its plan, zeros where the rules say nothing."""
        told = {key: value for key, value in (self.rules.get("execution") or {}).items() if value is not None}
        return dict.fromkeys(("base_error", "heading_error", "tool_error", "arm_error"), 0.0) | told

    @cached_property
    def strays(self) -> Array:
        """Offsets of the base at the edge of what it may be off (n, 3), the first none."""
        angle = np.arange(16) * np.pi / 8
        off = self.errors["base_error"] * np.column_stack([np.cos(angle), np.sin(angle)])
        turns = (-self.errors["heading_error"], 0.0, self.errors["heading_error"])
        ends = np.array([[*xy, turn] for xy in off for turn in turns])
        return np.unique(np.concatenate([np.zeros((1, 3)), ends]), axis=0)

    @cached_property
    def arm_stray(self) -> float:
        """Distance by which any point of the arm may be off its place."""
        feet = [*self.machine.facts.footprint]
        feet += [
            point[:2]
            for part in self.machine.parts
            if part.link < 0
            for point in part.shape.points @ part.shape.where[:3, :3].T + part.shape.where[:3, 3]
        ]
        swing = self.errors["heading_error"] * max(float(np.hypot(*one)) for one in feet)
        off = self.errors
        return max(off["arm_error"], off["tool_error"], off["base_error"] + swing)

    @cached_property
    def base(self) -> Array:
        return np.array([state["base"] for state in self.document["states"]], dtype=float)

    @cached_property
    def joints(self) -> Array:
        return np.array([state["joints"] for state in self.document["states"]], dtype=float)

    @cached_property
    def kinds(self) -> list[str]:
        return [state["kind"] for state in self.document["states"]]

    @cached_property
    def task(self) -> list[dict[str, Any]]:
        return [
            {"point": np.array(point), **piece} for piece in self.world["task"] for point in piece["points"]
        ]

    @cached_property
    def things(self) -> list[Thing]:
        return things_of(self.world, self.machine.facts.body_height)

    @cached_property
    def behind(self) -> list[int]:
        """The set-point last done at every state, -1 before the first."""
        done, last = [], -1
        for state in self.document["states"]:
            last = state["setpoint"] if state["kind"] == "setpoint" else last
            done.append(last)
        return done


def angle_between(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def arc_point(a: dict[str, Any], b: dict[str, Any], s: float) -> Array:
    """A direction on the arc between those of two targets."""
    one, other = np.array(a["direction"]), np.array(b["direction"])
    angle = angle_between(one, other)
    if angle < 1e-9:
        return one
    point: Array = (np.sin((1 - s) * angle) * one + np.sin(s * angle) * other) / np.sin(angle)
    return point
