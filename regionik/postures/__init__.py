"""Base and arm at one moment: what M-FABRIK asks of an arm, and what keeps the arm off things."""
