"""Execution of timed plans: a model of robot and world, a tracking controller, disturbances, and the run."""
