"""Solids round links, and which of them may run into each other."""
