"""What is wrong with the times of a plan: speeds, accelerations and jerks that states and trajectory tell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tests.opinion.course import Course, wrapped
from tests.opinion.machine import Array

OVER = 1e-3  # of a limit, for what lies between the instants that a timing looks at
Index = NDArray[np.int64]
STILL = 1e-8  # motion that takes no time [m] or [rad]
RISE = 0.5  # from rest to full speed, where no acceleration is given [s]
TURNED = 1e-5  # of a car's steering, that a hop does not tell [rad]
CREPT = 1e-7  # by a car from state to state, that does not [m]
ROLLED = 1e-6  # by a car from row to row of a trajectory, that tells how it steers [m]


def pace(course: Course) -> Iterator[str]:
    """Objections to the times of a plan, if it has any.

    The mean speed of a hop is met somewhere in it, and from the mean over one hop to that over the next no
    more can be gained than the limit of acceleration gives from the middle of one to that of the other.
    """
    times = np.array([state["time"] for state in course.document["states"]], dtype=float)
    if np.isnan(times).any():
        return
    spans = np.diff(times)
    if times[0] != 0 or (spans < 0).any():
        yield "pace: times do not begin at 0 and rise"
        return
    moved = np.column_stack([course.base, course.joints])
    moved = np.diff(moved, axis=0)
    moved[:, 2] = wrapped(moved[:, 2])
    for k in np.flatnonzero((spans == 0) & (np.abs(moved).max(axis=1) > STILL)):
        yield f"pace: something moves in no time after state {k}"
    on = np.flatnonzero(spans > 0).astype(np.int64)
    if not len(on):
        return
    yield from _speeds(course, moved[on], spans[on], on)
    yield from _accelerations(course, moved[on] / spans[on, None], spans[on], on)
    yield from _steering("pace", course, course.base, times)


def differences(course: Course, track: Array) -> Iterator[str]:
    """Objections to rows (n, 4 + dof) of a trajectory: time, base and joints, at even steps but for the last.

    A difference is the mean of a velocity, one of differences the mean of an acceleration, and a third one
    that of a jerk, so none is beyond a limit that is kept at every moment.
    """
    even = track[:-1]
    if len(even) < 4:
        return
    yield from _steering("differences", course, even[:, 1:4], even[:, 0], ROLLED)
    step = float(even[1, 0] - even[0, 0])
    told = {
        "goes": np.diff(even[:, 1:], axis=0) / step,
        "gains speed": np.diff(even[:, 1:], 2, axis=0) / step**2,
        "jerks": np.diff(even[:, 1:], 3, axis=0) / step**3,
    }
    asked = course.world.get("speeds") or {}
    plain = {"base_velocity": 0.5, "turn_velocity": 1.0, "base_acceleration": 1.0, "turn_acceleration": 2.0}
    limits = {**plain, **{key: value for key, value in asked.items() if value is not None}}
    joints = (*joint_limits(course), _each(asked.get("joint_jerk"), np.full(even.shape[1] - 4, np.inf)))
    for (does, rows), word, most in zip(
        told.items(), ("velocity", "acceleration", "jerk"), joints, strict=True
    ):
        shares = {
            "the base": np.hypot(*rows[:, :2].T) / limits.get(f"base_{word}", np.inf),
            "the heading": np.abs(rows[:, 2]) / limits.get(f"turn_{word}", np.inf),
            "a joint": (np.abs(rows[:, 3:]) / most).max(axis=1),
        }
        for who, share in shares.items():
            k = int(np.argmax(share))
            if share[k] > 1 + OVER:
                yield f"differences: {who} {does} at {share[k]:.4f} of its limit after {even[k, 0]:.4f} s"


def joint_limits(course: Course) -> tuple[Array, Array]:
    """Of speed and acceleration of each joint: those asked, else the robot's own, else plain ones."""
    speeds = course.world.get("speeds") or {}
    own = course.machine.velocity
    plain = np.where(course.machine.slides, 0.1, 1.0)
    velocity = _each(speeds.get("joint_velocity"), np.where(np.isfinite(own), own, plain))
    return velocity, _each(speeds.get("joint_acceleration"), velocity / RISE)


def _each(given: float | list[float] | None, plain: Array) -> Array:
    return plain if given is None else np.broadcast_to(np.asarray(given, dtype=float), plain.shape)


def _speeds(course: Course, moved: Array, spans: Array, hops: Index) -> Iterator[str]:
    asked, facts = course.world.get("speeds") or {}, course.machine.facts
    chord, turn = np.hypot(*moved[:, :2].T), np.abs(moved[:, 2])
    length = chord if facts.base == "omni" else chord / np.sinc(turn / 2 / np.pi)
    limits = {
        "the base": (length, asked.get("base_velocity", 0.5)),
        "the heading": (turn, asked.get("turn_velocity", 1.0)),
        "a joint": ((np.abs(moved[:, 3:]) / joint_limits(course)[0]).max(axis=1), 1.0),
    }
    if facts.gauge > 0 and asked.get("wheel_velocity") is not None:
        limits["a wheel"] = (length + turn * facts.gauge / 2, asked["wheel_velocity"])
    tools = np.array([state["tool"] for state in course.document["states"]], dtype=float)
    lifted = np.array([kind == "transit" for kind in course.kinds])
    way = np.linalg.norm(np.diff(tools, axis=0), axis=1) * ~(lifted[:-1] | lifted[1:])
    if asked.get("tool_velocity") is not None:
        limits["the tool"] = (way[hops], asked["tool_velocity"])
    limits["the tool at work"] = ((way / _own_speeds(course))[hops], 1.0)
    for who, (way, limit) in limits.items():
        for k in np.flatnonzero(way > limit * spans * (1 + OVER) + STILL):
            share = way[k] / spans[k] / limit
            yield f"pace: {who} goes at {share:.4f} of its limit after state {hops[k]}"


def _own_speeds(course: Course) -> Array:
    """What set-points ask of the tool on hops to them, infinite for nothing and on travel [m/s]."""
    task, speeds = course.task, list[float]()
    last = -1
    for state in course.document["states"][:-1]:
        last = state["setpoint"] if state["kind"] == "setpoint" else last
        ahead = task[last + 1] if last + 1 < len(task) else {}
        stroke = ahead.get("stroke")
        works = last >= 0 and (stroke is None or (stroke > 0 and stroke == task[last]["stroke"]))
        speeds.append(ahead.get("speed", np.inf) if works else np.inf)
    return np.array(speeds)


def _accelerations(course: Course, mean: Array, spans: Array, hops: Index) -> Iterator[str]:
    """Mean velocities (n, 3 + dof) of hops, with rest before the first and after the last."""
    asked = course.world.get("speeds") or {}
    still = np.zeros((1, mean.shape[1]))
    change = np.diff(np.vstack([still, mean, still]), axis=0)
    between = (np.append(0.0, spans) + np.append(spans, 0.0)) / 2
    gained = np.abs(change) / between[:, None]
    shares = {
        "the base": np.hypot(*gained[:, :2].T) / asked.get("base_acceleration", 1.0),
        "a joint": (gained[:, 3:] / joint_limits(course)[1]).max(axis=1),
        "the heading": gained[:, 2] / asked.get("turn_acceleration", 2.0),
    }
    for who, share in shares.items():
        for k in np.flatnonzero(share > 1 + OVER):
            at = hops[min(int(k), len(hops) - 1)]
            yield f"pace: {who} gains speed at {share[k]:.4f} of its limit about state {at}"


def _steering(who: str, course: Course, base: Array, times: Array, still: float = CREPT) -> Iterator[str]:
    """Objections to a car that is on another arc before its steering can have turned.

    The mean angle between two of its poses is met somewhere there: of a wheel one turning radius ahead of the
    axle.
    """
    facts, limits = course.machine.facts, course.world.get("speeds") or {}
    if facts.base != "car":
        return
    moved = np.diff(base, axis=0)
    turn = wrapped(moved[:, 2])
    middle = base[:-1, 2] + turn / 2
    ahead = moved[:, 0] * np.cos(middle) + moved[:, 1] * np.sin(middle)
    length = np.copysign(np.hypot(*moved[:, :2].T) / np.sinc(turn / 2 / np.pi), ahead)
    k = np.flatnonzero(np.abs(length) > still)
    turned = np.abs(np.diff(np.arctan(facts.turning_radius * turn[k] / length[k])))
    passed = times[k[1:] + 1] - times[k[:-1]]
    most = limits.get("steering_velocity", 1.0) * (1 + OVER) * passed + TURNED
    for there in k[1:][turned > most]:
        yield f"{who}: the steering turns too far in the time before {times[there]:.4f} s"
