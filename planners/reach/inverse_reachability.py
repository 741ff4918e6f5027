"""Places of an arm's base from which it meets a pose: samples of its postures, nearest to the pose first.

A base that stands upright on the floor and may go and turn anywhere leaves three numbers of a tool's pose to
the arm: its height, and which way is up in its frame. Postures drawn within the limits are kept with both;
those nearest to a pose, moved by damped least squares, meet it from places all over its reach.

Source: the inverse reachability distribution of Vahrenkamp, Asfour and Dillmann, Robot placement based on
reachability inversion (ICRA 2013), here without voxels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.kernels import compiled
from regionik.planners.reach.options import REACH
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, POSITION, Aim, polish
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.worlds.arms import pivot_index, sliding_chain
from regionik.worlds.arrays import Array, Mask
from regionik.worlds.chain import Chain, spread_postures
from regionik.worlds.prepared import made_once

OPTIONS = REACH.pose

MAX_SOLVER_STEPS = 20  # of damped least squares from a sample


class PostureSamples(NamedTuple):
    """Postures drawn within the limits, the pivot at zero."""

    postures: Array  # (m, n)
    tools: Array  # (m, 4, 4) tool frame of each in the arm's base frame
    reach: float  # length that heights are weighed by [m]


class Tolerances(NamedTuple):
    """Largest errors of a posture on target [m], [rad], and the arm's length [m]."""

    error: float
    angle: float
    reach: float


@made_once
def posture_samples(chain: Chain, reach: float) -> PostureSamples:
    """Draw the samples of a chain with a vertical pivot; kept for the last few chains."""
    postures = spread_postures(chain, reach, OPTIONS.samples, 0)
    postures[:, pivot_index(chain)] = 0.0
    return PostureSamples(postures, np.ascontiguousarray(chain.forward(postures)), reach)


def nearest_samples(samples: PostureSamples, rise: float, aim: Aim, count: int) -> NDArray[np.intp]:
    """Indices of the samples (count,) whose height and upward direction are nearest to an aim's.

    The aim is at a height ``rise`` over the arm's base frame [m].
    """
    upward = {POSITION: slice(0), DIRECTION: slice(2, 3), ORIENTATION: slice(3)}[aim.kind]
    away = np.square(samples.tools[:, 2, upward] - aim.turn[2, upward]).sum(axis=1)
    away += np.square((samples.tools[:, 2, 3] - rise) / (0.5 * samples.reach))
    return np.argpartition(away, count)[:count] if count < len(away) else np.arange(len(away))


def posture_seeds(
    chain: Chain, samples: PostureSamples, rise: float, aim: Aim, within: Tolerances, count: int
) -> tuple[Array, Array]:
    """Postures that meet an aim from somewhere, and where from.

    Parameters
    ----------
    chain : Chain
        With a vertical pivot that has no limits.
    rise : float
        Height of the aim over the arm's base frame, in place of its position [m].
    count : int
        Of the samples that are tried.

    Returns
    -------
    postures : (k, n) array
        From an arm's base frame that faces the tool.
    places : (k, 2) array
        Distance of pivot axis and tool [m], and bearing of the pivot axis as seen from the tool [rad].
    """
    chosen = nearest_samples(samples, rise, aim, count)
    postures, places = samples.postures[chosen], np.empty((len(chosen), 2))
    level = Aim(np.array([0.0, 0.0, rise]), aim.kind, aim.turn, aim.cone)
    arm = serial_arm(sliding_chain(chain))
    met = _moved(arm, level, samples.tools[chosen], within, pivot_index(chain), postures, places)
    return postures[met], places[met]


@compiled
def _moved(
    arm: SerialArm, aim: Aim, tools: Array, within: Tolerances, pivot: int, postures: Array, places: Array
) -> Mask:
    """Move postures to an aim, each where it is nearest to it; they and the places are overwritten.

    The base goes along, on the two slides that the arm begins with: of an arm of few joints only some places
    meet the aim.
    """
    met, joints = np.zeros(len(postures), dtype=np.bool_), np.zeros(len(arm.lower))
    for k in range(len(postures)):
        spin = _nearest_spin(tools[k], aim)
        azimuth = math.atan2(tools[k, 1, 3], tools[k, 0, 3])
        places[k, 0] = np.hypot(tools[k, 0, 3], tools[k, 1, 3])
        places[k, 1] = (azimuth - spin - np.pi) % (2 * np.pi)
        postures[k, pivot] -= azimuth
        there = aim_at(aim, places[k, 0], places[k, 1], places[k, 1] + np.pi)
        joints[:2], joints[2:] = 0.0, postures[k]
        error, angle, _ = polish(
            arm, there, joints, within.reach, within.error, within.angle, MAX_SOLVER_STEPS
        )
        met[k] = error <= within.error and angle <= within.angle
        dx, dy = places[k, 0] - joints[0], -joints[1]  # the tool as seen from where the base has come to
        turn = math.atan2(dy, dx)
        places[k, 0], places[k, 1] = np.hypot(dx, dy), (places[k, 1] + turn) % (2 * np.pi)
        postures[k] = joints[2:]
        postures[k, pivot] -= turn
    return met


@compiled
def _nearest_spin(tool: Array, aim: Aim) -> float:
    """Turn of an aim about the vertical that brings it nearest to a tool frame [rad]."""
    T, R = aim.turn, tool
    if aim.kind == DIRECTION:
        if np.hypot(T[0, 2], T[1, 2]) < 1e-9:
            return 0.0
        return float(math.atan2(R[1, 2], R[0, 2]) - math.atan2(T[1, 2], T[0, 2]))
    sine, cosine = 0.0, 0.0
    for i in range(3):
        cosine += T[0, i] * R[0, i] + T[1, i] * R[1, i]
        sine += T[0, i] * R[1, i] - T[1, i] * R[0, i]
    return float(math.atan2(sine, cosine))


@compiled
def aim_at(aim: Aim, distance: float, bearing: float, yaw: float) -> Aim:
    """An aim as an arm sees it from a distance [m] and a bearing [rad], its base frame at a heading [rad]."""
    c, s = math.cos(-yaw), math.sin(-yaw)
    turn = np.empty((3, 3))
    for i in range(3):
        turn[0, i] = c * aim.turn[0, i] - s * aim.turn[1, i]
        turn[1, i] = s * aim.turn[0, i] + c * aim.turn[1, i]
        turn[2, i] = aim.turn[2, i]
    away = bearing + np.pi - yaw
    position = np.array([distance * math.cos(away), distance * math.sin(away), aim.position[2]])
    return Aim(position, aim.kind, turn, aim.cone)
