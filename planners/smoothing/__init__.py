"""Smooth motion of base and arm along a whole path."""
