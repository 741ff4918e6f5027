"""Numbers that tune covers and tours: up to which size they are exact, and how long better ones are sought.

Kernels read numbers of their modules alone, so those of kernels stand there.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CoverageOptions:
    """All of them."""

    max_nodes: int = 20_000  # of branch and bound for a cover, which then returns the best bound too
    faces_at_once: int = 512  # compared with others in one product, the largest first
    max_overlaid: int = 200  # areas, at once: of more, but every second or third at first
    max_exact_order: int = 12  # points whose best order is found by dynamic programming over subsets
    max_alternations: int = 10  # of order and choice in a tour of sets
    max_polygon_rounds: int = 50  # in which points of a tour through polygons are moved
    # Or-opt of longer tours, from double bridges again and again.
    neighbours: int = 12  # of a node, that it may be joined to
    bridges_per_node: int = 60
    bridge_width: int = 40  # nodes within which one lies, so that it stays a local change


COVERAGE = CoverageOptions()
