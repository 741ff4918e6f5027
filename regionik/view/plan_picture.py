"""The picture of a plan: the world, the areas of all set-points, and the whole motion, animated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.values import Plan
from regionik.view.figure_data import parking_circles
from regionik.view.picture import Color, KeyframeTrack, Picture, SceneMesh, camera_for, count_noun
from regionik.view.triangle_meshes import TUBE_SIDES, floor_mesh, merge, spheres, tubes
from regionik.view.world_picture import (
    DETAIL,
    MARK_RADIUS,
    TOOL,
    floor_layer,
    floor_radius,
    joint_node,
    robot_meshes,
    world_meshes,
)
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot

SPEED = 0.25  # of base or tool, whichever moves farther [m/s]
SHORTEST, LONGEST = 10.0, 60.0  # [s]
REST = 1.5  # at the end, before the animation starts again [s]
MOST_FRAMES = 2000
_TURN_RADIUS = 0.2  # a turn counts as the motion of a point at this distance from the axis [m]
_LEAST_STEP = 0.002  # [m], so that no two states have the same time


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """Key frames of a motion."""

    times: Array  # (n,) [s], from 0
    base: Array  # (n, 3); yaw is unwrapped, so that every turn takes the shorter direction
    joints: Array  # (n, dof)
    lifted: NDArray[np.bool_]  # (n,) the motion to the frame is a transit
    passed: Array  # (k,) when each set-point is reached [s]

    @property
    def duration(self) -> float:
        return float(self.times[-1]) + REST


def key_frames(plan: Plan) -> KeyFrames:
    """Return at most about `MOST_FRAMES` key frames, all set-points among them."""
    motion, drive = plan.motion, plan.world.robot.drive
    states = np.column_stack([motion.base[:, :2], np.unwrap(motion.base[:, 2])])
    clock = _display_times(states, motion.joints, plan.tools())
    index = drive.cuts(states)
    times, base = _interpolated(index, clock), drive.sampled(states, index)
    at_setpoint = np.isin(index, np.flatnonzero(motion.kind == "setpoint"))
    keep = _selected(at_setpoint)
    dof = motion.joints.shape[1]
    # A row between two states belongs to the motion to the second.
    lifted = (motion.kind == "transit")[np.ceil(index).astype(int)]
    table = np.column_stack([base, *(_interpolated(index, joint) for joint in motion.joints.T), lifted])[keep]
    fine = _refined(times[keep], table)
    return KeyFrames(
        times=fine[:, 0],
        base=fine[:, 1:4],
        joints=fine[:, 4 : 4 + dof],
        lifted=fine[:, -1] > 0.5,
        passed=times[at_setpoint],
    )


def _interpolated(index: Array, column: Array) -> Array:
    """A column of states, interpolated at fractional indices."""
    values: Array = np.interp(index, np.arange(len(column)), column)
    return values


def _display_times(base: Array, joints: Array, tools: Array) -> Array:
    """Times at which states are shown (n,) [s]."""
    moves = np.column_stack(
        [
            np.linalg.norm(np.diff(base[:, :2], axis=0), axis=1),
            np.linalg.norm(np.diff(tools, axis=0), axis=1),
            _TURN_RADIUS * np.abs(np.diff(base[:, 2])),
            _TURN_RADIUS * np.abs(np.diff(joints, axis=0)).max(axis=1),
        ]
    ).max(axis=1)
    times = np.concatenate([[0.0], np.cumsum(np.maximum(moves, _LEAST_STEP))]) / SPEED
    total = times[-1]
    scale = np.clip(total, SHORTEST, LONGEST) / total if total > 0 else 1.0
    scaled: Array = times * scale
    return scaled


def _selected(at_setpoint: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices of the states that become key frames."""
    n = len(at_setpoint)
    others = n if n <= MOST_FRAMES else max(2, MOST_FRAMES - int(at_setpoint.sum()))
    spread = np.linspace(0, n - 1, others).round().astype(np.intp)
    return np.union1d(spread, np.flatnonzero(at_setpoint))


def _refined(times: Array, table: Array) -> Array:
    """Rows of time and table, subdivided where an angle turns too far to interpolate quaternions."""
    turn = np.abs(np.diff(table[:, 2:-1], axis=0)).max(axis=1, initial=0.0)
    pieces = np.maximum(1, np.ceil(turn / (np.pi / 2)).astype(int))
    index = np.concatenate([k + np.arange(p) / p for k, p in enumerate(pieces)] + [[len(times) - 1.0]])
    columns = np.column_stack([times, table])
    fine: Array = np.column_stack([_interpolated(index, c) for c in columns.T])
    fine[:, -1] = table[np.ceil(index).astype(int), -1]
    return fine


def turn_quaternions(axis: Array, angles: Array) -> Array:
    """Return quaternions x, y, z, w (n, 4) of turns about a unit axis; continuous where the angles are."""
    half = np.asarray(angles)[:, None] / 2
    return np.hstack([np.sin(half) * axis, np.cos(half)])


def picture_of_plan(plan: Plan) -> Picture:
    """Return the picture of a plan, animated."""
    world, frames = plan.world, key_frames(plan)
    robot, poses = robot_meshes(world.robot, frames.base[0], frames.joints[0])
    covered = shapely.union_all([area.admissible for area in plan.areas]).simplify(DETAIL)
    areas, area_tracks = _areas(plan, frames, covered)
    marks, mark_tracks = _passed_setpoints(plan, frames)
    trace, trace_tracks = _tool_trace(plan, frames)
    tracks = [*_robot_tracks(world.robot, frames), *area_tracks, *mark_tracks, *trace_tracks]
    tools = world.robot.tool(plan.motion.base, plan.motion.joints)[:, :2, 3]
    camera = camera_for(world, np.vstack([world.robot.drive.trace(plan.motion.base), tools]))
    return Picture(
        title=world.name,
        facts=(count_noun(len(plan.setpoints), "set-point"), count_noun(plan.lift_offs, "lift-off")),
        legend=(*_legend(frames), *(((Color.HEADING, "circles to park in"),) if plan.stops else ())),
        bodies=(*world_meshes(world, covered), *areas, *_parking_meshes(plan), *robot, *marks, *trace),
        poses=poses,
        camera=camera,
        extent=floor_radius(world, camera),
        tracks=tuple(_extended(track, frames.duration) for track in tracks) if len(frames.times) > 1 else (),
    )


def _legend(frames: KeyFrames) -> tuple[tuple[int, str], ...]:
    lifted = ((Color.LIFTED, "tool lifted"),) if frames.lifted.any() else ()
    return (
        (Color.CURRENT, "area of the next set-point"),
        (Color.STRONG, "areas for the whole path"),
        (Color.PALE, "admissible, but a dead end"),
        (Color.NAVIGABLE, "free floor"),
        (Color.REJECTION, "rejected: too close to a solid"),
        (Color.SOLID, "obstacles"),
        (Color.BASE_PATH, "path of the base"),
        (Color.AHEAD, "set-points ahead"),
        (Color.PASSED, "set-points passed, path of the tool"),
        *lifted,
    )


def _areas(
    plan: Plan, frames: KeyFrames, covered: BaseGeometry
) -> tuple[list[SceneMesh], list[KeyframeTrack]]:
    """Pale and strong unions, the area of the next set-point, and the base's path over them."""
    pruned = [area.pruned for area in plan.areas]
    strong = shapely.union_all(pruned).simplify(DETAIL)
    pale = covered - strong
    single = [floor_mesh(area.simplify(DETAIL)) for area in pruned]
    track = plan.world.robot.drive.trace(plan.motion.base)
    path = LineString(np.vstack([track, track[-1:]]))
    bodies = [
        floor_layer("areas/pale", pale, Color.PALE, 0.8, 3),
        floor_layer("areas/strong", strong, Color.STRONG, 0.62, 4),
        SceneMesh("areas/next", merge(single), Color.CURRENT, 0.55, 5, lit=False),
        floor_layer("areas/base path", path.buffer(0.007), Color.BASE_PATH, 0.95, 6),
    ]
    if not single:
        return bodies, []
    count = np.array([len(part.faces) for part in single])
    # Set-point k is the next one as soon as k - 1 is passed.
    since = np.concatenate([[0.0], frames.passed[:-1]])
    faces = np.column_stack([np.cumsum(count) - count, count])
    return bodies, [KeyframeTrack("areas/next", "faces", since, faces)]


def _parking_meshes(plan: Plan) -> list[SceneMesh]:
    """The circles in which the base may park at its stops."""
    if not plan.stops:
        return []
    return [floor_layer("areas/parking", parking_circles(plan.stops), Color.HEADING, 0.9, 7)]


def _passed_setpoints(plan: Plan, frames: KeyFrames) -> tuple[list[SceneMesh], list[KeyframeTrack]]:
    """Green marks, a little larger than those ahead, which they cover one by one."""
    marks = spheres(np.array([t.position for t in plan.world.task]), 1.15 * MARK_RADIUS)
    times = np.concatenate([[0.0], frames.passed])
    counts = len(marks.faces) // len(plan.world.task) * np.arange(len(times))
    track = KeyframeTrack("task/passed", "faces", times, _from_first(counts))
    return [SceneMesh("task/passed", marks, Color.PASSED)], [track]


def _tool_trace(plan: Plan, frames: KeyFrames) -> tuple[list[SceneMesh], list[KeyframeTrack]]:
    """The path the tool has taken, green at work and violet where it is lifted."""
    if len(frames.times) < 2:
        return [], []
    tools = plan.world.robot.tool(frames.base, frames.joints)[:, :3, 3]
    mesh = tubes(tools, 0.006)
    lifted = np.repeat(frames.lifted[1:], 2 * TUBE_SIDES)
    colors = np.where(lifted[:, None], _rgb(Color.LIFTED), _rgb(Color.PASSED))
    body = SceneMesh("tool/trace", mesh, Color.PASSED, lit=False, colors=colors)
    counts = 2 * TUBE_SIDES * np.arange(len(tools))
    return [body], [KeyframeTrack("tool/trace", "faces", frames.times, _from_first(counts))]


def _robot_tracks(robot: Robot, frames: KeyFrames) -> list[KeyframeTrack]:
    """Base, joints, and the colour of the tool."""
    up = np.array([0.0, 0.0, 1.0])
    spots = np.column_stack([frames.base[:, :2], np.zeros(len(frames.base))])
    tracks = [
        KeyframeTrack("robot", "position", frames.times, spots),
        KeyframeTrack("robot", "turn", frames.times, turn_quaternions(up, frames.base[:, 2])),
    ]
    for k, joint in enumerate(robot.chain.joints):
        values = frames.joints[:, k]
        if joint.kind == "revolute":
            turns = turn_quaternions(joint.axis, values)
            tracks.append(KeyframeTrack(joint_node(k), "turn", frames.times, turns))
        else:
            tracks.append(
                KeyframeTrack(joint_node(k), "position", frames.times, np.outer(values, joint.axis))
            )
    tip = f"{joint_node(robot.chain.dof - 1)}/{TOOL}"
    # A frame says how the motion to it went: the tool is lifted from the frame before.
    ahead = np.append(frames.lifted[1:], frames.lifted[-1:])
    colors = np.where(ahead[:, None], _rgb(Color.LIFTED), _rgb(Color.PASSED))
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
