"""Explanations of failures: irreducible causes, and the smallest changes that would mend them."""
