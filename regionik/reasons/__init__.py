"""Why not: the first set-point, the obstacle, what is missing, and causes of which none can be left out."""
