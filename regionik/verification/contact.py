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


def shrunk_weights(corners: Array, inset: float, tools: Array) -> Array:
    """Weights (m, k, k) of corners (m, k, 3) of a solid in m places in those of the same shrunk on all sides.

    It is a box, segment or hull. Where nothing would be left, it is a point as far from the tool (m, 3) as it
    may be. A hull is drawn in towards the mean of its corners, to a speck at most.
    """
    count = corners.shape[1]
    if count > len(SIGNS):
        thickness = float(polytope(corners[0]).depth(corners[0].mean(0)))
        left = max(OPTIONS.min_shrunk_share, 1.0 - inset / thickness)
        return np.broadcast_to(left * np.eye(count) + (1.0 - left) / count, (len(corners), count, count))
    sides = (corners[:, [4, 2, 1] if count == len(SIGNS) else [1]] - corners[:, :1]) / 2
    square = np.maximum((sides * sides).sum(-1), DEGENERATE**2)
    shares = inset / np.sqrt(square)
    toward = np.clip((sides * (tools - corners.mean(1))[:, None]).sum(-1) / square, -1.0, 1.0)
    signs = SIGNS if count == len(SIGNS) else SIGNS[[0, 7], :1]
    aside = np.clip(toward * np.maximum(0.0, shares - 1.0), -1.0, 1.0)
    at = signs * np.maximum(0.0, 1.0 - shares)[:, None] - aside[:, None]
    weights: Array = ((1 + at[:, :, None] * signs) / 2).prod(-1)
    return weights


class SweptSolids(NamedTuple):
    """A link's solid and the tool over m parts of segments, at samples of each.

    Between them corners leave their chords by at most ``bulge``, the tool by ``tool_bulge`` [m].
    """

    hulls: Array  # (m, samples, k, 3) [m]
    radius: float  # [m]
    tools: Array  # (m, samples, 3) [m]
    bulge: Array  # (m,)
    tool_bulge: Array  # (m,)

    @property
    def middle(self) -> tuple[Array, Array]:
        """Corners (m, k, 3) and tools (m, 3) at the sample in the middle [m]."""
        k = self.hulls.shape[1] // 2
        return self.hulls[:, k], self.tools[:, k]

    def take(self, which: Mask | Indices | slice) -> SweptSolids:
        tools, bulges = self.tools[which], (self.bulge[which], self.tool_bulge[which])
        return SweptSolids(self.hulls[which], self.radius, tools, *bulges)

    def shrunk(self, contact: ToolContact) -> Array:
        """Corners of the solids without what may sink in, (m, samples, k, 3) [m]."""
        hulls, tools = self.middle
        cores: Array = (
            shrunk_weights(hulls, max(0.0, contact.depth - self.radius), tools)[:, None] @ self.hulls
        )
        return cores


def mesh_depth(contact: ToolContact, swept: SweptSolids, piece: Piece) -> float:
    """Depth to which one solid has sunk into a mesh, where all of it may touch [m]."""
    low, high = 0.0, OPTIONS.max_depth
    while high - low > OPTIONS.contact_depth_step:
        depth = (low + high) / 2
        allowed = is_allowed(replace(contact, reach=np.inf, clearance=0.0, depth=depth), swept, piece)
        low, high = (low, depth) if allowed else (depth, high)
    return high


def is_allowed(contact: ToolContact, swept: SweptSolids, piece: Piece) -> bool:
    """Return whether one solid is proven to touch a piece no deeper than allowed, and only with its tip."""
    cores = swept.shrunk(contact)
    if _plane_proves(contact, swept, cores, piece):
        return True
    if piece.mesh is None or piece.mesh.contains(cores[0, swept.hulls.shape[1] // 2, 0]):
        return False
    # A line from the shrunk solid, outside the mesh, to a point inside goes down through a triangle's plane.
    around = swept.radius + swept.bulge + contact.clearance
    triangles = piece.mesh.vertices[piece.mesh.faces]
    low, high = swept.hulls.min((0, 1, 2)) - around, swept.hulls.max((0, 1, 2)) + around
    near = ((triangles.min(1) <= high) & (triangles.max(1) >= low)).all(1)
    return all(_plane_proves(contact, swept, cores, Piece(triangle, NONE)) for triangle in triangles[near])


def _plane_proves(contact: ToolContact, swept: SweptSolids, cores: Array, piece: Piece) -> bool:
    """Return whether a plane on the hull of a piece proves the contact of one solid allowed."""
    normal = np.zeros(3)
    corners, core = np.ascontiguousarray(piece.corners), np.ascontiguousarray(cores[0, cores.shape[1] // 2])
    apart = hull_distance(core, corners, piece.disc, normal, np.empty(3))[0] > piece.ball
    normals = [normal] if apart else []
    if len(corners) == 3:
        face = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        face /= max(float(np.linalg.norm(face)), DEGENERATE**2)
        normals += [face, -face]
    return any(planes_prove(contact, swept, cores, n[None], piece.support(n[None]))[0] for n in normals)


def planes_prove(
    contact: ToolContact, swept: SweptSolids, cores: Array, normals: Array, heights: Array
) -> Mask:
    """Mask of solids whose contact planes ``normals @ p = heights``, (m, 3) and (m,), prove allowed.

    Of the pieces touched nothing is above the planes; ``cores`` are the solids `SweptSolids.shrunk`.
    """
    hulls, tools = swept.middle
    moved = np.linalg.norm(swept.hulls - hulls[:, None], axis=-1).max((1, 2)) + swept.bulge
    drift = moved + np.linalg.norm(swept.tools - tools[:, None], axis=-1).max(1) + swept.tool_bulge
    along = normals[:, None, :, None]
    core = (cores @ along).min((1, 2, 3)) - max(0.0, swept.radius - contact.depth)
    deepest = (swept.hulls @ along).min((1, 2, 3)) - swept.radius + contact.depth
    proven: Mask = np.minimum(core, deepest) >= heights + swept.bulge - TOUCH
    near = np.flatnonzero(proven)
    below = heights[near] + contact.clearance + moved[near]
    farthest = farthest_below_planes(hulls[near], swept.radius, normals[near], below, tools[near])
    proven[near] = farthest <= contact.reach + TOUCH - drift[near]
    return proven


def farthest_below_planes(
    corners: Array, radius: float, normals: Array, heights: Array, tools: Array
) -> Array:
    """Upper bounds (m,) for the distances from tools of what of a solid lies below planes [m].

    A box or hull, by its corners (m, k, 3), is cut by the plane; a capsule is covered by spheres.
    """
    if corners.shape[1] > 2:
        above = (corners @ normals[:, :, None])[..., 0] - heights[:, None]
        lengths = np.linalg.norm(corners - tools[:, None], axis=-1)
        farthest: Array = np.where(above <= 0, lengths, 0.0).max(1, initial=0.0)
        m, i, j = np.nonzero((above < 0)[:, :, None] & (above > 0)[:, None])
        share = (above[m, i] / (above[m, i] - above[m, j]))[:, None]
        cut = corners[m, i] + share * (corners[m, j] - corners[m, i])
        np.maximum.at(farthest, m, np.linalg.norm(cut - tools[m], axis=1))
        return farthest
    shares = np.linspace(0.0, 1.0, OPTIONS.capsule_spheres)[:, None]
    centers = corners[:, :1] + shares * (corners[:, 1:] - corners[:, :1])
    r = (radius + np.linalg.norm(centers[:, 1] - centers[:, 0], axis=-1) / 2)[:, None]
    room = np.clip(heights[:, None] - (centers @ normals[:, :, None])[..., 0], None, r)
    off = centers - tools[:, None]
    up, size = (off @ normals[:, :, None])[..., 0], np.linalg.norm(off, axis=-1)
    free = up * r <= room * size  # the farthest point of the sphere is below the plane
    rim = np.sqrt(np.maximum(size**2 - up**2, 0.0)) + np.sqrt(np.maximum(r**2 - room**2, 0.0))
    far = np.where(free, size + r, np.hypot(up + room, rim))
    return np.where(room >= -r, far, 0.0).max(1, initial=0.0)
