"""What there is: robots, obstacles, floors and tasks, as frozen values."""
