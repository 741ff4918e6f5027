"""Numbers that tune the papers' systems: Xu's tracker, and the methods that M-FABRIK is compared with."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class TrackerOptions:
    """Xu's tracker."""

    start_headings: int = 24  # of a full turn, that a run is started with
    max_halvings: int = 6  # of the segment between two set-points
    max_swing: float = math.radians(1.0)  # by which the base turns more or less than in the step before [rad]
    drawn_width: float = 0.005  # half of it, of the curves that the axis may stand on [m]


@dataclass(frozen=True)
class GeneticOptions:
    """The genetic algorithm: paper 004, Table 1, configuration 2."""

    population: int = 50
    tournament: int = 5
    generations: int = 500
    # The 1 % without elitism of the paper ends three times as far off.
    mutation: float = 0.3
    elite: int = 2


@dataclass(frozen=True)
class EvolutionOptions:
    """Differential evolution, of as many postures as the genetic algorithm has for three joints."""

    population_per_joint: int = 15
    generations: int = 500


@dataclass(frozen=True)
class NetworkOptions:
    """The neural network."""

    # One layer of a hundred, as in paper 004, has about 1.5 times the error
    hidden: tuple[int, ...] = (50, 50)
    samples: int = 800
    epochs: int = 4000
    min_learnt_share: float = 0.25  # of the samples that count as learnt, where fewer are met
    height_share: float = 0.05  # of the arm's length: samples within it are at one height


@dataclass(frozen=True)
class ComparisonOptions:
    """Runs of methods, and from when on one is called better."""

    restarts: int = 10  # other postures to start from, the same for all methods that start again
    max_iterations: int = 300  # from each start
    small_gain: float = 0.0508  # share of each step that the rivals of Santos et al. take, by their table 3
    max_runs: int = 40  # of a method along the path, of which the fastest counts
    time_budget: float = 0.5  # after which a method is not run again [s]
    tie_ratio: float = 1.05  # of iterations, times or errors below which no method is better
    tie_error: float = 1e-6  # difference of errors below which none is [m]


@dataclass(frozen=True)
class PapersOptions:
    """All of them, by what they tune."""

    tracker: TrackerOptions = TrackerOptions()
    genetic: GeneticOptions = GeneticOptions()
    evolution: EvolutionOptions = EvolutionOptions()
    network: NetworkOptions = NetworkOptions()
    comparison: ComparisonOptions = ComparisonOptions()


PAPERS = PapersOptions()
