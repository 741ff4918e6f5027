"""What the links of an arm weigh, as far as standing still asks: masses and their centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

GRAVITY = 9.80665  # standard gravity [m/s2]


@dataclass(frozen=True, eq=False)
class LinkMass:
    """A mass that moves with one arm link.

    Attributes
    ----------
    link : int
        Index into ``Chain.frames``: the link that joint ``link`` moves.
    mass : float
        [kg]
    center : (3,) array
        Centre of mass in the link's frame [m].
    """

    link: int
    mass: float
    center: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (3,), "mass: center"))
        if not 0 < self.mass < np.inf:
            raise InputError(f"mass: expected a finite number above 0, got {self.mass}")
