"""Faults planted one by one in a copy of the tree, and whether tests that pass without them catch them.

Run: python -m tests.mutations [first [last]]. Exits 1 where a fault is not caught.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic

ROOT = Path(__file__).resolve().parent.parent
PROFILE = "--hypothesis-profile=planted"  # all examples, and none that fails is made smaller
LONGEST = 900  # of a run of tests [s]
QUICK = 90  # a control that ends within this shows that a run of `LONGEST` hangs, which catches the fault too


@dataclass(frozen=True)
class Fault:
    """``old`` stands once in ``file``; with ``new`` in its place one of ``tests`` must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


FAULTS = (
    Fault(
        "obstacles: a sheet in a mesh has no shadow",
        "worlds/surfaces.py",
        "[whole, *shapely.buffer(sheets, SHEET_WIDTH)]",
        "[whole]",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "areas: an arm that heads too far off has a wedge turned inside out",
        "regionik/areas/planar_reach.py",
        "        if half <= 0:\n            return []\n",
        "",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "areas: a pivot that cannot turn leaves no outer area",
        "regionik/areas/planar_reach.py",
        "else half + ROUNDING_MARGIN",
        "else half",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "areas: an arm that faces its target turns its pivot",
        "regionik/areas/reachable.py",
        "with_pivot_limits(self.chain, *self.pivot(query.rules))",
        "with_pivot_limits(self.chain, *self.pivot(Rules()))",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "reach: an arm that cannot rise misses its own height",
        "planners/reach/level_reach.py",
        "if off > span.length + HEIGHT_TOLERANCE:",
        "if off >= span.length:",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "stops: a circle to park in is advised that is not found",
        "regionik/parking/fewest_stops.py",
        "rounded_down(OPTIONS.sure_circle_share * widest, 4)",
        "widest",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "verify: a timed motion may leave the proven one",
        "regionik/verification/speeds.py",
        "if far > most",
        "if far > np.inf",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "verify: half a turn goes to the right",
        "regionik/verification/motion.py",
        "np.ceil((angle - np.pi) / (2 * np.pi))",
        "np.floor((angle + np.pi) / (2 * np.pi))",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "verify: a stop may promise less than the rules ask for",
        "regionik/verification/stops.py",
        "if not stop.tolerance >= wanted - TOUCH:",
        "if stop.tolerance < -np.inf:",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "verify: a stop need not promise a probability",
        "regionik/verification/stops.py",
        "if asked is not None:",
        "if False:",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "verify: the base drives at work in mode stops",
        "regionik/verification/stops.py",
        "~(lifted[:-1] | lifted[1:])",
        "(lifted[:-1] & ~lifted[:-1])",
        ("tests/test_false_answers.py",),
    ),
    Fault(
        "joints turn the wrong way",
        "worlds/joints.py",
        "np.eye(3) + s * cross",
        "np.eye(3) - s * cross",
        ("tests/test_serial.py",),
    ),
    Fault(
        "verify: a joint that mimics another moves as fast as that one",
        "regionik/verification/motion.py",
        "rate = np.abs(self._all_changes[:, k])",
        "rate = np.abs(self.joint_change[:, chain.leaders[k]])",
        ("tests/test_mimic.py",),
    ),
    Fault(
        "a joint that mimics another moves the tool as that one would",
        "planners/solvers/serial_chain.py",
        "J[i, j] += ratio * twist[i]",
        "J[i, j] += twist[i]",
        ("tests/test_mimic.py",),
    ),
    Fault(
        "boxes of postures are as wide for a joint that mimics another as for that one",
        "planners/solvers/serial_chain.py",
        "np.abs(arm.ratio * change[arm.leader])",
        "np.abs(change[arm.leader])",
        ("tests/test_mimic.py",),
    ),
    Fault(
        "verify: set-points twice as loose",
        "regionik/verification/tool_path.py",
        "if off > allowed + EXACT:",
        "if off > 2 * allowed + EXACT:",
        ("tests/test_verify.py",),
    ),
    Fault(
        "verify: the path is not looked at between states",
        "regionik/verification/tool_path.py",
        "worst + bulge <= limit + BETWEEN,",
        "worst <= np.inf,",
        ("tests/test_verify.py",),
    ),
    Fault(
        "verify: joint limits passed by a little",
        "regionik/verification/limits.py",
        "np.argwhere(margin < -EXACT).tolist():\n        unit",
        "np.argwhere(margin < -0.1).tolist():\n        unit",
        ("tests/test_verify.py",),
    ),
    Fault(
        "verify: steps twice as long",
        "regionik/verification/limits.py",
        "np.flatnonzero(length > longest + EXACT)",
        "np.flatnonzero(length > 2 * longest + EXACT)",
        ("tests/test_verify.py",),
    ),
    Fault(
        "verify: one lift-off too many",
        "regionik/verification/structure.py",
        "if most is not None and runs > most:",
        "if most is not None and runs > most + 1:",
        ("tests/test_verify.py",),
    ),
    Fault(
        "verify: clearance of the base halved",
        "regionik/verification/base_clearance.py",
        "bad = distance < self.limits[solid] - EXACT",
        "bad = distance < self.limits[solid] / 2 - EXACT",
        ("tests/test_verify.py",),
    ),
    Fault(
        "verify: the floor is asked for the middle of the base",
        "regionik/verification/base_clearance.py",
        "inside = shapely.covers(grown[EXACT], shapes)",
        "inside = shapely.covers(grown[EXACT], shapely.centroid(shapes))",
        ("tests/test_single_states.py",),
    ),
    Fault(
        "verify: clearance of the arm halved",
        "regionik/verification/arm_clearance.py",
        "np.flatnonzero((distance < self.limit - TOUCH) & ~allowed)",
        "np.flatnonzero((distance < self.limit / 2 - TOUCH) & ~allowed)",
        ("tests/test_single_states.py",),
    ),
    Fault(
        "verify: planes on faces hold for the middle of a hop alone",
        "regionik/verification/arm_clearance.py",
        "(swept.hulls @ piece.normals.T).min((1, 2)) - heights",
        "(swept.hulls[:, [swept.hulls.shape[1] // 2]] @ piece.normals.T).min((1, 2)) - heights",
        ("tests/test_proof_arm.py",),
    ),
    Fault(
        "verify: a tool may sink into what it touches as deep as it likes",
        "regionik/verification/contact.py",
        "np.minimum(core, deepest) >= heights + swept.bulge - TOUCH",
        "core < np.inf",
        ("tests/test_contact.py",),
    ),
    Fault(
        "verify: the whole last link may touch, not only its tip",
        "regionik/verification/contact.py",
        "<= contact.reach + TOUCH - drift",
        "<= np.inf",
        ("tests/test_contact.py",),
    ),
    Fault(
        "planner: a tool may sink into what it touches as deep as it likes",
        "planners/collision/robot_bodies.py",
        "return depth - min(SPARE, SHARE * depth)",
        "return 9.0",
        ("tests/test_proximity.py",),
    ),
    Fault(
        "verify: links may overlap by 5 cm",
        "regionik/verification/self_collision.py",
        "if d < -TOUCH}",
        "if d < -0.05}",
        ("tests/test_single_states.py",),
    ),
    Fault(
        "verify: motion between states bends ten times less",
        "regionik/verification/motion.py",
        "return acceleration * part**2 / 8",
        "return acceleration * part**2 / 80",
        ("tests/test_motion_bounds.py", "tests/test_verify.py"),
    ),
    Fault(
        "verify: a car turns on half its radius",
        "regionik/verification/limits.py",
        "short = turn * radius * (1 - EXACT)",
        "short = turn * radius / 2",
        ("tests/test_proof_wheels.py",),
    ),
    Fault(
        "verify: the tool works on what has a box near",
        "regionik/verification/contact.py",
        "if distances and reach > 0 and min(distances)[0] <= reach:",
        "if distances:",
        ("tests/test_single_states.py",),
    ),
    Fault(
        "verify: errors of set-points are believed",
        "regionik/verification/derived_fields.py",
        "if abs(found.error - error) > ROUNDING:",
        "if abs(found.error - error) > 10.0:",
        ("tests/test_derived_fields.py",),
    ),
    Fault(
        "verify: whether set-points converged is believed",
        "regionik/verification/derived_fields.py",
        "if found.converged != close:",
        "if found.converged and not close:",
        ("tests/test_altered_plans.py",),
    ),
    Fault(
        "verify: the file of a plan keeps figures that nothing checks",
        "regionik/storage/plan_document.py",
        "json_values(stored_figures(plan.stats))",
        "json_values(plan.stats)",
        ("tests/test_altered_plans.py",),
    ),
    Fault(
        "verify: numbers of a world from outside may differ",
        "regionik/verification/world_agreement.py",
        "return abs(ours - theirs) <= EXACT if numbers",
        "return True if numbers",
        ("tests/test_altered_plans.py",),
    ),
    Fault(
        "verify: how far a base is off the floor is told of its corners",
        "planners/geometry/offsets.py",
        "some = (there + far > best + OPTIONS.depth_error)",
        "some = (there > np.inf)",
        ("tests/test_depths.py",),
    ),
    Fault(
        "kernels: machine code that is damaged is run",
        "planners/kernels.py",
        "if sha256(data[:-size]).digest() != data[-size:]:",
        "if not data:",
        ("tests/test_kernels.py",),
    ),
    Fault(
        "worlds: places may lie anywhere",
        "worlds/arrays.py",
        "if far > MAX_COORDINATE:",
        "if far > np.inf:",
        ("tests/test_world_file.py",),
    ),
    Fault(
        "verify: margins may be told larger than they are",
        "regionik/verification/derived_fields.py",
        "if not off <= ROUNDING * max(1.0, abs(computed)):",
        "if not off <= 10.0:",
        ("tests/test_derived_fields.py",),
    ),
    Fault(
        "verify: areas of another shape are believed",
        "regionik/area_verification.py",
        "np.argwhere(off > ROUNDING)",
        "np.argwhere(off > 10.0)",
        ("tests/test_derived_fields.py",),
    ),
    Fault(
        "scene: the ground is kept when obstacles change",
        "regionik/scene.py",
        '_BODY = frozenset({"robot", "floor", "obstacles", "zones", "rules"})',
        '_BODY = frozenset({"robot", "floor", "zones", "rules"})',
        ("tests/test_scene.py",),
    ),
    Fault(
        "pruning: the backward cut is skipped",
        "regionik/pruning.py",
        "keep[rung] &= _followed(keep, ladder.ahead[rung])",
        "keep[rung] &= True",
        ("tests/test_pruning.py",),
    ),
    Fault(
        "pruning: the forward cut forgets what cannot be used",
        "regionik/pruning.py",
        "keep[rung] = usable[rung] & _followed(keep, ladder.back[rung])",
        "keep[rung] = _followed(keep, ladder.back[rung])",
        ("tests/test_pruning.py",),
    ),
    Fault(
        "areas: clearance halved",
        "regionik/areas/layers.py",
        "by = self.clearance + (ROUNDING_MARGIN + self.far if inner else self.near)",
        "by = self.clearance / 2 + (ROUNDING_MARGIN + self.far if inner else self.near)",
        ("tests/test_regions.py",),
    ),
    Fault(
        "areas: a body keeps no clearance above and below",
        "regionik/areas/layers.py",
        "keep = 0.0 if inside else world.arm_clearance",
        "keep = 0.0",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "areas: posts that the footprint meets are not looked at for the column",
        "regionik/areas/layers.py",
        "covered[asked] and _stands_upright(",
        "_stands_upright(",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "areas: what a lift carries is surely where it may be",
        "worlds/body.py",
        "prism.lifted(high, low) if inside",
        "prism.lifted(low, high) if inside",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "areas: a lift stands no higher than its target",
        "worlds/body.py",
        "height + reach - down",
        "height + reach - up",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "areas: shadows of a body that are not convex reject their edges alone",
        "planners/driving/heading_slabs.py",
        "floor = shapely.intersection_all([one.floor for one in found])",
        "floor = found[0].floor",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "obstacles: a mesh has no shadow where it has no surface between two heights",
        "worlds/surfaces.py",
        "    if above <= low or below >= high:\n        return []\n",
        "    return []\n",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "drives: an outline that lies in an obstacle is free",
        "planners/driving/footprint.py",
        "if _inside_solid(upper, p, placed[0]) or not _keeps_clear",
        "if not _keeps_clear",
        ("tests/test_robot_body.py",),
    ),
    Fault(
        "areas: floors shrunk by chords of the arcs",
        "planners/geometry/offsets.py",
        "return _offset(shape, -_distance_for_more(shape, by, -1.0))",
        "return _offset(shape, -by)",
        ("tests/test_offsets.py",),
    ),
    Fault(
        "areas: shallow bays that are filled too deep go unseen",
        "planners/geometry/offsets.py",
        "if over <= DISTANCE_TOLERANCE:",
        "if over <= by:",
        ("tests/test_offsets.py",),
    ),
    Fault(
        "areas: no margin at the ends of the reach",
        "regionik/areas/planar_reach.py",
        "_ahead(owner, family.facing, spans, query)",
        "_ahead(owner, family.facing, spans, query._replace(margin=query.margin and 0.0))",
        ("tests/test_regions.py", "tests/test_laws.py"),
    ),
    Fault(
        "configurations: the heading is that of the state before",
        "regionik/mfabrik.py",
        "plane = self._yaw(base) - float(self.robot.mount[3]) + float(q[k])",
        "plane = float(base[2]) - float(self.robot.mount[3]) + float(q[k])",
        ("tests/test_laws.py",),
    ),
    Fault(
        "passes: an upper limit of a bend ignored",
        "planners/geometry/angles.py",
        "return upper, near - upper",
        "return near, 0.0",
        ("tests/test_mfabrik.py",),
    ),
    Fault(
        "motion: clearance of the arm halved",
        "planners/collision/collision_checking.py",
        "need = links.radius[k] + hulls.ball[m] + margin + ROUNDING",
        "need = links.radius[k] + hulls.ball[m] + margin / 2 + ROUNDING",
        ("tests/test_proximity.py",),
    ),
    Fault(
        "wheels: the chord lies along the heading at its end",
        "worlds/drives.py",
        "half = share * slide[..., 2] / 2",
        "half = share * slide[..., 2]",
        ("tests/test_drives.py",),
    ),
    Fault(
        "boxes turn the wrong way on the floor",
        "worlds/obstacles.py",
        "corners @ np.array([[c, s], [-s, c]]) + self.center[:2]",
        "corners @ np.array([[c, -s], [s, c]]) + self.center[:2]",
        ("tests/test_laws.py", "tests/test_verify.py"),
    ),
    Fault(
        "links: the radius of one of two is forgotten",
        "worlds/separation.py",
        "beyond = (v * w).sum(1) > (one.radius + other.radius)",
        "beyond = (v * w).sum(1) > (one.radius)",
        ("tests/test_convex_separation.py",),
    ),
    Fault(
        "export: capsules lean the wrong way",
        "regionik/output/urdf.py",
        'shape = _collision(link, f"{capsule.name} side", translation(*middle), (0.0, pitch, yaw))',
        'shape = _collision(link, f"{capsule.name} side", translation(*middle), (0.0, -pitch, yaw))',
        ("tests/test_export.py",),
    ),
    Fault(
        "obstacles: a mesh's shadow loses faces",
        "worlds/surfaces.py",
        "[*triangles[valid], *inside], grid_size=SHADOW_GRID",
        "[*triangles[valid], *inside]",
        ("tests/test_values.py",),
    ),
    Fault(
        "timing: steering takes no time",
        "regionik/timing/parametrization.py",
        "max(0.0, turned / velocity - (end[after] - end[before + 1]))",
        "0.0",
        ("tests/test_steering.py",),
    ),
    Fault(
        "stops: none is looked for where the base starts",
        "regionik/parking/stop_motion.py",
        "first = staying.from_start()",
        "first = None",
        ("tests/test_pose_reach.py",),
    ),
    Fault(
        "stops: each does what areas say and no more",
        "regionik/parking/stop_motion.py",
        "return tried if len(tried.candidates) > len(done.candidates) else done",
        "return done",
        ("tests/test_pose_reach.py",),
    ),
    Fault(
        "drives: one begins where only its heading is free, unproven",
        "regionik/moving/drivers.py",
        "if not shapely.dwithin(piece, shapely.points([a, b]), ROUNDING).all():",
        "if False:",
        ("tests/test_transit.py",),
    ),
    Fault(
        "timing: what wheels slip is no velocity",
        "regionik/timing/smooth_path.py",
        "np.column_stack([row.real, row.imag]) + slip_rate",
        "np.column_stack([row.real, row.imag]) + 0.0 * slip_rate",
        ("tests/test_jerk_limits.py",),
    ),
    Fault(
        "verify: wheels that slip do so the other way",
        "regionik/verification/timed_segments.py",
        "np.where(self.lengths[:, None] > 0, left, 0.0)",
        "np.where(self.lengths[:, None] > 0, -left, 0.0)",
        ("tests/test_jerk_limits.py",),
    ),
    Fault(
        "timing: the tool may turn as it will between two states",
        "regionik/timing/limits.py",
        "moved[:, -1] + self.pointer * turned[:, -1]",
        "moved[:, -1]",
        ("tests/test_retime.py",),
    ),
    Fault(
        "timing: jerks may be twice their limits",
        "regionik/timing/limits.py",
        "np.hypot(*jerk[:, :2].T) / s.base_jerk",
        "np.hypot(*jerk[:, :2].T) / s.base_jerk / 2",
        ("tests/test_jerk_limits.py",),
    ),
    Fault(
        "verify: jerk across the heading is left out",
        "regionik/verification/speeds.py",
        "across = product(v, twist) + 2 * product(gain, w)",
        "across = 0.0 * product(v, twist)",
        ("tests/test_jerk_limits.py",),
    ),
    Fault(
        "verify: speeds twice their limits",
        "regionik/verification/speeds.py",
        "np.flatnonzero(share > 1 + OVER)",
        "np.flatnonzero(share > 2 + OVER)",
        ("tests/test_verify_speeds.py",),
    ),
    Fault(
        "verify: accelerations at the starts of segments alone",
        "regionik/verification/speeds.py",
        "in bernstein_parts(polynomials):\n"
        "        bounds = np.maximum(bounds, np.linalg.norm(values, order, axis=2).max(axis=1))\n",
        "in [next(bernstein_parts(polynomials))]:\n"
        "        bounds = np.maximum(bounds, np.linalg.norm(values, order, axis=2)[:, 0])\n",
        ("tests/test_verify_speeds.py",),
    ),
    Fault(
        "verify: tool positions are believed",
        "regionik/verification/derived_fields.py",
        "np.flatnonzero(~(off <= ROUNDING)).tolist():\n        text = f\"the plan's tool",
        "np.flatnonzero(~(off <= 10.0)).tolist():\n        text = f\"the plan's tool",
        ("tests/test_derived_fields.py",),
    ),
    Fault(
        "verify: the rim of a stop is not looked at",
        "regionik/verification/stops.py",
        "share * (RIM * stop.tolerance)",
        "share * (RIM * 0.0)",
        ("tests/test_stops.py",),
    ),
    Fault(
        "verify: a base of stops or the tracker stands outside its area",
        "regionik/area_verification.py",
        "if not off <= ROUNDING:",
        "if not off <= 10.0:",
        ("tests/test_derived_fields.py",),
    ),
    Fault(
        "verify: the tip may be deeper in what it touches, between states",
        "regionik/verification/contact.py",
        "np.minimum(core, deepest) >= heights + swept.bulge - TOUCH",
        "np.minimum(core, deepest) >= heights - 0.02",
        ("tests/test_contact.py",),
    ),
    Fault(
        "links: two joints apart count as neighbours",
        "worlds/self_collision.py",
        "if abs(links[i] - links[k]) > 1]",
        "if abs(links[i] - links[k]) > 2]",
        ("tests/test_self_collision_pairs.py",),
    ),
    Fault(
        "smoothing: a car may leave its way",
        "regionik/smoothing/runs.py",
        "fixed[:, :3] = not scene.robot.drive.turns_on_the_spot",
        "fixed[:, :1] = not scene.robot.drive.turns_on_the_spot",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "smoothing: wheels may slip",
        "planners/smoothing/path_smoothing.py",
        "np.concatenate([miss.ravel(), -slip])",
        "np.concatenate([miss.ravel(), 0.0 * slip])",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "smoothing: plans are taken that do not hold",
        "regionik/smoothing/smooth_motion.py",
        "if failed or not report.ok:",
        "if False:",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "smoothing: states far from one that failed are smoothed again",
        "regionik/smoothing/runs.py",
        "lower[held] = upper[held] = states[rows][held]",
        "pass",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "motion on the path: the arm is not proven clear",
        "regionik/moving/path_following.py",
        "return collision.proven(bases[: count + 1], joints[: count + 1])",
        "return count, None",
        ("tests/test_path_following.py",),
    ),
    Fault(
        "motion on the path: an arm that was led round something jumps back",
        "regionik/moving/path_following.py",
        "near.joints + wished - was",
        "wished",
        ("tests/test_path_following.py",),
    ),
    Fault(
        "transits: a way with a berth is led to its ends over whatever is there",
        "regionik/moving/drivers.py",
        "return np.array([*lead, *inside, *tail])",
        "return np.array([a, *inside[1:-1], b])",
        ("tests/test_transit.py",),
    ),
    Fault(
        "resolved motion: the way on from where no area shows is not proven free",
        "regionik/moving/path_search.py",
        "if states is None or resolved is None or self._in_area(here):",
        "if True:",
        ("tests/test_path_following.py",),
    ),
    Fault(
        "resolved motion: a car turns as it will",
        "regionik/moving/resolved_states.py",
        "if not radius or not motion.any():",
        "if True:",
        ("tests/test_resolved_motion.py",),
    ),
    Fault(
        "resolved motion: a joint goes past its limit",
        "regionik/moving/resolved_states.py",
        "high[n:] = np.minimum(chain.upper - start.joints, bend)",
        "high[n:] = bend",
        ("tests/test_resolved_motion.py",),
    ),
    Fault(
        "resolved motion: links go straight into what is near",
        "regionik/moving/resolved_states.py",
        "rows += [] if near is None else self._near_rows(near, here, start, motion)",
        "pass",
        ("tests/test_resolved_motion.py",),
    ),
    Fault(
        "resolved motion: the tool turns beyond its cone",
        "regionik/moving/resolved_states.py",
        "max(turned - cone, 0.0)",
        "0.0",
        ("tests/test_resolved_motion.py",),
    ),
    Fault(
        "distances: boxes that meet say how deep bodies are",
        "planners/collision/collision_checking.py",
        "return apart - thick if apart > 0.0 else -np.inf",
        "return apart - thick",
        ("tests/test_solid_floor.py",),
    ),
    Fault(
        "mfabrik: a start on target beyond a limit is an answer",
        "regionik/mfabrik.py",
        "pivot_joints(self._limited_robot.chain, self._within(joints))",
        "pivot_joints(self._limited_robot.chain, joints)",
        ("tests/test_mfabrik.py",),
    ),
    Fault(
        "fields: an arm without a pivot counts within slabs of heading alone",
        "regionik/reachability/field.py",
        "scene.free_floor.turning.sides",
        "scene.free_floor.by_heading.sides",
        ("tests/test_lab_robots.py",),
    ),
    Fault(
        "areas: the floor is free where a torso on a lift is in a table at each height",
        "regionik/areas/layers.py",
        "layers_of(world, always, footprint, inside=True)",
        "layers_of(world, pivot_discs(robot), footprint, inside=True)",
        ("tests/test_areas_know_the_body.py",),
    ),
    Fault(
        "smoothing: a base off the floor of all slabs is drawn back to it",
        "regionik/smoothing/runs.py",
        "self._floor, ANYWHERE)",
        "self._floor, self._floor)",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "near pairs: a part of the robot hides an obstacle that is farther off",
        "planners/collision/proximity.py",
        "own, after = int(m >= hulls.world),",
        "own, after = 0,",
        ("tests/test_near_pairs.py",),
    ),
    Fault(
        "smoothing: half-spaces that a step can leave are left out",
        "planners/smoothing/path_smoothing.py",
        "np.where(half_spaces.normal > 0, lower[half_spaces.state], upper[half_spaces.state])",
        "np.where(half_spaces.normal > 0, upper[half_spaces.state], lower[half_spaces.state])",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "optimisation: accelerations may be twice their limits",
        "planners/smoothing/time_program.py",
        "np.tile(self.problem.acceleration[part], self.bend_count)",
        "np.tile(2 * self.problem.acceleration[part], self.bend_count)",
        ("tests/test_optimised_motion.py",),
    ),
    Fault(
        "optimisation: a base may drive at its stops",
        "regionik/timing/optimised_motion.py",
        'fixed[self.kind != "transit", :3] = True',
        'fixed[self.kind != "transit", :3] = False',
        ("tests/test_optimised_motion.py",),
    ),
    Fault(
        "footprint: of two corners before a wall one is looked after",
        "regionik/moving/state_constraints.py",
        "for way in (unit, lever)]",
        "for way in (unit,)]",
        ("tests/test_smoothing.py",),
    ),
    Fault(
        "closed form: one elbow of two",
        "planners/solvers/closed_form.py",
        "g), x) for x in seconds]",
        "g), x) for x in seconds[:1]]",
        ("tests/test_closed_form.py",),
    ),
    Fault(
        "closed form: half of the sweep",
        "planners/solvers/closed_form.py",
        "        return joint.lower, joint.upper\n",
        "        return joint.lower, (joint.lower + joint.upper) / 2\n",
        ("tests/test_closed_form.py",),
    ),
    Fault(
        "reach of poses: a heading that is kept counts the other way",
        "planners/reach/pose_reach.py",
        "rot_z(-heading)[:3, :3] @ aim.turn",
        "rot_z(heading)[:3, :3] @ aim.turn",
        ("tests/test_reach_model.py",),
    ),
    Fault(
        "areas: a pivot at a fixed heading turns all round",
        "regionik/areas/reachable.py",
        "if bound else None",
        "if False else None",
        ("tests/test_reach_model.py",),
    ),
    Fault(
        "transits: the arm unfolds in the order in which it was folded",
        "regionik/moving/transit.py",
        "*unfold[::-1]",
        "*unfold",
        ("tests/test_transit.py",),
    ),
    Fault(
        "transits: the base of a carried arm is led by the floor alone",
        "regionik/moving/transit.py",
        'if drive is None and name == "carry" and len(out) == len(back) == 1:',
        "if False:",
        ("tests/test_areas_know_the_body.py",),
    ),
    Fault(
        "transits: ways of the arm alone are not looked at between states",
        "regionik/postures/arm_roadmap.py",
        "return collision.passes([a, *arm_states(a, b), b])",
        "return collision.clear(b)",
        ("tests/test_transit.py",),
    ),
    Fault(
        "shortcuts: base and arm at once are not looked at",
        "regionik/moving/shortcuts.py",
        " or not self.collision.passes(part):",
        ":",
        ("tests/test_shortcuts.py",),
    ),
    Fault(
        "shortcuts: wheels slide where the base goes at another pace",
        "regionik/moving/shortcuts.py",
        "self.driver.scene.robot.drive.sampled(drives.rows, index)",
        "_rows_at(drives, share)",
        ("tests/test_shortcuts.py",),
    ),
    Fault(
        "links: faces of a moved hull stay behind",
        "worlds/polytopes.py",
        "self.offsets + normals @ T[:3, 3]",
        "self.offsets",
        ("tests/test_link_hull.py",),
    ),
    Fault(
        "verify: steering may be as fast as it will",
        "regionik/verification/speeds.py",
        "np.where(turned > STEERED, turned / (time[k[1:]] - time[k[:-1] + 1]), 0.0)",
        "np.where(turned > STEERED, 0.0, 0.0)",
        ("tests/test_verify_speeds.py",),
    ),
    Fault(
        "verify: a car steers as fast as it will while it rolls",
        "regionik/verification/speeds.py",
        "product(polyder(g, axis=1), f) - product(g, polyder(f, axis=1))",
        "product(polyder(g, axis=1), f) * 0.0",
        ("tests/test_verify_speeds.py",),
    ),
    Fault(
        "verify: a car's curvature may go beyond its lock",
        "regionik/verification/speeds.py",
        "1 - least / (far + SLIPPED)",
        "0.0 * least",
        ("tests/test_verify_speeds.py",),
    ),
    Fault(
        "timing: a car steers as fast as it will while it rolls",
        "regionik/timing/smooth_path.py",
        "radius * np.abs(twist * roll - turn * gain)",
        "0.0 * np.abs(twist * roll - turn * gain)",
        ("tests/test_steering.py",),
    ),
    Fault(
        "timing: a car that steers as it rolls may stop to roll",
        "regionik/timing/smooth_path.py",
        "stands | (steers & (ahead[:-1] != ahead[1:]))",
        "stands",
        ("tests/test_steering.py",),
    ),
    Fault(
        "outer reach of poses: the cone moves no point of the tool",
        "planners/reach/level_reach.py",
        "stray = lever * 2.0 * np.sin(cone / 2) + ROUNDING_MARGIN",
        "stray = ROUNDING_MARGIN",
        ("tests/test_fixed_points.py",),
    ),
    Fault(
        "tours of sets: the first point costs nothing to get to",
        "planners/coverage/tours.py",
        "chosen = _cheapest_through(lead[layers[0]], steps, tail[layers[-1]])",
        "chosen = _cheapest_through(0.0 * lead[layers[0]], steps, tail[layers[-1]])",
        ("tests/test_tours.py",),
    ),
    Fault(
        "tours of the arm: postures are taken as they come",
        "regionik/parking/arm_tour.py",
        "if not carrier.serves(int(branches.owner[n]), self.postures.base, joints):\n"
        "            return False",
        "if joints is None:\n            return False",
        ("tests/test_sampled_poses.py",),
    ),
    Fault(
        "the collision checker: a start with nothing to spare makes all motion touch",
        "regionik/postures/collision_checker.py",
        "spare = MAX_SPARE if room < MIN_SPARE else min(MAX_SPARE, max(MIN_SPARE, room / 2))",
        "spare = MAX_SPARE if room < MIN_SPARE else -1.0",
        ("tests/test_collision_checker.py",),
    ),
    Fault(
        "motion: runs begin at joint limits",
        "regionik/moving/configuration_sampling.py",
        "(rank, -rooms[n], here[n])",
        "(rank, rooms[n], here[n])",
        ("tests/test_configuration_sampling.py",),
    ),
    Fault(
        "floor: solids wholly under it are in the way",
        "worlds/scene.py",
        "one for one in self.obstacles if one.z_range[1] > 0 or not self.rules.solid_floor",
        "one for one in self.obstacles",
        ("tests/test_solid_floor.py",),
    ),
    Fault(
        "tasks: a set-point given again is taken again",
        "worlds/documents/tasks.py",
        "if not _is_same(task[last], task[k]) or (",
        "if True or (",
        ("tests/test_world_file.py",),
    ),
    Fault(
        "pruning: runs end within strokes",
        "regionik/pruning.py",
        "i = begin if begin > starts[-1] else i",
        "i = max(i, begin)",
        ("tests/test_pruning.py",),
    ),
    Fault(
        "motion: a run that gets stuck ends within its stroke",
        "regionik/motion.py",
        "return JoinedRun(found.way, found.steps[: first - i])",
        "return found",
        ("tests/test_strokes.py",),
    ),
    Fault(
        "verify: speeds of set-points are not looked at",
        "regionik/verification/speeds.py",
        "np.minimum(fastest[first:after], target.speed)",
        "fastest[first:after]",
        ("tests/test_feeds.py",),
    ),
    Fault(
        "timing: the tool goes to a set-point at the speed of the one before",
        "regionik/timing/limits.py",
        "np.minimum(setpoint, len(self.work_speeds))]",
        "np.minimum(setpoint, len(self.work_speeds)) - 1]",
        ("tests/test_feeds.py",),
    ),
    Fault(
        "G-code: F holds for its own move alone",
        "worlds/readers/gcode.py",
        "        self.speeds.append(self.feed if works else math.inf)\n",
        "        self.speeds.append(self.feed if works else math.inf)\n        self.feed = math.inf\n",
        ("tests/test_feeds.py",),
    ),
    Fault(
        "exports: what is fed follows the tool's way with its errors",
        "regionik/timing/extrusion.py",
        "out=np.ones_like(gone), where=whole)",
        "out=np.ones_like(gone), where=whole & (gone < 0))",
        ("tests/test_prints.py",),
    ),
    Fault(
        "exports: the tool feeds on travel",
        "regionik/timing/extrusion.py",
        "worked = np.linalg.norm(np.diff(tools, axis=0), axis=1) * on",
        "worked = np.linalg.norm(np.diff(tools, axis=0), axis=1)",
        ("tests/test_extrusion.py",),
    ),
    Fault(
        "verify: the tool works on leads",
        "regionik/verification/strokes.py",
        "in_one_stroke(one, other) and not (one.lead or other.lead)",
        "in_one_stroke(one, other) and not one.lead",
        ("tests/test_leads.py",),
    ),
    Fault(
        "paths: the tool comes to the next stroke before it leaves the last",
        "worlds/toolpath.py",
        "[first - 0.25, np.arange(n), last + 0.25]",
        "[first - 0.75, np.arange(n), last + 0.75]",
        ("tests/test_leads.py",),
    ),
    Fault(
        "verify: the tool may be lifted within strokes",
        "regionik/verification/strokes.py",
        "if len(lifted) and in_one_stroke(",
        "if len(lifted) > len(plan.motion) and in_one_stroke(",
        ("tests/test_strokes.py",),
    ),
    Fault(
        "plans: the tool works on travel",
        "regionik/values.py",
        "np.append(ahead & down[:-1]",
        "np.append(down[:-1]",
        ("tests/test_strokes.py",),
    ),
    Fault(
        "areas: obstacles keep the clearance of the rules, whatever they ask for",
        "regionik/areas/layers.py",
        "return replace(shadow, more=solid.clearance - world.rules.clearance)",
        "return shadow",
        ("tests/test_own_clearances.py",),
    ),
    Fault(
        "areas: a column keeps clear where the footprint would by the rules alone",
        "regionik/areas/layers.py",
        "asked: _is_covered(corners, world.arm_clearance - asked, footprint)",
        "asked: _is_covered(corners, world.arm_clearance - world.base_clearance, footprint)",
        ("tests/test_own_clearances.py",),
    ),
    Fault(
        "drives: obstacles keep the clearance of the rules, whatever they ask for",
        "planners/driving/footprint_scene.py",
        "(clearance + shadow.kept for shadow in shadows)",
        "(clearance + shadow.radius for shadow in shadows)",
        ("tests/test_own_clearances.py",),
    ),
    Fault(
        "verify: obstacles ask for the clearance of the rules alone",
        "regionik/verification/base_clearance.py",
        "(world.rules.clearance if solid.clearance is None else solid.clearance)",
        "world.rules.clearance",
        ("tests/test_own_clearances.py",),
    ),
    Fault(
        "why: less clearance by the rules is less of obstacles' own",
        "regionik/areas/layers.py",
        "self.clearance if self.names[k] in self.own else clearance",
        "clearance",
        ("tests/test_own_clearances.py",),
    ),
    Fault(
        "zones: one to keep out of is not taken from the floor",
        "worlds/zones.py",
        "parts = shapely.get_parts(cut(floor, self.polygon))",
        'parts = shapely.get_parts(cut(floor, self.polygon) if self.keep == "in" else floor)',
        ("tests/test_zones.py",),
    ),
    Fault(
        "verify: the base may enter zones to keep out of",
        "regionik/verification/zones.py",
        'ground = shapely.difference(around, shapely.buffer(zone.polygon, allowance, join_style="mitre"))',
        "ground = around",
        ("tests/test_zones.py",),
    ),
    Fault(
        "verify: zones take no errors of an execution",
        "regionik/verification/verifier.py",
        "yield from verify_zones(world, segments, names)",
        "yield from verify_zones(replace(world, rules=type(world.rules)()), segments, names)",
        ("tests/test_zones.py",),
    ),
    Fault(
        "scans: cells reach half a voxel back",
        "worlds/readers/voxels.py",
        "cells = np.floor(points / side)",
        "cells = np.round(points / side)",
        ("tests/test_scans.py",),
    ),
    Fault(
        "scans: plates are joined whatever is between them",
        "worlds/readers/voxels.py",
        "& (boxes[1:, 0, axis] == boxes[:-1, 1, axis])",
        "",
        ("tests/test_scans.py",),
    ),
    Fault(
        "octomap: x and y are taken for one another",
        "worlds/readers/octomap.py",
        "return x + half * (k & 1), y + half * (k >> 1 & 1)",
        "return x + half * (k >> 1 & 1), y + half * (k & 1)",
        ("tests/test_scans.py",),
    ),
    Fault(
        "kept results: a damaged file is believed",
        "worlds/disk_cache.py",
        "if sha256(content).hexdigest().encode() != digest:",
        "if not digest:",
        ("tests/test_disk_cache.py",),
    ),
    Fault(
        "kept results: the name of the function is all that a key is made of",
        "worlds/disk_cache.py",
        "[name, versions, _packed(given)]",
        "[name, versions]",
        ("tests/test_disk_cache.py",),
    ),
    Fault(
        "urdf: a prism is in its cylinder, not around it",
        "worlds/urdf/bounding.py",
        "ring = radius / np.cos(pi / sides) *",
        "ring = radius *",
        ("tests/test_urdf_collision.py",),
    ),
)


def plant(fault: Fault, tree: Path) -> None:
    """Put a fault into a tree.

    Raises
    ------
    ValueError
        When the place it goes to is not there, or there more than once.
    """
    path = tree / fault.file
    text = path.read_text()
    if text.count(fault.old) != 1:
        raise ValueError(f"{fault.name}: {fault.file}: expected once, found {text.count(fault.old)} times")
    path.write_text(text.replace(fault.old, fault.new))


def copy_of(tree: Path, folder: Path) -> Path:
    """The tree without what tools have left in it."""
    left = shutil.ignore_patterns(".git", ".venv", "__pycache__", "*.egg-info", ".*_cache", ".hypothesis")
    return Path(shutil.copytree(tree, folder / "tree", symlinks=True, ignore=left))


def run(tests: tuple[str, ...], tree: Path, kernels: str) -> int | None:
    """Exit status of some of a tree's tests, none where they hang; kernels are kept in a folder beside it."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--hypothesis-seed=0", PROFILE, *tests]
    there = {**os.environ, "PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(tree.parent / kernels)}
    try:
        done = subprocess.run(command, cwd=tree, env=there, capture_output=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode > 1:
        raise RuntimeError(f"{' '.join(tests)} did not run:\n{done.stdout.decode()[-2000:]}")
    return done.returncode


def control(tests: tuple[str, ...], tree: Path) -> float:
    """How long tests take that must pass without any fault [s].

    Raises
    ------
    RuntimeError
        When they fail or hang, and so show nothing.
    """
    begun = monotonic()
    if run(tests, tree, "kernels") != 0:
        raise RuntimeError(f"{' '.join(tests)}: fails or hangs without a fault")
    return monotonic() - begun


def caught(fault: Fault, tree: Path, sound_time: float) -> bool:
    """Whether a test fails with the fault in a tree, which is left as it was.

    A hang counts where the control is quick. Compiled kernels are kept between faults, but not those made
    with a fault in one of them: numba looks at the file that a kernel stands in, not at those that it calls.
    """
    path = tree / fault.file
    sound = path.read_text()
    plant(fault, tree)
    try:
        ended = run(fault.tests, tree, "faulty" if fault.file.startswith("planners/") else "kernels")
    finally:
        path.write_text(sound)
        shutil.rmtree(tree.parent / "faulty", ignore_errors=True)
    return sound_time <= QUICK if ended is None else ended == 1


def main() -> int:
    first, last = ([int(word) for word in sys.argv[1:3]] + [1, len(FAULTS)][len(sys.argv) - 1 :])[:2]
    missed, times = 0, dict[tuple[str, ...], float]()
    with TemporaryDirectory() as folder:
        tree = copy_of(ROOT, Path(folder))
        for k in range(first, last + 1):
            fault = FAULTS[k - 1]
            if fault.tests not in times:
                times[fault.tests] = control(fault.tests, tree)
            good = caught(fault, tree, times[fault.tests])
            missed += not good
            word = "caught" if good else "NOT CAUGHT"
            print(f"{k:2d} {word}: {fault.name} ({fault.file})", flush=True)
    print(f"{last - first + 1 - missed} of {last - first + 1} caught")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
