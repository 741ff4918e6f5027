"""A robot as pinocchio and coal see it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tests.opinion.things import Shape, distance_of, hull_shape, placed

Array = NDArray[np.float64]
PARTS = (" start", " end", " side")  # of a capsule, which URDF has no word for
VIRTUAL = ("base_x", "base_y", "base_yaw")
POSTURES, NEARLY_ALWAYS = 64, 0.9  # of seeded postures: ours sees 0.99 where this one sees 0.94
NEARLY = 0.002  # apart by no more, they count as touching there: ours tells bodies apart beyond that only [m]
GRAVITY = 9.80665  # [m/s2]
UNLIMITED = 1e6  # stands for no limit in the URDF


@dataclass(frozen=True)
class Facts:
    """What a URDF does not tell of a robot."""

    base: str
    footprint: Array
    body_height: float
    turning_radius: float
    unchecked: frozenset[frozenset[str]]
    gauge: float = 0.0
    loads: tuple[tuple[int, float, tuple[float, ...]], ...] = ()  # link, mass [kg], its centre [m]
    # corners in their links' frames (n, 3) [m], by name: URDF has no word for hulls
    hulls: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Part:
    """A convex shape that moves with a link: link -1 is the base, link k what joint k moves."""

    solid: str
    link: int
    shape: Shape


class Machine:
    """Forward kinematics and link shapes of a robot whose base has three virtual joints."""

    def __init__(self, urdf: str, facts: Facts) -> None:
        self.facts = facts
        self.model = pin.buildModelFromXML(urdf)
        self.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        names = [name for name in self.model.names[1:] if name not in VIRTUAL]
        self.ids = [self.model.getJointId(name) for name in (*VIRTUAL, *names)]
        self.links = len(names)
        mimics = {
            str(one.get("name")): one.find("mimic") for one in ElementTree.fromstring(urdf).iter("joint")
        }
        active = [name for name in names if mimics[name] is None]
        self.dof = len(active)
        self.follows = [_follows(name, mimics[name], active) for name in names]
        own = [self.model.getJointId(name) for name in active]
        self.tool_frame = self.model.getFrameId("tool")
        at = [self.model.joints[i].idx_v for i in own]
        unlimited = [self.model.joints[i].nq == 2 for i in own]
        slots = [self.model.joints[i].idx_q for i in own]
        self.lower = np.where(unlimited, -np.inf, self.model.lowerPositionLimit[slots])
        self.upper = np.where(unlimited, np.inf, self.model.upperPositionLimit[slots])
        self.lower[self.lower <= -UNLIMITED], self.upper[self.upper >= UNLIMITED] = -np.inf, np.inf
        self.columns = np.array(at)
        velocity = self.model.velocityLimit[self.columns]
        self.velocity = np.where(velocity >= UNLIMITED, np.inf, velocity)
        self.slides = np.array(["JointModelP" in self.model.joints[i].shortname() for i in own])
        for link, mass, center in facts.loads:
            inertia = pin.Inertia(mass, np.array(center), np.zeros((3, 3)))
            self.model.appendBodyToJoint(self.ids[link + 3], inertia, pin.SE3.Identity())
        self.data = self.model.createData()
        self.parts = self._parts(urdf)
        self.last = max((part.link for part in self.parts), default=-1)

    def _parts(self, urdf: str) -> list[Part]:
        titles = [
            str(one.get("name"))
            for link in ElementTree.fromstring(urdf).iter("link")
            for one in link.findall("collision")
        ]
        order = {str(link.get("name")): k for k, link in enumerate(ElementTree.fromstring(urdf).iter("link"))}
        geometry = pin.buildGeomFromUrdfString(self.model, urdf, pin.COLLISION)
        # Pinocchio names the shapes of a link link_0, link_1, in the order of the file.
        shapes = sorted(
            geometry.geometryObjects,
            key=lambda o: (order[o.name.rpartition("_")[0]], int(o.name.rpartition("_")[2])),
        )
        assert len(shapes) == len(titles)
        parts = []
        for title, one in zip(titles, shapes, strict=True):
            solid = next((title.removesuffix(end) for end in PARTS if title.endswith(end)), title)
            if one.parentJoint == self.ids[2] and title == "footprint":
                continue  # a bounding box; the outline itself is among the facts
            link = max(self.ids.index(one.parentJoint) - 3, -1)
            if solid in self.facts.hulls:
                parts.append(Part(solid, link, hull_shape(self.facts.hulls[solid])))
                continue
            parts.append(Part(solid, link, Shape(one.geometry, one.placement.homogeneous)))
        return parts

    def configuration(self, base: Array, joints: Array) -> Array:
        """Pinocchio's vector of a base pose and values of the joints that mimic no other."""
        q: Array = pin.neutral(self.model)
        values = [factor * joints[k] + offset for k, factor, offset in self.follows]
        for i, value in zip(self.ids, (*base, *values), strict=True):
            joint = self.model.joints[i]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                (np.cos(value), np.sin(value)) if joint.nq == 2 else (value,)
            )
        return q

    def place(self, base: Array, joints: Array) -> None:
        """Bring all frames up to date."""
        pin.framesForwardKinematics(self.model, self.data, self.configuration(base, joints))

    def tool(self) -> Array:
        """The tool's frame (4, 4), after `place`."""
        frame: Array = self.data.oMf[self.tool_frame].homogeneous
        return frame

    def frame(self, link: int) -> Array:
        """The frame of a link, or of the base (-1), after `place`."""
        frame: Array = self.data.oMi[self.ids[link + 3]].homogeneous
        return frame

    def efforts(self, q: Array) -> Array:
        """Torque or force with which each arm joint bears its links and the payload (dof,) [N m] or [N]."""
        pulled: Array = pin.computeGeneralizedGravity(self.model, self.data, q)[self.columns]
        return pulled

    @property
    def pivots(self) -> bool:
        """Whether the first joint turns about the vertical."""
        first = self.model.joints[self.ids[3]]
        pin.framesForwardKinematics(self.model, self.data, pin.neutral(self.model))
        along = np.array(pin.getJointJacobian(self.model, self.data, self.ids[3], pin.WORLD))
        return not self.slides[0] and bool(np.abs(along[3:5, first.idx_v]).max() < 1e-9)

    def frames(self) -> Array:
        """The frame of each part (n, 4, 4), after `place`."""
        links = {link: self.frame(link) for link in range(-1, self.links)}
        return np.array([links[part.link] @ part.shape.where for part in self.parts]).reshape(-1, 4, 4)

    @property
    def mount(self) -> Array:
        """The arm's base frame in the base's (4, 4)."""
        frames = self.model.frames
        base, arm = (frames[self.model.getFrameId(name)].placement for name in ("base", "arm_base"))
        mount: Array = np.linalg.inv(base.homogeneous) @ arm.homogeneous
        return mount

    def body(self) -> Shape | None:
        """The base up to its height, which the links keep off; none of a point."""
        if len(self.facts.footprint) < 3:
            return None
        corners = [[x, y, z] for z in (0.0, self.facts.body_height) for x, y in self.facts.footprint]
        return hull_shape(np.array(corners))

    def rivals(self) -> list[tuple[int, int]]:
        """Pairs of parts that must keep apart, -1 for the base's body.

        Not those of one link nor of links that one joint connects, not those that the robot's maker excuses,
        not those that touch however the arm is held, or nearly so: which of these a seeded sample finds apart
        is chance.
        """
        rank = [part.link for part in self.parts]
        pairs = [
            (i, k)
            for i, k in combinations(range(len(self.parts)), 2)
            if abs(rank[i] - rank[k]) > 1
            and frozenset((self.parts[i].solid, self.parts[k].solid)) not in self.facts.unchecked
        ]
        if self.body() is not None:
            spared = {name for pair in self.facts.unchecked if _names_base(pair) for name in pair}
            first = min((link for link in rank if link >= 0), default=-1)
            pairs += [
                (-1, k)
                for k in range(len(self.parts))
                if rank[k] > first and self.parts[k].solid not in spared
            ]
        names = {pair: frozenset((self._solid(pair[0]), self._solid(pair[1]))) for pair in pairs}
        met = Counter(
            name
            for joints in self._postures()
            for name in {names[pair] for pair in self._touching(pairs, joints)}
        )
        return [pair for pair in pairs if met[names[pair]] < NEARLY_ALWAYS * POSTURES]

    def off_floor(self) -> list[bool]:
        """Whether each part must keep off the floor: those that joints raise, and that can be off it."""
        met: Counter[str] = Counter()
        heights = []
        for joints in self._postures():
            self.place(np.zeros(3), joints)
            frames = self.frames()
            heights.append(frames[:, 2])
            lowest = [
                frame[2, 3] + (part.shape.points @ frame[:3, :3].T)[:, 2].min()
                for part, frame in zip(self.parts, frames, strict=True)
            ]
            met.update({self._solid(k) for k, low in enumerate(lowest) if low <= 0.0})
        raised = np.ptp(heights, axis=0).max(axis=1) > 1e-9
        return [bool(up) and met[self._solid(k)] < NEARLY_ALWAYS * POSTURES for k, up in enumerate(raised)]

    def _solid(self, k: int) -> str:
        return "" if k < 0 else f"{self.parts[k].link} {self.parts[k].solid}"

    def _touching(self, pairs: list[tuple[int, int]], joints: Array) -> list[tuple[int, int]]:
        self.place(np.zeros(3), joints)
        frames, body = self.frames(), self.body()
        return [(i, k) for i, k in pairs if self.between(i, k, frames, self.frame(-1), body) <= NEARLY]

    def between(self, i: int, k: int, frames: Array, base: Array, body: Shape | None) -> float:
        """Signed distance of two parts; i may be -1, the base's body."""
        one = (body, base) if i < 0 else (self.parts[i].shape, frames[i])
        assert one[0] is not None
        other = self.parts[k].shape.solid
        return distance_of(one[0].solid, placed(one[1]), other, placed(frames[k]))

    def _postures(self) -> Array:
        low = np.where(np.isfinite(self.lower), self.lower, np.maximum(self.upper - 2 * np.pi, -np.pi))
        low = np.where(np.isfinite(low), low, -np.pi)
        high = np.where(np.isfinite(self.upper), self.upper, low + 2 * np.pi)
        drawn: Array = np.random.default_rng(5).uniform(low, high, (POSTURES, self.dof))
        return drawn


def _follows(name: str, mimic: ElementTree.Element | None, active: list[str]) -> tuple[int, float, float]:
    """Which active joint a joint follows or is, by which factor and from where."""
    if mimic is None:
        return active.index(name), 1.0, 0.0
    leader, factor, offset = (mimic.get(key, "") for key in ("joint", "multiplier", "offset"))
    return active.index(leader), float(factor), float(offset)


def _names_base(pair: frozenset[str]) -> bool:
    return any(name.startswith("base of ") for name in pair)


def jacobian(machine: Machine, q: Array) -> Any:
    """Of the tool's position by all virtual and arm joints, in the world's axes (6, 3 + dof)."""
    return pin.computeFrameJacobian(
        machine.model, machine.data, q, machine.tool_frame, pin.LOCAL_WORLD_ALIGNED
    )
