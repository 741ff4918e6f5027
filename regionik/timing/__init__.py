"""From a path to a trajectory: a smooth path, limits along it, the fastest timing, and samples of it."""
