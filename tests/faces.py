"""Inner names that tests may stand on: the doors of rooms, and values that are handed through them.

Whatever else tests use of the inside counts against them (`tests.counts`): a law that can be told through one
of these, or through public names, is told so. A name comes in only where many laws need it, and another goes.
"""

FACES = frozenset(
    f"regionik.{room}.{name}"
    for room, names in {
        # robots, worlds and their files
        "worlds.arms": "planar_arm",
        "worlds.bundled": "robot_named world_names",
        "worlds.documents.world_file": "world_from_document world_to_document",
        "worlds.errors": "Explanation FileNote",
        "worlds.links": "BASE LinkMass capsules_along",
        "worlds.readers.gcode": "read_gcode",
        "worlds.readers.occupancy_map": "load_map",
        "worlds.self_collision": "self_collision_pairs",
        # values that public functions take and hand out
        "postures.poses": "Pose",
        "values": "Answer Configuration Motion PlannedArea Report Stop Violation",
        # the scene, and stages
        "moving.drivers": "driver_for",
        "moving.transit": "TransitPlanner",
        "pipeline": "search",
        "regions": "path_areas",
        "scene": "scene_of",
        "smoothing.smooth_motion": "smooth_motion",
        "verification.motion": "MotionSegments",
        # engines
        "planners.collision.distances": "hull_separation nearest_distance obstacles_from",
        "planners.collision.proximity": "Proximity",
        "planners.solvers.multistart_ik": "ArmSolver",
        # what comes out
        "cli.app": "run",
        "output.urdf": "robot_to_urdf",
        "storage.files": "write_atomic",
    }.items()
    for name in names.split()
)
