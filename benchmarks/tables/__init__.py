"""Every table of the papers, recomputed."""
