"""Where an arm gets to: rings and bounds at each height, proven from inside and from outside."""
