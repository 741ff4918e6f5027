"""The pieces of a motion: the tool on its path, the tool lifted, the arm round things."""
