"""Where the last link may touch, and how: near a set-point, what lies there, with its tip and not too deep.

A plane is laid on what is touched. No more of the link than the rules allow lies beyond it, and all of the
link that comes within the clearance of the plane lies within ``tool_contact`` of the tool point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from regionik.planners.collision.convex_bodies import NONE, Piece
from regionik.planners.collision.distances import Obstacles, box_distances
from regionik.planners.collision.gjk import hull_distance
from regionik.verification.motion import Indices, Mask
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TOUCH = 1e-6  # [m]
FLAT = 1e-12  # length that counts as none [m]
SHALLOW = 1e-6  # to which depths in meshes are found [m]
DEEPEST = 1.0  # that they are told [m]
BALLS = 33  # that stand for a capsule
SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])  # as of LinkBox


@dataclass(frozen=True, eq=False)
class Contact:
    """What the tool works on.

    Attributes
    ----------
    trees : dict of int to cKDTree
        Set-points that lie on, in or near a solid, by the solid's index.
    reach : float
        ``tool_contact`` [m].
    clearance : float
        ``arm_clearance``, of all that is farther than ``reach`` from the tool point [m].
    depth : float
        To which the link may sink in, `Rules.deepest_contact` [m].
    """

    trees: dict[int, cKDTree]
    reach: float
    clearance: float
    depth: float

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
    rules, reach = world.rules, world.rules.tool_contact
    for target in world.task:
        spot = target.position[None, None]
        near = np.unique(obstacles.owner[box_distances(obstacles, spot, spot)[0] <= reach])
        distances = [(obstacles.solids[k].distance(target.position), int(k)) for k in near.tolist()]
        if distances and reach > 0 and min(distances)[0] <= reach:
            owners.setdefault(min(distances)[1], []).append(target.position)
    return Contact(
        {k: cKDTree(np.array(spots)) for k, spots in sorted(owners.items())},
        reach,
        rules.arm_clearance,
        rules.deepest_contact,
    )


def core_weights(corners: Array, off: float, tool: Array) -> Array:
    """Weights (k, k) of a hull's corners in the corners of what is left of it, that much off on all sides.

    Where nothing would be left, it is a point as far from the tool as it may be.
    """
    sides = (corners[[4, 2, 1] if len(corners) == 8 else [1]] - corners[0]) / 2
    square = np.maximum((sides * sides).sum(1), FLAT**2)
    shares = off / np.sqrt(square)
    toward = np.clip(sides @ (tool - corners.mean(0)) / square, -1.0, 1.0)
    signs = SIGNS if len(corners) == 8 else SIGNS[[0, 7], :1]
    at = signs * np.maximum(0.0, 1.0 - shares) - np.clip(toward * np.maximum(0.0, shares - 1.0), -1.0, 1.0)
    weights: Array = ((1 + at[:, None] * signs[None]) / 2).prod(-1)
    return weights


def depth_of(contact: Contact, moved: Moved, piece: Piece) -> float:
    """Depth to which a solid has sunk into a mesh, all of it being allowed to touch [m]."""
    low, high = 0.0, DEEPEST
    while high - low > SHALLOW:
        depth = (low + high) / 2
        fits = touches(replace(contact, reach=np.inf, clearance=0.0, depth=depth), moved, piece)
        low, high = (low, depth) if fits else (depth, high)
    return high


class Moved(NamedTuple):
    """A link's solid and the tool over a part of a hop: at its beginning, middle and end.

    Between those samples corners stray from their chords by ``bulge``, and the tool by ``tool_bulge`` [m].
    """

    hulls: Array  # (3, k, 3) [m]
    radius: float  # [m]
    tools: Array  # (3, 3) [m]
    bulge: float
    tool_bulge: float


def touches(contact: Contact, moved: Moved, piece: Piece) -> bool:
    """Whether a solid is proven to touch a piece no deeper than it may, and with no more than its tip."""
    weights = core_weights(moved.hulls[1], max(0.0, contact.depth - moved.radius), moved.tools[1])
    cores = weights @ moved.hulls
    if _behind(contact, moved, cores, piece):
        return True
    if piece.mesh is None or piece.mesh.contains(cores[1, 0]):
        return False
    # The way from what is left, outside the mesh, to what lies inside goes down through a triangle's plane.
    around = moved.radius + moved.bulge + contact.clearance
    triangles = piece.mesh.vertices[piece.mesh.faces]
    low, high = moved.hulls.min((0, 1)) - around, moved.hulls.max((0, 1)) + around
    near = ((triangles.min(1) <= high) & (triangles.max(1) >= low)).all(1)
    return all(_behind(contact, moved, cores, Piece(one, NONE)) for one in triangles[near])


def _behind(contact: Contact, moved: Moved, cores: Array, piece: Piece) -> bool:
    """Whether a plane shows that a solid touches the hull of a piece as it may; ``cores`` is what is left."""
    normal = np.zeros(3)
    apart = (
        hull_distance(cores[1], np.ascontiguousarray(piece.corners), piece.disc, normal, np.empty(3))[0]
        > piece.ball
    )
    normals = [normal] if apart else []
    if len(piece.corners) == 3:
        square = np.cross(piece.corners[1] - piece.corners[0], piece.corners[2] - piece.corners[0])
        square /= max(float(np.linalg.norm(square)), FLAT**2)
        normals += [square, -square]
    way = float(np.linalg.norm(moved.hulls - moved.hulls[1], axis=-1).max()) + moved.bulge
    drift = way + float(np.linalg.norm(moved.tools - moved.tools[1], axis=-1).max()) + moved.tool_bulge
    for n in normals:
        height = float(piece.support(n))
        left = (cores @ n).min() - max(0.0, moved.radius - contact.depth)
        sunk = (moved.hulls @ n).min() - moved.radius + contact.depth
        if min(left, sunk) < height + moved.bulge - TOUCH:
            continue
        plane = n, height + contact.clearance + way
        if farthest(moved.hulls[1], moved.radius, plane, moved.tools[1]) <= contact.reach + TOUCH - drift:
            return True
    return False


def farthest(corners: Array, radius: float, plane: tuple[Array, float], tool: Array) -> float:
    """Distance from the tool of what of a solid lies below a plane (n, n . p), or a little more.

    A box is cut by the plane; balls along its axis hold a capsule.
    """
    normal, height = plane
    if len(corners) == 8:
        above = corners @ normal - height
        i, j = np.nonzero((above[:, None] < 0) & (above > 0))
        share = (above[i] / (above[i] - above[j]))[:, None]
        cut = np.concatenate([corners[above <= 0], corners[i] + share * (corners[j] - corners[i])])
        return float(np.linalg.norm(cut - tool, axis=1).max(initial=0.0))
    centers = np.linspace(corners[0], corners[1], BALLS)
    r = radius + float(np.linalg.norm(centers[1] - centers[0])) / 2
    room, off = np.clip(height - centers @ normal, None, r), centers - tool
    up, size = off @ normal, np.linalg.norm(off, axis=1)
    free = up * r <= room * size  # the farthest point of the ball is below the plane
    rim = np.sqrt(np.maximum(size**2 - up**2, 0.0)) + np.sqrt(np.maximum(r**2 - room**2, 0.0))
    far = np.where(free, size + r, np.hypot(up + room, rim))
    return float(far[room >= -r].max(initial=0.0))
