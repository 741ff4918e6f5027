"""Proof that the last link touches no more than the rules allow: what a set-point lies on, with its tip.

A plane is laid on the touched solid. The link sinks in no deeper than allowed below it, and all of the link
that comes within the clearance of the plane lies within ``tool_contact`` of the tool point.
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
from regionik.verification.options import VERIFICATION
from regionik.verification.tolerances import TOUCH
from regionik.worlds.arrays import Array
from regionik.worlds.polytopes import polytope
from regionik.worlds.scene import World

OPTIONS = VERIFICATION.solids

DEGENERATE = 1e-12  # length that counts as zero [m]
SIGNS = np.array(
    [[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
)  # corners of a LinkBox


@dataclass(frozen=True, eq=False)
class ToolContact:
    """What the tool may touch."""

    trees: dict[int, cKDTree]  # set-points that lie on, in or near a solid, by the index of the solid
    reach: float  # ``tool_contact`` [m]
    clearance: float  # ``arm_clearance``, of all that is farther than ``reach`` from the tool point [m]
    depth: float  # largest penetration, `Rules.deepest_contact` [m]

    def near_setpoint(self, solid: Indices, tools: Array, bulge: Array) -> tuple[Mask, Mask]:
        """Masks of tools (m, samples, 3) near a set-point on their solid: all the time, and in the middle.

        Between its samples the tool leaves its chord by at most ``bulge`` (m,) [m].
        """
        always = np.zeros(len(solid), dtype=bool)
        middle = np.zeros(len(solid), dtype=bool)
        for k, tree in self.trees.items():
            rows = np.flatnonzero(solid == k)
            if not len(rows):
                continue
            centre = tools[rows, tools.shape[1] // 2]
            distance, nearest = tree.query(centre)
            farthest = np.linalg.norm(tools[rows] - tree.data[nearest][:, None], axis=-1).max(1)
            always[rows] = farthest + bulge[rows] <= self.reach + TOUCH
            middle[rows] = distance <= self.reach + TOUCH
        return always, middle


def tool_contact(world: World, obstacles: Obstacles) -> ToolContact:
    """Contact that a world allows.

    Each set-point belongs to the one solid that it lies on or in, or is nearest to within ``tool_contact``.
    """
    owners: dict[int, list[Array]] = {}
    rules, reach = world.rules, world.rules.tool_contact
    for target in world.task:
        point = target.position[None, None]
        near = np.unique(obstacles.owner[box_distances(obstacles, point, point)[0] <= reach])
        distances = [(obstacles.solids[k].distance(target.position), int(k)) for k in near.tolist()]
        if distances and reach > 0 and min(distances)[0] <= reach:
            owners.setdefault(min(distances)[1], []).append(target.position)
    return ToolContact(
        {k: cKDTree(np.array(points)) for k, points in sorted(owners.items())},
        reach,
        world.arm_clearance,
        rules.deepest_contact,
    )


def shrunk_weights(corners: Array, inset: float, tool: Array) -> Array:
    """Weights (k, k) of the corners of a box, segment or hull in the corners of the same shrunk on all sides.

    Where nothing would be left, it is a point as far from the tool as it may be. A hull is drawn in towards
    the mean of its corners, to a speck at most.
    """
    if len(corners) > len(SIGNS):
        left = max(OPTIONS.min_shrunk_share, 1.0 - inset / float(polytope(corners).depth(corners.mean(0))))
        return left * np.eye(len(corners)) + (1.0 - left) / len(corners)
    sides = (corners[[4, 2, 1] if len(corners) == 8 else [1]] - corners[0]) / 2
    square = np.maximum((sides * sides).sum(1), DEGENERATE**2)
    shares = inset / np.sqrt(square)
    toward = np.clip(sides @ (tool - corners.mean(0)) / square, -1.0, 1.0)
    signs = SIGNS if len(corners) == 8 else SIGNS[[0, 7], :1]
    at = signs * np.maximum(0.0, 1.0 - shares) - np.clip(toward * np.maximum(0.0, shares - 1.0), -1.0, 1.0)
    return ((1 + at[:, None] * signs[None]) / 2).prod(-1)


def mesh_depth(contact: ToolContact, swept: SweptSolid, piece: Piece) -> float:
    """Depth to which a solid has sunk into a mesh, where all of it may touch [m]."""
    low, high = 0.0, OPTIONS.max_depth
    while high - low > OPTIONS.contact_depth_step:
        depth = (low + high) / 2
        allowed = is_allowed(replace(contact, reach=np.inf, clearance=0.0, depth=depth), swept, piece)
        low, high = (low, depth) if allowed else (depth, high)
    return high


class SweptSolid(NamedTuple):
    """A link's solid and the tool over part of a segment: at its beginning, middle and end.

    Between those samples corners leave their chords by at most ``bulge``, the tool by ``tool_bulge`` [m].
    """

    hulls: Array  # (3, k, 3) [m]
    radius: float  # [m]
    tools: Array  # (3, 3) [m]
    bulge: float
    tool_bulge: float


def is_allowed(contact: ToolContact, swept: SweptSolid, piece: Piece) -> bool:
    """Return whether a solid is proven to touch a piece no deeper than allowed, and only with its tip."""
    weights = shrunk_weights(swept.hulls[1], max(0.0, contact.depth - swept.radius), swept.tools[1])
    cores = weights @ swept.hulls
    if _plane_proves(contact, swept, cores, piece):
        return True
    if piece.mesh is None or piece.mesh.contains(cores[1, 0]):
        return False
    # A line from the shrunk solid, outside the mesh, to a point inside goes down through a triangle's plane.
    around = swept.radius + swept.bulge + contact.clearance
    triangles = piece.mesh.vertices[piece.mesh.faces]
    low, high = swept.hulls.min((0, 1)) - around, swept.hulls.max((0, 1)) + around
    near = ((triangles.min(1) <= high) & (triangles.max(1) >= low)).all(1)
    return all(_plane_proves(contact, swept, cores, Piece(triangle, NONE)) for triangle in triangles[near])


def _plane_proves(contact: ToolContact, swept: SweptSolid, cores: Array, piece: Piece) -> bool:
    """Return whether a plane on the hull of a piece proves the contact allowed; ``cores`` are shrunk."""
    normal = np.zeros(3)
    corners = np.ascontiguousarray(piece.corners)
    apart = hull_distance(cores[1], corners, piece.disc, normal, np.empty(3))[0] > piece.ball
    normals = [normal] if apart else []
    if len(corners) == 3:
        face = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        face /= max(float(np.linalg.norm(face)), DEGENERATE**2)
        normals += [face, -face]
    moved = float(np.linalg.norm(swept.hulls - swept.hulls[1], axis=-1).max()) + swept.bulge
    drift = moved + float(np.linalg.norm(swept.tools - swept.tools[1], axis=-1).max()) + swept.tool_bulge
    for n in normals:
        height = float(piece.support(n))
        core = (cores @ n).min() - max(0.0, swept.radius - contact.depth)
        deepest = (swept.hulls @ n).min() - swept.radius + contact.depth
        if min(core, deepest) < height + swept.bulge - TOUCH:
            continue
        plane = n, height + contact.clearance + moved
        farthest = farthest_below_plane(swept.hulls[1], swept.radius, plane, swept.tools[1])
        if farthest <= contact.reach + TOUCH - drift:
            return True
    return False


def farthest_below_plane(corners: Array, radius: float, plane: tuple[Array, float], tool: Array) -> float:
    """Upper bound for the distance from the tool of what of a solid lies below a plane (n, n . p) [m].

    A box or hull is cut by the plane; a capsule is covered by spheres along its axis.
    """
    normal, height = plane
    if len(corners) > 2:
        above = corners @ normal - height
        i, j = np.nonzero((above[:, None] < 0) & (above > 0))
        share = (above[i] / (above[i] - above[j]))[:, None]
        cut = np.concatenate([corners[above <= 0], corners[i] + share * (corners[j] - corners[i])])
        return float(np.linalg.norm(cut - tool, axis=1).max(initial=0.0))
    centers = np.linspace(corners[0], corners[1], OPTIONS.capsule_spheres)
    r = radius + float(np.linalg.norm(centers[1] - centers[0])) / 2
    room, off = np.clip(height - centers @ normal, None, r), centers - tool
    up, size = off @ normal, np.linalg.norm(off, axis=1)
    free = up * r <= room * size  # the farthest point of the sphere is below the plane
    rim = np.sqrt(np.maximum(size**2 - up**2, 0.0)) + np.sqrt(np.maximum(r**2 - room**2, 0.0))
    far = np.where(free, size + r, np.hypot(up + room, rim))
    return float(far[room >= -r].max(initial=0.0))
