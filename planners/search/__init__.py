"""Branch and bound: the search, bounds that hold all over a box, free postures of an arm on a fixed base."""
