"""The table of small worlds: every kind of arm, base, floor, task and refusal, made from seeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
import shapely

from regionik.worlds.bundled import robot_named, world_names
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.limits import Criteria, Execution, Speeds
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.furnished import furnished_world
from tests.harness.jobs import (
    holes,
    inexact,
    level_robot,
    mimicking,
    mindful,
    parked,
    picks,
    poses_of_others,
    seam,
    smooth_poses,
)
from tests.harness.rasters import bent_panel, carried, raster
from tests.kinds import BaseKind
from tests.known_arms import known_robot
from tests.soaked import soaked_world
from tests.witnesses import witness

Maker = Callable[[], World]


def document_of(world: World) -> dict[str, Any]:
    """Return a world as its file has it, without the usual rules: older trees may not know all of them."""
    document, usual = world_to_document(world), asdict(Rules())
    rules = {key: value for key, value in document["rules"].items() if value != usual[key]}
    return {**document, "rules": rules}


def bundled(name: str, most: int | None = None, speeds: Speeds | None = None, **rules: Any) -> World:
    """Return a bundled world, or its first set-points, under other rules."""
    world = load_world(name)
    return replace(
        world, task=world.task[:most], rules=replace(world.rules, **rules), speeds=speeds or world.speeds
    )


def by(robot: str, base: BaseKind, name: str, **rules: Any) -> World:
    """Return a bundled world done by a bundled robot on another base, which starts anywhere."""
    rolling = replace(robot_named(robot), base=base, turning_radius=0.4 if base == "car" else 0.0)
    return replace(bundled(name, **rules), robot=rolling, start=None)


HALL = Floor(shapely.box(-1.0, -1.0, 4.0, 1.0))
SPOTS = ((0.0, 0.0, 0.3), (0.5, 0.0, 2.0), (1.0, 0.1, 0.3), (1.5, 0.0, 0.3), (6.5, 0.0, 0.3), (2.0, 0.0, 0.3))
POST = Box("post", np.array([0.4, 0.4, 0.5]), np.array([-0.6, 0.0, 0.25]))
TUBE = tuple(  # round the first set-point, too high for the base to touch
    Box(f"side {k}", np.array([0.02, 0.5, 0.4]), np.array([*way, 0.4]), k * np.pi / 2)
    for k, way in enumerate(((0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2)))
)


def hall(chosen: tuple[int, ...], obstacles: tuple[Box, ...] = (), **rules: Any) -> World:
    """Return some of `SPOTS` on a wide floor; the second is too high, the fifth off the floor."""
    task = tuple(Target(np.array(SPOTS[k])) for k in chosen)
    return World("hall", robot_named("youbot"), HALL, obstacles, task, Rules(clearance=0.05, **rules))


def blocked() -> World:
    """Return a hall whose start stands in a post."""
    world = hall((0, 2), (POST,))
    return replace(world, start=Start(np.array([-0.5, 0.0, 0.0]), world.robot.carry))


def parted() -> World:
    """Return a path through two rooms; the way from one to the other is too narrow for the base."""
    rooms = HALL.polygon - shapely.box(0.4, -0.95, 1.6, 1.0)
    far = tuple(Target(np.array([x, 0.3, 0.3])) for x in (0.0, 0.2, 1.9, 2.1))
    return replace(hall((0,)), robot=robot_named("youbot-real"), task=far, floor=Floor(rooms))


def _made() -> dict[str, Maker]:
    """Return makers by name; a name says what the world has."""
    table: dict[str, Maker] = {
        **{name: partial(bundled, name) for name in world_names() if name != "depot"},
        "depot-cut": partial(bundled, "depot", 150),
        "l_shape-stops": partial(bundled, "l_shape", mode="stops"),
        "l_shape-stops-any": partial(bundled, "l_shape", mode="stops", order="any"),
        "l_shape-tool-speed": partial(bundled, "l_shape", speeds=Speeds(tool_velocity=0.1)),
        "pillar-stops-near": partial(bundled, "pillar", mode="stops", stop_criterion="distance"),
        "shelf-stops": partial(bundled, "shelf", mode="stops", stop_criterion="clearance"),
        "pipe-stops-any": partial(bundled, "pipe", mode="stops", order="any"),
        "wall-stops": partial(bundled, "wall", mode="stops"),
        "free-fixed-heading": partial(bundled, "free", heading="fixed"),
        "pillar-facing": partial(bundled, "pillar", heading="face_target"),
        "pillar-no-lift-off": partial(bundled, "pillar", max_lift_offs=0),
        "free-differential": partial(by, "youbot-real", "differential", "free", heading="free"),
        "free-car": partial(by, "youbot-real", "car", "free", heading="free"),
        "pillar-differential": partial(by, "youbot-real", "differential", "pillar", clearance=0.05),
        "l_shape-differential": partial(by, "youbot-real", "differential", "l_shape", clearance=0.05),
        "depot-stops": partial(bundled, "depot", 60, mode="stops"),
        "free-pioneer7": partial(by, "pioneer7", "omni", "free"),
        "free-dof10": partial(by, "dof10", "differential", "free", heading="free"),
        "unreachable": partial(hall, (0, 1, 2)),
        "off-the-floor": partial(hall, (3, 4, 5), mode="stops"),
        "skipping": partial(hall, tuple(range(6)), skip_unreachable=True),
        "skipping-stops": partial(hall, tuple(range(6)), skip_unreachable=True, mode="stops", order="any"),
        "start-blocked": blocked,
        "in-a-tube": partial(hall, (0,), TUBE),
        "does-not-hold": partial(hall, (0,), TUBE, avoidance=False),
        "no-room-to-park": partial(hall, (0, 2), mode="stops", stop_tolerance=0.5),
        "two-rooms": parted,
        "picks-9": partial(picks, 9),
        "picks-15": partial(picks, 15),
        "picks-omni": partial(picks, 9, "omni", stop_criterion="clearance"),
        "holes-fixed-base": holes,
        "panda-poses": partial(poses_of_others, fixed=False),
        "panda-poses-fixed-base": partial(poses_of_others, fixed=True),
        "smooth-ur10e-stops": partial(smooth_poses, 0, "UR10e"),
        "smooth-iiwa-stops": partial(smooth_poses, 1, "LBR iiwa"),
        "seam-level": partial(seam, level_robot(), 0.5),
        "seam-telescope": partial(mimicking, "telescope"),
        "seam-palletizer": partial(mimicking, "palletizer"),
        "seam-tiago": partial(seam, known_robot("TIAGo"), 0.8),
        "seam-puma-stops": partial(seam, known_robot("Puma 560"), 0.8, mode="stops"),
        "manipulable": partial(mindful, Criteria(manipulability=0.003)),
        "joint-margin": partial(mindful, Criteria(joint_margin=0.1)),
        "effort": partial(mindful, Criteria(effort=12.0)),
        "inexact": partial(inexact, Execution(0.02, 0.03, 0.004, 0.03)),
        "parked": partial(parked, (0.01, 0.01, 0.02), 0.95),
        "raster-ur10e-longer": partial(_raster, "UR10e", "clutter", columns=15, rows=3),
        "raster-panda-car": partial(_raster, "Panda", "open", "car", 8, 1),
        "raster-too-near": _too_near,
    }
    for arm, clutter in RASTERS:
        table[f"raster-{arm.split()[-1].lower()}-{clutter}"] = partial(_raster, arm, clutter)
    for base in ("differential", "car"):
        table[f"raster-ur10e-{base}"] = partial(_raster, "UR10e", "open", base, 8, 1)
    for arm in ("UR10e", "Panda"):
        table[f"panel-{arm.lower()}"] = partial(_panel, arm)
    for kind, seeds in WITNESSES.items():
        table |= {f"witness-{kind.replace(' ', '-')}-{seed}": partial(_witness, kind, seed) for seed in seeds}
    for kind, seeds in RANDOM.items():
        table |= {f"random-{kind}-{seed}": partial(soaked_world, kind, seed) for seed in seeds}
    return table | {f"furnished-{seed}": partial(furnished_world, seed) for seed in FURNISHED}


def _raster(arm: str, clutter: Any, base: BaseKind = "omni", columns: int = 10, rows: int = 2) -> World:
    return raster(carried(arm, base), clutter, columns, rows)


def _too_near() -> World:
    """Return a raster whose first set-points are too near to the wall for the arm's last link."""
    world = _raster("UR10e", "open", columns=6, rows=1)
    first = replace(world.task[0], position=world.task[0].position + [0.0, 0.05, 0.0])
    return replace(world, task=(first, *world.task[1:]))


def _panel(arm: str) -> World:
    return bent_panel(carried(arm), 6, 2)


def _witness(kind: str, seed: int) -> World:
    return witness(kind, seed).world


RASTERS = (
    ("UR10e", "open"), ("UR10e", "clutter"), ("UR10e", "bollard"),
    ("LBR iiwa", "clutter"), ("Panda", "open"), ("Panda", "clutter"), ("Panda", "bollard"),
)  # fmt: skip
WITNESSES = {  # kinds of arms and seeds; of bases, floors and tasks they have all
    "wrists": (1, 2, 3, 4, 5),
    "offsets": (1, 2, 3, 5),
    "slides": (1, 2, 3, 4, 5),
    "tilted": (1, 2, 3, 4, 5),
    "urdf arms": (1, 2, 3, 4),
}
RANDOM = {  # kinds of `tests.soaked` and seeds
    "floor": (1, 2, 4, 6, 7),
    "overhead": (2, 4, 6, 7),
    "made": (2, 4),
    "wheels": (2, 3),
    "urdf": (2,),
    "stops": (1, 2, 3, 6, 7),
    "ground": (1, 2, 6, 7),
}
FURNISHED = (1, 2, 3, 5)
WORLDS = _made()
SHORT = (
    "free", "door", "pillar", "shelf", "l_shape-stops-any", "pillar-differential", "raster-ur10e-clutter",
    "raster-ur10e-car", "panda-poses", "witness-slides-3", "witness-tilted-5", "random-stops-2",
    "furnished-3", "unreachable", "skipping-stops",
)  # fmt: skip
