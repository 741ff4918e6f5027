"""Interface of the models of an arm's reach, for one kind of goal each, and rings as polygons."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.ground import EVERY
from regionik.areas.layers import ROUNDING_MARGIN, Geometries
from regionik.areas.options import AREAS
from regionik.planners.geometry.polygons import EVERYWHERE
from regionik.planners.solvers.planar_kinematics import LIMIT_SLACK
from regionik.postures.arm import Arm
from regionik.postures.families import BACK, FRONT, Family
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.limits import Criteria
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import Rules, Target

Index = NDArray[np.intp]
ReachTable = tuple[Index, tuple[Family, ...], Geometries]  # target, ascending, family and shape of each row
FineReachTable = tuple[tuple[Family, ...], Geometries]  # family and shape of each row


class ReachQuery(NamedTuple):
    """Conditions under which a reach is asked for.

    With ``coarse``, heights near to each other may share a reach where that saves work: outer rings are
    larger then, and inner ones likely, not proven. With ``proven``, inner areas that are sampled otherwise
    are cut to what is proven, which takes a second each. Then they may lack places outside of a ``window``.
    """

    rules: Rules
    margin: float | None  # that rings within the true reach keep from its ends [m]; None for rings around it
    span: tuple[float, float]  # headings of the base [rad]
    facings: tuple[int, ...] = (FRONT, BACK)
    arcs: int = AREAS.arc_points  # vertices of a full circle
    coarse: bool = False
    proven: bool = False
    window: tuple[float, ...] = EVERYWHERE  # least x and y, and most, of places that matter [m]

    @property
    def inner(self) -> bool:
        """True where areas are to lie within the reach, False where around it."""
        return self.margin is not None

    @property
    def rounding_margin(self) -> float:
        """Angle that inner sectors keep from both ends of the headings that base and pivot turn to [rad]."""
        return ROUNDING_MARGIN + self.rules.errors.heading_error if self.inner else 0.0


@dataclass(frozen=True, eq=False)
class ReachModel(ABC):
    """Reach of a robot's arm for one kind of goal; `reachable.reach_model` chooses the implementation.

    The reach of a target is the set of places of the arm axis on the floor, the pivot axis of the arm, from
    which some posture within limits meets the target. An inner area holds places that work, an outer one all
    that may.
    """

    robot: Robot  # with the limits that postures must keep

    # Inner and outer areas are the true reach at every height and cone, but for the chords of circles.
    exact: ClassVar[bool] = False
    # The self-motion of the solver shows postures of every kind.
    shows_all_postures: ClassVar[bool] = False

    @abstractmethod
    def table(self, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
        """Reach of targets of the model's goal: a row for each target, family and interval of distance."""

    @abstractmethod
    def fine_table(self, target: Target, kinds: Sequence[Family], query: ReachQuery) -> FineReachTable:
        """Reach of one target by given families, whatever criteria the rules have."""

    @abstractmethod
    def distances(self, criteria: Criteria | None, heights: Array, *, inner: bool) -> list[Array]:
        """Distances of axis and tool within reach at each height, any way the tool points, (k, 2) [m]."""

    @abstractmethod
    def families(self, target: Target, facings: tuple[int, ...], *, inner: bool) -> tuple[Family, ...]:
        """Posture families that may reach a target."""

    @abstractmethod
    def solver(
        self, family: Family, tolerance: float, *, turns: bool = True, criteria: Criteria | None = None
    ) -> Arm:
        """The arm as M-FABRIK moves it, in a family of postures, to a tolerance [m].

        ``turns`` tells whether the base turns for the arm; of criteria, manipulability and effort are met.
        """

    def meets(self, criteria: Criteria | None, joints: Array) -> bool:
        """True where a posture (dof,) meets criteria, of an arm in one plane at any roll.

        Raises InputError for criteria that the arm cannot be held to.
        """
        limits = with_joint_margin(self.robot, criteria).chain
        over = (joints < limits.lower - LIMIT_SLACK) | (joints > limits.upper + LIMIT_SLACK)
        return limits is self.robot.chain or not over.any()

    def turns_freely(self, rules: Rules, span: tuple[float, float]) -> bool:
        """True where areas are the same for a base that keeps its headings within a span."""
        low, high = self.pivot(rules)
        return span == EVERY or bool(high - low + span[1] - span[0] >= 2 * np.pi)

    def heeds_headings(self, query: ReachQuery) -> bool:
        """True where rows may hang on the span of headings that is asked for."""
        return True

    def pivot(self, rules: Rules) -> tuple[float, float]:
        """Turns of the pivot that the rules leave; at one where the base looks where the arm does [rad]."""
        joint = self.chain.active_joints[pivot_index(self.chain)]
        low, high = float(joint.lower), float(joint.upper)
        if rules.heading == "face_target":
            low = high = min(max(0.0, low), high)
        return low, high

    def is_proven(self, rules: Rules) -> bool:
        """True where every place of an inner area is proven to work."""
        return True

    @property
    def chain(self) -> Chain:
        """The arm on its vertical pivot."""
        return with_pivot(self.robot.chain)

    @property
    def height(self) -> float:
        """Height of the arm's base frame over the floor [m]."""
        return float(self.robot.mount[2])


class Sectors(NamedTuple):
    """Rings and ring sectors."""

    center: Array  # (n, 2) [m]
    low: Array  # (n,) inner radius, from 0 on [m]
    high: Array  # (n,) outer radius, above the inner one [m]
    azimuth: Array  # (n,) middle of each sector [rad]
    half: Array  # (n,) half of each sector; half a turn or more for whole rings [rad]


def sector_polygons(sectors: Sectors, query: ReachQuery) -> Geometries:
    """Rings and ring sectors as polygons, (n,): within the true shape where a margin is kept, else around."""
    (centers, low, high, azimuth, half), margin, arcs = sectors, query.margin, query.arcs
    out = np.empty(len(centers), dtype=object)
    full = half >= np.pi
    step = 2 * np.where(full, np.pi, half) / arcs
    outwards = 1.0 / np.cos(step / 2)
    far, near = high * outwards, low
    if margin is not None:
        far, near = high - margin, (low + margin) * outwards
    if full.any():
        out[full] = _rings(centers[full], far[full], near[full], arcs)
    part = ~full
    angles = (azimuth - half)[part, None] + step[part, None] * np.arange(arcs + 1)
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rim = centers[part, None] + far[part, None, None] * unit
    hole = centers[part, None] + near[part, None, None] * unit
    out[part] = shapely.polygons(np.concatenate([rim, hole[:, ::-1]], axis=1))
    return out


def wide_enough(low: Array, high: Array, query: ReachQuery) -> NDArray[np.bool_]:
    """Mask (n,) of the rings that have a polygon: one thinner than its chords has none within."""
    real: NDArray[np.bool_] = low + high > 0
    if query.margin is not None:
        real &= (low + query.margin) / np.cos(np.pi / query.arcs) + ROUNDING_MARGIN < high - query.margin
    return real


def _rings(centers: Array, far: Array, near: Array, arcs: int) -> Geometries:
    """Whole rings as polygons, discs where there is no hole."""
    turns = 2 * np.pi / arcs * np.arange(arcs)
    unit = np.column_stack([np.cos(turns), np.sin(turns)])
    unit = np.vstack([unit, unit[:1]])
    rims = shapely.linearrings(centers[:, None] + far[:, None, None] * unit)
    holed = near > ROUNDING_MARGIN
    holes = shapely.linearrings(centers[holed, None] + near[holed, None, None] * unit)
    rings = np.empty(len(centers), dtype=object)
    rings[holed] = shapely.polygons(rims[holed], holes=holes[:, None])
    rings[~holed] = shapely.polygons(rims[~holed])
    return rings
