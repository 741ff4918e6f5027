"""Speed against others, row by row: `python -m benchmarks.speed`."""
