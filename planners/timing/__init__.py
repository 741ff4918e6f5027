"""Times along a path and from posture to posture."""
