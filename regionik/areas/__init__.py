"""What an area is made of: reach of a target, the floor as the arm axis sees it, and what rules ask."""
