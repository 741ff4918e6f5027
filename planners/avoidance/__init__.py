"""Postures that keep clear: FABRIK with obstacle avoidance, searches, proofs that none exists."""
