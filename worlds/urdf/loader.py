"""Robots from URDF files.

The chain runs over the moving joints from root to tip; fixed joints are folded into its frames. Masses are
read, of all links that move with the chain, and visual elements to be shown; moments of inertia are not.
Soft limits of a safety controller narrow a joint's own. Speed limits of 0, and limits of a million and more,
count as none.

Solids bound the collision elements of all links that move with the chain: boxes and capsules as they are,
a prism around each cylinder, a capsule around each sphere, a few boxes and capsules around each mesh; some
twenty in all, as small ones share a bound. Links behind other joints (fingers, heads) stand still at zero.
Two bounds that touch in many postures, while the hulls inside them touch in none of 2000, need not keep
apart.

The root and all that is fixed to it, wheels included, give footprint and body height where they are not
given. Unless ``body_height`` says it, the base is cut at the height at which all takes least volume; what
stands higher, such as a mast, becomes solids of its own.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen, transform_points
from regionik.worlds.bundled import robot_named, robot_names
from regionik.worlds.chain import Chain, planar_pose
from regionik.worlds.disk_cache import cached
from regionik.worlds.drives import BaseKind, drive_of
from regionik.worlds.errors import FileNote, InputError, RobotNote, located, located_error
from regionik.worlds.links import BASE, CUBE_CORNERS
from regionik.worlds.readers.meshes import Surface
from regionik.worlds.readers.text import MAX_NUMBER, join_names
from regionik.worlds.robot import BODY_HEIGHT, Robot, Tool, check_turning_radius, with_tool, without_limits
from regionik.worlds.self_collision import bodies_clear, disabled_pairs, rest_posture
from regionik.worlds.surfaces import VisualSurface, coarsened
from regionik.worlds.urdf.bounding import hull_triangles
from regionik.worlds.urdf.collision import CollisionModel, collision_model, solid_part
from regionik.worlds.urdf.decomposition import CollisionPart
from regionik.worlds.urdf.elements import CollisionShape, UrdfModel, read_urdf
from regionik.worlds.urdf.installed import urdf_file
from regionik.worlds.urdf.kinematic_tree import (
    KinematicPath,
    LinkPlacement,
    PlacedLink,
    chain_along,
    kinematic_path,
    link_masses,
    place_links,
)
from regionik.worlds.urdf.meshes import MeshFiles
from regionik.worlds.urdf.options import URDF
from regionik.worlds.urdf.srdf import (
    NO_SEMANTICS,
    SemanticModel,
    named_pairs,
    read_srdf,
    semantic_pairs,
    srdf_beside,
)

OPTIONS = URDF.seen

_UPRIGHT = 1e-9


def load_robot(
    name_or_path: str | Path,
    base: BaseKind | None = None,
    tip: str | None = None,
    root: str | None = None,
    footprint: ArrayLike | None = None,
    mount: ArrayLike | None = None,
    turning_radius: float | None = None,
    body_height: float | None = None,
    carry: ArrayLike | str | None = None,
    limits: Literal["ignore"] | None = None,
    payload: float = 0.0,
    srdf: str | Path | None = None,
    unchecked: Sequence[Sequence[str]] = (),
    ignore: Sequence[str] = (),
    tool: Tool | None = None,
) -> Robot:
    """Return a bundled robot by its name, or the robot of a URDF file by its path or its name.

    Parameters
    ----------
    name_or_path : str or Path
        A bundled name, a path that ends in .urdf or .xml, or the name of a robot in an installed package; see
        `regionik.worlds.urdf.installed`.
    base : {"omni", "differential", "car"}, optional
        By default omni, or what the bundled robot has.
    tip, root : str, optional
        Links of the URDF file; by default the end of its one longest arm, and its root.
    footprint : (n, 2) array_like, optional
        Corners in order of the base's convex outline, or one point [m].
    mount : (4,) array_like, optional
        Root link, or arm of a bundled robot, in the base frame: x, y, z [m], yaw [rad]; by default zero.
    turning_radius : float, optional
        Least turning radius, which a car needs [m].
    body_height : float, optional
        The base is its footprint up to this height [m].
    carry : (dof,) array_like or str, optional
        Joint values with which the arm is driven about, or the name of a posture of the SRDF file; by default
        the first resting one of these that is clear, else `regionik.worlds.self_collision.rest_posture`.
    limits : "ignore", optional
        Leave out all joint limits.
    payload : float
        Mass held at the tool frame's origin [kg].
    srdf : str or Path, optional
        SRDF file; by default the one beside the URDF file (`regionik.worlds.urdf.srdf.srdf_beside`), if any.
    unchecked : sequence of (str, str), optional
        Pairs of links, or of solids, that need not keep apart besides.
    ignore : sequence of str, optional
        Links of the URDF file whose collision elements do not count, such as safety boxes.
    tool : Tool, optional
        What is mounted on the tip.

    Raises
    ------
    InputError
        One line: the file, the place in it, what was expected and the valid choices.

    Warns
    -----
    RobotNote
        Where a capsule replaces a mesh, and where links are left out.
    FileNote
        Where a mesh is far larger than the arm is long.

    Examples
    --------
    >>> load_robot("youbot", base="differential").base
    'differential'
    """
    where = str(name_or_path)
    with located(where, ""):
        given = _Overrides(base, footprint, mount, turning_radius, body_height, carry, limits, payload, tool)
    if isinstance(name_or_path, Path) or where not in robot_names():
        companion = None if srdf is None else Path(srdf)
        model = read_urdf(urdf_file(name_or_path)).without_shapes(ignore)
        return given.applied(_from_urdf(model, tip, root, given, companion, unchecked), where)
    lists = {"unchecked": unchecked or None, "ignore": ignore or None}
    refused = {"tip": tip, "root": root, "srdf": srdf, **lists}
    return given.applied(_bundled(where, refused, given), where)


@dataclass(frozen=True, eq=False)
class _Overrides:
    """Arguments of `load_robot` that replace what the robot has; None where they do not."""

    base: BaseKind | None
    footprint: ArrayLike | None
    mount: ArrayLike | None
    turning_radius: float | None
    body_height: float | None
    carry: ArrayLike | str | None
    limits: Literal["ignore"] | None
    payload: float
    tool: Tool | None

    def __post_init__(self) -> None:
        if self.base is not None and self.base not in get_args(BaseKind):
            raise InputError(f"base: expected one of {', '.join(get_args(BaseKind))}, got {self.base!r}")
        if self.limits not in (None, "ignore"):
            raise InputError(f"limits: expected ignore, got {self.limits!r}")
        for key, shape in (("footprint", (None, 2)), ("mount", (4,)), ("carry", (None,))):
            named = key == "carry" and isinstance(self.carry, str)
            if getattr(self, key) is not None and not named:
                object.__setattr__(self, key, _numbers(getattr(self, key), shape, key))
        for key in ("turning_radius", "body_height"):
            if getattr(self, key) is not None:
                number = float(_numbers(getattr(self, key), (), key))
                if number <= 0:
                    raise InputError(f"{key}: must be above 0, got {number:g}")
                object.__setattr__(self, key, number)

    def applied(self, robot: Robot, where: str) -> Robot:
        """Return a robot with what is given here; its mount and tool, and named postures, are set before."""
        robot = robot if self.limits is None else without_limits(robot)
        kind = robot.base if self.base is None else self.base
        radius = drive_of(kind, robot.turning_radius).turning_radius
        radius = radius if self.turning_radius is None else self.turning_radius
        replaced = {key: getattr(self, key) for key in ("footprint", "carry", "body_height")}
        given = {key: value for key, value in replaced.items() if value is not None}
        with located(where, ""):
            if isinstance(self.carry, str):
                del given["carry"]
            elif self.carry is not None:
                robot.chain.check_limits(np.asarray(self.carry).tolist(), "carry")
            check_turning_radius(kind, radius)
            return replace(robot, base=kind, turning_radius=radius, payload=self.payload, **given)


def _from_urdf(
    model: UrdfModel,
    tip: str | None,
    root: str | None,
    given: _Overrides,
    srdf: Path | None,
    unchecked: Sequence[Sequence[str]],
) -> Robot:
    companion = srdf_beside(model.path) if srdf is None else srdf
    semantics = NO_SEMANTICS if companion is None else read_srdf(companion, model)
    kinematic = kinematic_path(model, root, tip)
    chain = chain_along(model, kinematic, limited=given.limits is None)
    x, y, z, yaw = np.zeros(4) if given.mount is None else np.asarray(given.mount)
    T_base_root = planar_pose(x, y, yaw, z)
    mount, chain = _mounted(chain, T_base_root, float(yaw))
    placement = place_links(model, kinematic, T_base_root, semantics.at_rest)
    measured = given.footprint is None or given.body_height is None
    links = [link for link in placement.links if measured or link.owner != BASE]
    body = collision_model(model, links, chain, given.body_height, placement.resting)
    notes = [*body.notes, *_notes(placement, measured, kinematic)]
    with located(model.where, ""):
        robot = _robot(model, mount, chain, body, given)
    seen = _visual_surfaces(model, placement.links, (*body.parts, *body.base.parts))
    robot = replace(robot, masses=link_masses(model, placement), visuals=seen)
    if given.tool is not None:
        robot = with_tool(robot, given.tool)
        body = replace(body, parts=(*body.parts, *map(solid_part, robot.solids[len(body.parts) :])))
    with located(model.where, ""):
        known = [*semantic_pairs(robot, body, semantics.disabled), *named_pairs(robot, body, unchecked)]
        robot = replace(robot, unchecked=tuple(known))
        robot, touching = _at_rest(robot, body, semantics, given.carry)
    for note in body.oddities:
        warnings.warn(f"{model.where}: {note}", FileNote, stacklevel=3)
    for note in (*notes, *_tip_notes(robot), *touching):
        warnings.warn(f"{model.where}: {note}", RobotNote, stacklevel=3)
    return robot


def _robot(model: UrdfModel, mount: Array, chain: Chain, body: CollisionModel, given: _Overrides) -> Robot:
    outline = body.base.outline if given.footprint is None else np.asarray(given.footprint)
    height = body.base.height if given.body_height is None else given.body_height
    return Robot(
        name=model.name,
        base="omni",
        footprint=outline if len(outline) else np.zeros((1, 2)),
        mount=mount,
        chain=chain,
        solids=tuple(part.solid for part in body.parts),
        body_height=height if height > 0 else BODY_HEIGHT,
        base_solids=tuple(part.solid for part in body.base.parts),
    )


def _at_rest(
    robot: Robot, body: CollisionModel, semantics: SemanticModel, carry: ArrayLike | str | None
) -> tuple[Robot, list[str]]:
    """Return a robot with its carry posture and the pairs that are no use to check, and notes on both.

    To find these takes seconds, so they are kept on disk.
    """
    points = [part.points for part in (*body.parts, *body.base.parts)]
    given = None if carry is None else carry if isinstance(carry, str) else np.asarray(carry)
    bare = replace(robot, visuals=())
    rest, pairs, notes = cached(
        "at_rest", (bare, points, semantics, given), lambda: _studied(bare, points, semantics, given)
    )
    robot = replace(robot, unchecked=(*robot.unchecked, *pairs))
    return (robot if rest is None else replace(robot, carry=rest)), list(notes)


def _studied(
    robot: Robot, points: list[Array], semantics: SemanticModel, carry: Array | str | None
) -> tuple[Array | None, tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Return a robot's carry posture, if any is known, pairs that are no use to check, and notes on both."""
    named = semantics.resting_postures(robot.chain) if carry is None else []
    postures = [semantics.posture(name, robot.chain) for name in named]
    rest = next((posture for posture in postures if bodies_clear(robot, points, posture)), None)
    if isinstance(carry, str):
        rest = semantics.posture(carry, robot.chain)
    pairs, notes = disabled_pairs(robot, points, rest)
    if named and rest is None:
        notes.append(f"links touch in posture {named[0]} of the SRDF file: the arm is carried in another")
    if rest is None and carry is None:
        rest = rest_posture(replace(robot, unchecked=(*robot.unchecked, *pairs)))
        if rest is None:
            notes.append("no posture was found in which the arm keeps off itself: it is carried at zeros")
    return rest, tuple(pairs), tuple(notes)


def _mounted(chain: Chain, T_base_root: Array, yaw: float) -> tuple[Array, Chain]:
    """Return the mount (4,) of the arm's base frame, and the chain seen from it.

    The frame stands upright at the first joint; where that is a vertical pivot, or lifts stand below one, on
    the pivot's axis, as `regionik.worlds.arms` expects.
    """
    first = chain.joints[0]
    T_base_first = T_base_root @ first.T_parent_joint
    at_zero = T_base_root @ chain.frames(np.zeros(chain.dof))
    place = T_base_first[:3, 3].copy()
    for joint, T in zip(chain.joints, at_zero, strict=False):
        if abs((T[:3, :3] @ joint.axis)[2]) < 1 - _UPRIGHT:
            break
        if joint.kind == "revolute":
            place[:2] = T[:2, 3]
            break
    mount = np.array([*place, yaw])
    T_arm_first = np.linalg.inv(planar_pose(place[0], place[1], yaw, place[2])) @ T_base_first
    joints = (replace(first, T_parent_joint=T_arm_first), *chain.joints[1:])
    return mount, Chain(joints, chain.T_last_tool)


def _notes(placement: LinkPlacement, measured: bool, path: KinematicPath) -> list[str]:
    notes = []
    jerks = [joint.name for joint in path.joints if isfinite(joint.jerk)]
    if jerks:
        names = join_names(jerks, 8)
        notes.append(f"limits of jerk ({names}) are kept only where speeds.joint_jerk asks for them")
    if placement.stills and measured:
        names = join_names(placement.stills, 8)
        notes.append(f"joints of the base that are not the arm's ({names}) are taken to stand still")
    if placement.copies:
        names = join_names(placement.copies, 8)
        notes.append(f"joints that mimic the arm's ({names}) are taken to stand still")
    return notes


def _tip_notes(robot: Robot) -> list[str]:
    depth, name = robot.tip_depth
    if depth < URDF.doubts.min_tool_depth:
        return []
    return [
        f"the tool point lies {depth:.4f} m inside {name}: it sinks that deep into what the tool touches, "
        "which rules.contact_depth must allow; or give a tip at the end of the tool"
    ]


def _bundled(name: str, refused: dict[str, Any], given: _Overrides) -> Robot:
    for what, value in refused.items():
        if value is not None:
            raise located_error(name, what, "a bundled robot has no links to choose from")
    if isinstance(given.carry, str):
        raise located_error(name, "carry", "expected joint values, as a bundled robot has no named postures")
    robot = robot_named(name)
    robot = robot if given.mount is None else replace(robot, mount=np.asarray(given.mount))
    return robot if given.tool is None else with_tool(robot, given.tool)


def _numbers(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    array = frozen(values, shape, what)
    if array.size and np.abs(array).max() > MAX_NUMBER:
        raise InputError(f"{what}: expected numbers of at most {MAX_NUMBER:g} in size")
    return array


def _visual_surfaces(
    model: UrdfModel, links: Iterable[PlacedLink], parts: Iterable[CollisionPart]
) -> tuple[VisualSurface, ...]:
    """Return what is seen of links, one surface for each colour of what moves together.

    Elements that cannot be read are passed over: pictures do without. The first surface on a link stands for
    those parts of it that are of links with surfaces.
    """
    meshes = MeshFiles(model.path)
    pieces: dict[tuple[int, int], list[Array]] = {}
    seen: set[str] = set()
    for link in links:
        for shape, color in model.visuals[link.name]:
            for one in _surfaces(shape, meshes):
                paint = color if color is not None else OPTIONS.grey if one.color is None else one.color
                placed = transform_points(link.T_owner_link @ shape.T_link_shape, one.triangles)
                pieces.setdefault((link.owner, paint), []).append(placed)
                seen.add(link.name)
    surfaces = []
    for (owner, paint), some in pieces.items():
        corners = np.concatenate(some).reshape(-1, 3)
        if np.isfinite(corners).all() and len(corners):
            surfaces.append(VisualSurface(owner, paint, corners, np.arange(len(corners)).reshape(-1, 3)))
    shown: dict[int, tuple[str, ...]] = {}
    for part in parts:
        if part.sources & seen:
            shown[part.link] = (*shown.get(part.link, ()), part.solid.name)
    coarse = coarsened(tuple(surfaces), OPTIONS.max_triangles)
    return tuple(replace(one, stands_for=shown.pop(one.link, ())) for one in coarse)


def _surfaces(shape: CollisionShape, meshes: MeshFiles) -> Iterator[Surface]:
    """Yield the surface of a visual element in its own frame."""
    if shape.kind != "mesh":
        yield Surface(hull_triangles(_corners(shape)), None)
        return
    with suppress(InputError):
        yield from (one for one in meshes.colored(shape) if len(one.triangles) <= OPTIONS.max_mesh_triangles)


def _corners(shape: CollisionShape) -> Array:
    """Return corners whose hull is a box, a cylinder, a sphere or a capsule (n, 3)."""
    if shape.kind == "box":
        box: Array = CUBE_CORNERS * np.array(shape.size) / 2
        return box
    angle = 2 * np.pi * np.arange(OPTIONS.facets) / OPTIONS.facets
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(OPTIONS.facets)])
    up = np.array([0.0, 0.0, 1.0])
    if shape.kind == "cylinder":
        radius, length = shape.size
        return np.concatenate([radius * ring + end * length / 2 * up for end in (-1, 1)])
    heights = np.linspace(-1, 1, OPTIONS.facets // 2 + 1)
    sphere = [np.sqrt(1 - z * z) * ring + z * up for z in np.sin(heights * np.pi / 2).tolist()]
    ball = np.unique(shape.size[0] * np.concatenate(sphere), axis=0)
    if shape.kind == "sphere":
        return ball
    return np.concatenate([ball + end * shape.size[1] / 2 * up for end in (-1, 1)])
