"""Search for a clear posture of an arm in one plane on a target, with its base anywhere on a floor.

Breadth-first branch and bound over `planar_cells`. RULED_OUT is a proof, up to rounding far below a
nanometre; a posture that is found has passed the collision check in space. A budget of cells bounds the work,
so the same question always has the same answer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.collision_checking import is_clear
from regionik.planners.collision.robot_bodies import RobotScene
from regionik.planners.collision.upright_solids import Uprights, signed_distance
from regionik.planners.driving.footprint import fits, fits_nowhere_near
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.planners.geometry.angles import fit, wrap
from regionik.planners.geometry.polygons import contains, near_boundary
from regionik.planners.kernels import compiled
from regionik.planners.reach.planar_capsules import (
    NearObstacles,
    PlaneCapsules,
    judge_obstacles,
    judge_self,
    place_capsules,
)
from regionik.planners.reach.planar_cells import (
    AWAY,
    PITCH,
    TURN,
    YAW,
    ArmMount,
    PlanarCell,
    chord,
    judge_links,
    turn_pivot,
)
from regionik.planners.search.box_search import (
    NO_SIDE,
    PROOF_SLACK,
    Boxes,
    Verdict,
    begin_in_kernel,
    both,
    explore_in_kernel,
    left_open,
    proven,
    verdict_of,
)
from regionik.worlds.arrays import Array, Index

_MAX_REFUSED = 200  # postures that the collision check refused
MIN_OPEN = 1e-6  # cells that leave no more than this open are not bisected [m]
CELLS, REFUSED = range(2)  # what is counted


class ToolDemand(NamedTuple):
    """The demand on the tool."""

    target: Array  # (3,) [m]
    direction: Array  # (3,) of the tool
    cone: float  # half angle about it, pi where the tool may point anywhere [rad]
    seek: bool  # whether a posture is an answer; what else is asked of it may not be known here


class FloorPart(NamedTuple):
    """Places of the pivot axis, as `polygons` has them."""

    vertices: Array  # (n, 2) [m]
    starts: Index  # (m + 1,)


class BaseFloor(NamedTuple):
    """Places and headings of the base on the floor."""

    inner: FloorPart  # where the pivot axis may be at every heading
    outer: FloorPart  # where it may be at some heading, at most
    room: FootprintScene  # the footprint among floor and obstacles; no corners for a base that is a point
    heart: Array  # (2,) middle of a circle in the footprint, in the base's frame [m]
    radius: float  # of that circle [m]
    far: float  # of the footprint from the pivot axis [m]
    spare: float  # what the room keeps beyond the rules [m]


class AnyBase(NamedTuple):
    """A target for an arm in one plane whose base may stand anywhere on a floor."""

    capsules: PlaneCapsules
    mount: ArmMount
    floor: BaseFloor
    around: NearObstacles
    demand: ToolDemand
    scene: RobotScene  # for the check of a posture in space
    margin: float  # that it keeps [m]
    cell: PlanarCell  # overwritten
    base: Array  # (3,) overwritten with what is found
    joints: Array  # (dof,) likewise; joints that do not matter stay as they are
    tally: Index  # (2,) `CELLS` judged and postures `REFUSED`, overwritten


def search_cells(task: AnyBase, rings: Array, most: int) -> tuple[Verdict, float]:
    """Search all over the floor for a clear posture, written to ``task.base`` and ``task.joints``.

    The arm reaches the distances ``rings`` (k, 2) [m]; ``most`` is the budget of cells. Returns the verdict
    and, where it is OPEN, the diagonal of a box round the places that are left, 0 otherwise [m].
    """
    boxes = _search(task, *_first_cells(task.mount, task.demand, rings), most - 1)
    found = proven(boxes)
    if len(found):
        bound_cell(task, boxes.low[found[0]], boxes.high[found[0]])
        _take_middle(task)
        return Verdict.PROVEN, 0.0
    left = left_open(boxes)
    return verdict_of(boxes), _diagonal(task.demand.target, boxes.low[left], boxes.high[left])


@compiled
def _search(task: AnyBase, low: Array, high: Array, budget: int) -> Boxes:
    boxes = begin_in_kernel(_judge_cell, task, low, high)
    return explore_in_kernel(_judge_cell, task, boxes, budget, 1)


def _first_cells(mount: ArmMount, demand: ToolDemand, rings: Array) -> tuple[Array, Array]:
    """Low and high ends of cells (k, 5) that together hold all postures."""
    pitches = [(-math.pi, math.pi)]
    if demand.cone < 0.5 * math.pi:  # the plane faces the direction, or shows it its back
        pitch = math.atan2(demand.direction[2], math.hypot(demand.direction[0], demand.direction[1]))
        pitches = [(middle - demand.cone, middle + demand.cone) for middle in (pitch, math.pi - pitch)]
    turn = 0.5 * (mount.low + mount.high) if np.isfinite(mount.high - mount.low) else 0.0
    wide = min(math.pi, 0.5 * (mount.high - mount.low))
    cells = [
        ((-math.pi, math.pi), pitch, ring, (turn - wide, turn + wide), (elbow, elbow))
        for ring in rings.tolist()
        for pitch in pitches
        for elbow in (-1.0, 1.0)
    ]
    low, high = np.moveaxis(np.array(cells).reshape(-1, 5, 2), 2, 0)
    return low.copy(), high.copy()


def _diagonal(target: Array, low: Array, high: Array) -> float:
    """Diagonal of a box round the places of cells (k, 5) [m]."""
    if not len(low):
        return 0.0
    mid, half = 0.5 * (low + high), 0.5 * (high - low)
    by = half[:, AWAY] + 2.0 * np.sin(0.5 * half[:, YAW]) * (np.abs(mid[:, AWAY]) + half[:, AWAY])
    way = np.column_stack([np.cos(mid[:, YAW]), np.sin(mid[:, YAW])])
    places = target[:2] - mid[:, AWAY, None] * way
    return float(np.hypot(*((places + by[:, None]).max(0) - (places - by[:, None]).min(0))))


@compiled
def _judge_cell(task: AnyBase, low: Array, high: Array) -> tuple[Verdict, float, int]:
    """Judge a cell; proven where the posture in its middle passes the collision check."""
    task.tally[CELLS] += 1
    verdict, age, cell = bound_cell(task, low, high), -float(task.tally[CELLS]), task.cell
    if verdict == Verdict.RULED_OUT:
        return verdict, age, NO_SIDE
    if verdict == Verdict.PROVEN:
        verdict = Verdict.OPEN
        if task.demand.seek and task.tally[REFUSED] < _MAX_REFUSED:
            if _take_middle(task) and is_clear(
                task.scene, task.margin, task.base, task.joints, task.around.tool_on
            ):
                verdict = Verdict.PROVEN
            else:
                task.tally[REFUSED] += 1
    if cell.open.max() == 0.0:  # all of it is clear, but for the margin of the collision check
        cell.open[AWAY], cell.open[PITCH] = cell.half[AWAY], chord(cell.half[PITCH])
    side = int(np.argmax(cell.open))
    if cell.open[side] <= MIN_OPEN or task.tally[REFUSED] == _MAX_REFUSED:
        side = NO_SIDE  # once so many were refused it can no longer be ruled out
    return verdict, age, side


@compiled
def bound_cell(task: AnyBase, low: Array, high: Array) -> Verdict:
    """Judge a cell by its bounds alone; writes how wide it is, where that matters, to ``cell.open``."""
    mount, plane, cell, z = task.mount, task.mount.plane, task.cell, task.demand.target[2]
    for k in range(len(low)):
        cell.middle[k], cell.half[k], cell.open[k] = 0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k]), 0.0
    if not turn_pivot(mount, cell):
        return Verdict.RULED_OUT
    points = _judge_direction(task.demand, cell)
    if points == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    bent = judge_links(plane, z, cell)
    if bent == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    stands = _judge_base(mount, task.floor, task.demand.target, cell)
    if stands == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    if bent == Verdict.OPEN:
        cell.open[AWAY] = cell.half[AWAY]
        cell.open[PITCH] = max(cell.open[PITCH], plane.lengths[2] * chord(cell.half[PITCH]))
    place_capsules(task.capsules, plane, z, bent == Verdict.PROVEN, cell)
    own = judge_self(task.capsules, mount, cell)
    if own == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    off = judge_obstacles(task.capsules, plane, task.around, task.demand.target, cell)
    if off == Verdict.RULED_OUT:
        return Verdict.RULED_OUT
    if not np.isnan(mount.yaw):  # its pivot turns with the plane
        cell.open[YAW], cell.open[TURN] = max(cell.open[YAW], cell.open[TURN]), 0.0
    return both(both(points, bent), both(stands, both(own, off)))


@compiled
def _judge_direction(demand: ToolDemand, cell: PlanarCell) -> Verdict:
    """Judge whether the tool points within its cone."""
    if demand.cone >= math.pi:
        return Verdict.PROVEN
    mid, half, d = cell.middle, cell.half, demand.direction
    level = math.cos(mid[PITCH])
    along = (
        d[0] * level * math.cos(mid[YAW]) + d[1] * level * math.sin(mid[YAW]) + d[2] * math.sin(mid[PITCH])
    )
    angle = math.acos(min(1.0, max(-1.0, along)))
    # About the vertical the tool turns by no more than its distance from it, and so may the direction.
    yawed = half[YAW] * min(abs(level) + half[PITCH], np.hypot(d[0], d[1]))
    if angle > demand.cone + yawed + half[PITCH] + PROOF_SLACK:
        return Verdict.RULED_OUT
    if angle > demand.cone - yawed - half[PITCH] + PROOF_SLACK:  # cells begin as wide as the cone
        cell.open[YAW] = max(cell.open[YAW], yawed)
        cell.open[PITCH] = max(cell.open[PITCH], half[PITCH])
    return Verdict.PROVEN if angle <= demand.cone else Verdict.OPEN


@compiled
def _judge_base(mount: ArmMount, floor: BaseFloor, target: Array, cell: PlanarCell) -> Verdict:
    """Judge whether the base is on the floor, with its clearance."""
    mid, half = cell.middle, cell.half
    away, turned = mid[AWAY], chord(half[YAW])
    x = target[0] - away * math.cos(mid[YAW])
    y = target[1] - away * math.sin(mid[YAW])
    by = half[AWAY] + turned * (abs(away) + half[AWAY])
    inner, outer = floor.inner, floor.outer
    if contains(inner.vertices, inner.starts, x, y):
        return Verdict.PROVEN
    if not contains(outer.vertices, outer.starts, x, y) and not near_boundary(
        outer.vertices, outer.starts, x, y, by + PROOF_SLACK
    ):
        return Verdict.RULED_OUT
    cell.open[YAW], cell.open[AWAY] = max(cell.open[YAW], turned * abs(away)), half[AWAY]
    if not len(floor.room.corners):
        return Verdict.OPEN
    yaw, turns = mount.yaw, 0.0
    if np.isnan(yaw):
        yaw, turns = mid[YAW] - mount.zero - mid[TURN], half[YAW] + half[TURN]
        cell.open[YAW] = max(cell.open[YAW], floor.far * turned)
        cell.open[TURN] = floor.far * chord(half[TURN])
    c, s = math.cos(yaw), math.sin(yaw)
    x -= c * mount.mount[0] - s * mount.mount[1]
    y -= s * mount.mount[0] + c * mount.mount[1]
    by += floor.far * chord(turns) + 2.0 * floor.spare
    if fits_nowhere_near(floor.room, floor.heart, floor.radius, x, y, yaw, by):
        return Verdict.RULED_OUT
    return Verdict.PROVEN if fits(floor.room, x, y, yaw) else Verdict.OPEN


@compiled
def _take_middle(task: AnyBase) -> bool:
    """Write base and joints of the middle of the cell; False where the pivot does not turn so far."""
    mount, plane, mid, q = task.mount, task.mount.plane, task.cell.middle, task.joints
    turn, over = fit(mid[TURN], mount.low, mount.high)
    q[0] = turn
    before = 0.0
    for k in range(3):
        bend = fit(task.cell.bends[k] - before, plane.lower[k], plane.upper[k])[0]
        q[k + 1] = mount.sign[k] * (bend - mount.offset[k])
        before = task.cell.bends[k]
    yaw = wrap(mid[YAW] - mount.zero - turn) if np.isnan(mount.yaw) else mount.yaw
    c, s, target = math.cos(yaw), math.sin(yaw), task.demand.target
    x, y = c * mount.mount[0] - s * mount.mount[1], s * mount.mount[0] + c * mount.mount[1]
    task.base[0] = target[0] - mid[AWAY] * math.cos(mid[YAW]) - x
    task.base[1] = target[1] - mid[AWAY] * math.sin(mid[YAW]) - y
    task.base[2] = yaw
    return over <= PROOF_SLACK


@compiled
def near_solids(solids: Uprights, target: Array, far: float, near: Index) -> int:
    """Write the indices of solids that are at most ``far`` from a target; returns how many."""
    count = 0
    for k in range(len(solids.disc)):
        if signed_distance(solids, k, target[0], target[1], target[2]) <= far:
            near[count] = k
            count += 1
    return count
