"""Whether an arm in one plane has any clear posture for a target, wherever on a floor its base stands.

Branch and bound over the cells of `planecell`, all over a level before the next. "None" is a proof, up to
rounding far below a nanometre; "found" carries a posture that another check has passed. A budget of cells
bounds the work, so the same question always has the same answer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regionik.planners.clearance.bulkreach import Keep, is_clear
from regionik.planners.clearance.planecell import (
    AWAY,
    CLEAR,
    DOUBT,
    GONE,
    PITCH,
    SLACK,
    TURN,
    YAW,
    Frame,
    Look,
    chord,
    links,
    turned_by,
)
from regionik.planners.clearance.planehits import Around, Cores, keeps_off, keeps_to_itself, lay
from regionik.planners.driving.footprint_scene import FootprintScene, fits, fits_nowhere_near
from regionik.planners.geometry.flat import Index, compiled
from regionik.planners.geometry.upright import Uprights, signed_distance
from regionik.planners.reach.ringfloor import Parts, inside, is_near
from regionik.planners.solvers.kernels import fit, wrap
from regionik.worlds.arrays import Array

FOUND, NONE, OPEN = range(3)
FIRST_CELLS = 4  # for each ring of distances
MOST_REFUSED = 200  # postures that the other check turned down
NARROW = 1e-6  # cells that leave no more than this open are halved no more [m]


class Asked(NamedTuple):
    """A target.

    Attributes
    ----------
    target : (3,) array
        [m]
    direction : (3,) array
        Of the tool.
    cone : float
        Half angle about it, pi where the tool may point anywhere [rad].
    seek : bool
        Whether a posture is an answer; what else is asked of it may not be known here.
    """

    target: Array
    direction: Array
    cone: float
    seek: bool


class Floors(NamedTuple):
    """Where the base may stand.

    Attributes
    ----------
    inner, outer : Parts
        Where the pivot axis may be at every heading, and outside of which it may not be at any.
    room : FootprintScene
        The footprint among floor and obstacles; no corners for a base that is a point.
    heart : (2,) array
        Middle of a circle in the footprint, in the base's frame [m].
    radius : float
        Of that circle [m].
    far : float
        Of the footprint from the pivot axis [m].
    guard : float
        What the room keeps beyond the rules [m].
    """

    inner: Parts
    outer: Parts
    room: FootprintScene
    heart: Array
    radius: float
    far: float
    guard: float


class Cells(NamedTuple):
    """A queue of cells: their middles and half widths (n, 4), and which way the elbow bends (n,)."""

    mid: Array
    half: Array
    elbow: Array


@compiled
def first_cells(frame: Frame, asked: Asked, rings: Array, cells: Cells) -> int:
    """Write cells that hold all postures, given the distances that the arm reaches; returns how many."""
    pitch = math.atan2(asked.direction[2], math.hypot(asked.direction[0], asked.direction[1]))
    turn = 0.5 * (frame.low + frame.high) if np.isfinite(frame.high - frame.low) else 0.0
    wide = min(math.pi, 0.5 * (frame.high - frame.low))
    count = 0
    for k in range(len(rings)):
        for way in range(2 if asked.cone < 0.5 * math.pi else 1):
            for elbow in (-1.0, 1.0):
                mid, half = cells.mid[count], cells.half[count]
                mid[YAW], half[YAW] = 0.0, math.pi
                mid[AWAY], half[AWAY] = 0.5 * (rings[k, 0] + rings[k, 1]), 0.5 * (rings[k, 1] - rings[k, 0])
                mid[TURN], half[TURN] = turn, wide
                mid[PITCH], half[PITCH] = 0.0, math.pi
                if asked.cone < 0.5 * math.pi:  # the plane faces the direction, or shows it its back
                    mid[PITCH] = pitch if way == 0 else math.pi - pitch
                    half[PITCH] = asked.cone
                cells.elbow[count] = elbow
                count += 1
    return count


@compiled
def near_solids(solids: Uprights, target: Array, far: float, near: Index) -> int:
    """Write which solids are at most ``far`` from a target; returns how many."""
    count = 0
    for k in range(len(solids.disc)):
        if signed_distance(solids, k, target[0], target[1], target[2]) <= far:
            near[count] = k
            count += 1
    return count


@compiled
def _points(asked: Asked, mid: Array, half: Array, look: Look) -> int:
    """Whether the tool points within its cone: in the middle, somewhere in the cell perhaps, or nowhere."""
    if asked.cone >= math.pi:
        return CLEAR
    level, d = math.cos(mid[PITCH]), asked.direction
    along = (
        d[0] * level * math.cos(mid[YAW]) + d[1] * level * math.sin(mid[YAW]) + d[2] * math.sin(mid[PITCH])
    )
    angle = math.acos(min(1.0, max(-1.0, along)))
    # About the vertical the tool turns by no more than its distance from it, and so may the direction.
    yawed = half[YAW] * min(abs(level) + half[PITCH], math.hypot(d[0], d[1]))
    if angle > asked.cone + yawed + half[PITCH] + SLACK:
        return GONE
    if angle > asked.cone - yawed - half[PITCH]:
        look.wide[YAW] = max(look.wide[YAW], yawed)
        look.wide[PITCH] = max(look.wide[PITCH], half[PITCH])
    return CLEAR if angle <= asked.cone else DOUBT


@compiled
def _stands(frame: Frame, floors: Floors, asked: Asked, mid: Array, half: Array, look: Look) -> int:
    """Whether the base is on the floor, with its clearance."""
    away, turned = mid[AWAY], chord(half[YAW])
    x = asked.target[0] - away * math.cos(mid[YAW])
    y = asked.target[1] - away * math.sin(mid[YAW])
    by = half[AWAY] + turned * (abs(away) + half[AWAY])
    if inside(floors.inner, x, y):
        return CLEAR
    if not is_near(floors.outer, x, y, by + SLACK):
        return GONE
    look.wide[YAW], look.wide[AWAY] = max(look.wide[YAW], turned * abs(away)), half[AWAY]
    if not len(floors.room.corners):
        return DOUBT
    yaw, turns = frame.yaw, 0.0
    if np.isnan(yaw):
        yaw, turns = mid[YAW] - frame.zero - mid[TURN], half[YAW] + half[TURN]
        look.wide[YAW] = max(look.wide[YAW], floors.far * turned)
        look.wide[TURN] = floors.far * chord(half[TURN])
    c, s = math.cos(yaw), math.sin(yaw)
    x -= c * frame.mount[0] - s * frame.mount[1]
    y -= s * frame.mount[0] + c * frame.mount[1]
    by += floors.far * chord(turns) + 2.0 * floors.guard
    if fits_nowhere_near(floors.room, floors.heart, floors.radius, x, y, yaw, by):
        return GONE
    return CLEAR if fits(floors.room, x, y, yaw) else DOUBT


@compiled
def weigh(
    cores: Cores, frame: Frame, around: Around, floors: Floors, asked: Asked, elbow: float,
    mid: Array, half: Array, look: Look, vary: Array,
) -> int:  # fmt: skip
    """What is known of a cell; how wide it is, where that matters, is written to ``look.wide``."""
    look.wide[:] = 0.0
    z = asked.target[2]
    if not turned_by(frame, mid, half):
        return GONE
    points = _points(asked, mid, half, look)
    if points == GONE:
        return GONE
    bent = links(frame, z, elbow, mid, half, look, vary)
    if bent == GONE:
        return GONE
    stands = _stands(frame, floors, asked, mid, half, look)
    if stands == GONE:
        return GONE
    if bent != CLEAR:
        look.wide[AWAY] = half[AWAY]
        look.wide[PITCH] = max(look.wide[PITCH], frame.plane.lengths[2] * chord(half[PITCH]))
    lay(cores, frame, z, bent == CLEAR, mid, half, look, vary)
    own = keeps_to_itself(cores, frame, mid, half, look)
    if own == GONE:
        return GONE
    off = keeps_off(cores, frame, around, asked.target, mid, half, look)
    if off == GONE:
        return GONE
    if not np.isnan(frame.yaw):  # its pivot turns with the plane
        look.wide[YAW] = max(look.wide[YAW], look.wide[TURN])
        look.wide[TURN] = 0.0
    good = points == CLEAR and bent == CLEAR and stands == CLEAR and own == CLEAR and off == CLEAR
    return CLEAR if good else DOUBT


@compiled
def _takes(
    frame: Frame, asked: Asked, mid: Array, look: Look, signs: Array, offsets: Array, base: Array, q: Array
) -> bool:
    """Write base (3,) and joints of the middle of a cell; False where the pivot does not turn so far."""
    turn, over = fit(mid[TURN], frame.low, frame.high)
    q[0] = turn
    before = 0.0
    for k in range(3):
        bend = fit(look.bends[k] - before, frame.plane.lower[k], frame.plane.upper[k])[0]
        q[k + 1] = signs[k] * (bend - offsets[k])
        before = look.bends[k]
    yaw = wrap(mid[YAW] - frame.zero - turn) if np.isnan(frame.yaw) else frame.yaw
    c, s = math.cos(yaw), math.sin(yaw)
    base[0] = asked.target[0] - mid[AWAY] * math.cos(mid[YAW]) - (c * frame.mount[0] - s * frame.mount[1])
    base[1] = asked.target[1] - mid[AWAY] * math.sin(mid[YAW]) - (s * frame.mount[0] + c * frame.mount[1])
    base[2] = yaw
    return over <= SLACK


@compiled
def decide(
    cores: Cores, frame: Frame, around: Around, floors: Floors, asked: Asked, keep: Keep,
    signs: Array, offsets: Array, count: int, cells: Cells, look: Look, base: Array, q: Array,
) -> tuple[int, float]:  # fmt: skip
    """Look all over the floor for a clear posture.

    Parameters
    ----------
    cores, frame, around, floors, asked, keep
    signs, offsets : (3,) array
        ``bend = sign * joint + offset`` [rad].
    count : int
        Cells to begin with, from `first_cells`.
    cells : Cells
        The queue; where it is full the search ends.
    look : Look
    base, q : (3,), (dof,) array
        Overwritten with what was found; ``q`` holds the joints that do not matter.

    Returns
    -------
    int
        `FOUND`, `NONE`, or `OPEN`.
    float
        Diagonal of a box round the places that are left where it is open, 0 otherwise [m].
    """
    vary, head, most, refused = np.empty(3), 0, len(cells.elbow), 0
    box = np.array([np.inf, np.inf, -np.inf, -np.inf])
    while head < count:
        mid, half, elbow = cells.mid[head], cells.half[head], cells.elbow[head]
        head += 1
        seen = weigh(cores, frame, around, floors, asked, elbow, mid, half, look, vary)
        if seen == GONE:
            continue
        if seen == CLEAR and asked.seek and refused < MOST_REFUSED:
            takes = _takes(frame, asked, mid, look, signs, offsets, base, q)
            if takes and is_clear(keep, base, q, around.tool_on):
                return FOUND, 0.0
            refused += 1
            if refused == MOST_REFUSED:  # it can no longer be none: clear but for the margin of that check
                most = count
        if look.wide.max() == 0.0:  # all of it is clear, but for the margin of the other check
            look.wide[AWAY], look.wide[PITCH] = half[AWAY], chord(half[PITCH])
        side = int(np.argmax(look.wide))
        if look.wide[side] <= NARROW or count + 2 > most:
            _enclose(asked, mid, half, box)
            continue
        for way in (-0.5, 0.5):
            cells.mid[count], cells.half[count], cells.elbow[count] = mid, half, elbow
            cells.mid[count, side] += way * half[side]
            cells.half[count, side] *= 0.5
            count += 1
    if box[0] > box[2]:
        return NONE, 0.0
    return OPEN, math.hypot(box[2] - box[0], box[3] - box[1])


@compiled
def _enclose(asked: Asked, mid: Array, half: Array, box: Array) -> None:
    """Take the places of a cell into a box."""
    x = asked.target[0] - mid[AWAY] * math.cos(mid[YAW])
    y = asked.target[1] - mid[AWAY] * math.sin(mid[YAW])
    by = half[AWAY] + chord(half[YAW]) * (abs(mid[AWAY]) + half[AWAY])
    box[0], box[1] = min(box[0], x - by), min(box[1], y - by)
    box[2], box[3] = max(box[2], x + by), max(box[3], y + by)
