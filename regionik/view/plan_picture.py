"""The picture of a plan: the world, the areas of all set-points, and the whole motion."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from regionik.values import Plan
from regionik.view.animation import KeyFrames, key_frames, turn_quaternions
from regionik.view.camera import camera_for
from regionik.view.floor_plan import parking_circles
from regionik.view.picture import Color, KeyframeTrack, Picture, SceneMesh, count_noun
from regionik.view.triangle_meshes import TUBE_SIDES, merge, spheres, triangulate, tubes
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
    single = [triangulate(area.simplify(DETAIL)) for area in pruned]
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
