"""Foreign files: text, XML, meshes, CSV, maps."""
