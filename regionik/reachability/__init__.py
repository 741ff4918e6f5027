"""Reachability of targets, one by one, in bulk and as fields, both ways proven."""
