"""Inverse kinematics by a genetic algorithm; the only file that imports pygad, on first use."""

from __future__ import annotations

import numpy as np

from regionik.papers.options import PAPERS
from regionik.papers.rivals.method import SearchResult
from regionik.papers.rivals.population import PopulationMethod
from regionik.planners.solvers.damped_least_squares import Aim
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

OPTIONS = PAPERS.genetic


class Genetic(PopulationMethod):
    """Tournaments, one-point crossover and mutation, until the aim is met.

    Parameters
    ----------
    tolerance, angle_tolerance : float [m], [rad]
    mutation : float
        Probability for each gene.
    elite : int
        Best of a population that survive unchanged.
    seed : int
        Same seed, same answer.

    Raises
    ------
    InputError
        Where pygad is not installed.
    """

    name = "genetic"

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        angle_tolerance: float = 1e-3,
        mutation: float = OPTIONS.mutation,
        elite: int = OPTIONS.elite,
        seed: int = 0,
    ) -> None:
        super().__init__(chain, tolerance, angle_tolerance, seed)
        try:
            import pygad
        except ModuleNotFoundError:
            needed = "genetic: expected pygad to be installed: pip install regionik[compare]"
            raise InputError(needed) from None
        self._algorithm, self._mutation, self._elite = pygad.GA, mutation, elite

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Return the best of all generations; a generation counts as an iteration."""
        lower, upper = self.bounds(aim, joints)
        first = np.random.default_rng(self._seed).uniform(lower, upper, (OPTIONS.population, self.chain.dof))
        first[0] = np.clip(joints, lower, upper)
        search = self._algorithm(
            num_generations=OPTIONS.generations,
            num_parents_mating=OPTIONS.population,
            initial_population=first,
            gene_space=[{"low": a, "high": b} for a, b in zip(lower, upper, strict=True)],
            parent_selection_type="tournament",
            K_tournament=OPTIONS.tournament,
            crossover_type="single_point",
            mutation_type="random",
            mutation_probability=self._mutation,
            keep_elitism=self._elite,
            keep_parents=0,
            fitness_func=lambda _, genes, __: -self.misses(aim, np.atleast_2d(genes)),
            fitness_batch_size=OPTIONS.population,
            stop_criteria=f"reach_{-self.tolerance}",
            random_seed=self._seed,
            suppress_warnings=True,
        )
        search.run()
        genes, _, _ = search.best_solution(search.last_generation_fitness)
        return self.result(aim, genes, int(search.generations_completed))
