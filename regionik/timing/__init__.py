"""From a path to a trajectory: a smooth curve, limits along it, the fastest timing, and samples of it."""
