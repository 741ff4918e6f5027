"""Cells of a reach that damped least squares gave up too early, asked for all branches of a closed form.

From a neighbour it follows one branch, and where that ends, at a singular posture or a limit, another may go
on. So edges that were cut are asked a little beyond their cut, and cells that were dropped in their middle.
"""

from __future__ import annotations

import numpy as np

from regionik.planners.reach.polar_cells import PolarCells
from regionik.planners.solvers.closed_form import Polish, decomposition, postures_at
from regionik.planners.solvers.damped_least_squares import ORIENTATION, Aim
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.chain import Chain

BEYOND = 0.125, 0.375  # shares of an edge by which a cut is moved where the places there have postures


def can_ask(chain: Chain, kind: int) -> bool:
    """True where a closed form knows all postures at an aim of a kind at once."""
    form = decomposition(chain) if kind == ORIENTATION else None
    return form is not None and form.swept is None


def asked_cells(chain: Chain, aim: Aim, within: Polish, cells: PolarCells, met: Mask) -> PolarCells:
    """Cells that count, their cuts moved outward as far as a closed form knows postures there.

    Parameters
    ----------
    chain : Chain
        One that `can_ask`, from a base frame at heading zero.
    aim : Aim
        Above the origin.
    within : Polish
        Accuracy that postures have on it.
    met : (m,) array of bool
        Cells in whose middle a posture is known.
    """
    found, middles = cells.found, cells.middles[2]
    edges = np.concatenate([_cut(found[:-1], found[1:], 0), _cut(found, np.roll(found, -1, axis=1), 1)])
    sides = cells.outward.copy(), cells.onward.copy()
    cuts = np.array([sides[side][i, j] for side, i, j in edges.tolist()])
    inside = found[edges[:, 1], edges[:, 2]]
    shares = cuts + np.where(inside, 1.0, -1.0) * np.array(BEYOND)[:, None]
    wide, turn = cells.distances[1], 2 * np.pi / len(cells.bearings)
    out, on = np.where(edges[:, 0] == 0, shares, 0.0), np.where(edges[:, 0] == 1, shares, 0.0)
    places = np.stack([(edges[:, 1] + out) * wide, (edges[:, 2] + on) * turn], axis=-1)
    real = (shares > 0.0) & (shares < 1.0)
    known = _known(chain, aim, within, np.concatenate([places[real], middles[~met]]))
    real[real] = known[: np.count_nonzero(real)]
    moved = np.where(real[0], np.where(real[1], shares[1], shares[0]), cuts)
    for (side, i, j), share in zip(edges.tolist(), moved.tolist(), strict=True):
        sides[side][i, j] = share
    counted = met.copy()
    counted[~met] = known[len(known) - np.count_nonzero(~met) :]
    return PolarCells(cells.distances, cells.bearings, found, *sides).kept(counted)


def _cut(found: Mask, there: Mask, side: int) -> Index:
    """Edges of a side with one end in the reach: side, and indices of distance and bearing, (k, 3)."""
    i, j = np.nonzero(found != there)
    return np.column_stack([np.full(len(i), side), i, j])


def _known(chain: Chain, aim: Aim, within: Polish, places: Array) -> Mask:
    """Mask of the distances and bearings (m, 2) from which a posture meets an aim."""
    distance, bearing = places.T
    tools = np.tile(np.eye(4), (len(places), 1, 1))
    tools[:, :3, :3] = aim.turn
    tools[:, 0, 3], tools[:, 1, 3] = -distance * np.cos(bearing), -distance * np.sin(bearing)
    tools[:, 2, 3] = aim.position[2]
    known = np.zeros(len(places), dtype=np.bool_)
    if len(places):
        known[postures_at(chain, tools, within)[1]] = True
    return known
