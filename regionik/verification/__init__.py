"""Plans checked from their world alone, by code of its own."""
