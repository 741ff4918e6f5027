"""A simulated run as a table, and as a bag for Foxglove and RViz."""

from __future__ import annotations

import numpy as np

from regionik.output.ros2 import PATH, Event, bag_files, motion_events, nanoseconds, path_message
from regionik.simulation.run import SimulatedRun
from regionik.storage.files import csv_text
from regionik.timing.trajectory import TrajectorySample

_BASE = ("base_x", "base_y", "base_yaw")


def run_to_csv(run: SimulatedRun) -> str:
    """CSV text of a run, one row each hundredth of a second.

    Columns: ``time``, the base and the joints as they were, the base as it was taken to be (``estimated_x``
    and so on), the tool, its speed, its distance from where the plan has it (``tool_error``), and
    ``on_path``, 1 where it is on its path. Metres, radians, seconds.
    """
    joints = run.plan.world.robot.chain.names
    header = ["time", *_BASE, *joints, "estimated_x", "estimated_y", "estimated_yaw"]
    header += ["tool_x", "tool_y", "tool_z", "tool_speed", "tool_error", "on_path"]
    numbers = np.column_stack(
        [np.round(run.time, 9), run.base, run.joints, run.estimate, run.tool, run.tool_speed, run.tool_error]
    )
    rows = zip(numbers.tolist(), run.reference.on_path.tolist(), strict=True)
    return csv_text([header, *([*row, int(on_path)] for row, on_path in rows)])


def run_to_mcap(run: SimulatedRun) -> bytes:
    """MCAP of a run: /tf and /joint_states as they were, /planned_path, /tool_error, /contacts."""
    world, frame = run.plan.world, run.plan.world.frames.map
    base_rate, joint_rate = run.velocity[:, :3], run.velocity[:, 3:]
    unknown = np.full_like(base_rate, np.nan), np.full_like(joint_rate, np.nan)
    sample = TrajectorySample(run.time, run.base, run.joints, base_rate, joint_rate, *unknown)
    errors = zip(nanoseconds(run.time).tolist(), run.tool_error.tolist(), strict=True)
    events = [
        Event(0, "/planned_path", PATH, path_message(run.plan, frame=frame)),
        *(Event(time, "/tool_error", "std_msgs/msg/Float64", {"data": error}) for time, error in errors),
        *motion_events(world, sample, frame),
    ]
    for contact in run.contacts:
        moment = int(nanoseconds(np.array([contact.time]))[0])
        events.append(Event(moment, "/contacts", "std_msgs/msg/String", {"data": contact.text}))
    return bag_files(events)["bag.mcap"]
