"""Whether stops, reach, plans, fields and areas of a world say the same, as the second opinion sees it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.output.urdf import robot_to_urdf
from regionik.parking.stops import stops
from regionik.pipeline import search
from regionik.reachability.field import reach_field
from regionik.reachability.reach import reach
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.values import Answer, Stop
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.scene import Target, World
from tests.maths import Array
from tests.opinion.body import Body
from tests.opinion.judge import posture_objections
from tests.opinion.search import find_clear_at
from tests.retold import facts_of, machine_of

PLACES = 6  # of an inner area, and of a field
AREAS = 2  # targets whose areas are looked at
CELL = 0.2  # of fields [m]
LEAST = 1e-6  # areas that are smaller are none [m2]


def _spread(area: BaseGeometry, seed: int) -> Array:
    """Places all over an area (n, 2), at most `PLACES` and at least one."""
    low, high = np.reshape(area.bounds, (2, 2))
    drawn = np.random.default_rng(seed).uniform(low, high, (50 * PLACES, 2))
    found: Array = drawn[shapely.contains_xy(area, drawn)][:PLACES]
    return found if len(found) else np.array(area.representative_point().coords)


@dataclass(eq=False)
class Doors:
    """One world asked through every door; ``wrong`` is what contradicts, ``seen`` what was looked at."""

    world: World
    wrong: list[str] = field(default_factory=list)
    seen: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.machine, self.document = machine_of(self.world), world_to_document(self.world)

    def ask(self) -> Doors:
        """Ask at all of them."""
        self.areas()
        self.field()
        self.stops()
        return self

    def stops(self, *, planned: bool = True) -> None:
        """At each stop `reach` confirms what is confirmed, and what is confirmed at every one is planned."""
        try:
            found = stops(self.world)
        except NoPlanFound:
            self.seen["no stops"] += 1
            return
        for n, stop in enumerate(found, 1):
            self._stop(stop, f"stop {n}")
        served = sorted(i for stop in found for i in stop.setpoints)
        if served != list(range(len(self.world.task))):
            self.wrong.append(f"the stops serve set-points {served}")
        if planned and not any(stop.unconfirmed for stop in found):
            self._plan()

    def areas(self) -> None:
        """Places of inner areas at which base and body stand."""
        body = Body(self.document, self.machine)
        for i, target in enumerate(self.world.task[:AREAS]):
            inner = admissible_area(self.world, target).inner
            if inner.area > LEAST:
                self._stand(body, _spread(inner, i), f"the inner area of set-point {i + 1}")

    def field(self) -> None:
        """Places of a field that reach something, the best ones first, at which base and body stand."""
        found = reach_field(self.world, list(self.world.task), CELL)
        rows, columns = np.unravel_index(
            np.argsort(-found.values, axis=None, kind="stable"), found.values.shape
        )
        some = [
            np.array([found.x[c], found.y[r]])
            for r, c in zip(rows[:PLACES].tolist(), columns[:PLACES].tolist(), strict=True)
            if found.values[r, c]
        ]
        self._stand(Body(self.document, self.machine), some, "the field")

    def _stand(self, body: Body, places: Array | list[Array], what: str) -> None:
        for place in places:
            self.seen["places"] += 1
            if not body.stands_over(place):
                self.wrong.append(f"{what} holds {np.round(place, 6).tolist()}, where the base cannot stand")

    def _stop(self, stop: Stop, name: str) -> None:
        targets = [self.world.task[i] for i in stop.setpoints]
        answer = reach(self.world, targets, base=stop.base)
        for k, i in enumerate(stop.setpoints):
            confirmed = i not in stop.unconfirmed
            self.seen["confirmed" if confirmed else "unconfirmed"] += 1
            if confirmed != bool(answer.reachable[k]):
                said = "confirmed" if confirmed else "unconfirmed"
                self.wrong.append(f"{name}: set-point {i + 1} is {said}, reach says {answer.verdict[k]}")
        self.wrong += [f"{name}: {text}" for text in self.against(targets, answer, stop.base)]

    def against(self, targets: list[Target], answer: Answer, base: Array) -> list[str]:
        """What the second opinion has against what `reach` says from one pose of the base."""
        wrong = list[str]()
        urdf, facts = robot_to_urdf(self.world.robot, self.world.floor.polygon), facts_of(self.world.robot)
        for k, target in enumerate(targets):
            document = world_to_document(replace(self.world, task=(target,)))
            said = f"{np.round(target.position, 6).tolist()} is said to be {answer.verdict[k]}"
            if answer.reachable[k]:
                if not np.array_equal(answer.base[k], base):
                    wrong.append(f"{said} from another base")
                self.machine.place(answer.base[k], answer.joints[k])
                pose = {"base": answer.base[k].tolist(), "joints": answer.joints[k].tolist()}
                state = {
                    **pose,
                    "tool": self.machine.tool()[:3, 3].tolist(),
                    "kind": "setpoint",
                    "setpoint": 0,
                }
                held = posture_objections({"world": document, "states": [state]}, urdf, facts)
                wrong += [f"{said}: {text}" for text in held]
            elif answer.verdict[k] == "unreachable":
                asked = {"point": document["task"][0]["points"][0], **document["task"][0]}
                found = find_clear_at(document, self.machine, asked, base)
                if found is not None:
                    wrong.append(f"{said}: {answer.reason[k]} But {np.round(found, 6).tolist()} is there.")
        return wrong

    def _plan(self) -> None:
        self.seen["plans"] += 1
        try:
            search(scene_of(self.world))
        except NoPlanFound as no:
            why = no.explanation
            self.wrong.append(f"every stop is confirmed, and there is no plan: {why.verdict}: {why.reason}")
