"""Park and work: the fewest stops, the best place of each, and the motion from stop to stop."""
