"""The fewest places for many areas, and short ways through places."""
