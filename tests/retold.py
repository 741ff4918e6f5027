"""Robots as the second opinion is told of them."""

from __future__ import annotations

from regionik.output.urdf import robot_to_urdf
from regionik.worlds.links import LinkHull
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World
from tests.opinion.machine import Facts, Machine


def facts_of(robot: Robot) -> Facts:
    """What the second opinion is told besides the URDF."""
    unchecked = frozenset(frozenset(pair) for pair in robot.unchecked)
    loads = tuple((one.link, one.mass, tuple(one.center.tolist())) for one in robot.loads)
    shape = (robot.base, robot.footprint, robot.body_height, robot.turning_radius)
    hulls = {solid.name: solid.corners for solid in robot.all_solids if isinstance(solid, LinkHull)}
    return Facts(*shape, unchecked, robot.gauge, loads, hulls)


def machine_of(world: World) -> Machine:
    """The robot of a world as the second opinion sees it."""
    return Machine(robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
