"""Inverse kinematics by a neural network; the only file that imports scikit-learn, once it is asked for."""

from __future__ import annotations

import warnings

import numpy as np

from regionik.planners.rivals.iterative import DampedLeastSquares
from regionik.planners.rivals.method import ArmMethod, Found, reach_of, spatial_error
from regionik.planners.solvers.damped_least_squares import POSITION, Aim
from regionik.planners.solvers.inverse_kinematics import spread_postures
from regionik.planners.solvers.joint_turns import held
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

HIDDEN = (50, 50)  # one layer of a hundred, as in paper 004, ends about 1.5 times as far off
SAMPLES, EPOCHS = 800, 4000
EXACT = 1e-9  # to which the postures of the cloud meet their places [m]
WELL = 0.25  # share of the cloud that counts as learnt well, where fewer places are met within tolerance
FLAT = 1e-9  # by which a pivot may be off the vertical [m]
SLICE = 0.05  # of the arm's length, within which samples count as of one height


class Network(ArmMethod):
    """A multilayer perceptron from tool positions to joints, trained on the arm's own cloud.

    The cloud is drawn within the joint limits. A position has many postures, and a network would answer with
    their mean, which meets nothing; so each place of the cloud is given the one posture that damped least
    squares comes to from the middle of the limits. Where the arm has a pivot that turns most of the way
    round, all that is learnt at one heading of it and turned. The start of a search plays no part.

    Parameters
    ----------
    chain : Chain
    tolerance : float
        [m]
    samples : int
        Places of the cloud.
    epochs : int
        Most steps of the training (L-BFGS).
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
        samples: int = SAMPLES,
        epochs: int = EPOCHS,
        seed: int = 0,
    ) -> None:
        super().__init__(chain, tolerance, 1e-3)
        try:
            from sklearn.exceptions import ConvergenceWarning
            from sklearn.neural_network import MLPRegressor
            from threadpoolctl import threadpool_limits
        except ModuleNotFoundError:
            raise InputError(
                "network: expected scikit-learn to be there: pip install regionik[compare]"
            ) from None
        self._turns = _turns(chain)
        places, postures = cloud(chain, samples, seed)
        self._place, self._posture = _scale(places), _scale(postures)
        self._network = MLPRegressor(
            hidden_layer_sizes=HIDDEN,
            activation="tanh",
            solver="lbfgs",
            alpha=0.0,
            tol=1e-12,
            max_iter=epochs,
            max_fun=100 * epochs,
            random_state=seed,
        )
        # So small a network is slower on many threads, and each number of them rounds otherwise.
        with warnings.catch_warnings(), threadpool_limits(1):
            warnings.simplefilter("ignore", ConvergenceWarning)  # to stop at `epochs` is what is meant
            self._network.fit(_into(places, self._place), _into(postures, self._posture))
        off = np.linalg.norm(chain.forward(self._answers(places))[:, :3, 3] - places, axis=1)
        self.places = places[off <= max(self.tolerance, float(np.quantile(off, WELL)))]

    def search(self, aim: Aim, joints: Array) -> Found:
        """One look at the network, its answer taken into the limits."""
        if aim.kind != POSITION:
            raise InputError("network: takes positions alone, and the target asks for more")
        heading, place = self._facing(aim.position)
        q = self._answers(place[None])[0]
        lower, upper = self.chain.lower, self.chain.upper
        if self._turns:
            q[0] = held(q[0] + heading, float(joints[0]), lower[0], upper[0])
        q = np.clip(q, lower, upper)
        return Found(q, spatial_error(self.chain, aim, q), 0.0, 1, 0)

    def _answers(self, places: Array) -> Array:
        """Postures (n, dof) for places (n, 3) as they are learnt."""
        middle, spread = self._posture
        seen: Array = self._network.predict(_into(places, self._place)).reshape(len(places), -1)
        return seen * spread + middle

    def nearest_place(self, position: Array) -> Array:
        """The place learnt well that, of about this height, is nearest seen from above (3,) [m]."""
        heading, place = self._facing(position)
        off = np.abs(self.places[:, 2] - place[2])
        near = self.places[off <= max(SLICE * reach_of(self.chain), float(off.min()))]
        x, y, z = near[np.argmin(np.linalg.norm((near - place)[:, :2], axis=1))]
        c, s = np.cos(heading), np.sin(heading)
        return np.array([c * x - s * y, s * x + c * y, z])

    def _facing(self, position: Array) -> tuple[float, Array]:
        """Heading of a position, and where it lies seen from there; 0 and as it is where no pivot turns."""
        if not self._turns:
            return 0.0, np.array(position)
        x, y, z = position
        return float(np.arctan2(y, x)), np.array([np.hypot(x, y), 0.0, z])


def cloud(chain: Chain, samples: int, seed: int) -> tuple[Array, Array]:
    """Tool positions (n, 3) [m] and one posture (n, dof) for each; at most ``samples`` of them."""
    places = chain.forward(spread_postures(chain, reach_of(chain), samples, seed))[:, :3, 3]
    if _turns(chain):
        places = np.column_stack([np.hypot(*places.T[:2]), np.zeros(len(places)), places[:, 2]])
    bounded = np.isfinite(chain.lower) & np.isfinite(chain.upper)
    middle = np.where(bounded, chain.lower, 0.0) / 2 + np.where(bounded, chain.upper, 0.0) / 2
    solver = DampedLeastSquares(chain, EXACT, restarts=0)
    found = [solver.search(Aim(p, POSITION, np.eye(3), 0.0), middle) for p in places]
    postures = np.array([one.joints for one in found if one.error <= EXACT])
    return chain.forward(postures)[:, :3, 3], postures


def _turns(chain: Chain) -> bool:
    """Whether the first joint is a vertical pivot that turns more than three quarters round."""
    first = chain.joints[0]
    upward = (first.T_parent_joint[:3, :3] @ first.axis)[2] > 1.0 - FLAT
    centred = np.hypot(*first.T_parent_joint[:2, 3]) < FLAT
    return bool(first.kind == "revolute" and upward and centred and first.upper - first.lower > 1.5 * np.pi)


def _scale(rows: Array) -> tuple[Array, Array]:
    """Mean and spread of every column; 1 for a column without spread."""
    spread = rows.std(axis=0)
    return rows.mean(axis=0), np.where(spread > 1e-9, spread, 1.0)


def _into(rows: Array, scale: tuple[Array, Array]) -> Array:
    scaled: Array = (rows - scale[0]) / scale[1]
    return scaled
