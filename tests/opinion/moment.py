"""What is wrong with single moments of a plan."""

from __future__ import annotations

from collections.abc import Iterator

import coal
import numpy as np
import shapely

from tests.opinion.course import Course, angle_between, arc_point, halfway
from tests.opinion.machine import Array
from tests.opinion.things import FLOOR, Shape, Thing, asked_of, distance_of, floor_of, placed

APART = 1e-5  # of distances in space, whose solver iterates [m]
FLAT = 3e-6  # of distances on the floor [m]
ALONG = 3e-6  # of what the tool does between states [m] or [rad]


class Moment:
    """Looks at single moments of a plan, and wants a berth round the arm beyond what its rules say [m]."""

    def __init__(self, course: Course, berth: float = -APART) -> None:
        self.course, self.machine, self.berth = course, course.machine, berth
        facts, world = course.machine.facts, course.world
        self.floor = floor_of(world).buffer(FLAT, join_style="mitre")
        shapely.prepare(self.floor)
        self.plans = [thing for thing in course.things if thing.core is not None]
        self.cores = shapely.STRtree([thing.core for thing in self.plans])
        self.widest = max((thing.radius + asked_of(thing, course.rules) for thing in self.plans), default=0.0)
        self.body, self.pairs = self.machine.body(), self.machine.rivals()
        self.off_floor = self.machine.off_floor()
        self.outline = facts.footprint
        balls = [part.shape.ball for part in self.machine.parts]
        self.middles = np.array([middle for middle, _ in balls]).reshape(-1, 3)
        self.radii = np.array([radius for _, radius in balls])
        self.pieces = [(i, piece) for i, thing in enumerate(course.things) for piece in thing.pieces]
        self.balls = _boxes([piece for _, piece in self.pieces])
        self.plan = shapely.STRtree(shapely.box(*self.balls[0][:, :2].T, *self.balls[1][:, :2].T))
        self.work = self._owners()

    def look(self, k: int, share: float) -> Iterator[str]:
        """Objections to the moment at a share of the hop after state k."""
        course = self.course
        there = min(k + 1, len(course.base) - 1)
        base = halfway(self.machine.facts.base, course.base[k], course.base[there], share)
        joints = course.joints[k] + share * (course.joints[there] - course.joints[k])
        self.machine.place(base, joints)
        tool, frames = self.machine.tool(), self.machine.frames()
        where = f"in state {k}" if share == 0 else f"{share:.3f} of the way after state {k}"
        for off in course.strays:
            yield from (f"{text} {where}" for text in self._base(base + off))
        yield from (f"{text} {where}" for text in self._arm(frames, tool[:3, 3]))
        yield from (f"{text} {where}" for text in self._itself(frames))
        yield from (f"{text} {where}" for text in self._path(k, there if share else k, tool))

    def look_at_body(self, k: int) -> Iterator[str]:
        """Objections to what stands on the base in state k, and to the arm's first link."""
        self.machine.place(self.course.base[k], self.course.joints[k])
        yield from self._arm(self.machine.frames(), self.machine.tool()[:3, 3], most=0)

    def _base(self, base: Array) -> Iterator[str]:
        c, s = np.cos(base[2]), np.sin(base[2])
        corners = self.outline @ np.array([[c, s], [-s, c]]) + base[:2]
        shape = shapely.MultiPoint(corners).convex_hull
        if not self.floor.covers(shape):
            yield "floor: the base is off it"
        for i in self.cores.query(shape, predicate="dwithin", distance=self.widest):
            thing = self.plans[i]
            least = asked_of(thing, self.course.rules)
            gap = shape.distance(thing.core) - thing.radius
            # Shapes that touch are 0 apart, and so are shapes that overlap.
            deep = (
                least == 0 and gap <= 0 and not shape.buffer(-FLAT).disjoint(thing.core.buffer(thing.radius))
            )
            if gap < least - FLAT or (deep and shape.area > 0):
                yield f"clearance: the base is {gap:.6f} m from {thing.name}"

    def _arm(self, frames: Array, tool: Array, most: float = np.inf) -> Iterator[str]:
        """Objections to links up to a number, and to what is fixed to the base."""
        least = self.course.rules["arm_clearance"] + self.course.arm_stray
        spots = np.einsum("nij,nj->ni", frames[:, :3, :3], self.middles) + frames[:, :3, 3]
        if not len(self.pieces) or not len(spots):
            return
        around = (self.radii + least + abs(self.berth))[:, None]
        below, above = (spots - around).min(0)[:2], (spots + around).max(0)[:2]
        close = self.plan.query(shapely.box(*below, *above))
        low, high = (corner[close] for corner in self.balls)
        apart = np.maximum(np.maximum(low[None] - spots[:, None], spots[:, None] - high[None]), 0.0)
        for p, n in np.argwhere(np.linalg.norm(apart, axis=2) < around):
            part, (i, piece) = self.machine.parts[p], self.pieces[close[n]]
            thing = self.course.things[i]
            if part.link > most or (thing.name == FLOOR and not self.off_floor[p]):
                continue
            gap = distance_of(part.shape.solid, placed(frames[p]), piece.solid, piece.placed)
            if part.link == self.machine.last and self._works_on(i, tool):
                if gap < least + self.berth or thing.contains(spots[p]):
                    yield from self._contact(p, frames[p], thing, gap, tool)
                continue
            if gap < least + self.berth or thing.contains(spots[p]):
                yield f"arm: {part.solid} of link {part.link} is {gap:.6f} m from {thing.name}"

    def _contact(self, p: int, frame: Array, thing: Thing, gap: float, tool: Array) -> Iterator[str]:
        """Objections to how deep the tool is in what it works on, and to what else of its link is near."""
        rules, part = self.course.rules, self.machine.parts[p]
        depth, who = rules["contact_depth"] + rules["tolerance"], f"{part.solid} of link {part.link}"
        if thing.surface is None and gap < -depth + self.berth:
            yield f"arm: {who} is {-gap:.6f} m deep in {thing.name}"
        points = part.shape.points @ frame[:3, :3].T + frame[:3, 3]
        far = np.linalg.norm(points - tool, axis=1) > rules["tool_contact"] + ALONG
        for point, aside in zip(points, far, strict=True):
            off = _gap(thing, point)
            if off < -depth * np.sqrt(3) + self.berth:  # a box is as deep as it has to shrink on all sides
                yield f"arm: a point of {who} is {-off:.6f} m deep in {thing.name}"
            if aside and off < rules["arm_clearance"] + self.course.arm_stray + self.berth:
                yield f"arm: {who} is {off:.6f} m from {thing.name}, away from the tool"

    def _itself(self, frames: Array) -> Iterator[str]:
        spots = np.einsum("nij,nj->ni", frames[:, :3, :3], self.middles) + frames[:, :3, 3]
        base = self.machine.frame(-1)
        far = abs(self.berth)
        for i, k in self.pairs:
            if i >= 0 and np.linalg.norm(spots[i] - spots[k]) > self.radii[i] + self.radii[k] + far:
                continue
            gap = self.machine.between(i, k, frames, base, self.body)
            if gap < self.berth:
                one = "the base" if i < 0 else self.machine.parts[i].solid
                yield f"self: {one} and {self.machine.parts[k].solid} are {gap:.6f} m apart"

    def _path(self, k: int, there: int, tool: Array) -> Iterator[str]:
        course = self.course
        if "transit" in (course.kinds[k], course.kinds[there]):
            return
        i = course.behind[k]
        a, b = course.task[max(i, 0)], course.task[min(i + 1, len(course.task) - 1)]
        along = b["point"] - a["point"]
        square = float(along @ along)
        t = 0.0 if square == 0 else float(np.clip((tool[:3, 3] - a["point"]) @ along / square, 0, 1))
        off = float(np.linalg.norm(tool[:3, 3] - a["point"] - t * along))
        if off > course.rules["path_tolerance"] - course.errors["tool_error"] + ALONG:
            yield f"path: the tool is {off:.6f} m off it"
        if "direction" in a and "direction" in b:
            cone = max(a["cone"], b["cone"])
            least = min(angle_between(tool[:3, 2], arc_point(a, b, s)) for s in np.linspace(0, 1, 33))
            if least > cone + angle_between(np.array(a["direction"]), np.array(b["direction"])) / 64 + 1e-5:
                yield f"path: the tool's axis is {least:.6f} rad off"

    def _works_on(self, thing: int, tool: Array) -> bool:
        """Whether the tool is near a set-point of what it works on."""
        mine = self.work.get(thing)
        if mine is None:
            return False
        away = float(np.linalg.norm(mine - tool, axis=1).min())
        return away <= float(self.course.rules["tool_contact"]) + ALONG

    def _owners(self) -> dict[int, Array]:
        """Set-points by the thing that they lie in or, of those within ``tool_contact``, next to."""
        reach = self.course.rules["tool_contact"]
        found: dict[int, list[Array]] = {}
        for target in self.course.task:
            gaps = [(_gap(thing, target["point"]), i) for i, thing in enumerate(self.course.things)]
            if reach > 0 and gaps and min(gaps)[0] <= reach:
                found.setdefault(min(gaps)[1], []).append(target["point"])
        return {i: np.array(points) for i, points in found.items()}


def _boxes(pieces: list[Shape]) -> tuple[Array, Array]:
    """Lower and upper corners of upright boxes round solids where they stand."""
    low, high = [], []
    for piece in pieces:
        middle, half = piece.box
        at = piece.where[:3, :3] @ middle + piece.where[:3, 3]
        reach = np.abs(piece.where[:3, :3]) @ half
        low.append(at - reach)
        high.append(at + reach)
    return np.array(low).reshape(-1, 3), np.array(high).reshape(-1, 3)


DOT = 1e-7  # radius of a ball that stands for a point [m]


def _gap(thing: Thing, point: Array) -> float:
    T = np.eye(4)
    T[:3, 3] = point
    dot, at = coal.Sphere(DOT), placed(T)
    gaps = [distance_of(dot, at, piece.solid, piece.placed) + DOT for piece in thing.pieces]
    return -min(gaps) if thing.contains(point) else min(gaps)
