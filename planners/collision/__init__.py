"""Convex bodies, their distances, and robots checked for collisions in states and motions."""
