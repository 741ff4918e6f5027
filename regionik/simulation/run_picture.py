"""The picture of a simulated run: the robot as it moved, over the areas and the tool path of its plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from regionik.simulation.options import SIMULATION
from regionik.simulation.run import SimulatedRun
from regionik.values import Motion, Plan
from regionik.view.picture import Color, Picture, SceneMesh
from regionik.view.plan_picture import picture_of_plan
from regionik.view.triangle_meshes import tubes

OPTIONS = SIMULATION.run

_PATH_RADIUS = 0.003  # radius of the planned tool path [m]


def picture_of_run(run: SimulatedRun) -> Picture:
    """Return the picture of a run, animated, with the tool path that was planned beside the one made."""
    rows = len(run.time)
    frames = np.unique(np.linspace(0, rows - 1, min(rows, OPTIONS.max_frames)).astype(int))
    figures, moving = run.figures, picture_of_plan(_as_plan(run, frames), run.time[frames])
    error = {key: 1000 * value for key, value in figures["tool_error"].items()}
    facts = (
        f"simulated, {figures['duration']:.1f} s",
        f"tool error: 95 % below {error['p95']:.2f} mm, worst {error['worst']:.2f} mm",
        *([run.failure] if run.failure else []),
    )
    planned = tubes(run.reference.T_tool[frames, :3, 3], _PATH_RADIUS)
    shown = SceneMesh("tool/planned", planned, Color.AHEAD, lit=False, label="path of the tool as planned")
    assert moving.timeline is not None
    return replace(
        moving,
        facts=(*moving.facts[:-1], *facts),  # the last one says that states have no times
        bodies=(*moving.bodies, shown),
        timeline=replace(moving.timeline, timed=True),
    )


def _as_plan(run: SimulatedRun, frames: NDArray[np.intp]) -> Plan:
    """The plan with the motion that was made; each set-point is the frame nearest to its time."""
    plan = run.plan
    kind = np.where(run.reference.on_path[frames], "step", "transit").astype("<U8")
    setpoint = run.reference.setpoint[frames].copy()
    states = np.flatnonzero(plan.motion.kind == "setpoint")
    at = np.searchsorted(run.time[frames], plan.motion.time[states]).clip(0, len(frames) - 1)
    kind[at], setpoint[at] = "setpoint", plan.motion.setpoint[states]
    times = np.full(len(frames), np.nan)  # between its states a run goes as it was recorded
    motion = Motion(run.base[frames], run.joints[frames], kind, setpoint, times)
    return replace(plan, motion=motion)
