"""Lattice of base poses, the moves of a base on wheels between them, and the least cost to get on by them.

Poses stand on a square grid with sixteen headings, each along a short vector of the grid, so that a base that
drives straight on comes to poses of the lattice again. Source: state lattices (Pivtoraiko, Knepper and Kelly,
J. Field Robotics 26, 2009), with headings as there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.driving.reeds_shepp import words_between
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index, Mask

_QUADRANT = ((1, 0), (2, 1), (1, 1), (1, 2))
STEPS = tuple(
    (a * c - b * s, a * s + b * c) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1)) for a, b in _QUADRANT
)  # shortest way straight on from each heading, in cells
HEADINGS = np.array([math.atan2(b, a) for a, b in STEPS])  # [rad]
MAX_ARC_DETOUR = 1.1  # longest curve of a car against its chord that is a move
MAX_ARC_RADIUS = 2.0  # largest radius of its arcs, in turning radii
_MIN_SAVING = 1e-9  # costs that differ less are the same [m]


class LatticeMove(NamedTuple):
    """A move from one heading to another, by an offset in cells, and its cost [m]."""

    start: int
    end: int
    dx: int
    dy: int
    cost: float


def spin_moves(cell: float, turn_weight: float) -> tuple[LatticeMove, ...]:
    """Moves of a base that turns on the spot: to the next heading, and straight on and back.

    Parameters
    ----------
    cell : float
        Of the grid [m].
    turn_weight : float
        Cost of turning against driving [m/rad].
    """
    count, moves = len(STEPS), list[LatticeMove]()
    for k, (dx, dy) in enumerate(STEPS):
        length = cell * math.hypot(dx, dy)
        moves += [LatticeMove(k, k, dx, dy, length), LatticeMove(k, k, -dx, -dy, length)]
        for other in ((k + 1) % count, (k - 1) % count):
            moves.append(LatticeMove(k, other, 0, 0, turn_weight * abs(_turn(k, other))))
    return tuple(moves)


def car_moves(cell: float, turning_radius: float) -> tuple[LatticeMove, ...]:
    """Moves of a car: straight on, and curves without a change of direction to the next headings; and back.

    A curve that starts and ends on the lattice is about an arc, of the turning radius or a wider one.
    """
    moves = set[LatticeMove]()
    for k, (dx, dy) in enumerate(STEPS):
        moves.add(LatticeMove(k, k, dx, dy, cell * math.hypot(dx, dy)))
        for other in ((k + 1) % len(STEPS), (k - 1) % len(STEPS)):
            turn = _turn(k, other)
            middle = HEADINGS[k] + turn / 2
            for radius in np.linspace(1.0, MAX_ARC_RADIUS, 5) * turning_radius:
                chord = 2 * radius * math.sin(abs(turn) / 2) / cell
                spot = round(chord * math.cos(middle)), round(chord * math.sin(middle))
                moves |= _curve(k, other, *spot, cell, turning_radius)
    return tuple(
        sorted(moves | {LatticeMove(end, start, -dx, -dy, cost) for start, end, dx, dy, cost in moves})
    )


def _curve(k: int, other: int, dx: int, dy: int, cell: float, radius: float) -> set[LatticeMove]:
    """The move of a car between two poses, if its shortest curve goes forwards all along and is short."""
    here, there = np.array([0.0, 0.0, HEADINGS[k]]), np.array([cell * dx, cell * dy, HEADINGS[other]])
    words, lengths = words_between(here, there, radius)
    if not len(words) or (words[0][:, 0] < 0).any():
        return set()
    short = lengths[0] <= MAX_ARC_DETOUR * cell * math.hypot(dx, dy)
    return {LatticeMove(k, other, dx, dy, float(lengths[0]))} if short else set()


def relax(value: Array, free: Mask, moves: tuple[LatticeMove, ...]) -> None:
    """Lower values to the least of the costs of moves and the value that these lead to, in place.

    Parameters
    ----------
    value : (16, nx, ny) array
        Cost from each pose, infinite where none is known.
    free : (16, nx, ny) array of bool
        Poses that moves may start from and lead through.
    """
    ways = np.array([move[:4] for move in moves], dtype=np.int64).reshape(-1, 4)
    _relax(value, free, ways, np.array([move.cost for move in moves]))


@compiled
def _relax(value: Array, free: Mask, ways: Index, cost: Array) -> None:
    """Lower values in place; ``ways`` (k, 4) are the starts, ends and offsets of the moves."""
    wide, deep = value.shape[1:]
    lowered = True
    while lowered:
        lowered = False
        for k in range(len(ways)):
            start, end, dx, dy = ways[k]
            for x in range(max(0, -dx), wide - max(0, dx)):
                for y in range(max(0, -dy), deep - max(0, dy)):
                    better = value[end, x + dx, y + dy] + cost[k]
                    if free[start, x, y] and better < value[start, x, y] - _MIN_SAVING:
                        value[start, x, y] = better
                        lowered = True


def _turn(k: int, other: int) -> float:
    """Angle from one heading to another, the shorter way [rad]."""
    return float(math.remainder(HEADINGS[other] - HEADINGS[k], 2 * math.pi))
