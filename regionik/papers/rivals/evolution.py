"""Inverse kinematics by differential evolution, as scipy has it."""

from __future__ import annotations

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution

from regionik.papers.options import PAPERS
from regionik.papers.rivals.method import SearchResult
from regionik.papers.rivals.population import PopulationMethod
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.worlds.arrays import Array

OPTIONS = PAPERS.evolution


class Evolution(PopulationMethod):
    """Differential evolution (Storn and Price 1997), until the aim is met."""

    name = "evolution"

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Return the best of all generations."""
        lower, upper = self.bounds(aim, joints)

        def met(intermediate_result: OptimizeResult) -> bool:
            return bool(intermediate_result.fun <= self.tolerance)

        found = differential_evolution(
            lambda genes: self.misses(aim, genes.T),
            list(zip(lower, upper, strict=True)),
            x0=np.clip(joints, lower, upper),
            rng=np.random.default_rng(self._seed),
            maxiter=OPTIONS.generations,
            popsize=OPTIONS.population_per_joint,
            vectorized=True,
            updating="deferred",
            tol=0.0,
            polish=False,
            callback=met,
        )
        return self.result(aim, found.x, int(found.nit))
