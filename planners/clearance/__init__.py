"""What a robot touches: distances, motions proven clear, arms taken round things, searches that decide."""
