"""Exact base areas and whole-path planning for mobile manipulators.

>>> import regionik as rik
>>> world = rik.load_world("free")
>>> len(world.task)
21

The names below are looked up when they are first used, so that ``import regionik`` itself stays light.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from regionik.area_verification import verify_areas
    from regionik.live_solver import LiveSolver
    from regionik.mfabrik import Solver
    from regionik.output.export import export, write_field
    from regionik.output.plan_file import load_plan, save_plan
    from regionik.papers.by_hand import avoiding_fabrik, base_steps
    from regionik.papers.comparison import compare
    from regionik.papers.polynomial import polynomial
    from regionik.parking.replanning import replan_stop
    from regionik.parking.stops import stops
    from regionik.pipeline import plan, why
    from regionik.reachability.field import reach_field, reach_slice
    from regionik.reachability.reach import reach
    from regionik.regions import admissible_area
    from regionik.simulation.noise import Noise
    from regionik.simulation.simulate import simulate
    from regionik.timing.point_to_point import point_to_point
    from regionik.timing.retime import retime
    from regionik.timing.trajectory import trajectory
    from regionik.values import Plan
    from regionik.verification.verifier import verify, verify_answers
    from regionik.view.figures import plot, plot_floor
    from regionik.view.page import to_html
    from regionik.view.viewer import show
    from regionik.worlds.chain import Chain
    from regionik.worlds.documents.world_file import load_world
    from regionik.worlds.errors import InputError, NoPlanFound, RegionikError
    from regionik.worlds.joints import Joint
    from regionik.worlds.limits import Criteria, Execution, ParkingAccuracy, Speeds
    from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull
    from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
    from regionik.worlds.robot import Robot, Tool
    from regionik.worlds.scene import Floor, Rules, Start, Target, World
    from regionik.worlds.urdf.loader import load_robot
    from regionik.worlds.zones import Zone

__version__ = "0.1.0"

__all__ = [
    "Box", "Chain", "Criteria", "Cylinder", "Execution", "Floor", "InputError", "Joint", "LinkBox",
    "LinkCapsule", "LinkHull", "LiveSolver", "Mesh", "NoPlanFound", "Noise", "ParkingAccuracy", "Plan",
    "Prism", "RegionikError", "Robot", "Rules", "Solver", "Speeds", "Sphere", "Start", "Target", "Tool",
    "World", "Zone", "admissible_area", "avoiding_fabrik", "base_steps", "compare", "export",
    "load_plan", "load_robot", "load_world", "plan", "plot", "plot_floor", "point_to_point",
    "polynomial", "reach", "reach_field", "reach_slice", "replan_stop", "retime", "save_plan", "show",
    "simulate", "stops", "to_html", "trajectory", "verify", "verify_answers", "verify_areas", "why",
    "write_field",
]  # fmt: skip

_HOME = {
    name: f"regionik.{module}"
    for module, names in {
        "area_verification": "verify_areas",
        "papers.by_hand": "avoiding_fabrik base_steps",
        "papers.comparison": "compare",
        "papers.polynomial": "polynomial",
        "live_solver": "LiveSolver",
        "mfabrik": "Solver",
        "output.export": "export write_field",
        "output.plan_file": "load_plan save_plan",
        "parking.replanning": "replan_stop",
        "parking.stops": "stops",
        "pipeline": "plan why",
        "reachability.field": "reach_field reach_slice",
        "reachability.reach": "reach",
        "regions": "admissible_area",
        "simulation.noise": "Noise",
        "simulation.simulate": "simulate",
        "timing.point_to_point": "point_to_point",
        "timing.retime": "retime",
        "timing.trajectory": "trajectory",
        "values": "Plan",
        "verification.verifier": "verify verify_answers",
        "view.figures": "plot plot_floor",
        "view.page": "to_html",
        "view.viewer": "show",
        "worlds.chain": "Chain",
        "worlds.documents.world_file": "load_world",
        "worlds.errors": "InputError NoPlanFound RegionikError",
        "worlds.limits": "Criteria Execution ParkingAccuracy Speeds",
        "worlds.joints": "Joint",
        "worlds.links": "LinkBox LinkCapsule LinkHull",
        "worlds.obstacles": "Box Cylinder Mesh Prism Sphere",
        "worlds.robot": "Robot Tool",
        "worlds.scene": "Floor Rules Start Target World",
        "worlds.zones": "Zone",
        "worlds.urdf.loader": "load_robot",
    }.items()
    for name in names.split()
}
_SHOWN = (
    ("values", "Answer"),
    ("regions", "Area"),
    ("worlds.errors", "Explanation"),
    ("reachability.field", "Field"),
    ("values", "Plan"),
    ("values", "Stops"),
    ("worlds.scene", "World"),
)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'regionik' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def _show_in_notebooks() -> None:
    """Let a notebook that imports regionik show values as pictures and lines."""
    shell = sys.modules["IPython"].get_ipython()
    if shell is not None:
        html = shell.display_formatter.formatters["text/html"]
        for module, name in _SHOWN:
            html.for_type_by_name(f"regionik.{module}", name, _as_html)


def _as_html(value: Any) -> str:
    from regionik.view.page import as_html

    return as_html(value)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


if "IPython" in sys.modules:
    _show_in_notebooks()
