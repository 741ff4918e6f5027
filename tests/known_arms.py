"""Arms that people own, by the rows of their makers and of the literature, on an omnidirectional base."""

from __future__ import annotations

from functools import cache

import numpy as np

from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from regionik.worlds.links import capsules_along
from regionik.worlds.robot import Robot
from tests.maths import rot_x, rot_y, rot_z, translation

H = np.pi / 2

# theta, d, a, alpha, lower, upper; Denavit and Hartenberg's standard rows
DH: dict[str, list[tuple[float, ...]]] = {
    "Puma 560": [
        (0, 0.67, 0, H, -2.79, 2.79), (0, 0, 0.4318, 0, -1.92, 1.92), (0, 0.15005, 0.0203, -H, -2.36, 2.36),
        (0, 0.4318, 0, H, -4.64, 4.64), (0, 0, 0, -H, -1.74, 1.74), (0, 0.1, 0, 0, -4.64, 4.64),
    ],
    "UR5": [
        (0, 0.089159, 0, H, -6.28, 6.28), (0, 0, -0.425, 0, -6.28, 6.28), (0, 0, -0.39225, 0, -3.14, 3.14),
        (0, 0.10915, 0, H, -6.28, 6.28), (0, 0.09465, 0, -H, -6.28, 6.28), (0, 0.0823, 0, 0, -6.28, 6.28),
    ],
    "KR 16": [
        (0, 0.675, 0.26, -H, -3.23, 3.23), (0, 0, 0.68, 0, -2.7, 0.61), (-H, 0, 0.035, H, -2.27, 2.69),
        (0, -0.67, 0, -H, -6.1, 6.1), (0, 0, 0, H, -2.27, 2.27), (0, -0.158, 0, 2 * H, -6.1, 6.1),
    ],
    "LBR iiwa": [
        (0, 0.34, 0, -H, -2.97, 2.97), (0, 0, 0, H, -2.09, 2.09), (0, 0.4, 0, H, -2.97, 2.97),
        (0, 0, 0, -H, -2.09, 2.09), (0, 0.4, 0, -H, -2.97, 2.97), (0, 0, 0, H, -2.09, 2.09),
        (0, 0.126, 0, 0, -3.05, 3.05),
    ],
}  # fmt: skip

# alpha, a, d, lower, upper; Craig's rows, and from the last joint to the tool [m]
CRAIG: dict[str, tuple[list[tuple[float, ...]], float]] = {
    "Panda": (
        [
            (0, 0, 0.333, -2.8973, 2.8973), (-H, 0, 0, -1.7628, 1.7628), (H, 0, 0.316, -2.8973, 2.8973),
            (H, 0.0825, 0, -3.0718, -0.0698), (-H, -0.0825, 0.384, -2.9, 2.9), (H, 0, 0, -0.0175, 3.75),
            (H, 0.088, 0, -2.8973, 2.8973),
        ],
        0.107,
    ),
    "xArm7": (
        [
            (0, 0, 0.267, -6.28, 6.28), (-H, 0, 0, -2.059, 2.0944), (H, 0, 0.293, -6.28, 6.28),
            (H, 0.0525, 0, -0.19198, 3.927), (H, 0.0775, 0.3425, -6.28, 6.28), (H, 0, 0, -1.69297, 3.14159),
            (-H, 0.076, 0, -6.28, 6.28),
        ],
        0.097,
    ),
}  # fmt: skip

# x, y, z, roll, pitch, yaw, lower, upper; the origins of the joints of its URDF file, the first one a lift
TIAGO = (
    (0.0, 0.0, 0.597, 0, 0, 0, 0.0, 0.35),
    (0.15505, 0.014, -0.151, 0, 0, -H, 0.0, 2.749),
    (0.125, 0.0165, -0.031, H, 0, 0, -H, 1.0908),
    (0.0895, 0.0, 0.0015, -H, 0, H, -3.5343, H),
    (-0.02, -0.027, -0.222, -H, -H, 0, -0.3927, 2.3562),
    (-0.162, 0.02, 0.027, 0, -H, 0, -2.0944, 2.0944),
    (0.0, 0.0, 0.15, 0, -H, -H, -1.4137, 1.4137),
    (0.0, 0.0, 0.0, H, 0, H, -2.0944, 2.0944),
)

NAMES = (*DH, *CRAIG, "TIAGo")


@cache
def known_robot(name: str) -> Robot:
    """Return one of `NAMES` on a point base."""
    chain = _chain(name)
    return Robot(name, "omni", np.zeros((1, 2)), np.zeros(4), chain, capsules_along(chain, 0.03))


def _chain(name: str) -> Chain:
    if name in DH:
        return Chain.from_dh(DH[name])
    if name in CRAIG:
        rows, tool = CRAIG[name]
        frames = [rot_x(alpha) @ translation(a, 0, d) for alpha, a, d, *_ in rows]
        limits = [row[-2:] for row in rows]
    else:
        tool, limits = 0.046, [row[-2:] for row in TIAGO]
        frames = [
            translation(x, y, z) @ rot_z(yaw) @ rot_y(pitch) @ rot_x(roll)
            for x, y, z, roll, pitch, yaw, *_ in TIAGO
        ]
    joints = tuple(
        Joint(
            f"joint_{k + 1}", "prismatic" if name == "TIAGo" and k == 0 else "revolute", lower, upper, T,
            np.array([0.0, 0.0, 1.0]),
        )
        for k, (T, (lower, upper)) in enumerate(zip(frames, limits, strict=True))
    )  # fmt: skip
    return Chain(joints, translation(0, 0, tool))
