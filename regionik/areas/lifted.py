"""Rejection by what lifts carry: torsos and heads that turn with the base, at heights that a target allows.

A lift that brings the tool to a target stands somewhere in a range (`regionik.worlds.body.lift_for`). Inner
areas keep all of that range clear, or, where that leaves no place, a part of it; outer ones are cut by what
is taken at each height of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY
from regionik.areas.layers import ROUNDING_MARGIN, BodyLayer, all_taken, layers_of
from regionik.areas.options import AREAS
from regionik.planners.driving.heading_slabs import ConvexScene, free_at_all, free_at_some, outline_scene
from regionik.worlds.body import lift_for, lift_range, lifted_prisms
from regionik.worlds.robot import Robot, with_joint_margin
from regionik.worlds.scene import World

Lift = tuple[float, float]  # lowest and highest [m]


@dataclass(frozen=True, eq=False)
class LiftedBody:
    """What a robot's lifts carry in a world, and what of the floor that rejects."""

    world: World
    footprint: BodyLayer
    # What was asked before: layers and scenes by lift, rejections by lift and span of headings, by inner
    _layers: dict[tuple[Lift, bool], tuple[BodyLayer, ...]] = field(default_factory=dict, init=False)
    _scenes: dict[tuple[Lift, bool], list[ConvexScene]] = field(default_factory=dict, init=False)
    _rejections: dict[tuple[Lift, Lift, bool], BaseGeometry] = field(default_factory=dict, init=False)

    @cached_property
    def matters(self) -> bool:
        """True where what lifts carry may reject some place of the base."""
        return bool(self._layers_at(lift_range(self.world.robot), inner=True))

    def rejection(self, height: float, span: tuple[float, float] = EVERY, *, inner: bool) -> BaseGeometry:
        """Return the places of the arm axis rejected for a tool at a height, at headings of a span.

        With ``inner`` those from which a lift may bring its load too near to something, else those from
        which each lift does.
        """
        lift = self._allowed(height)
        if lift is None:
            return Polygon()
        return self.rejection_of(lift, span, inner=inner)

    def rejection_of(self, lift: Lift, span: tuple[float, float], *, inner: bool) -> BaseGeometry:
        """Return the places rejected where lifts raise the arm within a range, as `rejection` does."""
        key = lift, span, inner
        if key not in self._rejections:
            self._rejections[key] = self._rejection(*key)
        return self._rejections[key]

    def parts(self, height: float) -> list[Lift]:
        """Return the range of lifts for a tool at a height, within the limits that criteria leave, in parts.

        None where there is but one.
        """
        ends, limits = self._allowed(height), lift_range(self._within_criteria)
        if ends is None or not math.isfinite(limits[1] - limits[0]):
            return []
        low, high = max(ends[0], limits[0]), min(ends[1], limits[1])
        count = math.ceil((high - low) / AREAS.lift_step - 1e-9)  # but for rounding
        return list(pairwise(np.linspace(low, high, count + 1).tolist())) if count > 1 else []

    @property
    def _within_criteria(self) -> Robot:
        return with_joint_margin(self.world.robot, self.world.rules.criteria)

    def rejections(self, height: float) -> list[tuple[str, str, BaseGeometry]]:
        """Return what `rejection` is made of at every heading: solid, part of the robot, and places."""
        lift = self._allowed(height)
        layers = () if lift is None else self._layers_at(lift, inner=True)
        return [
            (name, layer.part, taken)
            for layer in layers
            for name, taken in zip(layer.names, layer.taken(inner=True), strict=True)
        ]

    def _allowed(self, height: float) -> Lift | None:
        """How far lifts may raise the arm for a tool at a height, in steps; None where none brings it."""
        lift = lift_for(self.world.robot, height, self.world.rules.tolerance)
        if lift is None:
            return None
        low, high = lift_range(self.world.robot)
        return max(low, AREAS.lift_step * math.floor(lift[0] / AREAS.lift_step)), min(
            high, AREAS.lift_step * math.ceil(lift[1] / AREAS.lift_step)
        )

    def _rejection(self, lift: Lift, span: tuple[float, float], inner: bool) -> BaseGeometry:
        if span == EVERY:
            return shapely.union_all(all_taken(self._layers_at(lift, inner=inner), inner=inner))
        free = free_at_all if inner else free_at_some
        scenes = self._scenes_at(lift, inner=inner)
        return shapely.union_all([scene.floor.envelope - free(scene, *span) for scene in scenes])

    def _scenes_at(self, lift: Lift, *, inner: bool) -> list[ConvexScene]:
        if (lift, inner) not in self._scenes:
            margin = ROUNDING_MARGIN if inner else 0.0
            layers = self._layers_at(lift, inner=inner)
            outlines = [layer.moved(np.zeros(2), margin) for layer in layers]
            self._scenes[lift, inner] = [outline_scene(one, self.world.floor.polygon) for one in outlines]
        return self._scenes[lift, inner]

    def _layers_at(self, lift: Lift, *, inner: bool) -> tuple[BodyLayer, ...]:
        if (lift, inner) not in self._layers:
            prisms = lifted_prisms(self.world.robot, lift, inside=not inner)
            found = layers_of(self.world, prisms, self.footprint, inside=not inner) if prisms else ()
            self._layers[lift, inner] = found
        return self._layers[lift, inner]
