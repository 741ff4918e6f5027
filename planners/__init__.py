"""How one part moves: arm solvers, base drives and collision distances on plain values."""
