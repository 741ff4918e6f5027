"""Reach of any arm on a vertical pivot: postures looked for at many distances, and a bound that holds."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from regionik.planners.inverse import ArmSolver
from regionik.worlds.chain import Chain
from regionik.worlds.pivot import span_of

SAMPLES = 96  # distances looked at, up to the bound of the reach
TOLERANCE = 1e-4  # [m]


@lru_cache(maxsize=4096)
def sampled_reach(chain: Chain, height: float, z: float) -> tuple[tuple[float, float], ...]:
    """Distances between pivot axis and target from which postures were found, as intervals.

    Between two neighbouring samples with a posture the reach is taken to have no gap: that is likely, not
    proven. The pivot turns without end, as the base turns where it cannot.

    Parameters
    ----------
    chain : Chain
    height : float
        Of the arm's base frame over the floor [m].
    z : float
        Height of the target over the floor [m].
    """
    bound = outer_reach(chain, height, z)
    if not bound:
        return ()
    solver = _solver(chain)
    distances = np.linspace(0.0, bound[0][1], SAMPLES)
    goals = np.column_stack([distances, np.zeros(SAMPLES), np.full(SAMPLES, z - height)])
    start = np.clip(np.zeros(chain.dof), solver.chain.lower, solver.chain.upper)
    found = np.concatenate([[False], solver.batch(goals, start).converged, [False]])
    edges = np.flatnonzero(np.diff(found.astype(int)))
    runs = zip(edges[::2], edges[1::2] - 1, strict=True)
    return tuple((float(distances[a]), float(distances[b])) for a, b in runs if b > a)


def outer_reach(chain: Chain, height: float, z: float) -> tuple[tuple[float, float], ...]:
    """Distances beyond which no posture reaches: one interval from 0, or none."""
    span = span_of(chain)
    square = span.length**2 - (z - height - span.height) ** 2
    return () if square < 0 else ((0.0, span.radius + float(np.sqrt(square))),)


@lru_cache(maxsize=16)
def _solver(chain: Chain) -> ArmSolver:
    pivot = replace(chain.joints[0], lower=-np.inf, upper=np.inf)
    return ArmSolver(Chain((pivot, *chain.joints[1:]), chain.T_last_tool), tolerance=TOLERANCE, restarts=4)
