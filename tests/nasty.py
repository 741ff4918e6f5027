"""Broken world files, and what the one line about each must contain.

`broken` gives the text of a good world file with one thing changed, so that nothing else is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

GOOD = """\
version: 1
robot: youbot
floor: {polygon: [[-1, -1], [4, -1], [4, 2], [-1, 2]]}
obstacles:
  - {name: pillar, box: {size: [0.6, 0.6, 1.0], center: [1.3, 0.1, 0.5], yaw: 0.0}}
  - {name: post, cylinder: {radius: 0.1, height: 1.2, center: [2.0, 0.5, 0.6]}}
start: {base: [0, 0, 0], joints: [0, 1, 0, 1, 0]}
task:
  - {line: {from: [0.4, 1.5, 0.3], to: [0.8, 1.5, 0.3], count: 5}}
rules: {clearance: 0.2, step: 0.1}
"""
TASK = "{line: {from: [0.4, 1.5, 0.3], to: [0.8, 1.5, 0.3], count: 5}}"
BOX = "box: {size: [0.6, 0.6, 1.0], center: [1.3, 0.1, 0.5], yaw: 0.0}"
FLOOR = "{polygon: [[-1, -1], [4, -1], [4, 2], [-1, 2]]}"


_TURN = "[[0, -1, 0, 0.1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"


@dataclass(frozen=True)
class Nasty:
    """A broken world file."""

    name: str
    text: str
    expected: tuple[str, ...]
    suffix: str = ".yaml"


def broken(old: str, new: str) -> str:
    """The good file with one thing changed."""
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)


def solid(entry: str) -> str:
    """The good file with an arm of one link that has one solid."""
    return broken("youbot", f"{{dh: [[0, 0.1, 0, 0, -1, 1]], solids: [{{link: 0, name: fist, {entry}}}]}}")


def zoned(polygon: str, keep: str = "out") -> str:
    """The good file with a zone."""
    return f"{GOOD}zones: [{{name: zone, keep: {keep}, polygon: {polygon}}}]\n"


NASTY = (
    Nasty("empty file", "", ("expected a mapping",)),
    Nasty("a list", "[1, 2]", ("expected a mapping",)),
    Nasty("not yaml", "version: [1", ("line", "not valid YAML")),
    Nasty("not json", '{"version": 1,', ("line 1", "not valid JSON"), ".json"),
    Nasty("json nan", '{"version": NaN}', ("version", "finite"), ".json"),
    Nasty("json twice", '{"version": 1, "version": 1}', ("'version'", "twice"), ".json"),
    Nasty("json deep", "[" * 100_000, ("nested",), ".json"),
    Nasty("yaml deep", "[" * 5_000, ("levels of nesting",)),
    Nasty("yaml twice", GOOD + "version: 1\n", ("line 11", "'version'", "twice")),
    Nasty("yaml alias", broken("[0, 0, 0]", "&a [0, 0, 0]"), ("line 7", "aliases")),
    Nasty("yaml tag", broken("version: 1", "version: !!python/name:os.system 1"), ("line 1",)),
    Nasty("yaml date", broken("step: 0.1", "step: 2024-01-01"), ("rules.step", "expected a number")),
    Nasty("key of number", GOOD + "7: x\n", ("expected text as key", "7")),
    Nasty("unknown key", GOOD + "obstacle: []\n", ("unknown key 'obstacle'", "obstacles", "rules")),
    Nasty(
        "unknown inner key",
        broken("yaw: 0.0", "jaw: 0.0"),
        ("obstacles[0].box", "'jaw'", "size, center, yaw"),
    ),
    Nasty("no version", broken("version: 1\n", ""), ("missing key 'version'",)),
    Nasty("version 2", broken("version: 1", "version: 2"), ("version", "expected 1")),
    Nasty("no robot", broken("robot: youbot\n", ""), ("missing key 'robot'", "bundled name")),
    Nasty("no floor", broken(f"floor: {FLOOR}\n", ""), ("missing key 'floor'", "polygon")),
    Nasty(
        "follow of nothing",
        broken(TASK, "{arc: {center: [0, 1, 0.3], radius: 0.3, from: 0, to: 1, count: 3}, follow: true}"),
        ("task[0].follow", "direction or an orientation"),
    ),
    Nasty("unknown robot", broken("youbot", "yuobot"), ("robot", "'yuobot'", "youbot, youbot-real")),
    Nasty("robot of number", broken("youbot", "3"), ("robot", "name, dh, urdf, chain")),
    Nasty("robot of two kinds", broken("youbot", "{dh: [], urdf: a.urdf, tip: t}"), ("robot", "one of name")),
    Nasty("urdf", broken("youbot", "{urdf: a.urdf, tip: tool}"), ("robot", "a.urdf", "no such file")),
    Nasty("short dh", broken("youbot", "{dh: [[0, 0.1, 0, 0]]}"), ("robot.dh[0]", "6 values", "got 4")),
    Nasty(
        "limits swapped",
        broken("youbot", "{dh: [[0, 0.1, 0, 0, 1, -1]]}"),
        ("robot.dh[0]", "lower", "got 1 and -1"),
    ),
    Nasty(
        "car of no turning radius",
        broken("youbot", "{dh: [[0, 0.1, 0, 0, -1, 1]], base: car}"),
        ("robot.turning_radius", "a car needs", "above 0"),
    ),
    Nasty(
        "turning radius of no car",
        broken("youbot", "{dh: [[0, 0.1, 0, 0, -1, 1]], base: differential, turning_radius: 1}"),
        ("robot.turning_radius", "expected base car"),
    ),
    Nasty(
        "no such base",
        broken("youbot", "{dh: [[0, 0.1, 0, 0, -1, 1]], base: boat}"),
        ("robot.base", "'omni'"),
    ),
    Nasty(
        "long carry",
        broken("youbot", "{dh: [[0, 0.1, 0, 0, -1, 1]], carry: [0, 0]}"),
        ("robot.carry", "1 value"),
    ),
    Nasty(
        "hollow footprint",
        broken("youbot", "{dh: [[0, 0.1, 0, 0, -1, 1]], footprint: [[0, 0], [2, 0], [0.5, 0.5], [0, 2]]}"),
        ("robot.footprint", "convex"),
    ),
    Nasty("solid of no kind", solid("mass: 3"), ("robot.solids[0]", "start, end, radius", "size, position")),
    Nasty("solid of two kinds", solid("size: [1, 1, 1], radius: 1"), ("robot.solids[0]", "either start")),
    Nasty(
        "solid without a link",
        solid("size: [1, 1, 1]").replace("link: 0, ", ""),
        ("robot.solids[0]", "missing key 'link'", "number of a joint"),
    ),
    Nasty(
        "solid beyond",
        solid("size: [1, 1, 1]").replace("link: 0", "link: 1"),
        ("solids[0].link", "-1 (the base) to 0"),
    ),
    Nasty("capsule with one end", solid("start: [0, 0, 0], radius: 1"), ("solids[0]", "missing key 'end'")),
    Nasty("link box of no size", solid("position: [0, 0, 0]"), ("robot.solids[0]", "missing key 'size'")),
    Nasty("flat link box", solid("size: [1, 0, 1]"), ("robot.solids[0].size[1]", "above 0", "got 0")),
    Nasty("square link box", solid("size: [1, 1]"), ("robot.solids[0].size", "3 values", "got 2")),
    Nasty("link box askew", solid("size: [1, 1, 1], rpy: 0.3"), ("robot.solids[0].rpy", "a list", "0.3")),
    Nasty(
        "misspelt link box",
        solid("size: [1, 1, 1], centre: [0, 0, 0]"),
        ("robot.solids[0]", "'centre'", "link, name, size, position, rpy"),
    ),
    Nasty(
        "link box placed twice",
        solid(f"size: [1, 1, 1], position: [0, 0, 0], frame: {_TURN}"),
        ("robot.solids[0]", "unknown key 'position'", "link, name, size, frame"),
    ),
    Nasty(
        "mirrored link box",
        solid(f"size: [1, 1, 1], frame: {_TURN.replace('-1', '1')}"),
        ("robot.solids[0].frame", "rotation matrix"),
    ),
    Nasty(
        "frame with no last row",
        solid(f"size: [1, 1, 1], frame: {_TURN.replace('[0, 0, 0, 1]', '[0, 0, 0, 0]')}"),
        ("robot.solids[0].frame", "last row", "[0.0, 0.0, 0.0, 0.0]"),
    ),
    Nasty(
        "wrong type",
        broken("0.6, 0.6, 1.0", "0.6, wide, 1.0"),
        ("obstacles[0].box.size[1]", "a number", "'wide'"),
    ),
    Nasty(
        "true is no number", broken("step: 0.1", "step: true"), ("rules.step", "expected a number", "True")
    ),
    Nasty("nan", broken("0.6, 0.6, 1.0", "0.6, .nan, 1.0"), ("obstacles[0].box.size[1]", "finite")),
    Nasty("infinite", broken("1.3, 0.1, 0.5", "1.3, .inf, 0.5"), ("obstacles[0].box.center[1]", "finite")),
    Nasty("too big", broken("step: 0.1", "step: 1" + "0" * 400), ("rules.step", "finite")),
    Nasty("zero size", broken("0.6, 0.6, 1.0", "0.6, 0.6, 0"), ("obstacles[0].box.size[2]", "above 0")),
    Nasty("short vector", broken("1.3, 0.1, 0.5", "1.3, 0.1"), ("obstacles[0].box.center", "3", "got 2")),
    Nasty(
        "negative radius", broken("radius: 0.1", "radius: -0.1"), ("obstacles[1].cylinder.radius", "above 0")
    ),
    Nasty(
        "no kind",
        broken(BOX, "bocks: 1"),
        ("obstacles[0]", "exactly one of box, cylinder, sphere, prism, mesh"),
    ),
    Nasty("two kinds", broken(BOX, f"{BOX}, sphere: {{}}"), ("obstacles[0]", "exactly one of box")),
    Nasty("name twice", broken("post", "pillar"), ("obstacles[1].name", "'pillar'", "obstacles[0]")),
    Nasty("empty name", broken("post", "''"), ("obstacles[1].name", "not empty")),
    Nasty("name of two lines", broken("post", '"a\\nb"'), ("obstacles[1].name", "one line")),
    Nasty(
        "flat prism",
        broken(BOX, "prism: {polygon: [[0, 0], [1, 0], [1, 1]], z: [1, 1]}"),
        ("prism.z", "bottom"),
    ),
    Nasty(
        "mesh missing", broken(BOX, "mesh: {file: no.stl}"), ("obstacles[0].mesh", "no.stl", "no such file")
    ),
    Nasty("mesh of what", broken(BOX, "mesh: {file: a.txt}"), ("obstacles[0].mesh", ".stl")),
    Nasty(
        "open mesh",
        broken(
            BOX,
            "mesh: {vertices: [[0,0,0],[1,0,0],[0,1,0],[0,0,1]], faces: [[0,1,2],[0,1,3],[0,2,3],[0,1,2]]}",
        ),
        ("obstacles[0].mesh", "closed"),
    ),
    Nasty(
        "crossing floor",
        broken(FLOOR, "{polygon: [[0, 0], [1, 1], [1, 0], [0, 1]]}"),
        ("floor.polygon", "cross"),
    ),
    Nasty("floor on a line", broken(FLOOR, "{polygon: [[0, 0], [1, 1], [2, 2]]}"), ("floor.polygon",)),
    Nasty("two corners", broken(FLOOR, "{polygon: [[0, 0], [1, 1]]}"), ("floor.polygon", "3 values")),
    Nasty("no such map", broken(FLOOR, "{map: no.yaml}"), ("floor.map", "no.yaml", "no such file")),
    Nasty("empty floor", broken(FLOOR, "{}"), ("floor", "exactly one of polygon, map")),
    Nasty(
        "start too far",
        broken("[0, 1, 0, 1, 0]", "[0, 3, 0, 1, 0]"),
        ("start.joints[1]", "joint_2", "0 to 2.70526"),
    ),
    Nasty("start too short", broken("[0, 1, 0, 1, 0]", "[0, 1]"), ("start.joints", "expected 5", "joint_1")),
    Nasty("no task", broken(f"  - {TASK}\n", "  []\n"), ("task", "at least 1")),
    Nasty("task missing", broken(f"task:\n  - {TASK}\n", ""), ("missing key 'task'",)),
    Nasty("piece of no kind", broken(TASK, "{curve: 1}"), ("task[0]", "line, sine, arc, points, csv")),
    Nasty("no points", broken(TASK, "{points: []}"), ("task[0].points", "at least 1")),
    Nasty("count of 1", broken("count: 5", "count: 1"), ("task[0].line.count", "at least 2")),
    Nasty("broken count", broken("count: 5", "count: 2.5"), ("task[0].line.count", "whole number")),
    Nasty("huge count", broken("count: 5", "count: 1000000000"), ("task[0].line.count", "at most")),
    Nasty("line of no length", broken("to: [0.8", "to: [0.4"), ("task[0].line", "from and to must differ")),
    Nasty(
        "upright wave",
        broken(TASK, "{sine: {from: [0, 1, 0], to: [0, 1, 1], amplitude: 0.1, periods: 1, count: 5}}"),
        ("task[0].sine", "axis"),
    ),
    Nasty("cone alone", broken(TASK, "{points: [[0, 1, 0.3]], cone: 0.1}"), ("task[0].cone", "direction")),
    Nasty(
        "wide cone",
        broken(TASK, "{points: [[0, 1, 1]], direction: [1, 0, 0], cone: 4}"),
        ("task[0].cone", "at most"),
    ),
    Nasty(
        "no direction",
        broken(TASK, "{points: [[0, 1, 1]], direction: [0, 0, 0]}"),
        ("task[0].direction", "zero"),
    ),
    Nasty(
        "long quaternion",
        broken(TASK, "{points: [[0, 1, 1]], orientation: [1, 1, 0, 0]}"),
        ("orientation", "unit"),
    ),
    Nasty(
        "mirror",
        broken(TASK, "{points: [[0, 1, 1]], orientation: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}"),
        ("task[0].orientation", "rotation matrix"),
    ),
    Nasty(
        "aims twice",
        broken(TASK, "{points: [[0, 1, 1]], orientation: [0, 0, 0, 1], direction: [1, 0, 0]}"),
        ("task[0]", "at most one of direction, orientation"),
    ),
    Nasty("csv missing", broken(TASK, "{csv: no.csv}"), ("task[0].csv", "no.csv", "no such file")),
    Nasty(
        "inside",
        broken(TASK, "{points: [[0, 1.5, 1], [1.2, 0.1, 0.4]]}"),
        ("set-point 2 of 2", "'pillar'", "task[0]"),
    ),
    Nasty(
        "unknown heading",
        broken("step: 0.1", "heading: north"),
        ("rules.heading", "'face_target'", "'north'"),
    ),
    Nasty("no step", broken("step: 0.1", "step: 0"), ("rules.step", "above 0")),
    Nasty(
        "negative clearance", broken("clearance: 0.2", "clearance: -0.2"), ("rules.clearance", "at least 0")
    ),
    Nasty("parking", broken("step: 0.1", "mode: parking"), ("rules.mode", "continuous", "stops")),
    Nasty("any order on the way", broken("step: 0.1", "order: any"), ("rules.order", "stops", "given")),
    Nasty(
        "a stop that turns",
        broken("step: 0.1", "mode: stops, heading: face_target"),
        ("rules.heading", "face_target", "free or fixed"),
    ),
    Nasty(
        "best by luck",
        broken("step: 0.1", "stop_criterion: luck"),
        ("rules.stop_criterion", "tolerance", "manipulability"),
    ),
    *(
        Nasty(f"parking {parking}", broken("step: 0.1", f"mode: stops, parking: {{{parking}}}"), says)
        for parking, says in (
            (
                "covariance: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]",
                ("rules.parking: covariance", "below 0", "-1"),
            ),
            ("covariance: [[1, 2, 0], [2, 1, 0], [0, 0, 1]]", ("rules.parking: covariance", "below 0", "-1")),
            ("covariance: [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]", ("rules.parking: covariance", "symmetric")),
            ("covariance: [[1, 0], [0, 1]]", ("rules.parking.covariance", "3")),
            ("deviations: [0.1, -0.1, 0]", ("rules.parking: deviations", "at least 0", "-0.1")),
            ("deviations: [0, 0, 0], probability: 1", ("rules.parking.probability", "1")),
            ("probability: 0.9", ("rules.parking", "one of covariance, deviations")),
        )
    ),
    Nasty(
        "parking on the way",
        broken("step: 0.1", "step: 0.1, parking: {deviations: [0.1, 0.1, 0]}"),
        ("rules.parking", "rules.mode: stops"),
    ),
    Nasty(
        "probability of nothing",
        broken("step: 0.1", "mode: stops, stop_criterion: probability"),
        ("rules.stop_criterion", "rules.parking"),
    ),
    Nasty(
        "effort without masses",
        broken("step: 0.1", "step: 0.1, criteria: {effort: 5}"),
        ("rules: criteria: effort", "youbot has no masses", "robot.masses or robot.payload"),
    ),
    Nasty(
        "efforts of other joints",
        broken("step: 0.1", "step: 0.1, criteria: {effort: [5, 4]}"),
        ("rules: criteria: effort", "one limit, or 5", "joint_5", "got 2"),
    ),
    Nasty(
        "half of the range",
        broken("step: 0.1", "step: 0.1, criteria: {joint_margin: 0.5}"),
        ("rules.criteria.joint_margin",),
    ),
    Nasty(
        "mass of no link",
        broken("youbot", "{name: youbot, masses: [{link: 5, mass: 1}]}"),
        ("robot.masses[0].link", "from 0 to 4", "got 5"),
    ),
    Nasty(
        "negative clearance of its own",
        broken("name: post", "name: post, clearance: -0.1"),
        ("obstacles[1].clearance", "at least 0", "got -0.1"),
    ),
    Nasty(
        "clearance of text", broken("name: post", "name: post, clearance: far"), ("obstacles[1].clearance",)
    ),
    Nasty("zone of two points", zoned("[[0, 0], [1, 1]]"), ("zones[0].polygon", "3 values or more", "got 2")),
    Nasty(
        "zone that crosses itself",
        zoned("[[0, 0], [1, 1], [1, 0], [0, 1]]"),
        ("zones[0].polygon", "does not cross or touch itself"),
    ),
    Nasty(
        "zone kept nowhere", zoned("[[0, 0], [1, 0], [0, 1]]", keep="off"), ("zones[0].keep", "'in' or 'out'")
    ),
    Nasty(
        "zone for some set-points",
        zoned("[[0, 0], [1, 0], [0, 1]], setpoints: [99]"),
        ("zones[0]", "unknown key 'setpoints'", "name, keep, polygon, holes"),
    ),
    Nasty(
        "zone that is called as an obstacle",
        zoned("[[0, 0], [1, 0], [0, 1]]").replace("name: zone", "name: post"),
        ("zones[0].name", "a name of its own", "'post' is obstacles[1]"),
    ),
    Nasty(
        "zone that leaves no floor",
        zoned("[[-2, -2], [5, -2], [5, 3], [-2, 3]]"),
        ("zones", "leave some of the floor"),
    ),
    Nasty("misspelt rule", broken("step: 0.1", "stpe: 0.1"), ("rules", "'stpe'", "arm_clearance")),
)
