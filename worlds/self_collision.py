"""Self-collision of robots: pairs of solids that may touch, and postures in which none do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, compress

import numpy as np
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array, Mask
from regionik.worlds.chain import Chain, spread_postures
from regionik.worlds.links import BASE
from regionik.worlds.obstacles import Prism
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import Robot
from regionik.worlds.separation import ConvexBody, apart_somewhere, separated

BODY = -1  # the base's own body, among indices of solids
POSTURES, MANY_POSTURES = 64, 2000  # sampled: to find pairs, and to disable some
MIN_TOUCHING_SHARE, MAX_MEETING_SHARE, MAX_TOUCHING_SHARE = 0.1, 0.75, 0.95  # of the postures
UNLIMITED_SLIDE = 2.0  # travel of a joint without limits in these postures [m]
_PARALLEL = 1e-6
_LEVEL = 1e-9  # change of a height that is rounding [m]


def base_name(robot: Robot) -> str:
    """Return the name of the base's own body, in messages and in ``robot.unchecked``."""
    return f"base of {robot.name}"


def base_body(robot: Robot) -> Prism | None:
    """Return the base as a solid in its own frame: the footprint from the floor to ``body_height``.

    None for a base without a footprint.
    """
    if len(robot.footprint) < 3:
        return None
    return Prism(base_name(robot), Polygon(robot.footprint), 0.0, robot.body_height)


@made_once
def self_collision_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    """Return the pairs of solids that must keep apart.

    They are indices into ``robot.all_solids``, the smaller first; -1 is the base's own body. Left out are
    solids of one link, and of links that one joint connects; of the base, with what is fixed to it, and the
    first link that carries any; pairs that touch in every one of `POSTURES` postures within the limits; and
    those that ``robot.unchecked`` names.
    """
    frames = _solid_frames(robot, spread_postures(robot.chain, UNLIMITED_SLIDE, POSTURES, 0))
    links = [solid.link for solid in robot.all_solids]
    first = min((link for link in links if link > BASE), default=BASE)  # it stands on the base
    pairs = [(BODY, k) for k, link in enumerate(links) if link > first] if base_body(robot) else []
    pairs += [(i, k) for i, k in combinations(range(len(links)), 2) if abs(links[i] - links[k]) > 1]
    allowed = {frozenset(names) for names in robot.unchecked}

    def checked(i: int, k: int) -> bool:
        if {_solid_name(robot, i), _solid_name(robot, k)} in allowed:
            return False
        (one, on), (other, at) = _solid_of(robot, i), _solid_of(robot, k)
        return apart_somewhere(one, frames[:, on], other, frames[:, at])

    return tuple(pair for pair in pairs if checked(*pair))


@made_once
def off_floor(robot: Robot) -> tuple[bool, ...]:
    """Return True for each of ``robot.all_solids`` that must keep off the floor.

    Left out are those that no joint raises or lowers, fixed to the base or on its pivot, and those that reach
    into the floor in every one of `POSTURES` postures.
    """
    heights = _heights(robot, spread_postures(robot.chain, UNLIMITED_SLIDE, POSTURES, 0))
    return tuple(bool(np.ptp(one, axis=0).max() > _LEVEL and one.min(axis=1).max() > 0.0) for one in heights)


def postures_off_floor(robot: Robot, joints: Array, margin: float) -> Mask:
    """Return True for postures (n, dof) in which all that must is off the floor by a margin [m], (n,)."""
    heeded = compress(_heights(robot, joints), off_floor(robot))
    clear = [heights.min(axis=1) > margin for heights in heeded]
    found: Mask = np.all([np.ones(len(joints), dtype=bool), *clear], axis=0)
    return found


def _heights(robot: Robot, joints: Array) -> list[Array]:
    """Return, of each solid, heights of its corners less its radius in postures (n, dof), (n, k) [m]."""
    frames = _solid_frames(robot, joints)
    return [
        frames[:, solid.link, 2, :3] @ solid.corners.T + frames[:, solid.link, 2, 3:] - solid.radius
        for solid in robot.all_solids
    ]


def postures_clear(robot: Robot, joints: Array, margin: float) -> Mask:
    """Return True for postures (n, dof) in which all pairs are seen to be apart, by a margin [m], (n,)."""
    frames, clear = _solid_frames(robot, joints), np.ones(len(joints), dtype=bool)
    for i, k in self_collision_pairs(robot):
        (one, on), (other, at) = _solid_of(robot, i, margin), _solid_of(robot, k)
        left = np.flatnonzero(clear)
        clear[left] = separated(one, frames[left, on], other, frames[left, at])
    return clear


def bodies_clear(robot: Robot, points: Sequence[Array], joints: Array) -> bool:
    """Return True where of no pair that must keep apart both the solids and the bodies inside touch.

    ``points`` are as in `disabled_pairs`, ``joints`` (dof,) is one posture.
    """
    pairs = _SolidPairs(robot, points, joints[None])
    checked = self_collision_pairs(robot)
    return not any(pairs.touching(*pair).any() and pairs.meeting(*pair).any() for pair in checked)


def disabled_pairs(
    robot: Robot, points: Sequence[Array], rest: Array | None = None
) -> tuple[list[tuple[str, str]], list[str]]:
    """Return pairs of names of solids that are no use to check, and notes on those whose bodies may touch.

    That are, of the pairs that must keep apart: those between which all joints slide along one line and which
    touch somewhere, as tubes of a telescope do; those that touch often, or in the rest posture, though the
    bodies inside them do not in the same postures; those that touch nearly always; and those whose bodies
    touch in most postures, as no arm is built so: its file is crude.

    ``points`` (n, 3) are, of each of ``robot.all_solids``, corners of the hull of the body inside it, in its
    link's frame [m]; ``rest`` (dof,) is a posture that the robot is known to take.
    """
    postures = _SolidPairs(robot, points, spread_postures(robot.chain, UNLIMITED_SLIDE, MANY_POSTURES, 0))
    at_rest = _SolidPairs(robot, points, np.zeros((0, robot.chain.dof)) if rest is None else rest[None])
    pairs: list[tuple[str, str]] = []
    notes: list[str] = []
    for i, k in self_collision_pairs(robot):
        name, other = _solid_name(robot, i), _solid_name(robot, k)
        if at_rest.touching(i, k).any() and not at_rest.meeting(i, k).any():
            pairs.append((name, other))
        if pairs[-1:] == [(name, other)]:
            continue
        touching = postures.touching(i, k)
        nested = i != BODY and touching.any() and _slides_along_one_line(robot.chain, *postures.links(i, k))
        # The base's own body is but a bound, into which an arm may well reach: what is inside is not known.
        often = MAX_MEETING_SHARE if i == BODY else MIN_TOUCHING_SHARE
        if touching.mean() < often and not nested:
            continue
        real = 0 if nested else int((postures.meeting(i, k) & touching).sum())
        if real and touching.mean() < MAX_TOUCHING_SHARE and real < MAX_MEETING_SHARE * MANY_POSTURES:
            continue
        pairs.append((name, other))
        if real:
            notes.append(
                f"the bounds of {name} and {other} touch in {touching.mean():.0%} of postures, the "
                f"links themselves in up to {real / MANY_POSTURES:.0%}: this pair is not checked"
            )
    return pairs, notes


@dataclass(frozen=True, eq=False)
class _SolidPairs:
    """The solids of a robot, and the bodies inside them, in postures."""

    robot: Robot
    points: Sequence[Array]  # corners of the hulls of the bodies
    joints: Array  # (n, dof)

    @cached_property
    def frames(self) -> Array:
        return _solid_frames(self.robot, self.joints)

    def links(self, i: int, k: int) -> tuple[int, int]:
        """Return the links of two solids."""
        return _solid_of(self.robot, i)[1], _solid_of(self.robot, k)[1]

    def touching(self, i: int, k: int) -> Mask:
        """Return True for postures in which two solids are not seen to be apart."""
        return self._touching(_solid_of(self.robot, i)[0], _solid_of(self.robot, k)[0], (i, k))

    def meeting(self, i: int, k: int) -> Mask:
        """Return True for postures in which the bodies inside two solids are not."""
        one = _solid_of(self.robot, i)[0] if i == BODY else ConvexBody(self.points[i])
        return self._touching(one, ConvexBody(self.points[k]), (i, k))

    def _touching(self, one: ConvexBody, other: ConvexBody, pair: tuple[int, int]) -> Mask:
        on, at = self.links(*pair)
        return ~separated(one, self.frames[:, on], other, self.frames[:, at])


def _slides_along_one_line(chain: Chain, one: int, other: int) -> bool:
    """Return True where all joints between two links slide, and in one direction."""
    between = slice(min(one, other) + 1, max(one, other) + 1)
    if any(joint.kind != "prismatic" for joint in chain.joints[between]):
        return False
    frames = chain.frames(np.zeros(chain.dof))[:-1][between]
    axes = np.array([T[:3, :3] @ joint.axis for T, joint in zip(frames, chain.joints[between], strict=True)])
    return bool((np.abs(axes @ axes[0]) > 1 - _PARALLEL).all())


def _solid_frames(robot: Robot, joints: Array) -> Array:
    """Return link frames in the base frame in postures (n, dof), (n, links + 1, 4, 4).

    The last is the base frame itself, instead of the tool's, which carries no solid: index `BASE` finds it.
    """
    frames: Array = robot.T_base_arm @ robot.chain.frames(joints)
    frames[:, BASE] = np.eye(4)
    return frames


def _solid_name(robot: Robot, index: int) -> str:
    return base_name(robot) if index == BODY else robot.all_solids[index].name


def _solid_of(robot: Robot, index: int, margin: float = 0.0) -> tuple[ConvexBody, int]:
    """Return a solid of the robot, or the base's own body, grown by a margin [m], and its link."""
    body = base_body(robot) if index == BODY else None
    if body is not None:
        outline = np.asarray(body.polygon.exterior.coords)[:-1]
        ends = [np.c_[outline, np.full(len(outline), z)] for z in body.z_range]
        return ConvexBody(np.concatenate(ends), margin), BASE
    solid = robot.all_solids[index]
    return ConvexBody(solid.corners, solid.radius + margin), solid.link


@dataclass(frozen=True)
class _RestSearch:
    """Numbers of the search for a posture at rest."""

    margins: tuple[float, ...] = (0.01, 0.003, 0.0)  # between solids, the first that can be had [m]
    max_zeros_excess: float = 0.02  # overhang of zeros over that of the best posture found [m]
    postures: int = 2000  # drawn at first
    checked: int = 40  # of the best of a draw, at a time
    spreads: tuple[float, ...] = (
        0.5,
        0.25,
        0.1,
        0.05,
        0.02,
    )  # of draws about the best [rad] or [m]
    redrawn: int = 150  # postures in each further draw
    decimals: int = 2  # of joint values
    seed: int = 0  # of all draws


_REST = _RestSearch()


def rest_posture(robot: Robot) -> Array | None:
    """Return the clear posture whose solids stay most within the footprint and above the floor, (dof,).

    Seeded postures within the joint limits are looked at, then others ever nearer to the best of them, then
    that with single joints at zero. Zeros, or the limits nearest to them, are taken where they are clear and
    hardly worse. None where no posture is clear.
    """
    dof = robot.chain.dof
    zeros = np.clip(np.zeros((1, dof)), robot.chain.lower, robot.chain.upper)
    for margin in _REST.margins:
        drawn = spread_postures(robot.chain, UNLIMITED_SLIDE, _REST.postures, _REST.seed)
        found = _best(robot, np.concatenate([zeros, drawn]), margin)
        if found is None:
            continue
        rng = np.random.default_rng(_REST.seed)
        for spread in _REST.spreads:
            found = _better(robot, found, found + spread * rng.uniform(-1, 1, (_REST.redrawn, dof)), margin)
        for k in range(dof):
            found = _better(robot, found, np.where(np.arange(dof) == k, zeros, found), margin)
        plain = _clear(robot, zeros, margin)[0]
        worse = overhang(robot, np.stack([zeros[0], found]))
        return zeros[0] if plain and worse[0] <= worse[1] + _REST.max_zeros_excess else found
    return None


def overhang(robot: Robot, joints: Array) -> Array:
    """Return how far solids stick out of the footprint, or into the floor if that is more: their mean [m].

    (n,) for postures (n, dof); 0 where all of the arm is within.
    """
    frames, total = _solid_frames(robot, joints), np.zeros(len(joints))
    for solid in robot.solids:
        T = frames[:, solid.link]
        corners = solid.corners @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
        out = np.maximum(_outside(robot.footprint, corners[..., :2]), -corners[..., 2])
        total += np.maximum(out.max(1) + solid.radius, 0.0)
    return total / max(len(robot.solids), 1)


def _outside(footprint: Array, points: Array) -> Array:
    """Return how far points (..., 2) are beyond the sides of a convex outline, or from its one corner [m]."""
    if len(footprint) == 1:
        away: Array = np.linalg.norm(points - footprint[0], axis=-1)
        return away
    sides = np.roll(footprint, -1, axis=0) - footprint
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    turn = np.sign(sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0])
    beyond: Array = (turn * (points @ normals.T - (footprint * normals).sum(1))).max(-1)
    return beyond


def _clear(robot: Robot, joints: Array, margin: float) -> Mask:
    """Return True for postures (n, dof) that keep a margin [m] between links and off the floor, (n,)."""
    return postures_off_floor(robot, joints, margin) & postures_clear(robot, joints, margin)


def _better(robot: Robot, candidates: Array, others: Array, margin: float) -> Array:
    """Return the best of a clear posture (dof,) and others (n, dof)."""
    best = _best(robot, np.concatenate([candidates[None], others]), margin)
    return candidates if best is None else best


def _best(robot: Robot, joints: Array, margin: float) -> Array | None:
    """Return the clear one of postures (n, dof), rounded, with least overhang; None where none is clear.

    Of postures with the same overhang, but for a centimetre, the one nearest to zeros.
    """
    rounded = np.clip(np.round(joints, _REST.decimals), robot.chain.lower, robot.chain.upper)
    order = np.lexsort([np.abs(rounded).sum(1), np.round(overhang(robot, rounded), 2)])
    for rows in np.array_split(order, max(1, len(order) // _REST.checked)):
        clear = _clear(robot, rounded[rows], margin)
        if clear.any():
            best: Array = rounded[rows[np.argmax(clear)]]
            return best
    return None
