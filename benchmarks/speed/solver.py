"""One solve by a prepared `rik.Solver`, called from Python, against others for the same targets and starts.

A piece of work is one target: 1 mm, free base, no obstacles, all joints within their limits. The time of a
solver is that of all targets together, those included that take it restarts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.ik_peers import bounds
from benchmarks.speed import peers
from benchmarks.speed.harness import Row, Size, Wanted, Work, absent, against
from benchmarks.speed.mobile import TOLERANCE, Task, mobile_chain, task
from regionik.mfabrik import Solver
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain

WHAT = "one solve from Python, 1 mm, free base"
SLACK = 1e-6  # beyond limits that a peer may round
MUST = 0.98  # share of targets that a setting must solve
PEERS: tuple[tuple[str, Callable[[Chain], Iterator[tuple[str, peers.Ask]]], float, int], ...] = (
    ("roboticstoolbox, C++ LM", peers.toolbox_lm, 25, 300),
    ("pinocchio, loop", peers.pinocchio_loop, 35, 300),
    ("pink", peers.pink_loop, 200, 60),
    ("mink", peers.mink_loop, 250, 60),
    ("ikpy", peers.ikpy_search, 8000, 12),
)


def rows(size: Size) -> Iterator[Row]:
    """A row a peer."""
    for name, make, least, count in PEERS:
        some = task(size.count(count))
        chain, wanted = mobile_chain(some.robot), Wanted(float(least))
        try:
            settings = list(make(chain))
        except ModuleNotFoundError as error:
            yield absent(WHAT, name, wanted, f"no package {error.name}")
            continue
        setting, ask, share = fastest(chain, some, settings)
        ours, own = asked_of_ours(some)
        note = f"setting {setting}; solves {100 * share:.3g} % of {len(some.targets)}, ours {100 * own:.3g} %"
        work, pieces = asked_of(ask, some), (len(some.targets),) * 2
        yield against(WHAT, name, ours, work, wanted, size, pieces=pieces, note=note)
    why = "its Python door takes whole poses only, so it cannot be asked for a position"
    yield absent(WHAT, "pytracik", None, why)


def asked_of(ask: peers.Ask, some: Task) -> Work:
    """All targets, one after the other."""
    cases = list(zip(some.targets, some.starts, strict=True))

    def work() -> None:
        for target, start in cases:
            ask(target, start)

    return work


def asked_of_ours(some: Task) -> tuple[Work, float]:
    """The same of ours, and the share that it solves."""
    solver = Solver(some.robot, tolerance=TOLERANCE)
    cases = list(zip(some.targets, some.bases, some.joints, strict=True))
    chain = mobile_chain(some.robot)
    found = [solver(*case) for case in cases]
    answers = [np.concatenate([one.base, one.joints]) for one in found]

    def work() -> None:
        for target, base, joints in cases:
            solver(target, base, joints)

    return work, solved(chain, some.targets, answers, beyond=4 * np.pi)


def fastest(chain: Chain, some: Task, settings: list[tuple[str, peers.Ask]]) -> tuple[str, peers.Ask, float]:
    """The setting that takes least, of those that solve nearly all, else of those that solve most."""
    tried = []
    for name, ask in settings:
        ask(some.targets[0], some.starts[0])
        begun = time.process_time()
        answers = [ask(*case) for case in zip(some.targets, some.starts, strict=True)]
        spent = time.process_time() - begun
        share = solved(chain, some.targets, answers)
        tried.append((-min(share, MUST), spent, share, name, ask))
    _, _, share, name, ask = min(tried, key=lambda one: one[:2])
    return name, ask, share


def solved(chain: Chain, targets: Array, answers: Sequence[Array | None], beyond: float = SLACK) -> float:
    """Share of answers on target and within limits; the heading of the base may go ``beyond`` its own."""
    lower, upper = bounds(chain)
    slack = np.where(np.array(chain.names) == "base_yaw", max(beyond, SLACK), SLACK)
    good = 0
    for target, joints in zip(targets, answers, strict=True):
        if joints is not None:
            within = (joints >= lower - slack).all() and (joints <= upper + slack).all()
            miss = np.linalg.norm(chain.forward(joints)[:3, 3] - target)
            good += bool(within and miss <= TOLERANCE * (1 + 1e-9))
    return good / len(targets)
