"""What stops print holds: `reach` confirms it from there, `plan` plans it, the second opinion agrees."""

from __future__ import annotations

import pytest

from tests import MINUTES
from tests.doors import Doors
from tests.furnished import BODIES, furnished_world

DAILY, FEW = (1, 3), 7
FOUND = 793  # a circle to park in, on whose rim only a posture of another kind is at the limits
REST = [seed for seed in range(30) if seed not in DAILY]  # `.ci/run` and `make soak` go through others


@pytest.mark.parametrize(
    "seed",
    [
        *DAILY,
        pytest.param(FOUND, marks=pytest.mark.slow),
        *(pytest.param(seed, marks=pytest.mark.slow if seed < FEW else MINUTES) for seed in REST),
    ],
)
def test_every_door_says_the_same_of_stops(seed: int) -> None:
    doors = Doors(furnished_world(seed))
    doors.stops()
    assert not doors.wrong


def test_rooms_are_of_all_sorts() -> None:
    worlds = [furnished_world(seed) for seed in range(40)]
    names = {solid.name.split()[0] for world in worlds for solid in world.solids}
    assert {"table", "board", "column"} <= names
    assert {world.robot.name for world in worlds} >= set(BODIES) - {"plain"}
    over = [
        world
        for world in worlds
        for one in world.solids
        if one.name.startswith("table") and world.robot.body_height < one.z_range[0] < world.robot.mount[2]
    ]
    assert len(over) > 10  # the base drives under the top, and what stands on it does not
    assert {world.rules.order for world in worlds} == {"given", "any"}
