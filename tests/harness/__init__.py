"""Small worlds by which a planner is held against the one before it: ``python -m tests.harness``."""
