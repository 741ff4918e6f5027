"""Parts of an area: the reach of a target, the floor as the arm axis sees it, what the rules ask."""
