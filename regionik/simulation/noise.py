"""Noise of an execution: late and rough localisation, slipping wheels; and the pose estimated from them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.simulation.options import SIMULATION
from regionik.worlds.arrays import Array
from regionik.worlds.chain import rot_z
from regionik.worlds.errors import InputError

OPTIONS = SIMULATION.noise


@dataclass(frozen=True)
class Noise:
    """Disturbances of an execution; without arguments there are none.

    Attributes
    ----------
    position, heading : float
        Standard deviations of the localisation, of x and y each [m] and of the heading [rad].
    rate : float
        Of the localisation [1/s].
    delay : float
        Of the localisation [s].
    slip : float
        Largest share by which the base goes farther, or less far, than its wheels say: along its heading,
        across it and in its turn, drawn evenly and anew each second.

    Examples
    --------
    >>> Noise(position=0.01, slip=0.02)
    Noise(position=0.01, heading=0.0, rate=20.0, delay=0.05, slip=0.02)
    """

    position: float = 0.0
    heading: float = 0.0
    rate: float = 20.0
    delay: float = 0.05
    slip: float = 0.0

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if not 0 <= value < np.inf or (key == "rate" and value == 0):
                expected = "above 0" if key == "rate" else "at least 0"
                raise InputError(f"noise: {key}: must be {expected}, got {value:g}")

    def __bool__(self) -> bool:
        return bool(self.position or self.heading or self.slip)

    @property
    def deviations(self) -> Array:
        """Standard deviations of a localised pose, (3,)."""
        return np.array([self.position, self.position, self.heading])

    def slips(self, duration: float, rng: np.random.Generator) -> Array:
        """Draw factors of what the base does to what its wheels say, one row a second, (n, 3)."""
        return 1.0 + self.slip * rng.uniform(-1.0, 1.0, (int(duration / OPTIONS.slip_time) + 1, 3))

    def start(self, pose: Array, rng: np.random.Generator) -> PoseEstimate:
        """Draw the estimate of a pose (3,) at which the robot has stood for a while."""
        deviation = self.deviations / np.sqrt(max(OPTIONS.localisation_time * self.rate, 1.0))
        return PoseEstimate(pose + deviation * rng.standard_normal(3), np.diag(deviation**2))


def typical_noise() -> Noise:
    """Noise of an indoor robot: 10 mm and 0.5 degrees at 20 Hz, 50 ms late, and 2 % of slip."""
    return Noise(position=0.01, heading=float(np.radians(0.5)), slip=0.02)


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """An estimated base pose: odometry, corrected by late localisation (an extended Kalman filter)."""

    pose: Array  # (3,) x, y [m], yaw [rad]
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))  # (3, 3)

    def moved(self, twist: Array, time: float, slip: float) -> PoseEstimate:
        """Return the estimate after the wheels said a twist (3,), in the base's own frame, for a time [s]."""
        step = twist_step(self.pose[2], twist, time)
        F = np.eye(3)
        F[0, 2], F[1, 2] = -step[1], step[0]
        # A draw of the slip lasts: what it adds to the error it adds bit by bit, in the same direction.
        spread = slip / np.sqrt(3) * np.abs(twist) * np.sqrt(OPTIONS.slip_time * time)
        S = rot_z(self.pose[2] + twist[2] * time / 2)[:3, :3] * spread
        return PoseEstimate(self.pose + step, F @ self.covariance @ F.T + S @ S.T)

    def corrected(self, localized: Array, then: Array, deviations: Array) -> PoseEstimate:
        """Return the estimate corrected by a localised pose (3,) of when ``then`` (3,) was estimated."""
        off = localized - then
        off[2] = wrap(off[2])
        gain = self.covariance @ np.linalg.pinv(self.covariance + np.diag(deviations**2))
        return PoseEstimate(self.pose + gain @ off, (np.eye(3) - gain) @ self.covariance)


def twist_step(yaw: float, twist: Array, time: float) -> Array:
    """Motion in the world, (3,), by a twist (3,) of the base in its own frame for a time [s]."""
    step: Array = rot_z(yaw + twist[2] * time / 2)[:3, :3] @ twist * time
    return step
