"""Why not: causes of which none can be left out, and the smallest changes that would make it a yes."""
