"""Rejection by what lifts carry: torsos and heads that turn with the base, at heights that a target allows.

A lift that brings the tool to a target stands somewhere in a range (`regionik.worlds.body.lift_for`). Inner
areas keep all of that range clear, outer ones are cut by what is taken at each height of it.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY, ground_of
from regionik.areas.layers import GUARD, BodyLayer, all_taken, layers_of
from regionik.planners.driving.heading_slabs import ConvexScene, free_at_all, free_at_some, outline_scene
from regionik.worlds.body import lift_for, lift_range, lifted_prisms
from regionik.worlds.scene import World

STEP = 0.05  # to which ranges of lifts are widened, so that heights share their rejection [m]


def lifts_matter(world: World) -> bool:
    """Return True where what lifts carry may reject some place of the base."""
    return bool(_layers(world, lift_range(world.robot), inner=True))


def lifted_rejection(
    world: World, height: float, span: tuple[float, float] = EVERY, *, inner: bool
) -> BaseGeometry:
    """Return the places of the arm axis that are rejected for a tool at a height, at headings of a span.

    With ``inner`` those from which a lift may bring its load too near to something, else those from which
    each lift does.
    """
    lift = _allowed(world, height)
    return Polygon() if lift is None else _rejection(world, lift, span, inner=inner)


def lifted_rejections(world: World, height: float) -> list[tuple[str, str, BaseGeometry]]:
    """Return what `lifted_rejection` is made of at every heading: solid, part of the robot, and places."""
    lift = _allowed(world, height)
    layers = () if lift is None else _layers(world, lift, inner=True)
    return [
        (name, layer.part, taken)
        for layer in layers
        for name, taken in zip(layer.names, layer.taken(inner=True), strict=True)
    ]


def _allowed(world: World, height: float) -> tuple[float, float] | None:
    """How far lifts may raise the arm for a tool at a height, widened by steps; None where none brings it."""
    lift = lift_for(world.robot, height, world.rules.tolerance)
    if lift is None:
        return None
    low, high = lift_range(world.robot)
    return max(low, STEP * math.floor(lift[0] / STEP)), min(high, STEP * math.ceil(lift[1] / STEP))


@lru_cache(maxsize=256)
def _rejection(
    world: World, lift: tuple[float, float], span: tuple[float, float], *, inner: bool
) -> BaseGeometry:
    if span == EVERY:
        return shapely.union_all(all_taken(_layers(world, lift, inner=inner), inner=inner))
    free = free_at_all if inner else free_at_some
    scenes = _scenes(world, lift, inner=inner)
    return shapely.union_all([scene.floor.envelope - free(scene, *span) for scene in scenes])


@lru_cache(maxsize=64)
def _scenes(world: World, lift: tuple[float, float], *, inner: bool) -> list[ConvexScene]:
    outlines = [
        layer.moved(np.zeros(2), GUARD if inner else 0.0) for layer in _layers(world, lift, inner=inner)
    ]
    return [outline_scene(outline, world.floor.polygon) for outline in outlines]


@lru_cache(maxsize=64)
def _layers(world: World, lift: tuple[float, float], *, inner: bool) -> tuple[BodyLayer, ...]:
    prisms = lifted_prisms(world.robot, lift, inside=not inner)
    return layers_of(world, prisms, ground_of(world).base, inside=not inner) if prisms else ()
