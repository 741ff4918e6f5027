"""The picture of a plan: the world, the areas of all set-points, and the whole motion."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from regionik.values import Plan
from regionik.view import triangle_meshes
from regionik.view.animation import Frames, Track, key_frames, turning
from regionik.view.camera import camera_for
from regionik.view.picture import (
    AHEAD,
    BASE_PATH,
    CURRENT,
    HEADING,
    LIFTED,
    NAVIGABLE,
    PALE,
    PASSED,
    REJECTION,
    SOLID,
    STRONG,
    Body,
    Picture,
)
from regionik.view.world_picture import (
    BALL,
    DETAIL,
    TOOL,
    counted,
    extent,
    joint_path,
    layer,
    robot_bodies,
    world_bodies,
)
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot


def picture_of_plan(plan: Plan) -> Picture:
    """All that there is to see of a plan."""
    world, frames = plan.world, key_frames(plan)
    robot, poses = robot_bodies(world.robot, frames.base[0], frames.joints[0])
    covered = shapely.union_all([area.admissible for area in plan.areas]).simplify(DETAIL)
    areas, area_tracks = _areas(plan, frames, covered)
    marks, mark_tracks = _passed(plan, frames)
    trace, trace_tracks = _trace(plan, frames)
    tracks = [*_robot_tracks(world.robot, frames), *area_tracks, *mark_tracks, *trace_tracks]
    tools = world.robot.tool(plan.motion.base, plan.motion.joints)[:, :2, 3]
    camera = camera_for(world, np.vstack([world.robot.drive.trace(plan.motion.base), tools]))
    return Picture(
        title=world.name,
        facts=(counted(len(plan.setpoints), "set-point"), counted(plan.lift_offs, "lift-off")),
        legend=(*_legend(frames), *(((HEADING, "circles to park in"),) if plan.stops else ())),
        bodies=(*world_bodies(world, covered), *areas, *_parking(plan), *robot, *marks, *trace),
        poses=poses,
        camera=camera,
        extent=extent(world, camera),
        tracks=tuple(_until(track, frames.duration) for track in tracks) if len(frames.times) > 1 else (),
    )


def _legend(frames: Frames) -> tuple[tuple[int, str], ...]:
    lifted = ((LIFTED, "tool lifted"),) if frames.lifted.any() else ()
    return (
        (CURRENT, "area of the next set-point"),
        (STRONG, "areas for the whole path"),
        (PALE, "admissible, but a dead end"),
        (NAVIGABLE, "free floor"),
        (REJECTION, "rejected: too close to a solid"),
        (SOLID, "obstacles"),
        (BASE_PATH, "path of the base"),
        (AHEAD, "set-points ahead"),
        (PASSED, "set-points passed, path of the tool"),
        *lifted,
    )


def _areas(plan: Plan, frames: Frames, covered: BaseGeometry) -> tuple[list[Body], list[Track]]:
    """Pale and strong unions, the area of the next set-point, and the base's path over them."""
    pruned = [area.pruned for area in plan.areas]
    strong = shapely.union_all(pruned).simplify(DETAIL)
    pale = covered - strong
    single = [triangle_meshes.flat(area.simplify(DETAIL)) for area in pruned]
    track = plan.world.robot.drive.trace(plan.motion.base)
    path = LineString(np.vstack([track, track[-1:]]))
    bodies = [
        layer("areas/pale", pale, PALE, 0.8, 3),
        layer("areas/strong", strong, STRONG, 0.62, 4),
        Body("areas/next", triangle_meshes.merged(single), CURRENT, 0.55, 5, lit=False),
        layer("areas/base path", path.buffer(0.007), BASE_PATH, 0.95, 6),
    ]
    if not single:
        return bodies, []
    count = np.array([len(part.faces) for part in single])
    # Set-point k is the next one from the moment at which k - 1 is passed.
    since = np.concatenate([[0.0], frames.passed[:-1]])
    faces = np.column_stack([np.cumsum(count) - count, count])
    return bodies, [Track("areas/next", "faces", since, faces)]


def _parking(plan: Plan) -> list[Body]:
    """The circles in which the base may park at its stops."""
    circles = [Point(stop.base[:2]).buffer(stop.tolerance) for stop in plan.stops]
    return [layer("areas/parking", shapely.multipolygons(circles), HEADING, 0.9, 7)] if circles else []


def _passed(plan: Plan, frames: Frames) -> tuple[list[Body], list[Track]]:
    """Green marks a little larger than those ahead, which they swallow one by one."""
    marks = triangle_meshes.balls(np.array([t.position for t in plan.world.task]), 1.15 * BALL)
    times = np.concatenate([[0.0], frames.passed])
    counts = len(marks.faces) // len(plan.world.task) * np.arange(len(times))
    track = Track("task/passed", "faces", times, _from_first(counts))
    return [Body("task/passed", marks, PASSED)], [track]


def _trace(plan: Plan, frames: Frames) -> tuple[list[Body], list[Track]]:
    """The way the tool has come, green on the path and violet where it is lifted."""
    if len(frames.times) < 2:
        return [], []
    tools = plan.world.robot.tool(frames.base, frames.joints)[:, :3, 3]
    tubes = triangle_meshes.tubes(tools, 0.006)
    lifted = np.repeat(frames.lifted[1:], 2 * triangle_meshes.TUBE_SIDES)
    colors = np.where(lifted[:, None], _rgb(LIFTED), _rgb(PASSED))
    body = Body("tool/trace", tubes, PASSED, lit=False, colors=colors)
    counts = 2 * triangle_meshes.TUBE_SIDES * np.arange(len(tools))
    return [body], [Track("tool/trace", "faces", frames.times, _from_first(counts))]


def _robot_tracks(robot: Robot, frames: Frames) -> list[Track]:
    """Base, joints, and the colour of the tool."""
    up = np.array([0.0, 0.0, 1.0])
    spots = np.column_stack([frames.base[:, :2], np.zeros(len(frames.base))])
    tracks = [
        Track("robot", "position", frames.times, spots),
        Track("robot", "turn", frames.times, turning(up, frames.base[:, 2])),
    ]
    for k, joint in enumerate(robot.chain.joints):
        values = frames.joints[:, k]
        if joint.kind == "revolute":
            turns = turning(joint.axis, values)
            tracks.append(Track(joint_path(k), "turn", frames.times, turns))
        else:
            tracks.append(Track(joint_path(k), "position", frames.times, np.outer(values, joint.axis)))
    tip = f"{joint_path(robot.chain.dof - 1)}/{TOOL}"
    # A frame knows how the motion arrived at it: the tool is lifted from the frame before.
    ahead = np.append(frames.lifted[1:], frames.lifted[-1:])
    colors = np.where(ahead[:, None], _rgb(LIFTED), _rgb(PASSED))
    tracks.append(Track(tip, "color", frames.times, colors))
    return tracks


def _until(track: Track, end: float) -> Track:
    """The same track, resting until all end together, and without keys that say nothing new."""
    times = np.append(track.times, end)
    values = np.concatenate([track.values, track.values[-1:]])
    still = (values[1:] == values[:-1]).all(axis=1)
    keep = np.ones(len(times), dtype=bool)
    keep[1:-1] = ~(still[:-1] & still[1:])
    return Track(track.path, track.kind, times[keep], values[keep])


def _from_first(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.column_stack([np.zeros_like(counts), counts])


def _rgb(color: int) -> Array:
    return np.array([color >> 16, color >> 8 & 255, color & 255]) / 255
