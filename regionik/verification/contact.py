"""Where the last link may touch: near a set-point, what lies there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from regionik.planners.geometry.collision import Obstacles, box_gaps
from regionik.verification.motion import Indices, Mask
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TOUCH = 1e-6  # [m]


@dataclass(frozen=True, eq=False)
class Contact:
    """What the tool works on.

    Attributes
    ----------
    trees : dict of int to cKDTree
        Set-points that lie on, in or near a solid, by the solid's index.
    reach : float
        ``tool_contact`` [m].
    """

    trees: dict[int, cKDTree]
    reach: float

    def allows(self, solid: Indices, tools: Array, bulge: Array) -> tuple[Mask, Mask]:
        """Whether the tool (m, samples, 3) is near a set-point of the solid: all along, and in the middle."""
        whole = np.zeros(len(solid), dtype=bool)
        middle = np.zeros(len(solid), dtype=bool)
        for k, tree in self.trees.items():
            mine = np.flatnonzero(solid == k)
            if not len(mine):
                continue
            centre = tools[mine, tools.shape[1] // 2]
            distance, nearest = tree.query(centre)
            away = np.linalg.norm(tools[mine] - tree.data[nearest][:, None], axis=-1).max(1)
            whole[mine] = away + bulge[mine] <= self.reach + TOUCH
            middle[mine] = distance <= self.reach + TOUCH
        return whole, middle


def contact_of(world: World, obstacles: Obstacles) -> Contact:
    """Give each set-point the one solid that it lies on or in, or is nearest to within ``tool_contact``."""
    owners: dict[int, list[Array]] = {}
    reach = world.rules.tool_contact
    for target in world.task:
        spot = target.position[None, None]
        near = np.unique(obstacles.owner[box_gaps(obstacles, spot, spot)[0] <= reach])
        distances = [(obstacles.solids[k].distance(target.position), int(k)) for k in near.tolist()]
        if distances and reach > 0 and min(distances)[0] <= reach:
            owners.setdefault(min(distances)[1], []).append(target.position)
    return Contact({k: cKDTree(np.array(spots)) for k, spots in sorted(owners.items())}, reach)
