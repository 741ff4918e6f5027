"""The frozen results of the stages."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError, ReasonCode, Verdict
from regionik.worlds.prepared import Prepared
from regionik.worlds.scene import StopCriterion, Target, World
from regionik.worlds.strokes import within_strokes

StateKind = Literal["setpoint", "step", "transit"]


COLUMNS = "base", "joints", "kind", "setpoint", "time"  # of a motion


@dataclass(frozen=True, eq=False, slots=True)
class Configuration:
    """Base and arm that put the tool on a target (the result of M-FABRIK).

    Attributes
    ----------
    base : (3,) array
        x, y [m], yaw [rad].
    joints : (dof,) array
    error : float
        Distance of the tool from the target [m].
    iterations : int
        Passes of Algorithm 1, and steps of polishing base and arm together; restarts included.
    converged : bool
    """

    base: Array
    joints: Array
    error: float
    iterations: int
    converged: bool

    def __repr__(self) -> str:
        state = "converged" if self.converged else f"not converged in {self.iterations} iterations"
        return f"Configuration({_pose_text(self.base)}, {state}, error {self.error:.3g} m)"


@dataclass(frozen=True, eq=False)
class Batch:
    """Many configurations as arrays: base (n, 3), joints (n, dof), error, iterations, converged (n,)."""

    base: Array
    joints: Array
    error: Array
    iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]

    @classmethod
    def of(cls, rows: Sequence[Configuration], dof: int) -> Batch:
        """Return configurations of a robot with so many joints as arrays; there may be none."""
        return cls(
            np.array([row.base for row in rows]).reshape(-1, 3),
            np.array([row.joints for row in rows]).reshape(-1, dof),
            np.array([row.error for row in rows]),
            np.array([row.iterations for row in rows], dtype=np.int64),
            np.array([row.converged for row in rows], dtype=bool),
        )


@dataclass(frozen=True, eq=False)
class State:
    """One moment of the motion."""

    base: Array  # (3,) x, y [m], yaw [rad]
    joints: Array  # (dof,)
    kind: StateKind
    setpoint: int | None
    time: float | None = None  # [s]


@dataclass(frozen=True, eq=False)
class Motion:
    """The whole motion in order, kept as columns.

    Between neighbours the base turns evenly the shorter way and joints move linearly. An omnidirectional base
    moves straight. One on wheels rolls along one arc or line, forwards or backwards, or turns on the spot:
    the chord between two states lies along the heading in the middle of the turn.

    Attributes
    ----------
    base : (n, 3) array
    joints : (n, dof) array
    kind : (n,) array of str
        "setpoint", "step" or "transit".
    setpoint : (n,) array of int
        Set-point the state belongs to, -1 for none. A ``step`` on its way from set-point i to i + 1
        carries i.
    time : (n,) array
        [s], NaN where the motion is not timed.
    tool : (n, 3) array, optional
        Tool positions as a plan file gives them, which `regionik.verify` holds against base and joints [m].
    tool_on : (n,) array of bool, optional
        What `Plan.tool_on` tells, as a plan file gives it.
    """

    base: Array
    joints: Array
    kind: NDArray[np.str_]
    setpoint: NDArray[np.int64]
    time: Array
    tool: Array | None = None
    tool_on: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        n = len(self.base)
        object.__setattr__(self, "base", frozen(self.base, (None, 3), "states: base"))
        object.__setattr__(self, "joints", frozen(self.joints, (n, None), "states: joints"))
        for key in ("kind", "setpoint", "time"):
            if len(getattr(self, key)) != n:
                raise InputError(f"states: expected {n} values of {key}")
        if self.tool is not None:
            object.__setattr__(self, "tool", frozen(self.tool, (n, 3), "states: tool"))

    def __repr__(self) -> str:
        return f"Motion({len(self)} states, {int((self.kind == 'transit').sum())} of them transits)"

    def __len__(self) -> int:
        return len(self.base)

    def __getitem__(self, k: int) -> State:
        i, t = int(self.setpoint[k]), float(self.time[k])
        kind: Any = str(self.kind[k])
        return State(self.base[k], self.joints[k], kind, None if i < 0 else i, None if np.isnan(t) else t)

    def __iter__(self) -> Iterator[State]:
        return (self[k] for k in range(len(self)))

    def leads_to(self) -> NDArray[np.int64]:
        """Set-point that each state but the last is on its way to, (n - 1,)."""
        return approached(self.kind, self.setpoint)

    def part(self, first: int, end: int) -> Motion:
        """States from one to before another."""
        return Motion(*(getattr(self, key)[first:end] for key in COLUMNS))

    @staticmethod
    def joined(parts: Sequence[Motion]) -> Motion:
        """One motion after the other."""
        return Motion(*(np.concatenate([getattr(part, key) for part in parts]) for key in COLUMNS))


def approached(kind: NDArray[np.str_], setpoint: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the set-point that each of n - 1 segments between states leads to, by their kinds and owners.

    >>> approached(np.array(["transit", "setpoint", "step", "setpoint"]), np.array([-1, 0, 0, 1])).tolist()
    [0, 1, 1]
    """
    last = np.maximum.accumulate(np.where(kind == "setpoint", setpoint, -1))
    found: NDArray[np.int64] = last[:-1] + 1
    return found


@dataclass(frozen=True, eq=False)
class PlannedArea:
    """Floor areas of one set-point, as drawn and exported.

    ``admissible`` is reach minus rejection; ``pruned`` is what is left of it for the whole path;
    ``rejected`` is the part of the reach that obstacles or the floor's edge took away.
    """

    admissible: BaseGeometry
    pruned: BaseGeometry
    rejected: BaseGeometry

    def __repr__(self) -> str:
        admissible, pruned = self.admissible.area, self.pruned.area
        return f"PlannedArea({admissible:.3g} m2 admissible, {pruned:.3g} m2 of it pruned)"


@dataclass(frozen=True, eq=False)
class Stop:
    """A place where the base stands still while the arm does some set-points.

    Attributes
    ----------
    base : (3,) array
        x, y [m], yaw [rad].
    setpoints : tuple of int
        In the order of work. In a plan these follow one another.
    tolerance : float
        Radius of the circle about ``base`` within which, at this heading, the arm reaches all the set-points
        and the base keeps its clearance [m].
    criterion : str
        That chose the place, as in `regionik.worlds.scene.Rules`.
    probability : float or None
        Proven lower bound: so probably do arm and base as within that circle, once the base has parked with
        the error of `regionik.worlds.limits.ParkingAccuracy`. None without one in the rules.
    unconfirmed : tuple of int
        Those of the set-points at which no clear posture is known with the base exactly there; at all others
        one was found and checked. Of a plan's stops, whose motion is verified, there are none.
    """

    base: Array
    setpoints: tuple[int, ...]
    tolerance: float
    criterion: StopCriterion
    probability: float | None = None
    unconfirmed: tuple[int, ...] = ()

    def __repr__(self) -> str:
        likely = "" if self.probability is None else f", parks with {self.probability:.4f}"
        served = f"{len(self.setpoints)} set-points, {self.tolerance:.3g} m"
        doubt = f", {len(self.unconfirmed)} of them unconfirmed" if self.unconfirmed else ""
        return f"Stop({_pose_text(self.base)}, {served}{likely}{doubt})"

    @property
    def first(self) -> int:
        return self.setpoints[0]

    @property
    def last(self) -> int:
        return self.setpoints[-1]


class Stops(tuple[Stop, ...]):
    """Stops in the order of the work, which know the ``world`` on whose floor they are shown."""

    world: World

    def __new__(cls, stops: Iterable[Stop], world: World) -> Self:
        made = super().__new__(cls, stops)
        made.world = world
        return made

    def __repr__(self) -> str:
        served = sum(len(stop.setpoints) for stop in self)
        return f"Stops({self.world.name}: {len(self)} for {served} set-points)"


@dataclass(frozen=True, eq=False)
class Skipped:
    """A set-point of the world as given that a plan leaves out: ``rules.skip_unreachable`` allows it.

    Attributes
    ----------
    setpoint : int
        Its index in the task as given.
    target : Target
    verdict : str
        As in an `regionik.worlds.errors.Explanation`.
    reason : str
    code : str
        The reason in a word, as in an `Answer`.
    """

    setpoint: int
    target: Target
    verdict: Verdict
    reason: str
    code: ReasonCode = ""

    def __repr__(self) -> str:
        return f"Skipped(set-point {self.setpoint + 1}, {self.verdict})"


@dataclass(frozen=True, eq=False)
class Plan(Prepared):
    """A whole-path plan. It embeds its world, so that it can be verified alone.

    Attributes
    ----------
    world : World
        With the set-points that are done, in the order of the work.
    seed : int
    setpoints : tuple of Configuration
        One for each target of ``world.task``.
    motion : Motion
        All states, from the start (if any) to the last set-point; iterate over it for one `State` at a time.
    areas : tuple of PlannedArea
        One for each set-point. Files of very long paths have none, see
        `regionik.worlds.readers.text.MAX_BYTES`.
    lift_offs : int
        Times that the tool leaves the path after the first set-point.
    stops : tuple of Stop
        In mode ``stops``; empty otherwise.
    stats : dict
        Plain numbers about the plan, the same for the same world and seed. ``order`` has the index in the
        task as given of each set-point, where that is not its own. Files keep those figures that
        `regionik.verify` computes again, see `regionik.storage.plan_document.FIGURES`.
    skipped : tuple of Skipped
        Set-points of the world as given that are left out; together with ``world.task`` they are its task.
    """

    world: World
    seed: int
    setpoints: tuple[Configuration, ...]
    motion: Motion
    areas: tuple[PlannedArea, ...]
    lift_offs: int
    stops: tuple[Stop, ...] = ()
    stats: dict[str, Any] = field(default_factory=dict)
    skipped: tuple[Skipped, ...] = ()

    def __repr__(self) -> str:
        given = f" of {len(self.setpoints) + len(self.skipped)}" * bool(self.skipped)
        counts = f"{len(self.setpoints)}{given} set-points, {len(self.motion)} states"
        counts += f", {self.lift_offs} lift-off{'s' * (self.lift_offs != 1)}"
        return f"Plan({self.world.name}: {counts})"

    def tools(self) -> Array:
        """Tool position at every state, (n, 3) [m]."""
        frames = self.world.robot.tool(self.motion.base, self.motion.joints)
        return frames[:, :3, 3]

    def tool_on(self) -> NDArray[np.bool_]:
        """True where the tool works from a state to the next, (n,): not on travel, nor on leads, nor lifted.

        Without strokes in the task it works all the way from set-point to set-point.
        """
        ahead, down = (
            np.append(self.world.works, False)[self.motion.leads_to()],
            self.motion.kind != "transit",
        )
        return np.append(ahead & down[:-1] & down[1:], False)[: len(down)]

    def lifts_within(self) -> list[int]:
        """Set-points to which the tool comes lifted, although their stroke begins before."""
        lifted = self.motion.setpoint[1:][
            (self.motion.kind[:-1] == "transit") & (self.motion.kind[1:] == "setpoint")
        ]
        within = within_strokes([target.stroke for target in self.world.task])
        return [i for i in lifted.tolist() if within[i]]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write ``plan.json``, whole or not at all, as `regionik.save_plan` does."""
        import_module("regionik").save_plan(self, path)  # by its public name, as values know no files


@dataclass(frozen=True)
class Violation:
    """A failed check of a plan."""

    kind: str
    state: int | None  # index of the state, or of the first of two neighbours
    setpoint: int | None
    amount: float  # [m] or [rad] beyond what is allowed
    text: str


@dataclass(frozen=True)
class Report:
    """The result of `regionik.verify`.

    Attributes
    ----------
    ok : bool
    margins : dict
        Least margin of every check; negative where it is violated [m] or [rad].
    violations : tuple of Violation
    """

    ok: bool
    margins: dict[str, float]
    violations: tuple[Violation, ...]

    def __repr__(self) -> str:
        if self.ok:
            return f"Report(ok, {len(self.margins)} margins)"
        return f"Report({len(self.violations)} violations, the first: {self.violations[0].text})"


def _pose_text(base: Array) -> str:
    x, y, yaw = base.tolist()
    return f"x {x:.3f} m, y {y:.3f} m, yaw {yaw:.3f} rad"


def answer_titles(joint_names: Sequence[str]) -> tuple[str, ...]:
    """Return the titles of a table of answers."""
    return ("name", "x", "y", "z", "verdict", "code", "base_x", "base_y", "base_yaw", *joint_names, "reason")


@dataclass(frozen=True, eq=False)
class Answer:
    """Reachability of n targets.

    Attributes
    ----------
    targets : (n, 3) array
        [m]
    reachable : (n,) array of bool
    verdict : (n,) array of str
        "reachable": base and joints were found and checked, on target, on the floor and, with avoidance in
        the rules, clear of obstacles. "unreachable": the outer area is empty, which is a proof in the model,
        or each posture from each place is proven to touch something. "undecided": neither, within ``gap``.
    base : (n, 3) array
        x, y [m], yaw [rad]; NaN where there is none.
    joints : (n, dof) array
        NaN where there is none.
    reason : list of str
        One for each target; empty where it is reachable.
    gap : (n,) array
        Diameter of the largest circle of undecided places for the arm axis; 0 for a decided target [m].
    name : list of str
        What people call each target; empty for one without a name.
    code : list of str
        The reason in a word, one of `regionik.worlds.errors.ReasonCode`; empty where it is reachable.
    """

    targets: Array
    reachable: NDArray[np.bool_]
    verdict: NDArray[np.str_]
    base: Array
    joints: Array
    reason: list[str]
    gap: Array
    name: list[str]
    code: list[ReasonCode]

    def columns(self, joint_names: Sequence[str] = ()) -> dict[str, list[Any]]:
        """Return the `answer_titles` of a table and their columns; None where a target has no base.

        Joints go by the names given, as ``world.robot.chain.names`` has them; else they are numbered.
        """
        joint_names = joint_names or [f"joint_{k + 1}" for k in range(self.joints.shape[1])]
        found = np.column_stack([self.base, self.joints]).astype(object)
        found[~self.reachable] = None
        asked, told = [self.name, *self.targets.T.tolist()], [self.verdict.tolist(), self.code]
        columns = [*asked, *told, *found.T.tolist(), self.reason]
        return dict(zip(answer_titles(joint_names), columns, strict=True))

    def to_pandas(self, joint_names: Sequence[str] = ()) -> Any:
        """Return `columns` as a ``pandas.DataFrame``; an InputError where pandas is not installed."""
        try:
            from pandas import DataFrame
        except ImportError as error:
            raise InputError(f"to_pandas needs pandas (pip install pandas): {error}") from None
        return DataFrame(self.columns(joint_names))

    def __repr__(self) -> str:
        counts = dict(zip(*np.unique(self.verdict, return_counts=True), strict=True))
        found = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
        asked = f"{len(self.verdict)} target{'s' * (len(self.verdict) != 1)}"
        return f"Answer({asked}: {found or 'none'})"
