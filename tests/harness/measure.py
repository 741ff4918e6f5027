"""Figures of what one tree makes of worlds: ``python measure.py FOLDER LONGEST NAME ...``.

It stands alone and uses public names only, so that it runs on older trees: whoever calls it puts the tree on
the path. For each world file of the folder it prints a line of JSON. A world that takes longer than so many
processor seconds ends the process.
"""

from __future__ import annotations

import hashlib
import json
import signal
import sys
import time
import warnings
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

import regionik as rik

AT_SPEED = 0.95  # of a limit, from where on the robot is said to go at full speed
COLUMNS = "base", "joints", "kind", "setpoint"  # of the motion, which its digest is of
Figures = dict[str, Any]


def measured(path: Path) -> Figures:
    """Return what is planned for a world file and what it cost."""
    began = time.process_time()
    with _counted() as tries:
        try:
            found = rik.plan(rik.load_world(path))
        except rik.NoPlanFound as no:
            row = {"verdict": no.explanation.verdict, "digest": _digest(no.explanation.reason.encode())}
            return row | _work(began, tries)
        except rik.InputError as refused:
            said = str(refused).replace(str(path), "")
            return {"verdict": "refused", "digest": _digest(said.encode())} | _work(began, tries)
        work = _work(began, tries)
    began = time.process_time()
    report = rik.verify(found)
    checked = {"verified": report.ok, "margins": report.margins, "cpu_verify": _since(began)}
    return {"verdict": "planned"} | _figures(found) | _timing(found) | work | checked | _file(found, path)


def _counted() -> Any:
    """Return what counts tries of searches, on trees that count them."""
    try:
        from regionik.planners.tries import counted
    except ImportError:
        return nullcontext()
    return counted()


def _work(began: float, tries: Any) -> Figures:
    return {"cpu": _since(began), "tries": getattr(tries, "made", None)}


def _since(began: float) -> float:
    return round(time.process_time() - began, 3)


def _figures(found: rik.Plan) -> Figures:
    """Return how far base and arm travel, and how often the tool is lifted and the base parked."""
    motion, stops = found.motion, found.stats.get("stops", {})
    way, turn, bend = _steps(motion)
    return {
        "skipped": len(found.skipped),
        "lift_offs": found.lift_offs,
        "stops": len(found.stops),
        "stops_bound": stops.get("lower_bound", 0),
        "states": len(motion),
        "base_way": float(way.sum()),
        "turning": float(turn.sum()),
        "arm_travel": float(bend.sum()),
    }


def _steps(motion: Any) -> tuple[Any, Any, Any]:
    """Return way [m], turn [rad] and change of each joint from state to state."""
    way = np.linalg.norm(np.diff(motion.base[:, :2], axis=0), axis=1)
    turn = np.abs(np.remainder(np.diff(motion.base[:, 2]) + np.pi, 2 * np.pi) - np.pi)
    return way, turn, np.abs(np.diff(motion.joints, axis=0))


def _timing(found: rik.Plan) -> Figures:
    """Return duration, and the share of it at full speed, by the world's speeds or by the usual ones."""
    began = time.process_time()
    try:
        timed = found if np.isfinite(found.motion.time).all() else rik.retime(found)
    except rik.InputError as refused:
        return {"duration": None, "at_speed": None, "not_timed": str(refused)}
    speeds, motion = timed.world.speeds or rik.Speeds(), timed.motion
    joints = speeds.joint_limits(timed.world.robot.chain)[0]
    way, turn, bend = _steps(motion)
    share = np.column_stack([way / speeds.base_velocity, turn / speeds.turn_velocity, bend / joints])
    took = np.diff(motion.time)
    fast = share.max(axis=1) >= AT_SPEED * took
    duration = float(motion.time[-1])
    at_speed = float(took[fast].sum()) / duration if duration else 1.0
    return {"duration": duration, "at_speed": at_speed, "cpu_timing": _since(began)}


def _file(found: rik.Plan, path: Path) -> Figures:
    """Return digests of the plan's file and of its motion, and the size of the file."""
    file = path.with_suffix(".plan.json")
    found.save(file)
    data = file.read_bytes()
    file.unlink()
    motion = b"".join(np.ascontiguousarray(getattr(found.motion, key)).tobytes() for key in COLUMNS)
    return {"digest": _digest(data), "motion": _digest(motion), "file_bytes": len(data)}


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def main() -> None:
    folder, longest = Path(sys.argv[1]), float(sys.argv[2])
    warnings.simplefilter("ignore")
    print(json.dumps({"tree": str(Path(rik.__file__).parents[1])}), flush=True)
    for name in sys.argv[3:]:
        signal.setitimer(signal.ITIMER_PROF, longest)  # the signal ends the process, in kernels too
        row = measured(folder / f"{name}.json")
        signal.setitimer(signal.ITIMER_PROF, 0)
        print(json.dumps({"name": name} | row), flush=True)


if __name__ == "__main__":
    main()
