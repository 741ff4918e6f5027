"""Motion of the base on its floor: any shape of footprint, every kind of wheels."""
