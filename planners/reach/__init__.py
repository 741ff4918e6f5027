"""Reach of arms at each height, bounded from inside and from outside."""
