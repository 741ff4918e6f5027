"""A simulated run as a table."""

from __future__ import annotations

import csv
import io

import numpy as np

from regionik.simulation.run import SimulatedRun

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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row, on_path in zip(numbers.tolist(), run.reference.on_path.tolist(), strict=True):
        writer.writerow([*row, int(on_path)])
    return text.getvalue()
