"""Inverse kinematics by a neural network; the only file that imports scikit-learn, on first use."""

from __future__ import annotations

import warnings

import numpy as np

from regionik.papers.options import PAPERS
from regionik.papers.rivals.iterative import DampedLeastSquares
from regionik.papers.rivals.method import ArmMethod, SearchResult, arm_length, position_error
from regionik.planners.solvers.damped_least_squares import POSITION, Aim
from regionik.planners.solvers.fabrikr import clamped_turn
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, spread_postures
from regionik.worlds.errors import InputError

OPTIONS = PAPERS.network

EXACT = 1e-9  # tolerance of the training postures [m]
VERTICAL = 1e-9  # tolerance of a vertical pivot [m]


class Network(ArmMethod):
    """A multilayer perceptron from tool positions to joints, trained on samples of the arm.

    Samples are drawn within the joint limits. A position has many postures, and a network would return their
    mean, which is off target; so each sampled position is given the one posture that damped least squares
    finds from the middle of the limits. Where a vertical pivot turns most of the way round, samples are
    learnt at one of its angles and rotated. The start of a search is ignored.

    Parameters
    ----------
    tolerance : float [m]
    samples : int
        Positions to learn.
    epochs : int
        Most iterations of L-BFGS.
    seed : int
        Same seed, same network.

    Raises
    ------
    InputError
        Where scikit-learn is not installed.
    """

    name = "network"

    def __init__(
        self,
        chain: Chain,
        tolerance: float = 1e-3,
        samples: int = OPTIONS.samples,
        epochs: int = OPTIONS.epochs,
        seed: int = 0,
    ) -> None:
        super().__init__(chain, tolerance, 1e-3)
        try:
            from sklearn.exceptions import ConvergenceWarning
            from sklearn.neural_network import MLPRegressor
            from threadpoolctl import threadpool_limits
        except ModuleNotFoundError:
            raise InputError(
                "network: expected scikit-learn to be installed: pip install regionik[compare]"
            ) from None
        self._turns = _has_turning_pivot(chain)
        positions, postures = training_set(chain, samples, seed)
        self._position_scale, self._posture_scale = _scale(positions), _scale(postures)
        self._network = MLPRegressor(
            hidden_layer_sizes=OPTIONS.hidden,
            activation="tanh",
            solver="lbfgs",
            alpha=0.0,
            tol=1e-12,
            max_iter=epochs,
            max_fun=100 * epochs,
            random_state=seed,
        )
        # So small a network is slower on many threads, and rounding depends on their number.
        with warnings.catch_warnings(), threadpool_limits(1):
            warnings.simplefilter("ignore", ConvergenceWarning)  # `epochs` is the intended end
            inputs = _standardized(positions, self._position_scale)
            self._network.fit(inputs, _standardized(postures, self._posture_scale))
        off = np.linalg.norm(chain.forward(self._predict(positions))[:, :3, 3] - positions, axis=1)
        self.learnt = positions[off <= max(self.tolerance, float(np.quantile(off, OPTIONS.min_learnt_share)))]

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Predict once, clipped to the limits."""
        if aim.kind != POSITION:
            raise InputError("network: takes positions alone, and the target asks for more")
        heading, local = self._at_heading_zero(aim.position)
        q = self._predict(local[None])[0]
        lower, upper = self.chain.lower, self.chain.upper
        if self._turns:
            q[0] = clamped_turn(q[0] + heading, float(joints[0]), lower[0], upper[0])
        q = np.clip(q, lower, upper)
        return SearchResult(q, position_error(self.chain, aim, q), 0.0, 1, 0)

    def _predict(self, positions: Array) -> Array:
        """Postures (n, dof) for positions (n, 3) at heading zero."""
        mean, spread = self._posture_scale
        inputs = _standardized(positions, self._position_scale)
        outputs: Array = self._network.predict(inputs).reshape(len(positions), -1)
        return outputs * spread + mean

    def nearest_learnt(self, position: Array) -> Array:
        """Nearest on the floor of the positions learnt at about this height, (3,) [m]."""
        heading, local = self._at_heading_zero(position)
        off = np.abs(self.learnt[:, 2] - local[2])
        near = self.learnt[off <= max(OPTIONS.height_share * arm_length(self.chain), float(off.min()))]
        x, y, z = near[np.argmin(np.linalg.norm((near - local)[:, :2], axis=1))]
        c, s = np.cos(heading), np.sin(heading)
        return np.array([c * x - s * y, s * x + c * y, z])

    def _at_heading_zero(self, position: Array) -> tuple[float, Array]:
        """Heading of a position, and the position turned back by it; 0 and as it is where no pivot turns."""
        if not self._turns:
            return 0.0, np.array(position)
        x, y, z = position
        return float(np.arctan2(y, x)), np.array([np.hypot(x, y), 0.0, z])


def training_set(chain: Chain, samples: int, seed: int) -> tuple[Array, Array]:
    """Tool positions (n, 3) [m] and one posture (n, dof) for each, at most ``samples``."""
    places = chain.forward(spread_postures(chain, arm_length(chain), samples, seed))[:, :3, 3]
    if _has_turning_pivot(chain):
        places = np.column_stack([np.hypot(*places.T[:2]), np.zeros(len(places)), places[:, 2]])
    bounded = np.isfinite(chain.lower) & np.isfinite(chain.upper)
    middle = np.where(bounded, chain.lower, 0.0) / 2 + np.where(bounded, chain.upper, 0.0) / 2
    solver = DampedLeastSquares(chain, EXACT, restarts=0)
    found = [solver.search(Aim(p, POSITION, np.eye(3), 0.0), middle) for p in places]
    postures = np.array([one.joints for one in found if one.error <= EXACT])
    return chain.forward(postures)[:, :3, 3], postures


def _has_turning_pivot(chain: Chain) -> bool:
    """Return whether the first joint is a vertical pivot with a range above three quarters of a turn."""
    first = chain.joints[0]
    upward = (first.T_parent_joint[:3, :3] @ first.axis)[2] > 1.0 - VERTICAL
    centred = np.hypot(*first.T_parent_joint[:2, 3]) < VERTICAL
    return bool(first.kind == "revolute" and upward and centred and first.upper - first.lower > 1.5 * np.pi)


def _scale(rows: Array) -> tuple[Array, Array]:
    """Mean and spread of every column; 1 for a column without spread."""
    spread = rows.std(axis=0)
    return rows.mean(axis=0), np.where(spread > 1e-9, spread, 1.0)


def _standardized(rows: Array, scale: tuple[Array, Array]) -> Array:
    scaled: Array = (rows - scale[0]) / scale[1]
    return scaled
