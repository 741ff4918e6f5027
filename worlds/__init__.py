"""Robots, obstacles, floors and tasks, as frozen values."""
