"""What a timing makes of its limits, and where the tool cannot go as fast as is asked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from regionik.timing.limits import Limits, Mask, tool_velocity
from regionik.timing.trajectory import Sample, Trajectory
from regionik.values import Motion
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

RATE = 1000.0  # at which limits are checked [Hz]
CHUNK = 50_000  # of these instants at a time
HELD = 0.99  # of the asked speed, from which it counts as held
TOLD = 20  # places where it is not
RESTS = 1e-6  # tool speed below which the tool stays at a set-point [m/s]


def looked(limits: Limits, motion: Motion) -> Iterator[tuple[Sample, Mask]]:
    """The motion at a thousand instants a second, some at a time, and whether the tool is on the path."""
    found = Trajectory(limits.robot, motion)
    working = limits.working(motion) if len(motion) > 1 else np.zeros(1, dtype=bool)  # one state has no hop
    times = np.append(np.arange(0.0, found.duration, 1 / RATE), found.duration)
    for some in np.array_split(times, 1 + len(times) // CHUNK):
        hop = np.searchsorted(motion.time, some, side="right") - 1
        yield found.sample(some), working[np.clip(hop, 0, len(working) - 1)]


def slowing(limits: Limits, motion: Motion) -> float:
    """By which factor a motion must be slower to keep all limits, at a thousand instants a second."""
    looks = (float(limits.slowing(*look.columns, on).max()) for look, on in looked(limits, motion))
    return max(looks, default=1.0)


def figures(limits: Limits, motion: Motion, blend: float) -> dict[str, Any]:
    """Plain numbers about a timing, for ``Plan.stats``."""
    used: dict[str, float] = {}
    time: list[Array] = []
    speed: list[Array] = []
    asked = limits.speeds.tool_velocity
    for look, on in looked(limits, motion):
        z, velocity, _ = look.columns
        shares = limits.shares(*look.columns, on)
        used = {name: max(used.get(name, 0.0), float(share.max())) for name, share in shares.items()}
        if asked is not None:
            time.append(look.time[on])
            speed.append(np.linalg.norm(tool_velocity(limits.robot, z[on], velocity[on]), axis=1))
    told: dict[str, Any] = {"duration": float(motion.time[-1]), "blend": blend, "used": used}
    if asked is not None:
        told["tool"] = _held(limits, motion, asked, np.concatenate(time), np.concatenate(speed))
    return told


def _held(limits: Limits, motion: Motion, asked: float, time: Array, speed: Array) -> dict[str, Any]:
    """Where the tool keeps a speed on the path: the share of its time there, and what keeps it from it."""
    slow = np.concatenate([[False], speed < HELD * asked, [False]])
    apart = np.concatenate([[True], np.diff(time) > 1.5 / RATE, [True]])
    starts = np.flatnonzero(slow[1:] & (~slow[:-1] | apart))
    ends = np.flatnonzero(slow[:-1] & (~slow[1:] | apart))
    longest = np.argsort(time[starts] - time[ends - 1], kind="stable")[:TOLD]
    least = [a + int(np.argmin(speed[a:b])) for a, b in zip(starts[longest], ends[longest], strict=True)]
    names = limits.closest(*Trajectory(limits.robot, motion).sample(time[least]).columns)
    places = [
        {"from": float(time[starts[k]]), "to": float(time[ends[k] - 1]), "least": float(speed[m]), "by": name}
        for k, m, name in zip(longest.tolist(), least, names, strict=True)
    ]
    share = float(np.mean(speed >= HELD * asked)) if len(speed) else 0.0
    return {"asked": asked, "held": share, "below": len(starts), "places": places}


def check_tool_speed(limits: Limits, motion: Motion) -> None:
    """Refuse a tool speed that joints or base cannot give it, somewhere on the path.

    Raises
    ------
    InputError
        With the joint, its speed and the time in the motion at hand.
    """
    asked = limits.speeds.tool_velocity
    if asked is None:
        raise InputError("hold: expected a tool speed to hold; give tool_velocity")
    for look, on in looked(limits, motion):
        z, velocity, _ = look.columns
        speed = np.linalg.norm(tool_velocity(limits.robot, z, velocity), axis=1)
        moves = on & (speed > RESTS)
        if not moves.any():
            continue
        wanted = velocity[moves] * (asked / speed[moves])[:, None]
        name, value, limit, k = limits.fastest(wanted)
        if value > limit * (1 + 1e-9):
            raise InputError(
                f"tool_velocity: {asked:g} m/s cannot be held at t = {look.time[moves][k]:.3f} s: "
                f"{name} would go at {value:.3g}, its limit is {limit:.3g}"
            )
