"""Systems of the papers: Xu's tracker, and the rivals that M-FABRIK is compared with."""
