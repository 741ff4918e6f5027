"""Layered graph of a base on wheels: the least cost of the rest of the tool path, lift-offs first.

A layer is a set-point. Its nodes are poses of a lattice whose arm axis lies in a component that pruning
left, and from which the arm likely reaches the set-point. While the tool rests, the base moves from node to
node of the layer as its kind drives; the tool goes on to the next set-point while the base stands in a node
of both; and from any node the tool may be lifted and set down at any node of the next layer. Dynamic
programming from the last layer back gives the least cost of every node, exact on this graph. The search for
motion then tries what costs least first, and proves it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt

from regionik.areas.free_space import FreeSpace, into_spans
from regionik.areas.ground import united
from regionik.areas.sampled_reach import sampled_reach
from regionik.ladder import Ladder
from regionik.planners.driving.arcs import path_of_motions
from regionik.planners.driving.pose_lattice import HEADINGS, LatticeMove, car_moves, relax, spin_moves
from regionik.planners.driving.pose_planner import REEDS_SHEPP, SPIN, Steering, steer
from regionik.planners.driving.reeds_shepp import MAX_MOTIONS
from regionik.planners.progress import track
from regionik.planners.tries import count_tries
from regionik.postures.families import BACK, FRONT
from regionik.postures.poses import axis_of
from regionik.reach_table import reach_table
from regionik.scene import Scene
from regionik.worlds.arms import has_pivot
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.joints import nearest_turn

CELLS_ACROSS = 36  # cells across the areas of half the set-points
CELL_SIZES = 0.01, 0.08  # least and largest [m]
TURN_WEIGHT = 0.5  # cost of turning with the tool on its path against driving [m/rad]
LIFT_COST = 1e3  # cost of a lift-off, more than any driving [m]
EDGE_COST = 0.5  # cost of standing at the edge of an area against driving, for each metre of the tool's path
MAX_EDGE_DEPTH = 0.12  # from the edge of an area beyond which that costs nothing [m]
# set-points computed together, passed before anew, and then kept
LAYERS_AHEAD, LAYER_STRIDE, LAYERS_BEHIND = 384, 256, 32
MAX_STEERED_POSES = 16  # poses, and as many blocks of them, to which the way is steered
BLOCK_CELLS = 3  # cells across a block
DETOUR_COST = 10.0  # cost of a way that steering does not find [m]
HEADING_SLACK = 1e-9  # slack of headings [rad]

Labels = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Layer:
    """Nodes at one set-point: facing of the arm, heading, and cell of the grid."""

    corner: Index  # (2,) cell with the index 0, 0
    owner: Labels  # (f, 16, nx, ny) component that holds the node, -1 for none
    # (f, 16, nx, ny) least cost to do the rest of the path from it, infinite where there is no node [m]
    value: Array


@dataclass(frozen=True, eq=False)
class LayeredSearch:
    """Poses of a base on wheels along a pruned ladder, with the cost of the rest of the path."""

    scene: Scene
    ladder: Ladder
    keep: Mask  # (m,) components that pruning left
    breaks: tuple[int, ...]  # set-points before which it lifts the tool
    free_space: FreeSpace
    _layers: dict[int, Layer] = field(default_factory=dict)

    def onward(self, i: int, components: Sequence[int], here: Array) -> Iterator[tuple[Array, int]]:
        """Return poses at set-point i in some components that the base can steer to, the best first."""
        return ((pose, k) for pose, k, steered in self._ranked(i, components, here) if steered)

    def arrivals(self, i: int, components: Sequence[int], here: Array) -> Iterator[tuple[Array, int]]:
        """Return poses like `onward`, for a base that arrives with the tool lifted."""
        return ((pose, k) for pose, k, _ in self._ranked(i, components, here))

    def lift_offs(self, i: int) -> int | None:
        """Fewest lift-offs after set-point i in the graph; None where it has no node there.

        They are counted as far as costs are computed together.
        """
        least = float(self.layer(i).value.min(initial=np.inf))
        return None if np.isinf(least) else int(least // LIFT_COST)

    def heading(self, i: int, axis: Array) -> float | None:
        """Heading of the cheapest node near a place of the arm axis; None without nodes [rad]."""
        layer = self.layer(i)
        nodes = np.argwhere(layer.owner >= 0)
        if not len(nodes):
            return None
        poses = self._poses(layer.corner, nodes[:, 1:])
        far = np.hypot(*(axis_of(self.scene.robot, poses) - axis).T)
        return float(poses[int(np.argmin(layer.value[tuple(nodes.T)] + far)), 2])

    def layer(self, i: int) -> Layer:
        """Nodes of a set-point, computed together with those of many after it."""
        last = self.ladder.count - 1
        worn = i >= min(self._layers, default=0) + LAYER_STRIDE and last not in self._layers
        if i not in self._layers or worn:
            first = max(0, i - LAYERS_BEHIND)
            self._layers.clear()
            after: Layer | None = None
            for j in track("base ways", range(first, min(first + LAYERS_AHEAD, last + 1))[::-1]):
                after = self._layers[j] = self._valued(j, after)
        return self._layers[i]

    def _valued(self, i: int, after: Layer | None) -> Layer:
        """Nodes of set-point i, given those of the next one: one step of dynamic programming."""
        count_tries()
        corner, owner = self._nodes(i)
        free = owner >= 0
        value = np.full(owner.shape, np.inf)
        if after is None:
            value[free] = 0.0
        else:
            if i + 1 not in self.breaks:
                low = np.maximum(corner, after.corner)
                high = np.minimum(corner + owner.shape[2:], after.corner + after.owner.shape[2:])
                if (low < high).all():
                    mine, other = (_box(low - start, high - start) for start in (corner, after.corner))
                    value[mine] = np.where(free[mine], after.value[other], np.inf)
            value[free] = np.minimum(value[free], LIFT_COST + after.value.min(initial=np.inf))
        hop = [target.position for target in self.scene.task[i : i + 2]]
        stride = float(np.linalg.norm(hop[-1] - hop[0]))  # of the tool, on from here
        for one, where in zip(value, free, strict=True):
            one += EDGE_COST * stride * _nearness(where, max(1, round(MAX_EDGE_DEPTH / self.cell)))
            relax(one, where, self._moves)
        return Layer(corner, owner, value)

    def _nodes(self, i: int) -> tuple[Index, Labels]:
        """First cell of a set-point's window, and the component of every node in it."""
        ladder = self.ladder
        kept = [k for k in range(*ladder.rungs[i : i + 2]) if self.keep[k]]
        around = np.ceil(np.hypot(*self.scene.robot.mount[:2]) / self.cell)
        cells = shapely.get_coordinates(ladder.component[kept]) @ self._turn / self.cell
        corner = np.floor(cells.min(axis=0) - around).astype(np.intp)
        shape = np.ceil(cells.max(axis=0) + around).astype(np.intp) - corner + 1
        owner = np.full((len(self._facings), len(HEADINGS), *shape), -1, dtype=np.intp)
        grid = np.indices((1, *shape))[:, 0].reshape(3, -1).T
        shapely.prepare(ladder.component[kept])
        spans = [self.free_space.sides[side].span for side in ladder.side[kept].tolist()]
        faced = [np.abs(into_spans(self._yaws, *span) - self._yaws) < HEADING_SLACK for span in spans]
        for h in range(len(self._yaws)):
            base = self._poses(corner, grid + np.array([h, 0, 0]))
            reached, axes = self._likely_reach(i, base), axis_of(self.scene.robot, base)
            for k, near in zip(kept[::-1], faced[::-1], strict=True):
                f = self._facings.index(ladder.family[k].facing)
                if near[h]:
                    inside = shapely.contains_xy(ladder.component[k], axes) & reached
                    owner[f, h].flat[inside] = k
        shapely.destroy_prepared(ladder.component[kept])
        return corner, owner

    def _likely_reach(self, i: int, base: Array) -> Mask:
        """Mask of the base poses (n, 3) of one heading from which the arm likely reaches a set-point.

        Areas hold for a base that turns for its arm. One on wheels turns for its way, and where the pivot is
        limited what its arm reaches depends on that; most of all where it has none, and where its tool points
        depends on the heading alone.
        """
        robot, target, yaw = self.scene.robot, self.scene.task[i], float(base[0, 2])
        if self.scene.model(target).turns_freely(self.scene.rules, (yaw, yaw)):
            return np.ones(len(base), dtype=bool)
        held = sampled_reach(robot).holds(base, target.position)
        if target.direction is None or has_pivot(robot.chain):
            return held
        area = united(
            reach_table(self._fixed_heading, [target], (FRONT, BACK), inner=True, span=(yaw, yaw))[2]
        )
        return held & shapely.contains_xy(area, axis_of(robot, base))

    @cached_property
    def _fixed_heading(self) -> Scene:
        """Return the world of a base with a fixed heading."""
        return self.scene.changed(rules=replace(self.scene.rules, heading="fixed"))

    def _ranked(self, i: int, components: Sequence[int], here: Array) -> Iterator[tuple[Array, int, bool]]:
        """Poses of set-point i, their components, and whether the base steers there, the best first.

        They are those that cost least, and the best of the cheapest blocks of cells, so that what blocks the
        arm at one place is left behind.
        """
        layer = self.layer(i)
        nodes = np.argwhere(np.isin(layer.owner, components))
        if not len(nodes):
            return
        owner, value = layer.owner[tuple(nodes.T)], layer.value[tuple(nodes.T)]
        poses = self._poses(layer.corner, nodes[:, 1:])
        far = self._least(here, poses)
        total = value + far
        order = np.argsort(total, kind="stable")
        block = nodes[order, 2] // BLOCK_CELLS * layer.owner.shape[3] + nodes[order, 3] // BLOCK_CELLS
        first = np.unique(block, return_index=True)[1]
        some = order[
            np.union1d(np.arange(min(MAX_STEERED_POSES, len(order))), np.sort(first)[:MAX_STEERED_POSES])
        ]
        ways = np.array([self._steered(i, here, pose) for pose in poses[some]])
        cost = value[some] + np.where(np.isinf(ways), DETOUR_COST + far[some], ways)
        for m in np.argsort(cost, kind="stable").tolist():
            yield poses[some[m]], int(owner[some[m]]), bool(np.isfinite(ways[m]))

    def _least(self, here: Array, poses: Array) -> Array:
        """Lower bound of the cost of steering to poses (n, 3), (n,) [m]."""
        drive, (dx, dy, turn) = self.scene.robot.drive, (poses - here).T
        far, turn = np.hypot(dx, dy), np.abs(nearest_turn(turn))
        if drive.turns_on_the_spot:
            return far + TURN_WEIGHT * turn
        return np.maximum(far, drive.turning_radius * turn)

    def _steered(self, i: int, here: Array, there: Array) -> float:
        """Cost of steering to a pose of set-point i, infinite where that is not free or leaves nodes [m]."""
        ways = np.empty((MAX_MOTIONS, 2))
        cost = float(steer(self.scene.footprint, self._steering, here, there, np.inf, ways))
        if np.isinf(cost) or i == 0:
            return cost
        places = path_of_motions(here, ways, "straight").sample(2 * self.cell)[1:-1]
        held = self._holds(self.layer(i), places) | self._holds(self.layer(i - 1), places)
        return cost if held.all() else np.inf

    def _holds(self, layer: Layer, poses: Array) -> Mask:
        """Return a mask of the base poses (n, 3) whose nearest lattice pose is a node."""
        off = np.abs(np.angle(np.exp(1j * (poses[:, 2:] - self._yaws))))
        cell = np.rint(poses[:, :2] @ self._turn / self.cell).astype(np.intp) - layer.corner
        inside = ((cell >= 0) & (cell < layer.owner.shape[2:])).all(axis=1)
        cell[~inside] = 0
        free: Mask = np.max(layer.owner, axis=0) >= 0
        taken = free[off.argmin(axis=1), cell[:, 0], cell[:, 1]]
        return np.logical_and(inside, taken)

    @cached_property
    def _steering(self) -> Steering:
        drive = self.scene.robot.drive
        if drive.turns_on_the_spot:
            return Steering(SPIN, 0.0, TURN_WEIGHT)
        return Steering(REEDS_SHEPP, drive.turning_radius, 0.0)

    @cached_property
    def _moves(self) -> tuple[LatticeMove, ...]:
        drive = self.scene.robot.drive
        if drive.turns_on_the_spot:
            return spin_moves(self.cell, TURN_WEIGHT)
        return car_moves(self.cell, drive.turning_radius)

    @cached_property
    def _facings(self) -> list[int]:
        return sorted({family.facing for family in self.ladder.family})

    @cached_property
    def _yaws(self) -> Array:
        """Headings of the lattice, (16,) [rad]."""
        return HEADINGS + np.arctan2(*self._turn[:, 0][::-1])

    @cached_property
    def _turn(self) -> Array:
        """Axes of the grid as columns, (2, 2): along most of the tool's path and across."""
        hops = np.diff([target.position[:2] for target in self.scene.task], axis=0)
        lengths, ways = np.hypot(*hops.T), np.arctan2(hops[:, 1], hops[:, 0])
        angle = float(np.angle(lengths @ np.exp(4j * ways))) / 4 if len(hops) else 0.0
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    @cached_property
    def cell(self) -> float:
        """Width of the lattice's cells [m]."""
        low, high = np.split(shapely.bounds(self.ladder.component[self.keep]), 2, axis=1)
        return float(np.clip(np.median(np.max(high - low, axis=1)) / CELLS_ACROSS, *CELL_SIZES))

    def _poses(self, corner: Index, nodes: Index) -> Array:
        """Base poses (n, 3) of nodes (n, 3): heading, and cell from a corner."""
        return np.column_stack([(corner + nodes[:, 1:]) * self.cell @ self._turn.T, self._yaws[nodes[:, 0]]])


def _box(low: Index, high: Index) -> tuple[slice, ...]:
    """Part of a layer's arrays from one cell to another."""
    return (slice(None), slice(None), *map(slice, low.tolist(), high.tolist()))


def _nearness(free: Mask, depth: int) -> Array:
    """Nearness of nodes (16, nx, ny) to the edge of what is free: 1 there, 0 ``depth`` cells inside."""
    cells = [distance_transform_cdt(np.pad(one, 1), "taxicab")[1:-1, 1:-1] for one in free]
    return 1 - np.clip(np.stack(cells) - 1, 0, depth) / depth
