"""Exact base areas and whole-path planning for mobile manipulators."""
