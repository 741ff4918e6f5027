"""All bundled worlds and some random ones, planned and judged by the second opinion.

Half of the random ones may have no plan (`tests.soaked`). Half have arms of five to seven joints and are
built round a motion that is free (`tests.witnesses`).

Run: python -m tests.soak 500 -o docs/soak.md. Exits 1 where a plan or a claim was contradicted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from rich.progress import track

from regionik.output.urdf import robot_to_urdf
from regionik.pipeline import search
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.timing.retime import retime
from regionik.timing.trajectory import trajectory
from regionik.values import Plan
from regionik.worlds.bundled import world_names
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.scene import Target, World
from tests import random_arms
from tests.bounded import Ended, bounded_calls
from tests.doors import Doors
from tests.furnished import furnished_world
from tests.opinion.course import Course
from tests.opinion.judge import detours, objections, posture_objections
from tests.opinion.machine import Facts, Machine
from tests.opinion.moment import Moment
from tests.opinion.search import find, find_clear
from tests.plans import plan_to_document
from tests.retold import facts_of, machine_of
from tests.soaked import GROUND, KINDS, STOPS, soaked_world
from tests.witnesses import traits_of, witness

FURNISHED = "furnished"  # rooms in which every door is asked: see `tests.doors`
DRAWN = (*KINDS, *KINDS, STOPS, GROUND, GROUND, FURNISHED, FURNISHED)  # in turn, some of them rarer
WITNESSED = random_arms.KINDS
KNOWN = ("bundled", *KINDS, STOPS, GROUND, FURNISHED, *WITNESSED)
GIVEN_UP = "given up"  # in place of a verdict
LONGEST = 60.0  # processor time for a world, twice at the most [s]
PROVEN = ("unreachable", "start-blocked", "plan-invalid")  # verdicts that a witness contradicts
PROOF = "This is a proof"  # in words
RATE, LONG = 1000.0, 900_000  # rows of a trajectory, a second and at the most
SEARCHED, EVERY = ("floor", "overhead"), 2  # where single targets are asked for: in every second of these


@dataclass(frozen=True)
class Judged:
    """What came of a world; ``wrong`` is what the second opinion has against it."""

    kind: str
    seed: int
    verdict: str  # "planned" or that of the explanation
    wrong: tuple[str, ...]
    claimed: bool = False  # said: a set-point is proven out of reach, or the start is blocked
    detours: tuple[float, ...] = ()  # lengths of its drives with the tool lifted, the shortest ones being 1
    asked: tuple[str, ...] = ()  # rules beyond the usual ones that the world has
    reach: tuple[str, ...] = ()  # verdicts on single targets
    traits: tuple[str, ...] = ()  # of a world with a witness
    doors: tuple[str, ...] = ()  # what was looked at through every door, a word for each


def _asked(world: World) -> tuple[str, ...]:
    """Which rules of a world are not in every one."""
    named = {} if world.rules.criteria is None else vars(world.rules.criteria)
    more = {"speeds": world.speeds, "face_target": world.rules.heading == "face_target"}
    return tuple(key for key, value in {**named, **more}.items() if value)


def told(made: Plan) -> tuple[dict[str, Any], str, Facts]:
    """All that the second opinion is told of a plan."""
    robot = made.world.robot
    document = plan_to_document(made)
    return document, robot_to_urdf(robot, made.world.floor.polygon), facts_of(robot)


def against(made: Plan) -> tuple[str, ...]:
    """What the second opinion has against a plan."""
    return tuple(objections(*told(made), track_of(made)))


def track_of(made: Plan) -> np.ndarray | None:
    """Rows of a timed plan's trajectory, as its exports have them: time, base and joints."""
    end = float(made.motion.time[-1])
    if np.isnan(end):
        return None
    rate = min(RATE, LONG / max(end, 1.0))
    sample = trajectory(made).sample(np.append(np.arange(np.ceil(end * rate - 1e-6)) / rate, end))
    return np.column_stack([sample.time, sample.base, sample.joints])


def counterexample(world: World, setpoint: int) -> np.ndarray | None:
    """A base pose and joint values for a set-point, found by brute force."""
    document = world_to_document(world)
    task = [{"point": point, **piece} for piece in document["task"] for point in piece["points"]]
    return find(document, machine_of(world), task[setpoint])


def against_reach(world: World, targets: list[Target]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Verdicts on targets among the obstacles of a world, and what brute force has against them."""
    answer, wrong = reach(world, targets), list[str]()
    machine, facts = machine_of(world), facts_of(world.robot)
    urdf = robot_to_urdf(world.robot, world.floor.polygon)
    for i, target in enumerate(targets):
        document = world_to_document(replace(world, task=(target,)))
        verdict, said = str(answer.verdict[i]), f"{np.round(target.position, 6).tolist()} is said to be"
        if verdict == "reachable":
            base, joints = answer.base[i].tolist(), answer.joints[i].tolist()
            machine.place(answer.base[i], answer.joints[i])
            tool = machine.tool()[:3, 3].tolist()
            state = {"base": base, "joints": joints, "tool": tool, "kind": "setpoint", "setpoint": 0}
            held = posture_objections({"world": document, "states": [state]}, urdf, facts)
            wrong += [f"{said} in reach: {text}" for text in held]
        elif verdict == "unreachable":
            asked = {"point": document["task"][0]["points"][0], **document["task"][0]}
            found = find_clear(document, machine, asked)
            if found is not None:
                there = np.round(found, 6).tolist()
                wrong.append(f"{said} out of reach: {answer.reason[i]} But {there} is there.")
    return tuple(answer.verdict.tolist()), tuple(wrong)


def hard_targets(world: World, rng: np.random.Generator) -> list[Target]:
    """A set-point of the task, and places near obstacles of a world."""
    drawn = [world.task[rng.integers(len(world.task))]]
    for _ in range(2 if world.obstacles else 0):
        solid = world.obstacles[rng.integers(len(world.obstacles))]
        shadow = solid.shadow(np.inf)
        assert shadow is not None
        middle = np.array([*shadow.core.centroid.coords[0], rng.uniform(0.1, 0.8)])
        drawn.append(Target(middle + rng.normal(0.0, [0.15, 0.15, 0.0])))
    return drawn


def blocked_at_start(world: World) -> bool:
    """Whether anything is in the way of the start, as the second opinion sees it."""
    document = world_to_document(world)
    machine = Machine(robot_to_urdf(world.robot, world.floor.polygon), facts_of(world.robot))
    course = Course({"world": document, "states": [{**document["start"], "kind": "transit"}]}, machine)
    return any(Moment(course).look(0, 0.0))


def judged(kind: str, seed: int) -> Judged:
    """Plan a world and ask for the second opinion; an exception nobody foresaw is a fault too."""
    try:
        return _judged(kind, seed)
    except Exception as error:  # the very thing that is looked for
        return Judged(kind, seed, "failed", (f"{type(error).__name__}: {error}",))


def _judged(kind: str, seed: int) -> Judged:
    if kind in WITNESSED:
        return _against_witness(witness(kind, seed), kind, seed)
    if kind == FURNISHED:
        return _through_every_door(furnished_world(seed), seed)
    world = soaked_world(kind, seed)
    one = replace(_planned(world, kind, seed), asked=_asked(world))
    if kind not in SEARCHED or seed % EVERY:
        return one
    verdicts, wrong = against_reach(world, hard_targets(world, np.random.default_rng([seed, 2])))
    return replace(one, reach=verdicts, wrong=one.wrong + wrong)


def _through_every_door(world: World, seed: int) -> Judged:
    """Plan a room, and ask for its stops, areas, field and reach."""
    one, doors = _planned(world, FURNISHED, seed), Doors(world)
    doors.areas()
    doors.field()
    doors.stops(planned=False)
    wrong = one.wrong + tuple(doors.wrong)
    if doors.seen["confirmed"] and not doors.seen["unconfirmed"] and one.verdict != "planned":
        wrong += (f"every stop is confirmed, and there is no plan: {one.verdict}",)
    return replace(one, wrong=wrong, doors=tuple(doors.seen.elements()))


def _against_witness(known: Plan, kind: str, seed: int) -> Judged:
    """Plan the world of a motion known to be free; whoever proves that there is none is wrong."""
    world = known.world
    wrong = tuple(f"its witness: {text}" for text in against(known))
    try:
        made = search(scene_of(world))
        made = made if world.speeds is None else retime(made)
        verdict, wrong = "planned", wrong + against(made)
    except NoPlanFound as failure:
        why = failure.explanation
        verdict = why.verdict
        if verdict in PROVEN or PROOF in why.reason:
            wrong += (f"said though there is a witness: {verdict}: {why.reason}",)
    except InputError as refused:
        verdict = "refused: " + str(refused).removeprefix(f"{world.name}: ")
    return Judged(kind, seed, verdict, wrong, asked=_asked(world), traits=traits_of(world))


def _planned(world: World, kind: str, seed: int) -> Judged:
    try:
        made = search(scene_of(world))
        made = made if world.speeds is None else retime(made)
    except NoPlanFound as failure:
        why = failure.explanation
        wrong: tuple[str, ...] = () if why.reason else ("no reason is given",)
        wrong += (why.reason,) if why.verdict == "plan-invalid" else ()  # a fault of the planner's
        blocked = why.verdict == "start-blocked"
        if blocked and not blocked_at_start(world):
            wrong += (f"said to be blocked at its start: {why.reason}",)
        parking = any(cause.name == "room to park" for cause in why.causes)  # in reach, but with no circle
        claimed = why.verdict == "unreachable" and not parking and why.setpoint is not None
        if claimed and why.setpoint is not None:
            found = counterexample(world, why.setpoint)
            if found is not None:
                there = np.round(found, 6).tolist()
                wrong += (f"said to be out of reach: {why.reason} But {there} is there.",)
        return Judged(kind, seed, why.verdict, wrong, claimed or blocked)
    except InputError as refused:
        return Judged(kind, seed, f"refused: {refused}", ())
    return Judged(kind, seed, "planned", against(made), detours=tuple(detours(*told(made)).values()))


def report(found: list[Judged]) -> str:
    """The results as Markdown."""
    known = [one for one in found if one.kind in WITNESSED]
    others = [one for one in found if one.kind not in WITNESSED]
    seeds = [one.seed for one in found if one.kind != "bundled"]
    drawn = f"{len(seeds)} random ones, of seeds {min(seeds)} to {max(seeds)}" if seeds else "no random ones"
    wrong_ones = [one for one in found if one.wrong]
    lines = [
        "# Random worlds and the second opinion",
        "",
        f"On {date.today()} `make soak` planned {len(found) - len(seeds)} bundled worlds and {drawn}.",
        "Pinocchio and coal judged every plan and every blocked start, brute force every proven",
        "`unreachable` of a set-point: those are the claims tested.",
        "In furnished rooms they judge stops, reach from them, areas and fields, too.",
        "What dense samples do not show is not proven.",
        f"A world that takes more than {LONGEST:g} s of processor time, twice, is given up.",
        "See `tests/soak.py` and `tests/opinion`.",
        "",
        *([*_drawn_table(others), "", *_figures(others), ""] if others else []),
        *([*_witness_tables(known), ""] if known else []),
        "Contradicted:" if wrong_ones else "None was contradicted.",
        "",
        *(f"- {_who(one)}: {text}" for one in wrong_ones for text in one.wrong),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _drawn_table(found: list[Judged]) -> list[str]:
    """Rows of worlds drawn with no plan in mind, by kind."""
    lines = ["| worlds | planned | no plan, by verdict | claims tested | drives | contradicted |"]
    lines.append("|---|---|---|---|---|---|")
    for kind in dict.fromkeys(one.kind for one in found):
        mine = [one for one in found if one.kind == kind]
        verdicts = Counter(one.verdict for one in mine)
        planned = verdicts.pop("planned", 0)
        claims, wrong = sum(one.claimed for one in mine), sum(bool(one.wrong) for one in mine)
        ways = [way for one in mine for way in one.detours]
        drives = f"{len(ways)}: {np.median(ways):.3f}, {max(ways):.3f}" if ways else "none"
        lines.append(
            f"| {kind}, {len(mine)} | {planned} | {_counted(verdicts)} | {claims} | {drives} | {wrong} |"
        )
    return lines


def _witness_tables(found: list[Judged]) -> list[str]:
    """Rows of worlds with a witness, by kind of arm, then by what else they have."""
    words = (
        "| worlds | planned | unreachable | undecided | other no's | refused | given up | planned, of all |"
    )
    head = ["", "| {} " + words, "|---|---|---|---|---|---|---|---|---|"]
    kinds = {kind: [one for one in found if one.kind == kind] for kind in WITNESSED}
    traits = sorted({trait for one in found for trait in one.traits})
    more = {trait: [one for one in found if trait in one.traits] for trait in traits}
    lines = [
        "## Arms of five to seven joints, round a motion that is free",
        "",
        "Each of these worlds was built round a witness: a motion of base and arm whose tool track is the",
        "path, which `verify` and the second opinion accept. So each has a plan, and `unreachable`, which is",
        "said of proofs only, or a blocked start would be false. The last column: how often a plan is found.",
        *[line.format("arm") for line in head],
        *(_witness_row(kind, mine) for kind, mine in kinds.items() if mine),
        _witness_row("all", found),
        *[line.format("with") for line in head],
        *(_witness_row(trait, mine) for trait, mine in more.items()),
    ]
    reasons = Counter(one.verdict.removeprefix("refused: ") for one in found if "refused" in one.verdict)
    refused = [f"Refused, {count}: {reason}" for reason, count in reasons.most_common()]
    return [*lines, *(["", *refused] if refused else [])]


def _witness_row(name: str, mine: list[Judged]) -> str:
    verdicts = Counter("refused" if "refused" in one.verdict else one.verdict for one in mine)
    first, last = ("planned", "unreachable", "undecided"), ("refused", GIVEN_UP)
    rest = Counter({verdict: n for verdict, n in verdicts.items() if verdict not in (*first, *last)})
    share = f"{100 * verdicts['planned'] / max(len(mine), 1):.1f} %"
    cells = [*(verdicts[v] for v in first), _counted(rest), *(verdicts[v] for v in last), share]
    return " | ".join([f"| {name}", str(len(mine)), *map(str, cells)]) + " |"


def _figures(found: list[Judged]) -> list[str]:
    """Sentences on what was asked besides, and how long drives are."""
    asked = Counter(key for one in found if one.verdict == "planned" for key in one.asked)
    verdicts = Counter(verdict for one in found for verdict in one.reach)
    doors = Counter(word for one in found for word in one.doors)
    return [
        f"Plans under rules that not every world has: {_counted(asked)}.",
        f"Single targets, judged by brute force that sees obstacles: {_counted(verdicts)}.",
        f"Set-points of stops, and places of areas and fields in furnished rooms: {_counted(doors)}.",
        "Drives are those with the tool lifted, as parts of the shortest way of the largest disc inside the",
        "footprint, or of a car's shortest curve, which no base can beat: median, worst.",
    ]


def _counted(numbers: Counter[str]) -> str:
    return ", ".join(f"{key} {n}" for key, n in sorted(numbers.items())) or "none"


def _who(one: Judged) -> str:
    return world_names()[one.seed] if one.kind == "bundled" else f"{one.kind} {one.seed}"


def _lines(path: Path | None) -> TextIO:
    """Where lines are added."""
    return Path(os.devnull if path is None else path).open("a")


def _read(path: Path | None) -> dict[tuple[str, int], Judged]:
    """What an earlier run of the same code kept."""
    if path is None or not path.exists():
        return {}
    found: dict[tuple[str, int], Judged] = {}
    for line in path.read_text().splitlines():
        row: dict[str, Any] = {
            key: tuple(v) if isinstance(v, list) else v for key, v in json.loads(line).items()
        }
        found[row["kind"], row["seed"]] = Judged(**row)
    return found


def main() -> int:
    """Exit code 1 where a plan or a claim was contradicted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", type=int, nargs="?", default=500, help="random ones")
    parser.add_argument("--first", type=int, default=0, help="seed of the first of each kind's turns")
    parser.add_argument("--kinds", nargs="+", choices=KNOWN, help="of all these only")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kept", type=Path, help="worlds judged, a line each, which are not judged again")
    asked = parser.parse_args()
    drawn = asked_worlds(asked.worlds, asked.first)
    worlds = [(kind, n) for kind, n in drawn if kind in (asked.kinds or [kind])]
    seen = _read(asked.kept)
    left = [world for world in worlds if world not in seen]
    with _lines(asked.kept) as lines:
        coming = bounded_calls(judged, left, asked.workers, LONGEST)
        for (kind, seed), answer in track(coming, "worlds", len(left)):
            one = _ended(kind, seed, answer) if isinstance(answer, Ended) else answer
            seen[kind, seed] = one
            print(json.dumps(asdict(one)), file=lines, flush=True)
    found = [seen[world] for world in worlds]
    text = report(found)
    if asked.output is not None:
        asked.output.write_text(text)
    print(text)
    return int(any(one.wrong for one in found))


def asked_worlds(count: int, first: int = 0) -> list[tuple[str, int]]:
    """Kind and seed of all bundled worlds and of ``count`` random ones, every second one with a witness.

    Seeds begin with the ``first``, so that runs on several days judge worlds that none has seen.
    """
    bundled = [("bundled", n) for n in range(len(world_names()))]
    seeds = range(first, first + (count + 1) // 2)
    turns = [(n, (DRAWN[n % len(DRAWN)], WITNESSED[n % len(WITNESSED)])) for n in seeds]
    return bundled + [(kind, n) for n, turn in turns for kind in turn][:count]


def _ended(kind: str, seed: int, ended: Ended) -> Judged:
    """A world whose process ended: it took too long, or it crashed."""
    if ended.overtime:
        return Judged(kind, seed, GIVEN_UP, ())
    return Judged(kind, seed, "failed", (f"its process ended with exit code {ended.exit_code}",))


if __name__ == "__main__":
    sys.exit(main())
