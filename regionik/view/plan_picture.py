"""The picture of a plan: the world, the areas of all set-points, and the whole motion, animated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.explain.several import left_out
from regionik.timing.trajectory import is_timed, trajectory
from regionik.values import Plan
from regionik.view.floor_view import area_words, axis_path, drawn_union, parking_circles, used_areas
from regionik.view.options import VIEW
from regionik.view.picture import (
    Color,
    KeyframeTrack,
    Picture,
    SceneMesh,
    camera_for,
    count_noun,
    setpoint_names,
)
from regionik.view.timeline import timeline
from regionik.view.triangle_meshes import TriangleMesh, floor_mesh, merge, spheres, tubes
from regionik.view.world_picture import (
    TOOL,
    floor_layer,
    floor_radius,
    joint_node,
    robot_meshes,
    robot_points,
    world_meshes,
)
from regionik.worlds.arrays import Array
from regionik.worlds.drives import unwrapped
from regionik.worlds.robot import Robot

OPTIONS = VIEW.animation
WORKS, TRAVELS, LIFTED = range(3)  # what the tool does


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """Key frames of a motion."""

    times: Array  # (n,) [s], from 0
    base: Array  # (n, 3); yaw is unwrapped, so that every turn takes the shorter direction
    joints: Array  # (n, dof)
    how: NDArray[np.int64]  # (n,) the motion to the frame: one of `WORKS`, `TRAVELS`, `LIFTED`
    passed: Array  # (k,) when each set-point is reached [s]

    @property
    def duration(self) -> float:
        return float(self.times[-1]) + OPTIONS.end_pause

    @property
    def lifted(self) -> NDArray[np.bool_]:
        """True where the motion to a frame is a transit, (n,)."""
        return self.how == LIFTED


def key_frames(plan: Plan, clock: Array) -> KeyFrames:
    """Return at most about 2,000 key frames, all set-points among them.

    States are shown at the times of a ``clock`` (n,) [s], see `display_times`. A timed plan goes between them
    as `regionik.trajectory` does.
    """
    motion, passed, how = plan.motion, clock[plan.motion.kind == "setpoint"], _how(plan)
    if is_timed(motion):
        kept = motion.time[_selected(motion.kind == "setpoint")]
        end = float(motion.time[-1])
        even = np.linspace(0.0, end, int(np.clip(OPTIONS.frame_rate * end, 2, OPTIONS.max_frames)))
        times = np.union1d(kept, even) if end > 0 else kept[:1]
        sample = trajectory(plan).sample(times)
        rows = how[np.searchsorted(motion.time, times)]
        return _frames(times, np.column_stack([sample.base, sample.joints, rows]), passed)
    states = unwrapped(motion.base)
    index = plan.world.robot.drive.cuts(states)
    times, base = _interpolated(index, clock), plan.world.robot.drive.sampled(states, index)
    keep = _selected(np.isin(index, np.flatnonzero(motion.kind == "setpoint")))
    # A row between two states belongs to the motion to the second.
    rows = how[np.ceil(index).astype(int)]
    table = np.column_stack([base, *(_interpolated(index, joint) for joint in motion.joints.T), rows])
    return _frames(times[keep], table[keep], passed)


def _how(plan: Plan) -> NDArray[np.int64]:
    """What the tool does on the way to each state, (n,)."""
    lifted, on = plan.motion.kind == "transit", plan.tool_on()
    travels = np.append(False, ~(lifted | on)[:-1]) & ~lifted
    return np.where(lifted, LIFTED, np.where(travels, TRAVELS, WORKS))


def _frames(times: Array, table: Array, passed: Array) -> KeyFrames:
    """Key frames of rows base, joints, how; more where an angle turns too far for quaternions."""
    turn = np.abs(np.diff(table[:, 2:-1], axis=0)).max(axis=1, initial=0.0)
    pieces = np.maximum(1, np.ceil(turn / (np.pi / 2)).astype(int))
    index = np.concatenate([k + np.arange(p) / p for k, p in enumerate(pieces)] + [[len(times) - 1.0]])
    moments, *rows = (_interpolated(index, column) for column in (times, *table.T[:-1]))
    poses, how = np.column_stack(rows), table[np.ceil(index).astype(int), -1].round().astype(np.int64)
    return KeyFrames(moments, poses[:, :3], poses[:, 3:], how, passed)


def display_times(plan: Plan) -> Array:
    """Times at which states are shown (n,): their own, or those of an even speed [s]."""
    motion = plan.motion
    if is_timed(motion):
        return motion.time
    return _even_times(unwrapped(motion.base), motion.joints, plan.tools())


def _interpolated(index: Array, column: Array) -> Array:
    """A column of states, interpolated at fractional indices."""
    values: Array = np.interp(index, np.arange(len(column)), column)
    return values


def _even_times(base: Array, joints: Array, tools: Array) -> Array:
    """Times (n,) at which base, tool or a joint moves at the speed shown, whichever moves farther [s]."""
    driven, moved = (np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (base[:, :2], tools))
    turned = np.abs(np.diff(np.column_stack([base[:, 2], joints]), axis=0)).max(axis=1)
    moves = np.maximum(np.maximum(driven, moved), OPTIONS.turn_radius * turned)
    times = np.concatenate([[0.0], np.cumsum(np.maximum(moves, OPTIONS.min_step))]) / OPTIONS.shown_speed
    total = times[-1]
    return times * (np.clip(total, OPTIONS.min_duration, OPTIONS.max_duration) / total if total > 0 else 1.0)


def _selected(at_setpoint: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices of the states that become key frames."""
    n = len(at_setpoint)
    others = n if n <= OPTIONS.max_frames else max(2, OPTIONS.max_frames - int(at_setpoint.sum()))
    spread = np.linspace(0, n - 1, others).round().astype(np.intp)
    return np.union1d(spread, np.flatnonzero(at_setpoint))


def turn_quaternions(axis: Array, angles: Array) -> Array:
    """Return quaternions x, y, z, w (n, 4) of turns about a unit axis; continuous where the angles are."""
    half = np.asarray(angles)[:, None] / 2
    return np.hstack([np.sin(half) * axis, np.cos(half)])


def picture_of_plan(plan: Plan, clock: Array | None = None) -> Picture:
    """Return the picture of a plan, animated by a ``clock`` (n,), by default its `display_times` [s]."""
    clock = display_times(plan) if clock is None else clock
    world, frames = plan.world, key_frames(plan, clock)
    robot, poses = robot_meshes(world, frames.base[0], frames.joints[0])
    covered = drawn_union([area.admissible for area in plan.areas])
    areas, area_tracks = _areas(plan, frames, covered)
    marks, mark_tracks = _passed_setpoints(plan, frames)
    trace, trace_tracks = _tool_trace(plan, frames)
    tracks = [*_robot_tracks(world.robot, frames), *area_tracks, *mark_tracks, *trace_tracks]
    some = slice(None, None, 1 + len(frames.times) // 300)
    camera = camera_for(world, robot_points(world.robot, frames.base[some], frames.joints[some]))
    moves = len(frames.times) > 1
    counts = [count_noun(len(plan.setpoints), "set-point"), count_noun(plan.lift_offs, "lift-off")]
    out = [left_out(plan.skipped, len(plan.setpoints) + len(plan.skipped))] if plan.skipped else []
    return Picture(
        title=world.name,
        facts=(*counts, *out, f"{plan.motion.time[-1]:.1f} s" if is_timed(plan.motion) else "not timed"),
        bodies=(
            *(*areas, *_parking_meshes(plan), *world_meshes(world, covered)),
            *(*_left_out(plan), *marks, *trace, *robot),
        ),
        poses=poses,
        camera=camera,
        extent=floor_radius(world, camera),
        tracks=tuple(_extended(track, frames.duration) for track in tracks) if moves else (),
        timeline=timeline(plan, clock) if moves else None,
        setpoints=setpoint_names(world),
    )


def _areas(
    plan: Plan, frames: KeyFrames, covered: BaseGeometry
) -> tuple[list[SceneMesh], list[KeyframeTrack]]:
    """Unions of what is used and of what is not, the area of the next set-point, and the axis' path."""
    used, (strong_words, pale_words) = used_areas(plan), area_words(plan)
    strong = drawn_union(used)
    single = [floor_mesh(area.simplify(VIEW.floor.detail)) for area in used]
    path = axis_path(plan)
    line = LineString(np.vstack([path, path[-1:]])).buffer(0.007)
    bodies = [
        SceneMesh("areas/next", merge(single), Color.CURRENT, 1.0, 5, label="area of the next set-point"),
        floor_layer("areas/strong", strong, Color.STRONG, 4, strong_words),
        floor_layer("areas/pale", covered - strong, Color.PALE, 3, pale_words),
        floor_layer("areas/axis path", line, Color.AXIS_PATH, 6, "path of the arm's axis"),
    ]
    if not single:
        return bodies, []
    count = np.array([len(part.faces) for part in single])
    # Set-point k is the next one as soon as k - 1 is passed.
    since = np.concatenate([[0.0], frames.passed[:-1]])
    faces = np.column_stack([np.cumsum(count) - count, count])
    return bodies, [KeyframeTrack("areas/next", "faces", since, faces)]


def _parking_meshes(plan: Plan) -> list[SceneMesh]:
    """The circles in which the arm's axis may park at its stops."""
    if not plan.stops:
        return []
    circles = parking_circles(plan.world, plan.stops)
    return [floor_layer("areas/parking", circles, Color.PARKING, 7, "circles to park in")]


def _left_out(plan: Plan) -> Iterator[SceneMesh]:
    """Marks of the set-points that are left out, each named by its reason."""
    for one in plan.skipped:
        mark = spheres(one.target.position[None], 1.6 * VIEW.scene.mark_radius)
        path = f"task/left out {one.setpoint}"
        yield SceneMesh(path, mark, Color.MISSING, label="set-points left out", name=one.reason)


def _passed_setpoints(plan: Plan, frames: KeyFrames) -> tuple[list[SceneMesh], list[KeyframeTrack]]:
    """Green marks, a little larger than those ahead, which they cover one by one."""
    marks = spheres(np.array([t.position for t in plan.world.task]), 1.15 * VIEW.scene.mark_radius)
    times = np.concatenate([[0.0], frames.passed])
    counts = len(marks.faces) // len(plan.world.task) * np.arange(len(times))
    track = KeyframeTrack("task/passed", "faces", times, _from_first(counts))
    numbers, label = tuple(range(len(plan.world.task))), "set-points passed"
    drawn = SceneMesh("task/passed", marks, Color.PASSED, label=label, name="set-point", numbers=numbers)
    return [drawn], [track]


def _tool_trace(plan: Plan, frames: KeyFrames) -> tuple[list[SceneMesh], list[KeyframeTrack]]:
    """The path the tool has taken: at work, on travel and where it is lifted."""
    if len(frames.times) < 2:
        return [], []
    tools = plan.world.robot.tool(frames.base, frames.joints)[:, :3, 3]
    whole = tubes(tools, 0.006)
    bodies, tracks = [], []
    for path, how, color, label in (
        ("tool/trace", WORKS, Color.PASSED, "path of the tool"),
        ("tool/travel", TRAVELS, Color.TRAVEL, "tool on travel"),
        ("tool/lifted", LIFTED, Color.LIFTED, "tool lifted"),
    ):
        rows = frames.how[1:] == how
        faces = whole.faces[np.repeat(rows, 2 * VIEW.scene.tube_sides)]
        counts = 2 * VIEW.scene.tube_sides * np.concatenate([[0], np.cumsum(rows)])
        if rows.any():
            mesh = TriangleMesh(whole.vertices, faces)
            bodies.append(SceneMesh(path, mesh, color, lit=False, label=label))
            tracks.append(KeyframeTrack(path, "faces", frames.times, _from_first(counts)))
    return bodies, tracks


def _robot_tracks(robot: Robot, frames: KeyFrames) -> list[KeyframeTrack]:
    """Base, joints, and the colour of the tool."""
    up = np.array([0.0, 0.0, 1.0])
    spots = np.column_stack([frames.base[:, :2], np.zeros(len(frames.base))])
    tracks = [
        KeyframeTrack("robot", "position", frames.times, spots),
        KeyframeTrack("robot", "turn", frames.times, turn_quaternions(up, frames.base[:, 2])),
    ]
    for k, joint in enumerate(robot.chain.joints):
        values = robot.chain.joint_values(frames.joints)[:, k]
        turns, node = joint.kind == "revolute", joint_node(k)
        moved = turn_quaternions(joint.axis, values) if turns else np.outer(values, joint.axis)
        tracks.append(KeyframeTrack(node, "turn" if turns else "position", frames.times, moved))
    tip = f"{joint_node(len(robot.chain.joints) - 1)}/{TOOL}"
    # A frame says how the motion to it went: the tool is lifted from the frame before.
    ahead = np.append(frames.how[1:], frames.how[-1:])
    colors = np.array([_rgb(color) for color in (Color.PASSED, Color.TRAVEL, Color.LIFTED)])[ahead]
    tracks.append(KeyframeTrack(tip, "color", frames.times, colors))
    return tracks


def _extended(track: KeyframeTrack, end: float) -> KeyframeTrack:
    """The track held until ``end`` [s], so that all end together, without redundant keys."""
    times = np.append(track.times, end)
    values = np.concatenate([track.values, track.values[-1:]])
    still = (values[1:] == values[:-1]).all(axis=1)
    keep = np.ones(len(times), dtype=bool)
    keep[1:-1] = ~(still[:-1] & still[1:])
    return KeyframeTrack(track.path, track.kind, times[keep], values[keep])


def _from_first(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.column_stack([np.zeros_like(counts), counts])


def _rgb(color: int) -> Array:
    return np.array([color >> 16, color >> 8 & 255, color & 255]) / 255
