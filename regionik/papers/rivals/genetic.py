"""Inverse kinematics by a genetic algorithm; the only file that imports pygad, on first use."""

from __future__ import annotations

import numpy as np

from regionik.papers.options import PAPERS
from regionik.papers.rivals.method import ArmMethod, SearchResult, arm_length, position_error
from regionik.planners.solvers.damped_least_squares import DIRECTION, POSITION, Aim
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

OPTIONS = PAPERS.genetic


class Genetic(ArmMethod):
    """Tournaments, one-point crossover and mutation within the joint limits, until the aim is met.

    Prismatic joints without limits are drawn within the distance of the target and an arm's length of their
    start. The start is one of the first population.

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
        super().__init__(chain, tolerance, angle_tolerance)
        try:
            import pygad
        except ModuleNotFoundError:
            needed = "genetic: expected pygad to be installed: pip install regionik[compare]"
            raise InputError(needed) from None
        self._algorithm, self._mutation, self._elite, self._seed = pygad.GA, mutation, elite, seed
        self._reach = arm_length(chain)

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Return the best of all generations; a generation counts as an iteration."""
        lower, upper = self._bounds(aim, joints)
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
            fitness_func=lambda _, genes, __: -self._misses(aim, np.atleast_2d(genes)),
            fitness_batch_size=OPTIONS.population,
            stop_criteria=f"reach_{-self.tolerance}",
            random_seed=self._seed,
            suppress_warnings=True,
        )
        search.run()
        genes, _, _ = search.best_solution(search.last_generation_fitness)
        q = np.clip(genes.astype(np.float64), self.chain.lower, self.chain.upper)
        angle = float(_angles(aim, self.chain.forward(q)[None])[0])
        error, generations = position_error(self.chain, aim, q), int(search.generations_completed)
        return SearchResult(q, error, angle, generations, 0)

    def _bounds(self, aim: Aim, joints: Array) -> tuple[Array, Array]:
        turns = np.array([joint.kind == "revolute" for joint in self.chain.joints])
        span = np.where(turns, np.pi, position_error(self.chain, aim, joints) + self._reach)
        return np.maximum(self.chain.lower, joints - span), np.minimum(self.chain.upper, joints + span)

    def _misses(self, aim: Aim, postures: Array) -> Array:
        """Misses of postures (m, dof) [m]; an angle counts as a length of the same share of its tolerance."""
        tools = self.chain.forward(postures)
        off: Array = np.linalg.norm(tools[:, :3, 3] - aim.position, axis=1)
        if aim.kind == POSITION:
            return off
        share = self.tolerance / self.angle_tolerance
        missed: Array = np.maximum(off, share * _angles(aim, tools))
        return missed


def _angles(aim: Aim, tools: Array) -> Array:
    """Angles (m,) of tools (m, 4, 4) beyond the aim's cone [rad]."""
    if aim.kind == POSITION:
        return np.zeros(len(tools))
    if aim.kind == DIRECTION:
        cosines = tools[:, :3, 2] @ aim.turn[:, 2]
    else:
        cosines = (np.einsum("mij,ij->m", tools[:, :3, :3], aim.turn) - 1.0) / 2.0
    angles: Array = np.maximum(0.0, np.arccos(np.clip(cosines, -1.0, 1.0)) - aim.cone)
    return angles
