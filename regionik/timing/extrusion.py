"""What the tool of a plan feeds: the flow of its set-points, along its own way at work."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.values import Plan
from regionik.worlds.arrays import Array, Index
from regionik.worlds.prepared import made_once


@dataclass(frozen=True, eq=False)
class Extrusion:
    """Material that the tool has fed by each state, evenly along its way from one to the next."""

    tools: Array  # (n, 3) [m]
    amount: Array  # (n,) in the unit of the task

    @cached_property
    def _lengths(self) -> Array:
        return np.linalg.norm(np.diff(self.tools, axis=0), axis=1)

    @cached_property
    def flow(self) -> Array:
        """Material per metre on each segment, and 0 after the last, (n,)."""
        fed = np.diff(self.amount)
        return np.append(np.divide(fed, self._lengths, out=np.zeros_like(fed), where=self._lengths > 0), 0.0)

    def at(self, tools: Array, segment: Index) -> Array:
        """Amount by places (m, 3) of the tool on segments, the last state being one without length, (m,)."""
        far = np.linalg.norm(tools - self.tools[segment], axis=1)
        fed = np.minimum(far, np.append(self._lengths, 0.0)[segment]) * self.flow[segment]
        return self.amount[segment] + fed


@made_once
def extrusion_of(plan: Plan) -> Extrusion | None:
    """Return what the tool of a plan feeds; None where its task tells no flow.

    Over the whole way to a set-point it is as much as for the straight one, however the tool is off its path
    in between. Of a way on which it is lifted it is what is worked.
    """
    flows, task, tools = plan.world.work_flows, plan.world.task, plan.tools()
    if flows is None:
        return None
    on, ahead = plan.tool_on()[:-1], plan.motion.leads_to()
    worked = np.linalg.norm(np.diff(tools, axis=0), axis=1) * on
    places = np.array([target.position for target in task])
    straight = np.append(np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=1), 0.0)
    gone = np.bincount(ahead, worked, minlength=len(straight))
    whole = (np.bincount(ahead, ~on, minlength=len(straight)) == 0) & (gone > 0)
    flow = np.append(flows, 0.0) * np.divide(straight, gone, out=np.ones_like(gone), where=whole)
    return Extrusion(tools, np.concatenate([[0.0], np.cumsum(flow[ahead] * worked)]))
