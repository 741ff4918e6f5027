"""A telescope on a lift, a palletizer and random chains: arms with joints that mimic others."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint, Mimic
from regionik.worlds.robot import Robot
from regionik.worlds.urdf.loader import load_robot
from tests.maths import Array, rot_z, translation

ROOMY = "-9 9"


def _link(name: str, size: str = "", x: float = 0.0) -> str:
    shape = f'<origin xyz="{x} 0 0"/><geometry><box size="{size}"/></geometry>'
    return f'<link name="{name}">{f"<collision>{shape}</collision>" if size else ""}</link>'


def _joint(name: str, ends: str, xyz: str, axis: str, limits: str, mimic: str = "") -> str:
    (parent, child), (lower, upper) = ends.split(), limits.split()
    kind = "prismatic" if name.startswith(("mast", "stage")) else "revolute"
    follows = ""
    if mimic:
        leader, multiplier, offset = mimic.split()
        follows = f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{follows}'
        f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint>'
    )


def _tip(parent: str, x: float) -> str:
    return (
        f'{_link("tip")}<joint name="end" type="fixed"><parent link="{parent}"/><child link="tip"/>'
        f'<origin xyz="{x} 0 0" rpy="0 1.5707963267948966 0"/></joint>'
    )


# A lift of two stages under a turret, the second listed first; of the telescope's stages the last copies the
# one that copies the first, and the limits of the second hold the first back.
TELESCOPE = "".join(
    [
        '<robot name="telescope">',
        _link("base", "0.5 0.4 0.3"),
        _link("mast", "0.1 0.1 0.3"),
        _link("head", "0.08 0.08 0.3"),
        _link("cab", "0.12 0.1 0.1"),
        *(
            _link(name, f"0.3 {width} {width}", 0.15)
            for name, width in (("a", 0.06), ("b", 0.05), ("c", 0.04))
        ),
        _joint("mast2", "mast head", "0 0 0.05", "0 0 1", "0 1", "mast1 0.5 0.02"),
        _joint("mast1", "base mast", "0.1 0 0.4", "0 0 1", "0 0.4"),
        _joint("turn", "head cab", "0 0 0.2", "0 0 1", "-2 2"),
        _joint("stage1", "cab a", "0.05 0 0", "1 0 0", "0 0.25"),
        _joint("stage2", "a b", "0.02 0 0", "1 0 0", "0 0.21", "stage1 2.0 0.01"),
        _joint("stage3", "b c", "0.02 0 0", "1 0 0", ROOMY, "stage2 1.5 0.0"),
        _tip("c", 0.35),
        "</robot>",
    ]
)
# The hand keeps its slope to the upper arm, whatever the elbow does.
PALLETIZER = "".join(
    [
        '<robot name="palletizer">',
        _link("base", "0.5 0.4 0.3"),
        _link("column", "0.12 0.12 0.2"),
        *(_link(name, f"0.4 {width} {width}", 0.2) for name, width in (("upper", 0.06), ("fore", 0.05))),
        _link("hand", "0.1 0.05 0.05", 0.05),
        _joint("turn", "base column", "0 0 0.4", "0 0 1", "-2.9 2.9"),
        _joint("raise", "column upper", "0.05 0 0.1", "0 1 0", "-1.9 0.6"),
        _joint("bend", "upper fore", "0.4 0 0", "0 1 0", "0.1 2.4"),
        _joint("level", "fore hand", "0.4 0 0", "0 1 0", ROOMY, "bend -1 0.3"),
        _tip("hand", 0.12),
        "</robot>",
    ]
)
TEXTS = {"telescope": TELESCOPE, "palletizer": PALLETIZER}
ARMS = tuple(TEXTS)


def loaded(text: str, **more: Any) -> Robot:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(text)
        return load_robot(path, **{"tip": "tip", **more})


@cache
def arm(name: str) -> Robot:
    return loaded(TEXTS[name])


def postures(chain: Chain, count: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, chain.dof))


def expanded(name: str, q: Array) -> Array:
    """Values of all joints, by hand."""
    if name == "palletizer":
        return np.array([q[0], q[1], q[2], 0.3 - q[2]])
    stage2 = 2 * q[2] + 0.01
    return np.array([q[0], 0.5 * q[0] + 0.02, q[1], q[2], stage2, 1.5 * stage2])


def random_chain(seed: int, *, slides: bool = True) -> Chain:
    """Two pairs of joints and one alone; followers before and behind what they follow, by shares up to 3."""
    rng = np.random.default_rng(seed)
    joints = [Joint("pivot", "revolute", -2.0, 2.0, np.eye(4))]
    mimics = {"a": None, "c": Mimic("b", rng.uniform(-3, 3), 0.1), "b": None}
    mimics["d"] = Mimic("a", rng.uniform(-3, 3), rng.uniform(-0.2, 0.2))
    for name, mimic in mimics.items():
        axis, sliding = rng.normal(size=3), slides and rng.random() < 0.4
        T = translation(*rng.uniform(-0.3, 0.3, 3)) @ rot_z(rng.uniform(-3, 3))
        low, high = (-0.1, 0.15) if sliding else (-1.0, 1.2)
        joints.append(Joint(name, "prismatic" if sliding else "revolute", low, high, T, axis, mimic=mimic))
    return Chain(tuple(joints), translation(*rng.uniform(-0.3, 0.3, 3)))


def plain(chain: Chain) -> Chain:
    """The same joints, each moving by itself."""
    return Chain(tuple(replace(joint, mimic=None) for joint in chain.joints), chain.T_last_tool)
